//! Projection model of images from other software.

use std::fmt::Debug;

use subaperture_model::geometry::Geodetic;

/// Ground projection and spectrum of an image, from its own metadata (such as SICD).
///
/// Rows and columns are fractional and count from 0; whole numbers are pixel centres.
pub trait ProjectionModel: Debug + Sync {
    /// Image to ground: position that a pixel shows; `None` if its range and Doppler do not intersect the ground.
    fn place(&self, pixel: [f64; 2]) -> Option<Geodetic>;

    /// Ground to image: row and column that show a position, evaluated on the projection's own surface. The inverse of [`Self::place`].
    fn pixel(&self, place: &Geodetic) -> Option<[f64; 2]>;

    /// Approximate row and column spacing, metres.
    fn steps_m(&self) -> [f64; 2];

    /// Centre of the spectrum at a pixel, cycles per row and per column.
    fn middle(&self, pixel: [f64; 2]) -> [f64; 2];

    /// Bandwidth, cycles per row and per column.
    fn widths(&self) -> [f64; 2];
}
