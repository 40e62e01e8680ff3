//! Sums of exponentials at arbitrary frequencies on a uniform grid: type-1 non-uniform FFT (NUFFT).
//!
//! ```text
//! z[k] = sum_s v_s exp(+j 2 pi u_s (k - K/2)),    k = 0 .. K - 1
//! ```
//!
//! Each `v_s` is gridded to 8 cells of a grid of `M >= 2 K` cells around `M u_s` with a Kaiser-Bessel kernel
//! ([`subaperture_signal::kaiser_bessel`]). An FFT and a division by the kernel's spectrum give `z`. Frequencies `u`
//! are modulo 1 and wrap around, as the sum itself does.
//!
//! The grid is float32 in two planes, added to a float64 grid before rounding errors accumulate: after at most
//! [`FLUSH`] chunks. With kernel and table the error is -125 dB on random scenes (`tests/simulate/engine.rs`).
//!
//! Cost: 16 multiply-adds per value, and an FFT of `M` cells.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use std::fmt;
use std::sync::Arc;

use num_complex::Complex64;
use subaperture_fft::{Fft, Transforms};

use super::chunk::{LANES, Values};
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Cells per value.
const TAPS: usize = 8;
/// Chunks accumulated in float32.
const FLUSH: usize = 64;

/// NUFFT plan for one number of samples.
pub(super) struct Nufft {
    samples: usize,
    kernel: KaiserBessel,
    inverse: Arc<dyn Fft<f64>>,
    /// `(-1)^(k - K/2) / Phi((k - K/2) / M)`.
    shape: Vec<f64>,
    work: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

/// Grid onto which values are spread.
#[derive(Debug, Default)]
pub(super) struct Grid {
    re: Vec<f32>,
    im: Vec<f32>,
    sum: Vec<Complex64>,
    chunks: usize,
}

impl Nufft {
    pub(super) fn new(samples: usize) -> Self {
        let length = fast_length(2 * samples.max(TAPS));
        let kernel = KaiserBessel::new(TAPS);
        let inverse = Transforms::Portable.inverse(length);
        let middle = (samples / 2) as i64;
        let shape = (0..samples as i64)
            .map(|k| {
                // Positions count from half a turn below zero.
                let sign = if (k - middle) % 2 == 0 { 1.0 } else { -1.0 };
                sign / kernel.spectrum((k - middle) as f64 / length as f64)
            })
            .collect();
        Self {
            samples,
            kernel,
            work: vec![Complex64::ZERO; length],
            scratch: vec![Complex64::ZERO; inverse.get_inplace_scratch_len()],
            inverse,
            shape,
        }
    }

    /// Number of samples, `K`.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// Number of grid cells, `M`.
    pub(super) fn length(&self) -> usize {
        self.work.len()
    }

    /// Add the first `count` values to `grid`.
    pub(super) fn spread(&self, values: &Values, count: usize, grid: &mut Grid) {
        let (re, im) = (&mut grid.re[..], &mut grid.im[..]);
        for i in 0..count.min(LANES) {
            let weights: [f32; TAPS] = self.kernel.weights(values.fraction[i]);
            let (a, b) = (values.re[i], values.im[i]);
            let cell = values.cell[i] as usize;
            for (z, w) in re[cell..cell + TAPS].iter_mut().zip(weights) {
                *z += w * a;
            }
            for (z, w) in im[cell..cell + TAPS].iter_mut().zip(weights) {
                *z += w * b;
            }
        }
        grid.chunks += 1;
        if grid.chunks == FLUSH {
            grid.flush();
        }
    }

    /// Call `out(k, value)` with the samples of the grid, and empty it.
    pub(super) fn finish(&mut self, grid: &mut Grid, mut out: impl FnMut(usize, Complex64)) {
        grid.flush();
        let length = self.length();
        self.work.fill(Complex64::ZERO);
        for (i, z) in grid.sum.iter_mut().enumerate() {
            // The first of the eight cells is three cells before the position.
            self.work[(i + length - (TAPS / 2 - 1)) % length] += std::mem::take(z);
        }
        self.inverse
            .process_with_scratch(&mut self.work, &mut self.scratch);
        for (k, shape) in self.shape.iter().enumerate() {
            let place = (k + length - self.samples / 2) % length;
            out(k, self.work[place] * shape);
        }
    }
}

impl Grid {
    /// Resize to the size for `nufft`, and empty.
    pub(super) fn fit(&mut self, nufft: &Nufft) {
        let cells = nufft.length() + TAPS;
        for plane in [&mut self.re, &mut self.im] {
            plane.clear();
            plane.resize(cells, 0.0);
        }
        self.sum.clear();
        self.sum.resize(cells, Complex64::ZERO);
        self.chunks = 0;
    }

    fn flush(&mut self) {
        for ((sum, re), im) in self.sum.iter_mut().zip(&mut self.re).zip(&mut self.im) {
            *sum += Complex64::new(f64::from(std::mem::take(re)), f64::from(std::mem::take(im)));
        }
        self.chunks = 0;
    }
}

impl fmt::Debug for Nufft {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Nufft")
            .field("samples", &self.samples)
            .field("length", &self.length())
            .finish_non_exhaustive()
    }
}
