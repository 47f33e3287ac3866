//! Cases: a folder's files, and the commands that are run there one after the other.

use serde_json::Value;

use super::bytes;
use super::dice::Dice;
use super::graphs;
use super::stock::Stock;
use super::values::text_of;

/// One case, made from a seed.
pub(crate) struct Case {
    pub(crate) kind: &'static str,
    /// Files by their path in the folder; every one must keep its bytes.
    pub(crate) files: Vec<(String, Vec<u8>)>,
    /// Symbolic links: path and target.
    pub(crate) links: Vec<(&'static str, String)>,
    pub(crate) steps: Vec<Step>,
}

/// What is done in the folder.
pub(crate) enum Step {
    Call(Call),
    /// Some files below a folder are damaged.
    Damage(&'static str, u64),
    /// Two folders must have the same files if all calls before succeeded.
    Same(&'static str, &'static str),
}

/// One run of the program.
#[derive(Clone, Default)]
pub(crate) struct Call {
    pub(crate) args: Vec<String>,
    /// Whether stdout is `/dev/full`.
    pub(crate) full_stdout: bool,
    /// The largest file it may write, in blocks of 512 bytes.
    pub(crate) blocks: Option<u64>,
    /// A signal, and after how many milliseconds it is sent.
    pub(crate) signal: Option<(&'static str, u64)>,
    /// Whether the command is in order, so that only code 0 is right.
    pub(crate) succeeds: bool,
}

impl Call {
    fn new(args: &[&str]) -> Self {
        Self { args: args.iter().map(|arg| (*arg).to_owned()).collect(), ..Self::default() }
    }

    fn and(mut self, args: &[&str]) -> Self {
        self.args.extend(args.iter().map(|arg| (*arg).to_owned()));
        self
    }
}

const FORMATS: [&str; 5] = ["usdc", "usda", "obj", "ply", "json"];

impl Case {
    /// The case of `seed`.
    pub(crate) fn of(seed: u64, stock: &Stock) -> Self {
        let mut dice = Dice::new(seed);
        let dice = &mut dice;
        match dice.below(20) {
            0..8 => mutated_graph(stock, dice),
            8..10 => setting(stock, dice),
            10..12 => look(stock, dice),
            12..15 => geometry(stock, dice),
            15 => colliding_targets(stock, dice),
            16 => command_line(stock, dice),
            17 => no_room(stock, dice),
            _ => killed(stock, dice),
        }
    }

    fn new(kind: &'static str, graph: &str, stock: &Stock) -> Self {
        let mut files = vec![("g.json".to_owned(), graph.as_bytes().to_vec())];
        for (name, bytes) in &stock.files {
            // Every case has the small ones, so that mutated names find something.
            if bytes.len() < 2000 || graph.contains(name.as_str()) {
                files.push((format!("in/{name}"), bytes.clone()));
            }
        }
        Self { kind, files, links: Vec::new(), steps: Vec::new() }
    }

    fn call(mut self, call: Call) -> Self {
        self.steps.push(Step::Call(call));
        self
    }
}

fn example(stock: &Stock, dice: &mut Dice) -> Value {
    stock.graphs[dice.below(stock.graphs.len())].clone()
}

/// The text of an example graph that was changed.
fn changed_text(stock: &Stock, dice: &mut Dice) -> String {
    let mut graph = example(stock, dice);
    graphs::mutate(&mut graph, stock, dice);
    let text = text_of(&graph);
    if !dice.one_in(8) {
        return text;
    }
    let mut bytes = text.into_bytes();
    bytes::mutate(&mut bytes, dice);
    String::from_utf8_lossy(&bytes).into_owned()
}

fn cook(format: &str, out: &str) -> Call {
    Call::new(&["cook", "g.json", "--out", out, "--format", format])
}

/// Frames that are odd now and then.
fn frames(dice: &mut Dice) -> &'static str {
    if !dice.one_in(4) {
        return dice.of(&["1", "1-2", "2"]);
    }
    dice.of(&[
        "-3",
        "0",
        "0.5",
        "1-2x0.25",
        "-1000000000",
        "1000000000",
        "2,1,1.5",
        "-2-1",
        "1-10000000x9999999",
        "2-1",
        "1-2x0",
        "",
        "99999999999999999999",
        "1-",
        "x",
        "1e3",
        "0.0000001",
        "4294967296",
        "-9223372036854775808",
        "1-30",
        "1,,2",
        "nan",
    ])
}

fn mutated_graph(stock: &Stock, dice: &mut Dice) -> Case {
    let case = Case::new("graph", &changed_text(stock, dice), stock);
    let format = dice.of(&FORMATS);
    let mut first = cook(format, "out");
    if dice.one_in(2) {
        first = first.and(&["--frames", frames(dice)]);
    }
    for (one_in, options) in [
        (6, &["--report", "report.json"][..]),
        (10, &["--cache", "cache"]),
        (10, &["--preview", "--preview-size", "32x24"]),
        (20, &["--movie", "--preview-size", "32x24"]),
        (20, &["--memory", "1M"]),
        (20, &["--strict"]),
        (30, &["--preview", "--preview-size", "40x30", "--clip", "x=0", "--color-by", "P.y"]),
    ] {
        // The options of pictures are given once.
        if dice.one_in(one_in) && !options.iter().any(|option| first.args.iter().any(|arg| arg == option)) {
            first = first.and(options);
        }
    }
    if !dice.one_in(4) {
        return case.call(first);
    }
    let mut again = first.clone();
    again.args[3] = "again".into();
    let again = again.and(&["--threads", dice.of(&["1", "3"])]);
    let mut case = case.call(first).call(again);
    case.steps.push(Step::Same("out", "again"));
    case
}

fn setting(stock: &Stock, dice: &mut Dice) -> Case {
    let graph = example(stock, dice);
    let format = dice.of(&FORMATS);
    let mut call = Call::new(&[dice.of(&["cook", "cook", "cook", "check", "explain"]), "g.json"]);
    if call.args[0] == "cook" {
        call = call.and(&["--format", format]);
    }
    for _ in 0..1 + dice.below(2) {
        call = call.and(&["--set", &graphs::setting(&graph, stock, dice)]);
    }
    Case::new("set", &text_of(&graph), stock).call(call)
}

fn look(stock: &Stock, dice: &mut Dice) -> Case {
    let case = Case::new("look", &changed_text(stock, dice), stock);
    let json: &[&str] = if dice.one_in(2) { &["--json"] } else { &[] };
    let explain = Call::new(&["explain", "g.json"]).and(json);
    let explain = if dice.one_in(2) { explain.and(&["--frames", frames(dice)]) } else { explain };
    case.call(Call::new(&["check", "g.json"]).and(json)).call(explain)
}

/// A damaged geometry file, given to every command that reads one.
fn geometry(stock: &Stock, dice: &mut Dice) -> Case {
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
    let mut case = Case::new("geometry", &graph, stock);
    case.files.push((file.clone(), changed));
    case.files.push((format!("original.{ending}"), original.clone()));
    let to = format!("converted.{}", dice.of(&FORMATS));
    case.call(Call::new(&["stats", &file]).and(if dice.one_in(2) { &["--json"] } else { &[] }))
        .call(Call::new(&["diff", &file, &format!("original.{ending}")]))
        .call(Call::new(&["convert", &file, &to]))
        .call(cook(dice.of(&FORMATS), "out"))
}

/// A graph whose cook writes several files, two of which, or one and an input, are one file.
fn colliding_targets(stock: &Stock, dice: &mut Dice) -> Case {
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
    let call = match dice.below(6) {
        0..3 => cook(dice.of(&FORMATS), "out").and(&["--report", &target]),
        3 => Call::new(&[
            "convert",
            "in/grass.0001.obj",
            dice.of(&["again.obj", "folder/grass.0001.obj", "in/../again.obj"]),
        ]),
        4 => Call::new(&["convert", "in/grass.####.obj", dice.of(&["folder/grass.####.obj", "folder/grass.0001.obj"])]),
        _ => cook("usda", dice.of(&["in", "folder", "g.json", "link", "dangling"])).and(&[
            "--preview",
            "--preview-size",
            "16x16",
        ]),
    };
    case.call(call)
}

/// Words in an order that nobody planned.
fn command_line(stock: &Stock, dice: &mut Dice) -> Case {
    const WORDS: [&str; 60] = [
        "g.json",
        "in/hand.obj",
        "none.json",
        "out",
        "--frames",
        "1",
        "1-2",
        "--out",
        "--format",
        "json",
        "usdc",
        "obj",
        "--set",
        "x=1",
        "--threads",
        "0",
        "1",
        "70000",
        "--memory",
        "1k",
        "0",
        "-1",
        "--cache",
        "cache",
        "--cache-limit",
        "--report",
        "/dev/full",
        "/dev/null",
        "/dev/stdout",
        "-v",
        "-q",
        "--strict",
        "--preview",
        "--movie",
        "--preview-frames",
        "--preview-split",
        "--preview-size",
        "1x1",
        "16x9",
        "100000x100000",
        "--camera",
        "eye=0,0,0 target=0,0,0",
        "eye=1,2,3 fov=179.9",
        "--color-by",
        "P.y",
        "Cd",
        "--clip",
        "x=0",
        "y=nan",
        "z=1e30",
        "--json",
        "--tolerance",
        "1e30",
        "--scale",
        "1e-30",
        "--fps",
        "--help",
        "--",
        "-",
        "\u{fffd}",
    ];
    let graph = example(stock, dice);
    let verb =
        dice.of(&["cook", "cook", "check", "explain", "nodes", "stats", "diff", "convert", "schema", "completions"]);
    let mut call = Call::new(&[verb, "g.json"]);
    for _ in 0..dice.below(7) {
        call = call.and(&[WORDS[dice.below(WORDS.len())]]);
    }
    Case::new("command line", &text_of(&graph), stock).call(call)
}

/// A disk without room, or what stands in the way of a file.
fn no_room(stock: &Stock, dice: &mut Dice) -> Case {
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

/// A cook with a cache that is stopped, its cache perhaps damaged, and cooked again: the files are those of a cook that
/// nobody stopped.
fn killed(stock: &Stock, dice: &mut Dice) -> Case {
    let mut graph = example(stock, dice);
    let first = graph["scene"]["frames"][0].as_i64().unwrap_or(1);
    if graph["scene"].is_object() {
        graph["scene"]["frames"] = serde_json::json!([first, first + 15]);
    }
    let mut case = Case::new("killed", &text_of(&graph), stock);
    for name in ["mine.checkpoint", "version", "mine.frame", "mine.part"] {
        case.files.push((format!("cache/{name}"), b"mine".to_vec()));
    }
    // Some graphs have outputs that obj and ply cannot hold.
    let format = dice.of(&["usdc", "usda", "json"]);
    let with_cache = cook(format, "out").and(&["--cache", "cache", "--report", "report.json"]);
    let mut stopped = with_cache.clone();
    stopped.signal = Some((dice.of(&["TERM", "INT", "KILL", "KILL"]), dice.below(600) as u64));
    let mut whole = with_cache;
    whole.succeeds = true;
    let mut without = cook(format, "clean");
    without.succeeds = true;
    case = case.call(stopped);
    if dice.one_in(2) {
        case.steps.push(Step::Damage("cache", dice.bits()));
    }
    case = case.call(whole).call(without);
    case.steps.push(Step::Same("out", "clean"));
    case
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::torture::stock::{NodeType, Param};
    use serde_json::json;

    fn stock() -> Stock {
        let param = Param { name: "file".into(), default: json!(""), legal: Vec::new() };
        let types = vec![NodeType { name: "Mesh_In".into(), inputs: Vec::new(), params: vec![param] }];
        let graph = json!({"convect": 1, "scene": {"frames": [3, 4]}, "nodes": {"a": {"type": "Mesh_In", "params": {"file": "in/large.obj"}}},
            "outputs": {"o": "a"}});
        let files = vec![("a.obj".into(), b"v 0 0 0\n".to_vec()), ("large.obj".into(), b"v 0 0 0\n".repeat(1000))];
        Stock { graphs: vec![graph], files, types }
    }

    #[test]
    fn every_kind_appears_and_every_case_calls_the_program() {
        let kinds: std::collections::BTreeSet<&str> = (0..300)
            .map(|seed| {
                let case = Case::of(seed, &stock());
                assert!(case.steps.iter().any(|step| matches!(step, Step::Call(_))), "{seed}");
                case.kind
            })
            .collect();
        assert_eq!(kinds.len(), 8, "{kinds:?}");
    }

    #[test]
    fn a_case_has_the_files_that_its_graph_names() {
        let case = Case::new("graph", &text_of(&stock().graphs[0]), &stock());
        assert_eq!(
            case.files.iter().map(|(path, _)| &path[..]).collect::<Vec<_>>(),
            ["g.json", "in/a.obj", "in/large.obj"]
        );
        assert_eq!(Case::new("graph", "{}", &stock()).files.len(), 2);
    }
}
