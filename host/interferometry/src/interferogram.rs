//! Interferogram: multilooked product of two images.
//!
//! ```text
//! gamma = sum a conj(b) / sqrt( sum |a|^2  sum |b|^2 )
//! ```
//!
//! over a boxcar window of `rows x columns` looks that slides by one pixel ([`window_sums`]). The magnitude of `gamma` is the sample coherence, its phase that of the
//! multilooked interferogram `sum a conj(b)`. A linear phase across the window lowers the magnitude by `sinc(f n)` for a fringe rate of `f` cycles per pixel over
//! `n` pixels: keep windows below a quarter of a fringe, for a loss below 10 %.

use num_complex::Complex32;
use subaperture_model::image::Image;
use subaperture_quality::PixelMap;
use subaperture_quality::coherence::window_sums;

use crate::InterferometryError;

/// Multilooked interferogram, normalised to coherence.
#[derive(Clone, Debug, PartialEq)]
pub struct Interferogram {
    /// Rows and columns of the window.
    pub window: [usize; 2],
    /// Complex sample coherence per pixel: magnitude 0 to 1, phase of `image conj(reference)`. NaN where the window leaves the image or contains
    /// a pixel that is not finite, or where an image has no power.
    pub coherence: Image,
    /// Mean power of the window in the stronger of the images, NaN as above.
    pub power: PixelMap,
}

impl Interferogram {
    /// Magnitude of the sample coherence, 0 to 1.
    pub fn magnitude(&self) -> PixelMap {
        self.map(|z| z.norm())
    }

    /// Interferometric phase, radians, -pi to pi.
    pub fn phase(&self) -> PixelMap {
        self.map(|z| z.arg())
    }

    fn map(&self, value: impl Fn(Complex32) -> f32) -> PixelMap {
        PixelMap {
            rows: self.coherence.rows,
            columns: self.coherence.columns,
            values: self.coherence.pixels.iter().map(|&z| value(z)).collect(),
        }
    }
}

/// Form the interferogram of two images of one size with a window of odd numbers of rows and columns, 3 pixels or more in total, not above half of the image.
///
/// Memory is 12 bytes per pixel.
///
/// # Errors
/// [`InterferometryError::Window`], or [`InterferometryError::Pair`] if the sizes differ.
pub fn interferogram(
    image: &Image,
    reference: &Image,
    window: [usize; 2],
) -> Result<Interferogram, InterferometryError> {
    let size = [image.rows, image.columns];
    check_window(window, size)?;
    let pixels = (window[0] * window[1]) as f64;
    let edge = window.map(|n| n / 2);
    let mut coherence = Vec::with_capacity(image.pixels.len());
    let mut power = Vec::with_capacity(image.pixels.len());
    window_sums(image, reference, window, |sums| {
        let at = [coherence.len() / size[1], coherence.len() % size[1]];
        let full = (0..2).all(|i| at[i] >= edge[i] && at[i] + edge[i] < size[i]);
        let (gamma, most) = match sums.filter(|_| full) {
            Some(sums) => {
                let gamma = sums.coherence();
                let gamma = Complex32::new(gamma.re as f32, gamma.im as f32);
                (gamma, (sums.a.max(sums.b) / pixels) as f32)
            }
            None => (Complex32::new(f32::NAN, f32::NAN), f32::NAN),
        };
        coherence.push(gamma);
        power.push(most);
    })?;
    Ok(Interferogram {
        window,
        coherence: Image {
            rows: size[0],
            columns: size[1],
            pixels: coherence,
        },
        power: PixelMap {
            rows: size[0],
            columns: size[1],
            values: power,
        },
    })
}

/// Check that a window has odd sides, 3 pixels or more, and is not above half of the image.
pub(crate) fn check_window(
    [rows, columns]: [usize; 2],
    image: [usize; 2],
) -> Result<(), InterferometryError> {
    let odd = !rows.is_multiple_of(2) && !columns.is_multiple_of(2);
    let fits = rows <= image[0].div_ceil(2) && columns <= image[1].div_ceil(2);
    // Both fit the image, so that their product does not overflow.
    match odd && fits && rows * columns >= 3 {
        true => Ok(()),
        false => Err(InterferometryError::Window {
            rows,
            columns,
            image_rows: image[0],
            image_columns: image[1],
        }),
    }
}
