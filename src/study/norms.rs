//! Norms: what is measured between two results, in which unit, and the statistics of it.
//!
//! Every norm gives a list of numbers for each frame: a distance for each point, or one difference. The statistics are over
//! the numbers of all frames, summed in that order in f64, so they are the same on any number of threads.

use std::collections::BTreeMap;

use engine::geometry::{CURVE_ID, Column, Component, Geometry, ID, Kind, Owner, P, Topology};
use engine::graph::Graph;
use numerics::vector::to_f64;

pub(super) use super::differences::{Differences, Errors};
use super::nearest;
use crate::stats::surface::{SurfaceStats, tet_volume};

/// The words of `--norm` that are no attributes.
const NORMS: [&str; 6] = ["points", "surface", "volume", "mean", "p99", "max"];

/// The start of the message about an attribute that the output lacks.
pub(super) const NO_ATTRIBUTE: &str = "the output has no attribute";

/// What is compared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Measure {
    /// Distances of points, matched by id or by index.
    Points,
    /// Distances to the nearest point of the other's surface, both ways.
    Surface,
    /// The volume enclosed.
    Volume,
    /// An attribute.
    Attribute(String),
    /// A metric of a node.
    Metric { node: String, metric: String },
}

/// The statistic that a tolerance bounds and the plot shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Statistic {
    Mean,
    P99,
    Max,
}

impl Statistic {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::P99 => "p99",
            Self::Max => "max",
        }
    }
}

/// A measure and a statistic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Norm {
    pub(super) measure: Measure,
    pub(super) statistic: Statistic,
}

impl Norm {
    /// The norm that the words of `--norm` ask for.
    ///
    /// # Errors
    /// If two words say the same thing.
    pub(super) fn of(words: &[String]) -> Result<Self, String> {
        let (mut measure, mut statistic) = (None, None);
        for word in words.iter().map(|word| word.trim()) {
            let of_measure = match word {
                "mean" | "p99" | "max" => {
                    let asked = match word {
                        "mean" => Statistic::Mean,
                        "p99" => Statistic::P99,
                        _ => Statistic::Max,
                    };
                    if statistic.replace(asked).is_some() {
                        return Err("--norm has two statistics; write one of mean, p99 and max".into());
                    }
                    continue;
                }
                "" => return Err("--norm is empty; write points, surface, volume, an attribute or node.metric".into()),
                "points" => Measure::Points,
                "surface" => Measure::Surface,
                "volume" => Measure::Volume,
                other => match other.split_once('.') {
                    Some((node, metric)) => Measure::Metric { node: node.into(), metric: metric.into() },
                    None => Measure::Attribute(other.into()),
                },
            };
            if measure.replace(of_measure).is_some() {
                return Err("--norm has two measures; write one, and mean, p99 or max beside it".into());
            }
        }
        Ok(Self { measure: measure.unwrap_or(Measure::Points), statistic: statistic.unwrap_or(Statistic::Mean) })
    }
}

impl Measure {
    /// Its name in JSON and on the command line.
    pub(super) fn name(&self) -> String {
        match self {
            Self::Points => "points".into(),
            Self::Surface => "surface".into(),
            Self::Volume => "volume".into(),
            Self::Attribute(name) => name.clone(),
            Self::Metric { node, metric } => format!("{node}.{metric}"),
        }
    }

    /// Its unit; empty if it has none, or none that is known.
    ///
    /// # Errors
    /// If the graph has no such metric.
    pub(super) fn unit(&self, graph: &Graph) -> Result<&'static str, String> {
        Ok(match self {
            Self::Points | Self::Surface => "m",
            Self::Volume => "m³",
            Self::Attribute(name) => match name.as_str() {
                "P" | "Pref" | "width" | "thickness" => "m",
                "v" => "m/s",
                _ => "",
            },
            Self::Metric { node, metric } => {
                let Some(found) = graph.nodes.iter().find(|found| *found.id == **node) else {
                    let near = engine::expr::suggest::nearest(node, graph.nodes.iter().map(|node| &*node.id));
                    let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
                    return Err(format!("--norm: the graph has no node `{node}`{hint}"));
                };
                let metrics = found.node().map_or(&[][..], |declared| declared.metrics);
                let known = metrics.iter().find(|known| known.name == metric);
                known.map(|known| known.unit.sign()).ok_or_else(|| {
                    let names: Vec<String> = metrics.iter().map(|metric| format!("`{}`", metric.name)).collect();
                    let hint =
                        if names.is_empty() { "it has none".into() } else { format!("it has {}", names.join(", ")) };
                    format!("--norm: `{node}` ({}) has no metric `{metric}`; {hint}", found.type_name())
                })?
            }
        })
    }

    /// The geometry with the attributes that it reads alone: all frames of a reference are held in memory.
    pub(super) fn reads_of(&self, geometry: &Geometry) -> Geometry {
        let mut read = Geometry::default();
        if matches!(self, Self::Metric { .. }) {
            return read;
        }
        let is_read = |name: &str| {
            [P.name, ID.name, CURVE_ID.name].contains(&name) || matches!(self, Self::Attribute(own) if own == name)
        };
        for part in geometry.parts() {
            let mut part = part.clone();
            let all: Vec<_> = part.columns().map(|(owner, name, _)| (owner, name.clone())).collect();
            for (owner, name) in all.iter().filter(|(_, name)| !is_read(name)) {
                part.remove(*owner, name);
            }
            read.put(part);
        }
        read
    }

    /// Adds the differences of a frame of two results. Metrics are compared elsewhere.
    ///
    /// # Errors
    /// Why they cannot be compared.
    pub(super) fn compare(&self, a: &Geometry, b: &Geometry, into: &mut Differences) -> Result<(), String> {
        match self {
            Self::Points => each_part(a, b, |a, b| points(a, b, into)),
            Self::Surface => each_part(a, b, |a, b| nearest::both_ways(a, b, into)),
            Self::Volume => {
                into.extend([(enclosed(a)? - enclosed(b)?).abs()]);
                Ok(())
            }
            Self::Attribute(name) if name == "P" => each_part(a, b, |a, b| points(a, b, into)),
            Self::Attribute(name) => attribute(name, a, b, into),
            Self::Metric { .. } => Ok(()),
        }
    }
}

/// Goes through the components of both.
fn each_part(
    a: &Geometry,
    b: &Geometry,
    mut compare: impl FnMut(&Component, &Component) -> Result<(), String>,
) -> Result<(), String> {
    for kind in Kind::ALL {
        match (a.part(kind), b.part(kind)) {
            (Some(a), Some(b)) => compare(a, b)?,
            (None, None) => {}
            _ => return Err(format!("only one of two results has the component {kind}")),
        }
    }
    Ok(())
}

/// Distances of points.
fn points(a: &Component, b: &Component, into: &mut Differences) -> Result<(), String> {
    let (p, q) = (a.positions(), b.positions());
    let distance = |(i, j): (usize, usize)| (to_f64(p[i]) - to_f64(q[j])).norm();
    let pairs = point_pairs(a, b)?;
    into.count(p.len() + q.len(), pairs.len());
    into.extend(pairs.into_iter().map(distance));
    Ok(())
}

/// The points of both that are the same: by `id`, by `curve_id`, else by index.
fn point_pairs(a: &Component, b: &Component) -> Result<Vec<(usize, usize)>, String> {
    if let (Some(a), Some(b)) = (a.get(ID), b.get(ID))
        && let Some(pairs) = matched(a, b)?
    {
        return Ok(pairs);
    }
    if let (Topology::Curves(of_a), Topology::Curves(of_b)) = (a.topology(), b.topology()) {
        let mut pairs = Vec::with_capacity(a.point_count());
        for (i, j) in element_pairs(a, b)? {
            let (i, j) = (of_a.range(i), of_b.range(j));
            if i.len() != j.len() {
                return Err(format!("a curve has {} CVs in one result and {} in another", i.len(), j.len()));
            }
            pairs.extend(i.zip(j));
        }
        return Ok(pairs);
    }
    let counts = [a.point_count(), b.point_count()];
    if counts[0] != counts[1] {
        return Err(format!("one result has {} points of the {}, another {}", counts[0], a.kind(), counts[1]));
    }
    if a.topology() != b.topology() {
        return Err(format!("the {} of two results connect their points differently", a.kind()));
    }
    Ok((0..counts[0]).map(|index| (index, index)).collect())
}

/// The elements of both that are the same: curves by `curve_id`, else by index.
pub(super) fn element_pairs(a: &Component, b: &Component) -> Result<Vec<(usize, usize)>, String> {
    if let (Some(a), Some(b)) = (a.get(CURVE_ID), b.get(CURVE_ID))
        && let Some(pairs) = matched(a, b)?
    {
        return Ok(pairs);
    }
    let counts = [a.element_count(), b.element_count()];
    match counts[0] == counts[1] {
        true => Ok((0..counts[0]).map(|index| (index, index)).collect()),
        false => Err(format!("one result has {} elements of the {}, another {}", counts[0], a.kind(), counts[1])),
    }
}

/// Rows with the same id, in the order of `a`; `None` if ids repeat. Rows that only one has are left out.
fn matched(a: &[i32], b: &[i32]) -> Result<Option<Vec<(usize, usize)>>, String> {
    let index = |ids: &[i32]| -> BTreeMap<i32, usize> { ids.iter().enumerate().map(|(row, id)| (*id, row)).collect() };
    if a == b {
        return Ok(Some((0..a.len()).map(|row| (row, row)).collect()));
    }
    let rows = index(b);
    if rows.len() != b.len() || index(a).len() != a.len() {
        return Ok(None);
    }
    let pairs: Vec<(usize, usize)> = a.iter().enumerate().filter_map(|(row, id)| Some((row, *rows.get(id)?))).collect();
    match pairs.is_empty() && !(a.is_empty() && b.is_empty()) {
        true => Err("two results have no id in common".into()),
        false => Ok(Some(pairs)),
    }
}

/// Differences of an attribute: of each row the length of the difference.
fn attribute(name: &str, a: &Geometry, b: &Geometry, into: &mut Differences) -> Result<(), String> {
    let mut found = false;
    each_part(a, b, |a, b| {
        for owner in Owner::ALL {
            let (Some(p), Some(q)) = (a.table(owner).column(name), b.table(owner).column(name)) else { continue };
            found = true;
            let pairs = match owner {
                Owner::Point => point_pairs(a, b)?,
                Owner::Element => element_pairs(a, b)?,
                Owner::Once => vec![(0, 0)],
            };
            if p.kind() != q.kind() {
                return Err(format!("the attribute `{name}` has another type in each of two results"));
            }
            let (p, q, width) = (rows(p), rows(q), p.kind().width());
            into.count((p.len() + q.len()) / width, pairs.len());
            let row = |rows: &'_ [f64], row: usize| -> Vec<f64> { rows[row * width..(row + 1) * width].to_vec() };
            into.extend(
                pairs.into_iter().map(|(i, j)| {
                    row(&p, i).iter().zip(row(&q, j)).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
                }),
            );
        }
        Ok(())
    })?;
    match found {
        true => Ok(()),
        false => {
            let columns = a.parts().flat_map(Component::columns).map(|(_, name, _)| &**name);
            let near = engine::expr::suggest::nearest(name, NORMS.into_iter().chain(columns));
            let hint =
                near.map_or("see `convect stats` for those it has".into(), |near| format!("did you mean `{near}`?"));
            Err(format!("{NO_ATTRIBUTE} `{name}`; {hint}"))
        }
    }
}

/// The numbers of a column.
fn rows(column: &Column) -> Vec<f64> {
    fn flat<const N: usize, T: Copy + Into<f64>>(rows: &[[T; N]]) -> Vec<f64> {
        rows.as_flattened().iter().map(|x| (*x).into()).collect()
    }
    match column {
        Column::F1(rows) => flat(rows.as_chunks::<1>().0),
        Column::F3(rows) => flat(rows),
        Column::F4(rows) => flat(rows),
        Column::I1(rows) => flat(rows.as_chunks::<1>().0),
        Column::I3(rows) => flat(rows),
        Column::I4(rows) => flat(rows),
    }
}

/// The volume that the mesh encloses, or that of the tets.
fn enclosed(geometry: &Geometry) -> Result<f64, String> {
    if let Some(mesh) = geometry.mesh()
        && let Some(faces) = mesh.faces()
        && let Some(volume) = SurfaceStats::of(faces, mesh.positions()).volume
    {
        return Ok(volume);
    }
    let tets = geometry.tets().ok_or("the output has no closed mesh and no tets, so it encloses no volume")?;
    let positions = tets.positions();
    Ok(tets.tet_corners().iter().map(|tet| tet_volume(tet.map(|corner| positions[corner as usize]))).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(words: &[&str]) -> Result<Norm, String> {
        Norm::of(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn a_norm_has_a_measure_and_a_statistic_in_any_order() {
        assert_eq!(words(&[]), Ok(Norm { measure: Measure::Points, statistic: Statistic::Mean }));
        assert_eq!(words(&["max"]), Ok(Norm { measure: Measure::Points, statistic: Statistic::Max }));
        assert_eq!(words(&["p99", "surface"]), Ok(Norm { measure: Measure::Surface, statistic: Statistic::P99 }));
        assert_eq!(words(&["shielded"]).unwrap().measure, Measure::Attribute("shielded".into()));
        let metric = Measure::Metric { node: "body".into(), metric: "energy".into() };
        assert_eq!(words(&["body.energy", "max"]).unwrap().measure, metric);
        assert!(words(&["max", "mean"]).is_err() && words(&["points", "volume"]).is_err());
    }

    #[test]
    fn the_99th_percentile_is_one_of_the_numbers() {
        let of = |numbers: &[f64]| {
            let mut differences = Differences::default();
            differences.extend(numbers.iter().copied());
            Errors::of(differences)
        };
        let errors = of(&(1..=200).map(f64::from).collect::<Vec<_>>()).unwrap();
        assert_eq!(errors, Errors { mean: 100.5, p99: 198.0, max: 200.0 });
        assert_eq!(of(&[2.0]).unwrap(), Errors { mean: 2.0, p99: 2.0, max: 2.0 });
        assert_eq!((of(&[]), of(&[f64::NAN])), (None, None));
    }

    #[test]
    fn how_finely_a_shape_is_cut_does_not_change_how_much_a_part_of_it_counts() {
        let errors = |fine: usize| {
            let mut differences = Differences::default();
            // A tenth of the second shape is 3 away, however finely that is cut.
            let far = vec![(3.0, 0.1 / fine as f64); fine];
            differences.extend_both_ways([vec![(1.0, 5.0); 10], [far, vec![(1.0, 0.9)]].concat()]);
            Errors::of(differences).unwrap()
        };
        for fine in [1, 7, 100] {
            let found = errors(fine);
            assert!((found.mean - 1.1).abs() < 1e-12 && (found.p99, found.max) == (3.0, 3.0), "{fine}: {found:?}");
        }
        let mut flat = Differences::default();
        flat.extend_both_ways([vec![(1.0, 0.0); 2], vec![(2.0, 0.0)]]);
        assert_eq!(Errors::of(flat).unwrap().mean, 1.5, "without any size each point counts the same");
    }

    #[test]
    fn points_are_matched_by_id_and_refused_without_where_their_number_changes() {
        let with = |rows: &[([f32; 3], i32)]| {
            let mut points = Component::points(rows.iter().map(|(p, _)| *p).collect());
            points.set(ID, rows.iter().map(|(_, id)| *id).collect()).unwrap();
            Geometry::from(points)
        };
        let a = with(&[([0.0; 3], 7), ([1.0, 0.0, 0.0], 9)]);
        let b = with(&[([1.0, 2.0, 0.0], 9), ([5.0; 3], 1), ([0.0; 3], 7)]);
        let mut found = Differences::default();
        Measure::Points.compare(&a, &b, &mut found).unwrap();
        assert_eq!(found.numbers(), [0.0, 2.0]);
        let bare = |count| Geometry::from(Component::points(vec![[0.0; 3]; count]));
        let refused = Measure::Points.compare(&bare(2), &bare(3), &mut found).unwrap_err();
        assert_eq!(refused, "one result has 2 points of the points, another 3");
    }

    #[test]
    fn a_reference_keeps_only_what_the_norm_reads() {
        let mut points = Component::points(vec![[0.0; 3]]);
        points.set(ID, vec![3]).unwrap();
        points.set(engine::geometry::V, vec![[1.0; 3]]).unwrap();
        let names = |measure: Measure| -> Vec<String> {
            let kept = measure.reads_of(&points.clone().into());
            kept.parts().flat_map(Component::columns).map(|(_, name, _)| name.to_string()).collect()
        };
        assert_eq!(names(Measure::Points), ["P", "id"]);
        assert_eq!(names(Measure::Attribute("v".into())), ["P", "id", "v"]);
        assert!(names(Measure::Metric { node: "a".into(), metric: "b".into() }).is_empty());
    }

    #[test]
    fn an_attribute_differs_by_the_length_of_the_difference() {
        let with = |v: [f32; 3]| {
            let mut points = Component::points(vec![[0.0; 3]]);
            points.set(engine::geometry::V, vec![v]).unwrap();
            Geometry::from(points)
        };
        let mut found = Differences::default();
        let measure = Measure::Attribute("v".into());
        measure.compare(&with([0.0, 3.0, 0.0]), &with([4.0, 0.0, 0.0]), &mut found).unwrap();
        assert_eq!(found.numbers(), [5.0]);
        let unknown = Measure::Attribute("heat".into()).compare(&with([0.0; 3]), &with([0.0; 3]), &mut found);
        assert_eq!(unknown.unwrap_err(), "the output has no attribute `heat`; see `convect stats` for those it has");
        let mistyped = Measure::Attribute("volum".into()).compare(&with([0.0; 3]), &with([0.0; 3]), &mut found);
        assert_eq!(mistyped.unwrap_err(), "the output has no attribute `volum`; did you mean `volume`?");
    }
}
