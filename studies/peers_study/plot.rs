//! A work-precision plot as plain SVG: a panel for each scene, a line for each method, both axes logarithmic.

use std::fmt::Write as _;

/// The settings of a method: name, milliseconds a frame, error.
pub(crate) struct Line {
    pub(crate) name: &'static str,
    pub(crate) points: Vec<(String, f64, f64)>,
}

/// A scene.
pub(crate) struct Panel {
    pub(crate) title: &'static str,
    /// Distance of our reference from the nearest peer's: errors below it say little.
    pub(crate) floor: f64,
    pub(crate) lines: Vec<Line>,
}

/// Size of a panel with its margins, and of the plot area inside, pixels.
const PANEL: [f64; 2] = [520.0, 400.0];
const INSIDE: [f64; 4] = [64.0, 34.0, 440.0, 310.0];
/// Height of the legend, pixels.
const LEGEND: f64 = 68.0;
/// Errors above this are all alike: the result is useless.
const WORST: f64 = 1.0;
const BEST: f64 = 1e-6;
/// Size of a letter in labels, pixels.
const LETTER: [f64; 2] = [6.0, 11.0];
/// Colour of each line and whether it is dashed; the same in every panel.
const STYLES: [(&str, bool); 8] = [
    ("#c1121f", false),
    ("#f77f00", false),
    ("#e0a100", true),
    ("#003f88", false),
    ("#4895ef", true),
    ("#1b7f4b", false),
    ("#7cb518", true),
    ("#7b2cbf", true),
];

/// A rectangle: left, top, right, bottom.
type Area = [f64; 4];

/// The whole plot.
pub(crate) fn svg(panels: &[Panel]) -> String {
    let columns = panels.len().clamp(1, 2);
    let (width, height) = (PANEL[0] * columns as f64, LEGEND + PANEL[1] * panels.len().div_ceil(columns).max(1) as f64);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fcfcfa\"/>"
    );
    if let Some(first) = panels.first() {
        legend(&mut out, first, width);
    }
    for (at, panel) in panels.iter().enumerate() {
        let (column, row) = (at % columns, at / columns);
        let _ = writeln!(
            out,
            "<g transform=\"translate({} {})\">",
            PANEL[0] * column as f64,
            LEGEND + PANEL[1] * row as f64
        );
        draw(&mut out, panel);
        out.push_str("</g>\n");
    }
    out.push_str("</svg>\n");
    out
}

fn legend(out: &mut String, panel: &Panel, width: f64) {
    let columns = if width > PANEL[0] { 4 } else { 2 };
    let wide = (width - 40.0) / columns as f64;
    let high = (LEGEND - 16.0) / panel.lines.len().div_ceil(columns) as f64;
    for (at, (line, style)) in panel.lines.iter().zip(STYLES).enumerate() {
        let (x, y) = (30.0 + wide * (at % columns) as f64, 20.0 + high * (at / columns) as f64);
        stroke(out, &[[x, y - 4.0], [x + 30.0, y - 4.0]], style);
        mark(out, [x + 15.0, y - 4.0], style);
        let _ = writeln!(out, "<text x=\"{}\" y=\"{y}\">{}</text>", x + 38.0, line.name);
    }
}

fn stroke(out: &mut String, points: &[[f64; 2]], (colour, dashed): (&str, bool)) {
    let dash = if dashed { " stroke-dasharray=\"5 3\"" } else { "" };
    out.push_str("<polyline points=\"");
    points.iter().for_each(|[x, y]| {
        let _ = write!(out, "{x:.1},{y:.1} ");
    });
    let _ = writeln!(out, "\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"{dash}/>");
}

fn mark(out: &mut String, [x, y]: [f64; 2], (colour, dashed): (&str, bool)) {
    let fill = if dashed { "#fcfcfa" } else { colour };
    let _ = writeln!(
        out,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"1.5\"/>"
    );
}

/// Powers of ten that enclose the values.
fn decades(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let logs = values.filter(|value| *value > 0.0).map(libm::log10);
    let [low, high] = logs.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], log| [low.min(log), high.max(log)]);
    if low > high { [0.0, 1.0] } else { [low.floor(), high.ceil().max(low.floor() + 1.0)] }
}

fn draw(out: &mut String, panel: &Panel) {
    let bounded = |error: f64| if error.is_finite() { error.clamp(BEST, WORST) } else { WORST };
    let points = || panel.lines.iter().flat_map(|line| &line.points).filter(|point| point.2 != 0.0);
    let across = decades(points().map(|point| point.1));
    let up = decades(points().map(|point| bounded(point.2)));
    let [left, top, wide, high] = INSIDE;
    let to_pixels = |ms: f64, error: f64| {
        let x = (libm::log10(ms) - across[0]) / (across[1] - across[0]);
        let y = (libm::log10(bounded(error)) - up[0]) / (up[1] - up[0]);
        [left + wide * x, top + high * (1.0 - y)]
    };
    let _ = writeln!(out, "<text x=\"{left}\" y=\"{}\" font-size=\"14\">{}</text>", top - 12.0, panel.title);
    axes(out, across, up);
    if panel.floor > libm::pow(10.0, up[0]) && panel.floor < WORST {
        let y = to_pixels(1.0, panel.floor)[1];
        let _ = writeln!(
            out,
            "<path d=\"M{left} {y:.1}h{wide}\" stroke=\"#888\" stroke-dasharray=\"2 3\"/>\
             <text x=\"{}\" y=\"{:.1}\" font-size=\"9\" fill=\"#666\" text-anchor=\"end\">from our fine limit to the nearest peer's</text>",
            left + wide - 4.0,
            y + 12.0
        );
    }
    let mut taken: Vec<Area> = Vec::new();
    for (line, style) in panel.lines.iter().zip(STYLES) {
        let at: Vec<[f64; 2]> = line.points.iter().map(|point| to_pixels(point.1, point.2)).collect();
        // A line is interrupted where the time falls, that is, where the number of iterations changes.
        at.chunk_by(|a, b| b[0] > a[0]).for_each(|run| stroke(out, run, style));
        for [x, y] in at {
            mark(out, [x, y], style);
            taken.push([x - 4.0, y - 4.0, x + 4.0, y + 4.0]);
        }
    }
    for (line, (colour, _)) in panel.lines.iter().zip(STYLES) {
        for (name, ms, error) in &line.points {
            let Some([x, y]) = room(&mut taken, to_pixels(*ms, *error), name.len()) else { continue };
            // First with a wide outline in the background colour, which covers lines below.
            for around in ["stroke=\"#fcfcfa\" stroke-width=\"3\"", ""] {
                let _ = writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"10\" fill=\"{colour}\" {around}>{name}</text>"
                );
            }
        }
    }
}

fn axes(out: &mut String, across: [f64; 2], up: [f64; 2]) {
    let [left, top, wide, high] = INSIDE;
    let steps = |range: [f64; 2]| (0..=(range[1] - range[0]) as u32).map(move |k| (range[0] + f64::from(k), k));
    for (power, k) in steps(across) {
        let x = left + wide * f64::from(k) / (across[1] - across[0]);
        let _ = writeln!(
            out,
            "<path d=\"M{x:.1} {top}v{high}\" stroke=\"#ddd\"/>\
             <text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\" font-size=\"11\">{}</text>",
            top + high + 16.0,
            libm::pow(10.0, power)
        );
    }
    for (power, k) in steps(up) {
        let y = top + high * (1.0 - f64::from(k) / (up[1] - up[0]));
        let _ = writeln!(
            out,
            "<path d=\"M{left} {y:.1}h{wide}\" stroke=\"#ddd\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"11\">1e{power}</text>",
            left - 6.0,
            y + 4.0
        );
    }
    let _ = writeln!(
        out,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{high}\" fill=\"none\" stroke=\"#999\"/>\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">ms a frame, one thread</text>\
         <text transform=\"translate(16 {}) rotate(-90)\" text-anchor=\"middle\">error ÷ body size</text>",
        left + 0.5 * wide,
        top + high + 36.0,
        top + 0.5 * high
    );
}

/// A free position for a label beside a point, if there is one.
fn room(taken: &mut Vec<Area>, [x, y]: [f64; 2], letters: usize) -> Option<[f64; 2]> {
    /// Factor on the distance of labels from the point, for a second attempt.
    const FAR: f64 = 1.3;
    let [left, top, inner_wide, inner_high] = INSIDE;
    let (wide, high) = (LETTER[0] * letters as f64, LETTER[1]);
    let sides = [
        [6.0, 3.0],
        [-0.5 * wide, -6.0],
        [-0.5 * wide, 14.0],
        [-6.0 - wide, 3.0],
        [5.0, -5.0],
        [5.0, 12.0],
        [-5.0 - wide, -5.0],
        [-5.0 - wide, 12.0],
    ];
    let far = sides.iter().map(|[dx, dy]| [dx * FAR, dy * FAR]);
    sides.iter().copied().chain(far).map(|[dx, dy]| [x + dx, y + dy]).find(|[x, y]| {
        let own = [*x, y - high + 2.0, x + wide, y + 2.0];
        let inside = own[0] > left && own[1] > top && own[2] < left + inner_wide && own[3] < top + inner_high;
        let free = taken.iter().all(|a| own[2] < a[0] || a[2] < own[0] || own[3] < a[1] || a[3] < own[1]);
        if inside && free {
            taken.push(own);
        }
        inside && free
    })
}
