//! Outputs carry what they declare; metrics are published and finite.

use super::*;

#[test]
fn outputs_must_carry_what_they_declare() {
    finds(shift(|_| Ok(Outputs::default())), "it returns no `curves`");
    let swapped = shift(|cx| {
        let by = cx.get(AMOUNT);
        let points = cx.part(CURVES).positions().iter().map(|p| p.map(|x| x + by)).collect();
        Ok(OUT.with(Geometry::from(Component::points(points))))
    });
    finds(swapped, "its output `curves` carries points, expected curves");
    let more = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT))?.with(Component::points(Vec::new())))));
    finds(more, "its output `curves` carries curves, points, expected curves");
}

#[test]
fn metrics_must_be_declared_published_and_finite() {
    let publishes: fn(&Cx) -> Result<Outputs> = |cx| {
        cx.publish(HEIGHT, f64::from(cx.get(AMOUNT)));
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    };
    finds(shift(publishes), "it publishes `height`, which it does not declare");
    assert_eq!(findings_of(shift(publishes).metrics(&[&HEIGHT])), [""; 0]);
    finds_only(GOOD.metrics(&[&HEIGHT]), "it never publishes the metric `height`");
    let endless = shift(|cx| {
        cx.publish(HEIGHT, f64::from(1.0 / cx.get(AMOUNT)));
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    finds_only(endless.metrics(&[&HEIGHT]), "the metric `height` is NaN or infinite");
}
