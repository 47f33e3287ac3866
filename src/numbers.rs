//! Formatting of numbers for people and scripts.

/// Six significant digits in the shortest form.
pub fn short(number: f64) -> String {
    let rounded: f64 = format!("{number:.5e}").parse().unwrap_or(number);
    let text = format!("{rounded:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}

/// The f64 with the digits of the shortest decimal of an f32: 0.1 for 0.1, not 0.10000000149.
pub fn decimal(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_six_digits_and_no_trailing_zero() {
        let shown: Vec<String> = [5.0, 1.0 / 3.0, -0.0, 1e-7, 123_456_789.0, 0.1, f64::NAN].map(short).into();
        assert_eq!(shown, ["5", "0.333333", "-0", "1e-7", "123457000", "0.1", "NaN"]);
    }

    #[test]
    fn an_f32_becomes_the_decimal_in_its_file() {
        assert_eq!([0.1, f32::MAX, -0.0].map(decimal), [0.1, 3.402_823_5e38, -0.0]);
    }
}
