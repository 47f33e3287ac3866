//! Text in a picture: the caption in the upper left, the legend of the colour map in the lower left.
//!
//! Guarantees: text is clipped at the picture's border. Limit: whole dots; a phrase is one line.

mod font;

use crate::color::color_map;
use crate::image::Image;

/// Dots from the border, and between letters.
const BORDER: usize = 8;
const SPACE: usize = 1;
/// Dots between phrases of a caption, and of the square that shows a colour.
const BETWEEN: usize = 9;
const SWATCH: usize = 7;
/// Dots of the legend's bar.
const BAR: [usize; 2] = [120, 5];
/// From the top of one line to the next, dots.
const LINE: usize = 12;
/// Fraction of the backdrop that shows through the letters: softer than black on white.
const FAINT: f32 = 0.25;

/// A part of a caption, never broken: a text, and the colour of what it names.
#[derive(PartialEq)]
pub(crate) struct Phrase {
    pub(crate) color: Option<[u8; 3]>,
    pub(crate) text: String,
}

/// Writes the phrases into the upper left, in as many lines as they need.
pub(crate) fn caption(image: &mut Image, phrases: &[Phrase]) {
    let dot = dot_size(image);
    let [mut left, mut top] = [BORDER * dot; 2];
    for Phrase { color, text } in phrases.iter().filter(|phrase| !phrase.text.is_empty()) {
        let swatch = if color.is_some() { SWATCH + 2 * SPACE + 1 } else { 0 };
        let width = (swatch + length(text)) * dot;
        if left > BORDER * dot && left + width + BORDER * dot > image.width() {
            (left, top) = (BORDER * dot, top + LINE * dot);
        }
        if let Some(color) = color {
            fill(image, [left, top], SWATCH * dot, *color);
        }
        write(image, text, [left + swatch * dot, top], dot);
        left += width + BETWEEN * dot;
    }
}

/// Writes a text with its lower right corner at `right`, `bottom`.
pub(crate) fn label(image: &mut Image, text: &str, [right, bottom]: [usize; 2]) {
    let dot = dot_size(image);
    write(image, text, [right.saturating_sub(length(text) * dot), bottom.saturating_sub(7 * dot)], dot);
}

/// A square of one colour.
fn fill(image: &mut Image, [left, top]: [usize; 2], side: usize, color: [u8; 3]) {
    for y in top..(top + side).min(image.height()) {
        image.row_mut(y).iter_mut().skip(left).take(side).for_each(|pixel| *pixel = color);
    }
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
pub(crate) fn dot_size(image: &Image) -> usize {
    (image.height().min(image.width()) / 200).max(1)
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

    fn phrase(text: &str) -> Phrase {
        Phrase { color: None, text: text.into() }
    }

    #[test]
    fn a_caption_shows_colours_and_breaks_between_phrases() {
        let mut image = Image::filled(80, 60, [255; 3]).unwrap();
        let phrases = ["dough", "pin"].map(|text| Phrase { color: Some([200, 100, 0]), text: text.into() });
        caption(&mut image, &phrases);
        let at = |x: usize, y: usize| image.pixels()[y * 80 + x];
        assert_eq!([at(BORDER, BORDER), at(BORDER + SWATCH - 1, BORDER + SWATCH - 1)], [[200, 100, 0]; 2]);
        // The second phrase does not fit beside the first.
        assert_eq!(at(BORDER, BORDER + LINE), [200, 100, 0]);
        assert_eq!(image.pixels().iter().filter(|pixel| **pixel == [200, 100, 0]).count(), 2 * SWATCH * SWATCH);
    }

    #[test]
    fn a_letter_is_drawn_dot_by_dot() {
        let mut image = Image::filled(40, 40, [255; 3]).unwrap();
        caption(&mut image, &[phrase("L")]);
        let dark = |x: usize, y: usize| image.pixels()[y * 40 + x][0] < 255;
        assert!((0..7).all(|row| dark(BORDER, BORDER + row)));
        assert!((0..5).all(|column| dark(BORDER + column, BORDER + 6)));
        assert_eq!(image.pixels().iter().filter(|pixel| pixel[0] < 255).count(), 11);
    }

    #[test]
    fn text_beyond_the_border_is_cut() {
        for [width, height] in [[1, 1], [3, 900], [900, 3], [20, 20]] {
            let mut image = Image::filled(width, height, [255; 3]).unwrap();
            caption(&mut image, &[phrase("a very long name of an output that no picture holds"), phrase("frame 1")]);
            label(&mut image, "wind", [width, height]);
            legend(&mut image, "envelope", [0.0, 1.0]);
        }
    }
}
