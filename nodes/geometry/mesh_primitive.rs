//! Mesh_Primitive: simple shapes, as colliders, bodies and skins.
//!
//! Solids are closed, with faces counter-clockwise as seen from outside; the grid is open and faces up. Every shape is
//! centred on the origin and has exactly the bounds of `size`; [`numerics::shapes`] makes them.

use engine::prelude::*;
use numerics::shapes::{self, Polygons};

choice! {
    /// The shape.
    enum Solid {
        Box = "box": "a box of quads",
        Sphere = "sphere": "a sphere or ellipsoid with its poles on the y axis",
        Cylinder = "cylinder": "an upright cylinder with flat caps",
        Capsule = "capsule": "an upright cylinder with rounded caps; the length of its straight part is the height \
            minus the width",
        Grid = "grid": "a flat open sheet in x and z, facing up; the height in `size` is ignored",
        Torus = "torus": "a ring lying flat; its tube is round as long as the height is at most a third of the width",
        Bowl = "bowl": "the lower half of a hollow ellipsoid, open at the top",
        Plate = "plate": "a box with height `thickness`; the height in `size` is ignored",
    }
}

/// With this many divisions the largest shapes have 3 million vertices and take 200 MB.
const MOST_DIVISIONS: f64 = 512.0;

params! { PARAMS:
    SHAPE: Param<Solid> = Param::choice("shape", Solid::Box, "The shape.");
    SIZE: Param<[f32; 3]> = Param::vec3("size", [1.0; 3],
        "Width, height and depth of the whole shape. 0 makes it flat.").unit(Unit::Metres).at_least(0.0);
    DIVISIONS: Param<i64> = Param::int("divisions", 16,
        "Number of quads along a straight edge, or along a quarter of a circle.")
        .within(1.0, MOST_DIVISIONS).soft(1.0, 64.0);
    THICK: Param<f32> = Param::float("thickness", 0.01,
        "Wall thickness of a bowl, at its rim and at its bottom; height of a plate.")
        .unit(Unit::Metres).above(0.0).soft(0.001, 0.1)
        .when(|params| matches!(params.get(SHAPE), Solid::Bowl | Solid::Plate));
}

const MESH: Output = Output::new("mesh", &[Kind::Mesh], "The shape, with `uvw`.");

pub(crate) static NODE: Node = Node::new(
    "Mesh_Primitive",
    1,
    "A box, sphere, cylinder, capsule, grid, torus, bowl or plate, centred on the origin. Solids are closed and face \
     outwards, so they can be used as colliders or filled with tets. `uvw` is the position within the shape's \
     bounds, 0 to 1 along x, y and z.",
    Cook::Pure(cook),
)
.params(PARAMS)
.outputs(&[&MESH])
.writes(&[&P, &UVW])
.checks(check)
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let (size, thickness) = (cx.get(SIZE).map(f64::from), f64::from(cx.get(THICK)));
    let n = cx.get(DIVISIONS) as usize;
    // The most that any shape takes: 16 faces for each division squared, in f64 while it is made.
    cx.reserve(16.0 * 96.0 * (n * n) as f64, "lower `divisions`, or raise --memory")?;
    let [width, _, depth] = size;
    let (size, shape) = match cx.get(SHAPE) {
        Solid::Box => (size, shapes::block(size, [n; 3])),
        Solid::Sphere => (size, shapes::sphere(size, n)),
        Solid::Cylinder => (size, shapes::cylinder(size, n)),
        Solid::Capsule => (size, shapes::capsule(size, n)),
        Solid::Grid => ([width, 0.0, depth], shapes::grid([width, depth], n)),
        Solid::Torus => (size, shapes::torus(size, n)),
        Solid::Bowl => (size, shapes::bowl(size, thickness, n).ok_or_else(|| no_hollow(cx.params()))?),
        Solid::Plate => {
            let size = [width, thickness, depth];
            (size, shapes::block(size, [n, 1, n]))
        }
    };
    mesh(cx, size, shape)
}

/// The shape as a mesh.
fn mesh(cx: &Cx, size: [f64; 3], Polygons { counts, corners, points }: Polygons) -> Result<Outputs> {
    let positions = points.iter().map(|p| p.map(|x| x as f32)).collect();
    let mut mesh = Component::mesh(counts, corners, positions)?;
    if cx.wants(UVW) {
        // Along an axis on which the shape is flat, all points are in the middle.
        let place = |k: usize, x: f64| if size[k] > 0.0 { (x / size[k] + 0.5) as f32 } else { 0.5 };
        mesh.set(UVW, points.iter().map(|p| [0, 1, 2].map(|k| place(k, p[k]))).collect())?;
    }
    Ok(MESH.with(Geometry::from(mesh)))
}

/// Refuses a bowl whose wall fills it.
fn check(params: &Params) -> Result<()> {
    match params.get(SHAPE) == Solid::Bowl && params.get(THICK) >= hollow(params) {
        true => Err(no_hollow(params)),
        false => Ok(()),
    }
}

/// The wall thickness that fills a bowl, metres.
fn hollow(params: &Params) -> f32 {
    let [x, y, z] = params.get(SIZE);
    (0.5 * x).min(y).min(0.5 * z)
}

fn no_hollow(params: &Params) -> Error {
    let ([x, y, z], thickness, hollow) = (params.get(SIZE), params.get(THICK), hollow(params));
    Error::refused(format!("`thickness` is {thickness}, which leaves no hollow in a bowl of [{x}, {y}, {z}]"))
        .hint(format!("expected less than {hollow} m, the smallest of half the width, half the depth and the height"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};
    use engine::param::Choice;
    use numerics::vector::{self, DVec3, to_f64};

    const SOLIDS: [Solid; 7] =
        [Solid::Box, Solid::Sphere, Solid::Cylinder, Solid::Capsule, Solid::Torus, Solid::Bowl, Solid::Plate];

    fn extent(mesh: &Component) -> [f32; 3] {
        let [low, high] = mesh.bounds().unwrap();
        vector::sub(high, low)
    }

    /// Volume inside the faces, positive where they look outwards.
    fn volume(mesh: &Component) -> f64 {
        let at = |corner: u32| to_f64(mesh.positions()[corner as usize]);
        let wedge = |[a, b, c]: [DVec3; 3]| a.dot(&b.cross(&c));
        let fan = |face: &[u32]| (2..face.len()).map(|k| wedge([face[0], face[k - 1], face[k]].map(at))).sum::<f64>();
        mesh.faces().unwrap().iter().map(fan).sum::<f64>() / 6.0
    }

    #[test]
    fn a_box_of_one_division_is_a_cube_of_eight_corners() {
        let out = bench(&NODE).set(DIVISIONS, 1).set(SIZE, [2.0, 4.0, 6.0]).cook();
        assert_eq!((out.mesh().point_count(), out.mesh().element_count()), (8, 6));
        assert_eq!(out.mesh().bounds(), Some([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]]));
        assert_eq!(volume(out.mesh()), 48.0);
    }

    #[test]
    fn every_shape_fills_its_size_exactly_at_any_scale() {
        for scale in [1e-6, 1.0, 1e6] {
            let size = [0.7 * scale, 0.3 * scale, 0.9 * scale];
            for shape in SOLIDS {
                let out =
                    bench(&NODE).set(SHAPE, shape).set(SIZE, size).set(DIVISIONS, 3).set(THICK, 0.1 * scale).cook();
                let expected = if shape == Solid::Plate { [size[0], 0.1 * scale, size[2]] } else { size };
                assert_eq!(extent(out.mesh()), expected, "{shape:?}");
                assert!(volume(out.mesh()) > 0.0, "{shape:?}");
            }
        }
    }

    #[test]
    fn a_grid_is_flat_and_faces_up() {
        let out = bench(&NODE).set(SHAPE, Solid::Grid).set(DIVISIONS, 1).set(SIZE, [2.0, 9.0, 2.0]).cook();
        assert_eq!(out.mesh().positions(), [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]);
        assert_eq!(out.mesh().faces().unwrap().face(0), [0, 2, 3, 1]);
    }

    #[test]
    fn the_volume_of_a_bowl_matches_its_closed_form() {
        // Half a ball of radius 1 less half a ball of radius 0.9, to the order of 1/n².
        let out =
            bench(&NODE).set(SHAPE, Solid::Bowl).set(SIZE, [2.0, 1.0, 2.0]).set(THICK, 0.1).set(DIVISIONS, 64).cook();
        let exact = 2.0 / 3.0 * std::f64::consts::PI * (1.0 - 0.729);
        assert!((volume(out.mesh()) / exact - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_bowl_thicker_than_its_hollow_is_refused() {
        let bowl = bench(&NODE).set(SHAPE, Solid::Bowl).set(SIZE, [1.0, 0.4, 1.0]);
        let error = bowl.set(THICK, 0.4).try_cook().unwrap_err();
        assert_eq!(error.fact, "`thickness` is 0.4, which leaves no hollow in a bowl of [1, 0.4, 1]");
        assert!(error.hint.unwrap().starts_with("expected less than 0.4 m"));
    }

    #[test]
    fn thickness_affects_bowls_and_plates_only() {
        for shape in Solid::VALUES.iter().copied() {
            let cook = |thickness| bench(&NODE).set(SHAPE, shape).set(DIVISIONS, 2).set(THICK, thickness).cook();
            let differs = cook(0.1).mesh().positions() != cook(0.2).mesh().positions();
            assert_eq!(differs, matches!(shape, Solid::Bowl | Solid::Plate), "{shape:?}");
        }
    }

    #[test]
    fn uvw_is_the_position_within_the_bounds() {
        for shape in SOLIDS {
            let out = bench(&NODE).set(SHAPE, shape).set(SIZE, [0.3, 0.7, 1.1]).set(DIVISIONS, 3).cook();
            let uvw = out.mesh().get(UVW).unwrap();
            assert!(uvw.as_flattened().iter().all(|x| (0.0..=1.0).contains(x)), "{shape:?}");
            for k in 0..3 {
                assert!(uvw.iter().any(|at| at[k] == 0.0) && uvw.iter().any(|at| at[k] == 1.0), "{shape:?}");
            }
        }
        let grid = bench(&NODE).set(SHAPE, Solid::Grid).set(DIVISIONS, 1).cook();
        assert_eq!(grid.mesh().get(UVW).unwrap()[1], [1.0, 0.5, 0.0]);
    }

    #[test]
    fn shapes_of_size_zero_are_finite() {
        for shape in [Solid::Box, Solid::Sphere, Solid::Cylinder, Solid::Capsule, Solid::Torus, Solid::Grid] {
            let out = bench(&NODE).set(SHAPE, shape).set(SIZE, [0.0; 3]).set(DIVISIONS, 2).cook();
            assert!(out.mesh().positions().as_flattened().iter().all(|x| *x == 0.0), "{shape:?}");
        }
        let huge = bench(&NODE).set(SIZE, [f32::MAX; 3]).set(DIVISIONS, 2).cook();
        assert_eq!(huge.mesh().bounds(), Some([[-0.5 * f32::MAX; 3], [0.5 * f32::MAX; 3]]));
    }

    #[test]
    fn sizes_and_divisions_out_of_range_are_refused() {
        let error = |bench: conformance::Bench| bench.try_cook().unwrap_err().fact;
        assert_eq!(error(bench(&NODE).set(SIZE, [1.0, -1.0, 1.0])), "`size` is [1, -1, 1]");
        assert_eq!(error(bench(&NODE).set(DIVISIONS, 0)), "`divisions` is 0");
        assert_eq!(error(bench(&NODE).set(DIVISIONS, 513)), "`divisions` is 513");
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
