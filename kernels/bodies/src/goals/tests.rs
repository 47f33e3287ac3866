use super::*;
use crate::embedding::embed;
use crate::tets::{CagedSurface, ClosedSurface, FillSettings, PolygonSurface};
use numerics::random::Key;
use numerics::shapes::{self, Polygons};

/// A filled surface: points, tets, and the row of each point in the shape.
struct Body {
    points: Vec<[f32; 3]>,
    tets: Vec<[u32; 4]>,
    rows: Vec<i32>,
}

impl Body {
    fn filled(shape: &Polygons, spacing: f64) -> Self {
        let mut starts = vec![0];
        shape.counts.iter().for_each(|count| starts.push(starts[starts.len() - 1] + count));
        let points: Vec<_> = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
        let closed =
            ClosedSurface::of(&PolygonSurface { starts: &starts, corners: &shape.corners, points: &points }, false)
                .unwrap();
        let solid = closed.fill(&FillSettings { spacing, interior: true }).unwrap();
        let skin = points.len();
        let rows = (0..solid.points.len()).map(|k| if k < skin { k as i32 } else { -1 }).collect();
        Self { points: solid.points, tets: solid.tets, rows }
    }

    fn ball(n: usize) -> Self {
        Self::filled(&shapes::sphere([1.0; 3], n), 0.0)
    }

    /// Six corners around a centre, at distance 1 along the axes.
    fn octahedron() -> Self {
        let mut points = vec![[0.0; 3]; 7];
        for axis in 0..3 {
            points[2 * axis][axis] = 1.0;
            points[2 * axis + 1][axis] = -1.0;
        }
        let mut tets = Vec::new();
        for octant in 0..8_u32 {
            let [x, y, z] = [octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2)];
            tets.push(if octant.count_ones() % 2 == 0 { [6, x, y, z] } else { [6, y, x, z] });
        }
        Self { points, tets, rows: vec![0, 1, 2, 3, 4, 5, -1] }
    }

    fn skin(&self) -> usize {
        self.rows.iter().filter(|row| **row >= 0).count()
    }

    /// Image of the surface by a map.
    fn shape(&self, map: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f32; 3]> {
        self.points[..self.skin()].iter().map(|p| map(p.map(f64::from)).map(|x| x as f32)).collect()
    }

    fn goal(&self, shape: &[[f32; 3]]) -> GoalShape {
        self.within(shape, GoalLimits::default())
    }

    fn within(&self, shape: &[[f32; 3]], limits: GoalLimits) -> GoalShape {
        let by = HeldBy::Points { rows: &self.rows, shape };
        goal_shape(&HeldBody { points: &self.points, tets: &self.tets, by }, limits)
    }

    /// Largest distance of a point from its image by a map.
    fn away(&self, goal: &GoalShape, map: impl Fn([f64; 3]) -> [f64; 3]) -> f64 {
        let mut most = 0.0_f64;
        for (rest, point) in self.points.iter().zip(&goal.points) {
            let at = map(rest.map(f64::from));
            (0..3).for_each(|k| most = most.max((f64::from(point[k]) - at[k]).abs()));
        }
        most
    }
}

fn sheared([x, y, z]: [f64; 3]) -> [f64; 3] {
    [3.0 + 0.1 * x - 0.7 * y, 2.0 * x + 0.3 * z - 1.0, 0.4 * y + 1.3 * z + 0.5 * x]
}

#[test]
fn the_centre_of_an_octahedron_moves_to_the_mean_of_its_corners() {
    let body = Body::octahedron();
    let mut shape = body.shape(|p| p);
    shape[0] = [7.0, 0.0, 0.0];
    let out = body.goal(&shape);
    assert!((0..3).all(|k| (out.points[6][k] - [1.0, 0.0, 0.0][k]).abs() < 1e-6), "{:?}", out.points[6]);
    // Four of the eight corner tets of volume 1/6 grow by a factor of 7 + 1 over 2: 4/6·(7 + 1)/2.
    assert!((out.volume_ratio.unwrap() - 4.0).abs() < 1e-5);
    assert_eq!((out.inverted, out.loose), (0, 0));
    assert!(out.residual < 1e-10);
}

#[test]
fn a_corner_pushed_through_the_centre_inverts_its_tets() {
    let body = Body::octahedron();
    let mut shape = body.shape(|p| p);
    shape[0] = [-3.0, 0.0, 0.0];
    // The centre moves to −4/6, which is still above the opposite corner at −1.
    assert_eq!(body.goal(&shape).inverted, 4);
}

#[test]
fn affine_maps_are_reproduced_exactly() {
    let body = Body::ball(6);
    for map in [sheared, |[x, y, z]: [f64; 3]| [-x, y, z], |[x, y, z]: [f64; 3]| [1e-3 * x, 40.0 * y, z + 9.0]] {
        let out = body.goal(&body.shape(map));
        let size = out.points.as_flattened().iter().fold(0.0_f32, |most, x| most.max(x.abs()));
        assert!(body.away(&out, map) < 2e-7 * f64::from(size));
        assert_eq!(out.loose, 0);
    }
    let mirrored = body.goal(&body.shape(|[x, y, z]| [-x, y, z]));
    assert!(mirrored.inverted > body.tets.len() * 9 / 10 && (mirrored.volume_ratio.unwrap() + 1.0).abs() < 1e-6);
}

#[test]
fn the_finite_elements_reproduce_linear_functions() {
    for body in [Body::ball(6), Body::filled(&shapes::block([1.0, 0.2, 0.6], [5, 1, 3]), 0.11)] {
        let at = |point: usize| DVec3::from(sheared(body.points[point].map(f64::from)));
        let held: Vec<_> = (0..body.points.len()).map(|point| (body.rows[point] >= 0).then(|| at(point))).collect();
        let equations = Equations::of(&body.points, &body.tets, &[], &held);
        let solved = solve(&equations, GoalLimits::default());
        assert!(solved.residual <= 1e-9);
        for point in body.skin()..body.points.len() {
            let found = solved.rows[equations.free[point].unwrap() as usize];
            assert!((0..3).all(|k| (found[k] - at(point)[k]).abs() < 1e-7), "{found:?} {:?}", at(point));
        }
    }
}

#[test]
fn harmonic_maps_converge_under_refinement() {
    // Each coordinate solves Laplace's equation, so the map is its own interior.
    let bent = |[x, y, z]: [f64; 3]| [x + 0.5 * (x * x - y * y), y + 0.7 * x * z, z + 0.4 * (y * z - x * y)];
    let error = |n: usize| {
        let body = Body::ball(n);
        body.away(&body.goal(&body.shape(bent)), bent)
    };
    let (coarse, fine) = (error(4), error(10));
    assert!(coarse < 0.02 && fine < 0.4 * coarse, "{coarse} {fine}");
}

#[test]
fn a_surface_at_rest_keeps_every_bit() {
    let body = Body::ball(5);
    let out = body.goal(&body.points[..body.skin()]);
    assert_eq!(out.points, body.points);
    assert_eq!((out.steps, out.residual, out.volume_ratio, out.inverted), (0, 0.0, Some(1.0), 0));
}

#[test]
fn separate_pieces_are_independent() {
    let (one, two) = (Body::ball(4), Body::ball(5));
    let bent = |[x, y, z]: [f64; 3]| [x + 0.2 * y * y, y, z - 0.3 * x * y];
    let shift = one.points.len() as u32;
    let both = Body {
        points: [&one.points[..], &two.points].concat(),
        tets: one.tets.iter().copied().chain(two.tets.iter().map(|tet| tet.map(|k| k + shift))).collect(),
        rows: one
            .rows
            .iter()
            .copied()
            .chain(two.rows.iter().map(|row| if *row < 0 { -1 } else { row + one.skin() as i32 }))
            .collect(),
    };
    let shape = [one.shape(|p| p), two.shape(bent)].concat();
    let out = both.goal(&shape);
    assert_eq!(out.points[..one.points.len()], one.points, "the piece at rest");
    let alone = two.goal(&two.shape(bent));
    assert_eq!(out.points[one.points.len()..], alone.points, "the other one");
}

#[test]
fn points_without_constraints_stay_and_are_counted() {
    let mut body = Body::octahedron();
    body.points.extend([[5.0, 5.0, 5.0], [6.0, 5.0, 5.0], [5.0, 6.0, 5.0], [5.0, 5.0, 6.0], [9.0; 3]]);
    body.tets.push([7, 8, 9, 10]);
    body.rows.extend([-1; 5]);
    let rest = body.points.clone();
    let out = body.goal(&body.shape(|[x, y, z]| [x, 2.0 * y, z + 1.0]));
    assert_eq!(out.points[7..], rest[7..]);
    assert_eq!(out.loose, 5);
    assert!(out.points[6].iter().zip([0.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-6));
}

#[test]
fn running_out_of_iterations_is_reported() {
    let body = Body::ball(6);
    let shape = body.shape(|[x, y, z]| [x + y * y, y, z]);
    let short = body.within(&shape, GoalLimits { relative: 1e-10, steps: 2 });
    assert_eq!(short.steps, 2);
    assert!(short.residual > 1e-6 && short.residual < 1.0);
    let whole = body.goal(&shape);
    assert!(whole.steps > 2 && whole.steps < 200 && whole.residual <= 1.1e-10, "{} {}", whole.steps, whole.residual);
}

#[test]
fn degenerate_bodies_give_finite_goals() {
    let body = Body::ball(4);
    let noise = |row: usize| [0, 1, 2].map(|k| Key::new(2).of(row as u64).of(k).between([-1.0, 1.0]));
    let shapes = [body.shape(|[x, y, z]| [x + y * y, y, z]), vec![[0.5; 3]; body.skin()]];
    let rests: [Vec<[f32; 3]>; 6] = [
        vec![[0.25; 3]; body.points.len()],
        body.points.iter().map(|[x, _, z]| [*x, 0.0, *z]).collect(),
        (0..body.points.len()).map(noise).collect(),
        body.points.iter().map(|p| p.map(|x| x * 1e30)).collect(),
        body.points.iter().map(|p| p.map(|x| x * 1e-41)).collect(),
        body.points.iter().map(|[x, y, z]| [*x, *y, -z]).collect(),
    ];
    for rest in rests {
        for shape in &shapes {
            let broken = Body { points: rest.clone(), tets: body.tets.clone(), rows: body.rows.clone() };
            let out = broken.goal(shape);
            assert!(out.points.as_flattened().iter().all(|x| x.is_finite()));
            assert!(out.residual.is_finite());
        }
    }
    let none = Body { points: Vec::new(), tets: Vec::new(), rows: Vec::new() };
    let out = none.goal(&[]);
    assert_eq!((out.points.len(), out.volume_ratio, out.residual), (0, None, 0.0));
}

#[test]
fn scaling_everything_scales_the_goal() {
    let body = Body::ball(4);
    let bent = |[x, y, z]: [f64; 3]| [x + y * y, y - 0.5 * x * z, z];
    let one = body.goal(&body.shape(bent));
    for size in [1.0_f32 / 1024.0, 1024.0] {
        let scaled = |rows: &[[f32; 3]]| rows.iter().map(|row| row.map(|x| x * size)).collect::<Vec<_>>();
        let large = Body { points: scaled(&body.points), tets: body.tets.clone(), rows: body.rows.clone() };
        let out = large.goal(&scaled(&body.shape(bent)));
        assert_eq!(out.points, scaled(&one.points), "by a power of two, to the bit");
        assert_eq!((out.steps, out.inverted), (one.steps, one.inverted));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let body = Body::filled(&shapes::sphere([1.0; 3], 8), 0.045);
    assert!(body.points.len() - body.skin() > 3000, "several chunks of rows");
    let shape = body.shape(|[x, y, z]| [x + y * y, y, z - 0.3 * x * y]);
    let runs = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| body.goal(&shape))
    });
    assert!(runs[0] == runs[1] && runs[0] == runs[2]);
}

/// A ball in a cage of tets, and how its mesh rides along.
struct Caged {
    points: Vec<[f32; 3]>,
    tets: Vec<[u32; 4]>,
    carriers: Vec<EmbeddedPoint>,
    mesh: Vec<[f32; 3]>,
}

impl Caged {
    fn ball(spacing: f64) -> Self {
        let shape = shapes::sphere([1.0; 3], 8);
        let mesh: Vec<_> = shape.points.iter().map(|p| p.map(|x| x as f32)).collect();
        let mut starts = vec![0];
        shape.counts.iter().for_each(|count| starts.push(starts[starts.len() - 1] + count));
        let surface = PolygonSurface { starts: &starts, corners: &shape.corners, points: &mesh };
        let solid = CagedSurface::of(surface, spacing, false).unwrap().fill().tets;
        let carriers = embed(&solid.points, &solid.tets, &mesh).unwrap();
        Self { points: solid.points, tets: solid.tets, carriers, mesh }
    }

    fn goal(&self, shape: &[[f32; 3]]) -> GoalShape {
        let by = HeldBy::Riding { carriers: &self.carriers, rest: &self.mesh, shape };
        goal_shape(&HeldBody { points: &self.points, tets: &self.tets, by }, GoalLimits::default())
    }

    fn shape(&self, map: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<[f32; 3]> {
        self.mesh.iter().map(|p| map(p.map(f64::from)).map(|x| x as f32)).collect()
    }
}

#[test]
fn a_cage_follows_affine_maps_of_its_mesh_exactly_and_keeps_its_bits_at_rest() {
    let body = Caged::ball(0.4);
    let still = body.goal(&body.mesh);
    assert_eq!((still.points, still.steps, still.loose), (body.points.clone(), 0, 0));
    let out = body.goal(&body.shape(sheared));
    for (rest, point) in body.points.iter().zip(&out.points) {
        let at = sheared(rest.map(f64::from));
        assert!((0..3).all(|k| (f64::from(point[k]) - at[k]).abs() < 2e-6), "{point:?}, expected {at:?}");
    }
}

/// A ball of radius 1, bent by a third of it, in cages whose tets are coarser and finer than its faces (0.2).
#[test]
fn a_cage_brings_its_mesh_as_near_to_a_shape_as_its_tets_can() {
    let bent = |[x, y, z]: [f64; 3]| [x + 0.3 * y * y, y, z - 0.2 * x * y];
    for (spacing, most) in [(0.4, 5.1e-3), (0.2, 1.2e-3), (0.1, 5e-5)] {
        let body = Caged::ball(spacing);
        let shape = body.shape(bent);
        let out = body.goal(&shape);
        assert!(out.missed < most && out.missed > 0.0, "{spacing}: {:e}", out.missed);
        assert_eq!((out.inverted, out.loose), (0, 0));
        // The map's determinant is 1 everywhere.
        assert!((out.volume_ratio.unwrap() - 1.0).abs() < 1e-3, "{spacing}: {:?}", out.volume_ratio);
        assert!(out.steps < 200 && out.residual < 1e-9, "{spacing}: {} {}", out.steps, out.residual);
    }
}

#[test]
fn a_mesh_that_is_pressed_into_a_point_gives_a_finite_cage() {
    let body = Caged::ball(0.4);
    for at in [[0.5; 3], [1e30; 3]] {
        let out = body.goal(&vec![at; body.mesh.len()]);
        assert!(out.points.as_flattened().iter().all(|x| x.is_finite()) && out.residual.is_finite());
    }
}
