//! Remap of image magnitude to 8-bit grey.

use subaperture_model::image::{ImageSource, power};

use crate::MapError;

/// Remap from magnitude to grey.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Remap {
    /// Linear in decibels. Upper level: the image's peak unless given. Lower level: 6 dB below the median, which gives a dynamic range limited to 40 to 60 dB.
    /// Default.
    #[default]
    Decibels,
    /// Logarithmic about the mean magnitude `m` (NGA Density remap, parameters 30 and 40 as in sarpy): 0.8 `m` maps to 30 of 255, 40 times that
    /// to white. Bright points do not darken the rest. Zeros are excluded from the mean.
    Density,
}

/// Levels of black and white, dB of magnitude (0 dB: a unit scatterer).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Level of the darkest grey, dB.
    pub bottom_db: f64,
    /// Level of the brightest grey, dB.
    pub top_db: f64,
}

/// Density: grey of the lower limit, of 255.
const DENSITY_GREY: f64 = 30.0;
/// Density: lower limit over the mean.
const DENSITY_LOW: f64 = 0.8;
/// Density: upper limit over the lower limit.
const DENSITY_SPAN: f64 = 40.0;

/// Histogram bins of 0.1 dB, from [`LOWEST_DB`] on.
const CELLS: usize = 8000;
const LOWEST_DB: f64 = -400.0;

impl Levels {
    /// Levels of an image, which is read once. `top_db` and `span_db` (dynamic range) replace the automatic values.
    ///
    /// # Errors
    /// [`MapError::Empty`] if no pixel is finite and non-zero; [`MapError::ImageSource`] if the image cannot be read.
    pub fn of(
        pixels: &dyn ImageSource,
        remap: Remap,
        top_db: Option<f64>,
        span_db: Option<f64>,
    ) -> Result<Self, MapError> {
        let given = |levels: Self| {
            let top_db = top_db.unwrap_or(levels.top_db);
            Self {
                top_db,
                bottom_db: top_db - span_db.unwrap_or(levels.top_db - levels.bottom_db),
            }
        };
        let (mut peak, mut sum, mut count) = (0.0f64, 0.0, 0u64);
        let mut histogram = vec![0u64; CELLS];
        for place in pixels.places() {
            let window = pixels.window(&place).map_err(MapError::ImageSource)?;
            for &z in &window.pixels {
                let power = power(z);
                if power.is_finite() && power > 0.0 {
                    peak = peak.max(power);
                    sum += power.sqrt();
                    count += 1;
                    let cell = (10.0 * libm::log10(power) - LOWEST_DB) * 10.0;
                    histogram[(cell.max(0.0) as usize).min(CELLS - 1)] += 1;
                }
            }
        }
        if count == 0 {
            return Err(MapError::Empty);
        }
        Ok(given(match remap {
            Remap::Density => {
                let low_db = 20.0 * libm::log10(DENSITY_LOW * sum / count as f64);
                let span_db = 20.0 * libm::log10(DENSITY_SPAN);
                Self {
                    bottom_db: low_db - span_db * DENSITY_GREY / (255.0 - DENSITY_GREY),
                    top_db: low_db + span_db,
                }
            }
            Remap::Decibels => {
                let mut before = 0;
                let middle = histogram.iter().position(|&cell| {
                    before += cell;
                    2 * before >= count
                });
                let median_db = LOWEST_DB + (middle.unwrap_or(0) as f64 + 0.5) / 10.0;
                let top_db = (10.0 * libm::log10(peak)).ceil();
                let span_db = (top_db - (median_db - 6.0).floor()).clamp(40.0, 60.0);
                Self {
                    bottom_db: top_db - span_db,
                    top_db,
                }
            }
        }))
    }

    /// Position of a power between black (0) and white (1); NaN for NaN.
    pub(crate) fn part(&self, power: f32) -> f64 {
        let db = 10.0 * libm::log10(f64::from(power));
        ((db - self.bottom_db) / (self.top_db - self.bottom_db)).clamp(0.0, 1.0)
    }

    /// Grey from 1 to 255; 0 is no data.
    pub(crate) fn marked(&self, power: f32) -> u8 {
        match power.is_finite() {
            true => (1.5 + 254.0 * self.part(power)) as u8,
            false => 0,
        }
    }

    /// Scale and offset that convert such a grey to decibels.
    pub(crate) fn decibels(&self) -> [f64; 2] {
        let step = (self.top_db - self.bottom_db) / 254.0;
        [step, self.bottom_db - step]
    }

    /// Grey of a power, 0 to 255; 0 for NaN.
    pub fn grey(&self, power: f32) -> u8 {
        self.grey_alpha(power)[0]
    }

    /// Grey and alpha of a power.
    pub(crate) fn grey_alpha(&self, power: f32) -> [u8; 2] {
        match power.is_finite() {
            true => [(0.5 + 255.0 * self.part(power)) as u8, 255],
            false => [0, 0],
        }
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex32;

    use subaperture_model::image::Image;

    use super::*;

    fn image(amplitudes: &[f32]) -> Image {
        Image {
            rows: 1,
            columns: amplitudes.len(),
            pixels: amplitudes.iter().map(|&a| Complex32::new(0.0, a)).collect(),
        }
    }

    #[test]
    fn density_remap_agrees_with_sarpy_formula() {
        let amplitudes = [0.25f32, 1.0, 2.0, 0.5, 30.0, 0.015625];
        let levels = Levels::of(&image(&amplitudes), Remap::Density, None, None).unwrap();
        let mean = amplitudes.iter().sum::<f32>() / 6.0;
        let slope = 225.0 / 40f32.log10();
        for amplitude in amplitudes {
            let grey = slope * (amplitude / (0.8 * mean)).log10() + 30.0;
            let [got, alpha] = levels.grey_alpha(amplitude * amplitude);
            // sarpy truncates, this rounds.
            assert!(
                (f32::from(got) - grey.clamp(0.0, 255.0)).abs() <= 0.51,
                "{got} {grey}"
            );
            assert_eq!(alpha, 255);
        }
        assert_eq!(levels.grey_alpha(f32::NAN), [0, 0]);
    }

    #[test]
    fn decibel_levels_span_from_peak_to_below_median() {
        let levels = |amplitudes: &[f32], top, span| {
            let levels = Levels::of(&image(amplitudes), Remap::Decibels, top, span);
            levels.map(|levels| [levels.bottom_db, levels.top_db])
        };
        // A peak of 19.08 dB and a median of -26.02 dB: to -33 dB, 53 dB in all.
        let some = [9.0f32, 0.05, 0.05, 0.02, 0.1];
        assert_eq!(levels(&some, None, None).unwrap(), [-33.0, 20.0]);
        assert_eq!(levels(&[1.0; 4], None, None).unwrap(), [-40.0, 0.0]);
        assert_eq!(levels(&some, Some(5.0), Some(30.0)).unwrap(), [-25.0, 5.0]);
        for values in [&[0.0f32, f32::NAN][..], &[f32::INFINITY]] {
            assert!(matches!(levels(values, None, None), Err(MapError::Empty)));
        }
    }

    #[test]
    fn grey_scale_and_offset_recover_decibels() {
        let levels = Levels {
            bottom_db: -50.0,
            top_db: 0.8,
        };
        let [scale, offset] = levels.decibels();
        for db in [-50.0, -49.9, -17.3, 0.79, 0.8] {
            let grey = levels.marked(10f64.powf(db / 10.0) as f32);
            assert!(
                (f64::from(grey) * scale + offset - db).abs() < 0.501 * scale,
                "{db}"
            );
        }
        assert_eq!(
            [f32::NAN, 0.0, 1e9].map(|power| levels.marked(power)),
            [0, 1, 255]
        );
    }
}
