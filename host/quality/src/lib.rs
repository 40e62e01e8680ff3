//! Image quality measures: impulse response, region statistics, and comparison of two images.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `quality`.
//!
//! - [`response`] measures a point target: position, resolution (3 dB width), peak and integrated sidelobe ratio (PSLR, ISLR), magnitude and phase;
//!   [`subaperture_model::resolution::theory`] gives the theoretical values and shares no code with the measurement.
//! - [`aperture`] maps the frequencies of an image to its aperture; [`sub_aperture`] computes sub-aperture images.
//! - [`polarisation`] computes the Pauli decomposition.
//! - [`statistics`] computes level, entropy, contrast and sharpness of a region.
//! - [`difference`], [`coherence`] and [`registration`] compare two images;
//!   [`subaperture_model::image::Comparison`] gives the error of a whole image.
//!
//! Powers are `|I|^2` in float64, levels `10 log10` of powers: 0 dB is a unit scatterer. Pixels are
//! counted from 0, row first.
#![forbid(unsafe_code)]

pub mod aperture;
pub mod coherence;
pub mod difference;
pub mod polarisation;
pub mod registration;
pub mod response;
pub mod statistics;
pub mod sub_aperture;
mod transform;

/// Real value per pixel, row-major; NaN where undefined.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelMap {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `rows * columns` values.
    pub values: Vec<f32>,
}

impl PixelMap {
    /// Mean of the finite values; `None` if there are none.
    pub fn mean(&self) -> Option<f64> {
        let there = || self.values.iter().filter(|v| v.is_finite());
        let sum: f64 = there().map(|&v| f64::from(v)).sum();
        let count = there().count();
        (count > 0).then(|| sum / count as f64)
    }
}

/// Error of comparing two images.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PairError {
    /// The images differ in size.
    #[error(
        "expected images of one size, found {0} rows x {1} columns and {2} x {3}; form both on one grid",
        image.0, image.1, other.0, other.1
    )]
    Size {
        /// Rows and columns of the first image.
        image: (usize, usize),
        /// Rows and columns of the second image.
        other: (usize, usize),
    },
    /// An image or a setting does not suit the measure.
    #[error("{0}")]
    Unsuited(String),
}

fn check_sizes(
    a: &subaperture_model::image::Image,
    b: &subaperture_model::image::Image,
) -> Result<(), PairError> {
    let (image, other) = ((a.rows, a.columns), (b.rows, b.columns));
    match image == other && a.pixels.len() == b.pixels.len() {
        true => Ok(()),
        false => Err(PairError::Size { image, other }),
    }
}

fn widen(z: num_complex::Complex32) -> num_complex::Complex64 {
    num_complex::Complex64::new(f64::from(z.re), f64::from(z.im))
}
