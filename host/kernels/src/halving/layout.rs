//! How the samples of a pulse stand.

use num_complex::Complex32;

use crate::lanes::GROUP;

/// How the samples of a pulse stand: real parts of even places, of odd places, and so the imaginary parts, each filled up with zeros
/// to a multiple of [`GROUP`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    count: usize,
}

impl Layout {
    /// Of so many samples.
    pub const fn new(count: usize) -> Self {
        Self { count }
    }

    /// Samples.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Numbers in one of the four planes.
    pub const fn half(&self) -> usize {
        self.count.div_ceil(2).next_multiple_of(GROUP)
    }

    /// Numbers a pulse.
    pub const fn values(&self) -> usize {
        4 * self.half()
    }

    /// Samples times weights, as they stand here, into `row`.
    ///
    /// # Panics
    /// If there are not as many of them, or is no room for [`Self::values`].
    #[inline(always)]
    pub fn spread(&self, samples: &[Complex32], weights: &[f32], weight: f32, row: &mut [f32]) {
        assert!(samples.len() == self.count && row.len() == self.values());
        assert_eq!(samples.len(), weights.len());
        let half = self.half();
        let (re, im) = row.split_at_mut(2 * half);
        let (even_re, odd_re) = re.split_at_mut(half);
        let (even_im, odd_im) = im.split_at_mut(half);
        let pairs = samples.chunks_exact(2).zip(weights.chunks_exact(2));
        let full = samples.len() / 2;
        for (i, (pair, weights)) in pairs.enumerate() {
            let (a, b) = (weights[0] * weight, weights[1] * weight);
            (even_re[i], even_im[i]) = (pair[0].re * a, pair[0].im * a);
            (odd_re[i], odd_im[i]) = (pair[1].re * b, pair[1].im * b);
        }
        for plane in [&mut *even_re, odd_re, &mut *even_im, odd_im] {
            plane[full..].fill(0.0);
        }
        if let (Some(last), true) = (samples.last(), samples.len() % 2 == 1) {
            let a = weights[samples.len() - 1] * weight;
            (even_re[full], even_im[full]) = (last.re * a, last.im * a);
        }
    }

    /// The samples of a row, one after another.
    ///
    /// # Panics
    /// If the row has not [`Self::values`], or there is no room.
    #[inline]
    pub fn gather(&self, row: &[f32], samples: &mut [Complex32]) {
        assert!(samples.len() == self.count && row.len() == self.values());
        let half = self.half();
        let (re, im) = row.split_at(2 * half);
        let (even_re, odd_re) = re.split_at(half);
        let (even_im, odd_im) = im.split_at(half);
        for (i, pair) in samples.chunks_mut(2).enumerate() {
            pair[0] = Complex32::new(even_re[i], even_im[i]);
            if let Some(odd) = pair.get_mut(1) {
                *odd = Complex32::new(odd_re[i], odd_im[i]);
            }
        }
    }
}
