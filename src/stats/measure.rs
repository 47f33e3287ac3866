//! Measurements of a geometry: counts, bounds, lengths, areas, volumes, and the range of every attribute.
//!
//! Sums are f64 in the order of the rows, so the same file gives the same digits everywhere. NaN and infinity are
//! counted and otherwise ignored.

use engine::geometry::{
    Column, ColumnType, Component, Geometry, Grid, Kind, Name, Owner, SparseField, Table, Topology, Volume,
};
use numerics::vector::to_f64;

use super::surface::{SurfaceStats, tet_volume};

/// Minimum, maximum and sum of one or more numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spread {
    count: usize,
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) sum: f64,
}

impl Spread {
    /// The spread of the finite `numbers`; `None` if there are none.
    pub(super) fn of(numbers: impl IntoIterator<Item = f64>) -> Option<Self> {
        numbers.into_iter().filter(|x| x.is_finite()).fold(None, |spread, x| {
            let so_far = spread.unwrap_or(Self { count: 0, min: x, max: x, sum: 0.0 });
            let (min, max) = (so_far.min.min(x), so_far.max.max(x));
            Some(Self { count: so_far.count + 1, min, max, sum: so_far.sum + x })
        })
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / self.count as f64
    }
}

/// Statistics of an attribute, component by component.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AttributeStats {
    pub(super) name: Name,
    pub(super) kind: ColumnType,
    pub(super) rows: usize,
    /// NaN and infinities.
    pub(super) not_finite: usize,
    /// One for each component of a row; `None` without finite numbers.
    pub(super) spreads: Vec<Option<Spread>>,
}

impl AttributeStats {
    fn of(name: &Name, column: &Column) -> Self {
        let width = column.kind().width();
        let numbers = numbers(column);
        let spreads = (0..width).map(|k| Spread::of(numbers.iter().skip(k).step_by(width).copied())).collect();
        let not_finite = numbers.iter().filter(|x| !x.is_finite()).count();
        Self { name: name.clone(), kind: column.kind(), rows: column.len(), not_finite, spreads }
    }
}

/// The components of all rows, row by row.
fn numbers(column: &Column) -> Vec<f64> {
    fn wide<const N: usize, T: Copy + Into<f64>>(rows: &[[T; N]]) -> Vec<f64> {
        rows.as_flattened().iter().map(|x| (*x).into()).collect()
    }
    match column {
        Column::F1(rows) => wide(rows.as_chunks::<1>().0),
        Column::F3(rows) => wide(rows),
        Column::F4(rows) => wide(rows),
        Column::I1(rows) => wide(rows.as_chunks::<1>().0),
        Column::I3(rows) => wide(rows),
        Column::I4(rows) => wide(rows),
    }
}

/// Measurements that only one kind of component has.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// CVs per curve, and lengths in metres.
    Curves { cvs: Option<Spread>, length: Option<Spread> },
    /// Faces.
    Mesh(SurfaceStats),
    /// Nothing.
    Points,
    /// Signed volumes in m³, and the number of tets whose volume is not positive.
    Tets { volume: Option<Spread>, inverted: usize },
}

/// A component.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PartStats {
    pub(super) kind: Kind,
    pub(super) points: usize,
    /// Curves, faces or tets.
    pub(super) elements: usize,
    pub(super) bounds: Option<[[f32; 3]; 2]>,
    pub(super) shape: Shape,
    /// By owner, then by name.
    pub(super) attributes: Vec<(Owner, Vec<AttributeStats>)>,
}

/// A volume.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VolumeStats {
    /// The grid of the level set, and of the velocity unless `velocity_grid` is set.
    pub(super) grid: Grid,
    pub(super) velocity_grid: Option<Grid>,
    /// Cells whose centre is inside.
    pub(super) inside: usize,
    pub(super) fields: Vec<AttributeStats>,
    pub(super) attributes: Vec<AttributeStats>,
}

/// All measurements of a geometry.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Stats {
    pub(super) parts: Vec<PartStats>,
    pub(super) volume: Option<VolumeStats>,
}

/// Measures `geometry`.
pub(super) fn stats(geometry: &Geometry) -> Stats {
    Stats { parts: geometry.parts().map(part).collect(), volume: geometry.volume().map(volume) }
}

fn part(part: &Component) -> PartStats {
    let table = |owner| (owner, attributes(part.table(owner)));
    PartStats {
        kind: part.kind(),
        points: part.point_count(),
        elements: part.element_count(),
        bounds: part.bounds(),
        shape: shape(part),
        attributes: Owner::ALL.map(table).into(),
    }
}

fn attributes(table: &Table) -> Vec<AttributeStats> {
    table.iter().map(|(name, column)| AttributeStats::of(name, column)).collect()
}

fn shape(part: &Component) -> Shape {
    let positions = part.positions();
    match part.topology() {
        Topology::Curves(runs) => Shape::Curves {
            cvs: Spread::of(runs.counts().map(f64::from)),
            length: Spread::of(runs.ranges().map(|cvs| polyline_length(&positions[cvs]))),
        },
        Topology::Mesh(faces) => Shape::Mesh(SurfaceStats::of(faces, positions)),
        Topology::Points => Shape::Points,
        Topology::Tets(tets) => {
            let volumes: Vec<f64> =
                tets.iter().map(|tet| tet_volume(tet.map(|corner| positions[corner as usize]))).collect();
            let inverted = volumes.iter().filter(|volume| **volume <= 0.0).count();
            Shape::Tets { volume: Spread::of(volumes), inverted }
        }
    }
}

/// The length of a polyline.
fn polyline_length(cvs: &[[f32; 3]]) -> f64 {
    cvs.windows(2).map(|pair| (to_f64(pair[1]) - to_f64(pair[0])).norm()).sum()
}

fn volume(volume: &Volume) -> VolumeStats {
    // A volume that was read from a file fits in dense arrays.
    let field = |(name, field): (&str, &SparseField)| {
        AttributeStats::of(&name.into(), &Column::new(field.to_dense().unwrap_or_default()))
    };
    VolumeStats {
        grid: volume.level_grid(),
        velocity_grid: Some(volume.velocity_grid()).filter(|grid| *grid != volume.level_grid()),
        inside: volume.level_set().nodes().filter(|(_, phi)| *phi < 0.0).count(),
        fields: volume.fields().map(field).into(),
        attributes: attributes(volume.once()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::Attr;

    #[test]
    fn curves_have_lengths_and_cv_counts() {
        let cvs = vec![[0.0; 3], [3.0, 4.0, 0.0], [3.0, 4.0, 2.0], [7.0; 3]];
        let part = part(&Component::curves(vec![3, 1], cvs).unwrap());
        let Shape::Curves { cvs: Some(cvs), length: Some(length) } = part.shape else { panic!("{part:?}") };
        assert_eq!((cvs.min, cvs.max, cvs.mean()), (1.0, 3.0, 2.0));
        assert_eq!((length.min, length.max, length.mean(), length.sum), (0.0, 7.0, 3.5, 7.0));
        assert_eq!(part.bounds, Some([[0.0; 3], [7.0; 3]]));
    }

    #[test]
    fn non_finite_numbers_are_counted_and_excluded() {
        let mut points = Component::points(vec![[0.0; 3]; 4]);
        points.set(Attr::point("heat"), vec![1.0_f32, f32::NAN, 3.0, f32::INFINITY]).unwrap();
        let stats = part(&points);
        let (_, attributes) = &stats.attributes[0];
        let heat = &attributes[1];
        assert_eq!((&*heat.name, heat.rows, heat.not_finite), ("heat", 4, 2));
        let spread = heat.spreads[0].unwrap();
        assert_eq!((spread.min, spread.max, spread.mean()), (1.0, 3.0, 2.0));
    }

    #[test]
    fn an_attribute_has_a_range_for_each_component() {
        let column = Column::new(vec![[1, -2, 3], [5, 0, 3]]);
        let stats = AttributeStats::of(&"clump".into(), &column);
        let ranges: Vec<_> = stats.spreads.iter().flatten().map(|x| (x.min, x.max, x.mean())).collect();
        assert_eq!(ranges, [(1.0, 5.0, 3.0), (-2.0, 0.0, -1.0), (3.0, 3.0, 3.0)]);
    }

    #[test]
    fn empty_components_have_no_range() {
        let empty = part(&Component::curves(vec![], vec![]).unwrap());
        assert_eq!((empty.bounds, &empty.shape), (None, &Shape::Curves { cvs: None, length: None }));
        assert_eq!(empty.attributes[0].1[0].spreads, [None; 3]);
    }

    #[test]
    fn inverted_and_flat_tets_are_counted() {
        let corners = vec![[0.0; 3], [6.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let tets = Component::tets(vec![[0, 1, 2, 3], [0, 2, 1, 3], [0, 1, 2, 2]], corners).unwrap();
        let Shape::Tets { volume: Some(volume), inverted } = shape(&tets) else { panic!("no tets") };
        assert_eq!((volume.min, volume.max, volume.sum, inverted), (-1.0, 1.0, 0.0, 2));
    }

    #[test]
    fn a_volume_counts_its_inside() {
        let grid = Grid { origin: [0.0; 3], cell: 0.5, size: [2, 1, 1] };
        let cells = Volume::new(grid, vec![-0.1, 0.0], [vec![1.0; 3], vec![0.0; 4], vec![0.0; 4]]).unwrap();
        let stats = volume(&cells);
        assert_eq!((stats.inside, stats.fields.len(), stats.fields[1].rows), (1, 4, 3));
    }
}
