//! Results between whole frames: those of windows on a cubic through the neighbours, so that motion blur does not shimmer,
//! those of sequences of files on a line from one file to the next, as USD has it.

use std::sync::Arc;

use super::call::guarded;
use super::deliver::stays;
use super::store::Cooked;
use crate::error::Result;
use crate::geometry::{Geometry, P, V};
use crate::node::RestoreBetween;

/// The results of a window `share` of the way from `near[1]` to `near[2]`; `near[0]` and `near[3]` are the frames before
/// and after. `P` and `v` go along the cubic Hermite through them (Catmull–Rom slopes); all else is that of `near[1]`.
/// `restore` then corrects each output.
///
/// # Errors
/// Where `restore` panics.
pub(super) fn interpolated(near: [&Cooked; 4], share: f32, restore: Option<RestoreBetween>) -> Result<Cooked> {
    let one = |port: usize| {
        let near = near.map(|cooked| &*cooked[port]);
        let mut result = interpolated_geometry(near, share);
        if let Some(restore) = restore {
            guarded(|| {
                restore([near[1], near[2]], share, &mut result);
                Ok(())
            })?;
        }
        Ok(Arc::new(result))
    };
    (0..near[1].len()).map(one).collect()
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
