//! The names of what a format cannot store of a geometry, for a note to the user.
//!
//! Promise: names exactly what convect's own reader of the format does not read back, as a test checks. Limit: what
//! other programs ignore in a file is not known here.

use engine::geometry::{Component, Geometry, Kind, N, Name, Owner, P, UVW};

use crate::Format;
use crate::obj::CD;

/// What a file of that format does not store of `geometry`: `` `envelope` of curves ``, `the curves without a point`.
/// Components that the format cannot hold at all are refused elsewhere.
pub fn lost(format: Format, geometry: &Geometry) -> Vec<String> {
    let holds: fn(&Component, Owner, &Name, [bool; 2]) -> bool = match format {
        Format::Usdc | Format::Usda | Format::Json => return Vec::new(),
        Format::Ply => |_, owner, _, _| owner != Owner::Once,
        Format::Obj => obj_holds,
    };
    let everywhere = |name: &str| {
        let mut parts = geometry.parts().filter(|part| part.point_count() > 0);
        parts.all(|part| has_vectors(part, name))
    };
    let in_step = [N.name, UVW.name].map(everywhere);
    let mut lost = Vec::new();
    for part in geometry.parts() {
        let kind = part.kind();
        if part.point_count() == 0 {
            lost.push(format!("the {kind} without a point"));
            continue;
        }
        // Nothing is lost of a column without rows; for example, points have no elements.
        let columns = part.columns().filter(|(_, _, column)| !column.is_empty());
        let columns = columns.filter(|(owner, name, _)| !holds(part, *owner, name, in_step));
        lost.extend(columns.map(|(_, name, _)| format!("`{name}` of {kind}")));
    }
    lost
}

/// Whether an OBJ file stores that attribute. An `l` line cannot reference normals, a `p` line neither normals nor
/// `uvw`: they are read back only if every vertex of the file has one (`normals`, `textures`).
fn obj_holds(part: &Component, owner: Owner, name: &Name, [normals, textures]: [bool; 2]) -> bool {
    let kind = part.kind();
    let is_stored = match &**name {
        name if name == P.name || name == CD => true,
        name if name == N.name => kind == Kind::Mesh || normals,
        name if name == UVW.name => kind != Kind::Points || textures,
        _ => false,
    };
    is_stored && owner == Owner::Point && has_vectors(part, name)
}

fn has_vectors(part: &Component, name: &str) -> bool {
    part.table(Owner::Point).get::<[f32; 3]>(name).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameStamp;
    use engine::geometry::{Column, ColumnType};

    fn full(mut part: Component) -> Component {
        for (owner, name, kind) in [
            (Owner::Point, "N", ColumnType::F3),
            (Owner::Point, "uvw", ColumnType::F3),
            (Owner::Point, "Cd", ColumnType::F3),
            (Owner::Point, "envelope", ColumnType::F1),
            (Owner::Element, "clump", ColumnType::I1),
            (Owner::Once, "gain", ColumnType::F1),
        ] {
            let rows = part.table(owner).rows();
            part.set_column(owner, name, Column::zeros(kind, rows)).unwrap();
        }
        part
    }

    fn samples() -> Vec<Geometry> {
        let positions = vec![[0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        let curves = full(Component::curves(vec![3], positions.clone()).unwrap());
        let mesh = full(Component::mesh(vec![3], vec![0, 1, 2], positions.clone()).unwrap());
        let points = full(Component::points(positions));
        let none = Component::curves(Vec::new(), Vec::new()).unwrap();
        let bare = Component::curves(vec![1], vec![[0.5; 3]]).unwrap();
        vec![
            curves.clone().into(),
            mesh.clone().into(),
            points.clone().into(),
            Geometry::from(curves.clone()).with(mesh.clone()).with(points.clone()),
            Geometry::from(bare).with(mesh.clone()).with(points.clone()),
            Geometry::from(curves).with(points),
            none.clone().into(),
            Geometry::from(none).with(mesh),
        ]
    }

    #[test]
    fn exactly_what_is_not_read_back_is_named() {
        let stamp = FrameStamp { frame: 1.0, seconds: 0.0 };
        for (sample, geometry) in samples().iter().enumerate() {
            for format in [Format::Obj, Format::Ply, Format::Json] {
                let mut bytes = Vec::new();
                crate::write(format, geometry, &stamp, &mut bytes).unwrap();
                let back = crate::read(format, &bytes).unwrap();
                let mut missing = Vec::new();
                for part in geometry.parts() {
                    let Some(back) = back.part(part.kind()) else {
                        missing.push(format!("the {} without a point", part.kind()));
                        continue;
                    };
                    let columns = part.columns().filter(|(owner, name, _)| back.table(*owner).column(name).is_none());
                    let columns = columns.filter(|(_, _, column)| !column.is_empty());
                    missing.extend(columns.map(|(_, name, _)| format!("`{name}` of {}", part.kind())));
                }
                assert_eq!(lost(format, geometry), missing, "{format} of sample {sample}");
            }
        }
    }
}
