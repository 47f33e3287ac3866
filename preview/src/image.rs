//! Pictures: rows of sRGB bytes, joined side by side or on a contact sheet, and written as PNG.
//!
//! Guarantees: the bytes of a PNG depend only on the picture. Limit: 8 bits per channel, no alpha; at most
//! [`Image::MOST_PIXELS`].

use std::io::Write;

use crate::PreviewError;

/// A picture of at least one pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: usize,
    height: usize,
    rows: Vec<[u8; 3]>,
}

/// Pixels between panels.
const GAP: usize = 4;
/// Between panels, sRGB.
const GAP_COLOR: [u8; 3] = [255; 3];

impl Image {
    /// Largest number of pixels in a picture: 768 MiB of bytes.
    pub const MOST_PIXELS: usize = 1 << 28;

    /// A picture of one colour, sRGB.
    ///
    /// # Errors
    /// If it would have no pixel, or more than [`Image::MOST_PIXELS`].
    pub fn filled(width: usize, height: usize, color: [u8; 3]) -> Result<Self, PreviewError> {
        match width.checked_mul(height) {
            Some(pixels) if (1..=Self::MOST_PIXELS).contains(&pixels) => {
                Ok(Self { width, height, rows: vec![color; pixels] })
            }
            _ => Err(PreviewError::Size { width, height }),
        }
    }

    /// Pixels across.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels down.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels, sRGB, row by row from the upper left.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.rows
    }

    /// Row `y` of pixels, to be drawn into.
    ///
    /// # Panics
    /// If `y` is not below the height.
    pub(crate) fn row_mut(&mut self, y: usize) -> &mut [[u8; 3]] {
        &mut self.rows[y * self.width..(y + 1) * self.width]
    }

    /// Copies `panel` to `left`, `top`; it must fit.
    fn paste(&mut self, panel: &Self, left: usize, top: usize) {
        for (y, row) in panel.rows.chunks(panel.width).enumerate() {
            self.row_mut(top + y)[left..left + panel.width].copy_from_slice(row);
        }
    }

    /// Writes the picture as PNG, 24 bits per pixel, packed as tightly as the encoder can.
    ///
    /// # Errors
    /// If `to` cannot be written.
    pub fn write_png(&self, to: impl Write) -> Result<(), PreviewError> {
        let mut writer = encoder(to, [self.width, self.height]).write_header()?;
        writer.write_image_data(self.rows.as_flattened())?;
        Ok(writer.finish()?)
    }
}

/// An encoder of 24 bits per pixel.
pub(crate) fn encoder<'a, W: Write>(to: W, size: [usize; 2]) -> png::Encoder<'a, W> {
    let size = size.map(|pixels| pixels as u32);
    let mut encoder = png::Encoder::new(to, size[0], size[1]);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(png::Compression::High);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_filter(png::Filter::Adaptive);
    encoder
}

/// Pictures in a row: outputs next to each other. Smaller ones are aligned at the top.
///
/// # Errors
/// Without pictures, or where they are too large together.
pub fn side_by_side(panels: &[Image]) -> Result<Image, PreviewError> {
    contact_sheet(panels, panels.len())
}

/// Pictures in rows of `columns`, for the frames of a sequence. Each gets the space of the largest.
///
/// # Errors
/// Without pictures or columns, or where the sheet would be too large.
pub fn contact_sheet(panels: &[Image], columns: usize) -> Result<Image, PreviewError> {
    if columns == 0 || panels.is_empty() {
        return Err(PreviewError::EmptySheet { panels: panels.len(), columns });
    }
    let columns = columns.min(panels.len());
    let rows = panels.len().div_ceil(columns);
    let largest = |side: fn(&Image) -> usize| panels.iter().map(side).max().unwrap_or(0);
    let (width, height) = (largest(Image::width), largest(Image::height));
    let room = |count: usize, side: usize| count.saturating_mul(side + GAP) - GAP;
    let mut sheet = Image::filled(room(columns, width), room(rows, height), GAP_COLOR)?;
    for (k, panel) in panels.iter().enumerate() {
        sheet.paste(panel, k % columns * (width + GAP), k / columns * (height + GAP));
    }
    Ok(sheet)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient(width: usize, height: usize) -> Image {
        let mut image = Image::filled(width, height, [0; 3]).unwrap();
        for y in 0..height {
            for (x, pixel) in image.row_mut(y).iter_mut().enumerate() {
                *pixel = [x as u8, y as u8, (x * y) as u8];
            }
        }
        image
    }

    fn decoded(bytes: &[u8]) -> Image {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut rows = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rows).unwrap();
        assert_eq!(info.color_type, png::ColorType::Rgb);
        let (width, height) = (info.width as usize, info.height as usize);
        Image { width, height, rows: rows.as_chunks::<3>().0.to_vec() }
    }

    #[test]
    fn a_png_reads_back_as_the_picture() {
        for image in [gradient(70, 33), gradient(3, 2), Image::filled(1, 1, [1, 2, 3]).unwrap()] {
            let mut bytes = Vec::new();
            image.write_png(&mut bytes).unwrap();
            assert_eq!(decoded(&bytes), image);
        }
    }

    #[test]
    fn a_sheet_has_every_panel_at_its_position() {
        let panels = [gradient(5, 4), gradient(3, 2), gradient(5, 4)];
        let sheet = contact_sheet(&panels, 2).unwrap();
        assert_eq!((sheet.width(), sheet.height()), (5 + GAP + 5, 4 + GAP + 4));
        let at = |x: usize, y: usize| sheet.pixels()[y * sheet.width() + x];
        assert_eq!(at(4, 3), [4, 3, 12]);
        assert_eq!(at(5 + GAP + 2, 1), [2, 1, 2]);
        assert_eq!(at(5 + GAP + 3, 0), GAP_COLOR);
        assert_eq!(at(4, 4 + GAP + 3), [4, 3, 12]);
        assert_eq!(side_by_side(&panels).unwrap().width(), 15 + 2 * GAP);
        assert_eq!(contact_sheet(&panels, usize::MAX).unwrap(), side_by_side(&panels).unwrap());
    }

    #[test]
    fn empty_and_too_large_pictures_are_refused() {
        let text = |error: Result<Image, PreviewError>| error.unwrap_err().to_string();
        assert_eq!(text(Image::filled(0, 5, [0; 3])), "the picture is 0 × 5 pixels, expected 1 to 268435456 in all");
        assert!(Image::filled(usize::MAX, 2, [0; 3]).is_err());
        assert_eq!(text(side_by_side(&[])), "a sheet of 0 pictures in 0 columns, expected at least 1 of each");
    }

    #[test]
    fn a_full_disk_is_an_error_not_a_panic() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
                Err(std::io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> std::io::Result<()> {
                Ok(())
            }
        }
        assert!(matches!(gradient(9, 9).write_png(Full), Err(PreviewError::Write(_))));
    }
}
