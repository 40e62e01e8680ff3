//! How good an image is: responses of points, statistics of regions, one image against another.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `quality`.
//!
//! - [`response`] measures a point's position, width, side lobes, magnitude and phase; [`subaperture_resolution::theory`] says
//!   what a windowed band should give, and shares no code with the measurement.
//! - [`aperture`] shows an image as parts of its aperture saw it.
//! - [`polarisation`] sets images of several polarisations together.
//! - [`statistics`] gives level, entropy, contrast and sharpness of an image or a part of it.
//! - [`difference`], [`coherence`] and [`registration`] set one image against another, beside
//!   [`subaperture_model::image::Comparison`], which gives the errors of a whole image.
//!
//! Powers are `|I|^2` in float64, levels `10 log10` of them: 0 dB is a unit scatterer. Pixels are
//! counted from 0, row before column.
#![forbid(unsafe_code)]

pub mod aperture;
pub mod coherence;
pub mod difference;
pub mod polarisation;
pub mod registration;
pub mod response;
pub mod statistics;
mod transform;

/// A real value for every pixel of an image, row-major; NaN where there is none.
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
    /// Mean of the values that are there; `None` if none is.
    pub fn mean(&self) -> Option<f64> {
        let there = || self.values.iter().filter(|v| v.is_finite());
        let sum: f64 = there().map(|&v| f64::from(v)).sum();
        let count = there().count();
        (count > 0).then(|| sum / count as f64)
    }
}

/// Why two images cannot be set against each other.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PairError {
    /// Not the same rows and columns.
    #[error(
        "images of different size: {0} rows x {1} columns and {2} x {3}; form both on one grid",
        image.0, image.1, other.0, other.1
    )]
    Size {
        /// Rows and columns of the one.
        image: (usize, usize),
        /// Rows and columns of the other.
        other: (usize, usize),
    },
    /// Not what the measure needs.
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
