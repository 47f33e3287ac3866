//! Every input changes the result.

use super::*;

#[test]
fn every_input_must_matter() {
    finds_only(GOOD.inputs(&[&CURVES, &OTHER]), "the input `other` never affects the result");
    let list = shift(|cx| {
        let more = cx.input(SKINS).iter().map(|skin| first_y(skin)).sum::<f32>();
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + more)?))
    });
    assert_eq!(findings_of(list.inputs(&[&CURVES, &SKINS])), [""; 0]);
}
