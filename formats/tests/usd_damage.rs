//! Damaged USD: cut off, or with single bits turned over. An error or another geometry, never a panic, and no more memory
//! than twice what the intact file takes.
//!
//! Here some cuts and flips of each file; all of them with `CONVECT_ALL_DAMAGE=1` (cuts at each 997th byte, or each byte
//! of a small file, and 10,000 flips).

#![allow(clippy::unwrap_used, reason = "a missing value fails the test")]
#![allow(unsafe_code, reason = "an allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use engine::geometry::{Attr, Component, Geometry, ID, V, WIDTH};
use formats::usd::{Flavour, NoAssets, UsdStage, UsdWriter};

struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator does the work.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: as asked for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        // SAFETY: from above.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most memory that reading takes at once, the file included.
fn peak(bytes: &[u8]) -> usize {
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    let read = UsdStage::open(bytes.into(), NoAssets).and_then(|stage| {
        stage.times("")?;
        for time in [1.0, 1.5, 2.0] {
            stage.read("", time, &|_| true)?;
        }
        Ok(())
    });
    drop(read);
    PEAK.load(Relaxed) - before
}

fn sample() -> [Geometry; 2] {
    let points = 3000;
    let frame = |frame: f32| {
        let positions: Vec<[f32; 3]> = (0..points).map(|i| [i as f32 * 0.1, frame, (i % 7) as f32]).collect();
        let mut curves = Component::curves(vec![5; points / 5], positions.clone()).unwrap();
        curves.set(V, vec![[frame; 3]; points]).unwrap();
        curves.set(WIDTH, vec![0.5; points]).unwrap();
        curves.set(Attr::<i32>::element("clump"), (0..points as i32 / 5).map(|i| i / 9).collect()).unwrap();
        let quads = points as u32 / 2;
        let corners = (0..quads - 2).flat_map(|i| [i, i + 1, i + 2]).collect();
        let mesh = Component::mesh(vec![3; quads as usize - 2], corners, positions.clone()).unwrap();
        let mut cloud = Component::points(positions);
        cloud.set(ID, (0..points as i32).collect()).unwrap();
        Geometry::from(curves).with(mesh).with(cloud)
    };
    [frame(1.0), frame(2.0)]
}

fn written(flavour: Flavour) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.usd");
    let mut writer = UsdWriter::create(&path, flavour, "a", 24.0, [0.0; 3]).unwrap();
    for (time, geometry) in [1.0, 2.0].into_iter().zip(sample()) {
        writer.frame(time, &geometry).unwrap();
    }
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
}

/// An archive with one file, as USD packs it.
fn archive(name: &str, file: &[u8]) -> Vec<u8> {
    let (size, length) = ((file.len() as u32).to_le_bytes(), (name.len() as u16).to_le_bytes());
    let common = [&[0; 4][..], &[0; 8], &size, &size, &length, &[0; 2]].concat();
    let local = [b"PK\x03\x04\x0a\0".as_slice(), &common[..], name.as_bytes(), file].concat();
    let listed = [b"PK\x01\x02\x0a\0\x0a\0".as_slice(), &common[..], &[0; 14], name.as_bytes()].concat();
    let [at, length] = [local.len(), listed.len()].map(|n| (n as u32).to_le_bytes());
    [&local[..], &listed, b"PK\x05\x06\0\0\0\0\x01\0\x01\0", &length, &at, &[0; 2]].concat()
}

#[test]
fn damage_is_an_error_and_takes_no_more_memory() {
    let all = std::env::var_os("CONVECT_ALL_DAMAGE").is_some();
    let crate_file = written(Flavour::Usdc);
    let stored = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/usd")).unwrap();
    let mut stored: Vec<_> = stored.map(|entry| entry.unwrap().path()).collect();
    stored.retain(|path| path.extension().is_some_and(|ending| ending != "py"));
    stored.sort();
    let mut files: Vec<(String, Vec<u8>)> =
        stored.iter().map(|path| (path.display().to_string(), std::fs::read(path).unwrap())).collect();
    files.push(("text".into(), written(Flavour::Usda)));
    files.push(("archive".into(), archive("a.usdc", &crate_file)));
    files.push(("crate".into(), crate_file));
    assert!(files.len() > 5, "files of other programs are stored");
    for (name, bytes) in files {
        let intact = peak(&bytes);
        let most = 2 * intact.max(bytes.len());
        let step = (bytes.len() / 400).clamp(1, 997) * if all { 1 } else { 47 };
        for cut in (0..bytes.len()).step_by(step) {
            let peak = peak(&bytes[..cut]);
            assert!(peak <= most, "{name} cut at {cut}: {peak} bytes, {intact} intact");
        }
        let mut random = 88_172_645_463_325_252_u64;
        for _ in 0..if all { 10_000 } else { 70 } {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            let bit = (random % (bytes.len() as u64 * 8)) as usize;
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let peak = peak(&damaged);
            assert!(peak <= most, "{name} with bit {bit} turned over: {peak} bytes, {intact} intact");
        }
    }
}
