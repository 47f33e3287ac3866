//! `job` and `merge`: a cook in parts is the cook of the whole.

use std::fs;
use std::process::Command;

use serde_json::{Value, json};

use crate::bench::Bench;

/// Grass that swings, grass at rest, and a drop of dough that falls.
const SCENE: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 9], "fps": 24, "origin": [1000.25, 0, 0] },
  "nodes": {
    "blades": { "type": "Curve_In", "params": { "file": "grass.obj" } },
    "wind": { "type": "Curve_Wind", "inputs": { "curves": "blades" }, "params": { "global_rotate": { "keyframes": [[1, 0], [4, 0.6]] }, "scroll": 0, "noise": "none" } },
    "box": { "type": "Mesh_Primitive", "params": { "divisions": 1 } },
    "tets": { "type": "Tetrahedralize", "inputs": { "surface": "box" } },
    "fall": { "type": "Softbody", "inputs": { "bodies": "tets" } }
  },
  "outputs": { "grass": "wind", "still": "blades", "dough": "fall" }
}"#;

/// Runs a line of a list, with this program.
fn run(bench: &Bench, line: &str) {
    let rest = line.strip_prefix("convect ").unwrap();
    let words: Vec<&str> = rest.split(' ').map(|word| word.trim_matches('\'')).collect();
    bench.done(&words);
}

#[test]
fn the_parts_of_a_list_merge_to_the_whole() {
    let bench = Bench::with_graph(SCENE);
    bench.done(&["cook", "g.json", "--out", "whole"]);
    bench.done(&["job", "g.json", "--engine", "list", "--out", "farm", "--chunk", "4"]);
    let list = fs::read_to_string(bench.path("farm/g.list.txt")).unwrap();
    let lines: Vec<&str> = list.lines().collect();
    // The dough, what stands still, three parts of the grass, and the merge.
    assert_eq!(lines.len(), 6, "{list}");
    assert_eq!(
        lines[2],
        "convect cook g.json --part 1-4 --output grass --out farm/parts/1-4 --cache farm/cache --report \
         farm/parts/1-4/report.frames.json --quiet"
    );
    // From frame 4 on the grass does not move, so that its last part has no reason to sample.
    lines[..5].iter().for_each(|line| run(&bench, line));
    run(&bench, lines[5]);
    for name in ["grass", "dough", "still"] {
        let [whole, merged] = [format!("whole/{name}.usdc"), format!("farm/{name}.usda")];
        assert_eq!(bench.done(&["diff", &whole, &merged]), "the same\n", "{name}");
    }
    assert_eq!(bench.read_json("farm/report.json")["frames"], json!([1, 2, 3, 4, 5, 6, 7, 8, 9]));
    bench.done(&["merge", "farm", "--one-file", "--output", "grass"]);
    assert_eq!(bench.done(&["diff", "whole/grass.usdc", "farm/grass.usdc"]), "the same\n");
    // Between frames of two parts.
    bench.write(
        "read.json",
        r#"{"convect": 1, "scene": {"frames": [1, 9]}, "nodes": {
            "a": {"type": "Usd_In", "params": {"file": "whole/grass.usdc"}},
            "b": {"type": "Usd_In", "params": {"file": "farm/grass.usda"}}
        }, "outputs": {"a": "a", "b": "b"}}"#,
    );
    bench.done(&["cook", "read.json", "--frames", "4.5,3.25", "--format", "json", "--out", "half"]);
    for frame in ["0004_5", "0003_25"] {
        let [a, b] = ["a", "b"].map(|name| format!("half/{name}.{frame}.json"));
        assert_eq!(bench.done(&["diff", &a, &b]), "the same\n");
    }
}

/// Dough that falls, with hair that follows it.
const HAIR: &str = r#"{
  "convect": 1,
  "scene": { "frames": [1, 24], "fps": 24 },
  "nodes": {
    "lump": { "type": "Mesh_Primitive", "params": { "shape": "sphere", "size": [0.2, 0.1, 0.2], "divisions": 4 } },
    "placed": { "type": "Transform", "inputs": { "geometry": "lump" }, "params": { "translate": [0, 0.1, 0] } },
    "body": { "type": "Tetrahedralize", "inputs": { "surface": "placed" } },
    "fall": { "type": "Softbody", "inputs": { "bodies": ["body"] }, "params": { "stiffness": 3e3, "ground": true } },
    "hair": { "type": "Curve_Scatter", "inputs": { "skin": "placed" }, "params": { "density": 1000, "length": [0.03, 0.05] } },
    "carried": { "type": "Curve_Attach", "inputs": { "curves": "hair", "rest_skin": "placed", "skin": "fall.surface" } }
  },
  "outputs": { "hair": "carried", "dough": "fall.surface" }
}"#;

#[test]
fn parts_behind_a_solver_take_its_frames_from_the_cache_or_step_from_a_checkpoint() {
    let bench = Bench::with_graph(HAIR);
    bench.done(&["cook", "g.json", "--out", "whole"]);
    bench.done(&["job", "g.json", "--engine", "list", "--out", "farm", "--chunk", "8"]);
    let list = fs::read_to_string(bench.path("farm/g.list.txt")).unwrap();
    let lines: Vec<&str> = list.lines().collect();
    assert_eq!(
        lines[..3],
        [
            "convect cook g.json --part 1-24 --output hair --output dough --node fall --out farm/parts/1-24 --cache \
             farm/cache --no-write --report farm/parts/1-24/report.solve-fall.json --quiet",
            "# these find in the cache what step solve-fall cooked; before its end they cook it themselves",
            "convect cook g.json --part 1-8 --output hair --output dough --out farm/parts/1-8 --cache farm/cache \
             --report farm/parts/1-8/report.after-fall.json --quiet",
        ]
    );
    // The solver, three parts and the merge; and the remark.
    assert_eq!(lines.len(), 6, "{list}");
    let steps = |report: &str| bench.read_json(report)["nodes"]["fall"]["cooks"].as_u64().unwrap();
    run(&bench, lines[0]);
    assert_eq!(steps("farm/parts/1-24/report.solve-fall.json"), 24);
    assert!(!bench.path("farm/parts/1-24/dough.usdc").exists());
    // Its frames are there: no step, though each is cheaper to make than what is usually kept.
    run(&bench, lines[4]);
    assert_eq!(steps("farm/parts/17-24/report.after-fall.json"), 0);
    // Only checkpoints are there, of every eighth frame.
    for entry in fs::read_dir(bench.path("farm/cache")).unwrap() {
        for file in fs::read_dir(entry.unwrap().path()).unwrap() {
            let file = file.unwrap().path();
            if file.extension().is_none_or(|kind| kind != "checkpoint") {
                fs::remove_file(file).unwrap();
            }
        }
    }
    run(&bench, lines[3]);
    assert_eq!(steps("farm/parts/9-16/report.after-fall.json"), 8);
    run(&bench, lines[2]);
    run(&bench, lines[5]);
    for name in ["hair", "dough"] {
        let [whole, merged] = [format!("whole/{name}.usdc"), format!("farm/{name}.usda")];
        assert_eq!(bench.done(&["diff", &whole, &merged]), "the same\n", "{name}");
    }
}

#[test]
fn a_job_is_explained_with_the_times_of_a_report() {
    let bench = Bench::with_graph(HAIR);
    let cut = bench.done(&["explain", "g.json", "--job", "--chunk", "8"]);
    let expected = "step solve-fall: fall in 1 task of 24 frames\n\
        step after-fall: hair, dough in 3 tasks of 8 frames, after solve-fall\n\
        for the expected time give --times the report of a cook\n";
    assert_eq!(cut, expected);
    // A second for each step of the solver, half a second for each frame of hair.
    let report = json!({"report": 1, "frames": [1, 2], "total": {"writing_ms": 0.0}, "nodes": {
        "fall": {"cooks": 2, "wall_ms": 2000.0}, "carried": {"cooks": 2, "wall_ms": 1000.0},
        "lump": {"cooks": 1, "wall_ms": 0.0}, "placed": {"cooks": 1, "wall_ms": 0.0},
        "body": {"cooks": 1, "wall_ms": 0.0}, "hair": {"cooks": 1, "wall_ms": 0.0},
    }});
    bench.write("r.json", &report.to_string());
    let args = ["explain", "g.json", "--job", "--chunk", "8", "--times", "r.json", "--machines", "1,3"];
    let text = bench.done(&args);
    let expected = "step solve-fall: fall in 1 task of 24 frames, 26.0 s each at most\n\
        step after-fall: hair, dough in 3 tasks of 8 frames, 6.0 s each at most, after solve-fall\n\
        without a farm 36.0 s\n1 machine 46.0 s, 0.8 times as fast\n3 machines 34.0 s, 1.1 times as fast\n\
        each task is taken to wait, start and copy for 2 s\n";
    assert_eq!(text, expected);
    let json: Value = serde_json::from_str(&bench.done(&[&args[..], &["--json"]].concat())).unwrap();
    assert_eq!(json["steps"][1]["parts"], json!(["1-8", "9-16", "17-24"]));
    assert_eq!(json["machines"][1], json!({"machines": 3, "seconds": 34.0}));
    let ran = bench.run(&["explain", "g.json", "--job", "--machines", "0"]);
    assert_eq!(ran.code, Some(2), "{}", ran.stderr);
}

#[test]
fn a_node_that_is_cooked_into_the_cache_needs_one_and_exists() {
    let bench = Bench::new();
    let ran = bench.run(&["cook", "g.json", "--node", "wind", "--no-write"]);
    assert!(ran.code == Some(2) && ran.stderr.contains("--cache"), "{}", ran.stderr);
    let ran = bench.run(&["cook", "g.json", "--node", "gale", "--no-write", "--cache", "cache"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), "the graph has no node `gale`\n"));
    let ran = bench.run(&["cook", "g.json", "--node", "wind", "--no-write", "--cache", "cache", "--preview"]);
    let expected = "--node cooks no output that could be drawn; leave out the pictures, or --node\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), expected));
}

#[test]
fn a_job_of_some_frames_cooks_these() {
    let bench = Bench::with_graph(HAIR);
    bench.done(&["job", "g.json", "--engine", "openjd", "--chunk", "8", "--frames", "3-12"]);
    let template: Value = serde_json::from_str(&fs::read_to_string(bench.path("out/g.openjd.yaml")).unwrap()).unwrap();
    let range = |step: usize| template["steps"][step]["parameterSpace"]["taskParameterDefinitions"][0]["range"].clone();
    assert_eq!([range(0), range(1)], [json!(["3-12"]), json!(["3-10", "11-12"])]);
    assert_eq!(template["steps"][1]["dependencies"], json!([{"dependsOn": "solve-fall"}]));
    let merge = template["steps"][2]["script"]["actions"]["onRun"]["args"].as_array().unwrap();
    assert!(merge.contains(&json!("3-12")), "{merge:?}");
}

#[test]
fn a_merge_demands_every_frame_once() {
    let bench = Bench::new();
    let part = |part: &str| {
        let folder = format!("farm/parts/{part}");
        bench.done(&["cook", "g.json", "--part", part, "--out", &folder, "--report", &format!("{folder}/report.json")]);
    };
    part("1-2");
    let ran = bench.run(&["merge", "farm", "--frames", "1-4"]);
    let expected = "output `grass` lacks frames 3-4; cook the parts that have them again\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
    part("2-4");
    let ran = bench.run(&["merge", "farm", "--frames", "1-4"]);
    let expected = "output `grass`: frame 2 is in two parts; remove one of them\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
    fs::remove_dir_all(bench.path("farm/parts/2-4")).unwrap();
    bench.done(&[
        "cook",
        "g.json",
        "--frames",
        "3-4",
        "--set",
        "wind.blend=0",
        "--out",
        "farm/parts/3-4",
        "--report",
        "farm/parts/3-4/report.json",
    ]);
    // A report that does not say what its part was cooked by, as older ones.
    let mut report = bench.read_json("farm/parts/3-4/report.json");
    report.as_object_mut().unwrap().remove("recipe").unwrap();
    bench.write("farm/parts/3-4/report.json", &report.to_string());
    let ran = bench.run(&["merge", "farm"]);
    assert_eq!(ran.code, Some(1));
    assert!(
        ran.stderr.contains("do not fit together") && ran.stderr.contains("has samples in only one of them"),
        "{}",
        ran.stderr
    );
    let ran = bench.run(&["merge", "farm", "--output", "fur"]);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(2), "no part has an output `fur`; outputs: `grass`, `still`\n"));
}

/// Notes once a kind and node, with the frames of all parts and the worst value; metrics frame by frame, to the last digit.
#[test]
fn the_report_of_a_merge_is_that_of_the_whole() {
    let bench = Bench::with_graph(
        r#"{"convect": 1, "scene": {"frames": [1, 12]}, "nodes": {
            "blade": {"type": "Curve_In", "params": {"points": [[0, 0, 0], [0, 0.3, 0.1]]}},
            "gusts": {"type": "Curve_Wind_Gusts", "inputs": {"curves": "blade"}, "params": {
                "loop": 8, "base": 0.5, "start_frame_range": [1, 8], "life_range": [9, 9],
                "wind_dir": {"keyframes": [[1, [1, 0, 0]], [12, [0, 0, 1]]]}}},
            "wind": {"type": "Curve_Wind", "inputs": {"curves": "gusts"}, "params": {
                "global_rotate": {"keyframes": [[6, 0], [7, 1]]}}},
            "ground": {"type": "Mesh_Primitive"},
            "kept": {"type": "Curve_Wind_Collision",
                "inputs": {"curves": "wind", "rest": "blade", "colliders": ["ground"]}}},
            "outputs": {"grass": "kept"}}"#,
    );
    bench.done(&["cook", "g.json", "--out", "whole", "--report", "whole.json"]);
    for part in ["1-5", "6-6", "7-12"] {
        let folder = format!("farm/parts/{part}");
        bench.done(&["cook", "g.json", "--part", part, "--out", &folder, "--report", &format!("{folder}/report.json")]);
    }
    bench.done(&["merge", "farm"]);
    let [whole, merged] = ["whole.json", "farm/report.json"].map(|report| bench.read_json(report));
    let kinds: Vec<&Value> = whole["notes"].as_array().unwrap().iter().map(|note| &note["kind"]).collect();
    assert!(kinds.contains(&&json!("unlooped_gusts")) && kinds.contains(&&json!("no_width")), "{kinds:?}");
    let sorted = |report: &Value| {
        let mut notes: Vec<String> = report["notes"].as_array().unwrap().iter().map(Value::to_string).collect();
        notes.sort();
        notes
    };
    assert_eq!(sorted(&whole), sorted(&merged));
    for node in ["gusts", "wind", "kept"] {
        let [a, b] = [&whole, &merged].map(|report| report["nodes"][node]["metrics"].to_string());
        assert_eq!(a, b, "in order, too");
    }
    // Also those that compare a part's first frame with the last one of the part before; the first frame has none.
    let jumps = merged["nodes"]["kept"]["metrics"]["jumps"].as_object().unwrap();
    assert_eq!(jumps.len(), 11);
    assert_eq!((&jumps["6"], &jumps["7"]), (&json!(0.0), &json!(1.0)));
    assert_eq!(merged["tips"], Value::Null);

    bench.write("farm/parts/6-6/report.json.tips", "torn");
    let ran = bench.run(&["merge", "farm"]);
    let expected = "`farm/parts/6-6/report.json.tips` is damaged; cook its part again\n";
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(1), expected));
    // A part whose tips are not known, as older ones.
    let mut report = bench.read_json("farm/parts/6-6/report.json");
    report.as_object_mut().unwrap().remove("tips").unwrap();
    bench.write("farm/parts/6-6/report.json", &report.to_string());
    bench.done(&["merge", "farm"]);
    let merged = bench.read_json("farm/report.json");
    assert_eq!(merged["nodes"]["kept"]["metrics"]["jumps"].as_object().unwrap().len(), 9);
}

#[test]
fn files_of_frames_merge_too() {
    let bench = Bench::new();
    bench.done(&["cook", "g.json", "--format", "json", "--out", "whole"]);
    for part in ["1-2", "3-4"] {
        let folder = format!("farm/parts/{part}");
        let report = format!("{folder}/report.json");
        bench.done(&["cook", "g.json", "--part", part, "--format", "json", "--out", &folder, "--report", &report]);
    }
    bench.done(&["merge", "farm", "--frames", "1-4"]);
    assert_eq!(bench.done(&["diff", "whole/grass.####.json", "farm/grass.####.json"]), "the same\n");
}

#[test]
fn a_template_of_open_job_description_has_steps_parts_and_a_merge() {
    let bench = Bench::with_graph(SCENE);
    bench.done(&["job", "g.json", "--engine", "openjd", "--chunk", "4", "--wedge", "wind.blend=0.5,1"]);
    // It is JSON, which is YAML too.
    let template: Value = serde_json::from_str(&fs::read_to_string(bench.path("out/g.openjd.yaml")).unwrap()).unwrap();
    let names: Vec<&str> =
        template["steps"].as_array().unwrap().iter().map(|step| step["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["solve-fall", "still", "frames", "merge"]);
    let parameters = &template["steps"][2]["parameterSpace"]["taskParameterDefinitions"];
    assert_eq!(parameters[0]["range"], json!(["1-4", "5-8", "9-9"]));
    assert_eq!(parameters[1]["range"], json!(["0.5", "1"]));
    let dependencies: Vec<&str> = template["steps"][3]["dependencies"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["dependsOn"].as_str().unwrap())
        .collect();
    assert_eq!(dependencies, ["solve-fall", "still", "frames"]);
    let args = template["steps"][2]["script"]["actions"]["onRun"]["args"].as_array().unwrap();
    assert!(args.contains(&json!("wind.blend={{Task.Param.Wedge}}")));
    assert!(args.contains(&json!("{{Param.Out}}/wedges/wind.blend={{Task.Param.Wedge}}/parts/{{Task.Param.Part}}")));
    let parameters: Vec<&str> =
        template["parameterDefinitions"].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap()).collect();
    assert_eq!(parameters, ["Graph", "Out", "Cache", "Convect"]);
}

/// The script of Slurm, with a stand-in for `sbatch` that runs each task at once.
#[cfg(unix)]
#[test]
fn the_script_of_slurm_runs_each_task_and_queues_those_worth_a_retry() {
    let bench = Bench::with_graph(SCENE);
    bench.done(&["cook", "g.json", "--out", "whole", "--output", "grass", "--output", "still"]);
    bench.done(&["job", "g.json", "--engine", "slurm", "--out", "farm", "--chunk", "5"]);
    bench.write(
        "bin/sbatch",
        "#!/bin/bash\nwhile [[ $1 == --* ]]; do case $1 in --array=*) last=${1#--array=0-}; last=${last%%%*} ;; esac; shift; done\n\
         for index in $(seq 0 \"$last\"); do SLURM_JOB_ID=7 SLURM_ARRAY_JOB_ID=7 SLURM_ARRAY_TASK_ID=$index bash \"$@\" >&2; \
         echo \"$3 $index ended with $?\" >> log; done\necho 7\n",
    );
    bench.write("bin/scontrol", "#!/bin/bash\necho \"scontrol $*\" >> log\n");
    let script = |convect: &str| {
        let path = format!("{}:{}", bench.path("bin").display(), std::env::var("PATH").unwrap());
        let chmod =
            Command::new("chmod").args(["+x", "bin/sbatch", "bin/scontrol"]).current_dir(bench.path("")).status();
        assert!(chmod.unwrap().success());
        let _ = fs::remove_file(bench.path("log"));
        let done = Command::new("bash")
            .args(["farm/g.slurm.sh"])
            .current_dir(bench.path(""))
            .env("PATH", path)
            .env("CONVECT", convect)
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        fs::read_to_string(bench.path("log")).unwrap()
    };
    let log = script(env!("CARGO_BIN_EXE_convect"));
    let expected = "solve-fall 0 ended with 0\nstill 0 ended with 0\nframes 0 ended with 0\nframes 1 ended with 0\n\
        merge 0 ended with 0\n";
    assert_eq!(log, expected);
    for name in ["grass", "still"] {
        let [whole, merged] = [format!("whole/{name}.usdc"), format!("farm/{name}.usda")];
        assert_eq!(bench.done(&["diff", &whole, &merged]), "the same\n");
    }
    // 3 is final, 1 is not.
    bench.write("fails", "#!/bin/bash\n[ \"$1\" = merge ] && exit 3\nexit 1\n");
    let chmod = Command::new("chmod").args(["+x", "fails"]).current_dir(bench.path("")).status();
    assert!(chmod.unwrap().success());
    let log = script("./fails");
    assert!(log.contains("scontrol requeue 7_1\nframes 1 ended with 1\nmerge 0 ended with 3\n"), "{log}");
}

#[test]
fn outputs_in_one_stage_are_cooked_in_parts_and_merged() {
    let several = r#""outputs": { "set": ["wind", "blades", { "from": "fall.surface", "attributes": ["P"], "v": true }], "dough": "fall" }"#;
    let bench = Bench::with_graph(
        &SCENE.replace(r#""outputs": { "grass": "wind", "still": "blades", "dough": "fall" }"#, several),
    );
    let ran = bench.run(&["cook", "g.json", "--out", "whole", "--report", "report.json"]);
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(ran.stderr.contains("wrote whole/set.usdc: 9 frames, "), "{}", ran.stderr);
    let output = &bench.read_json("report.json")["outputs"]["set"];
    assert_eq!(output["from"], json!(["wind", "blades", "fall"]));
    assert_eq!((&output["frames"], &output["files"]), (&json!(9), &json!(["whole/set.usdc"])));

    // The set needs the solver, so its parts come behind it; each part has all of its prims.
    bench.done(&["job", "g.json", "--engine", "list", "--out", "farm", "--chunk", "4"]);
    let list = fs::read_to_string(bench.path("farm/g.list.txt")).unwrap();
    let lines: Vec<&str> = list.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(lines.len(), 5, "{list}");
    assert!(lines[1].contains("--part 1-4 --output set --output dough --out farm/parts/1-4"), "{list}");
    lines.iter().for_each(|line| run(&bench, line));
    let same = |a: &str, b: &str| assert_eq!(bench.done(&["diff", a, b]), "the same\n", "{a} and {b}");
    same("whole/set.usdc", "farm/set.usda");
    bench.done(&["merge", "farm", "--one-file"]);
    same("whole/set.usdc", "farm/set.usdc");

    // Each output is a prim, with what it has alone.
    let stats = bench.json(&["stats", "farm/set.usdc", "--prim", "/set/fall_surface", "--frame", "9", "--json"]);
    assert_eq!((&stats["mesh"]["faces"], &stats["curves"]), (&json!(6), &Value::Null));
    let stats = bench.json(&["stats", "farm/set.usda", "--prim", "/set/wind", "--json"]);
    assert_eq!((&stats["curves"]["curves"], &stats["frames"]), (&json!(60), &json!(9)));
    let all = bench.json(&["stats", "whole/set.usdc", "--json"]);
    assert_eq!((&all["curves"]["curves"], &all["mesh"]["faces"]), (&json!(120), &json!(6)));
    for from in ["whole/set.usdc", "farm/set.usda"] {
        bench.done(&["convert", from, "set.usda"]);
        same("set.usda", "whole/set.usdc");
        let text = fs::read_to_string(bench.path("set.usda")).unwrap();
        assert_eq!(text.matches("    def Xform \"").count(), 3, "the prims stay apart");
        assert!(text.contains("displayName = \"fall.surface\""), "{from}");
    }
}

#[test]
fn parts_of_other_graphs_or_settings_are_not_merged() {
    let bench = Bench::with_graph(SCENE);
    let part = |frames: &str, set: &[&str]| {
        let (folder, report) = (format!("farm/parts/{frames}"), format!("farm/parts/{frames}/report.json"));
        let words = ["cook", "g.json", "--part", frames, "--output", "grass", "--out", &folder, "--report", &report];
        bench.done(&[&words, set].concat());
    };
    let merged = || {
        let ran = bench.run(&["merge", "farm"]);
        (ran.code, ran.stderr)
    };
    let parts = "`farm/parts/1-4/report.json` and `farm/parts/5-9/report.json` were cooked with";
    part("1-4", &["--set", "wind.waviness=0.5"]);
    part("5-9", &[]);
    let settings = "different settings, `--set wind.waviness=0.5` and no `--set wind.waviness`; cook the parts again, all with the same\n";
    assert_eq!(merged(), (Some(1), format!("{parts} {settings}")));
    part("5-9", &["--set", "wind.waviness=0.5"]);
    assert_eq!(merged().0, Some(0));
    let recipe = &bench.read_json("farm/report.json")["recipe"];
    assert_eq!(recipe["set"], json!({"wind.waviness": "0.5"}));
    bench.write("g.json", &SCENE.replace("\"noise\": \"none\"", "\"noise\": \"perlin\""));
    part("5-9", &["--set", "wind.waviness=0.5"]);
    let graphs = "different graphs, or one that was changed in between; cook the parts again, all with the same\n";
    assert_eq!(merged(), (Some(1), format!("{parts} {graphs}")));
}
