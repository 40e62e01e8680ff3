//! Synthetic images: impulse responses and noise.

use std::f64::consts::TAU;

use num_complex::{Complex32, Complex64};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::image::Image;
use subaperture::signal::window::Window;

/// A separable response of `n` weighted lines in each dimension, `cell` pixels per cell, with a peak of amplitude `a` at `(row, column)`
/// and a phase of `turn` per pixel: the definition, summed line by line.
pub(crate) struct Made {
    pub(crate) window: Window,
    pub(crate) cell: f64,
    pub(crate) row: f64,
    pub(crate) column: f64,
    pub(crate) turn: [f64; 2],
    pub(crate) amplitude: Complex64,
}

impl Made {
    pub(crate) const LINES: usize = 101;

    pub(crate) fn image(&self, side: usize) -> Image {
        let weights = self.window.weights(Self::LINES);
        let sum: f64 = weights.iter().sum();
        let along = |at: f64, turn: f64| -> Vec<Complex64> {
            (0..side)
                .map(|i| {
                    let x = i as f64 - at;
                    let lines = weights.iter().enumerate().map(|(k, w)| {
                        let line = (k as f64 - 50.0) / Self::LINES as f64 / self.cell;
                        Complex64::cis((TAU * line + turn) * x) * w / sum
                    });
                    lines.sum()
                })
                .collect()
        };
        let down = along(self.row, self.turn[0]);
        let across = along(self.column, self.turn[1]);
        let pixel = |i: usize| self.amplitude * down[i / side] * across[i % side];
        Image {
            rows: side,
            columns: side,
            pixels: (0..side * side).map(|i| narrow(pixel(i))).collect(),
        }
    }
}

fn narrow(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}

/// Complex Gaussian noise of power 1: sums of 12 uniform numbers.
pub(crate) fn noise(side: usize, seed: u64) -> Image {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || {
        let sum: f64 = (0..12)
            .map(|_| f64::from(random.next_u32()) / 2f64.powi(32))
            .sum();
        (sum - 6.0) / 2f64.sqrt()
    };
    Image {
        rows: side,
        columns: side,
        pixels: (0..side * side)
            .map(|_| narrow(Complex64::new(normal(), normal())))
            .collect(),
    }
}
