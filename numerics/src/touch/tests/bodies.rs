//! Bodies under the solver: what rests, and what is rolled over.

use super::*;
use crate::soft::{Body, Frame, Material, Mesh, Scaled, Solver, State};

const FRAME: f64 = 1.0 / 24.0;

/// A block of cubes of `side`, its lowest corner at `at`: particles, tetrahedra, and the surface facing outwards.
fn block(cells: [u32; 3], side: f64, at: [f64; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>, Vec<[u32; 3]>) {
    let counts = cells.map(|n| n + 1);
    let (mut points, mut tets) = (Vec::new(), Vec::new());
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            points.extend((0..counts[0]).map(|x| [0, 1, 2].map(|axis| at[axis] + side * f64::from([x, y, z][axis]))));
        }
    }
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let corner = |bits: u32| x + (bits & 1) + counts[0] * (y + (bits >> 1 & 1) + counts[1] * (z + (bits >> 2)));
                for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                    tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    let place = |corner: u32| V3::from(points[corner as usize]);
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
    for [a, b, c, d] in &tets {
        for ([p, q, r], inner) in [([*a, *b, *c], *d), ([*a, *b, *d], *c), ([*a, *c, *d], *b), ([*b, *c, *d], *a)] {
            let up = (place(q) - place(p)).cross(&(place(r) - place(p))).dot(&(place(inner) - place(p))) < 0.0;
            let face = if up { [p, q, r] } else { [p, r, q] };
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face));
        }
    }
    faces.sort_unstable();
    let outer = faces.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() == 1).map(|group| group[0].1).collect();
    (points, tets, outer)
}

fn body(points: &[[f64; 3]], tets: &[[u32; 4]], stiffness: f64) -> Body {
    let plain = |value| Scaled { value, mask: None };
    let material = Material { density: plain(1000.0), stiffness: plain(stiffness), damping: plain(0.02) };
    Body::new(&Mesh { points, tets, ..Mesh::default() }, &material, &[]).unwrap()
}

#[test]
fn a_block_on_a_mesh_plate_comes_to_rest_and_does_not_sink() {
    let thickness = 2e-3;
    let (points, tets, faces) = block([3, 3, 3], 0.1, [0.03, 0.9 * thickness, 0.05]);
    let body = body(&points, &tets, 5e4);
    // Of 8 × 8 squares, askew to the block's own.
    let mut plate = Vec::new();
    for z in 0..9 {
        plate.extend((0..9).map(|x| [0.113 * f64::from(x) - 0.3, 0.0, 0.107 * f64::from(z) - 0.3]));
    }
    let squares = (0..64u32).map(|k| (k % 8) + 9 * (k / 8));
    let triangles: Vec<[u32; 3]> = squares.flat_map(|a| [[a, a + 9, a + 10], [a, a + 10, a + 1]]).collect();
    let plate = Obstacle::new(&triangles, &[pose(0.0, &plate)], FRAME, thickness, 0.5).unwrap();
    let skins = [Skin::new(&points, &faces, &body.springs()).unwrap()];
    let own = Some(Rub { thickness, friction: 0.5 });
    let scene = Scene { skins: &skins, obstacles: &[plate], own, ..Scene::default() };
    let mut state = State::at_rest(&body);
    let mut solver = Solver::new(&body);
    let frame = Frame { contacts: Some(&scene), seconds: FRAME, ..Frame::default() };
    for _ in 0..240 {
        let _ = solver.step(&body, &mut state, &frame);
        let lowest = state.positions.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        assert!(lowest > 0.0, "{lowest}");
    }
    let speed = state.velocities.iter().map(|v| V3::from(*v).norm()).fold(0.0, f64::max);
    assert!(speed < 1e-4 * 9.81 * FRAME, "{} g·dt", speed / (9.81 * FRAME));
}

#[test]
fn no_vertex_is_deeper_in_a_rolling_pin_than_its_thickness() {
    const SIDES: u32 = 32;
    let thickness = 1e-3;
    let (points, tets, faces) = block([12, 3, 6], 0.02, [0.0; 3]);
    let body = body(&points, &tets, 2e4);
    let (pin, triangles) = cylinder(SIDES, 0.05, 0.3);
    // Ten thicknesses a frame, rolling, 1 cm into the block.
    let at = |frame: f64| {
        let way = frame * 10.0 * thickness;
        let (sine, cosine) = libm::sincos(-way / 0.05);
        let put = |[x, y, z]: &[f64; 3]| {
            [cosine * x - sine * y - 0.08 + way, sine * x + cosine * y + 0.1, z + 0.06]
        };
        pin.iter().map(put).collect::<Vec<_>>()
    };
    let skins = [Skin::new(&points, &faces, &body.springs()).unwrap()];
    let ground = Some(Ground { up: [0.0, 1.0, 0.0], height: -thickness, thickness, friction: 0.8 });
    let mut state = State::at_rest(&body);
    let mut solver = Solver::new(&body);
    let mut worst = 0.0_f64;
    for frame in 0..30 {
        let poses = [pose(0.0, &at(f64::from(frame))), pose(1.0, &at(f64::from(frame + 1)))];
        let pin = [Obstacle::new(&triangles, &poses, FRAME, thickness, 0.3).unwrap()];
        let scene = Scene { skins: &skins, obstacles: &pin, ground, ..Scene::default() };
        let _ = solver.step(&body, &mut state, &Frame { contacts: Some(&scene), seconds: FRAME, ..Frame::default() });
        let now = &poses[1].positions;
        for (index, p) in state.positions.iter().enumerate().filter(|(_, p)| p[2] > -0.09 && p[2] < 0.21) {
            let p = V3::from(*p);
            let outside = (0..SIDES as usize).map(|k| {
                let [a, b, c] = [2 * k, 2 * ((k + 1) % SIDES as usize), 2 * k + 1].map(|corner| V3::from(now[corner]));
                (b - a).cross(&(c - a)).normalize().dot(&(p - a))
            });
            let depth = -outside.fold(f64::NEG_INFINITY, f64::max);
            worst = worst.max(depth);
            assert!(depth < thickness, "{index} is {depth} deep in frame {frame}");
            assert!(p.y > -2.0 * thickness, "{index} is at {} in frame {frame}", p.y);
        }
    }
    assert!(worst < thickness, "{worst}");
}
