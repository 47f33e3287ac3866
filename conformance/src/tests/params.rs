//! Every param is read and changes the result; none is read undeclared.

use super::*;

#[test]
fn undeclared_reads_are_found() {
    finds(
        shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) + cx.get(SPARE))?))),
        "it reads the param `spare`, which it does not declare",
    );
    const WRONG: Param<i64> = Param::int("amount", 1, "How far they move.");
    finds(shift(|cx| Ok(OUT.with(up(cx, cx.get(WRONG) as f32)?))), "it reads the param `amount` as another type");
    let other = shift(|cx| {
        let more = cx.input(OTHER).map_or(0.0, |_| 1.0);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + more)?))
    });
    finds(other, "it reads the input `other`, which it does not declare");
}

#[test]
fn a_read_at_a_time_that_the_input_does_not_name_is_found() {
    let early = shift(|cx| {
        let first = cx.part_at_start(CURVES).positions().first().map_or(0.0, |point| point[1]);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + first)?))
    });
    finds(early, "the input `curves` is read at the start, which its `read_at` does not name");
}

#[test]
fn undeclared_reads_behind_a_choice_a_switch_and_a_missing_wire_are_found() {
    let node = shift(|cx| {
        let hidden = cx.get(WAY) == Way::Along && cx.get(TWICE) && cx.input(OTHER).is_none();
        let more = if hidden { cx.get(SPARE) } else { cx.input(OTHER).map_or(0.0, first_y) };
        let twice = if cx.get(TWICE) { 2.0 } else { 1.0 };
        let along = if cx.get(WAY) == Way::Along { -1.0 } else { 1.0 };
        Ok(OUT.with(up(cx, along * twice * cx.get(AMOUNT) + more)?))
    });
    finds_only(
        node.inputs(&[&CURVES, &OTHER]).params(&[&AMOUNT, &WAY, &TWICE]),
        "it reads the param `spare`, which it does not declare",
    );
}

#[test]
fn every_param_must_be_read_and_matter() {
    finds_only(GOOD.params(&[&AMOUNT, &SPARE]), "it never reads the param `spare`");
    let idle = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) + 0.0 * cx.get(SPARE))?)));
    finds_only(idle.params(&[&AMOUNT, &SPARE]), "the param `spare` never affects the result");
    const SEED: Param<Seed> = Param::seed("Picks another shift.");
    let seeded = shift(|cx| {
        let _ = cx.get(SEED);
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    finds_only(seeded.params(&[&AMOUNT, &SEED]), "the param `seed` never affects the result");
}

#[test]
fn a_param_that_is_read_in_rare_mixtures_passes() {
    const RARE: Param<f32> = Param::float("rare", 0.5, "How much further they move.")
        .within(0.0, 1.0)
        .when(|params| params.get(WAY) == Way::Along && params.get(TWICE));
    let node = shift(|cx| {
        let twice = if cx.get(TWICE) { 2.0 } else { 1.0 };
        let along = if cx.get(WAY) == Way::Along { -1.0 } else { 1.0 };
        let rare = if cx.get(WAY) == Way::Along && cx.get(TWICE) { cx.get(RARE) } else { 0.0 };
        Ok(OUT.with(up(cx, along * twice * cx.get(AMOUNT) + rare)?))
    });
    assert_eq!(findings_of(node.params(&[&AMOUNT, &WAY, &TWICE, &RARE])), [""; 0]);
}

const BLEND: Param<Maskable> = Param::maskable("blend", 1.0, "Share of the way.").within(0.0, 1.0);

#[test]
fn a_mask_must_matter() {
    let deaf = shift(|cx| {
        let blend = cx.mask(BLEND, cx.part(CURVES))?.value;
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * blend)?))
    });
    finds_only(deaf.params(&[&AMOUNT, &BLEND]), "the mask of `blend` never affects the result");
    let masked = shift(|cx| {
        let numerics::masked::Masked { value: blend, mask } = cx.mask(BLEND, cx.part(CURVES))?;
        let mut curves = cx.input(CURVES).clone();
        if let Some(part) = curves.part_mut(Kind::Curves) {
            for (row, p) in part.edit(P).into_iter().flatten().enumerate() {
                p[1] += cx.get(AMOUNT) * blend * mask.map_or(1.0, |mask| mask[row]);
            }
        }
        Ok(OUT.with(curves))
    });
    assert_eq!(findings_of(masked.params(&[&AMOUNT, &BLEND])), [""; 0]);
}
