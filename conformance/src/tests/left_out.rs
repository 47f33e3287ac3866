//! A stage reported as left out has no effect.

use super::*;

#[test]
fn a_stage_that_is_left_out_must_still_write_its_attributes() {
    const DUST: Attr<f32> = Attr::point("dust");
    let dusty: fn(&Cx) -> Result<Outputs> = |cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves).filter(|_| cx.get(TWICE)) {
            part.set(DUST, vec![1.0; part.point_count()])?;
        }
        Ok(OUT.with(curves))
    };
    let leaves_out: fn(&Params, &Wires) -> Vec<LeftOut> =
        |params, _| if params.get(TWICE) { Vec::new() } else { vec![LeftOut::new("dust", "`twice` is false")] };
    let node = shift(dusty).params(&[&AMOUNT, &TWICE]).writes(&[&P, &DUST]).leaves_out(leaves_out);
    finds_only(node, "while it leaves out `dust`, its output `curves` lacks `dust`");
}

type LeavesOut = fn(&Params, &Wires) -> Vec<LeftOut>;

#[test]
fn a_node_left_out_as_a_whole_must_pass_its_input_through() {
    let leaves_out: LeavesOut = |params, _| match params.get(AMOUNT) {
        0.0 => vec![LeftOut::new("all", "`amount` is 0")],
        _ => Vec::new(),
    };
    // Without the early return: the work is done, but moves nothing.
    finds_only(
        GOOD.leaves_out(leaves_out),
        "it leaves out `all` (`amount` is 0), but still makes a new `P` for the curves",
    );
    let returns_early = shift(|cx| match cx.get(AMOUNT) {
        0.0 => Ok(OUT.with(cx.input(CURVES).clone())),
        amount => Ok(OUT.with(up(cx, amount)?)),
    });
    assert_eq!(findings_of(returns_early.leaves_out(leaves_out)), [""; 0]);
}

#[test]
fn a_stage_left_out_too_often_is_found() {
    let leaves_out: LeavesOut = |params, _| match params.get(AMOUNT) < 0.001 {
        true => vec![LeftOut::new("shift", "`amount` is small")],
        false => Vec::new(),
    };
    finds_only(
        GOOD.leaves_out(leaves_out),
        "it leaves out `shift` (`amount` is small), but `amount` still affects the result",
    );
}

#[test]
fn a_stage_that_is_not_really_left_out_is_found() {
    let leaves_out: LeavesOut = |params, _| match (params.get(TWICE), params.get(SPARE)) {
        (false, _) => vec![LeftOut::new("extra", "`twice` is false")],
        (true, 0.0) => vec![LeftOut::new("extra", "`spare` is 0")],
        (true, _) => Vec::new(),
    };
    let honest = shift(|cx| {
        let extra = if cx.get(TWICE) { cx.get(SPARE) } else { 0.0 };
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + extra)?))
    });
    assert_eq!(findings_of(honest.params(&[&AMOUNT, &TWICE, &SPARE]).leaves_out(leaves_out)), [""; 0]);
    let runs_on = shift(|cx| {
        let extra = if cx.get(TWICE) { 2.0 } else { 1.0 } * cx.get(SPARE);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + extra)?))
    });
    finds_only(
        runs_on.params(&[&AMOUNT, &TWICE, &SPARE]).leaves_out(leaves_out),
        "it leaves out `extra` (`twice` is false), but `spare` still affects the result",
    );
}

#[test]
fn an_input_whose_stage_is_left_out_must_have_no_effect() {
    let leaves_out: LeavesOut = |params, _| match params.get(TWICE) {
        true => Vec::new(),
        false => vec![LeftOut::new("other", "`twice` is false")],
    };
    let node = shift(|cx| {
        let twice = if cx.get(TWICE) { 2.0 } else { 1.0 };
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + twice * cx.input(OTHER).map_or(0.0, first_y))?))
    });
    finds_only(
        node.inputs(&[&CURVES, &OTHER]).params(&[&AMOUNT, &TWICE]).leaves_out(leaves_out),
        "it leaves out `other` (`twice` is false), but the input `other` still affects the result",
    );
}
