//! A geometry in another unit of length.
//!
//! Every number that is a length or has one in it (a velocity) is multiplied in f64 and rounded once; all else stays,
//! attributes that convect does not know included.

use engine::geometry::{Component, Geometry, Grid, Kind, P, PREF, THICKNESS, V, Volume, WIDTH};

/// `geometry` with every known length times `factor`; 1 touches nothing.
///
/// # Errors
/// Where a length becomes more than an f32 holds.
pub(super) fn scaled(mut geometry: Geometry, factor: f64) -> Result<Geometry, String> {
    if factor.to_bits() == 1.0_f64.to_bits() {
        return Ok(geometry);
    }
    let length = |x: f32| (f64::from(x) * factor) as f32;
    for kind in Kind::ALL {
        if let Some(part) = geometry.part_mut(kind) {
            scale_part(part, length);
            if let Some((_, name, _)) = part.columns().find(|(.., column)| column.first_not_finite().is_some()) {
                return Err(format!("`{name}` of {kind} times {factor:?} is more than an f32 holds"));
            }
        }
    }
    if let Some(volume) = geometry.volume() {
        let grid = volume.grid();
        let grid = Grid { origin: grid.origin.map(length), cell: length(grid.cell), size: grid.size };
        let field = |field: &[f32]| field.iter().copied().map(length).collect();
        let velocity = volume.velocity().each_ref().map(|axis| field(axis));
        let made = Volume::new(grid, field(volume.level_set()), velocity);
        let mut bigger = made.map_err(|error| error.to_string())?;
        *bigger.once_mut() = volume.once().clone();
        geometry.put_volume(bigger);
    }
    Ok(geometry)
}

fn scale_part(part: &mut Component, length: impl Fn(f32) -> f32) {
    for attribute in [P, PREF, V] {
        for row in part.edit(attribute).into_iter().flatten() {
            *row = row.map(&length);
        }
    }
    for attribute in [WIDTH, THICKNESS] {
        for row in part.edit(attribute).into_iter().flatten() {
            *row = length(*row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::geometry::{ENVELOPE, UVW};

    #[test]
    fn lengths_are_scaled_and_nothing_else() {
        let mut points = Component::points(vec![[1.0, 2.0, 3.0]]);
        points.set(V, vec![[10.0, 0.0, 0.0]]).unwrap();
        points.set(WIDTH, vec![0.5]).unwrap();
        points.set(UVW, vec![[0.5; 3]]).unwrap();
        points.set(ENVELOPE, vec![1.0]).unwrap();
        let out = scaled(points.into(), 0.01).unwrap();
        let out = out.points().unwrap();
        assert_eq!(out.positions(), [[0.01, 0.02, 0.03]]);
        assert_eq!((out.get(V), out.get(WIDTH)), (Some(&[[0.1, 0.0, 0.0]][..]), Some(&[0.005][..])));
        assert_eq!((out.get(UVW), out.get(ENVELOPE)), (Some(&[[0.5; 3]][..]), Some(&[1.0][..])));
    }

    #[test]
    fn a_volume_grows_with_its_level_set() {
        let grid = Grid { origin: [1.0; 3], cell: 0.5, size: [1; 3] };
        let mut geometry = Geometry::default();
        geometry.put_volume(Volume::new(grid, vec![-0.25], [(); 3].map(|()| vec![3.0; 2])).unwrap());
        let out = scaled(geometry, 2.0).unwrap();
        let out = out.volume().unwrap();
        assert_eq!(out.grid(), Grid { origin: [2.0; 3], cell: 1.0, size: [1; 3] });
        assert_eq!((out.level_set()[0], out.velocity()[0][0]), (-0.5, 6.0));
    }

    #[test]
    fn a_length_beyond_an_f32_is_refused() {
        let error = scaled(Component::points(vec![[0.0, 10.0, 0.0]]).into(), 1e38).unwrap_err();
        assert_eq!(error, "`P` of points times 1e38 is more than an f32 holds");
    }

    #[test]
    fn a_scale_of_one_shares_every_array() {
        let geometry = Geometry::from(Component::points(vec![[0.1; 3]]));
        assert_eq!(scaled(geometry.clone(), 1.0).unwrap().arrays(), geometry.arrays());
    }
}
