//! Conversion of a geometry to another unit of length.
//!
//! Every length and velocity is multiplied in f64 and rounded once; everything else is unchanged, unknown attributes
//! included. Limit: a product may leave the range of f32.

use super::{Component, Geometry, Kind, P, PREF, THICKNESS, V, WIDTH};

fn scaled(factor: f64) -> impl Fn(f32) -> f32 {
    move |x| (f64::from(x) * factor) as f32
}

/// Whether lengths stay unchanged.
fn is_one(factor: f64) -> bool {
    factor.to_bits() == 1.0_f64.to_bits()
}

impl Component {
    /// Multiplies every known length by `factor`. If it is 1, nothing is copied.
    pub fn scale_lengths(&mut self, factor: f64) {
        if is_one(factor) {
            return;
        }
        let length = scaled(factor);
        for attribute in [P, PREF, V] {
            for row in self.edit(attribute).into_iter().flatten() {
                *row = row.map(&length);
            }
        }
        for attribute in [WIDTH, THICKNESS] {
            for row in self.edit(attribute).into_iter().flatten() {
                *row = length(*row);
            }
        }
    }
}

impl Geometry {
    /// Multiplies every known length of every component by `factor`. If it is 1, nothing is copied.
    pub fn scale_lengths(&mut self, factor: f64) {
        if is_one(factor) {
            return;
        }
        for kind in Kind::ALL {
            if let Some(part) = self.part_mut(kind) {
                part.scale_lengths(factor);
            }
        }
        if let Some(volume) = self.volume() {
            let bigger = volume.with_lengths(scaled(factor));
            self.put_volume(bigger);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ENVELOPE, Grid, UVW, Volume};
    use super::*;

    #[test]
    fn lengths_are_scaled_and_nothing_else() {
        let mut points = Component::points(vec![[1.0, 2.0, 3.0]]);
        points.set(V, vec![[10.0, 0.0, 0.0]]).unwrap();
        points.set(WIDTH, vec![0.5]).unwrap();
        points.set(THICKNESS, vec![2.0]).unwrap();
        points.set(UVW, vec![[0.5; 3]]).unwrap();
        points.set(ENVELOPE, vec![1.0]).unwrap();
        let mut geometry = Geometry::from(points);
        geometry.scale_lengths(0.01);
        let out = geometry.points().unwrap();
        assert_eq!(out.positions(), [[0.01, 0.02, 0.03]]);
        assert_eq!((out.get(V), out.get(WIDTH)), (Some(&[[0.1, 0.0, 0.0]][..]), Some(&[0.005][..])));
        assert_eq!(out.get(THICKNESS), Some(&[0.02][..]));
        assert_eq!((out.get(UVW), out.get(ENVELOPE)), (Some(&[[0.5; 3]][..]), Some(&[1.0][..])));
    }

    #[test]
    fn a_volume_is_scaled_with_its_level_set_and_velocity() {
        let grid = Grid { origin: [1.0; 3], cell: 0.5, size: [1; 3] };
        let mut geometry = Geometry::default();
        geometry.put_volume(Volume::new(grid, vec![-0.25], [(); 3].map(|()| vec![3.0; 2])).unwrap());
        geometry.scale_lengths(2.0);
        let out = geometry.volume().unwrap();
        assert_eq!(out.level_grid(), Grid { origin: [2.0; 3], cell: 1.0, size: [1; 3] });
        assert_eq!((out.level_set().to_dense().unwrap()[0], out.velocity()[0].to_dense().unwrap()[0]), (-0.5, 6.0));
    }

    #[test]
    fn a_scale_of_one_shares_every_array() {
        let geometry = Geometry::from(Component::points(vec![[0.1; 3]]));
        let mut same = geometry.clone();
        same.scale_lengths(1.0);
        assert_eq!(same.arrays(), geometry.arrays());
    }
}
