//! The bits of a frame do not depend on which other frames are cooked.

use super::*;

/// Moves curves with the clock.
fn with_clock(reads_clock: fn(&Params) -> bool) -> Node {
    let cook: fn(&FrameCx) -> Result<Outputs> = |cx| Ok(OUT.with(up(cx, cx.get(AMOUNT) * cx.seconds() as f32)?));
    Node { cook: Cook::Frame { cook, reads_clock }, ..GOOD }
}

#[test]
fn a_node_that_denies_reading_the_clock_is_found() {
    assert_eq!(findings_of(with_clock(|params| params.get(AMOUNT) != 0.0)), [""; 0]);
    finds_only(
        with_clock(|_| false),
        "it says that it does not read the clock, but gives different bits at another frame",
    );
    finds(with_clock(|params| params.get(SPARE) != 0.0), "it reads the param `spare`, which it does not declare");
}

#[test]
fn integrals_must_be_declared() {
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
    finds(CREEP, "it asks for an integral and declares no integrand");
    const SUMMED: Node = CREEP.integrates(|params| [0.0, params.get(SPEED), 0.0]);
    assert_eq!(findings_of(SUMMED), [""; 0]);
    const GREEDY: Node = Node {
        cook: Cook::Frame {
            cook: |cx| Ok(OUT.with(up(cx, cx.integrals::<2>(cx.frame())[1][0] as f32)?)),
            reads_clock: |_| true,
        },
        ..SUMMED
    };
    finds(GREEDY, "it asks for 2 integrals and declares 1");
}

#[test]
fn dependence_on_earlier_frames_is_found() {
    static LAST: AtomicU32 = AtomicU32::new(0);
    let cook: fn(&FrameCx) -> Result<Outputs> = |cx| {
        let last = LAST.swap(cx.frame().floor_number() as u32, Ordering::Relaxed);
        Ok(OUT.with(up(cx, cx.get(AMOUNT) * last as f32)?))
    };
    let node = Node { cook: Cook::Frame { cook, reads_clock: |_| true }, ..GOOD };
    finds(node, "has different bits when it is cooked alone");
}

/// A window that lags; with the leak its result also sinks slightly in every frame.
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
fn a_window_over_constant_inputs_must_be_constant() {
    let lag = |cook| Node { cook, ..GOOD }.params(&[&SPARE]);
    assert_eq!(findings_of(lag(Cook::window::<Lag<false>>(|_, _| Past::frames(8)))), [""; 0]);
    finds_only(lag(Cook::window::<Lag<true>>(|_, _| Past::frames(8))), "its result changes while its inputs do not");
}
