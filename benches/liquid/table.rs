//! A table of measured figures, each with the largest asked for.

use std::fmt;

struct Row {
    what: String,
    value: f64,
    most: Option<f64>,
    unit: &'static str,
    /// What the figure came from.
    beside: String,
}

impl Row {
    fn is_met(&self) -> bool {
        self.most.is_none_or(|most| self.value <= most)
    }
}

/// The figures in the order in which they were measured.
#[derive(Default)]
pub(crate) struct Table(Vec<Row>);

impl Table {
    /// Adds a figure that should be at most `most`, or that nothing is asked of; prints it, so that a long run can be followed.
    pub(crate) fn add(
        &mut self,
        what: impl Into<String>,
        value: f64,
        most: Option<f64>,
        unit: &'static str,
        beside: impl Into<String>,
    ) {
        let row = Row { what: what.into(), value, most, unit, beside: beside.into() };
        println!("{row}");
        self.0.push(row);
    }

    /// Whether no figure is above what is asked.
    pub(crate) fn is_met(&self) -> bool {
        self.0.iter().all(Row::is_met)
    }
}

/// Three digits, or an exponent.
fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        size if size < 1e-2 => format!("{x:.1e}"),
        size if size < 10.0 => format!("{x:.2}"),
        size if size < 100.0 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, value, most, unit, beside } = self;
        let most = most.map_or(String::new(), number);
        let verdict = match (most.is_empty(), self.is_met()) {
            (true, _) => "",
            (false, true) => "met",
            (false, false) => "MISSED",
        };
        write!(f, "| {what} | {}{unit} | {most} | {verdict} | {beside} |", number(*value))
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| | measured | at most | | |\n|---|---|---|---|---|")?;
        self.0.iter().try_for_each(|row| writeln!(f, "{row}"))
    }
}
