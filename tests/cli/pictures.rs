//! Pictures of a cook: contact sheets, single frames, movies, and what is drawn in them.

use std::fs;

use crate::bench::Bench;

/// Two gusts, of which one is an output, over blades of grass; and a block in a lattice beside them.
const GUSTS: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 3] },
  "nodes": {
    "blades": { "type": "Curve_In", "params": { "file": "grass.obj" } },
    "ball": { "type": "Gust_Control", "params": { "scale": [0.3, 0.3, 0.3], "translate": { "keyframes": [[1, [0, 0, 0]], [3, [1, 0, 0]]] } } },
    "calm": { "type": "Gust_Control", "params": { "shape": "cubes", "scale": [0.1, 0.2, 0.1], "strength": -0.5 } },
    "gusts": { "type": "Curve_Wind_Gusts", "inputs": { "curves": "blades", "controls": ["ball", "calm"] }, "params": { "num_gusts": 0 } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "gusts" }, "params": { "global_rotate": 0.5 } }
  },
  "outputs": { "grass": "wind", "ball": "ball" }
}"#;

/// A picture: its width, and its pixels.
struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    fn open(bench: &Bench, name: &str) -> Self {
        let bytes = fs::read(bench.path(name)).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut rows = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rows).unwrap();
        Self { width: info.width as usize, pixels: rows.as_chunks::<3>().0.to_vec() }
    }

    fn size(&self) -> [usize; 2] {
        [self.width, self.pixels.len() / self.width]
    }

    /// Pixels of a panel at `left`, `top` that are clearly darker than the backdrop.
    fn drawn(&self, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> usize {
        let panel = (0..width * height).map(|k| self.pixels[(top + k / width) * self.width + left + k % width]);
        panel.filter(|pixel| pixel[2] < 140).count()
    }
}

#[test]
fn a_sheet_has_one_panel_a_frame_and_no_empty_cell() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--preview", "--preview-size", "64x48"]);
    assert_eq!(bench.names("out"), ["g.preview.png", "grass.usdc", "still.usdc"]);
    let sheet = Picture::open(&bench, "out/g.preview.png");
    assert_eq!(sheet.size(), [64 * 2 + 4, 48 * 2 + 4]);
    for cell in [[0, 0], [68, 0], [0, 52], [68, 52]] {
        assert!(sheet.drawn(cell, [64, 48]) > 30, "{cell:?}");
    }
    // 5 frames have no fuller rectangle than a row.
    bench.done(&["cook", "g.json", "--preview", "--preview-size", "64x48", "--frames", "1-5"]);
    assert_eq!(Picture::open(&bench, "out/g.preview.png").size(), [64 * 5 + 16, 48]);
    bench.done(&["cook", "g.json", "--preview", "--preview-size", "64x48", "--frames", "1-20"]);
    assert_eq!(Picture::open(&bench, "out/g.preview.png").size(), [64 * 3 + 8, 48 * 2 + 4]);
}

#[test]
fn outputs_that_hide_each_other_are_noted_and_split_on_request() {
    let bench = Bench::new();
    let rest = ["cook", "g.json", "--frames", "1", "--preview-size", "64x48", "--set", "wind.global_rotate=0"];
    let ran = bench.run(&rest);
    let note = "note: outputs `grass` and `still` lie in the same place and hide each other in the picture; \
                --preview-split draws each output in its own panel";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let ran = bench.run(&[&rest[..], &["--preview-split"]].concat());
    assert!(!ran.stderr.contains("hide each other"), "{}", ran.stderr);
    let split = Picture::open(&bench, "out/g.preview.png");
    assert_eq!(split.size(), [64 * 2 + 4, 48]);
    assert!([[0, 0], [68, 0]].iter().all(|cell| split.drawn(*cell, [64, 48]) > 30));
}

#[test]
fn a_movie_has_all_frames_and_the_same_bytes_on_any_number_of_threads() {
    let bench = Bench::new();
    let movie = |threads: &str| {
        bench.done(&["cook", "g.json", "--movie", "--preview-size", "64x48", "--threads", threads]);
        assert_eq!(bench.names("out"), ["g.preview.apng", "grass.usdc", "still.usdc"], "no temporary is left");
        fs::read(bench.path("out/g.preview.apng")).unwrap()
    };
    let bytes = movie("1");
    assert_eq!(bytes, movie("2"));
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    assert_eq!(reader.info().animation_control.map(|control| control.num_frames), Some(4));
    let mut frames = Vec::new();
    for _ in 0..4 {
        let mut rows = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rows).unwrap();
        let control = reader.info().frame_control.unwrap();
        assert_eq!((control.delay_num, control.delay_den), (1000, 24000));
        frames.push(rows);
    }
    assert!(frames[0] != frames[1], "it moves");
}

#[test]
fn single_frames_share_a_camera_and_are_named_after_the_graph() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--preview-frames", "2,4", "--movie", "--preview-size", "64x48"]);
    let names = ["g.preview.0002.png", "g.preview.0004.png", "g.preview.apng", "grass.usdc", "still.usdc"];
    assert_eq!(bench.names("out"), names);
    let [two, four] = ["2", "4"].map(|frame| Picture::open(&bench, &format!("out/g.preview.000{frame}.png")));
    let same = two.pixels.iter().zip(&four.pixels).filter(|(a, b)| a == b).count();
    // The backdrop, the floor and the blades at rest.
    assert!(same > 64 * 48 / 2 && same < 64 * 48, "{same}");
}

#[test]
fn guides_are_drawn_but_neither_written_nor_reported_and_change_no_output() {
    let bench = Bench::with_graph(GUSTS);
    let cook = |more: &[&str]| {
        let args = ["cook", "g.json", "--format", "json", "--report", "report.json"];
        let ran = bench.run(&[&args, more].concat());
        assert_eq!(ran.code, Some(0), "{}", ran.stderr);
        assert!(!ran.stderr.contains("gust_points"), "{}", ran.stderr);
        let report = bench.read_json("report.json");
        (bench.files("out"), report["outputs"].as_object().map(|outputs| outputs.keys().cloned().collect::<Vec<_>>()))
    };
    let (plain, outputs) = cook(&[]);
    let (mut drawn, with) = cook(&["--preview", "--preview-size", "160x120"]);
    assert_eq!(outputs, with);
    assert!(drawn.remove("g.preview.png").is_some());
    assert_eq!(plain.keys().collect::<Vec<_>>(), drawn.keys().collect::<Vec<_>>());
    assert_eq!(plain, drawn);
}

#[test]
fn components_and_planes_are_accepted_and_mistakes_explained() {
    let bench = Bench::new();
    let draw = |more: &[&str]| {
        let args = ["cook", "g.json", "--output", "grass", "--frames", "1", "--preview-size", "64x48"];
        bench.run(&[&args[..], &["--format", "json"], more].concat())
    };
    let ran = draw(&["--color-by", "P.y", "--clip", "x=0.5"]);
    assert!(ran.code == Some(0) && !ran.stderr.contains("note"), "{}", ran.stderr);
    let ran = draw(&["--color-by", "P.w"]);
    assert!(ran.stderr.contains("no output has a numeric attribute `P.w` to colour by"), "{}", ran.stderr);
    let ran = draw(&["--clip", "w=1"]);
    let error = "`w=1` is not a plane, expected an axis and a position in metres like `x=0`";
    assert!(ran.code == Some(2) && ran.stderr.contains(error), "{}", ran.stderr);
    let ran = bench.run(&["cook", "g.json", "--movie", "--frames", "1-20000"]);
    let error = "the movie is 20000 frames of 640 × 480 pixels";
    assert!(ran.code == Some(2) && ran.stderr.contains(error), "{}", ran.stderr);
    assert!(ran.stderr.contains("choose fewer --frames or a smaller --preview-size"), "{}", ran.stderr);
}

#[cfg(unix)]
#[test]
fn a_picture_that_is_a_file_the_graph_reads_is_refused() {
    let bench = Bench::new();
    fs::create_dir(bench.path("out")).unwrap();
    std::os::unix::fs::symlink("../grass.obj", bench.path("out/g.preview.apng")).unwrap();
    let ran = bench.run(&["cook", "g.json", "--movie", "--preview-size", "64x48"]);
    let error = "`out/g.preview.apng` would be overwritten, but the graph reads it; choose another --out";
    assert!(ran.code == Some(1) && ran.stderr.contains(error), "{}", ran.stderr);
    assert!(fs::read_to_string(bench.path("grass.obj")).unwrap().starts_with("v "));
}
