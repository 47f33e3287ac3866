//! Results have the same bits for any number of threads, order of frames, memory, cache and CPU.

use std::collections::BTreeMap;
use std::process::Stdio;

use crate::bench::Bench;

const COOK: [&str; 4] = ["cook", "g.json", "--format", "json"];

/// The files of a cook of all frames in order.
fn forward(bench: &Bench) -> BTreeMap<String, Vec<u8>> {
    bench.done(&[&COOK[..], &["--out", "forward"]].concat());
    let files = bench.files("forward");
    assert_eq!(files.len(), 8, "4 frames of 2 outputs");
    assert_ne!(files["grass.0001.json"][20..], files["grass.0002.json"][20..], "the frames differ");
    files
}

#[test]
fn threads_and_memory_do_not_change_results() {
    let bench = Bench::new();
    let expected = forward(&bench);
    for args in [["--threads", "1"], ["--threads", "2"], ["--threads", "7"], ["--memory", "1M"], ["--memory", "0"]] {
        bench.done(&[&COOK[..], &["--out", "out"], &args].concat());
        assert!(bench.files("out") == expected, "{args:?}");
    }
}

#[test]
fn frames_cooked_alone_in_halves_and_in_steps_have_the_same_bits() {
    let bench = Bench::new();
    let expected = forward(&bench);
    for (out, runs) in
        [("alone", &["4", "2", "3", "1"][..]), ("halves", &["3-4", "1-2"]), ("steps", &["2-4x2", "1-3x2"])]
    {
        for frames in runs {
            bench.done(&[&COOK[..], &["--out", out, "--frames", frames]].concat());
        }
        assert!(bench.files(out) == expected, "{out}");
    }
    bench.done(&[&COOK[..], &["--out", "sub", "--frames", "1-4x0.5", "--output", "grass"]].concat());
    let sub = bench.files("sub");
    assert_eq!(sub.len(), 7);
    assert!(expected.iter().filter(|(name, _)| name.starts_with("grass")).all(|(name, file)| sub[name] == *file));
}

#[test]
fn a_cold_or_warm_cache_does_not_change_results() {
    let bench = Bench::new();
    let expected = forward(&bench);
    for (out, frames) in [("cold", "1-2"), ("half", "1-4"), ("warm", "1-4")] {
        bench.done(&[&COOK[..], &["--cache", "cache", "--out", out, "--frames", frames]].concat());
        assert!(bench.files(out).iter().all(|(name, file)| expected[name] == *file), "{out}");
    }
    assert_eq!(bench.names("warm").len(), 8);
    let own = format!("cache/{}", bench.names("cache")[0]);
    for name in bench.names(&own) {
        bench.write(&format!("{own}/{name}"), "broken");
    }
    bench.done(&[&COOK[..], &["--cache", "cache", "--out", "broken"]].concat());
    assert!(bench.files("broken") == expected, "an invalid cache is ignored");
}

#[test]
fn every_simd_path_gives_the_same_bits() {
    let bench = Bench::new();
    let expected = forward(&bench);
    for path in ["baseline", "avx2", "widest"] {
        let mut command = bench.command(&[&COOK[..], &["--out", path]].concat());
        let status = command.env("CONVECT_SIMD", path).stderr(Stdio::null()).status().unwrap();
        assert!(status.success(), "{path}");
        assert!(bench.files(path) == expected, "{path}");
    }
}

#[test]
fn usd_and_ply_are_the_same_bytes_each_time() {
    let bench = Bench::new();
    for format in ["usdc", "usda", "ply", "obj"] {
        for (out, threads) in [("a", "1"), ("b", "3")] {
            let out = format!("{format}-{out}");
            bench.done(&["cook", "g.json", "--format", format, "--threads", threads, "--out", &out]);
        }
        assert!(bench.files(&format!("{format}-a")) == bench.files(&format!("{format}-b")), "{format}");
    }
}
