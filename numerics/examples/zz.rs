use numerics::bend::*;
use numerics::ramp::*;
use numerics::simd::Path;
fn main() {
    let n = 10275u32;
    let starts: Vec<u32> = (0..=n).map(|c| c * 5).collect();
    let pts: Vec<[f32; 3]> = (0..n * 5)
        .map(|i| {
            let u = (i % 5) as f32 / 4.0;
            [i as f32 * 1e-4 + 0.02 * u * u, 0.1 * u, 0.01 * u]
        })
        .collect();
    let ramp = Ramp::new(vec![[0.0, 0.2], [1.0, 1.0]], Interpolation::Linear).unwrap();
    let b = Bend {
        wind: [1.0, 0.0, 0.0],
        rotate: 0.5,
        rotate_mask: None,
        envelope: None,
        ramp: &ramp,
        mode: Mode::Paper,
        blend: 1.0,
        blend_mask: None,
        noise: None,
    };
    for _ in 0..3000 {
        let _ = std::hint::black_box(bend_on(Path::widest(), &starts, &pts, &b));
    }
}
