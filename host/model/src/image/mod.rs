//! Complex images and their comparison.

mod comparison;
mod parts;
mod tiling;

use num_complex::Complex32;

pub use comparison::{Comparison, ComparisonError};
pub use parts::{ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands, blocks, peak_of};
pub use tiling::{Tiling, copy_common};

/// A complex image, row-major. Row and column meaning is the grid's
/// ([`crate::geometry::ImageGrid`]). A unit scatterer on a pixel, seen alike
/// by all pulses, reads 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `rows * columns` values.
    pub pixels: Vec<Complex32>,
}

/// The brightest pixel of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// Its value.
    pub value: Complex32,
}

impl Image {
    /// The pixel of largest magnitude, the first of several; `None` of an image without pixels or
    /// with none but NaN, which never count.
    pub fn peak(&self) -> Option<Peak> {
        let mut best: Option<(usize, f64)> = None;
        for (i, &z) in self.pixels.iter().enumerate() {
            let power = power(z);
            if !power.is_nan() && best.is_none_or(|(_, most)| power > most) {
                best = Some((i, power));
            }
        }
        best.map(|(i, _)| Peak {
            row: i / self.columns,
            column: i % self.columns,
            value: self.pixels[i],
        })
    }
}

/// `|z|^2` in float64, where the square of no float32 overflows or vanishes.
#[inline]
pub fn power(z: Complex32) -> f64 {
    let (re, im) = (f64::from(z.re), f64::from(z.im));
    re * re + im * im
}
