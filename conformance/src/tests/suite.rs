//! Nodes without faults pass, whatever their inputs; values that the suite cannot invent come from the test.

use super::*;

#[test]
fn a_node_that_keeps_to_its_declaration_passes() {
    assert_eq!(findings_of(GOOD), [""; 0]);
}

#[test]
fn a_node_that_refuses_every_sample_needs_samples_from_the_test() {
    let node = shift(|cx| Err(Error::refused(format!("`amount` is {}", cx.get(AMOUNT)))));
    finds_only(node, "it refuses all samples of the suite; provide suitable ones with `with`: `amount` is 0.1");
}

#[test]
fn code_comes_from_the_test() {
    const CODE: Param<engine::geometry::Name> = Param::text("code", "", "What is done: `up`, or `down`.").fixed();
    let node = shift(|cx| match &*cx.get(CODE) {
        "up" => Ok(OUT.with(up(cx, cx.get(AMOUNT))?)),
        "down" => Ok(OUT.with(up(cx, -cx.get(AMOUNT))?)),
        other => Err(Error::refused(format!("`code` is {other:?}")).hint("write `up` or `down`")),
    });
    let node = leak(node.params(&[&AMOUNT, &CODE]));
    assert!(faults(node)[0].contains("it refuses all samples of the suite"));
    let samples =
        conformance(node).with(|bench| bench.set(CODE, "up".into())).with(|bench| bench.set(CODE, "down".into()));
    assert_eq!(samples.faults(), [""; 0]);
}

#[test]
fn a_node_that_takes_anything_is_tried_with_everything() {
    const ANY: Input = Input::any("geometry", "What to tag.");
    const TAGGED: Output = Output::like("geometry", &ANY, "The same, tagged.");
    const TAG: Attr<f32> = Attr::once("tag");
    let node = Node::new(
        "Tag",
        1,
        "Tags geometry.",
        Cook::Pure(|cx| {
            let mut geometry = cx.input(ANY).clone();
            for kind in Kind::ALL {
                if let Some(part) = geometry.part_mut(kind) {
                    part.set(TAG, vec![cx.get(SPARE) + part.positions().first().map_or(0.0, |p| p[0])])?;
                }
            }
            Ok(TAGGED.with(geometry))
        }),
    );
    let node = node.inputs(&[&ANY]).params(&[&SPARE]).outputs(&[&TAGGED]).reads(&[&P]);
    assert_eq!(findings_of(Node { writes: &[&TAG], ..node }), [""; 0]);
    let found = findings_of(node);
    assert!(
        ["curves", "mesh", "points", "tets"].iter().all(|kind| {
            let finding = format!("it adds the attribute `tag` to the {kind}, which it does not declare to write");
            found.contains(&finding)
        }),
        "{found:#?}"
    );
}

#[test]
fn a_source_is_tried_without_inputs() {
    const MADE: Output = Output::new("points", &[Kind::Points], "A row of points.");
    const ROW: Node = Node::new(
        "Row",
        1,
        "Makes points.",
        Cook::Pure(|cx| {
            let mut points = Component::points((0..8).map(|k| [k as f32 * cx.get(AMOUNT), 0.0, 0.0]).collect());
            points.set(ID, (0..8).collect())?;
            Ok(MADE.with(Geometry::from(points)))
        }),
    )
    .params(&[&AMOUNT])
    .outputs(&[&MADE]);
    finds_only(ROW, "it adds the attribute `id` to the points, which it does not declare to write");
    assert_eq!(findings_of(ROW.writes(&[&P, &ID])), [""; 0]);
}
