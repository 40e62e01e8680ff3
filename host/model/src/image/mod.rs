//! Complex images and their comparison.

mod comparison;
mod parts;
mod tiling;

use num_complex::Complex32;

pub use comparison::{Comparison, ComparisonError};
pub use parts::{ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands, blocks, peak_of};
pub use tiling::{Tiling, copy_common};

/// Complex image, row-major. The grid ([`crate::geometry::ImageGrid`]) defines rows and columns. A unit scatterer on
/// a pixel, seen alike by all pulses, has the value 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `rows * columns` values.
    pub pixels: Vec<Complex32>,
}

/// Brightest pixel of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Row index.
    pub row: usize,
    /// Column index.
    pub column: usize,
    /// Value of the pixel.
    pub value: Complex32,
}

impl Image {
    /// Pixel of largest magnitude, the first of several. NaN is ignored; `None` without any other pixel.
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

/// `|z|^2` in float64, which neither overflows nor underflows for float32 values.
#[inline]
pub fn power(z: Complex32) -> f64 {
    let (re, im) = (f64::from(z.re), f64::from(z.im));
    re * re + im * im
}
