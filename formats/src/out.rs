//! A buffer that formats numbers and text.
//!
//! Floats are written in the shortest form that reads back as the same f32, always with a `.` or an `e`; integers never
//! contain one. Writes only fill a buffer; [`Out::pour`], called once per row, writes it out when it is full.

use std::io::{self, Write};

/// A buffer in front of a file.
pub(crate) struct Out<'a> {
    sink: &'a mut dyn Write,
    buffer: Vec<u8>,
    float: zmij::Buffer,
    whole: itoa::Buffer,
}

impl<'a> Out<'a> {
    /// Number of bytes from which the buffer is written out.
    const FULL: usize = 1 << 16;

    pub(crate) fn new(sink: &'a mut dyn Write) -> Self {
        let buffer = Vec::with_capacity(Self::FULL + 1024);
        Self { sink, buffer, float: zmij::Buffer::new(), whole: itoa::Buffer::new() }
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    pub(crate) fn bytes(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// A finite number.
    pub(crate) fn float(&mut self, number: f32) {
        self.buffer.extend_from_slice(self.float.format_finite(number).as_bytes());
    }

    /// A finite number, without a fraction if it is whole.
    pub(crate) fn double(&mut self, number: f64) {
        let text = self.float.format_finite(number);
        self.buffer.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes());
    }

    pub(crate) fn whole(&mut self, number: impl itoa::Integer) {
        self.buffer.extend_from_slice(self.whole.format(number).as_bytes());
    }

    /// Writes the buffer out if it is full.
    pub(crate) fn pour(&mut self) -> io::Result<()> {
        if self.buffer.len() >= Self::FULL { self.finish() } else { Ok(()) }
    }

    /// Writes out the rest.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.sink.write_all(&self.buffer)?;
        self.buffer.clear();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_short_and_never_look_like_integers() {
        let text = |x: f32| {
            let mut bytes = Vec::new();
            let mut out = Out::new(&mut bytes);
            out.float(x);
            out.finish().unwrap();
            String::from_utf8(bytes).unwrap()
        };
        for (x, expected) in
            [(0.1, "0.1"), (1.0, "1.0"), (-0.0, "-0.0"), (16_777_216.0, "16777216.0"), (1e-45, "1e-45")]
        {
            assert_eq!(text(x), expected);
        }
        assert_eq!(text(f32::MAX), "3.4028235e+38");
        // Covers all exponents and many fractions with irregular bits.
        for x in (0..u32::MAX).step_by(65_521).map(f32::from_bits).filter(|x| x.is_finite()) {
            let text = text(x);
            assert!(text.contains(['.', 'e']), "{text}");
            assert_eq!(text.parse::<f32>().unwrap().to_bits(), x.to_bits());
        }
    }
}
