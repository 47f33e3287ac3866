//! Merge: joins several geometries into one.
//!
//! Component by component, with points and elements in the order of the wires. Where one wire lacks an attribute, it
//! gets the attribute's neutral value (`envelope` 1, `orient` no rotation, `Pref` the position, otherwise 0). `id`s are
//! not renumbered. Two volumes cannot be joined and are refused. An attribute with one row for the whole component is
//! taken from the first wire that has it.

use engine::geometry::ColumnType;
use engine::prelude::*;

inputs! { INPUTS:
    GEOMETRY: Input<Many> = Input::any_many("geometry", "The geometries to join, in this order.");
}

const MERGED: Output = Output::union("geometry", &GEOMETRY, "The joined geometry.");

pub(crate) static NODE: Node = Node::new(
    "Merge",
    1,
    "Joins geometries into one: curves with curves, meshes with meshes, in the order of the wires. An \
     attribute that one of them lacks is filled in: `envelope` with 1, `orient` with no rotation, `Pref` with the \
     position, others with 0.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.outputs(&[&MERGED]);

fn cook(cx: &Cx) -> Result<Outputs> {
    let wires = cx.input(GEOMETRY);
    if let [only] = wires {
        return Ok(MERGED.with(only.clone()));
    }
    let mut merged = Geometry::default();
    for kind in Kind::ALL {
        let parts: Vec<(usize, &Component)> =
            wires.iter().enumerate().filter_map(|(wire, geometry)| Some((wire, geometry.part(kind)?))).collect();
        if let Some(part) = union(cx, &parts)? {
            merged.put(part);
        }
    }
    let volumes: Vec<(usize, &Volume)> =
        wires.iter().enumerate().filter_map(|(wire, geometry)| Some((wire, geometry.volume()?))).collect();
    match volumes[..] {
        [] => {}
        [(_, volume)] => merged.put_volume(volume.clone()),
        [(a, _), (b, _), ..] => {
            let fact = format!("`geometry` {a} and {b} both have a volume, and two grids cannot be joined");
            return Err(Error::refused(fact).hint("merge their surfaces"));
        }
    }
    Ok(MERGED.with(merged))
}

/// All parts joined, each given with its wire. A single part is shared, not copied.
fn union(cx: &Cx, parts: &[(usize, &Component)]) -> Result<Option<Component>> {
    let [(first, head), tail @ ..] = parts else { return Ok(None) };
    if tail.is_empty() {
        return Ok(Some((*head).clone()));
    }
    let names = names(*first, head, tail)?;
    // Twice, because the last pair is there when they are joined.
    cx.reserve(2.0 * joined_bytes(parts, &names), "merge fewer geometries, or raise --memory")?;
    let mut all = vec![completed(head, &names)?];
    for (_, part) in tail {
        all.push(completed(part, &names)?);
    }
    // Neighbours are joined pair by pair, so that each row is copied a few times and not once for every later wire.
    while all.len() > 1 {
        let join = |pair: &[Component]| match pair {
            [a, b] => Ok(a.concat(b)?),
            one => Ok(one[0].clone()),
        };
        all = all.chunks(2).map(join).collect::<Result<_>>()?;
    }
    Ok(all.pop())
}

/// The bytes of the joined parts: of each attribute a row for every point or element.
fn joined_bytes(parts: &[(usize, &Component)], names: &[(Owner, Name, ColumnType)]) -> f64 {
    let total = |count: &dyn Fn(&Component) -> usize| parts.iter().map(|(_, part)| count(part) as f64).sum::<f64>();
    let rows = [total(&Component::point_count), total(&Component::element_count)];
    let of_rows =
        names.iter().map(|(owner, _, kind)| rows[usize::from(*owner == Owner::Element)] * 4.0 * kind.width() as f64);
    total(&|part| part.topology().bytes()) + of_rows.sum::<f64>()
}

/// The attributes of points and elements that any part has.
///
/// # Errors
/// If two parts have the same attribute with different types.
fn names(first: usize, head: &Component, tail: &[(usize, &Component)]) -> Result<Vec<(Owner, Name, ColumnType)>> {
    let mut found: Vec<(Owner, Name, ColumnType, usize)> = Vec::new();
    for (wire, part) in std::iter::once(&(first, head)).chain(tail) {
        for (owner, name, column) in part.columns().filter(|(owner, ..)| *owner != Owner::Once) {
            match found.iter().find(|(other, known, ..)| *other == owner && known == name) {
                None => found.push((owner, name.clone(), column.kind(), *wire)),
                Some((_, _, kind, _)) if *kind == column.kind() => {}
                Some((_, _, kind, before)) => {
                    let fact = format!(
                        "`{name}` of the {} is {kind} in `geometry` {before} and {} in `geometry` {wire}",
                        part.kind(),
                        column.kind()
                    );
                    return Err(Error::refused(fact).hint("rename or remove one of them"));
                }
            }
        }
    }
    Ok(found.into_iter().map(|(owner, name, kind, _)| (owner, name, kind)).collect())
}

/// The part with the neutral value of each attribute that it lacks, where there is one.
fn completed(part: &Component, names: &[(Owner, Name, ColumnType)]) -> Result<Component> {
    let mut part = part.clone();
    for (owner, name, _) in names {
        if part.table(*owner).column(name).is_none()
            && let Some(column) = part.neutral(*owner, name)
        {
            part.set_column(*owner, name.clone(), column)?;
        }
    }
    Ok(part)
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};
    use engine::geometry::Grid;

    fn curve(x: f32) -> Component {
        Component::curves(vec![2], vec![[x, 0.0, 0.0], [x, 1.0, 0.0]]).unwrap()
    }

    fn with<T: Item>(mut part: Component, attribute: Attr<T>, rows: Vec<T>) -> Component {
        part.set(attribute, rows).unwrap();
        part
    }

    #[test]
    fn curves_follow_each_other_in_the_order_of_the_wires() {
        let out =
            bench(&NODE).input(GEOMETRY, curve(1.0)).input(GEOMETRY, curve(2.0)).input(GEOMETRY, curve(3.0)).cook();
        assert_eq!(out.curves().runs().starts(), [0, 2, 4, 6]);
        let roots: Vec<f32> = out.curves().positions().iter().step_by(2).map(|p| p[0]).collect();
        assert_eq!(roots, [1.0, 2.0, 3.0]);
    }

    #[test]
    fn corners_of_the_second_mesh_are_renumbered() {
        let mesh = |x: f32| Component::mesh(vec![3], vec![0, 1, 2], vec![[x, 0.0, 0.0]; 3]).unwrap();
        let out = bench(&NODE).input(GEOMETRY, mesh(0.0)).input(GEOMETRY, mesh(1.0)).cook();
        assert_eq!(out.mesh().faces().unwrap().face(1), [3, 4, 5]);
    }

    #[test]
    fn different_components_are_kept_and_shared() {
        let (curves, points) = (curve(0.0), Component::points(vec![[5.0; 3]]));
        let out = bench(&NODE).input(GEOMETRY, curves.clone()).input(GEOMETRY, points.clone()).cook();
        let expected = Geometry::from(curves).with(points);
        assert_eq!(out.geometry.arrays(), expected.arrays());
    }

    #[test]
    fn a_single_wire_passes_through_unchanged() {
        let one = Geometry::from(with(curve(0.0), ENVELOPE, vec![0.5; 2]));
        let out = bench(&NODE).input(GEOMETRY, one.clone()).cook();
        assert_eq!(out.geometry.arrays(), one.arrays());
    }

    #[test]
    fn missing_attributes_get_their_neutral_value() {
        let full = with(with(curve(0.0), ENVELOPE, vec![0.25; 2]), WIDTH, vec![0.1; 2]);
        let full = with(with(full, PREF, vec![[9.0; 3]; 2]), SHIELDED, vec![0.5]);
        let full = with(with(full, Attr::<f32>::point("mask"), vec![0.3; 2]), ORIENT, vec![[1.0, 0.0, 0.0, 0.0]; 2]);
        let out = bench(&NODE).input(GEOMETRY, curve(4.0)).input(GEOMETRY, full).cook();
        let curves = out.curves();
        assert_eq!(curves.get(ENVELOPE), Some(&[1.0, 1.0, 0.25, 0.25][..]));
        assert_eq!(curves.get(WIDTH), Some(&[0.0, 0.0, 0.1, 0.1][..]));
        assert_eq!(curves.get(PREF).unwrap()[..2], [[4.0, 0.0, 0.0], [4.0, 1.0, 0.0]]);
        assert_eq!(curves.get(SHIELDED), Some(&[0.0, 0.5][..]));
        assert_eq!(curves.get(Attr::<f32>::point("mask")), Some(&[0.0, 0.0, 0.3, 0.3][..]));
        assert_eq!(curves.get(ORIENT).unwrap()[0], [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn ids_are_kept() {
        let points = |id: i32| with(Component::points(vec![[0.0; 3]]), ID, vec![id]);
        let out = bench(&NODE).input(GEOMETRY, points(7)).input(GEOMETRY, points(7)).cook();
        assert_eq!(out.part(Kind::Points).get(ID), Some(&[7, 7][..]));
    }

    #[test]
    fn an_attribute_of_two_types_is_refused() {
        let number = with(curve(0.0), Attr::<f32>::point("mask"), vec![0.0; 2]);
        let vector = with(curve(0.0), Attr::<[f32; 3]>::point("mask"), vec![[0.0; 3]; 2]);
        let error = bench(&NODE).input(GEOMETRY, number).input(GEOMETRY, vector).try_cook().unwrap_err();
        assert_eq!(error.fact, "`mask` of the curves is float in `geometry` 0 and float3 in `geometry` 1");
    }

    #[test]
    fn one_volume_passes_through_and_two_are_refused() {
        let mut volume = Geometry::default();
        let grid = Grid { origin: [0.0; 3], cell: 1.0, size: [1, 1, 1] };
        volume.put_volume(Volume::new(grid, vec![0.0], [vec![0.0; 2], vec![0.0; 2], vec![0.0; 2]]).unwrap());
        let one = bench(&NODE).input(GEOMETRY, volume.clone()).input(GEOMETRY, curve(0.0));
        assert!(one.cook().geometry.volume().is_some());
        let error = one.input(GEOMETRY, volume).try_cook().unwrap_err();
        assert_eq!(error.fact, "`geometry` 0 and 2 both have a volume, and two grids cannot be joined");
    }

    #[test]
    fn empty_components_add_nothing() {
        let empty = Component::curves(vec![], vec![]).unwrap();
        let out = bench(&NODE).input(GEOMETRY, empty.clone()).input(GEOMETRY, curve(1.0)).input(GEOMETRY, empty).cook();
        assert_eq!(out.curves().runs().starts(), [0, 2]);
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
