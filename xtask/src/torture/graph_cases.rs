//! Cases of graphs: mutated examples, generated graphs, settings and command lines.

use serde_json::Value;

use super::bytes;
use super::case::{Call, Case, FORMATS, Step, cook};
use super::dice::Dice;
use super::stock::Stock;
use super::values::text_of;
use super::{generate, graphs};

/// One of the example graphs.
pub(crate) fn example(stock: &Stock, dice: &mut Dice) -> Value {
    stock.graphs[dice.below(stock.graphs.len())].clone()
}

/// The text of an example graph that was changed.
fn changed_text(stock: &Stock, dice: &mut Dice) -> String {
    let mut graph = example(stock, dice);
    graphs::mutate(&mut graph, stock, dice);
    let text = text_of(&graph);
    if !dice.one_in(20) {
        return text;
    }
    let mut bytes = text.into_bytes();
    bytes::mutate(&mut bytes, dice);
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Frames that are odd now and then.
pub(crate) fn frames(dice: &mut Dice) -> &'static str {
    if !dice.one_in(8) {
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

/// An example graph that was changed, cooked.
pub(crate) fn mutated(stock: &Stock, dice: &mut Dice) -> Case {
    cooked(Case::new("mutated", &changed_text(stock, dice), stock), dice)
}

/// A generated graph, cooked.
pub(crate) fn generated(stock: &Stock, dice: &mut Dice) -> Case {
    cooked(Case::new("generated", &text_of(&generate::graph(stock, dice)), stock), dice)
}

/// Cooks the graph of `case` with any options, and one time in two again with another number of threads: with the cache
/// of the first cook if that had one, and with the same bits.
fn cooked(case: Case, dice: &mut Dice) -> Case {
    let format = if dice.one_in(3) { dice.of(&FORMATS) } else { dice.of(&["usdc", "usda", "json"]) };
    let first = with_options(cook(format, "out"), dice);
    if dice.one_in(2) {
        return case.call(first);
    }
    let mut again = first.clone().and(&["--threads", dice.of(&["1", "3"])]);
    again.args.iter_mut().filter(|arg| *arg == "out").for_each(|out| *out = "again".into());
    let mut case = case.call(first).call(again);
    case.steps.push(Step::Same("out", "again"));
    case
}

/// `call` with options of `cook`.
fn with_options(call: Call, dice: &mut Dice) -> Call {
    const OPTIONS: [(usize, &[&str]); 11] = [
        (6, &["--report", "report.json"]),
        (8, &["--cache", "cache"]),
        (10, &["--preview"]),
        (20, &["--movie"]),
        (20, &["--strict"]),
        (15, &["--no-write"]),
        (30, &["--preview-split", "--preview"]),
        (20, &["--clip", "x=0", "--movie"]),
        (15, &["--color-by", "P.y", "--preview"]),
        (30, &["--memory", "64M"]),
        (30, &["--cache", "cache", "--cache-limit", "10k"]),
    ];
    let mut call = match dice.below(6) {
        0 => call.and(&["--part", dice.of(&["1-1", "1-2", "2-2", "0-1", "-1-3"])]),
        1 => call.and(&["--frames", frames(dice)]),
        _ => call,
    };
    for (one_in, options) in OPTIONS {
        let is_there = |option: &&&str| option.starts_with("--") && call.args.iter().any(|arg| arg == **option);
        // An option is given once.
        if dice.one_in(one_in) && options.iter().find(is_there).is_none() {
            call = call.and(options);
        }
    }
    if call.args.iter().any(|arg| arg == "--preview" || arg == "--movie") {
        call = call.and(&["--preview-size", "32x24"]);
    }
    if dice.one_in(10) {
        call.args[1] = "-".into();
        call.stdin = Some("g.json");
    }
    if dice.one_in(15) && !call.args.iter().any(|arg| arg == "--report") {
        call = call.and(&["--report", "-"]);
    }
    call
}

/// An example with params and controls set on the command line.
pub(crate) fn settings(stock: &Stock, dice: &mut Dice) -> Case {
    let graph = if dice.one_in(2) { example(stock, dice) } else { generate::graph(stock, dice) };
    let format = dice.of(&FORMATS);
    let mut call = Call::new(&[dice.of(&["cook", "cook", "cook", "check", "explain"]), "g.json"]);
    if call.args[0] == "cook" {
        call = call.and(&["--format", format]);
    }
    for _ in 0..1 + dice.below(2) {
        call = call.and(&["--set", &graphs::setting(&graph, stock, dice)]);
    }
    Case::new("settings", &text_of(&graph), stock).call(call)
}

/// A changed graph, checked and explained.
pub(crate) fn looked_at(stock: &Stock, dice: &mut Dice) -> Case {
    let case = Case::new("looked at", &changed_text(stock, dice), stock);
    let json: &[&str] = if dice.one_in(2) { &["--json"] } else { &[] };
    let explain = Call::new(&["explain", "g.json"]).and(json);
    let explain = if dice.one_in(2) { explain.and(&["--frames", frames(dice)]) } else { explain };
    let mut check = Call::new(&["check", "g.json"]).and(json);
    if dice.one_in(4) {
        check.args[1] = "-".into();
        check.stdin = Some("g.json");
    }
    case.call(check).call(explain)
}

/// Words in an order that nobody planned.
pub(crate) fn command_line(stock: &Stock, dice: &mut Dice) -> Case {
    const WORDS: [&str; 66] = [
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
        "/dev/fd/1",
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
        "--part",
        "1-1",
        "2-1",
        "--no-write",
        "--completions",
        "in",
        "\u{fffd}",
    ];
    let graph = example(stock, dice);
    let verb = dice.of(&[
        "cook",
        "cook",
        "cook",
        "check",
        "explain",
        "nodes",
        "stats",
        "diff",
        "convert",
        "schema",
        "functions",
    ]);
    let mut call = Call::new(&[verb, "g.json"]);
    for _ in 0..dice.below(7) {
        call = call.and(&[WORDS[dice.below(WORDS.len())]]);
    }
    Case::new("command line", &text_of(&graph), stock).call(call)
}
