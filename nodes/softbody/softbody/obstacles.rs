//! Colliders in motion over a time step.

use std::sync::Arc;

use bodies::collision::{Obstacle, ObstaclePose};
use engine::prelude::*;

/// The colliders of a step of `seconds`; `samples` holds the wires at increasing times within it.
///
/// # Errors
/// If a collider changes its topology within the step, or a point is not finite.
pub(super) fn obstacles(
    samples: &[(Frame, Vec<Arc<Geometry>>)],
    seconds: f64,
    thickness: f64,
    friction: f64,
) -> Result<Vec<Obstacle>> {
    // A mirror turns the faces round, but they keep their corners: which way they face does not matter here.
    let same = |a: &Component, b: &Component| {
        a.topology().same(b.topology()) || a.topology() == b.topology() || turned_round(a, b)
    };
    let Some(((first, wires), (last, _))) = samples.first().zip(samples.last()) else { return Ok(Vec::new()) };
    let mut obstacles = Vec::with_capacity(wires.len());
    for wire in 0..wires.len() {
        let at =
            |sample: &(Frame, Vec<Arc<Geometry>>)| sample.1.get(wire).and_then(|geometry| geometry.mesh()).cloned();
        let meshes: Vec<Component> = samples.iter().filter_map(at).collect();
        if let Some(other) = meshes.iter().find(|mesh| !same(mesh, &meshes[0])) {
            let count = |mesh: &Component| format!("{} faces of {} points", mesh.element_count(), mesh.point_count());
            let fact = format!("`colliders` {wire} changes from {} to {}", count(&meshes[0]), count(other));
            return Err(Error::refused(fact).hint("a collider needs the same faces and points at every frame"));
        }
        let place = |mesh: &Component| mesh.table(Owner::Point).column(P.name).cloned();
        // Samples that are still as the first.
        let held = meshes.iter().take_while(|mesh| place(mesh) == place(&meshes[0])).count();
        let kept: Vec<usize> = match held {
            held if held == meshes.len() => vec![0],
            // What is there at whole frames alone, as numbered files are, moves evenly from one to the next.
            held if held + 1 == meshes.len() => vec![0, held],
            _ => (0..meshes.len()).collect(),
        };
        let span = last.number() - first.number();
        let share = |frame: Frame| if span > 0.0 { (frame.number() - first.number()) / span } else { 1.0 };
        let pose = |sample: usize| ObstaclePose {
            share: share(samples[sample].0),
            positions: meshes[sample].positions().iter().map(|p| p.map(f64::from)).collect(),
        };
        let poses: Vec<ObstaclePose> = kept.into_iter().map(pose).collect();
        let obstacle = Obstacle::new(&meshes[0].triangles().corners, &poses, seconds, thickness, friction);
        obstacles.push(obstacle.map_err(|error| Error::refused(format!("`colliders` {wire}: {error}")))?);
    }
    Ok(obstacles)
}

/// Whether `b` is `a` mirrored.
fn turned_round(a: &Component, b: &Component) -> bool {
    let inside_out = a.faces().zip(b.faces()).is_some_and(|(a, b)| a.is_inside_out(b));
    inside_out && a.point_count() == b.point_count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(faces: &[u32]) -> Geometry {
        let points = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        Component::mesh(vec![faces.len() as u32], faces.to_vec(), points).unwrap().into()
    }

    /// Five samples of a step, of which only the last has moved: half of the way after half of the step, at one speed.
    #[test]
    fn a_collider_known_at_whole_frames_alone_moves_evenly_between_them() {
        let at = |height: f32| {
            let mut sheet = sheet(&[0, 1, 2, 3]);
            sheet.part_mut(Kind::Mesh).unwrap().edit(P).unwrap().iter_mut().for_each(|p| p[1] = height);
            vec![Arc::new(sheet)]
        };
        let samples = |heights: [f32; 5]| -> Vec<(Frame, Vec<Arc<Geometry>>)> {
            let frame = |k: usize| Frame::whole(1).plus_ticks(Frame::TICKS * k as i64 / 4);
            heights.into_iter().enumerate().map(|(k, height)| (frame(k), at(height))).collect()
        };
        for heights in [[0.0, 0.0, 0.0, 0.0, 0.5], [0.0, 0.125, 0.25, 0.375, 0.5]] {
            let obstacle = &obstacles(&samples(heights), 0.1, 0.01, 0.5).unwrap()[0];
            for share in [0.0, 0.3, 0.5, 0.9, 1.0] {
                let (height, speed) = (obstacle.at(share)[0][1], obstacle.velocity(share, 0, [1.0, 0.0, 0.0])[1]);
                assert!((height - 0.5 * share).abs() < 1e-9 && (speed - 5.0).abs() < 1e-6, "{share}: {height} {speed}");
            }
        }
        let kept = &obstacles(&samples([0.0, 0.0, 0.3, 0.0, 0.5]), 0.1, 0.01, 0.5).unwrap()[0];
        assert!((kept.at(0.5)[0][1] - 0.3).abs() < 1e-6, "what is known within the step is used");
    }

    #[test]
    fn a_collider_may_be_mirrored_but_not_joined_otherwise() {
        let step = |before: &[u32], after: &[u32]| {
            let wires = [sheet(before), sheet(after)].map(|sheet| vec![Arc::new(sheet)]);
            let [before, after] = wires;
            obstacles(&[(Frame::whole(1), before), (Frame::whole(2), after)], 0.1, 0.01, 0.5)
        };
        assert!(step(&[0, 1, 2, 3], &[0, 3, 2, 1]).is_ok(), "turned round");
        for other in [&[0, 2, 1, 3][..], &[3, 2, 1, 0], &[0, 1, 2]] {
            let error = step(&[0, 1, 2, 3], other).err().map(|error| error.fact);
            assert!(error.is_some_and(|fact| fact.starts_with("`colliders` 0 changes from 1 faces of 4")), "{other:?}");
        }
    }
}
