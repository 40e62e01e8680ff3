//! Plans of discrete Fourier transforms ([`rustfft`]), compiled in this package and nowhere else.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation, and of little use without it.
//!
//! rustfft is generic over its numbers: whatever crate makes a plan compiles all kernels for all of the processor's
//! extensions again, 25 s of processor time for float32 and as much for float64, and so does a crate into which a small
//! function that makes one is inlined. Here both are made behind functions that are not inlined.
//!
//! Which algorithm rustfft takes is the processor's to say, and so are the last bits of what comes out: [`Transforms::Portable`] has others,
//! slower, that give the same bits on every machine.
//!
//! Transforms are as rustfft's: without a factor in either direction, `X[k] = sum_n x[n] exp(-j 2 pi k n / N)` forward,
//! the conjugate's sum inverse.
#![forbid(unsafe_code)]

mod portable;

use std::sync::Arc;

pub use rustfft::{Fft, FftDirection};
use rustfft::{FftNum, FftPlanner};

/// The real numbers whose complex pairs are transformed.
pub trait Real: FftNum {
    /// A plan for `length` values, 0 or more.
    fn plan(transforms: Transforms, length: usize, direction: FftDirection) -> Arc<dyn Fft<Self>>;
}

impl Real for f32 {
    #[inline(never)]
    fn plan(transforms: Transforms, length: usize, direction: FftDirection) -> Arc<dyn Fft<Self>> {
        match transforms {
            Transforms::Fastest => FftPlanner::new().plan_fft(length, direction),
            Transforms::Portable => portable::plan(length, direction),
        }
    }
}

impl Real for f64 {
    #[inline(never)]
    fn plan(transforms: Transforms, length: usize, direction: FftDirection) -> Arc<dyn Fft<Self>> {
        match transforms {
            Transforms::Fastest => FftPlanner::new().plan_fft(length, direction),
            Transforms::Portable => portable::plan(length, direction),
        }
    }
}

/// By whose algorithms.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Transforms {
    /// The processor's: AVX, SSE, NEON or none, each with its own last bits.
    #[default]
    Fastest,
    /// The same bits on every machine.
    Portable,
}

impl Transforms {
    /// A plan for `length` values, from time to frequency.
    pub fn forward<T: Real>(self, length: usize) -> Arc<dyn Fft<T>> {
        T::plan(self, length, FftDirection::Forward)
    }

    /// A plan for `length` values, from frequency to time.
    pub fn inverse<T: Real>(self, length: usize) -> Arc<dyn Fft<T>> {
        T::plan(self, length, FftDirection::Inverse)
    }
}

/// The fastest plan for `length` values, from time to frequency.
pub fn forward<T: Real>(length: usize) -> Arc<dyn Fft<T>> {
    Transforms::Fastest.forward(length)
}

/// The fastest plan for `length` values, from frequency to time.
pub fn inverse<T: Real>(length: usize) -> Arc<dyn Fft<T>> {
    Transforms::Fastest.inverse(length)
}
