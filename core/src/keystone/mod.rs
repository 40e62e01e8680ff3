//! Keystone and Doppler transform of one frequency: pulses to Doppler bins that do not migrate.
//!
//! The Doppler of a scatterer at frequency `f[k]` is `f[k] / f_ref` times its Doppler at `f_ref`.
//! Both forms line the frequencies up (Schone 2020, chapter 3 and section 5.1):
//!
//! - [`sinc`]: slow time is resampled by a matrix computed once, then transformed by an FFT.
//!   Approximate at the sub-CPI's edges; small `M` only, for the matrix has `F M M` weights.
//! - [`chirp_z`]: the transform itself is evaluated at the scaled Doppler, exactly, with no table.

pub mod chirp_z;
pub mod sinc;

/// The form of Keystone and the table it uses, lent by the caller of [`crate::Plan::new`].
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
