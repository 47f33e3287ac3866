//! Cooks that are stopped and resumed.

use super::case::{Case, Step, cook};
use super::dice::Dice;
use super::graph_cases::example;
use super::stock::Stock;
use super::values::text_of;

/// Cooks with a cache that are stopped, perhaps beside another cook with the same cache; then, the cache perhaps damaged,
/// one that is not stopped: its files are those of a cook without a cache.
pub(crate) fn killed(stock: &Stock, dice: &mut Dice) -> Case {
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
    for _ in 0..1 + dice.below(3) {
        let mut stopped = with_cache.clone();
        stopped.signal = Some((dice.of(&["TERM", "INT", "KILL", "KILL"]), dice.below(600) as u64));
        case = case.call(stopped);
    }
    let mut clean = cook(format, "clean");
    clean.succeeds = true;
    case = case.call(clean);
    if dice.one_in(2) {
        let mut beside = cook(format, "beside").and(&["--cache", "cache", "--threads", "1"]);
        beside.succeeds = true;
        let mut stopped = with_cache.clone();
        stopped.signal = Some((dice.of(&["TERM", "KILL"]), dice.below(300) as u64));
        case.steps.push(Step::Calls(vec![stopped, beside]));
        case.steps.push(Step::Same("beside", "clean"));
    }
    if dice.one_in(2) {
        case.steps.push(Step::Damage("cache", dice.bits()));
    }
    let mut whole = with_cache;
    whole.succeeds = true;
    case = case.call(whole);
    case.steps.push(Step::Same("out", "clean"));
    case
}
