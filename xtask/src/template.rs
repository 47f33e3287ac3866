//! The text of a new node: a starting point that passes conformance, uses all cores and shows the structure.

/// Options of a new node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Options {
    /// Whether its result depends on the frame's time.
    pub(crate) reads_clock: bool,
    /// Name of the param that a point attribute may mask.
    pub(crate) mask: Option<String>,
    /// Name of a ramp along the curve.
    pub(crate) ramp: Option<String>,
    /// Whether it has random numbers.
    pub(crate) seed: bool,
    /// Whether it knows the curves' shape at rest.
    pub(crate) rest: bool,
    /// Whether segments may change their lengths.
    pub(crate) free_lengths: bool,
}

/// The node's file.
pub(crate) fn render(name: &str, options: &Options) -> String {
    let keep = |line: &&str| match line.split_once("//?") {
        None => true,
        Some((_, tag)) => match tag.trim() {
            "frame" => options.reads_clock,
            "pure" => !options.reads_clock,
            "mask" => options.mask.is_some(),
            "no mask" => options.mask.is_none(),
            "ramp" => options.ramp.is_some(),
            "seed" => options.seed,
            "no seed" => !options.seed,
            "rest" => options.rest,
            "no rest" => !options.rest,
            "kept" => !options.free_lengths,
            "free" => options.free_lengths,
            tag => unreachable!("the template has an unknown tag `{tag}`"),
        },
    };
    let amount = options.mask.as_deref().unwrap_or("amount");
    let ramp = options.ramp.as_deref().unwrap_or_default();
    let factors = [
        Some(if options.mask.is_some() { "amount.at(cv.row)" } else { "amount" }),
        options.ramp.as_ref().map(|_| "ramp.eval(cv.u)"),
        options.seed.then_some("own"),
        options.reads_clock.then_some("swing"),
    ];
    let factors: Vec<&str> = factors.into_iter().flatten().collect();
    let lines = TEMPLATE.lines().filter(keep).map(|line| line.split("//?").next().unwrap_or(line).trim_end());
    let frames = if options.rest { ".framed_by(rest)" } else { "" };
    let seeded = if options.seed { ".seeded(cx.get(SEED))" } else { "" };
    let kept = if options.free_lengths { "" } else { ".keeping_lengths()" };
    let read = ["&P", "&PREF", "&CURVE_ID"].into_iter().zip([true, options.rest, options.seed]);
    let read: Vec<&str> = read.filter_map(|(attribute, is_read)| is_read.then_some(attribute)).collect();
    let text: String = lines.map(|line| format!("{line}\n")).collect();
    text.replace("NODE_NAME", name)
        .replace(
            "AMOUNT_VALUE",
            if options.mask.is_some() { "params.get(AMOUNT_CONST).value" } else { "params.get(AMOUNT_CONST)" },
        )
        .replace("AMOUNT_SET", if options.mask.is_some() { "0.5.into()" } else { "0.5" })
        .replace(".OPTIONS", &[frames, seeded, kept].concat())
        .replace("ATTRIBUTES", &read.join(", "))
        .replace("AMOUNT_PARAM", amount)
        .replace("RAMP_PARAM", ramp)
        .replace("FACTORS", &factors.join(" * "))
        .replace("AMOUNT_CONST", &amount.to_ascii_uppercase())
        .replace("RAMP_CONST", &ramp.to_ascii_uppercase())
}

/// Lines that end in `//? tag` are kept only with that option.
const TEMPLATE: &str = r#"//! NODE_NAME: moves CVs across their curve.
//!
//! If it implements a paper, say here which one, which section, and where and why it departs from it.

use engine::prelude::*;
use numerics::ramp::Ramp; //? ramp
use numerics::trig::sin; //? frame
use std::f32::consts::TAU; //? frame
use std::sync::Arc; //? ramp

inputs! { INPUTS:
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to move, root first."); //? no rest
    CURVES: Input = Input::one("curves", Kind::Curves, "The curves to move, root first. Their shape at rest is `Pref`, \ //? rest
        or else their shape at the scene's first frame.").read_at(|_| Times::NOW.and(Times::START)); //? rest
}

params! { PARAMS:
    AMOUNT_CONST: Param<Maskable> = Param::maskable("AMOUNT_PARAM", 0.01, "How far CVs move. 0 leaves the curves alone.") //? mask
    AMOUNT_CONST: Param<f32> = Param::float("AMOUNT_PARAM", 0.01, "How far CVs move. 0 leaves the curves alone.") //? no mask
        .unit(Unit::Metres).soft(0.0, 1.0);
    RAMP_CONST: Param<Arc<Ramp>> = Param::ramp("RAMP_PARAM", &[[0.0, 0.0], [1.0, 1.0]], //? ramp
        "Scales the movement along the curve, from root (0) to tip (1)."); //? ramp
    SEED: Param<Seed> = Param::seed("Each seed moves every curve by another random fraction."); //? seed
}

const OUT: Output = Output::like("curves", &CURVES, "The moved curves. Their segments keep their lengths."); //? kept
const OUT: Output = Output::like("curves", &CURVES, "The moved curves."); //? free
 //? kept
metrics! { METRICS: //? kept
    LENGTH_ERROR = Metric::length_error(); //? kept
} //? kept

pub(crate) static NODE: Node = Node::new(
    "NODE_NAME",
    1,
    "Moves the CVs of curves across their direction. Segments keep their lengths; roots move with the rest of the curve.", //? kept
    "Moves the CVs of curves across their direction, so that their segments change their lengths.", //? free
    Cook::Pure(cook), //? pure
    Cook::Frame { cook, reads_clock: |params| AMOUNT_VALUE != 0.0 }, //? frame
)
.inputs(INPUTS)
.params(PARAMS)
.outputs(&[&OUT])
.reads(&[ATTRIBUTES])
.writes(&[&P])
.metrics(METRICS) //? kept
.neutral(|params, _| (AMOUNT_VALUE == 0.0).then_some("`AMOUNT_PARAM` is 0"));

fn cook(cx: &Cx) -> Result<Outputs> { //? pure
fn cook(cx: &FrameCx) -> Result<Outputs> { //? frame
    let mut curves = cx.edit(CURVES);
    let amount = cx.mask(AMOUNT_CONST, &curves)?; //? mask
    let amount = cx.get(AMOUNT_CONST); //? no mask
    let ramp = cx.get(RAMP_CONST); //? ramp
    // Seconds are reduced in f64: late frames keep their precision. //? frame
    let swing = sin(TAU * cx.seconds().fract() as f32 + 1.0); //? frame
    let rest = cx.at_rest(CURVES, &curves)?; //? rest
    let moved = CurveLoop::over(&curves).OPTIONS.map(|curve, out| {
        let own = curve.random(0); //? seed
        for cv in curve.cvs() {
            let offset = FACTORS;
            out[cv.index] = std::array::from_fn(|k| cv.point[k] + offset * cv.normal[k]);
        }
    });
    cx.publish(LENGTH_ERROR, moved.length_error); //? kept
    curves.set(P, moved.points)?;
    Ok(OUT.with(curves))
}

#[cfg(test)]
mod tests {
    use super::*;
    use conformance::{bench, conforms};

    #[test]
    fn conforms_to_its_declaration() {
        conforms(&NODE);
    }

    #[test]
    fn curves_move_and_keep_their_lengths() { //? kept
    fn curves_move() { //? free
        let points: Vec<[f32; 3]> = (0..9).map(|k| [0.0, 0.125 * k as f32, 0.0]).collect();
        let curve = Component::curves(vec![9], points.clone()).unwrap();
        let out = bench(&NODE).input(CURVES, curve).set(AMOUNT_CONST, AMOUNT_SET).cook();
        assert!(out.curves().positions() != points && out.metrics["length_error"] < 1e-5); //? kept
        assert!(out.curves().positions() != points); //? free
    }
}
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// The repository's tests compile the same texts and check that the nodes conform.
    #[test]
    fn rendered_nodes_are_those_that_the_tests_compile() {
        let full = Options {
            reads_clock: true,
            mask: Some("bend".into()),
            ramp: Some("falloff".into()),
            seed: true,
            rest: true,
            free_lengths: false,
        };
        let free = Options { free_lengths: true, seed: true, ..Options::default() };
        for (name, options, file) in [
            ("Curve_Plain", Options::default(), "curve_plain.rs"),
            ("Curve_Full", full, "curve_full.rs"),
            ("Curve_Free", free, "curve_free.rs"),
        ] {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/new_nodes").join(file);
            let text = render(name, &options);
            if std::env::var_os("BLESS").is_some() {
                std::fs::write(&path, &text).unwrap();
            }
            assert_eq!(
                std::fs::read_to_string(&path).unwrap(),
                text,
                "{}: `cargo xtask bless` writes it",
                path.display()
            );
        }
    }
}
