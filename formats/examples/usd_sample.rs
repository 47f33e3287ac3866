//! Writes USD samples that cover the difficult cases of a writer, or measures the speed of writing.
//!
//! `usd_sample DIR` writes `NAME.usda`, `NAME.usdc` and, as the expected values, `NAME.0001.json` … with floats as the
//! hexadecimal digits of their bits: `tools/usd_check.py DIR/*.usd?` compares them. `usd_sample --speed DIR` prints size
//! and time of 50,000 CVs × 100 frames in both flavours.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use engine::clock::Stopwatch;
use engine::geometry::{Column, Component, Geometry, ID, Kind, N, ORIENT, Owner, P, PREF, SHIELDED, UVW, V, WIDTH};
use formats::usd::{Flavour, UsdWriter};
use serde_json::{Map, Value, json};

const FPS: f64 = 24.0;

type Outcome<T = ()> = Result<T, Box<dyn Error>>;

/// Frame numbers and their geometry.
type Frames = Vec<(f64, Geometry)>;

fn main() -> Outcome {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    match args.as_slice() {
        [folder] => write_samples(folder),
        [flag, folder] if flag.as_os_str() == "--speed" => measure(folder),
        _ => Err("usage: usd_sample [--speed] DIR".into()),
    }
}

fn write_samples(folder: &Path) -> Outcome {
    fs::create_dir_all(folder)?;
    let samples: [(&str, [f64; 3], Frames); 12] = [
        ("fur", [0.0; 3], whole(3, |frame| curves(frame).map(Geometry::from))?),
        ("skin", [0.0; 3], whole(3, |frame| mesh(frame).map(Geometry::from))?),
        ("spray", [0.0; 3], whole(4, |frame| points(frame, 7 * frame % 20).map(Geometry::from))?),
        ("dough", [0.0; 3], whole(3, |frame| tets(frame).map(Geometry::from))?),
        ("everything", [1e6, 0.1, -3.0], whole(5, all)?),
        ("still", [0.0; 3], whole(3, |_| all(1))?),
        ("one", [0.0, 1.0, 0.0], whole(1, |_| all(1))?),
        ("sub-frames", [0.0; 3], whole(5, all)?.into_iter().map(|(f, g)| (f * 0.25 + 1000.1, g)).collect()),
        ("changing", [0.0; 3], whole(6, changing)?),
        ("come-and-go", [0.0; 3], come_and_go()?),
        ("large", [0.0; 3], whole(3, large)?),
        ("nothing", [0.0; 3], whole(2, |frame| nothing(frame > 1))?),
    ];
    for (name, origin, frames) in samples {
        write(folder, name, origin, &frames)?;
    }
    write(folder, "no-frames", [0.0; 3], &Vec::new())?;
    write_set(folder)
}

/// Several outputs in one stage, with names that are not valid in USD.
fn write_set(folder: &Path) -> Outcome {
    let members = ["skin.1", "skin_1", "2nd", "none"];
    let at = |frame: u32| -> Outcome<[Geometry; 4]> {
        Ok([all(frame)?, mesh(1)?.into(), changing(frame)?, nothing(frame > 2)?])
    };
    let frames = (1..=4).map(|frame| Ok((frame.into(), at(frame)?))).collect::<Outcome<Vec<(f64, [Geometry; 4])>>>()?;
    for (flavour, ending) in [(Flavour::Usda, "usda"), (Flavour::Usdc, "usdc")] {
        let path = folder.join(format!("a-set.{ending}"));
        let mut writer = UsdWriter::create_set(path, flavour, ("a-set", &members), FPS, [10.0, 0.0, 0.0])?;
        for (frame, geometries) in &frames {
            writer.frames(*frame, &geometries.each_ref())?;
        }
        writer.finish()?;
    }
    for (index, (frame, geometries)) in frames.iter().enumerate() {
        let outputs = members.iter().zip(geometries).map(|(name, geometry)| {
            let mut own = expected(*frame, geometry);
            own["output"] = json!(name);
            own
        });
        let all = json!({"frame": frame, "time": frame / FPS, "outputs": outputs.collect::<Vec<Value>>()});
        fs::write(folder.join(format!("a-set.{:04}.json", index + 1)), all.to_string())?;
    }
    Ok(())
}

fn whole(frames: u32, at: impl Fn(u32) -> Outcome<Geometry>) -> Outcome<Frames> {
    (1..=frames).map(|frame| Ok((f64::from(frame), at(frame)?))).collect()
}

fn write(folder: &Path, name: &str, origin: [f64; 3], frames: &Frames) -> Outcome {
    for (flavour, ending) in [(Flavour::Usda, "usda"), (Flavour::Usdc, "usdc")] {
        let mut writer = UsdWriter::create(folder.join(format!("{name}.{ending}")), flavour, name, FPS, origin)?;
        for (frame, geometry) in frames {
            writer.frame(*frame, geometry)?;
        }
        writer.finish()?;
    }
    for (index, (frame, geometry)) in frames.iter().enumerate() {
        let text = expected(*frame, geometry).to_string();
        fs::write(folder.join(format!("{name}.{:04}.json", index + 1)), text)?;
    }
    Ok(())
}

/// A hash of three numbers, the same on every machine; every bit pattern can occur.
fn hash(a: u32, b: u32, c: u32) -> u32 {
    let mut x = a.wrapping_mul(0x9e37_79b9) ^ b.wrapping_mul(0x85eb_ca6b) ^ c.wrapping_mul(0xc2b2_ae35);
    for _ in 0..3 {
        x = (x ^ (x >> 15)).wrapping_mul(0x2c1b_3c6d);
    }
    x ^ (x >> 13)
}

/// −1…1
fn float(a: u32, b: u32, c: u32) -> f32 {
    (f64::from(hash(a, b, c)) / f64::from(u32::MAX) * 2.0 - 1.0) as f32
}

fn vectors<const W: usize>(count: usize, salt: u32, frame: u32) -> Vec<[f32; W]> {
    (0..count as u32).map(|i| std::array::from_fn(|k| float(i * 8 + k as u32, salt, frame))).collect()
}

fn floats(count: usize, salt: u32, frame: u32) -> Vec<f32> {
    vectors::<1>(count, salt, frame).into_iter().flatten().collect()
}

fn integers(count: usize, salt: u32, frame: u32) -> Vec<i32> {
    (0..count as u32).map(|i| hash(i, salt, frame).cast_signed()).collect()
}

/// Floats that text and compression tend to lose.
fn odd_floats(count: usize) -> Vec<f32> {
    let odd = [
        -0.0,
        0.0,
        f32::MIN_POSITIVE / 2.0,
        -1e-45,
        f32::MAX,
        f32::MIN,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        16_777_217.0,
        0.1,
        1e16,
        1e-7,
        f32::EPSILON,
    ];
    odd.into_iter().cycle().take(count).collect()
}

/// Adds animated and static attributes of every type.
fn add_attributes(part: &mut Component, frame: u32) -> Outcome {
    let points = part.point_count();
    part.set_column(Owner::Point, "uvw", Column::new(vectors::<3>(points, 777, frame)))?;
    part.set_column(Owner::Point, "Cd", Column::new(vectors::<3>(points, 778, 0)))?;
    for owner in Owner::ALL {
        let rows = part.table(owner).rows();
        let salt = owner as u32 * 100;
        let mut add = |name: &str, column: Column| part.set_column(owner, format!("{owner}_{name}"), column);
        add("still", Column::new(floats(rows, salt + 1, 0)))?;
        add("moving", Column::new(floats(rows, salt + 2, frame)))?;
        add("held", Column::new(floats(rows, salt + 3, frame / 2)))?;
        add("odd", Column::new(odd_floats(rows)))?;
        add("vector", Column::new(vectors::<3>(rows, salt + 4, frame)))?;
        add("tint", Column::new(vectors::<4>(rows, salt + 5, frame)))?;
        add("count", Column::new(integers(rows, salt + 6, frame)))?;
    }
    Ok(())
}

/// Adds attributes of types that Blender does not have and warns about on curves and meshes.
fn add_wide_integers(part: &mut Component, frame: u32) -> Outcome {
    let rows = part.point_count();
    let wide = |salt| integers(rows * 4, salt, frame);
    let three = wide(7).chunks(4).map(|x| [x[0], x[1], x[2]]).collect();
    let four = wide(8).chunks(4).map(|x| [x[0], x[1], x[2], x[3]]).collect();
    part.set_column(Owner::Point, "three", Column::new::<[i32; 3]>(three))?;
    part.set_column(Owner::Point, "four", Column::new::<[i32; 4]>(four))?;
    Ok(())
}

fn curves(frame: u32) -> Outcome<Component> {
    let counts: Vec<u32> = (0..20).map(|curve| 2 + curve % 5).collect();
    let cvs = counts.iter().sum::<u32>() as usize;
    let mut part = Component::curves(counts, vectors(cvs, 1, frame))?;
    part.set(V, vectors(cvs, 2, 0))?;
    part.set(WIDTH, floats(cvs, 3, 0).iter().map(|x| x.abs()).collect())?;
    part.set(N, vectors(cvs, 4, frame))?;
    part.set(UVW, vectors(cvs, 5, 0))?;
    part.set(PREF, vectors(cvs, 6, 0))?;
    part.set(ORIENT, vectors(cvs, 7, frame))?;
    part.set(ID, integers(cvs, 8, 0))?;
    part.set(SHIELDED, floats(20, 9, frame))?;
    add_attributes(&mut part, frame)?;
    Ok(part)
}

fn mesh(frame: u32) -> Outcome<Component> {
    let (counts, corners) = grid(4, 3);
    let mut part = Component::mesh(counts, corners, vectors(20, 11, frame))?;
    part.set(V, vectors(20, 12, frame))?;
    part.set(N, vectors(20, 13, frame))?;
    part.set(UVW, vectors(20, 14, 0))?;
    part.set(ID, integers(20, 15, 0))?;
    part.set(WIDTH, floats(20, 16, 0))?;
    part.set(ORIENT, vectors(20, 17, 0))?;
    add_attributes(&mut part, frame)?;
    Ok(part)
}

/// Quads of a `w` × `h` grid, the first split into two triangles.
fn grid(w: u32, h: u32) -> (Vec<u32>, Vec<u32>) {
    let corner = |x: u32, y: u32| y * (w + 1) + x;
    let quads = (0..w * h).map(|i| (i % w, i / w));
    let mut corners: Vec<u32> =
        quads.flat_map(|(x, y)| [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)]).collect();
    corners.splice(0..4, [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 0), corner(1, 1), corner(0, 1)]);
    let mut counts = vec![4; (w * h) as usize + 1];
    counts[..2].fill(3);
    (counts, corners)
}

fn points(frame: u32, count: u32) -> Outcome<Component> {
    let count = count as usize;
    let mut part = Component::points(vectors(count, 21, frame));
    part.set(V, vectors(count, 22, frame))?;
    part.set(WIDTH, floats(count, 23, frame))?;
    part.set(ID, integers(count, 24, frame))?;
    part.set(N, vectors(count, 25, frame))?;
    add_attributes(&mut part, frame)?;
    add_wide_integers(&mut part, frame)?;
    Ok(part)
}

fn tets(frame: u32) -> Outcome<Component> {
    let shape = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0_f32]];
    let scale = frame as f32 * 0.3;
    let mut part =
        Component::tets(vec![[0, 1, 2, 3], [1, 4, 2, 3]], shape.iter().map(|p| p.map(|x| x * scale)).collect())?;
    part.set(V, vectors(5, 32, frame))?;
    part.set(ID, integers(5, 33, frame))?;
    add_attributes(&mut part, frame)?;
    add_wide_integers(&mut part, frame)?;
    Ok(part)
}

fn all(frame: u32) -> Outcome<Geometry> {
    Ok(Geometry::from(curves(frame)?).with(mesh(frame)?).with(points(1, 9)?).with(tets(frame)?))
}

/// A mesh that grows, then reverses its faces with nothing else changed; curves that lose CVs.
fn changing(frame: u32) -> Outcome<Geometry> {
    let size = [1, 2, 5, 5, 5, 3][frame as usize - 1];
    let (counts, mut corners) = grid(size, size);
    if frame == 4 {
        corners.reverse();
    }
    let vertices = ((size + 1) * (size + 1)) as usize;
    let counts = if frame == 4 { counts.into_iter().rev().collect() } else { counts };
    let mut skin = Component::mesh(counts, corners, vectors(vertices, 41, size))?;
    skin.set(V, vectors(vertices, 42, size))?;
    skin.set(ID, (0..vertices as i32).collect())?;
    let counts: Vec<u32> = (0..30).map(|curve| 1 + (hash(curve, frame, 5) % 7)).collect();
    let cvs = counts.iter().sum::<u32>() as usize;
    let fur = Component::curves(counts, vectors(cvs, 43, frame))?;
    Ok(Geometry::from(skin).with(fur))
}

/// Components and attributes that are missing in some frames, with names that are not valid in USD.
fn come_and_go() -> Outcome<Frames> {
    let names = ["a-b", "a_b", "größe", "2nd", "x:indices", "None", "def", "timeSamples", "quote\"\n", "curve_id"];
    let mut fur = curves(1)?;
    for (salt, name) in names.into_iter().enumerate() {
        for owner in [Owner::Point, Owner::Element] {
            let rows = fur.table(owner).rows();
            fur.set_column(owner, name, Column::new(floats(rows, salt as u32, 1)))?;
        }
    }
    let mut bare = Component::points(vec![[1.0, 2.0, 3.0]]);
    bare.set_column(Owner::Once, "late", Column::new(vec![5]))?;
    Ok(vec![
        (-2.0, Geometry::default()),
        (0.0, Geometry::from(fur.clone())),
        (1.0, Geometry::from(fur).with(mesh(1)?)),
        (2.0, Geometry::from(points(2, 3)?).with(tets(1)?)),
        (3.0, Geometry::from(bare).with(tets(2)?).with(mesh(1)?)),
        (4.0, Geometry::from(tets(2)?)),
    ])
}

/// Arrays that are long enough for every encoding and for several blocks.
fn large(frame: u32) -> Outcome<Geometry> {
    let (counts, corners) = grid(200, 150);
    let vertices = 201 * 151;
    let mut skin = Component::mesh(counts, corners, vectors(vertices, 51, frame))?;
    for (salt, name) in ["noise", "still_noise"].into_iter().enumerate() {
        skin.set_column(
            Owner::Point,
            name,
            Column::new(integers(vertices, salt as u32, frame * u32::from(salt == 0))),
        )?;
    }
    skin.set_column(Owner::Point, "steps", Column::new((0..vertices as i32).map(|i| i * i % 1000 * 70).collect()))?;
    let mut fur = Component::curves(vec![7; 10_000], vectors(70_000, 52, frame))?;
    fur.set_column(Owner::Element, "short", Column::new((0..10_000).map(|i| i % 15).collect()))?;
    let any_bits = (0..60_000).map(|i| f32::from_bits(hash(i, frame, 53))).map(|x| if x.is_nan() { 0.5 } else { x });
    let mut loose = Component::points(vectors(60_000, 54, frame));
    loose.set_column(Owner::Point, "any_bits", Column::new(any_bits.collect()))?;
    Ok(Geometry::from(skin).with(fur).with(loose))
}

/// Components without points, then with some, or none at all.
fn nothing(some: bool) -> Outcome<Geometry> {
    if some {
        return Ok(Geometry::from(Component::points(vec![[1.0; 3]])).with(curves(1)?));
    }
    let mut mesh = Component::mesh(vec![], vec![], vec![])?;
    add_attributes(&mut mesh, 1)?;
    Ok(Geometry::from(mesh).with(Component::points(vec![])).with(Component::tets(vec![], vec![])?))
}

/// The json form with floats as bits, and an empty array for no rows.
fn expected(frame: f64, geometry: &Geometry) -> Value {
    let mut out = Map::new();
    out.insert("frame".into(), json!(frame));
    out.insert("time".into(), json!(frame / FPS));
    for part in geometry.parts() {
        let mut component = Map::new();
        match part.kind() {
            Kind::Curves => {
                component.insert("counts".into(), part.runs().counts().collect());
            }
            Kind::Tets => {
                component.insert("indices".into(), part.tet_corners().iter().map(|tet| json!(tet)).collect());
            }
            _ => {}
        }
        if let Some(faces) = part.faces() {
            component.insert("counts".into(), faces.runs.counts().collect());
            component.insert("indices".into(), faces.corners.iter().copied().collect());
        }
        for (owner, table) in Owner::ALL.into_iter().zip(["point_attributes", "element_attributes", "attributes"]) {
            let columns = part.table(owner).iter().filter(|(name, _)| !(owner == Owner::Point && &***name == "P"));
            let columns: Map<String, Value> = columns.map(|(name, column)| (name.to_string(), bits(column))).collect();
            component.insert(table.into(), columns.into());
        }
        if let Some(positions) = part.table(Owner::Point).column("P") {
            component.insert("points".into(), bits(positions));
        }
        out.insert(part.kind().name().into(), component.into());
    }
    out.into()
}

fn bits(column: &Column) -> Value {
    fn hex(x: f32) -> Value {
        format!("{:08x}", x.to_bits()).into()
    }
    match column {
        Column::F1(rows) => rows.iter().map(|x| hex(*x)).collect(),
        Column::F3(rows) => rows.iter().map(|row| row.map(hex).into_iter().collect::<Value>()).collect(),
        Column::F4(rows) => rows.iter().map(|row| row.map(hex).into_iter().collect::<Value>()).collect(),
        Column::I1(rows) => rows.iter().copied().collect(),
        Column::I3(rows) => rows.iter().map(|row| json!(row)).collect(),
        Column::I4(rows) => rows.iter().map(|row| json!(row)).collect(),
    }
}

fn measure(folder: &Path) -> Outcome {
    const FRAMES: u32 = 100;
    fs::create_dir_all(folder)?;
    let rest = Component::curves(vec![5; 10_000], vectors(50_000, 1, 0))?;
    for (flavour, ending) in [(Flavour::Usda, "usda"), (Flavour::Usdc, "usdc")] {
        let path = folder.join(format!("speed.{ending}"));
        let mut writer = UsdWriter::create(&path, flavour, "speed", FPS, [0.0; 3])?;
        let mut in_frames = Duration::ZERO;
        for frame in 1..=FRAMES {
            let mut moved = rest.clone();
            moved.set(P, vectors(50_000, 1, frame))?;
            let moved = Geometry::from(moved);
            let watch = Stopwatch::start();
            writer.frame(frame.into(), &moved)?;
            in_frames += watch.wall();
        }
        let watch = Stopwatch::start();
        let summary = writer.finish()?;
        println!(
            "{ending}: {:.1} MB, frames {:.3} s, structure, sync and rename {:.3} s; {} arrays stored, {} shared",
            summary.bytes as f64 / 1e6,
            in_frames.as_secs_f64(),
            watch.wall().as_secs_f64(),
            summary.stored,
            summary.shared
        );
        fs::remove_file(path)?;
    }
    Ok(())
}
