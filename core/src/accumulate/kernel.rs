//! Windowed-sinc interpolation kernel for oversampled maps.
//!
//! **Equation.** A map whose signal is limited to the band `|nu| <= 1/4` cycles per bin (`R >= 2F`, `D >= 2M`) is
//! interpolated at `x = n + t`, with integer `n` and `0 <= t < 1`, by `T` taps:
//!
//! ```text
//! value = sum_i h(i - t) map[n + i],   i = 1 - T/2 ..= T/2
//! h(x) = sin(pi x) / (pi x)  I0(beta sqrt(1 - (2x/T)^2)) / I0(beta)
//! ```
//!
//! The window is Kaiser's for a transition band from 1/4 to 3/4 cycles per bin (the first spectral image), with
//! attenuation `A = 7.95 + 2.285 pi T` dB and `beta = 0.1102 (A - 8.7)` (Kaiser 1974). The table holds the weights
//! at `PHASES` values of `t` from 0 to 1, both ends included, and is interpolated linearly.
//!
//! **Accuracy** relative to the amplitude of the interpolated wave: worst case over frequency and `t` in the band,
//! and RMS over both, for 128 phases (`tests/stream/kernel.rs`):
//!
//! | | worst, dB | RMS, dB |
//! |---|---|---|
//! | 6 taps | -42.3 | -53.5 |
//! | 8 taps | -57.0 | -66.9 |
//! | 10 taps | -71.5 | -80.2 |
//! | bilinear, for comparison | -10.7 | -20.2 |
//!
//! Linear interpolation of the table adds at most `(pi / 2)^2 / 8 / (PHASES - 1)^2`, -94 dB at 128 phases. The worst
//! case is at the edge of the band: windowed or more oversampled maps do better. On a bin the value is exact.
//!
//! **Cost**: `4 T PHASES` bytes (4 KiB at 8 taps and 128 phases); `T PHASES` sines and Bessel functions once;
//! `2 T` multiply-adds per position for the weights.

use core::f64::consts::PI;

/// Interpolation kernel of `TAPS` taps (even, at least 2) at `PHASES` tabulated fractions of a bin (at least 2).
///
/// Other parameters do not compile:
/// ```compile_fail
/// let kernel = subaperture_core::accumulate::Kernel::<7, 128>::new();
/// ```
/// ```
/// use subaperture_core::accumulate::Kernel;
/// let kernel = Kernel::<8, 128>::new();
/// assert_eq!(Kernel::<8, 128>::BYTES, 4096);
/// // On a bin the weight is that of the bin alone.
/// assert_eq!(kernel.weights(0.0), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
/// // A constant is preserved within the kernel's error.
/// let sum: f32 = kernel.weights(0.3).iter().sum();
/// assert!((sum - 1.0).abs() < 1e-3);
/// ```
#[derive(Clone, Debug)]
pub struct Kernel<const TAPS: usize, const PHASES: usize> {
    table: [[f32; TAPS]; PHASES],
}

impl<const TAPS: usize, const PHASES: usize> Kernel<TAPS, PHASES> {
    /// Size in bytes.
    pub const BYTES: usize = size_of::<Self>();

    /// Number of taps, an even number.
    pub const TAPS: usize = TAPS;

    /// Number of taps at or before the interpolated position.
    const BEFORE: usize = TAPS / 2;

    /// Compute the table.
    pub fn new() -> Self {
        const {
            assert!(TAPS >= 2 && TAPS.is_multiple_of(2), "TAPS must be even");
            assert!(PHASES >= 2, "PHASES must be at least 2");
        }
        let attenuation_db = 7.95 + 2.285 * PI * TAPS as f64;
        let beta = 0.1102 * (attenuation_db - 8.7);
        let peak = bessel_i0(beta);
        let last = (PHASES - 1) as f64;
        let weight = |phase: usize, tap: usize| {
            let x = (tap as f64 + 1.0 - Self::BEFORE as f64) - phase as f64 / last;
            if x == 0.0 {
                return 1.0;
            }
            if x == libm::floor(x) {
                return 0.0;
            }
            let edge = 2.0 * x / TAPS as f64;
            let window = bessel_i0(beta * libm::sqrt(1.0 - edge * edge)) / peak;
            (window * libm::sin(PI * x) / (PI * x)) as f32
        };
        Self {
            table: core::array::from_fn(|phase| core::array::from_fn(|tap| weight(phase, tap))),
        }
    }

    /// Weights for a position `fraction` of a bin (0 to 1) above bin `n`, for `TAPS` bins from
    /// `n + 1 - TAPS/2`.
    #[inline]
    pub fn weights(&self, fraction: f32) -> [f32; TAPS] {
        let place = fraction * (PHASES - 1) as f32;
        // The cast saturates and maps NaN to 0.
        let lower = (place as usize).min(PHASES - 2);
        let within = place - lower as f32;
        let (Some(lower), Some(upper)) = (self.table.get(lower), self.table.get(lower + 1)) else {
            return [0.0; TAPS];
        };
        core::array::from_fn(|tap| lower[tap] + (upper[tap] - lower[tap]) * within)
    }

    /// First tap and weights for a fractional bin. NaN gives NaN weights.
    #[inline]
    pub(super) fn place(&self, bin: f64) -> (i32, [f32; TAPS]) {
        let lower = libm::floor(bin);
        // Saturates far outside any map.
        let first = (lower as i32).saturating_add(1 - Self::BEFORE as i32);
        (first, self.weights((bin - lower) as f32))
    }
}

impl<const TAPS: usize, const PHASES: usize> Default for Kernel<TAPS, PHASES> {
    fn default() -> Self {
        Self::new()
    }
}

/// Modified Bessel function of the first kind, order 0, by its power series. All terms are positive, so the relative
/// error is that of a few roundings.
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term, mut n) = (1.0, 1.0, 1.0);
    // Terms decrease once n > x/2; the remainder is then below the last term.
    while term > sum * 1e-17 && n < 1000.0 {
        term *= quarter / (n * n);
        sum += term;
        n += 1.0;
    }
    sum
}
