//! What a node does not write passes through, shared.

use super::*;

#[test]
fn attributes_that_are_not_written_must_pass_through() {
    let writes: fn(&Cx) -> Result<Outputs> = |cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.set(WIDTH, vec![1.0; part.point_count()])?;
        }
        Ok(OUT.with(curves))
    };
    finds(shift(writes), "it changes the attribute `width` of the curves, which it does not declare to write");
    finds(shift(writes), "it adds the attribute `width` to the curves, which it does not declare to write");
    assert_eq!(findings_of(shift(writes).writes(&[&P, &WIDTH])), [""; 0]);
    let drops = shift(|cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.remove(Owner::Element, "shielded");
        }
        Ok(OUT.with(curves))
    });
    finds_only(drops, "it drops the attribute `shielded` of the curves");
    let copies = shift(|cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            let _ = part.edit(ENVELOPE);
        }
        Ok(OUT.with(curves))
    });
    finds_only(copies, "it copies the attribute `envelope` of the curves, which it could share");
    finds(
        Node { writes: &[], ..GOOD },
        "it changes the attribute `P` of the curves, which it does not declare to write",
    );
}

#[test]
fn topology_must_be_shared_unless_it_is_declared_to_change() {
    let again: fn(&Cx) -> Result<Outputs> = |cx| {
        let moved = up(cx, cx.get(AMOUNT))?;
        let Some(part) = moved.curves() else { return Ok(OUT.with(moved)) };
        let Topology::Curves(runs) = part.topology() else { return Ok(OUT.with(moved)) };
        let tables = Owner::ALL.map(|owner| part.table(owner).clone());
        let runs = Topology::Curves(std::sync::Arc::new((**runs).clone()));
        Ok(OUT.with(Geometry::from(Component::from_tables(runs, tables)?)))
    };
    finds_only(shift(again), "it copies the topology of the curves, which it could share");
    let fewer: fn(&Cx) -> Result<Outputs> = |cx| {
        let by = cx.get(AMOUNT);
        let tips = cx.part(CURVES).positions().iter().map(|p| [p[0], p[1] + by, p[2]]).collect::<Vec<_>>();
        Ok(OUT.with(Geometry::from(Component::curves(vec![1; tips.len()], tips)?)))
    };
    finds_only(shift(fewer), "it changes the topology of the curves; declare `changes_topology`");
    assert_eq!(findings_of(shift(fewer).changes_topology()), [""; 0]);
}
