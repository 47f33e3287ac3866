//! The surface of a volume as a mesh.

use engine::prelude::*;
use liquid::extract::{Placement, QuadMesh, extract};
use rayon::prelude::*;

use super::volume::VolumeLevelSet;

/// Points that one thread reads the velocity for at a time.
const CHUNK: usize = 512;

/// The mesh of a volume's φ = 0, with `N`, `v` and `thickness` where they are wanted.
///
/// # Errors
/// Where there are more points than a mesh may have.
pub(crate) fn surface(cx: &Cx, volume: &Volume) -> Result<Component> {
    let level_set = VolumeLevelSet::new(volume);
    let mesh = extract(level_set.view(), Placement::Projected);
    let grid = volume.level_grid();
    let points = mesh.points_at(grid.origin.map(f64::from), f64::from(grid.cell));
    let velocity = cx.wants(V).then(|| velocity_at(volume, &points));
    let thickness = cx.wants(THICKNESS).then(|| {
        let cells = mesh.thickness(level_set.view());
        cells.into_iter().map(|cells| cells * grid.cell).collect::<Vec<_>>()
    });
    let QuadMesh { normals, quads, .. } = mesh;
    let mut surface = Component::mesh(vec![4; quads.len()], quads.into_flattened(), points)?;
    surface.set(N, normals)?;
    if let Some(velocity) = velocity {
        surface.set(V, velocity)?;
    }
    if let Some(thickness) = thickness {
        surface.set(THICKNESS, thickness)?;
    }
    Ok(surface)
}

/// The velocity of a volume at points, metres.
pub(crate) fn velocity_at(volume: &Volume, points: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let parts = points.par_chunks(CHUNK).map(|points| {
        let mut sampler = volume.sampler();
        points.iter().map(|point| sampler.velocity(*point)).collect::<Vec<_>>()
    });
    parts.collect::<Vec<_>>().concat()
}
