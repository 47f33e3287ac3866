use super::*;
use crate::scene::{Corner, Dot, Knot, Scene, Strand, scramble};
use crate::view::View;
use numerics::vector::length;

/// Side of the test picture, pixels: four tiles.
const SIDE: usize = 32;

/// Seen straight on, a stage unit is a pixel.
fn view() -> View {
    View::parallel([0.0, 0.0, 10.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]], SIDE as f32 / 2.0, SIDE)
}

/// Position on the stage of x, y on the screen, at a nearness relative to the stage's middle.
fn at([x, y]: [f32; 2], near: f32) -> Vec3 {
    [x - SIDE as f32 / 2.0, SIDE as f32 / 2.0 - y, near]
}

fn triangle(corners: [[f32; 2]; 3], near: f32, color: f32) -> [Corner; 3] {
    corners.map(|corner| Corner { at: at(corner, near), normal: [0.0, 0.0, 1.0], color: [color; 3] })
}

fn add_strand(scene: &mut Scene, points: &[[f32; 2]], width: f32) {
    let knot =
        |point: &[f32; 2]| Knot { at: at(*point, 0.0), tangent: [1.0, 0.0, 0.0], radius: width / 2.0, color: [1.0; 3] };
    let start = scene.knots.len();
    scene.knots.extend(points.iter().map(knot));
    scene.strands.push(Strand { knots: start..scene.knots.len(), seed: scramble(start as u32) });
}

/// Shows colours unchanged.
struct Flat;

impl Shader for Flat {
    type Color = f32;
    fn surface(&self, _: Vec3, _: Vec3, color: Vec3) -> f32 {
        color[0]
    }
    fn strand(&self, color: Vec3, _: f32, _: f32) -> f32 {
        color[0]
    }
    fn ball(&self, _: [f32; 2], color: Vec3, _: f32) -> f32 {
        color[0]
    }
}

/// Sum over the samples of each pixel, 0…16 where all is drawn with colour 1.
fn drawn(scene: &Scene) -> Vec<[f32; SIDE]> {
    let mut picture = vec![[0.0; SIDE]; SIDE];
    for tile in draw(&Screen::of(scene, &view(), [SIDE; 2]), &Flat, |tile| tile) {
        for (index, colors) in tile.color.iter().enumerate() {
            picture[tile.top + index / TILE][tile.left + index % TILE] = colors.iter().sum();
        }
    }
    picture
}

/// Pixels' worth of coverage.
fn area(scene: &Scene) -> f32 {
    drawn(scene).as_flattened().iter().sum::<f32>() / SAMPLES as f32
}

#[test]
fn samples_of_a_pixel_share_no_row_and_no_column() {
    for axis in [SAMPLE_X, SAMPLE_Y] {
        let mut sorted = axis;
        sorted.sort_by(f32::total_cmp);
        assert_eq!(sorted, std::array::from_fn(|k| (k as f32 + 0.5) / 16.0));
    }
}

#[test]
fn a_triangle_covers_its_inside_and_half_along_its_diagonal() {
    let scene = Scene { triangles: vec![triangle([[0.0, 0.0], [8.0, 0.0], [0.0, 8.0]], 0.0, 1.0)], ..Scene::default() };
    for (y, row) in drawn(&scene).iter().enumerate() {
        for (x, covered) in row.iter().enumerate() {
            match x + y {
                0..7 => assert_eq!(*covered, 16.0, "{x} {y}"),
                7 => assert!((7.0..=9.0).contains(covered), "{x} {y} {covered}"),
                _ => assert_eq!(*covered, 0.0, "{x} {y}"),
            }
        }
    }
}

#[test]
fn a_triangle_is_the_same_in_either_orientation() {
    let corners = [[3.3, 4.7], [20.1, 9.9], [11.6, 27.2]];
    let there = Scene { triangles: vec![triangle(corners, 0.0, 1.0)], ..Scene::default() };
    let back = Scene { triangles: vec![triangle([corners[0], corners[2], corners[1]], 0.0, 1.0)], ..Scene::default() };
    assert!(drawn(&there) == drawn(&back));
}

#[test]
fn the_nearer_triangle_is_visible_in_any_drawing_order() {
    let corners = [[0.0, 0.0], [64.0, 0.0], [0.0, 64.0]];
    let (near, far) = (triangle(corners, 1.0, 1.0), triangle(corners, -1.0, 0.25));
    for triangles in [vec![near, far], vec![far, near]] {
        let scene = Scene { triangles, ..Scene::default() };
        assert!(drawn(&scene).as_flattened().iter().all(|covered| *covered == 16.0));
    }
}

#[test]
fn triangles_around_a_point_leave_no_gap() {
    // Corners anywhere around the picture, with the hub inside a pixel, so that edges pass between samples in all
    // directions.
    let fraction = |k: u32| scramble(k) as f32 / u32::MAX as f32;
    for round in 0..40 {
        let hub = [10.0 + 12.0 * fraction(7 * round), 10.0 + 12.0 * fraction(7 * round + 1)];
        let (far, other) = (60.0 + 1e5 * fraction(round), 40.0 * fraction(3 * round));
        let rim = [[-far, other], [other, -far], [far, -other], [far + other, far], [-far, far]];
        let triangles = (0..5).map(|k| triangle([hub, rim[k], rim[(k + 1) % 5]], 0.0, 1.0)).collect();
        let scene = Scene { triangles, ..Scene::default() };
        assert!(drawn(&scene).as_flattened().iter().all(|covered| *covered == 16.0), "{round}");
    }
}

#[test]
fn a_strand_of_any_width_covers_length_times_width() {
    for width in [0.01, 0.1, 0.7, 1.0, 3.0] {
        for end in [[28.0, 4.0], [28.0, 9.3], [28.0, 27.1], [4.4, 28.0]] {
            // The mean over slightly shifted strands, each in its own picture, since they would hide each other.
            let long = length([end[0] - 4.0, end[1] - 4.0, 0.0]);
            let mean = (0..400).map(|k| {
                let mut scene = Scene::default();
                let shift = k as f32 / 400.0;
                add_strand(&mut scene, &[[4.0 + shift, 4.0], [end[0] + shift, end[1]]], width);
                scene.strands[0].seed = scramble(k);
                area(&scene)
            });
            let mean = mean.sum::<f32>() / 400.0;
            assert!((mean / (long * width) - 1.0).abs() < 0.05, "{mean} for {width} × {long}");
        }
    }
}

#[test]
fn a_strand_of_a_tenth_of_a_pixel_has_a_tenth_of_coverage_everywhere() {
    let mut scene = Scene::default();
    add_strand(&mut scene, &[[4.0, 10.5], [28.0, 10.5]], 0.1);
    let row = drawn(&scene)[10];
    // One or two samples of 16 in every pixel: no dots.
    assert!(row[4..28].iter().all(|covered| (1.0..=2.0).contains(covered)), "{row:?}");
}

#[test]
fn thin_strands_hide_the_background_by_their_coverage() {
    // Ten strands of half a pixel at one position: each lets half through, so that almost nothing remains.
    let mut scene = Scene::default();
    (0..10).for_each(|_| add_strand(&mut scene, &[[0.0, 16.5], [32.0, 16.5]], 0.5));
    assert!(area(&scene) > 0.97 * 32.0);
    scene.strands.truncate(2);
    assert!((area(&scene) / 32.0 - 0.75).abs() < 0.15, "{}", area(&scene));
}

#[test]
fn a_bent_strand_has_a_round_joint_and_flat_ends() {
    let mut scene = Scene::default();
    add_strand(&mut scene, &[[16.0, 4.0], [16.0, 16.0], [28.0, 16.0]], 8.0);
    // Two arms of 12 × 8, with the square of their overlap counted once, and a quarter disc outside the joint.
    let expected = 2.0 * 12.0 * 8.0 - 16.0 + std::f32::consts::PI * 16.0 / 4.0;
    assert!((area(&scene) - expected).abs() < 0.5, "{} {expected}", area(&scene));
    assert_eq!(drawn(&scene)[3], [0.0; SIDE]);
}

#[test]
fn a_ball_of_any_size_covers_its_disc() {
    for radius in [0.1_f32, 0.4, 2.0, 6.0] {
        let mean = (0..2000).map(|k| {
            let middle = at([16.0 + (k % 40) as f32 / 40.0, 16.0 + (k / 40) as f32 / 50.0], 0.0);
            let ball = Dot { at: middle, radius, color: [1.0; 3], lit: 1.0, seed: scramble(k) };
            area(&Scene { dots: vec![ball], ..Scene::default() })
        });
        let mean = mean.sum::<f32>() / 2000.0;
        // A ball smaller than a pixel is a disc of π/4 pixels with reduced coverage.
        assert!((mean / (std::f32::consts::PI * radius * radius) - 1.0).abs() < 0.06, "{radius}: {mean}");
    }
}
