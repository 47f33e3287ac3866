//! Params accept their whole range.

use super::*;

#[test]
fn a_node_that_fails_at_an_end_of_a_range_is_found() {
    const COUNT: Param<i64> = Param::int("count", 3, "How often they move.").within(1.0, 1_000.0).soft(1.0, 9.0);
    let node = shift(|cx| {
        let count = u8::try_from(cx.get(COUNT)).expect("a small count");
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * f32::from(count))?))
    });
    finds_only(node.params(&[&AMOUNT, &COUNT]), "it panics: it failed unexpectedly: a small count");
}

#[test]
fn an_end_that_is_read_behind_a_switch_is_tried() {
    const SHARE: Param<f32> =
        Param::float("share", 0.5, "How much further they move.").within(0.0, 1.0).when(|params| params.get(TWICE));
    let node = shift(|cx| {
        let further = if cx.get(TWICE) { 1.0 / (1.0 - cx.get(SHARE)) } else { 0.0 };
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + further)?))
    });
    finds_only(node.params(&[&AMOUNT, &TWICE, &SHARE]), "its result contains NaN: `P` of point 0 of the curves");
}
