//! Compares two geometries: what one of them lacks, and how much the rest differs.
//!
//! Without a tolerance numbers are the same if their bits are. With one, floats are the same if they differ by at most
//! the tolerance or are both NaN; integers must be equal. Rows are compared in order; if the numbers of rows differ,
//! only the counts are reported. Differences are f64, summed in the order of the rows.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;

use engine::geometry::{
    Column, ColumnType, Component, Geometry, Grid, Kind, Name, Owner, SparseField, Table, Topology, Volume,
};

/// One of the two geometries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    A,
    B,
}

/// A difference of bits.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Finding {
    pub(super) kind: Kind,
    pub(super) what: FindingKind,
}

/// The kind of a difference.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum FindingKind {
    /// Only this side has the component.
    Component(Side),
    /// Numbers of points or elements.
    Count { of: &'static str, counts: [usize; 2] },
    /// The same number of elements, but `differing` of them have different points.
    Topology { of: &'static str, differing: usize, elements: usize, first: usize },
    /// The grids of two volumes: of the level set, of the velocity, or of both.
    Grid { of: &'static str, grids: [Grid; 2] },
    /// Only this side has the attribute.
    Attribute(AttributePath, Side),
    /// An attribute of two types.
    Type(AttributePath, [ColumnType; 2]),
    /// The numbers of an attribute.
    Values(AttributePath, Values),
}

/// Identifies an attribute. Without an owner it is a field of a volume.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct AttributePath {
    pub(super) owner: Option<Owner>,
    pub(super) name: Name,
}

/// The difference of two columns with the same number of rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Values {
    pub(super) kind: ColumnType,
    /// Numbers in each of the two.
    pub(super) numbers: usize,
    /// Numbers that are not the same.
    pub(super) differing: usize,
    /// Pairs without a finite difference.
    pub(super) not_finite: usize,
    /// Largest finite absolute difference, and its row.
    pub(super) largest: f64,
    pub(super) largest_row: usize,
    /// Mean of all finite absolute differences, including zeros.
    pub(super) mean: f64,
    /// The first number that is not the same.
    pub(super) first: Option<FirstDifference>,
}

/// A number that is not the same: its row, its position in the row, and both values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FirstDifference {
    pub(super) row: usize,
    pub(super) lane: usize,
    pub(super) values: [f64; 2],
}

impl Finding {
    /// Whether the geometries differ by this; else it is a difference within the tolerance.
    pub(super) fn differs(&self) -> bool {
        !matches!(&self.what, FindingKind::Values(_, values) if values.differing == 0)
    }
}

/// All differences of bits, component by component. `tolerance` is a length or another attribute's unit.
pub(super) fn compare(a: &Geometry, b: &Geometry, tolerance: Option<f64>) -> Vec<Finding> {
    let mut findings = Findings { tolerance, kind: Kind::Curves, found: Vec::new() };
    for kind in Kind::ALL {
        findings.kind = kind;
        let has = |geometry: &Geometry| geometry.kinds().any(|found| found == kind);
        match (has(a), has(b)) {
            (true, false) => findings.add(FindingKind::Component(Side::A)),
            (false, true) => findings.add(FindingKind::Component(Side::B)),
            _ => {}
        }
        if let (Some(a), Some(b)) = (a.part(kind), b.part(kind)) {
            findings.components(a, b);
        }
    }
    if let (Some(a), Some(b)) = (a.volume(), b.volume()) {
        findings.volumes(a, b);
    }
    findings.found
}

/// Collects differences.
struct Findings {
    tolerance: Option<f64>,
    /// The current component.
    kind: Kind,
    found: Vec<Finding>,
}

impl Findings {
    fn add(&mut self, what: FindingKind) {
        self.found.push(Finding { kind: self.kind, what });
    }

    fn components(&mut self, a: &Component, b: &Component) {
        self.count("points", a.point_count(), b.point_count());
        match (a.topology(), b.topology()) {
            (Topology::Curves(a), Topology::Curves(b)) => self.elements("curves", a.counts(), b.counts()),
            (Topology::Mesh(a), Topology::Mesh(b)) => self.elements("faces", a.iter(), b.iter()),
            (Topology::Tets(a), Topology::Tets(b)) => self.elements("tets", a.iter(), b.iter()),
            _ => {}
        }
        for owner in Owner::ALL {
            self.tables(owner, a.table(owner), b.table(owner));
        }
    }

    fn count(&mut self, of: &'static str, a: usize, b: usize) {
        if a != b {
            self.add(FindingKind::Count { of, counts: [a, b] });
        }
    }

    fn elements<T: PartialEq>(
        &mut self,
        of: &'static str,
        a: impl ExactSizeIterator<Item = T>,
        b: impl ExactSizeIterator<Item = T>,
    ) {
        let elements = a.len();
        if elements != b.len() {
            return self.count(of, elements, b.len());
        }
        let mut differing = a.zip(b).enumerate().filter(|(_, (a, b))| a != b).map(|(index, _)| index);
        if let Some(first) = differing.next() {
            self.add(FindingKind::Topology { of, differing: 1 + differing.count(), elements, first });
        }
    }

    fn tables(&mut self, owner: Owner, a: &Table, b: &Table) {
        let names: BTreeSet<&Name> = a.iter().chain(b.iter()).map(|(name, _)| name).collect();
        for name in names {
            let attribute = AttributePath { owner: Some(owner), name: name.clone() };
            match (a.column(name), b.column(name)) {
                (Some(a), Some(b)) => self.columns(attribute, a, b),
                (Some(_), None) => self.add(FindingKind::Attribute(attribute, Side::A)),
                (None, _) => self.add(FindingKind::Attribute(attribute, Side::B)),
            }
        }
    }

    fn columns(&mut self, attribute: AttributePath, a: &Column, b: &Column) {
        // Formats need not store the type of a column without rows.
        if a.len() != b.len() || a.is_empty() {
            return;
        }
        let (kind, tolerance) = (a.kind(), self.tolerance);
        let values = match (a, b) {
            (Column::F1(a), Column::F1(b)) => values(a.as_chunks::<1>().0, b.as_chunks().0, kind, tolerance),
            (Column::F3(a), Column::F3(b)) => values(a, b, kind, tolerance),
            (Column::F4(a), Column::F4(b)) => values(a, b, kind, tolerance),
            (Column::I1(a), Column::I1(b)) => values(a.as_chunks::<1>().0, b.as_chunks().0, kind, None),
            (Column::I3(a), Column::I3(b)) => values(a, b, kind, None),
            (Column::I4(a), Column::I4(b)) => values(a, b, kind, None),
            _ => return self.add(FindingKind::Type(attribute, [kind, b.kind()])),
        };
        if let Some(values) = values {
            self.add(FindingKind::Values(attribute, values));
        }
    }

    fn volumes(&mut self, a: &Volume, b: &Volume) {
        let has_one = |volume: &Volume| volume.level_grid() == volume.velocity_grid();
        let grids = |grid: fn(&Volume) -> Grid| [grid(a), grid(b)];
        let all = if has_one(a) && has_one(b) {
            vec![("grid", grids(Volume::level_grid))]
        } else {
            vec![("level set", grids(Volume::level_grid)), ("velocity", grids(Volume::velocity_grid))]
        };
        for (of, grids) in all.into_iter().filter(|(_, [a, b])| a != b) {
            self.add(FindingKind::Grid { of, grids });
        }
        // A volume that was read from a file fits in dense arrays.
        let dense = |field: &SparseField| Column::new(field.to_dense().unwrap_or_default());
        for ((name, a), (_, b)) in a.fields().into_iter().zip(b.fields()) {
            self.columns(AttributePath { owner: None, name: name.into() }, &dense(a), &dense(b));
        }
        self.tables(Owner::Once, a.once(), b.once());
    }
}

/// A number of a column.
trait Number: Copy {
    fn bits(self) -> u32;
    fn value(self) -> f64;
}

impl Number for f32 {
    fn bits(self) -> u32 {
        self.to_bits()
    }

    fn value(self) -> f64 {
        self.into()
    }
}

impl Number for i32 {
    fn bits(self) -> u32 {
        self.cast_unsigned()
    }

    fn value(self) -> f64 {
        self.into()
    }
}

/// The difference of `a` and `b`, which have the same number of rows; `None` if all bits are the same.
fn values<const N: usize, T: Number>(
    a: &[[T; N]],
    b: &[[T; N]],
    kind: ColumnType,
    tolerance: Option<f64>,
) -> Option<Values> {
    let numbers = a.len() * N;
    let mut found =
        Values { kind, numbers, differing: 0, not_finite: 0, largest: 0.0, largest_row: 0, mean: 0.0, first: None };
    let (mut unequal, mut sum) = (0, 0.0);
    for (index, (a, b)) in a.as_flattened().iter().zip(b.as_flattened()).enumerate() {
        if a.bits() == b.bits() {
            continue;
        }
        unequal += 1;
        let values = [a.value(), b.value()];
        let distance = (values[0] - values[1]).abs();
        let (row, lane) = (index / N, index % N);
        if distance.is_finite() {
            sum += distance;
            if distance > found.largest {
                (found.largest, found.largest_row) = (distance, row);
            }
        } else {
            found.not_finite += 1;
        }
        let both_nan = values.iter().all(|x| x.is_nan());
        if !tolerance.is_some_and(|tolerance| distance <= tolerance || both_nan) {
            found.differing += 1;
            found.first.get_or_insert(FirstDifference { row, lane, values });
        }
    }
    found.mean = NonZeroUsize::new(numbers - found.not_finite).map_or(0.0, |finite| sum / finite.get() as f64);
    (unequal > 0).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::{ENVELOPE, ID};

    fn points(rows: &[[f32; 3]]) -> Geometry {
        Component::points(rows.to_vec()).into()
    }

    fn only_values(a: &Geometry, b: &Geometry, tolerance: Option<f64>) -> Values {
        match compare(a, b, tolerance).as_slice() {
            [Finding { what: FindingKind::Values(_, values), .. }] => values.clone(),
            found => panic!("{found:?}"),
        }
    }

    #[test]
    fn equal_bits_are_the_same_also_for_nan() {
        let odd = points(&[[f32::NAN, f32::INFINITY, -0.0]]);
        assert_eq!(compare(&odd, &odd.clone(), None), []);
    }

    #[test]
    fn differences_are_counted_and_measured() {
        let a = points(&[[0.0; 3], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let b = points(&[[0.0; 3], [1.0, 2.5, 3.0], [4.0, 5.0, 7.0]]);
        let values = only_values(&a, &b, None);
        assert_eq!((values.numbers, values.differing, values.largest, values.largest_row), (9, 2, 1.0, 2));
        assert_eq!(values.mean, 1.5 / 9.0);
        assert_eq!(values.first, Some(FirstDifference { row: 1, lane: 1, values: [2.0, 2.5] }));
    }

    #[test]
    fn a_tolerance_includes_differences_equal_to_it() {
        let (a, b) = (points(&[[0.0, 1.0, 2.0]]), points(&[[0.0, 1.25, 2.5]]));
        let differing = |tolerance| only_values(&a, &b, Some(tolerance)).differing;
        assert_eq!((differing(0.5), differing(0.499), differing(0.249)), (0, 1, 2));
        assert!(!compare(&a, &b, Some(0.5))[0].differs());
    }

    #[test]
    fn signs_of_zero_differ_only_in_bits() {
        let (a, b) = (points(&[[0.0; 3]]), points(&[[0.0, -0.0, 0.0]]));
        assert_eq!(only_values(&a, &b, None).differing, 1);
        assert_eq!(only_values(&a, &b, Some(0.0)).differing, 0);
    }

    #[test]
    fn nan_equals_only_nan() {
        let (a, b) = (points(&[[f32::NAN, 1.0, 0.0]]), points(&[[1.0, 1.0, f32::INFINITY]]));
        let values = only_values(&a, &b, Some(1e9));
        assert_eq!((values.differing, values.not_finite, values.largest, values.mean), (2, 2, 0.0, 0.0));
        let other = points(&[[f32::from_bits(f32::NAN.to_bits() | 1), 1.0, 0.0]]);
        assert_eq!(only_values(&a, &other, None).differing, 1);
        assert_eq!(only_values(&a, &other, Some(0.0)).differing, 0);
    }

    #[test]
    fn integers_have_no_tolerance() {
        let with_id = |id| {
            let mut points = Component::points(vec![[0.0; 3]]);
            points.set(ID, vec![id]).unwrap();
            Geometry::from(points)
        };
        let values = only_values(&with_id(i32::MIN), &with_id(i32::MAX), Some(1e10));
        assert_eq!((values.differing, values.largest), (1, 4_294_967_295.0));
    }

    #[test]
    fn a_missing_component_or_attribute_is_reported() {
        let mut curves = Component::curves(vec![1], vec![[0.0; 3]]).unwrap();
        let bare = Geometry::from(curves.clone());
        curves.set(ENVELOPE, vec![1.0]).unwrap();
        let whats = |a: &Geometry, b: &Geometry| -> Vec<FindingKind> {
            compare(a, b, None).into_iter().map(|finding| finding.what).collect()
        };
        let envelope = AttributePath { owner: Some(Owner::Point), name: "envelope".into() };
        assert_eq!(whats(&curves.clone().into(), &bare), [FindingKind::Attribute(envelope.clone(), Side::A)]);
        assert_eq!(whats(&bare, &curves.into()), [FindingKind::Attribute(envelope, Side::B)]);
        assert_eq!(whats(&bare, &Geometry::default()), [FindingKind::Component(Side::A)]);
    }

    #[test]
    fn different_counts_are_reported_without_values() {
        let curves = |counts: &[u32]| {
            let points = counts.iter().sum::<u32>() as usize;
            Geometry::from(Component::curves(counts.to_vec(), vec![[0.0; 3]; points]).unwrap())
        };
        let whats = |a: &[u32], b: &[u32]| -> Vec<FindingKind> {
            compare(&curves(a), &curves(b), None).into_iter().map(|finding| finding.what).collect()
        };
        assert_eq!(
            whats(&[2, 3], &[2, 3, 1]),
            [FindingKind::Count { of: "points", counts: [5, 6] }, FindingKind::Count { of: "curves", counts: [2, 3] }]
        );
        assert_eq!(
            whats(&[2, 3, 1], &[2, 1, 3]),
            [FindingKind::Topology { of: "curves", differing: 2, elements: 3, first: 1 }]
        );
    }

    #[test]
    fn types_of_columns_without_rows_are_not_compared() {
        let with = |column: Column, rows: usize| {
            let mut points = Component::points(vec![[0.0; 3]; rows]);
            points.set_column(Owner::Point, "mask", column).unwrap();
            Geometry::from(points)
        };
        assert_eq!(compare(&with(Column::new::<i32>(vec![]), 0), &with(Column::new::<f32>(vec![]), 0), None), []);
        let found = compare(&with(Column::new(vec![1]), 1), &with(Column::new(vec![1.0_f32]), 1), None);
        let attribute = AttributePath { owner: Some(Owner::Point), name: "mask".into() };
        assert_eq!(found[0].what, FindingKind::Type(attribute, [ColumnType::I1, ColumnType::F1]));
    }

    #[test]
    fn volumes_compare_grid_and_fields() {
        let volume = |cell: f32, phi: f32| {
            let grid = Grid { origin: [0.0; 3], cell, size: [1; 3] };
            let mut geometry = Geometry::default();
            geometry.put_volume(Volume::new(grid, vec![phi], [(); 3].map(|()| vec![0.0; 2])).unwrap());
            geometry
        };
        assert_eq!(compare(&volume(0.5, 1.0), &volume(0.5, 1.0), None), []);
        let found = compare(&volume(0.5, 1.0), &volume(0.25, 2.0), None);
        assert!(matches!(found[0].what, FindingKind::Grid { of: "grid", .. }));
        assert!(matches!(&found[1].what, FindingKind::Values(attribute, _) if &*attribute.name == "level_set"));
    }
}
