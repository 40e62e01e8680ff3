//! Images whose pixels lie on no grid of ours.

use std::fmt::Debug;

use subaperture_model::geometry::Geodetic;

/// Where the pixels of an image are on the Earth, and where its spectrum is, as its own metadata say.
///
/// Rows and columns count from 0 and have fractions; whole numbers are the middles of pixels.
pub trait Lying: Debug + Sync {
    /// Where on the ground there is what a pixel shows; none if it is nowhere.
    fn place(&self, pixel: [f64; 2]) -> Option<Geodetic>;

    /// Row and column that show a place of the ground, whatever its height is said to be. The inverse of [`Self::place`].
    fn pixel(&self, place: &Geodetic) -> Option<[f64; 2]>;

    /// From row to row and from column to column, metres, about.
    fn steps_m(&self) -> [f64; 2];

    /// The middle of the spectrum at a pixel: samples turn by so many cycles a row and a column.
    fn middle(&self, pixel: [f64; 2]) -> [f64; 2];

    /// Its widths, cycles a row and a column.
    fn widths(&self) -> [f64; 2];
}
