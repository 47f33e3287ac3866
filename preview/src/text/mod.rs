//! Text in a picture: the label in the upper left, the legend of the colour map in the lower left.
//!
//! Guarantees: text is clipped at the picture's border. Limit: whole dots, one line.

mod font;

use crate::color::color_map;
use crate::image::Image;

/// Dots from the border, and between letters.
const BORDER: usize = 8;
const SPACE: usize = 1;
/// Dots of the legend's bar.
const BAR: [usize; 2] = [120, 5];
/// From the top of one line to the next, dots.
const LINE: usize = 12;
/// Fraction of the backdrop that shows through the letters: softer than black on white.
const FAINT: f32 = 0.25;

/// Writes `label` into the upper left.
pub(crate) fn label(image: &mut Image, label: &str) {
    let dot = dot_size(image);
    write(image, label, [BORDER * dot; 2], dot);
}

/// Draws a bar of the colour map into the lower left, with the attribute's name over it and the range under it.
pub(crate) fn legend(image: &mut Image, name: &str, [low, high]: [f32; 2]) {
    let dot = dot_size(image);
    let [width, height] = BAR.map(|dots| dots * dot);
    let left = BORDER * dot;
    let Some(top) = image.height().checked_sub((BORDER + LINE - 3) * dot + height) else { return };
    for y in top..top + height {
        let row = image.row_mut(y).iter_mut().skip(left).take(width).enumerate();
        row.for_each(|(x, pixel)| *pixel = color_map((x as f32 + 0.5) / width as f32));
    }
    let (below, above) = (top + height + 3 * dot, top.saturating_sub(LINE * dot));
    let (low, high) = (number(low), number(high));
    let right = (left + width).saturating_sub(length(&high) * dot);
    write(image, name, [left, above], dot);
    write(image, &low, [left, below], dot);
    write(image, &high, [right, below], dot);
}

/// Pixels per dot: text has about the same size relative to any picture.
fn dot_size(image: &Image) -> usize {
    (image.height().min(image.width()) / 300).max(1)
}

/// Width in dots.
fn length(text: &str) -> usize {
    text.chars().map(|character| font::glyph(character).1 + SPACE).sum::<usize>().saturating_sub(SPACE)
}

/// Three significant digits, in the shortest form.
fn number(value: f32) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        return format!("{value:.2e}");
    }
    let decimals = if size >= 100.0 {
        0
    } else if size >= 10.0 {
        1
    } else if size >= 1.0 {
        2
    } else {
        3
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

fn write(image: &mut Image, text: &str, [left, top]: [usize; 2], dot: usize) {
    let mut x = left;
    for character in text.chars() {
        let (rows, width) = font::glyph(character);
        for (row, dots) in rows.enumerate() {
            for (column, _) in dots.char_indices().filter(|(_, mark)| *mark == '#') {
                square(image, [x + column * dot, top + row * dot], dot);
            }
        }
        x += (width + SPACE) * dot;
    }
}

/// A dot: darkens a light backdrop, lightens a dark one.
fn square(image: &mut Image, [left, top]: [usize; 2], side: usize) {
    for y in top..(top + side).min(image.height()) {
        for pixel in image.row_mut(y).iter_mut().skip(left).take(side) {
            let light = pixel.iter().map(|byte| u32::from(*byte)).sum::<u32>() > 3 * 110;
            let ink = if light { 30.0 } else { 245.0 };
            *pixel = pixel.map(|byte| (f32::from(byte) * FAINT + ink * (1.0 - FAINT)) as u8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_three_digits() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-0.25, "-0.25"),
            (std::f32::consts::PI, "3.14"),
            (1234.6, "1235"),
            (50.0, "50"),
            (100.0, "100"),
            (1e-5, "1.00e-5"),
            (f32::MAX, "3.40e38"),
            (f32::NAN, "NaN"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_letter_is_drawn_dot_by_dot() {
        let mut image = Image::filled(40, 40, [255; 3]).unwrap();
        label(&mut image, "L");
        let dark = |x: usize, y: usize| image.pixels()[y * 40 + x][0] < 255;
        assert!((0..7).all(|row| dark(BORDER, BORDER + row)));
        assert!((0..5).all(|column| dark(BORDER + column, BORDER + 6)));
        assert_eq!(image.pixels().iter().filter(|pixel| pixel[0] < 255).count(), 11);
    }

    #[test]
    fn text_beyond_the_border_is_cut() {
        for [width, height] in [[1, 1], [3, 900], [900, 3], [20, 20]] {
            let mut image = Image::filled(width, height, [255; 3]).unwrap();
            label(&mut image, "a very long name of an output that no picture holds");
            legend(&mut image, "envelope", [0.0, 1.0]);
        }
    }
}
