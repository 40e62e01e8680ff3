//! Parts of interpolation kernels: Kaiser window, and weight table.

use std::f64::consts::PI;

use super::polynomial::through;
use super::window::bessel_i0;

/// Terms of the even part of a weight, and of its odd part.
pub const TERMS: usize = 4;

/// Rows of a weight table per sample of distance.
const STEPS: usize = 512;

/// Kaiser window `I0(beta sqrt(1 - (2 t / W)^2)) / I0(beta)` for `|t| < W / 2`, with a width of `W` samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct KaiserWindow {
    width: f64,
    beta: f64,
    peak: f64,
}

impl KaiserWindow {
    #[inline]
    pub(super) fn new(taps: usize, beta: f64) -> Self {
        Self {
            width: taps as f64,
            beta,
            peak: bessel_i0(beta),
        }
    }

    /// Value at `t` samples from the middle.
    #[inline]
    pub(super) fn at(&self, t: f64) -> f64 {
        let u = 2.0 * t / self.width;
        let inside = 1.0 - u * u;
        if inside < 0.0 {
            0.0
        } else {
            bessel_i0(self.beta * inside.sqrt()) / self.peak
        }
    }

    /// Spectrum at `x` cycles per sample: `W sinh(sqrt(beta^2 - (pi W x)^2)) / (I0(beta) sqrt(beta^2 - (pi W x)^2))`.
    #[inline]
    pub(super) fn spectrum(&self, x: f64) -> f64 {
        let inside = self.beta * self.beta - (PI * self.width * x).powi(2);
        let root = inside.abs().sqrt();
        let shape = if root < 1e-9 {
            1.0
        } else if inside > 0.0 {
            libm::sinh(root) / root
        } else {
            libm::sin(root) / root
        };
        self.width * shape / self.peak
    }
}

/// Table of a kernel's weights at positions between samples, linearly interpolated.
#[derive(Clone, Debug)]
pub(super) struct WeightTable {
    taps: usize,
    /// `STEPS + 1` rows of `taps` weights, for fractions 0 to 1.
    rows: Vec<f32>,
}

impl WeightTable {
    /// Tabulate a kernel with the value `at(t)` at a distance of `t` samples.
    #[inline]
    pub(super) fn new(taps: usize, at: impl Fn(f64) -> f64) -> Self {
        let half = taps as f64 / 2.0;
        let rows = (0..=STEPS)
            .flat_map(|row| {
                let fraction = row as f64 / STEPS as f64;
                (0..taps).map(move |i| fraction + half - 1.0 - i as f64)
            })
            .map(|t| at(t) as f32)
            .collect();
        Self { taps, rows }
    }

    /// Weights of the `W` samples around a position: with `t = whole + fraction`, sample `whole - W/2 + 1 + i` has
    /// weight `i`.
    #[inline(always)]
    pub(super) fn weights<const W: usize>(&self, fraction: f32) -> [f32; W] {
        debug_assert_eq!(W, self.taps);
        let place = fraction * STEPS as f32;
        let row = (place as usize).min(STEPS - 1);
        let t = place - row as f32;
        let rows = &self.rows[row * W..(row + 2) * W];
        // Indexed loop: a closure passed to an array function would not be compiled with the caller's instruction set.
        let mut weights = [0.0; W];
        for (i, weight) in weights.iter_mut().enumerate() {
            *weight = rows[i] + (rows[W + i] - rows[i]) * t;
        }
        weights
    }
}

/// Even part of a function over half a sample to either side, and its odd part divided by `u`, as polynomials in `u^2`
/// through Chebyshev nodes.
pub(super) fn even_and_odd(of: impl Fn(f64) -> f64) -> [[f32; TERMS]; 2] {
    let mut squares = [0.0; TERMS];
    let mut values = [[0.0; TERMS]; 2];
    for (k, square) in squares.iter_mut().enumerate() {
        let u = 0.5 * libm::cos(PI * (k as f64 + 0.5) / (2 * TERMS) as f64);
        let (after, before) = (of(u), of(-u));
        *square = u * u;
        values[0][k] = (after + before) / 2.0;
        values[1][k] = (after - before) / (2.0 * u);
    }
    values.map(|values| through(squares, values).map(|x| x as f32))
}
