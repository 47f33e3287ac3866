//! Params that trade accuracy for time, as a node declares them: what `convect study` proposes to vary, and the order of
//! convergence it holds a measurement against.

/// In which direction a param becomes more accurate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finer {
    /// Larger numbers are more accurate: steps, points.
    Larger,
    /// Smaller numbers are more accurate: tolerances, cells.
    Smaller,
}

/// Settings of a param worth comparing, coarsest first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trials {
    /// These, as they are written in a graph.
    These(&'static [&'static str]),
    /// The graph's own value times these factors.
    Times(&'static [f64]),
}

/// A param that trades accuracy for time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accuracy {
    /// Its name.
    pub param: &'static str,
    /// Its direction; `None` for words.
    pub finer: Option<Finer>,
    /// Settings to compare.
    pub trials: Trials,
    /// The order of convergence: the error is proportional to the power of that order of the number, or of 1 ÷ the number
    /// where larger is finer. `None` where there is none, or it depends on the scene.
    pub order: Option<f64>,
    /// Another param and a setting of it with which the result is the exact limit of this param.
    pub exact: Option<(&'static str, &'static str)>,
    /// Another param and a setting of it without which this param is not read.
    pub needs: Option<(&'static str, &'static str)>,
}

impl Accuracy {
    /// A param of which larger numbers are more accurate.
    pub const fn larger(param: &'static str, trials: Trials) -> Self {
        Self { param, finer: Some(Finer::Larger), trials, order: None, exact: None, needs: None }
    }

    /// A param of which smaller numbers are more accurate.
    pub const fn smaller(param: &'static str, trials: Trials) -> Self {
        Self { finer: Some(Finer::Smaller), ..Self::larger(param, trials) }
    }

    /// A param of which one of several words is the most accurate: the last.
    pub const fn words(param: &'static str, words: &'static [&'static str]) -> Self {
        Self { finer: None, ..Self::larger(param, Trials::These(words)) }
    }

    /// With an order of convergence.
    #[must_use]
    pub const fn order(mut self, order: f64) -> Self {
        self.order = Some(order);
        self
    }

    /// With a setting of another param that gives the exact limit.
    #[must_use]
    pub const fn exact(mut self, param: &'static str, word: &'static str) -> Self {
        self.exact = Some((param, word));
        self
    }

    /// With a setting of another param without which it is not read.
    #[must_use]
    pub const fn needs(mut self, param: &'static str, word: &'static str) -> Self {
        self.needs = Some((param, word));
        self
    }
}
