//! Tests of whole files without the USD library: text, sizes, and files left on disk.

use std::fs;
use std::io::Cursor;

use engine::geometry::{Column, Component, Grid, Kind, Owner, P, SHIELDED, V, Volume, WIDTH};

use super::*;

fn fur() -> Component {
    let mut part =
        Component::curves(vec![3, 2], vec![[0.0; 3], [0.0, 1.0, 0.0], [0.0, 2.0, 0.5], [1.0, 0.0, 0.0], [1.0; 3]])
            .unwrap();
    part.set(WIDTH, vec![0.1, 0.1, 0.01, 0.2, 0.02]).unwrap();
    part.set(SHIELDED, vec![0.0, 1.0]).unwrap();
    part.set_column(Owner::Once, "a-b", Column::new(vec![[1.0, -0.0, 1e-42_f32]])).unwrap();
    part
}

fn write_to(flavour: Flavour, name: &str, origin: [f64; 3], frames: &[(f64, Geometry)]) -> Vec<u8> {
    let frames: Vec<(f64, Vec<&Geometry>)> = frames.iter().map(|(time, geometry)| (*time, vec![geometry])).collect();
    write_set(flavour, (name, &[]), origin, &frames)
}

fn write_set(
    flavour: Flavour,
    (name, members): (&str, &[&str]),
    origin: [f64; 3],
    frames: &[(f64, Vec<&Geometry>)],
) -> Vec<u8> {
    let file = Cursor::new(Vec::new());
    let encoder: Box<dyn Encoder<Cursor<Vec<u8>>>> = match flavour {
        Flavour::Usda => Box::new(usda::Writer::new(file, Cursor::new(Vec::new()))),
        Flavour::Usdc => Box::new(usdc::Writer::new(file).unwrap()),
    };
    let members = members.iter().map(|name| (*name).to_owned()).collect();
    let mut recorder = Recorder::new(encoder, Header { name: name.into(), fps: 24.0, origin, members });
    for (time, geometries) in frames {
        recorder.frame(*time, geometries).unwrap();
    }
    recorder.finish().unwrap().0.into_inner()
}

fn text_of(name: &str, origin: [f64; 3], frames: &[(f64, Geometry)]) -> String {
    String::from_utf8(write_to(Flavour::Usda, name, origin, frames)).unwrap()
}

#[test]
fn a_small_scene_gives_the_expected_text() {
    let mut moved = fur();
    moved.edit(P).unwrap()[4] = [f32::NAN, 2.0, 1.0];
    moved.remove(Owner::Element, "shielded");
    let frames = [(1001.0, fur().into()), (1001.5, moved.into())];
    let expected = r#"#usda 1.0
(
    defaultPrim = "fur_2"
    metersPerUnit = 1
    timeCodesPerSecond = 24
    framesPerSecond = 24
    startTimeCode = 1001
    endTimeCode = 1001.5
    upAxis = "Y"
)

def Xform "fur_2" (
    displayName = "fur-2"
)
{
    double3 xformOp:translate = (1000000.5, 0, -2)
    uniform token[] xformOpOrder = ["xformOp:translate"]

    def BasisCurves "curves"
    {
        uniform token type = "linear"
        uniform token wrap = "nonperiodic"
        int[] curveVertexCounts = [3, 2]
        float3[] extent = [(-0.1, -0.1, -0.1), (1.1, 2.1, 1.1)]
        point3f[] points.timeSamples = {
            1001: [(0, 0, 0), (0, 1, 0), (0, 2, 0.5), (1, 0, 0), (1, 1, 1)],
            1001.5: [(0, 0, 0), (0, 1, 0), (0, 2, 0.5), (1, 0, 0), (nan, 2, 1)],
        }
        float[] widths = [0.1, 0.1, 0.01, 0.2, 0.02] (
            interpolation = "vertex"
        )
        float[] primvars:shielded (
            interpolation = "uniform"
        )
        float[] primvars:shielded.timeSamples = {
            1001: [0, 1],
            1001.5: None,
        }
        float3[] primvars:a_b = [(1, -0, 1e-42)] (
            displayName = "a-b"
            interpolation = "constant"
        )
    }
}
"#;
    assert_eq!(text_of("fur-2", [1_000_000.5, 0.0, -2.0], &frames), expected);
}

#[test]
fn several_outputs_are_prims_of_one_stage() {
    let (still, mut moved): (Geometry, Component) = (fur().into(), fur());
    moved.edit(P).unwrap()[0] = [0.5; 3];
    moved.remove(Owner::Point, "width");
    let dots: Geometry = Component::points(vec![[1.0; 3]]).into();
    let (moved, none) = (moved.into(), Geometry::default());
    let names = ["skin.tets", "skin_tets", "dots", "none"];
    let frames = [(1.0, vec![&still, &still, &dots, &none]), (2.0, vec![&still, &moved, &dots, &none])];
    let text = String::from_utf8(write_set(Flavour::Usda, ("set", &names), [0.0, 2.0, 0.0], &frames)).unwrap();
    let prims: Vec<&str> = text.lines().filter(|line| line.contains("def ")).collect();
    let expected = [
        "def Xform \"set\"",
        "    def Xform \"skin_tets_2\" (",
        "        def BasisCurves \"curves\"",
        "    def Xform \"skin_tets\"",
        "        def BasisCurves \"curves\"",
        "    def Xform \"dots\"",
        "        def Points \"points\"",
        "    def Xform \"none\"",
    ];
    assert_eq!(prims, expected);
    assert!(
        text.contains(
            "    def Xform \"skin_tets_2\" (\n        displayName = \"skin.tets\"\n    )\n    {\n        def"
        )
    );
    assert!(text.ends_with("        }\n    }\n\n    def Xform \"none\"\n    {\n    }\n}\n"), "{text}");
    assert_eq!(text.matches("timeSamples").count(), 3, "points, extent and widths of the one that moves: {text}");
    for flavour in [Flavour::Usda, Flavour::Usdc] {
        let bytes = write_set(flavour, ("set", &names), [0.0, 2.0, 0.0], &frames);
        let stage = UsdStage::open(bytes.into(), NoAssets).unwrap();
        assert_eq!(stage.members().unwrap(), names);
        for (time, geometries) in &frames {
            for (place, geometry) in geometries.iter().enumerate() {
                let read = stage.read_member(Some(place), *time).unwrap();
                let [ours, theirs] =
                    [&read.geometry, *geometry].map(|one| one.curves().map(|part| part.get(P).unwrap().to_vec()));
                assert_eq!(ours, theirs, "{place} at {time}");
                assert_eq!(read.geometry.points().is_some(), geometry.points().is_some());
            }
            let all = stage.read("", *time, &|_| true).unwrap().geometry;
            assert_eq!(all.curves().unwrap().point_count(), 10, "as one component");
        }
    }
    let one = write_to(Flavour::Usdc, "set", [0.0; 3], &[(1.0, still)]);
    assert_eq!(UsdStage::open(one.into(), NoAssets).unwrap().members().unwrap(), [""; 0]);
}

#[test]
fn curves_without_widths_get_a_width_and_an_extent_for_it() {
    let mut thin = fur();
    thin.remove(Owner::Point, "width");
    let text = text_of("fur", [0.0; 3], &[(1.0, thin.clone().into()), (2.0, thin.clone().into())]);
    assert!(text.contains("        float[] widths = [0.001] (\n            interpolation = \"constant\"\n"), "{text}");
    assert!(text.contains("extent = [(-0.0005, -0.0005, -0.0005), (1.0005, 2.0005, 1.0005)]"), "{text}");
    assert!(lacks_width(&thin.clone().into()) && !lacks_width(&fur().into()));
    let text = text_of("fur", [0.0; 3], &[(1.0, thin.into()), (2.0, fur().into())]);
    assert_eq!(text.matches("widths").count(), 2, "one property with its time samples: {text}");
    assert!(text.contains("1: [0.001, 0.001, 0.001, 0.001, 0.001],"), "{text}");
}

#[test]
fn files_without_frames_or_components_are_valid() {
    let expected = "#usda 1.0\n(\n    defaultPrim = \"fur\"\n    metersPerUnit = 1\n    timeCodesPerSecond = 24\n    \
        framesPerSecond = 24\n    upAxis = \"Y\"\n)\n\ndef Xform \"fur\"\n{\n}\n";
    assert_eq!(text_of("fur", [0.0; 3], &[]), expected);
    let span = "    startTimeCode = 3\n    endTimeCode = 3\n    upAxis";
    assert_eq!(text_of("fur", [0.0; 3], &[(3.0, Geometry::default())]), expected.replace("    upAxis", span));
    assert!(write_to(Flavour::Usdc, "fur", [0.0; 3], &[]).starts_with(b"PXR-USDC\0\x08\0"));
}

#[test]
fn a_frame_costs_its_changing_arrays_and_one_handle_per_attribute() {
    let points = 1000;
    let frame = |x: f32| {
        let mut part = Component::curves(vec![5; 200], vec![[x, 0.0, 0.0]; points]).unwrap();
        part.set(V, vec![[1.0, 0.0, 0.0]; points]).unwrap();
        part.set_column(Owner::Point, "Pref", Column::new(vec![[0.5_f32; 3]; points])).unwrap();
        Geometry::from(part)
    };
    let frames: Vec<(f64, Geometry)> = (0..50_u8).map(|f| (f64::from(f), frame(f.into()))).collect();
    let size = |n: usize| write_to(Flavour::Usdc, "fur", [0.0; 3], &frames[..n]).len();
    let points_and_extent = points * 12 + 8 + 24 + 8;
    let time_and_three_handles = 8 + 3 * 8;
    assert_eq!(size(50) - size(49), points_and_extent + time_and_three_handles);
}

#[test]
fn writing_twice_gives_the_same_bytes() {
    let frames = [(1.0, fur().into()), (2.0, Geometry::default()), (2.25, fur().into())];
    for flavour in [Flavour::Usda, Flavour::Usdc] {
        let bytes = write_to(flavour, "fur", [0.0; 3], &frames);
        assert_eq!(bytes, write_to(flavour, "fur", [0.0; 3], &frames));
    }
}

#[test]
fn a_file_appears_when_it_is_finished_without_temporaries() {
    let folder = tempfile::tempdir().unwrap();
    let visible = || -> Vec<String> {
        let names = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|name| !name.starts_with('.')).collect()
    };
    for flavour in [Flavour::Usda, Flavour::Usdc] {
        let path = folder.path().join("fur.usd");
        let mut writer = UsdWriter::create(&path, flavour, "fur", 24.0, [0.0; 3]).unwrap();
        writer.frame(1.0, &fur().into()).unwrap();
        assert!(visible().is_empty());
        let summary = writer.finish().unwrap();
        assert_eq!((summary.frames, summary.stored, summary.shared), (1, 6, 0));
        assert_eq!(fs::read(&path).unwrap(), write_to(flavour, "fur", [0.0; 3], &[(1.0, fur().into())]));
        assert_eq!(fs::metadata(&path).unwrap().len(), summary.bytes);
        fs::remove_file(&path).unwrap();
        let mut dropped = UsdWriter::create(&path, flavour, "fur", 24.0, [0.0; 3]).unwrap();
        dropped.frame(1.0, &fur().into()).unwrap();
        drop(dropped);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn errors_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fur.usdc");
    let shown = path.display();
    let create = |path: &Path, fps: f64| UsdWriter::create(path, Flavour::Usdc, "fur", fps, [0.0; 3]);
    for fps in [0.0, -24.0, f64::NAN, f64::INFINITY] {
        let text = create(&path, fps).err().unwrap().to_string();
        assert_eq!(text, format!("`{shown}` could not be written: `fps` is {fps}, expected a positive number"));
    }
    let missing = folder.path().join("no").join("fur.usdc");
    assert!(
        create(&missing, 24.0)
            .err()
            .unwrap()
            .to_string()
            .starts_with(&format!("`{}` could not be created", missing.display()))
    );
    let mut writer = create(&path, 24.0).unwrap();
    let grid = Grid { origin: [0.0; 3], cell: 0.1, size: [0; 3] };
    let mut geometry = Geometry::default();
    geometry.put_volume(Volume::new(grid, vec![], [vec![], vec![], vec![]]).unwrap());
    let text = writer.frame(1.0, &geometry).unwrap_err().to_string();
    assert_eq!(
        text,
        format!("`{shown}` could not be written: frame 1 has a `volume`, which usda and usdc cannot hold; json can")
    );
    assert_eq!(geometry.kinds().collect::<Vec<_>>(), [Kind::Volume]);
    writer.frame(1.0, &fur().into()).unwrap();
    assert!(writer.finish().is_ok(), "a refused frame does not damage the file");
}
