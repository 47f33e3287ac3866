//! A number for all rows, scaled row by row where there is a mask: what an artist writes as a param with an attribute, and what
//! kernels take.

/// `value` times `mask` at each row; without a mask, `value` everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masked<'a, T> {
    /// The number where nothing masks it.
    pub value: T,
    /// Factors, one a row (a CV, a particle).
    pub mask: Option<&'a [f32]>,
}

impl<'a, T> Masked<'a, T> {
    /// The same number for every row.
    pub const fn uniform(value: T) -> Self {
        Self { value, mask: None }
    }

    /// Another number with the same mask.
    pub fn map<U>(self, f: impl FnOnce(T) -> U) -> Masked<'a, U> {
        Masked { value: f(self.value), mask: self.mask }
    }

    /// The factor at a row: 1 without a mask.
    ///
    /// # Panics
    /// Where the mask has no such row.
    #[inline(always)]
    pub fn factor(&self, row: usize) -> f32 {
        self.mask.map_or(1.0, |mask| mask[row])
    }
}

impl<T> From<T> for Masked<'_, T> {
    fn from(value: T) -> Self {
        Self::uniform(value)
    }
}

impl Masked<'_, f32> {
    /// The number at a row.
    ///
    /// # Panics
    /// Where the mask has no such row.
    #[inline(always)]
    pub fn at(&self, row: usize) -> f32 {
        self.value * self.factor(row)
    }
}

impl Masked<'_, f64> {
    /// The number at a row.
    ///
    /// # Panics
    /// Where the mask has no such row.
    #[inline(always)]
    pub fn at(&self, row: usize) -> f64 {
        self.value * f64::from(self.factor(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mask_scales_row_by_row() {
        let masked = Masked { value: 0.5_f32, mask: Some(&[0.0, 1.0, -2.0]) };
        assert_eq!([0, 1, 2].map(|row| masked.at(row)), [0.0, 0.5, -1.0]);
        assert_eq!(Masked::uniform(0.5_f32).at(7), 0.5);
        assert_eq!([0, 1, 2].map(|row| masked.map(f64::from).at(row)), [0.0, 0.5, -1.0]);
        assert_eq!(masked.map(f64::from).value, 0.5_f64);
    }
}
