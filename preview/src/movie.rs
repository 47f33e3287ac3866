//! Movies: frames one after another into an animated PNG, which browsers and most viewers play.
//!
//! Guarantees: only one frame is in memory; the bytes depend only on the frames and their times; the first frame is what
//! a viewer without animation shows. Limit: no sound, 8 bits per channel, at most [`Movie::MOST_PIXELS`] in all.

use std::io::Write;

use crate::PreviewError;
use crate::image::{Image, encoder};

/// A movie being written.
pub struct Movie<W: Write> {
    writer: png::Writer<W>,
    size: [usize; 2],
}

impl<W: Write> Movie<W> {
    /// Largest number of pixels in all frames together: 13,000 frames of 640 × 480, which take about a gigabyte.
    pub const MOST_PIXELS: usize = 4_000_000_000;

    /// Starts a movie of exactly `frames` frames, which is played for ever.
    ///
    /// # Errors
    /// If it would have no frame or too many pixels, or `to` cannot be written.
    pub fn start(to: W, width: usize, height: usize, frames: usize) -> Result<Self, PreviewError> {
        check(width, height, frames)?;
        let mut encoder = encoder(to, [width, height]);
        encoder.set_animated(frames as u32, 0)?;
        encoder.validate_sequence(true);
        // Ten times as fast as for pictures, and hardly larger.
        encoder.set_compression(png::Compression::Balanced);
        Ok(Self { writer: encoder.write_header()?, size: [width, height] })
    }

    /// Adds a frame that is shown for `seconds`.
    ///
    /// # Errors
    /// If the frame has another size, or cannot be written.
    pub fn frame(&mut self, image: &Image, seconds: f64) -> Result<(), PreviewError> {
        if [image.width(), image.height()] != self.size {
            return Err(PreviewError::Size { width: image.width(), height: image.height() });
        }
        let [over, under] = delay(seconds);
        self.writer.set_frame_delay(over, under)?;
        Ok(self.writer.write_image_data(image.pixels().as_flattened())?)
    }

    /// Completes the file after the last frame.
    ///
    /// # Errors
    /// If frames are missing, or `to` cannot be written.
    pub fn finish(self) -> Result<(), PreviewError> {
        Ok(self.writer.finish()?)
    }
}

impl Movie<std::io::Sink> {
    /// Whether a movie may have this many frames of this size.
    ///
    /// # Errors
    /// If it would have no frame or too many pixels.
    pub fn check(width: usize, height: usize, frames: usize) -> Result<(), PreviewError> {
        check(width, height, frames)
    }
}

fn check(width: usize, height: usize, frames: usize) -> Result<(), PreviewError> {
    let pixels = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(frames));
    match pixels {
        Some(pixels) if (1..=Movie::<std::io::Sink>::MOST_PIXELS).contains(&pixels) => Ok(()),
        _ => Err(PreviewError::Length { frames, width, height }),
    }
}

/// Seconds as a fraction of 16-bit numbers, as exactly as they allow: 1/24 is 1000/24000.
fn delay(seconds: f64) -> [u16; 2] {
    let rate = 1.0 / seconds;
    if rate.is_nan() || rate <= 0.0 {
        return [1, 24];
    }
    for over in [1000.0, 100.0, 10.0, 1.0] {
        let under = (rate * over).round();
        if (1.0..=65535.0).contains(&under) {
            return [over as u16, under as u16];
        }
    }
    if seconds > 1.0 { [seconds.min(65535.0) as u16, 1] } else { [1, 65535] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn movie(colors: &[[u8; 3]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut movie = Movie::start(&mut bytes, 6, 4, colors.len()).unwrap();
        for color in colors {
            movie.frame(&Image::filled(6, 4, *color).unwrap(), 1.0 / 24.0).unwrap();
        }
        movie.finish().unwrap();
        bytes
    }

    #[test]
    fn frames_read_back_in_order_with_their_times() {
        let colors = [[10, 20, 30], [40, 50, 60], [70, 80, 90]];
        let bytes = movie(&colors);
        assert_eq!(bytes, movie(&colors));
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control.map(|control| control.num_frames), Some(3));
        for color in colors {
            let mut rows = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut rows).unwrap();
            assert_eq!(rows[..3], color);
            let control = reader.info().frame_control.unwrap();
            assert_eq!((control.delay_num, control.delay_den), (1000, 24000));
        }
    }

    #[test]
    fn delays_fit_16_bits() {
        assert_eq!(delay(1001.0 / 24000.0), [1000, 23976]);
        assert_eq!(delay(1.0 / 120.0), [100, 12000]);
        assert_eq!(delay(1e-9), [1, 65535]);
        assert_eq!(delay(5000.0), [5000, 1]);
        assert_eq!(delay(0.0), [1, 65535]);
        assert_eq!(delay(f64::NAN), [1, 24]);
    }

    #[test]
    fn movies_that_are_too_long_or_incomplete_are_refused() {
        let error = Movie::check(640, 480, 1_000_000).unwrap_err().to_string();
        assert_eq!(
            error,
            "the movie is 1000000 frames of 640 × 480 pixels, expected at least 1 frame and at most 4000000000 pixels in all"
        );
        assert!(Movie::check(640, 480, 0).is_err() && Movie::check(usize::MAX, 2, 2).is_err());
        let mut bytes = Vec::new();
        let mut short = Movie::start(&mut bytes, 6, 4, 2).unwrap();
        short.frame(&Image::filled(6, 4, [0; 3]).unwrap(), 1.0).unwrap();
        assert!(short.frame(&Image::filled(5, 4, [0; 3]).unwrap(), 1.0).is_err());
        assert!(short.finish().is_err());
    }
}
