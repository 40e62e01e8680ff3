//! Comparison of an image with a reference.

use std::fmt;

use num_complex::{Complex32, Complex64};

use super::{Image, ImageSource, PixelBlock, power};

/// Error of an image `a` against a reference `b` of the same size; sums in float64. A figure that is undefined (for
/// an image or reference of zeros) is `None`. Ratios are in dB of amplitude, `20 log10`; identical images have an
/// error of minus infinity.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Comparison {
    /// Relative RMS error without scaling: `||a - b|| / ||b||`, dB.
    pub error_db: Option<f64>,
    /// Relative RMS error of `s a`, with the complex factor `s = <a, b> / ||a||^2` that minimises it, dB.
    pub scaled_error_db: Option<f64>,
    /// `|s|`, dB; positive if `a` is too weak.
    pub scale_db: Option<f64>,
    /// Phase of `s`, degrees in (-180, 180]; positive if `a` lags.
    pub scale_deg: Option<f64>,
    /// Largest `|arg(a / b)|`, unscaled, over the pixels with `|b|` within 20 dB of its maximum
    /// ([`Comparison::PEAK_SPAN_DB`]), degrees; 180 where `a` is zero.
    pub peak_phase_error_deg: Option<f64>,
    /// `|<a, b>| / (||a|| ||b||)`; 1 if the images differ only by a complex factor.
    pub correlation: Option<f64>,
}

/// Error of comparing two images.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    /// The images differ in rows or columns.
    #[error(
        "images of different size: {0} rows x {1} columns and {2} x {3}; form both on the same grid",
        image.0, image.1, reference.0, reference.1
    )]
    Size {
        /// Rows and columns of the image.
        image: (usize, usize),
        /// Rows and columns of the reference.
        reference: (usize, usize),
    },
    /// A part of an image could not be read.
    #[error("{0}")]
    Unreadable(String),
    /// A pixel is NaN or infinite.
    #[error("the {which} is not finite at row {row}, column {column}")]
    NotFinite {
        /// Name of the image: `image` or `reference`.
        which: &'static str,
        /// Row of the pixel.
        row: usize,
        /// Column of the pixel.
        column: usize,
    },
}

impl Comparison {
    /// Minimum level of a pixel whose phase counts, dB below the reference's peak.
    pub const PEAK_SPAN_DB: f64 = 20.0;

    /// Compare image `a` with the reference `b`.
    ///
    /// # Errors
    /// [`ComparisonError`] if the sizes differ or a pixel is not finite.
    pub fn between(a: &Image, b: &Image) -> Result<Self, ComparisonError> {
        let (image, reference) = ((a.rows, a.columns), (b.rows, b.columns));
        if a.pixels.len() != b.pixels.len() {
            return Err(ComparisonError::Size { image, reference });
        }
        Self::by_parts(a, b)
    }

    /// Like [`Self::between`], for images larger than memory. Both are read twice, in parts.
    ///
    /// # Errors
    /// [`ComparisonError`].
    pub fn by_parts(a: &dyn ImageSource, b: &dyn ImageSource) -> Result<Self, ComparisonError> {
        Ok(Self::over(a, b, false)?.0)
    }

    /// Like [`Self::by_parts`], over the pixels that are not NaN in either image. Also returns their number.
    ///
    /// # Errors
    /// [`ComparisonError`]; infinite pixels are an error.
    pub fn on_common(
        a: &dyn ImageSource,
        b: &dyn ImageSource,
    ) -> Result<(Self, u64), ComparisonError> {
        Self::over(a, b, true)
    }

    /// Comparison over all pixels, which must be finite, or over those that both images have.
    fn over(
        a: &dyn ImageSource,
        b: &dyn ImageSource,
        common: bool,
    ) -> Result<(Self, u64), ComparisonError> {
        let (image, reference) = (a.size(), b.size());
        if image != reference {
            return Err(ComparisonError::Size { image, reference });
        }
        let used = |u: Complex32, v: Complex32| !(common && (u.is_nan() || v.is_nan()));
        let mut count = 0;
        let mut inner = Complex64::ZERO;
        let (mut a_power, mut b_power, mut b_peak, mut difference) = (0.0, 0.0, 0.0f64, 0.0);
        for place in a.places() {
            let (a, b) = read_both(a, b, &place)?;
            check_finite(&a, "image", &place, common)?;
            check_finite(&b, "reference", &place, common)?;
            for (&u, &v) in a
                .pixels
                .iter()
                .zip(&b.pixels)
                .filter(|&(&u, &v)| used(u, v))
            {
                count += 1;
                a_power += power(u);
                b_power += power(v);
                b_peak = b_peak.max(power(v));
                inner += widen(u).conj() * widen(v);
                difference += (widen(u) - widen(v)).norm_sqr();
            }
        }
        let relative_db = |sum: f64| (b_power > 0.0).then(|| 10.0 * (sum / b_power).log10());
        let scale = (a_power > 0.0).then(|| inner / a_power);
        // A zero inner product leaves the phase of the scale undefined.
        let turned = scale.filter(|s| s.norm_sqr() > 0.0);
        let floor = b_peak * 10f64.powf(-Self::PEAK_SPAN_DB / 10.0);
        let (mut scaled, mut peak_phase_error) = (0.0, 0.0f64);
        for place in a.places() {
            let (a, b) = read_both(a, b, &place)?;
            for (&u, &v) in a
                .pixels
                .iter()
                .zip(&b.pixels)
                .filter(|&(&u, &v)| used(u, v))
            {
                scaled += (widen(u) * scale.unwrap_or_default() - widen(v)).norm_sqr();
                if power(v) >= floor {
                    let error = match widen(u) * widen(v).conj() {
                        Complex64::ZERO => std::f64::consts::PI,
                        product => product.arg().abs(),
                    };
                    peak_phase_error = peak_phase_error.max(error);
                }
            }
        }
        let scaled_error_db = scale.and_then(|_| relative_db(scaled));
        let comparison = Self {
            error_db: relative_db(difference),
            scaled_error_db,
            scale_db: turned.map(|s| 20.0 * s.norm().log10()),
            scale_deg: turned.map(|s| s.arg().to_degrees()),
            peak_phase_error_deg: (b_peak > 0.0).then(|| peak_phase_error.to_degrees()),
            correlation: (a_power > 0.0 && b_power > 0.0)
                .then(|| inner.norm() / (a_power * b_power).sqrt()),
        };
        Ok((comparison, count))
    }
}

/// Read a part of both images.
fn read_both(
    a: &dyn ImageSource,
    b: &dyn ImageSource,
    place: &PixelBlock,
) -> Result<(Image, Image), ComparisonError> {
    let read = |image: &dyn ImageSource| {
        let window = image.window(place);
        window.map_err(|error| ComparisonError::Unreadable(error.to_string()))
    };
    Ok((read(a)?, read(b)?))
}

fn widen(z: Complex32) -> Complex64 {
    Complex64::new(f64::from(z.re), f64::from(z.im))
}

fn check_finite(
    image: &Image,
    which: &'static str,
    [rows, columns]: &PixelBlock,
    common: bool,
) -> Result<(), ComparisonError> {
    let fit = |z: &Complex32| z.is_finite() || (common && z.is_nan());
    match image.pixels.iter().position(|z| !fit(z)) {
        None => Ok(()),
        Some(i) => Err(ComparisonError::NotFinite {
            which,
            row: rows.start + i / image.columns,
            column: columns.start + i % image.columns,
        }),
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |value: Option<f64>, digits: usize, unit: &str| match value {
            None => "undefined".to_owned(),
            Some(f64::NEG_INFINITY) => "none".to_owned(),
            Some(value) => format!("{value:.digits$}{unit}"),
        };
        writeln!(
            f,
            "relative RMS error   {}",
            number(self.error_db, 2, " dB")
        )?;
        writeln!(
            f,
            "  after best scale   {} (scale {}, {})",
            number(self.scaled_error_db, 2, " dB"),
            number(self.scale_db, 4, " dB"),
            number(self.scale_deg, 4, " deg"),
        )?;
        writeln!(
            f,
            "peak phase error     {} (pixels within {} dB of the reference's peak)",
            number(self.peak_phase_error_deg, 4, " deg"),
            Self::PEAK_SPAN_DB
        )?;
        write!(
            f,
            "correlation          {}",
            number(self.correlation, 9, "")
        )
    }
}
