//! Keystone transform of one frequency: pulses to Doppler bins without range migration.
//!
//! The Doppler frequency of a scatterer at `f[k]` is `f[k] / f_ref` times its Doppler frequency at `f_ref`. Both
//! implementations align the Doppler axes of all frequencies (Schone 2020, chapter 3 and section 5.1):
//!
//! - [`sinc`]: keystone resampling of slow time by a precomputed matrix, followed by an FFT. Approximate at the
//!   edges of the sub-CPI, and for small `M` only since the matrices have `F M M` weights.
//! - [`chirp_z`]: exact evaluation of the transform at the scaled Doppler frequencies, without a table.

pub mod chirp_z;
pub mod sinc;

/// Keystone implementation with the table it uses, lent by the caller of [`crate::Plan::new`].
#[derive(Debug)]
pub enum KeystoneTable<'a> {
    /// Sinc resampling by matrices of `F M M` weights, [`crate::Shape::sinc_len`].
    Sinc(&'a mut [f32]),
    /// Exact chirp-z transform.
    ChirpZ {
        /// Length of the chirp transform: a power of two, at least `M + D - 1`
        /// ([`crate::Shape::chirp_length`] is the minimum).
        length: usize,
    },
}
