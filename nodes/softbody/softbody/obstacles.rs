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
        let still =
            meshes.iter().all(|mesh| mesh.table(Owner::Point).column("P") == meshes[0].table(Owner::Point).column("P"));
        let span = last.number() - first.number();
        let share = |frame: Frame| if span > 0.0 { (frame.number() - first.number()) / span } else { 1.0 };
        let pose = |(sample, mesh): (&(Frame, Vec<Arc<Geometry>>), &Component)| ObstaclePose {
            share: share(sample.0),
            positions: mesh.positions().iter().map(|p| p.map(f64::from)).collect(),
        };
        let poses = samples.iter().zip(&meshes).map(pose).take(if still { 1 } else { samples.len() });
        let poses: Vec<ObstaclePose> = poses.collect();
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
