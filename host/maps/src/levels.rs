//! From levels to the greys of an 8-bit picture.

use subaperture_model::image::{Parts, power};

use crate::MapError;

/// How an image's magnitudes become greys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Remap {
    /// Decibels, from the darkest to the brightest grey: the top is the image's peak unless it is given, and the bottom 6 dB below its median, within
    /// 40 to 60 dB of it.
    #[default]
    Decibels,
    /// The logarithm of the magnitude about its mean `m`, as NGA's and sarpy's Density has it with 30 and 40: 0.8 `m` is at 30 of 255 and 40 times that
    /// is white. Bright points do not make the rest dark. Zeros are no part of the mean.
    Density,
}

/// Levels of black and white, dB of magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Of the darkest grey.
    pub bottom_db: f64,
    /// Of the brightest.
    pub top_db: f64,
}

/// Density's grey of its lower limit, of 255.
const DENSITY_GREY: f64 = 30.0;
/// Its lower limit, in means.
const DENSITY_LOW: f64 = 0.8;
/// Its upper limit, in lower ones.
const DENSITY_SPAN: f64 = 40.0;

/// Cells of the histogram, of 0.1 dB, from -400 dB on.
const CELLS: usize = 8000;
const LOWEST_DB: f64 = -400.0;

impl Levels {
    /// Those of an image, which is read once; `top_db` and `span_db` in place of its own.
    ///
    /// # Errors
    /// [`MapError::Empty`], [`MapError::Parts`].
    pub fn of(
        pixels: &dyn Parts,
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
            let window = pixels.window(&place).map_err(MapError::Parts)?;
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

    /// The part of the way from black to white at which a power is; NaN of none.
    pub(crate) fn part(&self, power: f32) -> f64 {
        let db = 10.0 * libm::log10(f64::from(power));
        ((db - self.bottom_db) / (self.top_db - self.bottom_db)).clamp(0.0, 1.0)
    }

    /// A grey from 1 to 255, and 0 where there is nothing.
    pub(crate) fn marked(&self, power: f32) -> u8 {
        match power.is_finite() {
            true => (1.5 + 254.0 * self.part(power)) as u8,
            false => 0,
        }
    }

    /// By what such a grey is to be multiplied, and what to be added, to have decibels.
    pub(crate) fn decibels(&self) -> [f64; 2] {
        let step = (self.top_db - self.bottom_db) / 254.0;
        [step, self.bottom_db - step]
    }

    /// A grey from black to white; black where there is nothing.
    pub fn grey(&self, power: f32) -> u8 {
        self.grey_alpha(power)[0]
    }

    /// A grey and how opaque it is.
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
    fn density_is_that_of_sarpy() {
        let amplitudes = [0.25f32, 1.0, 2.0, 0.5, 30.0, 0.015625];
        let levels = Levels::of(&image(&amplitudes), Remap::Density, None, None).unwrap();
        let mean = amplitudes.iter().sum::<f32>() / 6.0;
        let slope = 225.0 / 40f32.log10();
        for amplitude in amplitudes {
            let grey = slope * (amplitude / (0.8 * mean)).log10() + 30.0;
            let [got, alpha] = levels.grey_alpha(amplitude * amplitude);
            // sarpy cuts off where this rounds.
            assert!(
                (f32::from(got) - grey.clamp(0.0, 255.0)).abs() <= 0.51,
                "{got} {grey}"
            );
            assert_eq!(alpha, 255);
        }
        assert_eq!(levels.grey_alpha(f32::NAN), [0, 0]);
    }

    #[test]
    fn decibels_are_from_the_peak_to_below_the_median() {
        let levels = |amplitudes: &[f32], top, span| {
            let levels = Levels::of(&image(amplitudes), Remap::Decibels, top, span);
            levels.map(|levels| [levels.bottom_db, levels.top_db])
        };
        // A peak of 19.08 dB and a median of -26.02 dB: to -33 dB, 53 dB in all.
        let some = [9.0f32, 0.05, 0.05, 0.02, 0.1];
        assert_eq!(levels(&some, None, None).unwrap(), [-33.0, 20.0]);
        assert_eq!(levels(&[1.0; 4], None, None).unwrap(), [-40.0, 0.0]);
        assert_eq!(levels(&some, Some(5.0), Some(30.0)).unwrap(), [-25.0, 5.0]);
        for nothing in [&[0.0f32, f32::NAN][..], &[f32::INFINITY]] {
            assert!(matches!(levels(nothing, None, None), Err(MapError::Empty)));
        }
    }

    #[test]
    fn marked_greys_are_decibels_again() {
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
