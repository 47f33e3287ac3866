//! Frames as fixed-point samples, so that sub-frames are exact and can be keys.

/// A time on the frame axis: a whole number of ticks of 1/5,040 frame, so that all fractions from halves to tenths are
/// exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Frame(i64);

/// Why a string or number is not a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// Not a number.
    #[error("`{0}` is not a frame number")]
    NotANumber(String),
    /// Out of range.
    #[error("frame {0} is out of range; expected a frame within ±{limit}", limit = Frame::LIMIT)]
    TooFar(f64),
    /// Not a whole number of ticks.
    #[error("frame {0} is not a multiple of 1/5040 of a frame; the nearest is {1}")]
    BetweenTicks(f64, f64),
}

impl Frame {
    /// Ticks per frame.
    pub const TICKS: i64 = 5_040;
    /// Largest absolute frame number.
    pub const LIMIT: i64 = 1_000_000_000;

    /// A whole frame.
    pub const fn whole(frame: i64) -> Self {
        Self(frame * Self::TICKS)
    }

    /// Ticks since frame 0.
    pub const fn ticks(self) -> i64 {
        self.0
    }

    /// The frame at `number`.
    ///
    /// # Errors
    /// If it is not finite, out of range, or not a whole number of ticks.
    pub fn exactly(number: f64) -> Result<Self, FrameError> {
        if !number.is_finite() {
            return Err(FrameError::NotANumber(number.to_string()));
        }
        if number.abs() > Self::LIMIT as f64 {
            return Err(FrameError::TooFar(number));
        }
        let nearest = Self((number * Self::TICKS as f64).round() as i64);
        // A decimal such as 0.1 is rounded to binary; a difference of that size is ignored.
        if (nearest.number() - number).abs() > 1e-9 * number.abs().max(1.0) {
            return Err(FrameError::BetweenTicks(number, nearest.number()));
        }
        Ok(nearest)
    }

    /// The frame number.
    pub fn number(self) -> f64 {
        self.0 as f64 / Self::TICKS as f64
    }

    /// The frame number in JSON: an integer if it is whole.
    pub fn to_json(self) -> serde_json::Value {
        if self.is_whole() { self.floor_number().into() } else { self.number().into() }
    }

    /// Seconds since frame 0.
    pub fn seconds(self, fps: f64) -> f64 {
        self.number() / fps
    }

    /// Whether this is a whole frame.
    pub const fn is_whole(self) -> bool {
        self.0 % Self::TICKS == 0
    }

    /// The whole frame at or before this.
    pub const fn floor(self) -> Self {
        Self(self.0.div_euclid(Self::TICKS) * Self::TICKS)
    }

    /// The whole frame number at or before this.
    pub const fn floor_number(self) -> i64 {
        self.0.div_euclid(Self::TICKS)
    }

    /// The whole frame at or after this.
    pub const fn ceil(self) -> Self {
        Self(-(-self.0).div_euclid(Self::TICKS) * Self::TICKS)
    }

    /// This frame plus `frames` whole frames.
    #[must_use]
    pub const fn plus(self, frames: i64) -> Self {
        Self(self.0 + frames * Self::TICKS)
    }

    /// This frame plus `ticks` ticks.
    #[must_use]
    pub const fn plus_ticks(self, ticks: i64) -> Self {
        Self(self.0 + ticks)
    }

    /// The frame in file names: at least four digits, and the fraction after `_` (`0010`, `0010_5`, `-0003`).
    pub fn file_label(self) -> String {
        let sign = if self.0 < 0 { "-" } else { "" };
        let text = format!("{}", self.number().abs());
        match text.split_once('.') {
            Some((whole, fraction)) => format!("{sign}{whole:0>4}_{fraction}"),
            None => format!("{sign}{text:0>4}"),
        }
    }

    /// The frame whose [`Frame::file_label`] this is; `None` for any other text.
    pub fn of_file_label(label: &str) -> Option<Self> {
        let frame: Self = label.replace('_', ".").parse().ok()?;
        (frame.file_label() == label).then_some(frame)
    }
}

impl std::fmt::Display for Frame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.number())
    }
}

impl std::str::FromStr for Frame {
    type Err = FrameError;

    fn from_str(text: &str) -> Result<Self, FrameError> {
        let plain = text.strip_prefix('-').unwrap_or(text);
        let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        let fits = match plain.split_once('.') {
            Some((whole, fraction)) => digits(whole) && digits(fraction),
            None => digits(plain),
        };
        let number = text.parse().ok().filter(|_| fits).ok_or_else(|| FrameError::NotANumber(text.into()))?;
        Self::exactly(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_to_tenths_are_exact() {
        for n in 1..=10 {
            let frame = Frame::exactly(3.0 + 1.0 / f64::from(n)).unwrap();
            assert_eq!((frame.ticks() - Frame::whole(3).ticks()) * i64::from(n), Frame::TICKS, "1/{n}");
        }
    }

    #[test]
    fn floor_and_ceil_round_correctly_below_zero() {
        let at = |x: f64| Frame::exactly(x).unwrap();
        assert_eq!((at(-0.5).floor(), at(-0.5).ceil()), (at(-1.0), at(0.0)));
        assert_eq!((at(2.5).floor(), at(2.5).ceil()), (at(2.0), at(3.0)));
        assert_eq!((at(2.0).floor(), at(2.0).ceil()), (at(2.0), at(2.0)));
    }

    #[test]
    fn file_labels_sort_and_include_the_fraction() {
        let label = |text: &str| text.parse::<Frame>().unwrap().file_label();
        assert_eq!(label("1"), "0001");
        assert_eq!(label("10.5"), "0010_5");
        assert_eq!(label("12345"), "12345");
        assert_eq!(label("-3.25"), "-0003_25");
    }

    #[test]
    fn invalid_frames_are_refused() {
        let error = |text: &str| text.parse::<Frame>().unwrap_err().to_string();
        assert_eq!(error("ten"), "`ten` is not a frame number");
        assert_eq!(error("1e3"), "`1e3` is not a frame number");
        assert_eq!(error(""), "`` is not a frame number");
        assert_eq!(error("inf"), "`inf` is not a frame number");
        assert_eq!(error("2000000000"), "frame 2000000000 is out of range; expected a frame within ±1000000000");
        assert!(
            error("0.0001").starts_with("frame 0.0001 is not a multiple of 1/5040 of a frame; the nearest is 0.000")
        );
    }
}
