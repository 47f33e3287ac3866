//! A node reads the attributes that it declares to read, and no others.

use super::*;

/// Moves each CV by its `envelope`, 1 where it is missing.
fn by_envelope(cx: &Cx) -> Result<Outputs> {
    let envelope = cx.part(CURVES).get(ENVELOPE).map(<[f32]>::to_vec);
    let mut curves = cx.input(CURVES).clone();
    if let Some(part) = curves.part_mut(Kind::Curves) {
        for (row, p) in part.edit(P).into_iter().flatten().enumerate() {
            p[1] += cx.get(AMOUNT) * envelope.as_ref().map_or(1.0, |envelope| envelope[row]);
        }
    }
    Ok(OUT.with(curves))
}

#[test]
fn attributes_that_are_read_must_be_declared_and_matter() {
    finds(
        shift(by_envelope),
        "it reads an attribute that it does not declare (`envelope`): the result changes where it is changed",
    );
    assert_eq!(findings_of(shift(by_envelope).reads(&[&P, &ENVELOPE])), [""; 0]);
    finds_only(
        GOOD.reads(&[&P, &SHIELDED]),
        "it declares to read the attribute `shielded`, but it never affects the result",
    );
}

#[test]
fn positions_that_are_read_must_be_declared() {
    let finding = "it reads `P`, which it does not declare: the result changes with the points of `curves`";
    finds_only(Node { reads: &[], ..GOOD }, finding);
    let measures = shift(|cx| {
        cx.publish(HEIGHT, f64::from(cx.get(AMOUNT) + first_y(cx.input(CURVES))));
        Ok(OUT.with(cx.input(CURVES).clone()))
    });
    finds_only(Node { reads: &[], ..measures }.metrics(&[&HEIGHT]), finding);
    let widens = shift(|cx| {
        let mut curves = cx.input(CURVES).clone();
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.set(WIDTH, vec![cx.get(AMOUNT); part.point_count()])?;
        }
        Ok(OUT.with(curves))
    });
    assert_eq!(findings_of(Node { reads: &[], writes: &[&WIDTH], ..widens }), [""; 0]);
}

#[test]
fn a_declared_attribute_that_is_not_read_is_found_beside_one_that_is() {
    finds_only(
        shift(by_envelope).reads(&[&P, &ENVELOPE, &SHIELDED]),
        "it declares to read the attribute `shielded`, but it never affects the result",
    );
}
