//! For each rule a node that breaks it, and nodes of every kind that break none.

use std::sync::atomic::{AtomicU32, Ordering};

use serde::{Deserialize, Serialize};

use super::{conformance, faults};
use engine::geometry::{Attr, Component, ENVELOPE, Geometry, ID, Kind, Owner, P, SHIELDED, Topology, WIDTH};
use engine::node::{
    AttrNames, Chain, Cook, Cx, FrameCx, Input, LeftOut, Many, Metric, Node, Opt, Output, Outputs, Past, StepCx, Times,
};
use engine::param::{Maskable, Param, Params, Seed, Unit};
use engine::{Error, Result, choice};

choice! {
    /// Which way.
    enum Way {
        Up = "up": "along y",
        Along = "along": "along x",
    }
}

const CURVES: Input = Input::one("curves", Kind::Curves, "Curves to move.");
const OTHER: Input<Opt> = Input::optional("other", Kind::Curves, "Other curves.");
const SKINS: Input<Many> = Input::many("skins", Kind::Mesh, "Meshes beside them.");
const OUT: Output = Output::like("curves", &CURVES, "The curves, moved.");
const AMOUNT: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).soft(0.0, 1.0);
const SPARE: Param<f32> = Param::float("spare", 0.1, "What nobody asks for.").within(0.0, 1.0);
const WAY: Param<Way> = Param::choice("way", Way::Up, "Which way they move.");
const TWICE: Param<bool> = Param::bool("twice", false, "Moves them twice as far.");
const HEIGHT: Metric = Metric::new("height", Unit::Metres, "How far they were moved.");

/// The curves, moved along y.
fn up(cx: &Cx, by: f32) -> Result<Geometry> {
    let mut curves = cx.input(CURVES).clone();
    if let Some(part) = curves.part_mut(Kind::Curves) {
        part.edit(P).into_iter().flatten().for_each(|p| p[1] += by);
    }
    Ok(curves)
}

const fn shift(cook: fn(&Cx) -> Result<Outputs>) -> Node {
    Node::new("Shift", 1, "Moves curves.", Cook::Pure(cook))
        .inputs(&[&CURVES])
        .params(&[&AMOUNT])
        .outputs(&[&OUT])
        .writes(&[&P])
}

const GOOD: Node = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT))?)));

fn leak(node: Node) -> &'static Node {
    Box::leak(Box::new(node))
}

/// What the suite says of a node, all of it.
fn said(node: Node) -> Vec<String> {
    faults(leak(node))
}

#[track_caller]
fn caught(node: Node, finding: &str) {
    let found = said(node);
    assert!(found.iter().any(|line| line.contains(finding)), "expected {finding:?}, found {found:#?}");
}

#[track_caller]
fn only(node: Node, finding: &str) {
    let found = said(node);
    assert!(found.len() == 1 && found[0].contains(finding), "expected {finding:?} alone, found {found:#?}");
}

#[test]
fn a_node_that_keeps_to_its_declaration_passes() {
    assert_eq!(said(GOOD), [""; 0]);
}

// ——— declarations ———

#[test]
fn names_follow_their_style_and_stand_once() {
    only(Node { name: "shift_it", ..GOOD }, "`shift_it` is not made of capitalised words");
    const LOUD: Param<f32> = Param::float("Amount", 0.1, "How far they move.").unit(Unit::Metres);
    only(shift(|cx| Ok(OUT.with(up(cx, cx.get(LOUD))?))).params(&[&LOUD]), "the param `Amount` is not in snake_case");
    caught(Node { params: &[&AMOUNT, &AMOUNT], ..GOOD }, "the param `amount` is declared twice");
    caught(Node { inputs: &[&CURVES, &CURVES], ..GOOD }, "the input `curves` is declared twice");
    caught(Node { outputs: &[&OUT, &OUT], ..GOOD }, "the output `curves` is declared twice");
    caught(Node { metrics: &[&HEIGHT, &HEIGHT], ..GOOD }, "the metric `height` is declared twice");
    caught(Node { version: 0, ..GOOD }, "its version is 0");
    caught(Node { outputs: &[], ..GOOD }, "it has no output");
}

#[test]
fn everything_has_help_of_at_least_a_sentence() {
    only(Node { help: "Moves curves", ..GOOD }, "it needs help of at least a sentence");
    const BARE: Param<f32> = Param::float("amount", 0.1, "").unit(Unit::Metres);
    only(Node { params: &[&BARE], ..GOOD }, "the param `amount` needs help");
    const MUTE: Input = Input::one("curves", Kind::Curves, "curves.");
    only(Node { inputs: &[&MUTE], ..GOOD }, "the input `curves` needs help");
    const DUMB: Output = Output::like("curves", &CURVES, "Out.");
    only(shift(|cx| Ok(DUMB.with(up(cx, cx.get(AMOUNT))?))).outputs(&[&DUMB]), "the output `curves` needs help");
    const VAGUE: Metric = Metric::new("height", Unit::Metres, "height");
    let node = shift(|cx| {
        cx.publish(VAGUE, 1.0);
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    only(node.metrics(&[&VAGUE]), "the metric `height` needs help");
}

#[test]
fn numbers_have_a_unit_or_a_range_and_defaults_lie_inside() {
    const FREE: Param<f32> = Param::float("amount", 0.1, "How far they move.");
    only(Node { params: &[&FREE], ..GOOD }, "`amount` is a number with neither unit nor range");
    const BELOW: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).at_least(0.5);
    caught(
        Node { params: &[&BELOW], ..GOOD },
        "the default of `amount` is refused: `amount` is 0.1; expected at least 0.5",
    );
    const BACK: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).within(1.0, 0.0);
    caught(Node { params: &[&BACK], ..GOOD }, "the hard range of `amount` runs backwards");
    const WIDE: Param<f32> = Param::float("amount", 0.1, "How far they move.").within(0.0, 1.0).soft(0.0, 2.0);
    only(Node { params: &[&WIDE], ..GOOD }, "the usual range 0…2 of `amount` is empty, or not within 0…1");
    const RAMP: Param<std::sync::Arc<numerics::ramp::Ramp>> =
        Param::ramp("ramp", &[[1.0, 0.0], [0.0, 1.0]], "How they are moved.");
    only(Node { params: &[&RAMP], ..GOOD }, "the default of one of its ramps is no ramp");
}

#[test]
fn outputs_say_what_they_carry_and_attributes_have_their_types() {
    const LOST: Output = Output::like("curves", &OTHER, "The curves, moved.");
    caught(Node { outputs: &[&LOST], ..GOOD }, "the output `curves` does not say which components it carries");
    const THICK: Attr<[f32; 3]> = Attr::point("width");
    caught(Node { reads: &[&THICK], ..GOOD }, "it reads `width` as float3, which is always float");
    caught(Node { writes: &[&P, &P], ..GOOD }, "it lists `P` twice among what it writes");
}

#[test]
fn what_plans_ask_hangs_on_params_that_stand_still() {
    let attributes: fn(&Params) -> [AttrNames; 2] = |params| {
        params.get(AMOUNT);
        [AttrNames::These(Vec::new()), AttrNames::These(Vec::new())]
    };
    only(GOOD.attributes(attributes), "its attributes hang on `amount`, which may be animated");
    let clock =
        Cook::Frame { cook: |cx| Ok(OUT.with(up(cx, cx.integral(cx.frame())[0] as f32)?)), reads_clock: |_| true };
    let integrand: fn(&Params) -> [f64; 3] = |params| [f64::from(params.get(AMOUNT)), 0.0, 0.0];
    only(
        Node { cook: clock, ..GOOD }.integrates(integrand),
        "it integrates over `amount`, which is not declared with `history`",
    );
    const PAST: Param<f32> = Param::float("amount", 0.1, "How far they move.").unit(Unit::Metres).history();
    only(Node { params: &[&PAST], ..GOOD }, "`amount` is declared with `history`, and nothing is integrated over it");
    let start: fn(&Params) -> Option<i64> = |params| Some(params.get(AMOUNT) as i64);
    caught(
        Node { cook: Cook::solver::<Fall>(start), ..falling() },
        "its start hangs on `amount`, which may be animated",
    );
}

// ——— params, inputs, attributes ———

#[test]
fn only_what_is_declared_is_read() {
    caught(
        shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) + cx.get(SPARE))?))),
        "it reads the param `spare`, which it does not declare",
    );
    const WRONG: Param<i64> = Param::int("amount", 1, "How far they move.");
    caught(shift(|cx| Ok(OUT.with(up(cx, cx.get(WRONG) as f32)?))), "it reads the param `amount` as another type");
    let other = shift(|cx| {
        let more = cx.input(OTHER).map_or(0.0, |_| 1.0);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + more)?))
    });
    caught(other, "it reads the input `other`, which it does not declare");
}

#[test]
fn a_read_behind_a_choice_and_a_switch_and_a_missing_wire_is_found() {
    let node = shift(|cx| {
        let hidden = cx.get(WAY) == Way::Along && cx.get(TWICE) && cx.input(OTHER).is_none();
        let more = if hidden { cx.get(SPARE) } else { cx.input(OTHER).map_or(0.0, first_y) };
        let twice = if cx.get(TWICE) { 2.0 } else { 1.0 };
        let along = if cx.get(WAY) == Way::Along { -1.0 } else { 1.0 };
        Ok(OUT.with(up(cx, along * twice * cx.get(AMOUNT) + more)?))
    });
    only(
        node.inputs(&[&CURVES, &OTHER]).params(&[&AMOUNT, &WAY, &TWICE]),
        "it reads the param `spare`, which it does not declare",
    );
}

fn first_y(geometry: &Geometry) -> f32 {
    geometry.parts().next().and_then(|part| part.positions().first()).map_or(0.0, |p| p[1])
}

#[test]
fn every_param_is_read_and_matters() {
    only(GOOD.params(&[&AMOUNT, &SPARE]), "it never reads the param `spare`");
    let idle = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) + 0.0 * cx.get(SPARE))?)));
    only(idle.params(&[&AMOUNT, &SPARE]), "the param `spare` never changes anything");
    const SEED: Param<Seed> = Param::seed("Picks another shift.");
    let seeded = shift(|cx| {
        let _ = cx.get(SEED);
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    only(seeded.params(&[&AMOUNT, &SEED]), "the param `seed` never changes anything");
}

#[test]
fn a_param_that_is_read_in_one_rare_mixture_matters() {
    const RARE: Param<f32> = Param::float("rare", 0.5, "How much further they move.")
        .within(0.0, 1.0)
        .when(|params| params.get(WAY) == Way::Along && params.get(TWICE));
    let node = shift(|cx| {
        let twice = if cx.get(TWICE) { 2.0 } else { 1.0 };
        let along = if cx.get(WAY) == Way::Along { -1.0 } else { 1.0 };
        let rare = if cx.get(WAY) == Way::Along && cx.get(TWICE) { cx.get(RARE) } else { 0.0 };
        Ok(OUT.with(up(cx, along * twice * cx.get(AMOUNT) + rare)?))
    });
    assert_eq!(said(node.params(&[&AMOUNT, &WAY, &TWICE, &RARE])), [""; 0]);
}

const BLEND: Param<Maskable> = Param::maskable("blend", 1.0, "Share of the way.").within(0.0, 1.0);

#[test]
fn a_mask_must_matter() {
    let deaf = shift(|cx| {
        let blend = cx.mask(BLEND, cx.part(CURVES))?.value;
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * blend)?))
    });
    only(deaf.params(&[&AMOUNT, &BLEND]), "the mask of `blend` never changes anything");
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
    assert_eq!(said(masked.params(&[&AMOUNT, &BLEND])), [""; 0]);
}

#[test]
fn every_input_matters() {
    only(GOOD.inputs(&[&CURVES, &OTHER]), "the input `other` never changes anything");
    let list = shift(|cx| {
        let more = cx.input(SKINS).iter().map(|skin| first_y(skin)).sum::<f32>();
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + more)?))
    });
    assert_eq!(said(list.inputs(&[&CURVES, &SKINS])), [""; 0]);
}

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
fn attributes_that_are_read_are_declared_and_matter() {
    caught(
        shift(by_envelope),
        "it reads an attribute that it does not declare (`envelope`): the result changes where it is changed",
    );
    assert_eq!(said(shift(by_envelope).reads(&[&ENVELOPE])), [""; 0]);
    only(GOOD.reads(&[&P, &SHIELDED]), "it declares to read the attribute `shielded`, which never changes anything");
}

// ——— what goes through ———

#[test]
fn what_a_node_does_not_own_goes_through_untouched() {
    let writes: fn(&Cx) -> Result<Outputs> = |cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.set(WIDTH, vec![1.0; part.point_count()])?;
        }
        Ok(OUT.with(curves))
    };
    caught(shift(writes), "it changes the attribute `width` of the curves, which it does not declare to write");
    caught(shift(writes), "it adds the attribute `width` to the curves, which it does not declare to write");
    assert_eq!(said(shift(writes).writes(&[&P, &WIDTH])), [""; 0]);
    let drops = shift(|cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.remove(Owner::Element, "shielded");
        }
        Ok(OUT.with(curves))
    });
    only(drops, "it drops the attribute `shielded` of the curves");
    let copies = shift(|cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves) {
            let _ = part.edit(ENVELOPE);
        }
        Ok(OUT.with(curves))
    });
    only(copies, "it copies the attribute `envelope` of the curves, which it could share");
    caught(
        Node { writes: &[], ..GOOD },
        "it changes the attribute `P` of the curves, which it does not declare to write",
    );
}

#[test]
fn topology_is_shared_unless_it_is_declared_to_change() {
    let again: fn(&Cx) -> Result<Outputs> = |cx| {
        let moved = up(cx, cx.get(AMOUNT))?;
        let Some(part) = moved.curves() else { return Ok(OUT.with(moved)) };
        let Topology::Curves(runs) = part.topology() else { return Ok(OUT.with(moved)) };
        let tables = Owner::ALL.map(|owner| part.table(owner).clone());
        let runs = Topology::Curves(std::sync::Arc::new((**runs).clone()));
        Ok(OUT.with(Geometry::from(Component::from_tables(runs, tables)?)))
    };
    only(shift(again), "it copies the topology of the curves, which it could share");
    let fewer: fn(&Cx) -> Result<Outputs> = |cx| {
        let by = cx.get(AMOUNT);
        let tips = cx.part(CURVES).positions().iter().map(|p| [p[0], p[1] + by, p[2]]).collect::<Vec<_>>();
        Ok(OUT.with(Geometry::from(Component::curves(vec![1; tips.len()], tips)?)))
    };
    only(shift(fewer), "it changes the topology of the curves; declare `changes_topology`");
    assert_eq!(said(shift(fewer).changes_topology()), [""; 0]);
}

#[test]
fn outputs_carry_what_they_say() {
    caught(shift(|_| Ok(Outputs::default())), "it returns no `curves`");
    let swapped = shift(|cx| {
        let by = cx.get(AMOUNT);
        let points = cx.part(CURVES).positions().iter().map(|p| p.map(|x| x + by)).collect();
        Ok(OUT.with(Geometry::from(Component::points(points))))
    });
    caught(swapped, "its output `curves` carries points, expected curves");
    let more = shift(|cx| Ok(OUT.with(up(cx, cx.get(AMOUNT))?.with(Component::points(Vec::new())))));
    caught(more, "its output `curves` carries curves, points, expected curves");
}

#[test]
fn metrics_are_declared_published_and_finite() {
    let publishes: fn(&Cx) -> Result<Outputs> = |cx| {
        cx.publish(HEIGHT, f64::from(cx.get(AMOUNT)));
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    };
    caught(shift(publishes), "it publishes `height`, which it does not declare");
    assert_eq!(said(shift(publishes).metrics(&[&HEIGHT])), [""; 0]);
    only(GOOD.metrics(&[&HEIGHT]), "it never publishes the metric `height`");
    let endless = shift(|cx| {
        cx.publish(HEIGHT, f64::from(1.0 / cx.get(AMOUNT)));
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    only(endless.metrics(&[&HEIGHT]), "the metric `height` is NaN or infinite");
}

#[test]
fn what_is_left_out_still_writes_its_attributes() {
    const DUST: Attr<f32> = Attr::point("dust");
    let dusty: fn(&Cx) -> Result<Outputs> = |cx| {
        let mut curves = up(cx, cx.get(AMOUNT))?;
        if let Some(part) = curves.part_mut(Kind::Curves).filter(|_| cx.get(TWICE)) {
            part.set(DUST, vec![1.0; part.point_count()])?;
        }
        Ok(OUT.with(curves))
    };
    let leaves_out: fn(&Params, &engine::node::Wires) -> Vec<LeftOut> =
        |params, _| if params.get(TWICE) { Vec::new() } else { vec![LeftOut::new("dust", "`twice` is false")] };
    let node = shift(dusty).params(&[&AMOUNT, &TWICE]).writes(&[&P, &DUST]).leaves_out(leaves_out);
    only(node, "it leaves out `dust` and then lacks `dust` on its output `curves`");
}

// ——— bits ———

#[test]
fn a_node_that_remembers_is_found() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let node = shift(|cx| {
        let calls = CALLS.fetch_add(1, Ordering::Relaxed);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + calls as f32)?))
    });
    caught(node, "it gives other bits on a second run");
}

#[test]
fn a_node_that_counts_threads_is_found() {
    let node = shift(|cx| {
        let threads = rayon::current_num_threads();
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * threads as f32)?))
    });
    let found = said(node);
    assert_eq!(found, [2, 7].map(|threads| format!("it gives other bits on {threads} threads than on one")));
}

#[test]
fn a_node_that_panics_is_found_wherever_it_does() {
    let empty = shift(|cx| {
        let root = cx.part(CURVES).positions()[0][1];
        Ok(OUT.with(up(cx, cx.get(AMOUNT) + root)?))
    });
    only(empty, "it panics, given Empty geometry: it failed unexpectedly: index out of bounds");
    let huge = shift(|cx| {
        assert!(cx.part(CURVES).positions().iter().all(|p| p[0].abs() < 1e20), "too far");
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    only(huge, "it panics, given Huge geometry: it failed unexpectedly: too far");
    let one_cv = shift(|cx| {
        let shortest = cx.part(CURVES).runs().counts().min().unwrap_or(2);
        assert!(shortest > 1, "a curve of one CV");
        Ok(OUT.with(up(cx, cx.get(AMOUNT))?))
    });
    caught(one_cv, "it panics: it failed unexpectedly: a curve of one CV");
}

#[test]
fn a_node_that_makes_nan_of_sound_numbers_is_found() {
    let node = shift(|cx| Ok(OUT.with(up(cx, (cx.get(AMOUNT) - 0.05).sqrt())?)));
    only(node, "it lets NaN out: `P` of point 0 of the curves is NaN or infinite");
    // Of coordinates near the largest f32 nothing else can be made, and the engine says so.
    let squares = shift(|cx| {
        let mut curves = cx.input(CURVES).clone();
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.edit(P).into_iter().flatten().for_each(|p| p[1] = p[1] * p[1] + cx.get(AMOUNT));
        }
        Ok(OUT.with(curves))
    });
    assert_eq!(said(squares), [""; 0]);
}

#[test]
fn a_node_that_refuses_everything_asks_for_samples() {
    let node = shift(|cx| Err(Error::refused(format!("`amount` is {}", cx.get(AMOUNT)))));
    only(node, "it refuses all that the suite can offer; give it samples with `with`: `amount` is 0.1");
}

// ——— time ———

/// Moves curves with the clock.
fn with_clock(reads_clock: fn(&Params) -> bool) -> Node {
    let cook: fn(&FrameCx) -> Result<Outputs> = |cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) * cx.seconds() as f32)?));
    Node { cook: Cook::Frame { cook, reads_clock }, ..GOOD }
}

#[test]
fn a_node_that_denies_reading_the_clock_is_found() {
    assert_eq!(said(with_clock(|params| params.get(AMOUNT) != 0.0)), [""; 0]);
    only(with_clock(|_| false), "it says that it does not read the clock, and gives other bits at another frame");
    caught(with_clock(|params| params.get(SPARE) != 0.0), "it reads the param `spare`, which it does not declare");
}

#[test]
fn an_integral_passes() {
    const SPEED: Param<f64> =
        Param::double("speed", 1.0, "How fast they move.").unit(Unit::MetresPerSecond).soft(-2.0, 2.0).history();
    const CREEP: Node = Node {
        cook: Cook::Frame {
            cook: |cx| Ok(OUT.with(up(cx, cx.integral(cx.frame())[1] as f32)?)),
            reads_clock: |params| params.get(SPEED) != 0.0,
        },
        ..GOOD
    }
    .params(&[&SPEED]);
    caught(CREEP, "it asks for an integral and declares no integrand");
    const SUMMED: Node = CREEP.integrates(|params| [0.0, params.get(SPEED), 0.0]);
    assert_eq!(said(SUMMED), [""; 0]);
    const GREEDY: Node = Node {
        cook: Cook::Frame {
            cook: |cx| Ok(OUT.with(up(cx, cx.integrals::<2>(cx.frame())[1][0] as f32)?)),
            reads_clock: |_| true,
        },
        ..SUMMED
    };
    caught(GREEDY, "it asks for 2 integrals and declares 1");
}

#[test]
fn a_frame_that_hangs_on_frames_before_it_is_found() {
    static LAST: AtomicU32 = AtomicU32::new(0);
    let cook: fn(&FrameCx) -> Result<Outputs> = |cx| {
        let last = LAST.swap(cx.frame().floor_number() as u32, Ordering::Relaxed);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * last as f32)?))
    };
    let node = Node { cook: Cook::Frame { cook, reads_clock: |_| true }, ..GOOD };
    caught(node, "alone has other bits than among others");
}

/// A window that lags; with a leak, it sinks a little every frame.
struct Lag<const LEAK: bool>(Vec<[f32; 3]>);

impl<const LEAK: bool> Chain for Lag<LEAK> {
    fn start(cx: &FrameCx) -> Result<Self> {
        Ok(Self(cx.part(CURVES).positions().to_vec()))
    }
    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let share = cx.get(SPARE);
        for (p, goal) in self.0.iter_mut().zip(cx.part(CURVES).positions()) {
            *p = std::array::from_fn(|k| p[k] + (goal[k] - p[k]) * share - if LEAK { 0.001 } else { 0.0 });
        }
        Ok(())
    }
    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        let mut curves = cx.input(CURVES).clone();
        if let Some(part) = curves.part_mut(Kind::Curves) {
            part.set(P, self.0.clone())?;
        }
        Ok(OUT.with(curves))
    }
}

#[test]
fn a_window_stands_still_over_what_does() {
    let lag = |cook| Node { cook, ..GOOD }.params(&[&SPARE]);
    assert_eq!(said(lag(Cook::window::<Lag<false>>(|_, _| Past::frames(8)))), [""; 0]);
    only(
        lag(Cook::window::<Lag<true>>(|_, _| Past::frames(8))),
        "over inputs that stand still it does not stand still",
    );
}

/// A solver: curves that fall, faster and faster.
#[derive(Serialize, Deserialize)]
struct Fall {
    points: Vec<[f32; 3]>,
    speed: f64,
}

impl Chain for Fall {
    fn start(cx: &FrameCx) -> Result<Self> {
        Ok(Self { points: cx.at_start(DROPPED).curves().map_or(&[][..], Component::positions).to_vec(), speed: 0.0 })
    }
    fn step(&mut self, cx: &StepCx) -> Result<()> {
        self.speed += f64::from(cx.get(AMOUNT)) * cx.dt();
        self.points.iter_mut().for_each(|p| p[1] -= (self.speed * cx.dt()) as f32);
        Ok(())
    }
    fn output(&self, _: &FrameCx) -> Result<Outputs> {
        Ok(FALLEN.with(Geometry::from(Component::points(self.points.clone()))))
    }
}

/// The same, with a speed that no checkpoint holds.
#[derive(Serialize, Deserialize)]
struct Forgetful {
    points: Vec<[f32; 3]>,
    #[serde(skip)]
    speed: f64,
}

impl Chain for Forgetful {
    fn start(cx: &FrameCx) -> Result<Self> {
        Fall::start(cx).map(|fall| Self { points: fall.points, speed: fall.speed })
    }
    fn step(&mut self, cx: &StepCx) -> Result<()> {
        let mut fall = Fall { points: std::mem::take(&mut self.points), speed: self.speed };
        fall.step(cx)?;
        (self.points, self.speed) = (fall.points, fall.speed);
        Ok(())
    }
    fn output(&self, cx: &FrameCx) -> Result<Outputs> {
        Fall { points: self.points.clone(), speed: self.speed }.output(cx)
    }
}

const DROPPED: Input = Input::one("curves", Kind::Curves, "Where they fall from.").read_at(|_| Times::START);
const FALLEN: Output = Output::new("points", &[Kind::Points], "The CVs, fallen.");

fn falling() -> Node {
    Node::new("Fall", 1, "Curves that fall.", Cook::solver::<Fall>(|_| None))
        .inputs(&[&DROPPED])
        .params(&[&AMOUNT])
        .outputs(&[&FALLEN])
}

#[test]
fn a_solver_whose_checkpoints_lose_something_is_found() {
    assert_eq!(said(falling()), [""; 0]);
    let forgetful = Node { cook: Cook::solver::<Forgetful>(|_| None), ..falling() };
    only(forgetful, "its state loses something when it is written to a checkpoint and read back");
}

// ——— samples ———

#[test]
fn a_text_in_a_language_comes_from_the_test() {
    const CODE: Param<engine::geometry::Name> = Param::text("code", "", "What is done: `up`, or `down`.").fixed();
    let node = shift(|cx| match &*cx.get(CODE) {
        "up" => Ok(OUT.with(up(cx, cx.get(AMOUNT))?)),
        "down" => Ok(OUT.with(up(cx, -cx.get(AMOUNT))?)),
        other => Err(Error::refused(format!("`code` is {other:?}")).hint("write `up` or `down`")),
    });
    let node = leak(node.params(&[&AMOUNT, &CODE]));
    assert!(faults(node)[0].contains("it refuses all that the suite can offer"));
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
    let node = node.inputs(&[&ANY]).params(&[&SPARE]).outputs(&[&TAGGED]);
    assert_eq!(said(Node { writes: &[&TAG], ..node }), [""; 0]);
    let found = said(node);
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
    only(ROW, "it adds the attribute `id` to the points, which it does not declare to write");
    assert_eq!(said(ROW.writes(&[&P, &ID])), [""; 0]);
}
