//! Memory layout of a pulse's samples for decimation.

use num_complex::Complex32;

use crate::lanes::GROUP;

/// Layout of a pulse for decimation by a factor `M` of two or three: one plane of real parts for each phase `k mod M` of the sample index,
/// and likewise of imaginary parts, each zero-padded to a multiple of [`GROUP`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    count: usize,
    factor: usize,
}

impl Layout {
    /// Layout of `count` samples for decimation by `factor`.
    ///
    /// # Panics
    /// If the factor is neither 2 nor 3.
    pub const fn new(count: usize, factor: usize) -> Self {
        assert!(factor == 2 || factor == 3);
        Self { count, factor }
    }

    /// Number of samples.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Decimation factor, which is the number of planes of real parts.
    pub const fn factor(&self) -> usize {
        self.factor
    }

    /// Length of one plane.
    pub const fn plane(&self) -> usize {
        self.count.div_ceil(self.factor).next_multiple_of(GROUP)
    }

    /// Length of a pulse, all planes.
    pub const fn values(&self) -> usize {
        2 * self.factor * self.plane()
    }

    /// Store weighted samples in this layout.
    ///
    /// # Panics
    /// If the numbers of samples and weights differ from the layout's, or `row` is shorter than [`Self::values`].
    #[inline(always)]
    pub fn spread(&self, samples: &[Complex32], weights: &[f32], weight: f32, row: &mut [f32]) {
        match self.factor {
            2 => self.spread_by::<2>(samples, weights, weight, row),
            _ => self.spread_by::<3>(samples, weights, weight, row),
        }
    }

    #[inline(always)]
    fn spread_by<const M: usize>(
        &self,
        samples: &[Complex32],
        weights: &[f32],
        weight: f32,
        row: &mut [f32],
    ) {
        assert!(samples.len() == self.count && row.len() == self.values());
        assert_eq!(samples.len(), weights.len());
        let (length, full) = (self.plane(), self.count / M);
        let mut planes = row.chunks_exact_mut(length);
        let mut re: [&mut [f32]; M] = std::array::from_fn(|_| planes.next().expect("2 M planes"));
        let mut im: [&mut [f32]; M] = std::array::from_fn(|_| planes.next().expect("2 M planes"));
        let (samples, last) = samples.as_chunks::<M>();
        let (weights, last_weights) = weights.as_chunks::<M>();
        for (i, (z, w)) in samples.iter().zip(weights).enumerate() {
            for phase in 0..M {
                let w = w[phase] * weight;
                (re[phase][i], im[phase][i]) = (z[phase].re * w, z[phase].im * w);
            }
        }
        for plane in re.iter_mut().chain(&mut im) {
            plane[full..].fill(0.0);
        }
        for (phase, (z, w)) in last.iter().zip(last_weights).enumerate() {
            let w = w * weight;
            (re[phase][full], im[phase][full]) = (z.re * w, z.im * w);
        }
    }

    /// Restore consecutive complex samples from a row.
    ///
    /// # Panics
    /// If the row's length is not [`Self::values`], or `samples` is too short.
    #[inline]
    pub fn gather(&self, row: &[f32], samples: &mut [Complex32]) {
        assert!(samples.len() == self.count && row.len() == self.values());
        let length = self.plane();
        let (re, im) = row.split_at(self.factor * length);
        for (i, part) in samples.chunks_mut(self.factor).enumerate() {
            for (phase, sample) in part.iter_mut().enumerate() {
                let at = phase * length + i;
                *sample = Complex32::new(re[at], im[at]);
            }
        }
    }
}
