//! A declaration is complete and consistent.

use super::checkpoints::{Fall, falling};
use super::*;

#[test]
fn names_follow_their_style_and_are_unique() {
    finds_only(Node { name: "shift_it", ..GOOD }, "`shift_it` does not consist of capitalised words");
    const LOUD: Param<f32> = Param::float("Amount", 0.1, "How far they move.").unit(Unit::Metres);
    finds_only(
        shift(|cx| Ok(OUT.with(up(cx, cx.get(LOUD))?))).params(&[&LOUD]),
        "the param `Amount` is not in snake_case",
    );
    finds(Node { params: &[&AMOUNT, &AMOUNT], ..GOOD }, "the param `amount` is declared twice");
    finds(Node { inputs: &[&CURVES, &CURVES], ..GOOD }, "the input `curves` is declared twice");
    finds(Node { outputs: &[&OUT, &OUT], ..GOOD }, "the output `curves` is declared twice");
    finds(Node { metrics: &[&HEIGHT, &HEIGHT], ..GOOD }, "the metric `height` is declared twice");
    finds(Node { version: 0, ..GOOD }, "its version is 0");
    finds(Node { outputs: &[], ..GOOD }, "it has no output");
}

#[test]
fn everything_needs_help_of_at_least_a_sentence() {
    finds_only(Node { help: "Moves curves", ..GOOD }, "it needs help of at least a sentence");
    const BARE: Param<f32> = Param::float("amount", 0.1, "").unit(Unit::Metres);
    finds_only(Node { params: &[&BARE], ..GOOD }, "the param `amount` needs help");
    const MUTE: Input = Input::one("curves", Kind::Curves, "curves.");
    finds_only(Node { inputs: &[&MUTE], ..GOOD }, "the input `curves` needs help");
    const DUMB: Output = Output::like("curves", &CURVES, "Out.");
    finds_only(shift(|cx| Ok(DUMB.with(up(cx, cx.get(AMOUNT))?))).outputs(&[&DUMB]), "the output `curves` needs help");
    const VAGUE: Metric = Metric::new("height", Unit::Metres, "height");
    let node = shift(|cx| {
        cx.publish(VAGUE, 1.0);
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    finds_only(node.metrics(&[&VAGUE]), "the metric `height` needs help");
}

#[test]
fn numbers_need_a_unit_or_range_and_defaults_within_it() {
    const FREE: Param<f32> = Param::float("amount", 0.1, "How far they move.");
    finds_only(Node { params: &[&FREE], ..GOOD }, "`amount` is a number with neither unit nor range");
    const BELOW: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).at_least(0.5);
    finds(
        Node { params: &[&BELOW], ..GOOD },
        "the default of `amount` is refused: `amount` is 0.1; expected at least 0.5",
    );
    const BACK: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).within(1.0, 0.0);
    finds(Node { params: &[&BACK], ..GOOD }, "the hard range of `amount` runs backwards");
    const WIDE: Param<f32> = Param::float("amount", 0.1, "How far they move.").within(0.0, 1.0).soft(0.0, 2.0);
    finds_only(Node { params: &[&WIDE], ..GOOD }, "the usual range 0…2 of `amount` is empty, or not within 0…1");
    const RAMP: Param<std::sync::Arc<numerics::ramp::Ramp>> =
        Param::ramp("ramp", &[[1.0, 0.0], [0.0, 1.0]], "How they are moved.");
    finds_only(Node { params: &[&RAMP], ..GOOD }, "the default of one of its ramps is not a valid ramp");
}

#[test]
fn outputs_must_say_what_they_carry_and_attributes_have_fixed_types() {
    const LOST: Output = Output::like("curves", &OTHER, "The curves, moved.");
    finds(Node { outputs: &[&LOST], ..GOOD }, "the output `curves` does not say which components it carries");
    const THICK: Attr<[f32; 3]> = Attr::point("width");
    finds(Node { reads: &[&THICK], ..GOOD }, "it reads `width` as float3, which is always float");
    finds(Node { writes: &[&P, &P], ..GOOD }, "it lists `P` twice in what it writes");
}

#[test]
fn declarations_for_the_planner_may_depend_only_on_fixed_params() {
    let attributes: fn(&Params) -> [AttrNames; 2] = |params| {
        params.get(AMOUNT);
        [AttrNames::These(Vec::new()), AttrNames::These(Vec::new())]
    };
    finds_only(GOOD.attributes(attributes), "its attributes depend on `amount`, which can be animated");
    let clock =
        Cook::Frame { cook: |cx| Ok(OUT.with(up(cx, cx.integral(cx.frame())[0] as f32)?)), reads_clock: |_| true };
    let integrand: fn(&Params) -> [f64; 3] = |params| [f64::from(params.get(AMOUNT)), 0.0, 0.0];
    finds_only(
        Node { cook: clock, ..GOOD }.integrates(integrand),
        "it integrates over `amount`, which is not declared with `history`",
    );
    const PAST: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).history();
    finds_only(
        Node { params: &[&PAST], ..GOOD },
        "`amount` is declared with `history`, but nothing is integrated over it",
    );
    let start: fn(&Params) -> Option<i64> = |params| Some(params.get(AMOUNT) as i64);
    finds(
        Node { cook: Cook::solver::<Fall>(start), ..falling() },
        "its start depends on `amount`, which can be animated",
    );
}
