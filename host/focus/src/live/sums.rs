//! State of a live image: sums over pulses, the contribution of one pulse, and the stored pulses.

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use crate::Tile;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Pulse;

/// Sums over pulses, and their number.
pub(super) struct Sums {
    pub(super) pixels: Vec<Complex64>,
    /// By pixel, the number of pulses whose recorded delays do not cover it.
    num_uncovering: Vec<u32>,
    /// Exact sum at the compared pixels.
    pub(super) exact: Vec<Complex64>,
    /// Sum of squared weighted samples.
    pub(super) terms: f64,
    /// Sum of squared planned errors.
    pub(super) planned: f64,
    pub(super) count: usize,
}

impl Sums {
    pub(super) fn new(num_pixels: usize, num_sampled: usize) -> Self {
        Self {
            pixels: vec![Complex64::ZERO; num_pixels],
            num_uncovering: vec![0; num_pixels],
            exact: vec![Complex64::ZERO; num_sampled],
            terms: 0.0,
            planned: 0.0,
            count: 0,
        }
    }

    pub(super) fn clear(&mut self) {
        self.pixels.fill(Complex64::ZERO);
        self.num_uncovering.fill(0);
        self.exact.fill(Complex64::ZERO);
        (self.terms, self.planned, self.count) = (0.0, 0.0, 0);
    }

    /// Add the contribution of a pulse, or subtract it where `sign` is -1.
    pub(super) fn add(&mut self, sign: f64, part: &Part) {
        let sums = self.pixels.par_iter_mut().zip(&mut self.num_uncovering);
        let both = sums.zip(&part.tile.pixels);
        both.with_min_len(1 << 12).for_each(|((sum, num), z)| {
            if z.is_nan() {
                *num = num.saturating_add_signed(sign as i32);
            } else {
                *sum += Complex64::new(z.re.into(), z.im.into()) * sign;
            }
        });
        let both = self.exact.iter_mut().zip(&part.exact);
        both.for_each(|(sum, value)| *sum += value * sign);
        self.terms += part.terms * sign;
        self.planned += part.planned * sign;
        self.count = self.count.saturating_add_signed(sign as isize);
    }

    /// Whether every pulse covers a pixel.
    pub(super) fn covers(&self, pixel: usize) -> bool {
        self.num_uncovering[pixel] == 0
    }
}

/// Contribution of one pulse to [`Sums`].
pub(super) struct Part {
    /// Pixels; NaN where the recorded delays of the pulse do not cover them.
    pub(super) tile: Tile,
    pub(super) exact: Vec<Complex64>,
    pub(super) terms: f64,
    pub(super) planned: f64,
}

impl Part {
    pub(super) fn new(grid: &ImageGrid, num_sampled: usize) -> Self {
        Self {
            tile: Tile::whole(grid),
            exact: vec![Complex64::ZERO; num_sampled],
            terms: 0.0,
            planned: 0.0,
        }
    }
}

/// Last pulses, and the sums that will replace those shown.
pub(super) struct Aperture {
    pub(super) ring: Ring,
    pub(super) next: Sums,
    pub(super) falling_out: Part,
}

/// Ring buffer of pulses; the newest overwrites the oldest.
pub(super) struct Ring {
    pub(super) num_pulses: usize,
    pub(super) pulses: Vec<Pulse>,
    pub(super) samples: Vec<Complex32>,
    /// Position of the next pulse: that of the oldest one in a full ring.
    place: usize,
}

impl Ring {
    pub(super) fn new(num_pulses: usize, num_samples: usize) -> Self {
        Self {
            num_pulses,
            pulses: Vec::with_capacity(num_pulses),
            samples: Vec::with_capacity(num_pulses * num_samples),
            place: 0,
        }
    }

    pub(super) fn is_full(&self) -> bool {
        self.pulses.len() == self.num_pulses
    }

    /// Oldest pulse of a full ring.
    pub(super) fn oldest(&self, num_samples: usize) -> (&Pulse, &[Complex32]) {
        let first = self.place * num_samples;
        (
            &self.pulses[self.place],
            &self.samples[first..first + num_samples],
        )
    }

    pub(super) fn keep(&mut self, pulse: &Pulse, samples: &[Complex32]) {
        if self.is_full() {
            let first = self.place * samples.len();
            self.pulses[self.place] = *pulse;
            self.samples[first..first + samples.len()].copy_from_slice(samples);
        } else {
            self.pulses.push(*pulse);
            self.samples.extend_from_slice(samples);
        }
        self.place = (self.place + 1) % self.num_pulses;
    }
}
