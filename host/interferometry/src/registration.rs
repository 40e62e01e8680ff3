//! Registration: residual offset of two images, and its removal.
//!
//! An offset of `s` pixels lowers the coherence of images of a flat spectrum of `B` cycles per pixel to `sinc(B s) = sin(pi B s) / (pi B s)`, about
//! `1 - (pi B s)^2 / 6`. At the widest band, `B = 1`, a loss of 1e-3 corresponds to
//!
//! ```text
//! s = sqrt(6e-3) / pi = 0.0247 pixel
//! ```
//!
//! which is [`TOLERANCE_PIXELS`]: smaller offsets are left.
//!
//! The magnitude has twice the band of the image. Where that exceeds the pixel rate, aliasing pulls the estimate of a fraction of a pixel toward a whole pixel: by 0.04 of 0.25 pixel at
//! `B = 0.6`, 0.13 at `B = 0.75`. [`register`] therefore repeats the estimate on the shifted image, each time with a smaller offset and error; 0.02 pixel remain at `B = 0.75`.
//!
//! **Trust.** The correlation of the magnitudes of unrelated images is about Gaussian at each offset, with the variance `1 / n` for `n` independent samples. It exceeds
//! `sqrt(2 ln(N / p) / n)` at any of `N` offsets with a probability below `p` (Chernoff and union bounds). Registration with less is refused at `p = 1e-6`. Speckle of the coherence
//! `D` correlates by about `D^2`, and structure of the scene adds to it.

use num_complex::{Complex32, Complex64};
use subaperture_fft::{forward, inverse};
use subaperture_model::image::Image;
use subaperture_quality::registration::{Offset, offset};

use crate::{Autocorrelation, InterferometryError};

/// Offset per axis that lowers the coherence by up to 1e-3, pixels.
pub const TOLERANCE_PIXELS: f64 = 0.0247;

/// Probability of trusting the offset of unrelated images.
const FALSE_TRUST: f64 = 1e-6;

/// Window over which the pixels per independent sample are counted.
const WINDOW: usize = 5;

/// Estimate the offset of `image` against `reference` in pixels, from the correlation of their magnitudes ([`offset`]): the image shows at `p + offset` the point
/// that the reference shows at `p`.
///
/// # Errors
/// [`InterferometryError::Uncorrelated`] if the correlation could be that of unrelated images, or an error of the sizes.
pub fn trusted_offset(image: &Image, reference: &Image) -> Result<Offset, InterferometryError> {
    let found = offset(image, reference)?;
    let window = [image.rows, image.columns].map(|n| match n {
        n if n.div_ceil(2) >= WINDOW => WINDOW,
        n if n.div_ceil(2) >= 3 => 3,
        _ => 1,
    });
    let looks = Autocorrelation::estimate(reference, window)?.looks(window);
    let offsets = image.pixels.len() as f64;
    let samples = offsets * looks / (window[0] * window[1]) as f64;
    let least = (2.0 * libm::log(offsets / FALSE_TRUST) / samples).sqrt();
    match found.correlation > least {
        true => Ok(found),
        false => Err(InterferometryError::Uncorrelated {
            correlation: found.correlation,
            least,
            rows: found.rows,
            columns: found.columns,
        }),
    }
}

/// Largest number of shifts of a registration.
const MAX_SHIFTS: usize = 6;

/// Correction below which the estimate is not repeated, pixels.
const FINE_PIXELS: f64 = 0.005;

/// Image registered to a reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Registered {
    /// Image on the pixels of the reference.
    pub image: Image,
    /// Offset of the original image, pixels, with the correlation after registration.
    pub offset: Offset,
    /// Whether the offset was removed: it exceeded [`TOLERANCE_PIXELS`] on an axis.
    pub corrected: bool,
}

/// Register an image to a reference by [`shifted`].
///
/// # Errors
/// As [`trusted_offset`].
pub fn register(image: &Image, reference: &Image) -> Result<Registered, InterferometryError> {
    register_by(reference, |offset| {
        Ok(match offset == [0.0; 2] {
            true => image.clone(),
            false => shifted(image, offset),
        })
    })
}

/// Register an image to a reference by a resampler: `at` returns the image at the pixels `p + (rows, columns)`.
///
/// # Errors
/// As [`trusted_offset`], and those of `at`.
pub fn register_by<E: From<InterferometryError>>(
    reference: &Image,
    mut at: impl FnMut([f64; 2]) -> Result<Image, E>,
) -> Result<Registered, E> {
    let mut image = at([0.0; 2])?;
    let mut offset = trusted_offset(&image, reference)?;
    if offset.rows.abs().max(offset.columns.abs()) <= TOLERANCE_PIXELS {
        return Ok(Registered {
            image,
            offset,
            corrected: false,
        });
    }
    for _ in 0..MAX_SHIFTS {
        image = at([offset.rows, offset.columns])?;
        let left = trusted_offset(&image, reference)?;
        offset.correlation = left.correlation;
        if left.rows.abs().max(left.columns.abs()) < FINE_PIXELS {
            break;
        }
        offset.rows += left.rows;
        offset.columns += left.columns;
    }
    Ok(Registered {
        image,
        offset,
        corrected: true,
    })
}

/// Image at the pixels `p + (rows, columns)`, by a phase ramp over each row's and column's spectrum.
///
/// The ramp is exact for periodic images. Its frequencies are taken about the centre of the image's spectrum, so that a carrier that is the same in the whole image
/// is kept up to a constant phase. **Limit** the carrier of a wide scene at short range varies: use this for images whose spectrum
/// stays within one cycle per pixel, and `subaperture::maps::Resampled`, which follows the carrier, for others. Pixels from outside the image, and all within 4 pixels
/// of its border after a fraction of a pixel, are NaN; pixels that are not finite are zeros.
pub fn shifted(image: &Image, by: [f64; 2]) -> Image {
    let (rows, columns) = (image.rows, image.columns);
    let mut pixels: Vec<Complex64> = image
        .pixels
        .iter()
        .map(|z| match z.is_finite() {
            true => Complex64::new(z.re.into(), z.im.into()),
            false => Complex64::ZERO,
        })
        .collect();
    let centres = centres(&pixels, columns);
    let mut line = vec![Complex64::ZERO; columns];
    let shift = Shift::new(columns, by[1], centres[1]);
    for row in 0..rows {
        let at = row * columns..(row + 1) * columns;
        line.copy_from_slice(&pixels[at.clone()]);
        shift.apply(&mut line);
        pixels[at].copy_from_slice(&line);
    }
    let mut line = vec![Complex64::ZERO; rows];
    let shift = Shift::new(rows, by[0], centres[0]);
    for column in 0..columns {
        for row in 0..rows {
            line[row] = pixels[row * columns + column];
        }
        shift.apply(&mut line);
        for row in 0..rows {
            pixels[row * columns + column] = line[row];
        }
    }
    let inside = |i: usize| {
        let at = [i / columns, i % columns];
        (0..2).all(|axis| {
            let reach = match by[axis].fract() == 0.0 {
                true => 0.0,
                false => EDGE_PIXELS,
            };
            let from = at[axis] as f64 + by[axis];
            from >= reach && from <= ([rows, columns][axis] - 1) as f64 - reach
        })
    };
    let value = |(i, z): (usize, &Complex64)| match inside(i) {
        true => Complex32::new(z.re as f32, z.im as f32),
        false => Complex32::new(f32::NAN, f32::NAN),
    };
    Image {
        rows,
        columns,
        pixels: pixels.iter().enumerate().map(value).collect(),
    }
}

/// Distance from the border within which the opposite border leaks in, pixels.
const EDGE_PIXELS: f64 = 4.0;

/// Centre of the spectrum of rows and of columns, cycles per pixel: phase of the autocorrelation at a lag of one pixel.
fn centres(pixels: &[Complex64], columns: usize) -> [f64; 2] {
    let mut sums = [Complex64::ZERO; 2];
    for (i, z) in pixels.iter().enumerate() {
        if i >= columns {
            sums[0] += z * pixels[i - columns].conj();
        }
        if i % columns > 0 {
            sums[1] += z * pixels[i - 1].conj();
        }
    }
    sums.map(|sum| sum.arg() / std::f64::consts::TAU)
}

/// Shift of a line by a phase ramp.
struct Shift {
    ramp: Vec<Complex64>,
}

impl Shift {
    /// Ramp of a line of `n` pixels for a shift by `by`, with frequencies within half a cycle of `centre`.
    fn new(n: usize, by: f64, centre: f64) -> Self {
        let wave = |k: usize| {
            let f = k as f64 / n as f64;
            let f = f - (f - centre).round();
            Complex64::cis(std::f64::consts::TAU * f * by) / n as f64
        };
        Self {
            ramp: (0..n).map(wave).collect(),
        }
    }

    fn apply(&self, line: &mut [Complex64]) {
        forward::<f64>(line.len()).process(line);
        line.iter_mut()
            .zip(&self.ramp)
            .for_each(|(z, wave)| *z *= wave);
        inverse::<f64>(line.len()).process(line);
    }
}
