use numerics::shapes::{Polygons, block, grid, icosphere};
use numerics::vector::{DVec3, Vec3, add, cross, length, rotation, scale, sub, to_f32};
use numerics::volume::six_volumes;

use super::*;
use crate::open_share::open_share;

/// Points in cells, and triangles.
#[derive(Clone, Default)]
struct Mesh {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    fn of(shape: &Polygons, place: impl Fn(DVec3) -> DVec3) -> Self {
        let points = shape.points.iter().map(|p| to_f32(place(DVec3::from(*p)))).collect();
        Self { points, triangles: shape.triangles() }
    }

    fn at(shape: &Polygons, middle: Vec3) -> Self {
        Self::of(shape, |p| p + numerics::vector::to_f64(middle))
    }

    fn and(mut self, other: &Self) -> Self {
        let first = self.points.len() as u32;
        self.points.extend(&other.points);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
        self
    }

    fn turned_over(mut self) -> Self {
        self.triangles.iter_mut().for_each(|corners| corners.swap(1, 2));
        self
    }

    fn volume(&self) -> f64 {
        let corners = |[a, b, c]: &[u32; 3]| [[0.0; 3], self.at_point(*a), self.at_point(*b), self.at_point(*c)];
        self.triangles.iter().map(|triangle| six_volumes(corners(triangle))).sum::<f64>() / 6.0
    }

    fn at_point(&self, point: u32) -> Vec3 {
        self.points[point as usize]
    }

    fn topology(&self) -> ShapeTopology {
        ShapeTopology::new(&self.points, &self.triangles)
    }

    fn shape(&self, cells: i32) -> MeshShape {
        MeshShape::new(&self.topology(), &self.points, &ShapeSettings::new([0; 3], [cells; 3]))
    }

    fn collider(&self, cells: i32) -> MeshShape {
        MeshShape::new(&self.topology(), &self.points, &collider(cells))
    }
}

fn collider(cells: i32) -> ShapeSettings {
    ShapeSettings { thicken: true, ..ShapeSettings::new([0; 3], [cells; 3]) }
}

fn middles(cells: i32) -> impl Iterator<Item = (Cell, Vec3)> {
    CellRows::cuboid([0; 3], [cells; 3])
        .iter()
        .collect::<Vec<_>>()
        .into_iter()
        .map(|cell| (cell, nearest::middle(cell)))
}

/// The stored distance of a cell.
fn stored(shape: &MeshShape, cell: Cell) -> f32 {
    shape.rows().find(cell).map_or(shape.far, |at| shape.distance()[at])
}

/// The distance from a box around the origin.
fn from_box(p: Vec3, half: Vec3) -> f32 {
    let outside: Vec3 = std::array::from_fn(|axis| p[axis].abs() - half[axis]);
    length(outside.map(|x| x.max(0.0))) + outside[0].max(outside[1]).max(outside[2]).min(0.0)
}

/// Σ of the share of each cell that is inside, where the surface is flat and along its faces.
fn volume_by_shares(shape: &MeshShape) -> f64 {
    let share = |d: &f32| f64::from((0.5 - d).clamp(0.0, 1.0));
    shape.distance().iter().map(share).sum()
}

const MIDDLE: Vec3 = [24.31, 23.77, 24.12];

#[test]
fn a_ball_is_as_far_as_its_chords_allow() {
    let (radius, mesh) = (16.0, Mesh::at(&icosphere(16.0, 4), MIDDLE));
    let sagitta = mesh.triangles.iter().fold(0.0, |most: f32, corners| {
        let [a, b, c] = corners.map(|corner| mesh.at_point(corner));
        let middle = scale(add(add(a, b), c), 1.0 / 3.0);
        most.max(radius - length(sub(middle, MIDDLE)))
    });
    assert!(sagitta < 0.03);
    let shape = mesh.shape(48);
    for (cell, p) in middles(48) {
        let (found, exact) = (stored(&shape, cell), length(sub(p, MIDDLE)) - radius);
        if exact.abs() > 5.0 {
            assert!(found == 5.0_f32.copysign(exact) || (exact.abs() < 5.0 + sagitta && found.abs() > 5.0 - sagitta));
        } else {
            assert!(found >= exact - 1e-5 && found <= exact + sagitta + 1e-5, "{cell:?} {found} {exact}");
        }
    }
    let volume = volume_by_shares(&shape);
    assert!((volume / mesh.volume() - 1.0).abs() < 1e-3, "{volume} {}", mesh.volume());
}

#[test]
fn a_box_is_exact_at_faces_edges_and_corners() {
    let (size, middle) = ([12.0, 9.5, 14.0], [16.0, 15.75, 16.5]);
    let mesh = Mesh::at(&block(size, [1, 2, 3]), middle);
    let shape = mesh.shape(32);
    for (cell, p) in middles(32) {
        let exact = from_box(sub(p, middle), scale(size.map(|x| x as f32), 0.5)).clamp(-5.0, 5.0);
        assert!((stored(&shape, cell) - exact).abs() < 2e-6, "{cell:?}");
    }
    // Places on the mesh are where the distance leads to.
    for (cell, place) in shape.band().iter().zip(shape.places()) {
        let foot = place.mean(&mesh.triangles, &mesh.points);
        assert!((length(sub(nearest::middle(cell), foot)) - stored(&shape, cell).abs()).abs() < 1e-5);
    }
    let inside_out = mesh.turned_over().shape(32);
    assert!(middles(32).all(|(cell, _)| (stored(&inside_out, cell) - stored(&shape, cell)).abs() < 2e-6));
}

#[test]
fn overlapping_boxes_are_one_solid_and_a_box_turned_over_is_a_hole() {
    let (a, b) = (Mesh::at(&block([10.0; 3], [1; 3]), [12.0; 3]), Mesh::at(&block([10.0; 3], [2; 3]), [18.25; 3]));
    let both = a.clone().and(&b).shape(32);
    let in_box = |p: Vec3, middle: f32| from_box(sub(p, [middle; 3]), [5.0; 3]);
    for (cell, p) in middles(32) {
        let exact = in_box(p, 12.0).min(in_box(p, 18.25));
        // Faces of one within the other count as surface, but not as outside.
        assert_eq!(stored(&both, cell) < 0.0, exact < 0.0, "{cell:?}");
        if exact > 0.0 {
            assert!((stored(&both, cell) - exact.min(5.0)).abs() < 2e-6);
        }
    }
    let hollow = Mesh::at(&block([24.0; 3], [1; 3]), [16.0; 3]);
    let hollow = hollow.and(&Mesh::at(&block([10.0; 3], [1; 3]), [16.0; 3]).turned_over()).shape(32);
    for (cell, p) in middles(32) {
        let exact = from_box(sub(p, [16.0; 3]), [12.0; 3]).max(-in_box(p, 16.0)).clamp(-5.0, 5.0);
        assert!((stored(&hollow, cell) - exact).abs() < 2e-6, "{cell:?}");
    }
}

/// Whether liquid gets from one cell to another through faces that the solid leaves open.
fn is_connected(shape: &MeshShape, cells: i32, from: Cell, to: Cell) -> bool {
    let rows = CellRows::cuboid([0; 3], [cells; 3]);
    let mut reached = vec![false; rows.len()];
    let mut open = vec![from];
    while let Some(cell) = open.pop() {
        let Some(at) = rows.find(cell).filter(|at| !reached[*at]) else { continue };
        reached[at] = true;
        for axis in 0..3 {
            for side in [0, 1] {
                let mut face = cell;
                face[axis] += side;
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(a, b)| {
                    let mut corner = face;
                    corner[(axis + 1) % 3] += a;
                    corner[(axis + 2) % 3] += b;
                    shape.at(corner.map(|x| x as f32))
                });
                if open_share(corners) > 0.0 {
                    let mut next = cell;
                    next[axis] += 2 * side - 1;
                    open.push(next);
                }
            }
        }
    }
    rows.find(to).is_some_and(|at| reached[at])
}

#[test]
fn thin_shells_and_open_sheets_of_any_direction_do_not_leak() {
    let middle = [14.2, 13.9, 14.4];
    let ball = |radius: f64| Mesh::at(&icosphere(radius, 3), middle);
    let (inner, outer) = ([14; 3], [1; 3]);
    let shell = ball(10.0).and(&ball(9.9).turned_over());
    assert!(is_connected(&shell.shape(28), 28, inner, outer), "a thin shell leaks if it is not thickened");
    assert!(!is_connected(&shell.collider(28), 28, inner, outer));
    let mut sheet = ball(10.0);
    sheet.triangles.pop();
    assert_eq!(sheet.topology().open_triangles(), sheet.triangles.len());
    assert!(sheet.shape(28).rows().is_empty());
    assert!(!is_connected(&sheet.collider(28), 28, inner, outer));
    // Two layers without anything between them.
    let flat = ball(10.0).and(&ball(10.0).turned_over());
    assert!(!is_connected(&flat.collider(28), 28, inner, outer));
    // A solid that is thick is left as it is.
    assert_eq!(ball(10.0).collider(28).distance(), ball(10.0).shape(28).distance());
}

#[test]
fn every_line_of_cells_through_a_thin_plate_meets_it() {
    let axis = DVec3::new(0.6, 0.0, 0.8);
    for (turn, offset) in [(0.0, 0.0), (0.0, 0.5), (0.0, 0.23), (0.3, 0.1), (0.7, 0.4)] {
        let place = |p: DVec3| rotation(axis, turn) * p + DVec3::new(12.0, 12.0 + offset, 12.0);
        let plate = Mesh::of(&block([60.0, 0.1, 60.0], [3, 1, 3]), place);
        let sheet = Mesh::of(&grid([60.0, 60.0], 3), place);
        for shape in [plate.collider(24), sheet.collider(24)] {
            for (x, z) in (0..24).flat_map(|x| (0..24).map(move |z| (x, z))) {
                // Lines that leave the domain before they meet the plate do not count.
                let side = |y: i32| {
                    (rotation(axis, -turn)
                        * (numerics::vector::to_f64(nearest::middle([x, y, z]))
                            - DVec3::new(12.0, 12.0 + offset, 12.0)))
                    .y
                };
                if side(0) < -0.1 && side(23) > 0.1 {
                    assert!((0..24).any(|y| stored(&shape, [x, y, z]) < 0.0), "{turn} {offset} {x} {z}");
                }
            }
            // It grows no thicker than needed: √3 of a cell, and a margin on each side.
            let inside = |(cell, p): &(Cell, Vec3)| {
                let across =
                    (rotation(axis, -turn) * (numerics::vector::to_f64(*p) - DVec3::new(12.0, 12.0 + offset, 12.0))).y;
                stored(&shape, *cell) >= 0.0 || across.abs() < 1.03
            };
            assert!(middles(24).all(|middle| inside(&middle)));
        }
    }
}

#[test]
fn a_mesh_that_translates_is_exact_at_any_time() {
    let way = [5.3, -3.2, 0.7];
    let mesh = Mesh::at(&block([8.0, 6.0, 7.0], [2; 3]), [12.0, 18.0, 16.0]);
    let end: Vec<Vec3> = mesh.points.iter().map(|p| add(*p, way)).collect();
    let moving = MovingShape::new(&mesh.topology(), &mesh.points, &end, &collider(32));
    assert_eq!(moving.poses(), 5);
    assert!(!moving.is_capped());
    for share in [0.0, 0.1, 0.25, 0.4, 0.77, 1.0] {
        let middle = add([12.0, 18.0, 16.0], scale(way, share));
        for (_, p) in middles(32).step_by(7) {
            let exact = from_box(sub(p, middle), [4.0, 3.0, 3.5]);
            // Trilinear between middles: exact but near edges and corners, where it rounds them off.
            if exact.abs() < 2.5 {
                let error = (moving.distance(share, p) - exact).abs();
                assert!(error < 0.45, "{share} {p:?} {error}");
                let v = moving.velocity(share, p);
                assert!(length(sub(v, way)) < 1e-5, "{share} {v:?}");
            }
        }
        // Off edges it is exact.
        for step in 0..9 {
            let across = -2.0 + 0.5 * step as f32;
            let p = add(middle, [0.3, 3.0 + across.max(-1.0), -0.2]);
            assert!((moving.distance(share, p) - across.max(-1.0)).abs() < 1e-5);
        }
    }
    let next: Vec<Vec3> = end.iter().map(|p| sub(*p, way)).collect();
    let (after, anew) =
        (moving.next_frame(&mesh.topology(), &next), MovingShape::new(&mesh.topology(), &end, &next, &collider(32)));
    for (_, p) in middles(32).step_by(97) {
        assert_eq!(after.distance(0.3, p), anew.distance(0.3, p));
        assert_eq!(after.velocity(0.3, p), anew.velocity(0.3, p));
    }
    assert_eq!(after.next_frame(&mesh.topology(), &next).poses(), 1);
}

#[test]
fn a_mesh_that_turns_has_the_velocity_of_its_closest_place() {
    let (middle, turn) = ([16.0; 3], 0.02);
    let shape = block([14.0, 10.0, 12.0], [4; 3]);
    let place = |turn: f64| Mesh::of(&shape, |p| rotation(DVec3::y(), turn) * p + DVec3::repeat(16.0));
    let (start, end) = (place(0.0), place(turn));
    let moving = MovingShape::new(&start.topology(), &start.points, &end.points, &ShapeSettings::new([0; 3], [32; 3]));
    let spin = [0.0, turn as f32, 0.0];
    // Flat parts of a face: the mean of the closest places is the closest place.
    for (y, z) in (-3..=3).flat_map(|y| (-3..=3).map(move |z| (y as f32, z as f32))) {
        let exact = cross(spin, [7.0, y, z]);
        let v = moving.velocity(0.0, add(middle, [7.2, y, z]));
        // The chord of the turn in a frame, not its tangent: less by a share of turn², and turned by half of turn.
        assert!(length(sub(v, exact)) < 0.52 * turn as f32 * length(exact), "{v:?} {exact:?}");
    }
    let chord =
        |p: Vec3| to_f32(rotation(DVec3::y(), turn) * numerics::vector::to_f64(p) - numerics::vector::to_f64(p));
    let v = moving.velocity(0.0, add(middle, [7.5, 1.5, 2.5]));
    assert!(length(sub(v, chord([7.0, 1.5, 2.5]))) < 1e-5);
}

#[test]
fn a_sweep_is_the_way_along_the_normal() {
    let moved = |mesh: &Mesh, way: Vec3| {
        let end: Vec<Vec3> = mesh.points.iter().map(|p| add(*p, way)).collect();
        MovingShape::new(&mesh.topology(), &mesh.points, &end, &collider(24))
    };
    let near = [[0; 3], [24; 3]];
    let sheet = Mesh::at(&grid([60.0; 2], 5), [12.0, 6.4, 12.0]);
    assert!(moved(&sheet, [7.0, 0.0, 3.0]).sweep_near(near) < 1e-5);
    assert!((moved(&sheet, [7.0, 2.0, 3.0]).sweep_near(near) - 2.0).abs() < 1e-5);
    let ball = moved(&Mesh::at(&icosphere(3.0, 3), [6.0; 3]), [9.0, 0.0, 0.0]);
    assert!((0.97..=1.0).contains(&(ball.sweep_near(near) / 9.0)));
    // Where it never comes near the cells it does not count.
    assert_eq!(ball.sweep_near([[4, 18, 4], [20, 24, 20]]), 0.0);
    assert_eq!(moved(&sheet, [0.0; 3]).sweep_near(near), 0.0);
}

#[test]
fn a_thin_plate_stays_closed_while_it_moves() {
    let plate = Mesh::at(&block([60.0, 0.1, 60.0], [3, 1, 3]), [12.0, 6.4, 12.0]);
    let end: Vec<Vec3> = plate.points.iter().map(|p| add(*p, [0.0, 11.0, 0.0])).collect();
    let moving = MovingShape::new(&plate.topology(), &plate.points, &end, &collider(24));
    for n in 0..=40 {
        let share = n as f32 / 40.0;
        let (at, y) = (|y: f32| moving.distance(share, [11.3, y, 12.8]), 6.4 + 11.0 * share);
        assert!(
            at(y) < 0.02 && at(y - 1.6) > 0.4 && at(y + 1.6) > 0.4,
            "{share} {} {} {}",
            at(y),
            at(y - 1.6),
            at(y + 1.6)
        );
        assert!((0..24).any(|y| at(y as f32) < 0.0), "{share}");
    }
}

#[test]
fn invalid_and_degenerate_triangles_give_numbers() {
    let ball = Mesh::at(&icosphere(6.0, 2), [12.0; 3]);
    let mut broken = ball.clone();
    broken.points.extend([[f32::NAN; 3], [12.0; 3], [f32::INFINITY, 0.0, 0.0], [13.0, 12.0, 12.0], [12.5, 12.0, 12.0]]);
    let first = ball.points.len() as u32;
    let odd = [[first, 0, 1], [first + 1; 3], [first + 2, 3, 4], [first + 1, first + 3, first + 4]];
    broken.triangles.extend(odd);
    for settings in [ShapeSettings::new([0; 3], [24; 3]), collider(24)] {
        let shape = MeshShape::new(&broken.topology(), &broken.points, &settings);
        assert!(shape.distance().iter().all(|d| d.abs() <= 5.0));
        let moving = MovingShape::new(&broken.topology(), &ball_to(&broken), &broken.points, &settings);
        for (_, p) in middles(24).step_by(31) {
            assert!(moving.distance(0.4, p).is_finite() && moving.velocity(0.4, p).iter().all(|v| v.is_finite()));
        }
    }
    // A closed mesh with a corner that is not finite: what is left is no solid beyond it.
    let mut torn = ball.clone();
    let topology = torn.topology();
    torn.points[0] = [f32::NAN; 3];
    let shape = MeshShape::new(&topology, &torn.points, &ShapeSettings::new([0; 3], [24; 3]));
    assert!(shape.distance().iter().all(|d| d.is_finite()));
    assert!(shape.rows().bounds().is_some_and(|(low, high)| low >= [0; 3] && high[0] <= 24));
    assert!(middles(24).all(|(cell, p)| stored(&shape, cell) > 0.0 || length(sub(p, [12.0; 3])) < 6.0));
    let empty = Mesh::default();
    assert!(empty.shape(24).rows().is_empty());
    assert_eq!(empty.shape(24).at([3.0, 99.0, -5.0]), 5.0);
}

/// The same points, a little to the side.
fn ball_to(mesh: &Mesh) -> Vec<Vec3> {
    mesh.points.iter().map(|p| add(*p, [0.3, 0.0, -0.4])).collect()
}

#[test]
fn a_mesh_outside_the_domain_stores_nothing_and_one_around_it_is_inside_everywhere() {
    for middle in [[1e9, 0.0, 0.0], [8.0, -60.0, 8.0], [8.0, 8.0, 40.0]] {
        let shape = Mesh::at(&icosphere(16.0, 2), middle).shape(16);
        assert!(shape.rows().is_empty() && shape.places().is_empty(), "{middle:?}");
    }
    let around = Mesh::at(&block([1e6; 3], [1; 3]), [8.0; 3]).shape(16);
    assert_eq!((around.rows().len(), around.band().len()), (16 * 16 * 16, 0));
    assert!(around.distance().iter().all(|d| *d == -5.0));
    // What is cut by the domain's side is as if it went on.
    let cut = Mesh::at(&block([20.0; 3], [1; 3]), [0.0, 8.0, 8.0]).shape(16);
    for (cell, p) in middles(16) {
        let exact = from_box(sub(p, [0.0, 8.0, 8.0]), [10.0; 3]).clamp(-5.0, 5.0);
        assert!((stored(&cut, cell) - exact).abs() < 2e-6);
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mesh = Mesh::at(&icosphere(10.0, 3), [16.2, 15.9, 16.4]);
    let mesh = mesh.and(&Mesh::at(&grid([20.0; 2], 5), [16.0; 3]));
    let end = ball_to(&mesh);
    let run = || {
        let moving = MovingShape::new(&mesh.topology(), &mesh.points, &end, &collider(32));
        let [_, last] = moving.ends();
        let bits = last.distance().iter().map(|d| d.to_bits()).chain(last.places().iter().map(|place| place.triangle));
        let velocities: Vec<Vec3> = middles(32).step_by(13).map(|(_, p)| moving.velocity(0.3, p)).collect();
        (bits.collect::<Vec<_>>(), last.rows().clone(), velocities)
    };
    let on = |threads: usize| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(run);
    let expected = on(1);
    assert!(expected.0.len() > 10_000);
    assert_eq!(on(2), expected);
    assert_eq!(on(7), expected);
}
