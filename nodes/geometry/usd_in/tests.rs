//! Usd_In on stages written as text.

use super::*;
use conformance::{bench, conformance};
use engine::param::Source;

const HEADER: &str = "#usda 1.0\n(\n metersPerUnit = 1\n upAxis = \"Y\"\n)\n";

/// Each kind of prim, and a curve that moves by its frame along X.
const STAGE: &str = "def Xform \"set\" {
    def BasisCurves \"fur\" {
        uniform token type = \"linear\"
        int[] curveVertexCounts = [2]
        point3f[] points.timeSamples = { 1: [(1, 0, 0), (1, 1, 0)], 31: [(31, 0, 0), (31, 1, 0)] }
        float[] widths = [0.5] ( interpolation = \"constant\" )
    }
    def Mesh \"skin\" {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    }
    def Points \"dust\" { point3f[] points = [(0, 0, 0)] }
    def TetMesh \"body\" {
        int4[] tetVertexIndices = [(0, 1, 2, 3)]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    }
}
";

fn stage(body: &str) -> (tempfile::TempDir, Source) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in.usda");
    std::fs::write(&path, format!("{HEADER}{body}")).unwrap();
    (folder, Source::File { path: path.into(), numbered: false })
}

#[test]
fn conforms_to_its_declaration() {
    let (_folder, file) = stage(STAGE);
    let skin = file.clone();
    conformance(&NODE)
        .with(move |bench| bench.source(FILE.name(), file.clone()))
        .with(move |bench| bench.source(FILE.name(), skin.clone()).set(PRIM, "/set/skin".into()))
        .run();
}

#[test]
fn a_frame_between_samples_is_interpolated_and_scaled() {
    let (_folder, file) = stage(STAGE);
    let out = bench(&NODE).source(FILE.name(), file).set(FRAME, 10.5).set(SCALE, 2.0).cook();
    assert_eq!(out.curves().positions(), [[21.0, 0.0, 0.0], [21.0, 2.0, 0.0]]);
    assert_eq!(out.curves().get(WIDTH), Some(&[1.0; 2][..]));
}

#[test]
fn a_file_without_geometry_is_refused_with_what_it_has() {
    let (_folder, file) = stage("def Sphere \"ball\" {}\n");
    let error = bench(&NODE).source(FILE.name(), file).try_cook().unwrap_err();
    assert!(
        error.fact.ends_with("in.usda` has no curves, mesh, points or tets: `/ball` is a Sphere, which is not read"),
        "{error}"
    );
    let (_folder, file) = stage("def Scope \"a\" (inherits = </b>) {}\n");
    let error = bench(&NODE).source(FILE.name(), file).try_cook().unwrap_err();
    assert!(error.fact.ends_with("in.usda`: `/a` has inherited classes, which are not read"), "{error}");
    assert_eq!(error.hint.unwrap(), "flatten it first: usdcat --flatten -o out.usdc in.usd");
    let error = bench(&NODE).try_cook().unwrap_err();
    assert_eq!(error.to_string(), "it has no `file`; name a usdc, usda or usdz file");
}

#[test]
fn a_time_outside_of_the_samples_is_published() {
    let (_folder, file) = stage(STAGE);
    let held = |frame: f64, prim: &str| {
        let bench = bench(&NODE).source(FILE.name(), file.clone()).set(FRAME, frame).set(PRIM, prim.into());
        bench.cook().metrics[HELD.name]
    };
    assert_eq!([0.0, 1.0, 16.0, 31.0, 40.5].map(|frame| held(frame, "")), [1.0, 0.0, 0.0, 0.0, 9.5]);
    assert_eq!(held(40.0, "/set/skin"), 0.0, "what does not move is never held");
}

#[test]
fn what_is_invisible_at_times_is_nothing_there() {
    let body = STAGE.replace(
        "def Xform \"set\" {",
        "def Xform \"set\" {\n token visibility.timeSamples = { 1: \"inherited\", 3: \"invisible\", 5: \"inherited\" }",
    );
    let (_folder, file) = stage(&body);
    let kinds = |frame: f64| {
        let out = bench(&NODE).source(FILE.name(), file.clone()).set(FRAME, frame).cook();
        out.geometry.kinds().next().is_some()
    };
    assert_eq!([2.0, 3.0, 4.5, 5.0].map(kinds), [true, false, false, true]);
}

#[test]
fn numbers_that_are_not_finite_are_refused_by_file_and_attribute() {
    let (_folder, file) = stage(&STAGE.replace("float[] widths = [0.5]", "float[] widths = [nan]"));
    let error = bench(&NODE).source(FILE.name(), file).try_cook().unwrap_err();
    assert!(
        error.fact.ends_with("in.usda` has a NaN or infinity: `width` of the curves at index 0, counted from 0"),
        "{error}"
    );
    assert!(error.hint.unwrap().starts_with("`convect stats FILE --frame F` counts NaNs"));
}
