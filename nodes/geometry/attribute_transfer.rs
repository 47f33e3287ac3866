//! Attribute_Transfer: attributes of another geometry, by position.
//!
//! Each row takes the value of the nearest row of `source`, or, with a `radius`, the mean of those within it, with weights
//! (1 − (d ÷ `radius`)²)². Points take from points, elements from elements: a curve is where its root is, a face or tet
//! where the mean of its corners is, but the nearest face is the one with the nearest point. Of whole numbers, and of `orient`, there is no mean: the nearest counts. Where nothing
//! is within the radius a row keeps what it has; without the attribute it has its neutral value, such as an `envelope` of 1,
//! or 0.

use curves::attach::closest_triangles;
use engine::geometry::ColumnType;
use engine::prelude::*;
use numerics::parallel::{self, CHUNK};
use numerics::point_tree::{FoundPoint, PointTree};
use numerics::vector::{DVec3, to_f32, to_f64};
use std::sync::Arc;

choice! {
    /// What has the attributes.
    enum From {
        Points = "points": "points, such as CVs of curves, take from points",
        Elements = "elements": "curves, faces and tets take from curves, faces and tets",
    }
}

inputs! { INPUTS:
    GEOMETRY: Input = Input::any("geometry", "The geometry that gets the attributes.");
    SOURCE: Input = Input::any("source", "The geometry that has them. It may be of another kind.");
}

params! { PARAMS:
    ATTRIBUTES: Param<Arc<Vec<Name>>> = Param::texts("attributes", &[], "Names of the attributes.").fixed();
    FROM: Param<From> = Param::choice("from", From::Points, "Whether they are attributes of points or of elements.").fixed();
    RADIUS: Param<f32> = Param::float("radius", 0.0,
        "Distance within which values are averaged, the nearer the more; for integer attributes the nearest value is \
         used. Points or elements farther from all of `source` keep their values. 0 uses the nearest value at any \
         distance.")
        .unit(Unit::Metres).at_least(0.0).soft(0.0, 1.0);
}

const OUT: Output = Output::like("geometry", &GEOMETRY, "The geometry with the attributes.");

metrics! { METRICS:
    UNREACHED = Metric::new("unreached", Unit::None,
        "Points, or elements, that have nothing of `source` within `radius`; counted once for each attribute.")
        .warn_above(0.0, "So many points or elements have nothing of `source` within `radius`. They keep their values; a new \
            attribute is 0 there, an `envelope` 1. Raise `radius`, or set it to 0 to take the nearest value at any distance.");
}

pub(crate) static NODE: Node = Node::new(
    "Attribute_Transfer",
    3,
    "Copies attributes from another geometry by position: masks painted on a mesh to the fur on it, or groups of a groom to \
     another one. Takes the nearest value, or a mean of those within `radius`.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[&P])
.attributes(|params| [(); 2].map(|()| AttrNames::These(params.get(ATTRIBUTES).to_vec())))
.metrics(METRICS)
.neutral(|params, _| params.get(ATTRIBUTES).is_empty().then_some("`attributes` names none"))
.checks(check);

/// Refuses positions.
fn check(params: &Params) -> Result<()> {
    match params.get(ATTRIBUTES).iter().any(|name| **name == *P.name) {
        true => {
            Err(Error::refused("`attributes` names `P`").hint("positions are what rows are found by").of("attributes"))
        }
        false => Ok(()),
    }
}

fn cook(cx: &Cx) -> Result<Outputs> {
    check(cx.params())?;
    let mut geometry = cx.input(GEOMETRY).clone();
    let source = cx.input(SOURCE);
    let owner = match cx.get(FROM) {
        From::Points => Owner::Point,
        From::Elements => Owner::Element,
    };
    let mut unreached = 0;
    for name in cx.get(ATTRIBUTES).iter() {
        let (part, column) = found(source, owner, name)?;
        let places = places(part, owner);
        let tree = PointTree::new(&places);
        for kind in Kind::ALL {
            let Some(own) = geometry.part_mut(kind) else { continue };
            let rows = self::places(own, owner);
            if rows.is_empty() {
                continue;
            }
            let radius = cx.get(RADIUS);
            let near = match radius == 0.0 && owner == Owner::Element && part.kind() == Kind::Mesh {
                true => nearest_faces(part, &rows),
                false => near(&tree, &rows, radius),
            };
            let missed = near.iter().filter(|near| near.is_empty()).count();
            unreached += missed;
            let before = own.table(owner).column(name);
            if let Some(before) = before.filter(|before| missed > 0 && before.kind() != column.kind()) {
                return Err(of_another_type(name, before.kind(), column.kind(), missed));
            }
            let before = before.cloned().or_else(|| own.neutral(owner, name));
            let column = taken(name, column, before.filter(|before| before.kind() == column.kind()), &near);
            own.set_column(owner, name.clone(), column)?;
        }
    }
    cx.publish(UNREACHED, unreached as f64);
    Ok(OUT.with(geometry))
}

/// The first component of a geometry with that attribute, and the attribute.
fn found<'g>(source: &'g Geometry, owner: Owner, name: &str) -> Result<(&'g Component, &'g Column)> {
    let with = |part: &'g Component| Some((part, part.table(owner).column(name)?));
    source.parts().find_map(with).filter(|(_, column)| !column.is_empty()).ok_or_else(|| {
        let rows = if owner == Owner::Point { "points" } else { "elements" };
        let other = source.parts().any(|part| part.columns().any(|(_, known, _)| **known == *name));
        let hint = if other { "set `from` to what has it" } else { "wire the geometry that has it into `source`" };
        Error::refused(format!("no {rows} of `source` have the attribute `{name}`")).hint(hint).of("attributes")
    })
}

/// Rows that keep their values, which the attribute from `source` cannot hold.
fn of_another_type(name: &str, own: ColumnType, source: ColumnType, rows: usize) -> Error {
    let fact =
        format!("`{name}` is {own} in `geometry` and {source} in `source`, and {rows} rows would keep their own");
    Error::refused(fact).hint("set `radius` to 0, or give the attribute in `source` another name").of("radius")
}

/// Where rows are.
fn places(part: &Component, owner: Owner) -> Vec<[f32; 3]> {
    let points = part.positions();
    let mean = |corners: &[u32]| {
        let sum: DVec3 = corners.iter().map(|corner| to_f64(points[*corner as usize])).sum();
        to_f32(sum / corners.len().max(1) as f64)
    };
    match (owner, part.kind()) {
        (Owner::Point, _) => points.to_vec(),
        (_, Kind::Curves) => part.runs().ranges().map(|cvs| points[cvs].first().copied().unwrap_or_default()).collect(),
        (_, Kind::Mesh) => part.faces().map(|faces| faces.iter().map(mean).collect()).unwrap_or_default(),
        (_, Kind::Tets) => part.tet_corners().iter().map(|corners| mean(corners)).collect(),
        _ => Vec::new(),
    }
}

/// The face that each place takes from.
fn nearest_faces(mesh: &Component, places: &[[f32; 3]]) -> Vec<Vec<(u32, f64)>> {
    let triangles = mesh.triangles();
    let nearest = closest_triangles(mesh.positions(), &triangles.corners, places).unwrap_or_default();
    let mut faces = nearest.into_iter().map(|triangle| triangles.faces[triangle as usize]);
    places.iter().map(|_| faces.next().map(|face| (face, 1.0)).into_iter().collect()).collect()
}

/// The rows that each place takes from, nearest first, with their weights, which sum to 1.
fn near(tree: &PointTree, places: &[[f32; 3]], radius: f32) -> Vec<Vec<(u32, f64)>> {
    parallel::tabulate(places.len(), CHUNK, |row| {
        let mut found: Vec<FoundPoint> = Vec::new();
        if radius == 0.0 {
            tree.nearest(places[row], 1, &mut found);
            return found.iter().map(|found| (found.number, 1.0)).collect();
        }
        let reach = f64::from(radius);
        tree.within(places[row], reach, |one| found.push(one));
        found.sort_by(|a, b| a.square.total_cmp(&b.square).then(a.number.cmp(&b.number)));
        let weight = |found: &FoundPoint| {
            let left = 1.0 - found.square / (reach * reach);
            if left > 0.0 { left * left } else { 0.0 }
        };
        let sum: f64 = found.iter().map(weight).sum();
        let whole = if sum > 0.0 { sum } else { 1.0 };
        found.iter().map(|found| (found.number, weight(found) / whole)).filter(|(_, weight)| *weight > 0.0).collect()
    })
}

/// An attribute's values for rows that take from these of `column`; those that take from none have that of `before`, or 0.
fn taken(name: &str, column: &Column, before: Option<Column>, near: &[Vec<(u32, f64)>]) -> Column {
    let whole = column.concat(&before.unwrap_or_else(|| Column::zeros(column.kind(), near.len())));
    let all = whole.unwrap_or_else(|| column.clone());
    // Rows of `before` follow those of the source.
    let nearest =
        |(row, near): (usize, &Vec<(u32, f64)>)| near.first().map_or((column.len() + row) as u32, |(from, _)| *from);
    let nearest: Vec<u32> = near.iter().enumerate().map(nearest).collect();
    let gathered = all.gather(&nearest);
    if *name == *ORIENT.name {
        return gathered;
    }
    let mut table = engine::geometry::Table::new(near.len());
    let mut source = engine::geometry::Table::new(column.len());
    if table.set(name, gathered.clone()).is_err() || source.set(name, column.clone()).is_err() {
        return gathered;
    }
    if let (Some(rows), Some(out)) = (source.get::<f32>(name), table.edit::<f32>(name)) {
        for (out, near) in out.iter_mut().zip(near).filter(|(_, near)| near.len() > 1) {
            *out = near.iter().map(|(row, weight)| f64::from(rows[*row as usize]) * weight).sum::<f64>() as f32;
        }
    }
    if let (Some(rows), Some(out)) = (source.get::<[f32; 3]>(name), table.edit::<[f32; 3]>(name)) {
        for (out, near) in out.iter_mut().zip(near).filter(|(_, near)| near.len() > 1) {
            let mean: DVec3 = near.iter().map(|(row, weight)| to_f64(rows[*row as usize]) * *weight).sum();
            let mean = if *name == *N.name { mean.try_normalize(0.0).unwrap_or(mean) } else { mean };
            *out = to_f32(mean);
        }
    }
    table.column(name).cloned().unwrap_or(gathered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{Bench, bench, conformance};

    const MASK: Attr<f32> = Attr::point("mask");

    /// Points along x with a mask of 10 times their position, and a whole number of that.
    fn source() -> Component {
        let places = [0.0, 1.0, 3.0];
        let mut points = Component::points(places.map(|x| [x, 0.0, 0.0]).to_vec());
        points.set(MASK, places.map(|x| 10.0 * x).to_vec()).unwrap();
        points.set(Attr::<i32>::point("part"), vec![0, 1, 3]).unwrap();
        points
    }

    fn names(names: &[&str]) -> Arc<Vec<Name>> {
        Arc::new(names.iter().map(|name| (*name).into()).collect())
    }

    fn hair() -> Component {
        Component::curves(vec![3], vec![[0.1, 0.0, 0.0], [0.5, 0.0, 0.0], [2.5, 0.0, 0.0]]).unwrap()
    }

    fn transfer(list: &[&str]) -> Bench {
        bench(&NODE).input(GEOMETRY, hair()).input(SOURCE, source()).set(ATTRIBUTES, names(list))
    }

    #[test]
    fn conforms_to_its_declaration() {
        let named = |bench: Bench| bench.set(ATTRIBUTES, names(&["width", "envelope"]));
        conformance(&NODE).with(named).with(move |bench| named(bench).set(RADIUS, 0.06)).run();
    }

    #[test]
    fn each_point_takes_the_nearest_value() {
        let out = transfer(&["mask", "part"]).cook();
        assert_eq!(
            out.curves().get(Attr::<i32>::point("part")),
            Some(&[0, 0, 3][..]),
            "of equally near ones the first"
        );
        assert_eq!(out.curves().get(MASK), Some(&[0.0, 0.0, 30.0][..]));
        assert_eq!(out.metrics["unreached"], 0.0);
    }

    #[test]
    fn within_a_radius_values_are_averaged() {
        // Half way between 0 and 10 both weigh alike; at 0.1 of a radius of 1: (1 − 0.01)² and (1 − 0.81)².
        let out = transfer(&["mask", "part"]).set(RADIUS, 1.0).cook();
        let mask = out.curves().get(MASK).unwrap();
        let (near, far) = (0.99_f64 * 0.99, 0.19_f64 * 0.19);
        assert!((f64::from(mask[0]) - 10.0 * far / (near + far)).abs() < 1e-5);
        assert!((mask[1] - 5.0).abs() < 1e-5 && mask[2] == 30.0);
        assert_eq!(out.curves().get(Attr::<i32>::point("part")), Some(&[0, 0, 3][..]));
        let mut own = hair();
        own.set(MASK, vec![7.0; 3]).unwrap();
        let out = transfer(&["mask"]).set(RADIUS, 0.2).cook();
        assert_eq!((out.curves().get(MASK), out.metrics["unreached"]), (Some(&[0.0, 0.0, 0.0][..]), 2.0));
        let kept = bench(&NODE).input(GEOMETRY, own).input(SOURCE, source()).set(ATTRIBUTES, names(&["mask"]));
        assert_eq!(kept.set(RADIUS, 0.2).cook().curves().get(MASK), Some(&[0.0, 7.0, 7.0][..]));
    }

    #[test]
    fn what_keeps_its_value_keeps_it_whatever_its_type() {
        let mut own = hair();
        own.set(Attr::<i32>::point("mask"), vec![7; 3]).unwrap();
        let bench = bench(&NODE).input(GEOMETRY, own).input(SOURCE, source()).set(ATTRIBUTES, names(&["mask"]));
        let error = bench.clone().set(RADIUS, 0.2).try_cook().unwrap_err();
        assert_eq!(
            error.to_string(),
            "`mask` is int in `geometry` and float in `source`, and 2 rows would keep their own; set `radius` to 0, or give \
             the attribute in `source` another name"
        );
        assert_eq!(bench.cook().curves().get(MASK), Some(&[0.0, 0.0, 30.0][..]));
        let mut shelter = Component::points(vec![[0.1, 0.0, 0.0]]);
        shelter.set(ENVELOPE, vec![0.25]).unwrap();
        let out = self::bench(&NODE).input(GEOMETRY, hair()).input(SOURCE, shelter);
        let out = out.set(ATTRIBUTES, names(&["envelope"])).set(RADIUS, 0.2).cook();
        assert_eq!(out.curves().get(ENVELOPE), Some(&[0.25, 1.0, 1.0][..]));
    }

    #[test]
    fn curves_take_from_the_faces_under_their_roots() {
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]].map(|[x, z]| [x, 0.0, z]);
        let mut mesh = Component::mesh(vec![4, 4], vec![0, 1, 4, 3, 1, 2, 5, 4], points.to_vec()).unwrap();
        mesh.set(Attr::<i32>::element("patch"), vec![4, 5]).unwrap();
        let roots = vec![[0.4, 0.0, 0.5], [0.4, 1.0, 0.5], [1.7, 0.0, 0.1], [0.0, 1.0, 0.0]];
        let curves = Component::curves(vec![2, 2], roots).unwrap();
        let bench = bench(&NODE).input(GEOMETRY, curves).input(SOURCE, mesh).set(ATTRIBUTES, names(&["patch"]));
        let out = bench.clone().set(FROM, From::Elements).cook();
        assert_eq!(out.curves().get(Attr::<i32>::element("patch")), Some(&[4, 5][..]));
        let error = bench.clone().try_cook().unwrap_err();
        assert_eq!(error.to_string(), "no points of `source` have the attribute `patch`; set `from` to what has it");
    }

    /// The root lies on a face ten long, nearer to the middle of the short one beside it.
    #[test]
    fn the_nearest_face_is_the_one_that_a_root_lies_on() {
        let points = [0.0, 10.0, 10.2].map(|x| [[x, 0.0, 0.0], [x, 0.0, 1.0]]).as_flattened().to_vec();
        let mut mesh = Component::mesh(vec![4, 4], vec![0, 1, 3, 2, 2, 3, 5, 4], points).unwrap();
        mesh.set(Attr::<i32>::element("patch"), vec![1, 2]).unwrap();
        let roots = [9.0, 10.1, -3.0].map(|x| [[x, 0.1, 0.5], [x, 1.0, 0.5]]).as_flattened().to_vec();
        let curves = Component::curves(vec![2; 3], roots).unwrap();
        let bench = bench(&NODE).input(GEOMETRY, curves).input(SOURCE, mesh).set(ATTRIBUTES, names(&["patch"]));
        let out = bench.set(FROM, From::Elements).cook();
        assert_eq!(out.curves().get(Attr::<i32>::element("patch")), Some(&[1, 2, 1][..]));
    }

    #[test]
    fn empty_and_missing_things_are_refused_or_pass_through() {
        let nothing = Component::points(Vec::new());
        assert!(
            bench(&NODE)
                .input(GEOMETRY, hair())
                .input(SOURCE, nothing)
                .set(ATTRIBUTES, names(&["mask"]))
                .try_cook()
                .is_err()
        );
        assert!(transfer(&["P"]).try_cook().is_err());
        let none = Component::curves(Vec::new(), Vec::new()).unwrap();
        let out = bench(&NODE).input(GEOMETRY, none).input(SOURCE, source()).set(ATTRIBUTES, names(&["mask"])).cook();
        assert_eq!(out.curves().point_count(), 0);
    }
}
