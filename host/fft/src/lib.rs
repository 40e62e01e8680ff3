//! FFT plans of [`rustfft`], compiled in this crate only, with an optional portable algorithm.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; not intended for separate use.
//!
//! rustfft is generic over the number type. Every crate that makes a plan compiles all kernels for all instruction-set
//! extensions again, which takes 25 s of processor time each for float32 and float64, and so does a crate into which a
//! small planning function is inlined. Here both are made by functions that are never inlined.
//!
//! rustfft chooses its algorithm by the processor, so that the last bits of its results differ between machines.
//! [`Transforms::Portable`] uses slower algorithms whose results are bit-identical on every machine.
//!
//! Transforms are unnormalised in both directions, as in rustfft: `X[k] = sum_n x[n] exp(-j 2 pi k n / N)` forward, and
//! the sum with the conjugate exponential inverse.
#![forbid(unsafe_code)]

mod portable;

use std::sync::Arc;

pub use rustfft::{Fft, FftDirection};
use rustfft::{FftNum, FftPlanner};

/// Real number type of the transformed complex values: `f32` or `f64`.
pub trait Real: FftNum {
    /// Make a plan for `length` values, 0 or more.
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

/// Choice of FFT algorithms.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Transforms {
    /// Fastest for the processor: AVX, SSE, NEON or scalar code, with differences in the last bits.
    #[default]
    Fastest,
    /// Bit-identical results on every machine; slower.
    Portable,
}

impl Transforms {
    /// Make a plan of a forward transform (time to frequency) of `length` values.
    pub fn forward<T: Real>(self, length: usize) -> Arc<dyn Fft<T>> {
        T::plan(self, length, FftDirection::Forward)
    }

    /// Make a plan of an unnormalised inverse transform (frequency to time) of `length` values.
    pub fn inverse<T: Real>(self, length: usize) -> Arc<dyn Fft<T>> {
        T::plan(self, length, FftDirection::Inverse)
    }
}

/// Make the fastest plan of a forward transform (time to frequency) of `length` values.
pub fn forward<T: Real>(length: usize) -> Arc<dyn Fft<T>> {
    Transforms::Fastest.forward(length)
}

/// Make the fastest plan of an unnormalised inverse transform (frequency to time) of `length` values.
pub fn inverse<T: Real>(length: usize) -> Arc<dyn Fft<T>> {
    Transforms::Fastest.inverse(length)
}
