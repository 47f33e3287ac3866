//! The surface of a volume as a mesh.

use engine::prelude::*;
use liquid::extract::{Placement, QuadMesh, extract};
use liquid::level_set::{PhiView, refined};
use numerics::parallel;

use super::volume::VolumeLevelSet;

/// Points that one thread reads the velocity for at a time.
const CHUNK: usize = 512;

/// How fine and how smooth a surface is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceDetail {
    /// Cells along a side of a cell of the level set.
    pub(crate) resolution: u32,
    /// Passes that fade ripples.
    pub(crate) smooth: u32,
}

impl SurfaceDetail {
    /// The level set as it is.
    pub(crate) const AS_IS: Self = Self { resolution: 1, smooth: 0 };
}

/// Bytes that a cell takes while its surface is made.
const CELL_BYTES: f64 = 24.0;

/// The mesh of a volume's φ = 0, with `N`, `v` and `thickness` where they are wanted.
///
/// # Errors
/// Where there are more points than a mesh may have, or the cells take more memory than there is.
pub(crate) fn surface(cx: &Cx, volume: &Volume, detail: SurfaceDetail) -> Result<Component> {
    let level_set = VolumeLevelSet::new(volume);
    let grid = volume.level_grid();
    let (view, cell) = (level_set.view(), f64::from(grid.cell) / f64::from(detail.resolution));
    let fine = match detail.resolution {
        1 => None,
        by => {
            let cells = view.rows.len() as f64 * f64::from(by * by * by);
            cx.reserve(cells * CELL_BYTES, "lower `resolution`")?;
            Some((by, refined(view, by)))
        }
    };
    let view = fine.as_ref().map_or(view, |(by, (rows, phi))| {
        let [low, high] = [view.low, view.high].map(|corner| corner.map(|x| x * *by as i32));
        PhiView { rows, phi, outside: view.outside * *by as f32, low, high }
    });
    let mut mesh = extract(view, Placement::Projected);
    mesh.smooth(detail.smooth, view.low, view.high);
    let points = mesh.points_at(grid.origin.map(f64::from), cell);
    let velocity = cx.wants(V).then(|| velocity_at(volume, &points));
    let thickness = cx.wants(THICKNESS).then(|| {
        let cells = mesh.thickness(view);
        cells.into_iter().map(|cells| cells * cell as f32).collect::<Vec<_>>()
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
    let mut velocity = vec![[0.0; 3]; points.len()];
    parallel::for_each(velocity.chunks_mut(CHUNK).zip(points.chunks(CHUNK)), |_, (velocity, points)| {
        let mut sampler = volume.sampler();
        velocity.iter_mut().zip(points).for_each(|(velocity, point)| *velocity = sampler.velocity(*point));
    });
    velocity
}
