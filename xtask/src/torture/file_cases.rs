//! Cases of files: damaged ones, odd ones, folders, and files in the way of others.

use super::bytes;
use super::case::{Call, Case, FORMATS, cook};
use super::dice::Dice;
use super::graph_cases::{example, frames};
use super::stock::Stock;
use super::values::text_of;

/// A damaged geometry file, given to every command that reads one.
pub(crate) fn damaged_geometry(stock: &Stock, dice: &mut Dice) -> Case {
    let small: Vec<&(String, Vec<u8>)> = stock.files.iter().filter(|(_, bytes)| bytes.len() < 200_000).collect();
    let (name, original) = small[dice.below(small.len())];
    let ending = name.rsplit('.').next().unwrap_or_default();
    let mut changed = original.clone();
    bytes::mutate(&mut changed, dice);
    let file = format!("damaged.{ending}");
    let reader = dice.of(&["Curve_In", "Mesh_In", "Point_In", "Tet_In"]);
    let (user, input) = match reader {
        "Curve_In" => dice.of(&[&("Curve_Wind", "curves"), &("Curve_Jiggle", "curves"), &("Transform", "geometry")]),
        "Mesh_In" => dice.of(&[&("Tetrahedralize", "surface"), &("Curve_Scatter", "skin"), &("Transform", "geometry")]),
        "Tet_In" => &("Softbody", "bodies"),
        _ => &("Merge", "geometry"),
    };
    let wire = if matches!(*user, "Softbody" | "Merge") { "[\"a\", \"a\"]" } else { "\"a\"" };
    let graph = format!(
        r#"{{"convect": 1, "nodes": {{"a": {{"type": "{reader}", "params": {{"file": "{file}"}}}},
        "b": {{"type": "{user}", "inputs": {{"{input}": {wire}}}}}}}, "outputs": {{"o": "b"}}}}"#
    );
    let mut case = Case::new("damaged", &graph, stock);
    case.files.push((file.clone(), changed));
    case.files.push((format!("original.{ending}"), original.clone()));
    let to = format!("converted.{}", dice.of(&FORMATS));
    case.call(Call::new(&["stats", &file]).and(if dice.one_in(2) { &["--json"] } else { &[] }))
        .call(Call::new(&["diff", &file, &format!("original.{ending}")]))
        .call(Call::new(&["convert", &file, &to]))
        .call(cook(dice.of(&FORMATS), "out"))
}

/// A graph whose cook writes several files, two of which, or one and an input, are one file.
pub(crate) fn colliding_targets(stock: &Stock, dice: &mut Dice) -> Case {
    let graph = example(stock, dice);
    let mut case = Case::new("targets", &text_of(&graph), stock);
    let read = graph["nodes"].as_object().into_iter().flat_map(|nodes| nodes.values());
    let mut read: Vec<String> = read.filter_map(|node| node["params"]["file"].as_str().map(str::to_owned)).collect();
    read.push("g.json".into());
    let input = read[dice.below(read.len())].clone();
    case.files.push(("in/grass.0001.obj".into(), b"v 0 0 0\nv 0 1 0\nl 1 2\n".to_vec()));
    case.links.push(("link", input.clone()));
    case.links.push(("folder", "in".into()));
    case.links.push(("again.obj", "in/grass.0001.obj".into()));
    case.links.push(("dangling", "out/none.json".into()));
    let target = dice
        .of(&["link", &input, &format!("./in/../{input}"), "folder/../link", "dangling", "/dev/full", "out", "."])
        .to_owned();
    let call = match dice.below(8) {
        0..3 => cook(dice.of(&FORMATS), "out").and(&["--report", &target]),
        3 => Call::new(&[
            "convert",
            "in/grass.0001.obj",
            dice.of(&["again.obj", "folder/grass.0001.obj", "in/../again.obj"]),
        ]),
        4 => Call::new(&["convert", "in/grass.####.obj", dice.of(&["folder/grass.####.obj", "folder/grass.0001.obj"])]),
        5 => Call::new(&["convert", "in", dice.of(&["in/grass.####.obj", "link", "folder/one.obj"])]),
        6 => return own_output(case),
        _ => cook("usda", dice.of(&["in", "folder", "g.json", "link", "dangling"])).and(&[
            "--preview",
            "--preview-size",
            "16x16",
        ]),
    };
    case.call(call)
}

/// A graph that reads what its own cook would write.
fn own_output(mut case: Case) -> Case {
    let graph = r#"{"convect": 1, "scene": {"frames": [1, 2]},
        "nodes": {"a": {"type": "Curve_In", "params": {"file": "in/grass.####.obj"}}}, "outputs": {"grass": "a", "GRASS": "a"}}"#;
    case.files[0].1 = graph.as_bytes().to_vec();
    case.files.push(("in/grass.0002.obj".into(), b"v 0 0 0\nv 0 2 0\nl 1 2\n".to_vec()));
    case.call(cook("obj", "folder")).call(cook("obj", "in").and(&["--frames", "2", "--output", "grass"]))
}

/// Inputs that are links, pipes, devices and folders, given to every command that reads a file.
pub(crate) fn odd_inputs(stock: &Stock, dice: &mut Dice) -> Case {
    let input = dice.of(&[
        "pipe.obj",
        "link.obj",
        "round.obj",
        "zero.obj",
        "null.obj",
        "in",
        "dangling.obj",
        "folder/hand.obj",
        "/dev/stdin",
        "/dev/fd/0",
        "pipe.####.obj",
        "/proc/self/mem",
        "-",
    ]);
    let reader = dice.of(&["Mesh_In", "Curve_In", "Point_In", "Tet_In"]);
    let graph = format!(
        r#"{{"convect": 1, "nodes": {{"a": {{"type": "{reader}", "params": {{"file": "{input}"}}}}}}, "outputs": {{"o": "a"}}}}"#
    );
    let mut case = Case::new("odd inputs", &graph, stock);
    case.files.extend(
        stock
            .files
            .iter()
            .filter(|(name, _)| name == "hand.obj")
            .map(|(name, bytes)| (format!("in/{name}"), bytes.clone())),
    );
    case.pipes = vec!["pipe.obj", "pipe.0001.obj", "pipe.json"];
    for (link, target) in [
        ("link.obj", "in/hand.obj"),
        ("round.obj", "round.obj"),
        ("zero.obj", "/dev/zero"),
        ("null.obj", "/dev/null"),
        ("dangling.obj", "none.obj"),
        ("folder", "in"),
        ("g_link.json", "folder/../g.json"),
    ] {
        case.links.push((link, target.into()));
    }
    let graph = dice.of(&["g.json", "g.json", "g_link.json", "pipe.json", "in", "/dev/null", "/dev/stdin"]);
    let mut call = match dice.below(6) {
        0..3 => Call::new(&["cook", graph, "--format", dice.of(&FORMATS)]),
        3 => Call::new(&[dice.of(&["check", "explain"]), graph]),
        4 => Call::new(&[dice.of(&["stats", "diff"]), input, "in/hand.obj"]),
        _ => Call::new(&["convert", input, dice.of(&["new.obj", "new/x.usda", "in/x.json"])]),
    };
    if call.args[0] == "stats" {
        call.args.pop();
    }
    call.stdin = Some(dice.of(&["g.json", "in/hand.obj"]));
    if dice.one_in(4) {
        call = call.and(&["--cache", dice.of(&["pipe.json", "link.obj", "folder", "/dev/null", "g.json"])]);
        call.args.truncate(if call.args[0] == "cook" { call.args.len() } else { call.args.len() - 2 });
    }
    case.call(call)
}

/// A cook of numbered files, whose folder is converted, measured and compared.
pub(crate) fn folders(stock: &Stock, dice: &mut Dice) -> Case {
    let graph = example(stock, dice);
    let format = dice.of(&["json", "json", "obj", "ply"]);
    let from = dice.of(&["out", "out/", "in", ".", "out/none"]);
    let to =
        dice.of(&["new/x.####.json", "new/x.usdc", "new/x.usda", "out/y.####.ply", "x.obj", "out", "new/####.obj"]);
    let mut convert = Call::new(&["convert", from, to]);
    if dice.one_in(3) {
        convert = convert.and(&["--scale", dice.of(&["0.01", "1e30", "1e-40", "0"])]);
    }
    if dice.one_in(3) {
        convert = convert.and(&["--fps", dice.of(&["24", "1e9", "0.001"])]);
    }
    Case::new("folders", &text_of(&graph), stock)
        .call(cook(format, "out").and(&["--frames", frames(dice)]))
        .call(convert)
        .call(Call::new(&["diff", from, dice.of(&["out", "new", "new/x.0001.json"])]))
        .call(Call::new(&["stats", dice.of(&["out", "new/x.0001.json", "new/x.usda"]), "--json"]))
}

/// A disk without room, or what stands in the way of a file.
pub(crate) fn no_room(stock: &Stock, dice: &mut Dice) -> Case {
    let graph = example(stock, dice);
    let mut case = Case::new("no room", &text_of(&graph), stock);
    let out = dice.of(&["out", "out", "g.json", "g.json/x", "\u{1f43b}/deep/er"]);
    let mut call = cook(dice.of(&FORMATS), out).and(&["--report", "report.json", "--cache", "cache"]);
    if dice.one_in(2) {
        call = call.and(&["--preview", "--preview-size", "64x48"]);
    }
    call.blocks = (!dice.one_in(4)).then(|| dice.below(60) as u64);
    let mut look = Call::new(&[dice.of(&["check", "explain", "--help", "nodes", "schema"])]);
    if matches!(&look.args[0][..], "check" | "explain") {
        look = look.and(&["g.json", "--json"]);
    }
    look.full_stdout = true;
    case.files.push(("cache/mine.checkpoint".into(), b"mine".to_vec()));
    case.call(call).call(look)
}
