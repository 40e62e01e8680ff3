//! Window functions for fast time and slow time.
//!
//! **Definition.** Weight `i` of `n` is `w(u)` at the centre of the `i`-th of `n` equal cells,
//! `u = (i + 1/2) / n - 1/2`, divided by the sum of all, so that the weights of any window sum to 1:
//! - rectangular `1`; Hamming `0.54 + 0.46 cos(2 pi u)`;
//! - Taylor `1 + 2 sum_{i=1}^{n_bar-1} F_i cos(2 pi i u)`, coefficients of T. T. Taylor 1955 (Carrara,
//!   Goodman and Majewski, appendix D), with the smallest `n_bar >= 2 A^2 + 1/2`, where
//!   `cosh(pi A) = 10^(side_lobe_db / 20)`.
//!
//! **Cost**: planning only; only the weights are stored. **Accuracy**: computed in float64 and rounded once.
//! `tests/stream/stages.rs` measures the sidelobes.
//!
//! ```
//! use subaperture_core::Window;
//! let mut weights = [0.0; 2];
//! Window::Weights(&[1.0, 3.0]).fill(&mut weights)?;
//! assert_eq!(weights, [0.25, 0.75]);
//! # Ok::<(), subaperture_core::window::WindowError>(())
//! ```

use core::f64::consts::{PI, TAU};
use core::fmt;

/// Window function, or explicit weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Window<'a> {
    /// Uniform weights.
    Rectangular,
    /// Hamming window, first sidelobes near -43 dB.
    Hamming,
    /// Taylor window.
    Taylor {
        /// Sidelobe level below the peak in dB, 15 to 100.
        side_lobe_db: f64,
    },
    /// Explicit weights, one per sample. Their sum must be positive.
    Weights(&'a [f32]),
}

/// Reason why a window cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum WindowError {
    /// The Taylor sidelobe level is outside 15 to 100 dB.
    SideLobe(f64),
    /// The number of explicit weights differs from the number of samples.
    Length {
        /// Number of samples.
        expected: usize,
        /// Number of weights.
        got: usize,
    },
    /// The sum of the weights is zero, negative, infinite or NaN.
    Sum(f64),
}

/// Bound on `n_bar`, which is 31 at 100 dB.
const MAX_COEFFICIENTS: usize = 32;

impl Window<'_> {
    /// Write one weight per sample to `weights`. They sum to 1.
    ///
    /// # Errors
    /// [`WindowError`]; `weights` is then unchanged.
    pub fn fill(&self, weights: &mut [f32]) -> Result<(), WindowError> {
        let n = weights.len();
        let (taylor, orders) = match *self {
            Self::Taylor { side_lobe_db } => taylor_coefficients(side_lobe_db)?,
            _ => ([0.0; MAX_COEFFICIENTS], 0),
        };
        if let Self::Weights(own) = *self
            && own.len() != n
        {
            return Err(WindowError::Length {
                expected: n,
                got: own.len(),
            });
        }
        let weight = |i: usize| {
            let u = (i as f64 + 0.5) / n as f64 - 0.5;
            match *self {
                Self::Rectangular => 1.0,
                Self::Hamming => 0.54 + 0.46 * libm::cos(TAU * u),
                Self::Taylor { .. } => {
                    let terms = taylor.iter().take(orders).zip(1..);
                    terms.fold(1.0, |sum, (f, order)| {
                        sum + 2.0 * f * libm::cos(TAU * f64::from(order) * u)
                    })
                }
                Self::Weights(own) => own.get(i).copied().map_or(0.0, f64::from),
            }
        };
        let sum: f64 = (0..n).map(weight).sum();
        if !(sum > 0.0 && sum.is_finite()) {
            return Err(WindowError::Sum(sum));
        }
        for (i, out) in weights.iter_mut().enumerate() {
            *out = (weight(i) / sum) as f32;
        }
        Ok(())
    }
}

/// Coefficients `F_1 .. F_{n_bar - 1}` and their number.
fn taylor_coefficients(side_lobe_db: f64) -> Result<([f64; MAX_COEFFICIENTS], usize), WindowError> {
    if !(15.0..=100.0).contains(&side_lobe_db) {
        return Err(WindowError::SideLobe(side_lobe_db));
    }
    let a = libm::acosh(libm::pow(10.0, side_lobe_db / 20.0)) / PI;
    let n_bar = libm::ceil(2.0 * a * a + 0.5).max(2.0);
    let zero_scale = n_bar * n_bar / (a * a + (n_bar - 0.5) * (n_bar - 0.5));
    let orders = (1..n_bar as u32).map(f64::from);
    let mut coefficients = [0.0; MAX_COEFFICIENTS];
    for (coefficient, m) in coefficients.iter_mut().zip(orders.clone()) {
        // Zeros of the pattern: moved ones in the numerator, those of the sinc in the denominator.
        let mut f = if m % 2.0 == 1.0 { 0.5 } else { -0.5 };
        for i in orders.clone() {
            f *= 1.0 - m * m / (zero_scale * (a * a + (i - 0.5) * (i - 0.5)));
            if i != m {
                f /= 1.0 - m * m / (i * i);
            }
        }
        *coefficient = f;
    }
    Ok((coefficients, orders.count()))
}

impl fmt::Display for WindowError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SideLobe(db) => {
                write!(
                    f,
                    "Taylor window: expected a sidelobe level of 15 to 100 dB, found {db} dB"
                )
            }
            Self::Length { expected, got } => {
                write!(
                    f,
                    "window weights: expected one per sample ({expected}), found {got}"
                )
            }
            Self::Sum(sum) => write!(
                f,
                "window weights: expected a positive finite sum, found {sum}"
            ),
        }
    }
}

impl core::error::Error for WindowError {}
