//! `stats`, for all formats that it reads.

use serde_json::json;

use crate::bench::Bench;

/// A unit cube with one corner at the origin.
const CUBE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n\
    f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

#[test]
fn a_cube_is_measured() {
    let bench = Bench::new();
    bench.write("cube.obj", CUBE);
    let expected = "cube.obj: obj, 124 bytes
mesh           6 faces, 8 points
  bounds       [0, 0, 0] to [1, 1, 1] m, size [1, 1, 1]
  area         6 m²
  volume       1 m³
  edges        12: 12 manifold, 0 boundary, 0 non-manifold, 0 flipped
  P            point float3, [0, 0, 0] to [1, 1, 1], mean [0.5, 0.5, 0.5]
";
    assert_eq!(bench.done(&["stats", "cube.obj"]), expected);
    let stats = bench.json(&["stats", "cube.obj", "--json"]);
    assert_eq!((&stats["format"], &stats["bytes"]), (&json!("obj"), &json!(124)));
    assert_eq!((&stats["mesh"]["volume"], &stats["mesh"]["closed"]), (&json!(1.0), &json!(true)));
    assert_eq!(stats["mesh"]["point_attributes"]["P"]["mean"], json!([0.5, 0.5, 0.5]));
}

#[test]
fn a_cube_without_a_lid_is_open() {
    let bench = Bench::new();
    bench.write("box.obj", CUBE.rsplit_once("f ").unwrap().0);
    let stats = bench.json(&["stats", "box.obj", "--json"]);
    let mesh = &stats["mesh"];
    assert_eq!(
        (&mesh["closed"], &mesh["volume"], &mesh["edges"]["boundary"]),
        (&json!(false), &json!(null), &json!(4))
    );
    assert!(bench.done(&["stats", "box.obj"]).contains("none: the surface is not closed"));
}

#[test]
fn the_same_geometry_has_the_same_numbers_in_every_format() {
    let bench = Bench::new();
    let stats = |file: &str| bench.json(&["stats", file, "--json"])["curves"].clone();
    let expected = stats("grass.obj");
    assert_eq!((&expected["curves"], &expected["points"]), (&json!(60), &json!(300)));
    assert_eq!(expected["bounds"], json!({"min": [0.0, 0.0, 0.0], "max": [1.125, 0.25, 0.625]}));
    for format in ["json", "ply"] {
        let name = format!("grass.{format}");
        bench.done(&["convert", "grass.obj", &name]);
        assert_eq!(stats(&name), expected, "{format}");
    }
}

#[test]
fn tets_volumes_and_points_are_measured_too() {
    let bench = Bench::new();
    bench.write(
        "all.json",
        r#"{
      "points": {"points": [[1, 2, 3]], "point_attributes": {"id": [7]}, "attributes": {"mass": [2.5]}},
      "tets": {"indices": [[0, 1, 2, 3]], "points": [[0, 0, 0], [6, 0, 0], [0, 1, 0], [0, 0, 1]]},
      "volume": {"origin": [0, 0, 0], "cell": 0.1, "size": [1, 1, 2], "level_set": [-0.05, 0.05],
        "velocity_x": [0, 0, 0, 4], "velocity_y": [0, 0, 0, 0], "velocity_z": [1, 1, 1]}}"#,
    );
    let stats = bench.json(&["stats", "all.json", "--json"]);
    assert_eq!(stats["tets"]["volume"], json!({"min": 1.0, "max": 1.0, "mean": 1.0, "total": 1.0}));
    assert_eq!((&stats["tets"]["tets"], &stats["tets"]["inverted"]), (&json!(1), &json!(0)));
    let id = &stats["points"]["point_attributes"]["id"];
    assert_eq!((&id["type"], &id["min"], &id["mean"]), (&json!("int"), &json!(7.0), &json!(7.0)));
    assert_eq!(stats["points"]["attributes"]["mass"]["max"], json!(2.5));
    let volume = &stats["volume"];
    assert_eq!((&volume["cells"], &volume["inside"], &volume["cell"]), (&json!(2), &json!(1), &json!(0.1)));
    assert_eq!(volume["fields"]["velocity_x"]["mean"], json!(1.0));
    let text = bench.done(&["stats", "all.json"]);
    for line in ["points         1\n", "tets           1, 4 points\n", "volume         1 × 1 × 2 cells of 0.1 m\n"] {
        assert!(text.contains(line), "`{line}` in {text}");
    }
}

#[test]
fn a_file_without_geometry_is_reported_as_such() {
    let bench = Bench::new();
    bench.write("empty.json", "{}");
    assert_eq!(bench.done(&["stats", "empty.json"]), "empty.json: json, 2 bytes\nno components\n");
}

#[test]
fn an_invalid_geometry_file_is_refused() {
    let bench = Bench::new();
    bench.write("a.txt", "v 0 0 0");
    for file in ["a.txt", "g.json", "missing.obj", "."] {
        assert_eq!(bench.run(&["stats", file]).code, Some(1), "{file}");
    }
}
