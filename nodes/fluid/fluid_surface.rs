//! Fluid_Surface: the surface of a volume as a mesh.
//!
//! The extraction is [`liquid::extract`]'s dual marching cubes: watertight, manifold, closed along the ends of the volume's
//! grid. FluidSolve makes its output `surface` by the same function, so both have the same bits.
//!
//! `smooth` moves the points of the mesh (Taubin 1995) rather than averaging the level set, in which thin sheets and small
//! drops would vanish; then each closed surface encloses what it did.

use engine::prelude::*;

use crate::shared::surface::{SurfaceDetail, surface};

inputs! { INPUTS:
    VOLUME: Input = Input::one("volume", Kind::Volume, "A level set, and a velocity for the points of the surface.");
}

params! { PARAMS:
    RESOLUTION: Param<i64> = Param::int("resolution", 1,
        "Cells of the mesh along a side of a cell of the volume: 2 makes four times as many points, interpolated smoothly. It adds \
         no detail; `resolution` of FluidSolve does.").within(1.0, 8.0).soft(1.0, 4.0);
    SMOOTH: Param<i64> = Param::int("smooth", 0,
        "Passes that fade ripples of a few cells. Each closed surface keeps its volume, and thin sheets and drops stay.")
        .within(0.0, 1000.0).soft(0.0, 20.0);
}

const SURFACE: Output = Output::new("surface", &[Kind::Mesh], "The surface, closed, of quads that face outward.");

pub(crate) static NODE: Node = Node::new(
    "Fluid_Surface",
    2,
    "Makes a mesh of the surface of a liquid: watertight, smooth where the liquid is, with normals, velocities and the \
     thickness of the liquid behind each point.",
    Cook::Pure(cook),
)
.inputs(INPUTS)
.params(PARAMS)
.accuracy(&[Accuracy::larger("resolution", Trials::These(&["1", "2", "4"]))])
.outputs(&[&SURFACE])
.writes(&[&P, &N, &V, &THICKNESS])
.changes_topology();

fn cook(cx: &Cx) -> Result<Outputs> {
    let mut out = Geometry::default();
    if let Some(volume) = cx.input(VOLUME).volume() {
        let detail = SurfaceDetail { resolution: cx.get(RESOLUTION) as u32, smooth: cx.get(SMOOTH) as u32 };
        out.put(surface(cx, volume, detail)?);
    }
    Ok(SURFACE.with(out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};
    use engine::geometry::Grid;
    use numerics::vector::{dot, length, sub};

    /// A ball of radius 0.3 m in a box of 1 m, which moves along x.
    fn ball() -> Geometry {
        let n = 24;
        let cell = 1.0 / n as f32;
        let grid = Grid { origin: [-0.5, 2.0, 0.0], cell, size: [n; 3] };
        let at = |k: usize| {
            let [x, y, z] = [k % 24, k / 24 % 24, k / 576].map(|x| (x as f32 + 0.5) * cell - 0.5);
            length([x, y, z]) - 0.3
        };
        let phi = (0..grid.cells()).map(at).collect();
        let faces = |axis: usize, u: f32| vec![u; grid.faces(axis)];
        let volume = Volume::new(grid, phi, [faces(0, 2.0), faces(1, 0.0), faces(2, -1.0)]).unwrap();
        let mut geometry = Geometry::default();
        geometry.put_volume(volume);
        geometry
    }

    #[test]
    fn a_ball_becomes_a_sphere_where_the_grid_lies() {
        let out = bench(&NODE).input(VOLUME, ball()).cook();
        let mesh = out.mesh();
        let centre = [0.0, 2.5, 0.5];
        assert!(mesh.point_count() > 500);
        let normals = mesh.get(N).unwrap();
        for (p, normal) in mesh.positions().iter().zip(normals) {
            let way = sub(*p, centre);
            let far = length(way);
            assert!((far - 0.3).abs() < 1e-3, "{far}");
            let along = dot(way, *normal) / far;
            assert!(along > 0.999, "{along}");
        }
        assert!(mesh.get(THICKNESS).unwrap().iter().all(|t| (t - 0.6).abs() < 0.01));
        assert!(mesh.get(V).unwrap().iter().all(|v| (v[0] - 2.0).abs() + v[1].abs() + (v[2] + 1.0).abs() < 1e-5));
    }

    #[test]
    fn finer_and_smoother_it_is_the_same_ball() {
        let volume = |mesh: &Component| {
            let corner = |at: &u32| mesh.positions()[*at as usize];
            let quads = mesh.faces().unwrap().corners.as_chunks::<4>().0;
            let six = quads.iter().map(|[a, b, c, d]| {
                let [a, b, c, d] = [a, b, c, d].map(corner);
                let origin = [0.0, 2.5, 0.5];
                numerics::volume::six_volumes([origin, a, b, c]) + numerics::volume::six_volumes([origin, a, c, d])
            });
            six.fold(0.0, |sum, x| sum + x) / 6.0
        };
        let ball_volume = 4.0 / 3.0 * std::f64::consts::PI * 0.027;
        let plain = bench(&NODE).input(VOLUME, ball()).cook();
        let error = |mesh: &Component| (volume(mesh) / ball_volume - 1.0).abs();
        let coarse = error(plain.mesh());
        for (resolution, smooth, share) in [(2, 0, 0.5), (3, 0, 0.4), (1, 5, 1.01), (2, 5, 0.5)] {
            let out = bench(&NODE).input(VOLUME, ball()).set(RESOLUTION, resolution).set(SMOOTH, smooth).cook();
            let (now, before) = (out.mesh().point_count() as f64, plain.mesh().point_count() as f64);
            let times = now / before / (resolution * resolution) as f64;
            assert!((0.9..1.1).contains(&times), "{times}");
            let now = error(out.mesh());
            assert!(now < share * coarse, "{resolution} {smooth}: {now} {coarse}");
            assert!(out.mesh().get(THICKNESS).unwrap().iter().all(|t| (t - 0.6).abs() < 0.01));
        }
    }

    #[test]
    fn an_empty_volume_gives_an_empty_mesh() {
        let grid = Grid { origin: [0.0; 3], cell: 0.1, size: [4; 3] };
        let faces = |axis: usize| vec![0.0; grid.faces(axis)];
        let mut geometry = Geometry::default();
        geometry.put_volume(Volume::new(grid, vec![1.0; 64], [faces(0), faces(1), faces(2)]).unwrap());
        let out = bench(&NODE).input(VOLUME, geometry).cook();
        assert_eq!(out.mesh().point_count(), 0);
    }

    #[test]
    fn it_conforms() {
        conforms(&NODE);
    }
}
