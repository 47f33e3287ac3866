//! Results are finite and nothing panics.

use super::*;
use numerics::vector;

#[test]
fn a_panic_is_found_for_any_kind_of_sample() {
    let empty = shift(|cx| {
        let root = cx.part(CURVES).positions()[0][1];
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + root)?))
    });
    finds_only(empty, "it panics, given Empty geometry: it failed unexpectedly: index out of bounds");
    let huge = shift(|cx| {
        assert!(cx.part(CURVES).positions().iter().all(|p| p[0].abs() < 1e20), "too far");
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    finds_only(huge, "it panics, given Huge geometry: it failed unexpectedly: too far");
    let one_cv = shift(|cx| {
        let shortest = cx.part(CURVES).runs().counts().min().unwrap_or(2);
        assert!(shortest > 1, "a curve of one CV");
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    finds(one_cv, "it panics: it failed unexpectedly: a curve of one CV");
}

#[test]
fn nan_for_finite_input_is_found() {
    let node = shift(|cx| Ok(OUT.with(up(cx, (cx.get(AMOUNT) - 0.05).sqrt())?)));
    finds_only(node, "its result contains NaN: `P` of point 0 of the curves is NaN or infinite");
    // What cannot be compared for NaN is not said to have no effect.
    let hidden = shift(|cx| {
        let share = if cx.part(CURVES).point_count() > 12 { f32::NAN } else { 0.0 };
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * share)?))
    });
    let found = findings_of(hidden);
    assert!(!found.is_empty() && found.iter().all(|line| line.starts_with("its result contains NaN")), "{found:#?}");
    // For coordinates near the largest f32, NaN is unavoidable, and the engine reports it.
    let squares = shift(|cx| {
        let mut curves = cx.input(CURVES).clone();
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.edit(P).into_iter().flatten().for_each(|p| p[1] = p[1] * p[1] + cx.get(AMOUNT));
        }
        Ok(OUT.with(curves))
    });
    assert_eq!(findings_of(squares), [""; 0]);
}

/// Moves each CV along y by `amount` × `share`.
fn by_share(cx: &Cx, share: fn(cvs: &[[f32; 3]], cv: usize) -> f32) -> Result<Outputs> {
    let curves = cx.part(CURVES);
    let shares = curves.runs().ranges().flat_map(|cvs| {
        let cvs = &curves.positions()[cvs];
        (0..cvs.len()).map(move |cv| share(cvs, cv))
    });
    let shares: Vec<f32> = shares.collect();
    let mut out = cx.input(CURVES).clone();
    if let Some(part) = out.part_mut(Kind::Curves) {
        part.edit(P).into_iter().flatten().zip(shares).for_each(|(p, share)| p[1] += cx.get(AMOUNT) * share);
    }
    Ok(OUT.with(out))
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    vector::length(vector::sub(a, b))
}

#[test]
fn nan_for_degenerate_curves_only_is_found() {
    type BadCook = fn(&Cx) -> Result<Outputs>;
    let bad: [(&str, BadCook); 4] = [
        ("doubled CVs", |cx| {
            by_share(cx, |cvs, cv| {
                let length = cvs.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f32>();
                let before = cv.saturating_sub(1);
                if length == 0.0 || cv == 0 {
                    0.0
                } else {
                    (cvs[cv][1] - cvs[before][1]) / distance(cvs[cv], cvs[before])
                }
            })
        }),
        ("curves of one CV", |cx| by_share(cx, |cvs, cv| cv as f32 / (cvs.len() - 1) as f32)),
        ("curves of two CVs", |cx| {
            by_share(
                cx,
                |cvs, cv| if cvs.len() < 2 { 0.0 } else { cv.saturating_sub(1) as f32 / (cvs.len() - 2) as f32 - 1.0 },
            )
        }),
        ("curves whose CVs are all equal", |cx| {
            by_share(cx, |cvs, cv| {
                let length = cvs.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f32>();
                if cvs.len() < 2 { 0.0 } else { distance(cvs[0], cvs[cv]) / length }
            })
        }),
    ];
    for (what, cook) in bad {
        let found = findings_of(shift(cook));
        assert!(
            found.iter().any(|line| line.starts_with("its result contains NaN: `P` of point")),
            "{what}: {found:#?}"
        );
    }
    // With a guard, the last of them is correct.
    let guarded = shift(|cx| {
        by_share(cx, |cvs, cv| {
            let length = cvs.windows(2).map(|pair| distance(pair[0], pair[1])).sum::<f32>();
            if length > 0.0 { distance(cvs[0], cvs[cv]) / length } else { 0.0 }
        })
    });
    assert_eq!(findings_of(guarded), [""; 0]);
}

#[test]
fn nan_for_coincident_points_only_is_found() {
    const POINTS: Input = Input::one("points", Kind::Points, "Points to move.");
    const SPREAD: Output = Output::like("points", &POINTS, "The points, moved.");
    let node = Node::new(
        "Spread",
        1,
        "Moves points.",
        Cook::Pure(|cx| {
            let mut points = cx.input(POINTS).clone();
            if let Some(rows) = points.part_mut(Kind::Points).and_then(|part| part.edit(P)) {
                for row in 1..rows.len() {
                    rows[row][1] += cx.get(AMOUNT) / distance(rows[row], rows[row - 1]);
                }
            }
            Ok(SPREAD.with(points))
        }),
    );
    let node = node.inputs(&[&POINTS]).params(&[&AMOUNT]).outputs(&[&SPREAD]).reads(&[&P]).writes(&[&P]);
    finds(node, "its result contains NaN: `P` of point 10 of the points");
}
