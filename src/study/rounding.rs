//! What the storage of results as f32 changes of an error: the floor where the reference is exact.

use engine::geometry::{Column, Component, Geometry, P};

use super::nearest;
use super::norms::Measure;

impl Measure {
    /// What the storage of a result as f32 may change of an error: four units in the last place of the largest number that is
    /// compared. Of a volume, what moving the whole surface by that much would; nothing of a metric, which is not stored.
    pub(super) fn rounding(&self, geometry: &Geometry) -> f64 {
        match self {
            Self::Points | Self::Surface => of_positions(geometry),
            Self::Attribute(name) if name == P.name => of_positions(geometry),
            Self::Attribute(name) => {
                let columns =
                    geometry.parts().flat_map(Component::columns).filter(|(_, known, _)| known[..] == name[..]);
                let largest = columns.map(|(.., column)| match column {
                    Column::F1(rows) => largest(rows),
                    Column::F3(rows) => largest(rows.as_flattened()),
                    Column::F4(rows) => largest(rows.as_flattened()),
                    // Whole numbers are exact.
                    Column::I1(_) | Column::I3(_) | Column::I4(_) => 0.0,
                });
                four_units(largest.fold(0.0, f32::max))
            }
            Self::Volume => {
                let surface = geometry.mesh().or(geometry.tets()).map_or(0.0, nearest::area);
                surface * of_positions(geometry)
            }
            Self::Metric { .. } => 0.0,
        }
    }

    /// What [`Measure::rounding`] is, in words.
    pub(super) fn rounding_name(&self) -> &'static str {
        match self {
            Self::Points | Self::Surface | Self::Volume => "the rounding of stored positions",
            Self::Attribute(name) if name == P.name => "the rounding of stored positions",
            Self::Attribute(_) => "the rounding of stored values",
            Self::Metric { .. } => "0, as metrics are not rounded",
        }
    }
}

fn of_positions(geometry: &Geometry) -> f64 {
    let largest = geometry.parts().map(|part| largest(part.positions().as_flattened()));
    four_units(largest.fold(0.0, f32::max))
}

fn largest(numbers: &[f32]) -> f32 {
    numbers.iter().fold(0.0_f32, |largest, x| largest.max(x.abs()))
}

/// Four units in the last place; none of 0, which is exact.
fn four_units(number: f32) -> f64 {
    if number == 0.0 { 0.0 } else { 4.0 * (f64::from(number.next_up()) - f64::from(number)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::{ID, V};

    #[test]
    fn what_is_compared_is_rounded_as_it_is_stored() {
        let square = vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];
        let mut mesh = Component::mesh(vec![4], vec![0, 1, 2, 3], square).unwrap();
        mesh.set(V, vec![[0.5, 0.0, -0.25]; 4]).unwrap();
        mesh.set(ID, vec![7; 4]).unwrap();
        let geometry: Geometry = mesh.into();
        // Units in the last place of 4 and of 0.5.
        let (of_4, of_half) = (libm::exp2(-21.0), libm::exp2(-24.0));
        let attribute = |name: &str| Measure::Attribute(name.into());
        for (measure, expected) in [
            (Measure::Points, 4.0 * of_4),
            (Measure::Surface, 4.0 * of_4),
            (attribute("P"), 4.0 * of_4),
            (attribute("v"), 4.0 * of_half),
            (attribute("id"), 0.0),
            (Measure::Volume, 16.0 * 4.0 * of_4),
            (Measure::Metric { node: "a".into(), metric: "b".into() }, 0.0),
        ] {
            assert_eq!(measure.rounding(&geometry), expected, "{measure:?}");
        }
    }
}
