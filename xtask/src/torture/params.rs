//! Values of params that their declarations allow: most are legal, some are ends of a range, few lie just beyond.

use serde_json::{Value, json};

use super::dice::Dice;
use super::stock::Param;
use super::values::program;

/// Controls of generated graphs: a vector and a number.
pub(crate) const CONTROLS: [&str; 2] = ["wind_dir", "strength"];

/// Largest values of params that decide how much work a graph is.
const MOST: [(&str, f64); 5] =
    [("density", 400.0), ("divisions", 6.0), ("cvs", 12.0), ("num_gusts", 40.0), ("preroll", 48.0)];

/// A value for `param`, in any form that it takes; null where only geometry would fit.
pub(crate) fn any_form(param: &Param, dice: &mut Dice) -> Value {
    let value = plain(param, dice);
    if value.is_null() || param.is_fixed {
        return value;
    }
    let is_number = param.kind.starts_with("a number");
    match dice.below(12) {
        0 => {
            let interpolation = dice.of(&["linear", "smooth", "constant"]);
            let keys = json!([[1, value], [1.5 + dice.below(9) as f64, plain(param, dice)]]);
            json!({"keyframes": keys, "interpolation": interpolation})
        }
        1 if is_number || param.kind == "a whole number" => {
            let (a, b) = (drawn(param, dice), drawn(param, dice));
            let between = format!("mix({a}, {b}, 0.5 + 0.5*sin({}*time))", 1 + dice.below(30));
            json!({"expr": if is_number { between } else { format!("floor({between})") }})
        }
        1 | 2 if param.kind.starts_with("a vector") => match dice.below(3) {
            0 => json!({"expr": ["cos(time)", value[1], "0.1*frame"]}),
            1 => json!({"expr": format!("vec({}, {}*cos(frame), {})", value[0], value[1], value[2])}),
            _ => json!({"control": CONTROLS[0]}),
        },
        2 if is_number => json!({"control": CONTROLS[1]}),
        3 if param.may_be_masked => {
            json!({"value": value, "attribute": dice.of(&["mask", "mask", "mask", "envelope", "P"])})
        }
        _ => value,
    }
}

/// A plain value for `param`; null where only geometry would fit.
pub(crate) fn plain(param: &Param, dice: &mut Dice) -> Value {
    let kind = &param.kind[..];
    if let Some(at) = dice.index(param.words.len()) {
        return param.words[at].clone();
    }
    let whole = |number: f64| json!(number as i64);
    match kind {
        "`true` or `false`" => json!(dice.one_in(2)),
        "a whole number" => whole(drawn(param, dice)),
        "three whole numbers [x, y, z]" => json!([(); 3].map(|()| whole(drawn(param, dice)))),
        "two numbers [x, y]" => json!([(); 2].map(|()| drawn(param, dice))),
        "a range [a, b]" => {
            let (a, b) = (drawn(param, dice), drawn(param, dice));
            json!([a.min(b), a.max(b)])
        }
        "a string of assignments" => json!(program(dice)),
        "a string" => json!(dice.of(&["", "", "mask", "envelope"])),
        _ if kind.starts_with("a number") => json!(drawn(param, dice)),
        _ if kind.starts_with("a vector") || kind.starts_with("angles") => json!([(); 3].map(|()| drawn(param, dice))),
        _ if kind.starts_with("a ramp") => {
            json!({"ramp": [[0, drawn(param, dice)], [0.5, 1], [1, drawn(param, dice)]]})
        }
        _ => Value::Null,
    }
}

/// A number in the range of `param`; one in ten is an end of it, one in forty lies just beyond.
fn drawn(param: &Param, dice: &mut Dice) -> f64 {
    let [low, high] = range(param);
    let hard = [param.hard[0].unwrap_or(low), param.hard[1].unwrap_or(high)];
    let step = if param.kind.contains("whole") { 1.0 } else { 1e-3 };
    match dice.below(40) {
        0 => [hard[0] - step, hard[1].min(high) + step][dice.below(2)],
        1..5 => [low, high, hard[0]][dice.below(3)],
        _ => {
            let share = dice.below(1 << 20) as f64 / (1 << 20) as f64;
            // Of wide ranges the low end is what users know.
            let share = if high - low > 100.0 { share * share * share } else { share };
            low + (high - low) * share
        }
    }
}

/// What a param usually is; around its default where the declaration does not say.
fn range(param: &Param) -> [f64; 2] {
    let most = MOST.iter().find(|(name, _)| *name == param.name).map_or(f64::INFINITY, |(_, most)| *most);
    let default = param.default.as_f64().unwrap_or(0.0);
    let [low, high] = match (param.soft, param.hard) {
        (Some(soft), _) => soft,
        (None, [Some(low), Some(high)]) => [low, high],
        _ => [default - default.abs().max(1.0), default + default.abs().max(1.0)],
    };
    let [low, high] = [low.max(param.hard[0].unwrap_or(low)), high.min(param.hard[1].unwrap_or(high))];
    [low.min(most), high.min(most)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn param(kind: &str, hard: [Option<f64>; 2], soft: Option<[f64; 2]>) -> Param {
        Param { name: "rise".into(), kind: kind.into(), hard, soft, default: json!(1), ..Param::default() }
    }

    #[test]
    fn most_numbers_are_legal_and_some_lie_just_beyond() {
        let rise = param("a number", [Some(0.0), None], Some([0.0, 2.0]));
        let mut dice = Dice::new(1);
        let numbers: Vec<f64> = (0..1000).map(|_| drawn(&rise, &mut dice)).collect();
        let legal = numbers.iter().filter(|number| (0.0..=2.0).contains(*number)).count();
        assert!((950..1000).contains(&legal), "{legal}");
        assert!(numbers.iter().all(|number| (-0.01..2.01).contains(number)));
        assert!(numbers.contains(&0.0) && numbers.contains(&2.0), "the ends");
    }

    #[test]
    fn values_have_the_kind_of_their_param() {
        let mut dice = Dice::new(2);
        let mut of = |kind: &str| plain(&param(kind, [None, None], None), &mut dice);
        assert!(of("a whole number").is_i64());
        assert_eq!(of("a vector [x, y, z]").as_array().map(Vec::len), Some(3));
        assert!(of("a ramp {…}")["ramp"].is_array());
        assert_eq!(of("a list of tets [[a, b, c, d], …]"), Value::Null);
        let range = of("a range [a, b]");
        assert!(range[0].as_f64() <= range[1].as_f64());
    }

    #[test]
    fn fixed_params_are_never_animated() {
        let rise = Param { is_fixed: true, ..param("a number", [None, None], None) };
        let mut dice = Dice::new(3);
        assert!((0..200).all(|_| any_form(&rise, &mut dice).is_number()));
        let free = param("a number", [None, None], None);
        assert!((0..200).any(|_| any_form(&free, &mut dice)["expr"].is_string()));
    }
}
