//! Keystone and Doppler transform of one frequency: pulses to Doppler bins that do not migrate.
//!
//! The Doppler of a scatterer at frequency `f[k]` is `f[k] / f_ref` times its Doppler at `f_ref`.
//! Both forms line the frequencies up (Schone 2020, chapter 3 and section 5.1):
//!
//! - [`sinc`]: slow time is resampled by a matrix computed once, then transformed by an FFT.
//!   Approximate at the sub-CPI's edges; small `M` only, for the matrix has `F M M` weights.
//! - [`chirp_z`]: the transform itself is evaluated at the scaled Doppler, exactly, with no table.
//!
//! Storage for each is a type whose `BYTES` a user can print:
//!
//! ```
//! use subaperture_core::keystone::{ChirpZKeystone, SincKeystone};
//! // 32 pulses, 64 frequencies, 64 Doppler bins.
//! assert_eq!(SincKeystone::<32, 64, 64>::BYTES, 64 * 32 * 32 * 4 + 64 * 8);
//! assert_eq!(ChirpZKeystone::<128>::BYTES, 3 * 128 * 8);
//! ```

pub mod chirp_z;
pub mod sinc;

use num_complex::Complex32;

use crate::fft;

/// The form of Keystone and the table it uses, lent by a caller who plans with slices.
#[derive(Debug)]
pub enum KeystoneTable<'a> {
    /// Resampling by a matrix of `F M M` weights, [`crate::Shape::sinc_len`].
    Sinc(&'a mut [f32]),
    /// Exact, by chirp transforms.
    ChirpZ {
        /// Points of a chirp transform: a power of two, at least `M + D - 1`
        /// ([`crate::Shape::chirp_length`] is the least).
        length: usize,
    },
}

/// Storage of a Keystone form for a sub-CPI of sizes known to the compiler.
///
/// Sealed: [`SincKeystone`] and [`ChirpZKeystone`] are all there are.
pub trait Keystone<const PULSES: usize, const FREQUENCIES: usize, const DOPPLER_BINS: usize>:
    sealed::Sealed + Sized
{
    /// Fails to compile for sizes that do not fit.
    const CHECK: ();
    /// Storage before planning, all zero.
    const EMPTY: Self;

    /// Table to plan with, and scratch to process with.
    fn split(&mut self) -> (KeystoneTable<'_>, &mut [Complex32]);
}

/// Storage of the sinc form: the matrix `[frequency][output pulse][input pulse]` and one Doppler row.
#[derive(Debug)]
pub struct SincKeystone<const PULSES: usize, const FREQUENCIES: usize, const DOPPLER_BINS: usize> {
    matrix: [[[f32; PULSES]; PULSES]; FREQUENCIES],
    row: [Complex32; DOPPLER_BINS],
}

impl<const PULSES: usize, const FREQUENCIES: usize, const DOPPLER_BINS: usize>
    SincKeystone<PULSES, FREQUENCIES, DOPPLER_BINS>
{
    /// Memory: `4 F M M + 8 D` bytes.
    pub const BYTES: usize = size_of::<Self>();
}

impl<const PULSES: usize, const FREQUENCIES: usize, const DOPPLER_BINS: usize>
    Keystone<PULSES, FREQUENCIES, DOPPLER_BINS>
    for SincKeystone<PULSES, FREQUENCIES, DOPPLER_BINS>
{
    const CHECK: () = ();
    const EMPTY: Self = Self {
        matrix: [[[0.0; PULSES]; PULSES]; FREQUENCIES],
        row: [Complex32::ZERO; DOPPLER_BINS],
    };

    fn split(&mut self) -> (KeystoneTable<'_>, &mut [Complex32]) {
        let matrix = self.matrix.as_flattened_mut().as_flattened_mut();
        (KeystoneTable::Sinc(matrix), &mut self.row)
    }
}

/// Storage of the chirp-z form: chirp, kernel and work, each of one transform's `LENGTH`.
#[derive(Debug)]
pub struct ChirpZKeystone<const LENGTH: usize> {
    scratch: [[Complex32; LENGTH]; 3],
}

impl<const LENGTH: usize> ChirpZKeystone<LENGTH> {
    /// Memory: `24 LENGTH` bytes.
    pub const BYTES: usize = size_of::<Self>();
}

impl<const PULSES: usize, const FREQUENCIES: usize, const DOPPLER_BINS: usize, const LENGTH: usize>
    Keystone<PULSES, FREQUENCIES, DOPPLER_BINS> for ChirpZKeystone<LENGTH>
{
    const CHECK: () = assert!(
        fft::supports(LENGTH) && LENGTH + 1 >= PULSES + DOPPLER_BINS,
        "a chirp transform has a power of two of points, at least PULSES + DOPPLER_BINS - 1"
    );
    const EMPTY: Self = Self {
        scratch: [[Complex32::ZERO; LENGTH]; 3],
    };

    fn split(&mut self) -> (KeystoneTable<'_>, &mut [Complex32]) {
        let table = KeystoneTable::ChirpZ { length: LENGTH };
        (table, self.scratch.as_flattened_mut())
    }
}

mod sealed {
    pub trait Sealed {}
    impl<const M: usize, const F: usize, const D: usize> Sealed for super::SincKeystone<M, F, D> {}
    impl<const L: usize> Sealed for super::ChirpZKeystone<L> {}
}
