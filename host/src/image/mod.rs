//! Complex images, and how far apart two of them are.

use num_complex::Complex32;

/// A complex image, row-major. Row and column meaning is the grid's
/// ([`crate::geometry::ImageGrid`]). A unit scatterer on a pixel reads 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `rows * columns` values.
    pub pixels: Vec<Complex32>,
}
