//! Transform: translates, rotates and scales a geometry.
//!
//! It scales, then rotates about `pivot`, then translates; in f64, rounded once. It transforms `P`; `v` as a vector;
//! `N` so that it stays perpendicular and outward; `orient` by the rotation alone, as a quaternion cannot hold a scale;
//! `width` and `thickness` as lengths, by the cube root of the change in volume. All other attributes pass through,
//! `Pref` and `uvw` on purpose: they hold rest positions and texture coordinates, so that noise and textures stay
//! attached.
//!
//! A mirroring scale reverses the winding of faces and tets, so that outside stays outside. The motion of an animated
//! Transform is not added to `v`. A volume's grid is aligned with the axes: it can be translated and scaled uniformly;
//! anything else is refused.

use engine::geometry::{Grid, SparseField, Table};
use engine::prelude::*;
use numerics::affine::Affine;
use std::sync::Arc;

inputs! { INPUTS:
    GEOMETRY: Input = Input::any("geometry", "The geometry to transform.");
}

params! { PARAMS:
    TRANSLATE: Param<[f64; 3]> = Param::dvec3("translate", [0.0; 3], "Translation, applied last.").unit(Unit::Metres);
    ROTATE: Param<Turn> = Param::rotation("rotate",
        "Rotation about the pivot: about x, then y, then z. Between two keys it is interpolated about one common axis.");
    SCALE: Param<[f64; 3]> = Param::dvec3("scale", [1.0; 3],
        "Scale along x, y and z about the pivot, applied first. Negative values mirror, 0 flattens.").soft(0.01, 100.0);
    PIVOT: Param<[f64; 3]> = Param::dvec3("pivot", [0.0; 3],
        "The point that rotation and scale leave in place.").unit(Unit::Metres).when(is_linear);
}

const MOVED: Output = Output::like("geometry", &GEOMETRY, "The transformed geometry.");

pub(crate) static NODE: Node = Node::new(
    "Transform",
    1,
    "Scales, then rotates, then translates a geometry of any kind. Velocities, normals, orientations and widths are \
     transformed too; rest positions and texture coordinates stay. Faces of a mirrored mesh still face outwards.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&MOVED])
.reads(&[&P])
.writes(&[&P])
.attributes(|_| {
    // Only existing attributes are changed, so they are read as well.
    [(); 2].map(|()| AttrNames::These(FOLLOWING.map(Name::from).to_vec()))
})
.neutral(|params, _| {
    let affine = affine(params, params.get(TRANSLATE), params.get(PIVOT));
    affine.is_identity().then_some("it is the identity")
});

/// Attributes that a scale or a rotation changes.
const FOLLOWING: [&str; 5] = [V.name, N.name, ORIENT.name, WIDTH.name, THICKNESS.name];

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut geometry = cx.input(GEOMETRY).clone();
    let affine = affine(cx.params(), cx.get(TRANSLATE), cx.get(PIVOT));
    for kind in Kind::ALL {
        if let Some(part) = geometry.part(kind) {
            geometry.put(moved(part, &affine)?);
        }
    }
    if let Some(volume) = geometry.volume() {
        let moved = moved_volume(volume, &affine, cx)?;
        geometry.put_volume(moved);
    }
    Ok(MOVED.with(geometry))
}

fn affine(params: &Params, translate: [f64; 3], pivot: [f64; 3]) -> Affine {
    Affine::new(params.get(SCALE), params.get(ROTATE).0, pivot, translate)
}

fn is_linear(params: &Params) -> bool {
    affine(params, [0.0; 3], [0.0; 3]).is_linear()
}

/// The transformed component; columns that do not change are shared.
fn moved(part: &Component, affine: &Affine) -> Result<Component> {
    let mut part = if affine.mirrors() { turned_round(part)? } else { part.clone() };
    if let Some(rows) = part.edit(P) {
        affine.points(rows);
    }
    if affine.is_linear() {
        for owner in Owner::ALL {
            follow(&mut part, owner, V, |rows| affine.vectors(rows));
            follow(&mut part, owner, N, |rows| affine.normals(rows));
            follow(&mut part, owner, ORIENT, |rows| affine.orientations(rows));
            if affine.size() != 1.0 {
                follow(&mut part, owner, WIDTH, |rows| affine.lengths(rows));
                follow(&mut part, owner, THICKNESS, |rows| affine.lengths(rows));
            }
        }
    }
    Ok(part)
}

/// Changes the rows of an attribute of `owner`: faces may have normals, curves a width.
fn follow<T: Item>(part: &mut Component, owner: Owner, attribute: Attr<T>, change: impl Fn(&mut [T])) {
    if part.table(owner).get::<T>(attribute.name).is_some() {
        let attribute = match owner {
            Owner::Point => Attr::point(attribute.name),
            Owner::Element => Attr::element(attribute.name),
            Owner::Once => Attr::once(attribute.name),
        };
        part.edit(attribute).map(change);
    }
}

/// The component with the winding of faces and tets reversed; each face keeps its first corner.
fn turned_round(part: &Component) -> Result<Component> {
    let topology = match part.topology() {
        Topology::Mesh(faces) => {
            let mut corners = faces.corners.clone();
            faces.runs.ranges().for_each(|face| corners[face.start + 1..face.end].reverse());
            Topology::Mesh(Arc::new(Faces { runs: faces.runs.clone(), corners }))
        }
        Topology::Tets(tets) => Topology::Tets(Arc::new(tets.iter().map(|[a, b, c, d]| [*a, *b, *d, *c]).collect())),
        other => other.clone(),
    };
    let tables: [Table; 3] = Owner::ALL.map(|owner| part.table(owner).clone());
    Ok(Component::from_tables(topology, tables)?)
}

/// The volume with its grid transformed.
///
/// # Errors
/// If the grid would no longer be aligned with the axes, or its cells would not be cubes.
fn moved_volume(volume: &Volume, affine: &Affine, cx: &Cx) -> Result<Volume> {
    let [x, y, z] = cx.get(SCALE);
    let turned = cx.get(ROTATE).0[..3].iter().any(|x| *x != 0.0);
    if turned || x != y || y != z || x <= 0.0 {
        let refused = if turned { "rotated" } else { "scaled non-uniformly, by 0 or by a negative number" };
        return Err(Error::refused(format!("a volume cannot be {refused}: its grid is aligned with the axes"))
            .hint("transform the geometry that it is made from, or its surface"));
    }
    let moved = |grid: Grid| {
        let mut origin = [grid.origin];
        affine.points(&mut origin);
        Grid { origin: origin[0], cell: (f64::from(grid.cell) * affine.size()) as f32, size: grid.size }
    };
    let scaled = |field: &SparseField| {
        let mut field = field.clone();
        if affine.size() != 1.0 {
            field.edit(|x| {
                let mut x = [x];
                affine.lengths(&mut x);
                x[0]
            });
        }
        field
    };
    let velocity = volume.velocity().each_ref().map(scaled);
    let (level_grid, velocity_grid) = (moved(volume.level_grid()), moved(volume.velocity_grid()));
    let mut result = Volume::from_fields(level_grid, scaled(volume.level_set()), velocity_grid, velocity)?;
    *result.once_mut() = volume.once().clone();
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};
    use engine::param::{Value, euler_to_turn};

    fn degrees(x: f64, y: f64, z: f64) -> Turn {
        let Value::Turn(turn) = euler_to_turn([x, y, z]) else { panic!("a rotation") };
        Turn(turn)
    }

    fn triangle() -> Component {
        let mut mesh =
            Component::mesh(vec![3], vec![0, 1, 2], vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        mesh.set(N, vec![[0.0, 0.0, 1.0]; 3]).unwrap();
        mesh.set(V, vec![[1.0, 2.0, 3.0]; 3]).unwrap();
        mesh.set(PREF, vec![[7.0; 3]; 3]).unwrap();
        mesh.set(WIDTH, vec![0.5; 3]).unwrap();
        mesh.set(Attr::<f32>::point("mask"), vec![0.1, 0.2, 0.3]).unwrap();
        mesh.set(Attr::<[f32; 3]>::element("N"), vec![[0.0, 0.0, 1.0]]).unwrap();
        mesh
    }

    fn close(a: &[[f32; 3]], b: &[[f32; 3]]) -> bool {
        a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-6)
    }

    #[test]
    fn scales_then_rotates_then_translates() {
        let out = bench(&NODE)
            .input(GEOMETRY, triangle())
            .set(SCALE, [2.0, 1.0, 1.0])
            .set(ROTATE, degrees(0.0, 0.0, 90.0))
            .set(TRANSLATE, [10.0, 0.0, 0.0])
            .cook();
        assert!(close(out.mesh().positions(), &[[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [9.0, 0.0, 0.0]]));
        assert!(close(&out.mesh().get(V).unwrap()[..1], &[[-2.0, 2.0, 3.0]]));
        assert!(close(out.mesh().get(Attr::<[f32; 3]>::element("N")).unwrap(), &[[0.0, 0.0, 1.0]]));
    }

    #[test]
    fn the_pivot_stays_where_it_is() {
        let pivot = [1.0, 0.0, 0.0];
        let out = bench(&NODE)
            .input(GEOMETRY, triangle())
            .set(PIVOT, pivot)
            .set(SCALE, [3.0; 3])
            .set(ROTATE, degrees(20.0, 30.0, 40.0))
            .cook();
        assert_eq!(out.mesh().positions()[1], [1.0, 0.0, 0.0]);
    }

    #[test]
    fn the_identity_shares_every_array() {
        let mesh = triangle();
        let out = bench(&NODE).input(GEOMETRY, mesh.clone()).set(PIVOT, [5.0; 3]).cook();
        assert_eq!(out.geometry.arrays(), Geometry::from(mesh).arrays());
    }

    #[test]
    fn translation_changes_positions_only() {
        let mesh = triangle();
        let out = bench(&NODE).input(GEOMETRY, mesh.clone()).set(TRANSLATE, [0.5, 0.0, 0.0]).cook();
        assert_eq!(out.mesh().positions()[0], [0.5, 0.0, 0.0]);
        assert!(out.mesh().topology().same(mesh.topology()));
        for (owner, name, column) in mesh.columns().filter(|(_, name, _)| ***name != *P.name) {
            assert!(out.mesh().table(owner).column(name).unwrap().same(column), "{name}");
        }
    }

    #[test]
    fn rest_positions_and_custom_attributes_pass_through() {
        let mesh = triangle();
        let out = bench(&NODE).input(GEOMETRY, mesh.clone()).set(SCALE, [2.0; 3]).cook();
        for name in ["Pref", "mask"] {
            let column = |mesh: &Component| mesh.table(Owner::Point).column(name).unwrap().address();
            assert_eq!(column(out.mesh()), column(&mesh));
        }
        assert_eq!(out.mesh().get(WIDTH), Some(&[1.0; 3][..]));
    }

    #[test]
    fn a_mirrored_mesh_still_faces_outwards() {
        let out = bench(&NODE).input(GEOMETRY, triangle()).set(SCALE, [-1.0, 1.0, 1.0]).cook();
        assert_eq!(out.mesh().positions()[1], [-1.0, 0.0, 0.0]);
        assert_eq!(out.mesh().faces().unwrap().face(0), [0, 2, 1]);
        assert_eq!(out.mesh().get(N).unwrap()[0], [0.0, 0.0, 1.0]);
        assert_eq!(out.mesh().get(WIDTH), Some(&[0.5; 3][..]));
        let twice = bench(&NODE).input(GEOMETRY, triangle()).set(SCALE, [-1.0, -1.0, 1.0]).cook();
        assert_eq!(twice.mesh().faces().unwrap().face(0), [0, 1, 2]);
    }

    #[test]
    fn mirrored_tets_stay_positive() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let tets = Component::tets(vec![[0, 1, 2, 3]], points).unwrap();
        let out = bench(&NODE).input(GEOMETRY, tets).set(SCALE, [1.0, 1.0, -2.0]).cook();
        assert_eq!(out.part(Kind::Tets).tet_corners(), [[0, 1, 3, 2]]);
    }

    #[test]
    fn every_component_moves_and_orientations_rotate() {
        let mut points = Component::points(vec![[1.0, 0.0, 0.0]]);
        points.set(ORIENT, vec![[0.0, 0.0, 0.0, 1.0]]).unwrap();
        let curves = Component::curves(vec![2], vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]).unwrap();
        let both = Geometry::from(points).with(curves);
        let out = bench(&NODE).input(GEOMETRY, both).set(ROTATE, degrees(0.0, 90.0, 0.0)).cook();
        assert!(close(out.part(Kind::Points).positions(), &[[0.0, 0.0, -1.0]]));
        assert!(close(out.curves().positions(), &[[0.0, 0.0, -1.0], [0.0, 0.0, -2.0]]));
        let orient = out.part(Kind::Points).get(ORIENT).unwrap()[0];
        let h = std::f32::consts::FRAC_1_SQRT_2;
        assert!(orient.iter().zip([0.0, h, 0.0, h]).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    fn volume() -> Geometry {
        let grid = Grid { origin: [1.0, 0.0, 0.0], cell: 0.5, size: [1, 1, 1] };
        let mut geometry = Geometry::default();
        geometry.put_volume(Volume::new(grid, vec![-0.25], [vec![1.0; 2], vec![2.0; 2], vec![3.0; 2]]).unwrap());
        geometry
    }

    #[test]
    fn a_volume_is_translated_and_scaled_with_its_distances_and_speeds() {
        let out = bench(&NODE).input(GEOMETRY, volume()).set(SCALE, [2.0; 3]).set(TRANSLATE, [0.0, 1.0, 0.0]).cook();
        let moved = out.geometry.volume().unwrap();
        assert_eq!(moved.level_grid(), Grid { origin: [2.0, 1.0, 0.0], cell: 1.0, size: [1, 1, 1] });
        assert_eq!(moved.level_set().to_dense().unwrap(), [-0.5]);
        assert_eq!(moved.velocity()[1].to_dense().unwrap(), [4.0; 2]);
    }

    #[test]
    fn a_translated_volume_shares_its_arrays() {
        let volume = volume();
        let out = bench(&NODE).input(GEOMETRY, volume.clone()).set(TRANSLATE, [0.0, 1.0, 0.0]).cook();
        assert_eq!(out.geometry.volume().unwrap().velocity_grid().origin, [1.0, 1.0, 0.0]);
        assert_eq!(out.geometry.arrays(), volume.arrays());
    }

    #[test]
    fn rotating_or_stretching_a_volume_is_refused() {
        let volume = bench(&NODE).input(GEOMETRY, volume());
        let turned = volume.clone().set(ROTATE, degrees(0.0, 90.0, 0.0)).try_cook().unwrap_err();
        assert_eq!(turned.fact, "a volume cannot be rotated: its grid is aligned with the axes");
        for scale in [[1.0, 2.0, 1.0], [-1.0; 3], [0.0; 3]] {
            assert!(volume.clone().set(SCALE, scale).try_cook().is_err());
        }
    }

    #[test]
    fn keyed_rotation_is_about_one_axis() {
        let out = bench(&NODE)
            .input(GEOMETRY, Component::points(vec![[1.0, 0.0, 0.0]]))
            .keyed(TRANSLATE, &[(1.0, [0.0; 3]), (3.0, [2.0, 0.0, 0.0])])
            .at(2.0)
            .cook();
        assert_eq!(out.part(Kind::Points).positions(), [[2.0, 0.0, 0.0]]);
    }

    #[test]
    fn empty_and_extreme_geometry_is_transformed_or_refused() {
        let empty = Component::curves(vec![], vec![]).unwrap();
        assert!(bench(&NODE).input(GEOMETRY, empty).set(SCALE, [-2.0; 3]).cook().curves().positions().is_empty());
        let far = Component::points(vec![[1e30, 0.0, 0.0]]);
        let grown = |scale: f64| bench(&NODE).input(GEOMETRY, far.clone()).set(SCALE, [scale; 3]).try_cook();
        assert_eq!(grown(1e-30).unwrap().part(Kind::Points).positions(), [[1.0, 0.0, 0.0]]);
        assert_eq!(grown(1e30).unwrap_err().kind, ErrorKind::NotFinite);
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
