//! Memory layout of a pulse's samples for decimation.

use num_complex::Complex32;

use crate::lanes::GROUP;

/// Layout of a pulse in four planes: real parts of even samples, real parts of odd samples, and likewise imaginary parts, each zero-padded
/// to a multiple of [`GROUP`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    count: usize,
}

impl Layout {
    /// Layout of `count` samples.
    pub const fn new(count: usize) -> Self {
        Self { count }
    }

    /// Number of samples.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Length of one of the four planes.
    pub const fn half(&self) -> usize {
        self.count.div_ceil(2).next_multiple_of(GROUP)
    }

    /// Length of a pulse, all planes.
    pub const fn values(&self) -> usize {
        4 * self.half()
    }

    /// Store weighted samples in this layout.
    ///
    /// # Panics
    /// If the numbers of samples and weights differ from the layout's, or `row` is shorter than [`Self::values`].
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

    /// Restore consecutive complex samples from a row.
    ///
    /// # Panics
    /// If the row's length is not [`Self::values`], or `samples` is too short.
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
