//! A node is neutral only where its `cook` would change nothing.

use super::*;

#[test]
fn a_node_that_is_neutral_where_its_cook_changes_nothing_conforms() {
    let neutral = |params: &Params, _: &Wires| (params.get(AMOUNT) == 0.0).then_some("`amount` is 0");
    assert_eq!(findings_of(GOOD.neutral(neutral)), [""; 0]);
}

#[test]
fn a_node_that_is_neutral_too_often_is_found() {
    let doubling = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) * if cx.get(TWICE) { 2.0 } else { 1.0 })?)));
    let node =
        doubling.params(&[&AMOUNT, &TWICE]).neutral(|params, _| (!params.get(TWICE)).then_some("`twice` is false"));
    finds_only(node, "it is declared neutral (`twice` is false), but its `cook` moves points");
}

#[test]
fn a_node_that_is_neutral_below_a_threshold_is_found() {
    let neutral = |params: &Params, _: &Wires| (params.get(AMOUNT) <= 0.03).then_some("`amount` is small");
    finds_only(GOOD.neutral(neutral), "it is declared neutral (`amount` is small), but its `cook` moves points");
}

#[test]
fn an_undeclared_curve_id_is_found() {
    let node = shift(|cx| {
        let mut curves = cx.edit(CURVES);
        let moved = CurveLoop::over(&curves).map(|curve, out| {
            let by = cx.get(AMOUNT) * curve.random(0);
            for cv in curve.cvs() {
                out[cv.index] = [cv.point[0], cv.point[1] + by, cv.point[2]];
            }
        });
        curves.set(P, moved.points)?;
        Ok(OUT.with(curves))
    });
    let found = findings_of(node);
    assert!(found.iter().any(|finding| finding.contains("does not declare (`curve_id`)")), "{found:?}");
}
