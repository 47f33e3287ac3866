//! How long reading a USD file of 40 MB with all its values takes: `cargo run --release -p formats --example usd_speed`.
//!
//! Curves in 24 frames: positions and velocities of each, widths once. The file lies in memory; the best of 25 runs counts.

#![allow(clippy::unwrap_used, reason = "a measurement")]

use std::sync::Arc;

use engine::clock::Stopwatch;
use engine::geometry::{Component, Geometry, V, WIDTH};
use formats::usd::{Flavour, NoAssets, UsdStage, UsdWriter};

const FRAMES: u32 = 24;
const CURVES: usize = 13_600;
const CVS: usize = 5;

fn main() {
    let path = std::env::temp_dir().join(format!("usd_speed_{}.usdc", std::process::id()));
    let mut writer = UsdWriter::create(&path, Flavour::Usdc, "fur", 24.0, [0.0; 3]).unwrap();
    for frame in 1..=FRAMES {
        writer.frame(f64::from(frame), &fur(frame as f32)).unwrap();
    }
    writer.finish().unwrap();
    let bytes: Arc<[u8]> = std::fs::read(&path).unwrap().into();
    std::fs::remove_file(&path).unwrap();
    let (mut wall, mut cpu) = (f64::INFINITY, f64::INFINITY);
    let mut values = 0;
    for _ in 0..25 {
        let watch = Stopwatch::start();
        let stage = UsdStage::open(bytes.clone(), NoAssets).unwrap();
        values = 0;
        for frame in 1..=FRAMES {
            let read = stage.read("", f64::from(frame), &|_| true).unwrap();
            values += read.geometry.bytes();
        }
        wall = wall.min(watch.wall().as_secs_f64() * 1e3);
        cpu = cpu.min(watch.cpu().as_secs_f64() * 1e3);
    }
    let megabytes = bytes.len() as f64 / 1e6;
    let frame = values as f64 / f64::from(FRAMES) / 1e6;
    println!("{megabytes:.1} MB, {FRAMES} frames of {frame:.1} MB: {wall:.1} ms, {cpu:.1} ms of the CPU");
}

fn fur(frame: f32) -> Geometry {
    let points = CURVES * CVS;
    let position = |i: usize| [(i / CVS) as f32 * 0.01, (i % CVS) as f32 + frame, (i as f32 * 0.37 + frame).fract()];
    let mut curves = Component::curves(vec![CVS as u32; CURVES], (0..points).map(position).collect()).unwrap();
    curves.set(V, (0..points).map(|i| [frame, i as f32, 0.5]).collect()).unwrap();
    curves.set(WIDTH, vec![0.002; points]).unwrap();
    Geometry::from(curves)
}
