//! How thick the liquid is behind each point of its surface.

use numerics::parallel;
use numerics::vector::{Vec3, scale, sub};

use super::QuadMesh;
use crate::level_set::{PhiSampler, PhiView};

/// Cells behind a vertex at which the search starts: nearer, φ between centres is not sure to be inside.
const START: f32 = 0.5;
/// The shortest step of the search, cells.
const SHORTEST: f32 = 0.25;
/// Part of a normal that is rounding, where it should be along a wall.
const ALONG: f32 = 1e-3;
/// Steps after which a vertex gets the distance that was reached.
const MOST_STEPS: usize = 4096;
/// Vertices that one thread handles at a time.
const CHUNK: usize = 512;

impl QuadMesh {
    /// For each vertex the distance, in cells, to the surface on the other side of the liquid, against the normal.
    pub fn thickness(&self, view: PhiView<'_>) -> Vec<f32> {
        let of_vertex = |sampler: &mut PhiSampler<'_>, n: usize| behind(sampler, view, self.points[n], self.normals[n]);
        parallel::tabulate_with(self.points.len(), CHUNK, || PhiSampler::new(view), of_vertex)
    }
}

/// A normal without what leads the way along it out of a wall that the point is on, where that is rounding.
fn along_walls(view: PhiView<'_>, point: Vec3, normal: Vec3) -> Vec3 {
    [0, 1, 2].map(|k| {
        let wall = if normal[k] > 0.0 { view.low[k] } else { view.high[k] } as f32;
        if point[k] == wall && normal[k].abs() < ALONG { 0.0 } else { normal[k] }
    })
}

/// Goes into the liquid by |φ| at a time (sphere tracing: Hart 1996) until it is outside, or leaves the domain.
fn behind(sampler: &mut PhiSampler<'_>, view: PhiView<'_>, point: Vec3, normal: Vec3) -> f32 {
    let normal = along_walls(view, point, normal);
    let at = |way: f32| sub(point, scale(normal, way));
    let is_within = |p: Vec3| (0..3).all(|k| view.low[k] as f32 <= p[k] && p[k] <= view.high[k] as f32);
    let (mut before, mut inside) = (0.0, 0.0);
    let mut way = START;
    for _ in 0..MOST_STEPS {
        let place = at(way);
        if !is_within(place) {
            return leave(view, point, normal, way);
        }
        let phi = sampler.at(place);
        if phi >= 0.0 {
            // The crossing, on the line between the last two values.
            let share = if inside < 0.0 { inside / (inside - phi) } else { 1.0 };
            return before + share * (way - before);
        }
        (before, inside) = (way, phi);
        way += (-phi).max(SHORTEST);
    }
    way
}

/// The way, at most `way`, at which a line from `point` against `normal` leaves the domain.
fn leave(view: PhiView<'_>, point: Vec3, normal: Vec3, way: f32) -> f32 {
    let mut least = way;
    for k in 0..3 {
        let wall = if normal[k] > 0.0 { view.low[k] } else { view.high[k] } as f32;
        let there = (point[k] - wall) / normal[k];
        if there >= 0.0 && there < least {
            least = there.abs();
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use crate::extract::{Placement, extract};
    use crate::level_set::{BAND, LevelSet, PhiSampler};
    use crate::rows::CellRows;
    use numerics::vector::length;

    fn set(distance: impl Fn([f32; 3]) -> f32 + Sync) -> LevelSet {
        let rows = CellRows::cuboid([0; 3], [24; 3]);
        let phi = rows.tabulate(|cell| distance(cell.map(|x| x as f32 + 0.5)).clamp(-BAND, BAND));
        LevelSet::new(&rows, &phi, [0; 3], [24; 3])
    }

    #[test]
    fn a_ball_is_as_thick_as_its_diameter() {
        let ball = set(|p| length(p.map(|x| x - 12.0)) - 8.3);
        let mesh = extract(ball.view(), Placement::Projected);
        let thickness = mesh.thickness(ball.view());
        assert_eq!(thickness.len(), mesh.points.len());
        assert!(thickness.iter().all(|t| (t - 16.6).abs() < 0.15), "{thickness:?}");
    }

    #[test]
    fn a_sheet_has_its_own_thickness_and_not_that_of_the_liquid_beyond() {
        // From x = 4.2 to 6.9, and from 12 to 20.
        let sheet = set(|[x, ..]| ((x - 5.55).abs() - 1.35).min((x - 16.0).abs() - 4.0));
        let mesh = extract(sheet.view(), Placement::Projected);
        let thickness = mesh.thickness(sheet.view());
        let flat = mesh.points.iter().zip(&mesh.normals).zip(&thickness).filter(|((_, n), _)| n[0].abs() > 0.999);
        let (mut thin, mut thick) = (0, 0);
        for ((point, _), t) in flat {
            let expected = if point[0] < 9.0 { 2.7 } else { 8.0 };
            assert!((t - expected).abs() < 0.1, "{point:?}: {t}");
            if point[0] < 9.0 { thin += 1 } else { thick += 1 }
        }
        assert!(thin > 500 && thick > 500);
    }

    #[test]
    fn liquid_on_a_wall_ends_there() {
        let pool = set(|[_, y, _]| y - 5.25);
        let mesh = extract(pool.view(), Placement::Projected);
        let thickness = mesh.thickness(pool.view());
        let up = mesh.normals.iter().zip(&thickness).filter(|(n, _)| n[1] > 0.999);
        assert!(up.clone().count() > 400 && up.into_iter().all(|(_, t)| (t - 5.25).abs() < 0.05));
    }

    /// Where a level surface meets walls, rounding must not send the way out of them.
    #[test]
    fn a_pool_is_as_thick_at_its_rim() {
        let pool = set(|[_, y, _]| y - 5.25);
        let normals = [[7e-7, 1.0, -7e-7], [-7e-7, 1.0, 7e-7], [1e-9, 1.0, 0.0], [0.0, 1.0, 0.0]];
        for point in [[0.0, 5.25, 24.0], [24.0, 5.25, 24.0], [0.0, 5.25, 0.0], [0.0, 5.25, 11.5]] {
            for normal in normals {
                let thickness = super::behind(&mut PhiSampler::new(pool.view()), pool.view(), point, normal);
                assert!((thickness - 5.25).abs() < 1e-3, "{point:?} {normal:?}: {thickness}");
            }
        }
        // A normal that leans into the wall leads out of the liquid at once: 0, without a sign.
        for normal in [[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]] {
            let thickness = super::behind(&mut PhiSampler::new(pool.view()), pool.view(), [0.0, 5.25, 11.5], normal);
            assert_eq!(thickness.to_bits(), 0, "{thickness}");
        }
    }
}
