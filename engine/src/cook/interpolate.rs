//! Results between whole frames: those of windows on a cubic through the neighbours, so that motion blur does not shimmer,
//! those of sequences of files on a line from one file to the next, as USD has it.

use std::sync::Arc;

use super::call::guarded;
use super::deliver::stays;
use super::store::Cooked;
use crate::error::{Error, Result};
use crate::geometry::{Component, Geometry, P, V};
use crate::node::RestoreBetween;

/// The input whose points a window moves, at the frame that is asked for and at the whole frames around.
pub(super) struct Followed<'a> {
    pub(super) now: &'a Geometry,
    pub(super) near: [&'a Geometry; 4],
    pub(super) restore: RestoreBetween,
}

/// The results of a window `share` of the way from `near[1]` to `near[2]`; `near[0]` and `near[3]` are the frames before
/// and after. What it moves the points of the `followed` input by goes along the cubic Hermite through them (Catmull–Rom
/// slopes), and is added to that input; without one `P` and `v` themselves do, and all else is that of `near[1]`.
///
/// # Errors
/// Where the followed input has other points at one of these frames, or where its restoration panics.
pub(super) fn interpolated(near: [&Cooked; 4], share: f32, followed: Option<Followed<'_>>) -> Result<Cooked> {
    let one = |port: usize| {
        let near = near.map(|cooked| &*cooked[port]);
        let result = match &followed {
            Some(followed) => followed.moved(near, share)?,
            None => interpolated_geometry(near, share),
        };
        Ok(Arc::new(result))
    };
    (0..near[1].len()).map(one).collect()
}

impl Followed<'_> {
    fn moved(&self, near: [&Geometry; 4], share: f32) -> Result<Geometry> {
        let mut result = self.now.clone();
        for part in self.now.parts() {
            let count = part.point_count();
            let (Some([a, b, c, d]), Some([e, f, g, h])) = (rows_of(near, part), rows_of(self.near, part)) else {
                return Err(Error::refused(format!("its {} have other points between frames", part.kind())));
            };
            let moved = |row: usize| {
                std::array::from_fn(|k| {
                    let by =
                        [a[row][k] - e[row][k], b[row][k] - f[row][k], c[row][k] - g[row][k], d[row][k] - h[row][k]];
                    part.positions()[row][k] + hermite(by, share)
                })
            };
            let moved: Vec<[f32; 3]> = (0..count).map(moved).collect();
            if let Some(part) = result.part_mut(part.kind()) {
                part.set(P, moved)?;
            }
        }
        guarded(|| {
            (self.restore)(self.now, &mut result);
            Ok(())
        })?;
        Ok(result)
    }
}

/// The positions of each geometry's component of the kind of `part`, if all have as many points.
fn rows_of<'a>(near: [&'a Geometry; 4], part: &Component) -> Option<[&'a [[f32; 3]]; 4]> {
    let of = |geometry: &'a Geometry| {
        geometry.part(part.kind()).map(Component::positions).filter(|rows| rows.len() == part.point_count())
    };
    let [a, b, c, d] = near.map(of);
    Some([a?, b?, c?, d?])
}

fn interpolated_geometry(near: [&Geometry; 4], share: f32) -> Geometry {
    let mut result = near[1].clone();
    let kinds: Vec<_> = near[1].parts().map(|part| part.kind()).collect();
    for kind in kinds {
        let Some(part) = result.part_mut(kind) else { continue };
        for attribute in [P, V] {
            let rows = near.map(|geometry| geometry.part(kind).and_then(|part| part.get(attribute)));
            let [Some(a), Some(b), Some(c), Some(d)] = rows else { continue };
            if [a, c, d].iter().any(|rows| rows.len() != b.len()) {
                continue;
            }
            let mixed: Vec<[f32; 3]> = (0..b.len())
                .map(|row| std::array::from_fn(|k| hermite([a[row][k], b[row][k], c[row][k], d[row][k]], share)))
                .collect();
            part.set(attribute, mixed).expect("as many rows as before");
        }
    }
    result
}

/// What a source of numbered files gives `share` of the way from one whole frame to the next: `P` and `v` of points that
/// are in both are interpolated linearly, all else is that of the first.
pub(super) fn between_files([from, to]: [&Cooked; 2], share: f32) -> Cooked {
    let one = |(from, to): (&Arc<Geometry>, &Arc<Geometry>)| {
        let mut result = (**from).clone();
        for part in from.parts() {
            let Some(next) = to.part(part.kind()).filter(|next| stays(part, next)) else { continue };
            for attribute in [P, V] {
                let (Some(a), Some(b)) = (part.get(attribute), next.get(attribute)) else { continue };
                let on_line = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|k| a[k] + share * (b[k] - a[k]));
                let mixed: Vec<[f32; 3]> = a.iter().zip(b).map(on_line).collect();
                if let Some(part) = result.part_mut(part.kind()) {
                    part.set(attribute, mixed).expect("as many rows as before");
                }
            }
        }
        Arc::new(result)
    };
    from.iter().zip(to.iter()).map(one).collect()
}

/// The cubic through `b` and `c` with slopes (c−a)/2 and (d−b)/2, relative to `b` so that far from 0 nothing is lost.
fn hermite([a, b, c, d]: [f32; 4], t: f32) -> f32 {
    let (from, to) = (0.5 * (c - a), 0.5 * (d - b));
    let rise = c - b;
    b + t * (from + t * ((3.0 * rise - 2.0 * from - to) + t * (from + to - 2.0 * rise)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_met_exactly() {
        let at = |x: f32| x * x;
        for share in [0.0, 0.25, 0.5, 1.0] {
            assert!((hermite([at(-1.0), at(0.0), at(1.0), at(2.0)], share) - at(share)).abs() < 1e-6);
        }
    }
}
