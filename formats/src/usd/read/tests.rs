//! Small stages as text: what is read of them, and what is refused.

use std::sync::Arc;

use engine::geometry::{Attr, CURVE_ID, Column, Geometry, ID, Kind, N, Owner, P, PREF, UVW, V, WIDTH};

use super::*;
use crate::FilePosition;

fn opened(body: &str) -> Result<UsdStage> {
    let text = format!("#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Y\"\n)\n{body}");
    UsdStage::open(text.into_bytes().into(), Files)
}

/// Files that stages of these tests reference.
struct Files;

impl UsdAssets for Files {
    fn open(&self, name: &str) -> Result<Arc<[u8]>> {
        let clip = |time: f64, x: f64| {
            format!("#usda 1.0\ndef Points \"p\" {{\n point3f[] points.timeSamples = {{ {time}: [({x}, 0, 0)] }}\n}}\n")
        };
        let text = match name {
            "./dot.usda" => {
                "#usda 1.0\n(\n defaultPrim = \"dot\"\n timeCodesPerSecond = 48\n)\nclass Scope \"dot\" {\n \
                def Points \"p\" {\n point3f[] points.timeSamples = { 0: [(0, 0, 0)], 48: [(1, 0, 0)] }\n \
                float[] widths = [2]\n}\n}\n"
                    .to_owned()
            }
            "./chain.usda" => "#usda 1.0\ndef Scope \"a\" (references = @./dot.usda@) {}\n".to_owned(),
            "./clip.1.usda" => clip(1.0, 1.0),
            "./clip.2.usda" => clip(2.0, 4.0),
            other => return NoAssets.open(other),
        };
        Ok(text.into_bytes().into())
    }
}

fn read(body: &str, time: f64) -> UsdReading {
    opened(body).unwrap().read("", time, &|_| true).unwrap()
}

fn refusal(body: &str) -> String {
    let found = opened(body).and_then(|stage| stage.read("", 0.0, &|_| true));
    let error = found.unwrap_err();
    format!("{error}; {}", error.hint().unwrap_or_default())
}

fn positions(geometry: &Geometry, kind: Kind) -> Vec<[f32; 3]> {
    geometry.part(kind).unwrap().positions().to_vec()
}

const TRIANGLE: &str = "int[] faceVertexCounts = [3]\n int[] faceVertexIndices = [0, 1, 2]\n \
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n";

#[test]
fn primvars_of_each_interpolation_get_their_owner() {
    let body = "def BasisCurves \"c\" {
        uniform token type = \"linear\"
        int[] curveVertexCounts = [2, 1]
        point3f[] points = [(0, 0, 0), (0, 1, 0), (2, 0, 0)]
        vector3f[] velocities = [(1, 0, 0), (1, 0, 0), (1, 0, 0)]
        float[] widths = [0.5] ( interpolation = \"constant\" )
        float[] primvars:mask = [1, 2, 3] (
            interpolation = \"vertex\"
        )
        int[] primvars:curve_id = [7, 8] (
            interpolation = \"uniform\"
            displayName = \"id\"
        )
        float primvars:gain = 3
        float[] primvars:picked = [5, 6] (
            interpolation = \"varying\"
        )
        int[] primvars:picked:indices = [1, 0, 1]
        texCoord2f[] primvars:st = [(0.5, 0.25)] ( interpolation = \"constant\" )
        string[] primvars:names = [\"a\"] ( interpolation = \"constant\" )
        float[] primvars:short = [1, 2] ( interpolation = \"vertex\" )
    }";
    let UsdReading { geometry, notes, .. } = read(body, 1.0);
    let curves = geometry.curves().unwrap();
    assert_eq!(curves.runs().starts(), [0, 2, 3]);
    assert_eq!(curves.get(V), Some(&[[1.0, 0.0, 0.0]; 3][..]));
    assert_eq!(curves.get(WIDTH), Some(&[0.5; 3][..]));
    assert_eq!(curves.get(Attr::<f32>::point("mask")), Some(&[1.0, 2.0, 3.0][..]));
    assert_eq!(curves.table(Owner::Element).get::<i32>(ID.name), Some(&[7, 8][..]));
    assert_eq!(curves.get(CURVE_ID), None);
    assert_eq!(curves.get(Attr::<f32>::once("gain")), Some(&[3.0][..]));
    assert_eq!(curves.get(Attr::<f32>::point("picked")), Some(&[6.0, 5.0, 6.0][..]));
    assert_eq!(curves.get(UVW), Some(&[[0.5, 0.25, 0.0]; 3][..]));
    assert_eq!(
        notes,
        [
            "`primvars:names` of `/c` has texts, so it is not read",
            "`primvars:short` of `/c` has 2 rows, expected 3: one for each CV, so it is not read"
        ]
    );
}

#[test]
fn values_of_corners_are_kept_where_those_of_a_point_agree() {
    let mesh = |values: &str| {
        let body = format!(
            "def Mesh \"m\" {{\n int[] faceVertexCounts = [3, 3]\n int[] faceVertexIndices = [0, 1, 2, 2, 1, 3]\n \
             point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]\n \
             float[] primvars:x = {values} (\n interpolation = \"faceVarying\"\n )\n}}"
        );
        read(&body, 1.0)
    };
    let smooth = mesh("[0, 1, 2, 2, 1, 3]");
    let x = Attr::<f32>::point("x");
    assert_eq!(smooth.geometry.mesh().unwrap().get(x), Some(&[0.0, 1.0, 2.0, 3.0][..]));
    let seam = mesh("[0, 1, 2, 2, 9, 3]");
    assert_eq!(seam.geometry.mesh().unwrap().get(x), None);
    assert_eq!(
        seam.notes,
        [
            "`primvars:x` of `/m` differs between corners of a point at 1 of 6 corners, and points have one value, so it is \
          not read"
        ]
    );
}

#[test]
fn transforms_units_and_axes_are_baked_in() {
    let text = format!(
        "#usda 1.0\n(\n upAxis = \"Z\"\n metersPerUnit = 0.1\n)\ndef Xform \"a\" {{\n double3 xformOp:translate = (0, 0, 10)\n \
         float3 xformOp:scale = (2, 2, 2)\n uniform token[] xformOpOrder = [\"xformOp:translate\", \"xformOp:scale\"]\n \
         def Mesh \"m\" {{\n {TRIANGLE} normal3f[] normals = [(0, 0, 1)] ( interpolation = \"constant\" )\n \
         vector3f[] velocities = [(0, 1, 0), (0, 0, 0), (0, 0, 0)]\n \
         point3f[] primvars:Pref = [(0, 0, 1), (1, 0, 0), (0, 1, 0)] ( interpolation = \"vertex\" )\n}}\n}}"
    );
    let stage = UsdStage::open(text.into_bytes().into(), NoAssets).unwrap();
    let mesh = stage.read("/a/m", 1.0, &|_| true).unwrap().geometry.mesh().unwrap().clone();
    // Doubled, 10 up along Z, Z to Y, tenths to metres.
    assert_eq!(mesh.positions(), [[0.0, 1.0, 0.0], [0.2, 1.0, 0.0], [0.0, 1.0, -0.2]]);
    assert_eq!(mesh.get(N), Some(&[[0.0, 1.0, 0.0]; 3][..]));
    assert_eq!(mesh.get(V).unwrap()[0], [0.0, 0.0, -0.2]);
    assert_eq!(mesh.get(PREF).unwrap()[0], [0.0, 1.2, 0.0]);
}

#[test]
fn what_mirrors_turns_faces_over() {
    let with = |extra: &str| {
        let body = format!("def Mesh \"m\" {{\n{TRIANGLE}{extra}}}");
        read(&body, 1.0).geometry.mesh().unwrap().faces().unwrap().corners.clone()
    };
    assert_eq!(with(""), [0, 1, 2]);
    assert_eq!(with("uniform token orientation = \"leftHanded\"\n"), [0, 2, 1]);
    let mirrored = "float xformOp:scaleX = -1\n uniform token[] xformOpOrder = [\"xformOp:scaleX\"]\n";
    assert_eq!(with(mirrored), [0, 2, 1]);
}

#[test]
fn samples_are_interpolated_and_held_where_topology_changes() {
    let body = "def Points \"p\" {\n point3f[] points.timeSamples = { 1: [(0, 0, 0)], 3: [(2, 4, 8)], \
        5: [(9, 9, 9), (8, 8, 8)] }\n vector3f[] velocities.timeSamples = { 1: [(0, 0, 0)], 3: [(24, 0, 0)], \
        5: [(0, 0, 0), (0, 0, 0)] }\n int64[] ids.timeSamples = { 1: [7], 3: [7], 5: [1, 2] }\n}";
    let stage = opened(body).unwrap();
    let at = |time: f64| positions(&stage.read("/p", time, &|_| true).unwrap().geometry, Kind::Points);
    assert_eq!((at(0.0), at(1.0), at(2.0)), (vec![[0.0; 3]], vec![[0.0; 3]], vec![[1.0, 2.0, 4.0]]));
    // Half a frame along 24 m/s at 24 frames a second.
    assert_eq!(at(3.5), [[2.5, 4.0, 8.0]]);
    assert_eq!(at(99.0), [[9.0; 3], [8.0; 3]]);
    assert_eq!(stage.times("").unwrap(), [1.0, 3.0, 5.0]);
    assert!(stage.moves("/p").unwrap());
}

#[test]
fn what_does_not_change_is_shared_between_times() {
    let body = format!(
        "def Mesh \"m\" {{\n{} float[] primvars:mask = [1, 2, 3] ( interpolation = \"vertex\" )\n}}\n",
        TRIANGLE.replace(
            "points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
            "points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (0, 1, \
            0)], 2: [(0, 0, 0), (1, 0, 0), (0, 2, 0)], 3: [(0, 0, 0), (1, 0, 0), (0, 2, 0)] }"
        )
    );
    let stage = opened(&body).unwrap();
    let at = |time: f64| stage.read("", time, &|_| true).unwrap().geometry.mesh().unwrap().clone();
    let [first, second, third] = [1.0, 2.0, 3.0].map(at);
    assert!(first.topology().same(second.topology()));
    let mask = |part: &engine::geometry::Component| part.table(Owner::Point).column("mask").unwrap().clone();
    assert!(mask(&first).same(&mask(&second)));
    assert!(
        !first.table(Owner::Point).column(P.name).unwrap().same(second.table(Owner::Point).column(P.name).unwrap())
    );
    // Equal samples are one value.
    assert!(second.table(Owner::Point).column(P.name).unwrap().same(third.table(Owner::Point).column(P.name).unwrap()));
    let still = opened(&format!("def Mesh \"m\" {{\n{TRIANGLE}}}")).unwrap();
    assert!(!still.moves("").unwrap());
}

#[test]
fn single_values_keep_their_type() {
    let body = "def Points \"a\" {\n point3f[] points = [(2, 0, 0), (3, 0, 0)]\n int primvars:i = 16777217\n \
        uint primvars:u = 7\n bool primvars:b = true\n float primvars:f = 7\n double primvars:d = 0.5\n \
        int3 primvars:three = (1, -2, 3)\n int64 primvars:long = 5000000000\n}\n";
    let UsdReading { geometry, notes, hides_some } = read(body, 1.0);
    let points = geometry.points().unwrap();
    let column = |name: &str| points.table(Owner::Once).column(name).unwrap().clone();
    assert_eq!(column("i"), Column::new(vec![16_777_217]));
    assert_eq!([column("u"), column("b")], [Column::new(vec![7]), Column::new(vec![1])]);
    assert_eq!([column("f"), column("d")], [Column::new(vec![7.0_f32]), Column::new(vec![0.5_f32])]);
    assert_eq!(column("three"), Column::new(vec![[1, -2, 3]]));
    assert_eq!(notes, ["`primvars:long` of `/a` has whole numbers beyond 32 bits, so it is not read"]);
    assert!(!hides_some);
}

#[test]
fn the_span_is_that_of_all_samples() {
    let stage = opened(
        "def Xform \"a\" {\n double3 xformOp:translate.timeSamples = { 3: (0, 0, 0), 7: (1, 0, 0) }\n uniform token[] xformOpOrder = \
         [\"xformOp:translate\"]\n def Points \"p\" {\n point3f[] points.timeSamples = { 5: [(0, 0, 0)], 9: [(1, 0, 0)] }\n}\n}\n",
    )
    .unwrap();
    assert_eq!((stage.span("").unwrap(), stage.span("/a/p").unwrap()), (Some([3.0, 9.0]), Some([3.0, 9.0])));
    let still = opened(&format!("def Mesh \"m\" {{\n{TRIANGLE}}}")).unwrap();
    assert_eq!(still.span("").unwrap(), None);
}

#[test]
fn several_prims_of_a_kind_are_joined_in_the_order_of_the_stage() {
    let body = "def Xform \"b\" {\n def Points \"x\" {\n point3f[] points = [(1, 0, 0)]\n float[] widths = [3]\n \
        float primvars:gain = 5\n}\n}\ndef Points \"a\" {\n point3f[] points = [(2, 0, 0), (3, 0, 0)]\n}\n\
        def Sphere \"s\" {\n}\ndef Points \"hidden\" {\n point3f[] points = [(0, 0, 0)]\n token visibility = \"invisible\"\n}\n\
        over \"only\" {\n def Points \"p\" {\n point3f[] points = [(0, 0, 0)]\n}\n}\n";
    let UsdReading { geometry, notes, .. } = read(body, 1.0);
    let points = geometry.points().unwrap();
    assert_eq!(points.positions(), [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    assert_eq!(points.get(WIDTH), Some(&[3.0, 0.0, 0.0][..]));
    assert_eq!(points.get(Attr::<f32>::point("gain")), Some(&[5.0, 0.0, 0.0][..]));
    assert_eq!(notes, ["`/hidden` is invisible, so it is not read", "`/s` is a Sphere, which is not read"]);
}

#[test]
fn references_add_what_is_weaker_at_their_own_time() {
    let body = "def Scope \"a\" (\n prepend references = @./dot.usda@ (offset = 10)\n)\n{\n over \"p\" {\n \
        float[] widths = [9]\n}\n}\n";
    let stage = opened(body).unwrap();
    assert_eq!(stage.files_at(1.0), ["./dot.usda"]);
    // 48 time codes there are a second, as 24 are here.
    let read = stage.read("/a", 22.0, &|_| true).unwrap().geometry;
    assert_eq!(positions(&read, Kind::Points), [[0.5, 0.0, 0.0]]);
    assert_eq!(read.points().unwrap().get(WIDTH), Some(&[9.0][..]));
    assert_eq!(stage.times("").unwrap(), [10.0, 34.0]);
}

#[test]
fn clips_give_values_at_their_times_and_between_them() {
    let body = "def Points \"q\" (\n clips = {\n dictionary default = {\n \
        asset[] assetPaths = [@./clip.1.usda@, @./clip.2.usda@]\n double2[] active = [(1, 0), (2, 1)]\n \
        double2[] times = [(1, 1), (2, 2)]\n string primPath = \"/p\"\n }\n }\n)\n{\n point3f[] points\n}\n";
    let stage = opened(body).unwrap();
    let at = |time: f64| positions(&stage.read("", time, &|_| true).unwrap().geometry, Kind::Points)[0][0];
    assert_eq!([0.0, 1.0, 1.5, 2.0, 7.0].map(at), [1.0, 1.0, 2.5, 4.0, 4.0]);
    assert_eq!(stage.files_at(1.2), ["./clip.1.usda", "./clip.2.usda"]);
    assert_eq!(stage.files_at(5.0), ["./clip.2.usda"]);
    assert_eq!(stage.times("").unwrap(), [1.0, 2.0]);
}

#[test]
fn values_at_the_ends_of_segments_are_spread_over_cubic_curves() {
    let curves = |basis: &str, widths: &str| {
        let body = format!(
            "def BasisCurves \"c\" {{\n uniform token basis = \"{basis}\"\n int[] curveVertexCounts = [4]\n \
             point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)]\n float[] widths = {widths} (\n \
             interpolation = \"varying\"\n )\n}}"
        );
        let read = read(&body, 1.0);
        (read.geometry.curves().unwrap().get(WIDTH).map(<[f32]>::to_vec), read.notes)
    };
    let note = "`/c` has cubic curves, which enter by their control points".to_owned();
    assert_eq!(curves("bezier", "[0, 3]"), (Some(vec![0.0, 1.0, 2.0, 3.0]), vec![note.clone()]));
    assert_eq!(curves("bspline", "[1, 3]"), (Some(vec![1.0, 1.0, 3.0, 3.0]), vec![note]));
}

#[test]
fn what_is_composed_otherwise_is_refused_by_name_with_what_to_type() {
    let flatten = "flatten it first: usdcat --flatten -o out.usdc in.usd";
    for (body, expected) in [
        (
            "def Scope \"a\" (variants = { string v = \"x\" }\n prepend variantSets = \"v\") {}",
            format!("`/a` has variants, which are not read; {flatten}"),
        ),
        ("def Scope \"a\" (inherits = </b>) {}", format!("`/a` has inherited classes, which are not read; {flatten}")),
        (
            "def Scope \"a\" (references = @./chain.usda@</a>) {}",
            format!("`/a` is referenced and has references itself, which are not read; {flatten}"),
        ),
        (
            "def Scope \"a\" (references = @./dot.usda@</none>) {}",
            "`/a` references the prim `/none` of `./dot.usda`, which does not exist; name a prim of the file, or set its \
             defaultPrim"
                .into(),
        ),
        (
            "def Xform \"a\" {\n double xformOp:rotateX.spline = { bezier }\n \
             uniform token[] xformOpOrder = [\"xformOp:rotateX\"]\n}",
            "`/a` has a spline for `xformOp:rotateX`, which is not read; bake it to time samples in the program that made it"
                .into(),
        ),
    ] {
        assert_eq!(refusal(body), expected, "{body}");
    }
    let text = "#usda 1.0\n(\n subLayers = [@./a.usda@, @./b.usda@]\n)\n";
    let error = UsdStage::open(text.as_bytes().into(), NoAssets).unwrap_err();
    assert_eq!(error.to_string(), "it has sublayers, which are not read, such as `./a.usda`");
    assert_eq!(error.hint().unwrap(), flatten);
    let mut crate_file = b"PXR-USDC\0\x0d\0".to_vec();
    crate_file.resize(200, 0);
    let error = UsdStage::open(crate_file.into(), NoAssets).unwrap_err();
    assert_eq!(error.to_string(), "crate 0.13.0 is not read; 0.4 to 0.12 are");
    assert_eq!(error.hint().unwrap(), "convert it first: usdcat -o out.usdc in.usd");
    let error = UsdStage::open(b"v 0 0 0".as_slice().into(), NoAssets).unwrap_err();
    assert_eq!(error.to_string(), "byte 0: it is no USD: it starts neither with `PXR-USDC` nor with `#usda`");
}

#[test]
fn a_prim_that_does_not_exist_is_refused_with_those_that_do() {
    let stage = opened("def Scope \"a\" {\n def Scope \"b\" {}\n}").unwrap();
    let error = stage.read("/a/c", 0.0, &|_| true).unwrap_err();
    assert_eq!(error.to_string(), "it has no prim `/a/c`; under `/a` there is `/a/b`");
    assert!(matches!(error, FormatError::Content { position: FilePosition::File, .. }));
}

#[test]
fn text_that_is_no_usd_is_refused_with_its_line() {
    for (body, expected) in [
        ("def Scope \"a\" {\n", "line 7: `a` has no end"),
        ("}", "line 6: `}` closes nothing"),
        ("def Scope \"a\" {\n float = \n}", "line 7: `float`, expected a property"),
        ("def Points \"a\" {\n point3f[] points = [(0, 0)]\n}", "line 7: `)]`, expected `,`"),
        ("x", "line 6: `x`, expected a prim"),
    ] {
        let error = opened(body).and_then(|stage| stage.read("", 0.0, &|_| true)).unwrap_err();
        assert_eq!(error.to_string(), expected, "{body}");
    }
}

#[test]
fn deep_nesting_is_no_danger() {
    let body = "def \"a\" {\n".repeat(100_000);
    assert!(opened(&body).is_err());
    let closed = body + &"}\n".repeat(100_000);
    let error = opened(&closed).unwrap().read("", 0.0, &|_| true).unwrap_err();
    assert!(error.to_string().ends_with("lies under more than 512 others"), "{error}");
}

#[test]
fn attributes_that_nobody_wants_are_not_read() {
    let body = "def Points \"p\" {\n point3f[] points = [(0, 0, 0)]\n float[] widths = [1]\n}";
    let stage = opened(body).unwrap();
    let bare = stage.read("", 0.0, &|name| name != "width").unwrap().geometry;
    assert_eq!(bare.points().unwrap().get(WIDTH), None);
    let whole = stage.read("", 0.0, &|_| true).unwrap().geometry;
    assert_eq!(whole.points().unwrap().table(Owner::Point).column("width"), Some(&Column::new(vec![1.0_f32])));
}
