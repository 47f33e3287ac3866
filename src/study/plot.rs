//! The work-precision plot: error over time per frame, both logarithmic, as SVG.

use std::fmt::Write as _;

use super::knobs::Knob;
use super::outcome::{Goal, Outcome};
use super::table::brief;
use crate::numbers::short;

const WIDTH: f64 = 960.0;
const HEIGHT: f64 = 600.0;
/// Left, top, right and bottom of the plotting area.
const AREA: [f64; 4] = [92.0, 78.0, 730.0, 532.0];

/// A logarithmic axis.
struct Axis {
    /// Logarithms to base 10 of its ends.
    from: f64,
    to: f64,
    /// Pixels of its ends.
    low: f64,
    high: f64,
}

impl Axis {
    /// The axis over `numbers`, which are positive, widened to at least half a decade.
    fn new(numbers: &[f64], [low, high]: [f64; 2]) -> Self {
        let ends = numbers.iter().map(|x| libm::log10(*x)).fold(None, |ends: Option<[f64; 2]>, x| {
            let [from, to] = ends.unwrap_or([x, x]);
            Some([from.min(x), to.max(x)])
        });
        let [from, to] = ends.unwrap_or([-1.0, 1.0]);
        let margin = (0.06 * (to - from)).max((0.5 - (to - from)) / 2.0).max(0.06);
        Self { from: from - margin, to: to + margin, low, high }
    }

    fn at(&self, number: f64) -> f64 {
        let share = (libm::log10(number) - self.from) / (self.to - self.from);
        self.low + share * (self.high - self.low)
    }

    /// Where lines are drawn, and whether they have a number: powers of ten, and 2 and 5 times them where there are few.
    fn ticks(&self) -> Vec<f64> {
        let decades = self.to - self.from;
        let factors: &[f64] = if decades < 1.2 {
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0]
        } else if decades < 2.5 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let every = (decades / 10.0).ceil().max(1.0) as i32;
        let powers = (self.from.floor() as i32..=self.to.ceil() as i32).filter(|power| power % every == 0);
        let numbers = powers.flat_map(|power| factors.iter().map(move |factor| factor * libm::exp10(f64::from(power))));
        numbers.filter(|x| (self.from..=self.to).contains(&libm::log10(*x))).collect()
    }
}

/// Height of the band below a logarithmic axis of errors in which those of 0 are drawn, pixels.
const ZERO_BAND: f64 = 40.0;

/// The axis of errors: logarithmic down to the floor, on which everything below it is drawn. Without a floor an error may be
/// 0, which has no logarithm: it is drawn in a band of its own.
struct Errors {
    /// None where all errors are 0.
    positive: Option<Axis>,
    floor: f64,
    zero: bool,
}

impl Errors {
    fn new(errors: &[f64], floor: f64) -> Self {
        let [_, top, _, bottom] = AREA;
        let zero = floor <= 0.0 && errors.contains(&0.0);
        let low = if zero { bottom - ZERO_BAND } else { bottom };
        let drawn = errors.iter().map(|error| error.max(floor)).chain([floor]);
        let positive: Vec<f64> = drawn.filter(|error| *error > 0.0).collect();
        let positive = (!positive.is_empty()).then(|| Axis::new(&positive, [low, top]));
        Self { positive, floor, zero }
    }

    fn at(&self, error: f64) -> f64 {
        match &self.positive {
            Some(axis) if error.max(self.floor) > 0.0 => axis.at(error.max(self.floor)),
            _ => AREA[3] - ZERO_BAND / 2.0,
        }
    }

    /// Where lines are drawn and numbered.
    fn ticks(&self) -> Vec<f64> {
        let zero = self.zero.then_some(0.0);
        zero.into_iter().chain(self.positive.iter().flat_map(Axis::ticks)).collect()
    }
}

/// The text of an SVG file.
struct Svg(String);

impl Svg {
    fn line(&mut self, [x, y]: [f64; 2], [to_x, to_y]: [f64; 2], style: &str) {
        let _ = writeln!(self.0, r#"<line x1="{x:.1}" y1="{y:.1}" x2="{to_x:.1}" y2="{to_y:.1}" {style}/>"#);
    }

    fn circle(&mut self, [x, y]: [f64; 2], r: f64, style: &str) {
        let _ = writeln!(self.0, r#"<circle cx="{x:.1}" cy="{y:.1}" r="{r}" {style}/>"#);
    }

    fn text(&mut self, [x, y]: [f64; 2], style: &str, text: &str) {
        let escaped = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(self.0, r#"<text x="{x:.1}" y="{y:.1}" {style}>{escaped}</text>"#);
    }
}

/// The plot of a study.
pub(super) fn svg(outcome: &Outcome) -> String {
    let floor = outcome.floor();
    let done: Vec<(usize, f64, f64)> = (0..outcome.runs.len())
        .filter_map(|run| Some((run, outcome.ms(run)?.max(1e-6), outcome.error(run)?)))
        .collect();
    let [left, _, right, bottom] = AREA;
    let times: Vec<f64> = done.iter().map(|one| one.1).collect();
    let tolerance = match outcome.goal {
        Goal::Tolerance(tolerance) => Some(tolerance),
        Goal::Budget(_) | Goal::None => None,
    };
    let errors: Vec<f64> = done.iter().map(|one| one.2).chain(tolerance).collect();
    let (x, y) = (Axis::new(&times, [left, right]), Errors::new(&errors, floor));
    let mut svg = Svg(format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="system-ui, Helvetica, Arial, sans-serif" font-size="13" fill="#222">
<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>
"##
    ));
    frame(&mut svg, outcome, &x, &y);
    if floor > 0.0 {
        let at = y.at(floor);
        let _ = writeln!(
            svg.0,
            r##"<rect x="{left}" y="{at:.1}" width="{:.1}" height="{:.1}" fill="#e9e4da"/>"##,
            right - left,
            bottom - at
        );
        svg.line([left, at], [right, at], r##"stroke="#9b7b3f" stroke-width="1.5""##);
        svg.text(
            [left + 8.0, (at + 16.0).min(bottom - 5.0)],
            r##"fill="#7a5c22" font-size="12""##,
            &format!("floor {} {}", brief(floor), outcome.unit),
        );
    }
    goal(&mut svg, outcome, &x, &y);
    let front: Vec<String> = outcome
        .front
        .iter()
        .filter_map(|run| Some(format!("{:.1},{:.1}", x.at(outcome.ms(*run)?.max(1e-6)), y.at(outcome.error(*run)?))))
        .collect();
    let _ =
        writeln!(svg.0, r##"<polyline points="{}" fill="none" stroke="#1f5fa8" stroke-width="2"/>"##, front.join(" "));
    let mut labels: Vec<[f64; 4]> = Vec::new();
    for (run, ms, error) in &done {
        let at = [x.at(*ms), y.at(*error)];
        let on_front = outcome.front.contains(run);
        let style = match on_front {
            true => r##"fill="#1f5fa8" stroke="#fff""##,
            false => r##"fill="#fff" stroke="#8a94a0" stroke-width="1.5""##,
        };
        svg.circle(at, 4.5, style);
        if outcome.pick == Some(*run) {
            svg.circle(at, 9.0, r##"fill="none" stroke="#c2410c" stroke-width="2.5""##);
        }
        if on_front || outcome.knobs.len() == 1 {
            label(&mut svg, outcome, *run, at, &mut labels);
        }
    }
    failures(&mut svg, outcome);
    legend(&mut svg, outcome);
    svg.0 + "</svg>\n"
}

/// Title, grid, axes and their names.
fn frame(svg: &mut Svg, outcome: &Outcome, x: &Axis, y: &Errors) {
    let [left, top, right, bottom] = AREA;
    for at in x.ticks() {
        svg.line([x.at(at), top], [x.at(at), bottom], r##"stroke="#e6e8eb""##);
        svg.text([x.at(at), bottom + 18.0], r##"text-anchor="middle" fill="#555" font-size="12""##, &short(at));
    }
    for at in y.ticks() {
        svg.line([left, y.at(at)], [right, y.at(at)], r##"stroke="#e6e8eb""##);
        svg.text([left - 8.0, y.at(at) + 4.0], r##"text-anchor="end" fill="#555" font-size="12""##, &short(at));
    }
    if y.zero {
        svg.line(
            [left, bottom - ZERO_BAND],
            [right, bottom - ZERO_BAND],
            r##"stroke="#9aa3ad" stroke-dasharray="2 4""##,
        );
    }
    let (width, height) = (right - left, bottom - top);
    let _ = writeln!(
        svg.0,
        r##"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#9aa3ad"/>"##
    );
    let unit = if outcome.unit.is_empty() { String::new() } else { format!(" ({})", outcome.unit) };
    let error = format!("{} error, {}{unit}", outcome.norm.statistic.name(), outcome.norm.measure.name());
    let middle = (top + bottom) / 2.0;
    let style = format!(r##"text-anchor="middle" transform="rotate(-90 20 {middle})""##);
    svg.text([20.0, middle], &style, &error);
    svg.text([(left + right) / 2.0, bottom + 44.0], r##"text-anchor="middle""##, "time per frame (ms)");
    svg.text(
        [left, 30.0],
        r##"font-size="17" font-weight="600""##,
        &format!("{}: {}", outcome.output, knob_names(outcome)),
    );
    let frames = outcome.frames.len();
    let s = if frames == 1 { "" } else { "s" };
    svg.text([left, 52.0], r##"fill="#666" font-size="12""##, &format!("{}, {frames} frame{s}", outcome.graph));
}

fn knob_names(outcome: &Outcome) -> String {
    outcome.knobs.iter().map(|knob| knob.key.as_str()).collect::<Vec<_>>().join(", ")
}

/// The tolerance or the budget.
fn goal(svg: &mut Svg, outcome: &Outcome, x: &Axis, y: &Errors) {
    let [left, top, right, bottom] = AREA;
    let style = r##"stroke="#c2410c" stroke-dasharray="6 4""##;
    match outcome.goal {
        Goal::Tolerance(tolerance) => {
            let at = y.at(tolerance);
            svg.line([left, at], [right, at], style);
            let text = format!("tolerance {}", brief(tolerance));
            svg.text([left + 8.0, at - 6.0], r##"fill="#c2410c" font-size="12""##, &text);
        }
        Goal::Budget(ms) if (x.from..=x.to).contains(&libm::log10(ms)) => {
            let at = x.at(ms);
            svg.line([at, top], [at, bottom], style);
            svg.text([at + 6.0, top + 16.0], r##"fill="#c2410c" font-size="12""##, &format!("budget {} ms", brief(ms)));
        }
        Goal::Budget(_) | Goal::None => {}
    }
}

/// The values of a run beside its point, where they overlap no other label.
fn label(svg: &mut Svg, outcome: &Outcome, run: usize, [x, y]: [f64; 2], labels: &mut Vec<[f64; 4]>) {
    let setting = &outcome.runs[run].setting;
    let values: Vec<&str> =
        outcome.knobs.iter().zip(setting).map(|(knob, value): (&Knob, &usize)| knob.values[*value].as_str()).collect();
    let text = values.join(", ");
    let width = 7.0 * text.chars().count() as f64;
    let [left, top, right, bottom] = AREA;
    let places = [[x + 10.0, y - 8.0], [x + 10.0, y + 18.0], [x - 10.0 - width, y - 8.0], [x - 10.0 - width, y + 18.0]];
    let place = places.into_iter().find(|[x, y]| {
        let inside = *x >= left && x + width <= right && y - 12.0 >= top && *y <= bottom;
        let apart = |other: &[f64; 4]| x + width < other[0] || *x > other[2] || *y < other[1] || y - 12.0 > other[3];
        inside && labels.iter().all(apart)
    });
    if let Some([x, y]) = place {
        labels.push([x, y - 12.0, x + width, y]);
        svg.text([x, y], r##"font-size="12" fill="#333""##, &text);
    }
}

/// Runs that failed, above the plotting area: they have neither time nor error.
fn failures(svg: &mut Svg, outcome: &Outcome) {
    let [_, top, right, _] = AREA;
    let failed: Vec<usize> = (0..outcome.runs.len()).filter(|run| outcome.runs[*run].result.is_err()).collect();
    for (place, run) in failed.iter().take(24).enumerate() {
        let at = [right - 12.0 - 16.0 * place as f64, top - 12.0];
        let values: Vec<&str> = outcome
            .knobs
            .iter()
            .zip(&outcome.runs[*run].setting)
            .map(|(knob, value)| knob.values[*value].as_str())
            .collect();
        let style = r##"stroke="#b91c1c" stroke-width="2""##;
        let why = outcome.runs[*run].result.as_ref().err().map(String::as_str).unwrap_or_default();
        svg.0.push_str("<g><title>");
        let title = format!("{}: {why}", values.join(", "));
        svg.0.push_str(&title.replace('&', "&amp;").replace('<', "&lt;"));
        svg.0.push_str("</title>\n");
        svg.line([at[0] - 4.0, at[1] - 4.0], [at[0] + 4.0, at[1] + 4.0], style);
        svg.line([at[0] - 4.0, at[1] + 4.0], [at[0] + 4.0, at[1] - 4.0], style);
        svg.0.push_str("</g>\n");
    }
}

/// What the marks mean, and the orders.
fn legend(svg: &mut Svg, outcome: &Outcome) {
    let left = AREA[2] + 24.0;
    let mut y = AREA[1] + 10.0;
    let small = r##"font-size="12" fill="#333""##;
    svg.line([left, y - 4.0], [left + 22.0, y - 4.0], r##"stroke="#1f5fa8" stroke-width="2""##);
    svg.circle([left + 11.0, y - 4.0], 4.5, r##"fill="#1f5fa8" stroke="#fff""##);
    svg.text([left + 32.0, y], small, "Pareto front");
    y += 22.0;
    svg.circle([left + 11.0, y - 4.0], 4.5, r##"fill="#fff" stroke="#8a94a0" stroke-width="1.5""##);
    svg.text([left + 32.0, y], small, "other runs");
    if let Some(pick) = outcome.pick {
        y += 22.0;
        svg.circle([left + 11.0, y - 4.0], 8.0, r##"fill="none" stroke="#c2410c" stroke-width="2.5""##);
        svg.text([left + 32.0, y], small, &format!("pick: run {pick}"));
    }
    let failed = outcome.runs.iter().filter(|run| run.result.is_err()).count();
    if failed > 0 {
        y += 22.0;
        svg.text([left + 5.0, y], r##"fill="#b91c1c" font-weight="700""##, "×");
        svg.text([left + 32.0, y], small, &format!("failed: {failed}"));
    }
    y += 14.0;
    let mut lines = Vec::new();
    for slope in outcome.slopes() {
        lines.push(format!("order of {}", slope.knob));
        lines.extend(wrapped(&slope.describe(), 32));
    }
    lines.push(match outcome.floor {
        Some(_) => format!("floor: {} {}", brief(outcome.floor()), outcome.unit),
        None => "floor: unknown".into(),
    });
    lines.extend(wrapped(&format!("reference: {}", outcome.why), 32));
    if let Some(chaos) = outcome.chaos() {
        lines.push(String::new());
        lines.extend(wrapped(&chaos, 32));
    }
    for line in lines {
        y += 17.0;
        svg.text([left, y], small, &line);
    }
}

/// A text in lines of at most `most` characters, where words allow it.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_ticks_within_its_ends() {
        for (numbers, least) in [(vec![1.0, 2.0], 3), (vec![1e-6, 1e3], 5), (vec![3.0], 2)] {
            let axis = Axis::new(&numbers, [0.0, 100.0]);
            let ticks = axis.ticks();
            assert!(ticks.len() >= least && ticks.len() <= 12, "{numbers:?}: {ticks:?}");
            assert!(ticks.iter().all(|tick| (0.0..=100.0).contains(&axis.at(*tick))));
        }
    }

    #[test]
    fn an_error_of_zero_is_drawn_below_all_others() {
        let [_, top, _, bottom] = AREA;
        let some = Errors::new(&[1e-3, 0.0, 1e-6], 0.0);
        assert!(top < some.at(1e-3) && some.at(1e-3) < some.at(1e-6));
        assert!(some.at(1e-6) < bottom - ZERO_BAND && bottom - ZERO_BAND < some.at(0.0) && some.at(0.0) < bottom);
        assert_eq!(some.ticks()[0], 0.0);
        let none = Errors::new(&[0.0, 0.0], 0.0);
        assert_eq!((none.ticks(), none.at(0.0)), (vec![0.0], some.at(0.0)));
        let floored = Errors::new(&[1e-3, 0.0], 1e-5);
        assert!(!floored.zero && floored.at(0.0) == floored.at(1e-5) && floored.at(0.0) < bottom);
    }

    #[test]
    fn lines_are_wrapped_at_words() {
        assert_eq!(wrapped("one two three", 7), ["one two", "three"]);
    }
}
