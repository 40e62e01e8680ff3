//! Level, entropy, contrast and sharpness of an image region.
//!
//! With `p_i = |I_i|^2` over the `n` pixels that are finite, and `P` their sum:
//!
//! ```text
//! mean level           10 log10 (P / n)                       for an empty region: the noise level
//! entropy              - sum (p_i / P) ln (p_i / P)           nats; 0 for one bright pixel, ln n for a flat image
//! contrast of power    std(p) / mean(p)                       0 flat, 1 fully developed speckle
//! contrast of amplitude std(|I|) / mean(|I|)                  sqrt(4 / pi - 1) = 0.523 for speckle
//! sharpness            sum p_i^2 / P^2                        1 for one bright pixel, 1 / n for a flat image
//! ```
//!
//! Standard deviations are those of the population (divisor `n`). Non-finite pixels are counted and
//! excluded. The level of an empty region is that of a unit scatterer with the power of the noise.

use std::ops::Range;

use subaperture_model::geometry::{Axis, Extent, ImageGrid};
use subaperture_model::image::{Image, ImageSource, ImageSourceError, power};

/// Rectangle of an image, ends excluded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Row range.
    pub rows: Range<usize>,
    /// Column range.
    pub columns: Range<usize>,
}

/// An extent contains no pixel centre.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "no pixel lies within x {} to {}, y {} to {}: the image reaches from x {} to {}, y {} to {}",
    extent.x_m.0, extent.x_m.1, extent.y_m.0, extent.y_m.1,
    image.x_m.0, image.x_m.1, image.y_m.0, image.y_m.1
)]
pub struct EmptyRegion {
    extent: Extent,
    image: Extent,
}

impl Region {
    /// Region of the whole image.
    pub fn whole(image: &Image) -> Self {
        Self {
            rows: 0..image.rows,
            columns: 0..image.columns,
        }
    }

    /// Region of the pixels whose centres lie within an extent in grid coordinates.
    ///
    /// # Errors
    /// [`EmptyRegion`] if there are none.
    pub fn within(extent: &Extent, grid: &ImageGrid) -> Result<Self, EmptyRegion> {
        let span = |axis: &Axis, (low, high): (f64, f64)| {
            // Tolerance for rounding of start + i step.
            let first = ((low - axis.start) / axis.step - 1e-9).ceil().max(0.0);
            let last = ((high - axis.start) / axis.step + 1e-9).floor() + 1.0;
            first as usize..(last.max(0.0) as usize).min(axis.count)
        };
        let region = Self {
            rows: span(&grid.rows, extent.y_m),
            columns: span(&grid.columns, extent.x_m),
        };
        match region.rows.is_empty() || region.columns.is_empty() {
            true => Err(EmptyRegion {
                extent: *extent,
                image: Extent {
                    x_m: (grid.columns.start, grid.columns.at(grid.columns.count - 1)),
                    y_m: (grid.rows.start, grid.rows.at(grid.rows.count - 1)),
                },
            }),
            false => Ok(region),
        }
    }
}

/// Statistics of a region; `None` where undefined (all pixels zero or non-finite).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Statistics {
    /// Number of finite pixels.
    pub num_pixels: usize,
    /// Number of NaN or infinite pixels.
    pub num_not_finite: usize,
    /// Mean power, dB.
    pub mean_level_db: Option<f64>,
    /// Median power, dB: 1.6 dB below the mean for noise, and robust to a few bright points.
    pub median_level_db: Option<f64>,
    /// Highest power, dB.
    pub peak_level_db: Option<f64>,
    /// Entropy of power, nats.
    pub entropy: Option<f64>,
    /// Standard deviation over mean of power.
    pub power_contrast: Option<f64>,
    /// Standard deviation over mean of amplitude.
    pub amplitude_contrast: Option<f64>,
    /// Sum of squared power over squared sum of power.
    pub sharpness: Option<f64>,
}

impl Statistics {
    /// Statistics of a region of `image`, clipped to the image.
    pub fn of(image: &Image, region: &Region) -> Self {
        let rows = region.rows.start..region.rows.end.min(image.rows);
        let columns = region.columns.start..region.columns.end.min(image.columns);
        let mut powers = Vec::with_capacity(rows.len() * columns.len());
        for row in rows.clone() {
            let pixels = image.pixels[row * image.columns..]
                .iter()
                .take(image.columns);
            let part = pixels.take(columns.end).skip(columns.start);
            powers.extend(part.map(|&z| power(z)).filter(|p| p.is_finite()));
        }
        let n = powers.len() as f64;
        let sum: f64 = powers.iter().sum();
        let db = |p: f64| (p > 0.0).then(|| 10.0 * p.log10());
        // Undefined without power.
        let of_lit = |f: &dyn Fn() -> f64| (sum > 0.0).then(f);
        let contrast = |f: &dyn Fn(f64) -> f64| {
            let mean = powers.iter().map(|&p| f(p)).sum::<f64>() / n;
            let variance = powers.iter().map(|&p| (f(p) - mean).powi(2)).sum::<f64>() / n;
            variance.sqrt() / mean
        };
        let entropy = of_lit(&|| {
            let parts = powers.iter().filter(|p| **p > 0.0).map(|p| p / sum);
            // Adding zero converts -0 (one bright pixel) to 0.
            -parts.map(|q| q * q.ln()).sum::<f64>() + 0.0
        });
        let power_contrast = of_lit(&|| contrast(&|p| p));
        let amplitude_contrast = of_lit(&|| contrast(&f64::sqrt));
        let sharpness = of_lit(&|| powers.iter().map(|p| (p / sum).powi(2)).sum());
        let peak = powers.iter().copied().fold(0.0, f64::max);
        let num_pixels = powers.len();
        let median = (num_pixels > 0).then(|| {
            *powers
                .select_nth_unstable_by(num_pixels / 2, f64::total_cmp)
                .1
        });
        Self {
            num_pixels,
            num_not_finite: rows.len() * columns.len() - num_pixels,
            mean_level_db: db(sum / n),
            median_level_db: median.and_then(db),
            peak_level_db: db(peak),
            entropy,
            power_contrast,
            amplitude_contrast,
            sharpness,
        }
    }
}

/// Largest region that is read at once, pixels.
const FEW_PIXELS: usize = 1 << 23;

/// Bits of the median determined per pass over an image.
const MEDIAN_BITS: u32 = 16;

impl Statistics {
    /// Statistics of a region of an image that does not fit in memory: five passes, window by window. Memory: 0.5 MiB and
    /// one window. Results equal those of [`Self::of`] up to the order of summation; the median is found bit by bit, from the highest.
    ///
    /// # Errors
    /// [`ImageSourceError`] if the image cannot be read.
    pub fn by_parts(image: &dyn ImageSource, region: &Region) -> Result<Self, ImageSourceError> {
        let (rows, columns) = image.size();
        let region = Region {
            rows: region.rows.start..region.rows.end.min(rows),
            columns: region.columns.start..region.columns.end.min(columns),
        };
        let num_all = region.rows.len() * region.columns.len();
        if num_all <= FEW_PIXELS {
            let window = image.window(&[region.rows, region.columns])?;
            return Ok(Self::of(&window, &Region::whole(&window)));
        }
        let (mut n, mut sum, mut amplitudes, mut peak) = (0usize, 0.0, 0.0, 0.0f64);
        each_power(image, &region, |p| {
            n += 1;
            sum += p;
            amplitudes += p.sqrt();
            peak = peak.max(p);
        })?;
        let db = |p: f64| (p > 0.0).then(|| 10.0 * p.log10());
        let (mean, mean_amplitude) = (sum / n as f64, amplitudes / n as f64);
        let (mut of_power, mut of_amplitude, mut entropy, mut sharpness) = (0.0, 0.0, 0.0, 0.0);
        each_power(image, &region, |p| {
            of_power += (p - mean).powi(2);
            of_amplitude += (p.sqrt() - mean_amplitude).powi(2);
            let part = p / sum;
            if part > 0.0 {
                entropy -= part * part.ln();
            }
            sharpness += part * part;
        })?;
        let deviation = |squares: f64| (squares / n as f64).sqrt();
        let of_lit = |figure: f64| (sum > 0.0).then_some(figure);
        Ok(Self {
            num_pixels: n,
            num_not_finite: num_all - n,
            mean_level_db: db(mean),
            median_level_db: match n {
                0 => None,
                _ => db(median(image, &region, n / 2)?),
            },
            peak_level_db: db(peak),
            entropy: of_lit(entropy + 0.0),
            power_contrast: of_lit(deviation(of_power) / mean),
            amplitude_contrast: of_lit(deviation(of_amplitude) / mean_amplitude),
            sharpness: of_lit(sharpness),
        })
    }
}

/// Call with the power of every finite pixel of a region.
fn each_power(
    image: &dyn ImageSource,
    region: &Region,
    mut of: impl FnMut(f64),
) -> Result<(), ImageSourceError> {
    for [rows, columns] in image.places() {
        let common = |a: &Range<usize>, b: &Range<usize>| a.start.max(b.start)..a.end.min(b.end);
        let place = [
            common(&rows, &region.rows),
            common(&columns, &region.columns),
        ];
        if place.iter().any(Range::is_empty) {
            continue;
        }
        let powers = image.window(&place)?.pixels;
        powers
            .into_iter()
            .map(power)
            .filter(|p| p.is_finite())
            .for_each(&mut of);
    }
    Ok(())
}

/// Power of a rank, from 0. Non-negative floats sort as their bits.
fn median(
    image: &dyn ImageSource,
    region: &Region,
    mut rank: usize,
) -> Result<f64, ImageSourceError> {
    let mut known = 0u64;
    let mut shift = u64::BITS;
    while shift > 0 {
        let above = shift;
        shift -= MEDIAN_BITS;
        let mut counts = vec![0usize; 1 << MEDIAN_BITS];
        each_power(image, region, |p| {
            let bits = p.to_bits();
            if above == u64::BITS || bits >> above == known {
                counts[(bits >> shift) as usize & ((1 << MEDIAN_BITS) - 1)] += 1;
            }
        })?;
        let mut bucket = 0;
        while rank >= counts[bucket] {
            rank -= counts[bucket];
            bucket += 1;
        }
        known = known << MEDIAN_BITS | bucket as u64;
    }
    Ok(f64::from_bits(known))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;

    fn image(amplitudes: &[f32], columns: usize) -> Image {
        Image {
            rows: amplitudes.len() / columns,
            columns,
            pixels: amplitudes.iter().map(|&a| Complex32::new(0.0, a)).collect(),
        }
    }

    #[track_caller]
    fn near(value: Option<f64>, wanted: f64) {
        let value = value.expect("defined");
        assert!((value - wanted).abs() < 1e-12, "{value}, not {wanted}");
    }

    #[test]
    fn statistics_agree_with_hand_calculation() {
        // Powers 1, 1, 4, 16, one NaN and one infinite; n = 4, P = 22, mean 5.5.
        let image = image(&[1.0, -1.0, 2.0, f32::NAN, 4.0, f32::INFINITY], 3);
        let s = Statistics::of(&image, &Region::whole(&image));
        assert_eq!((s.num_pixels, s.num_not_finite), (4, 2));
        near(s.mean_level_db, 10.0 * 5.5f64.log10());
        near(s.peak_level_db, 10.0 * 16f64.log10());
        // Third of four in ascending order.
        near(s.median_level_db, 10.0 * 4f64.log10());
        let part = |p: f64| -(p / 22.0) * (p / 22.0).ln();
        near(s.entropy, 2.0 * part(1.0) + part(4.0) + part(16.0));
        // Sum of squared powers 274; variance 274 / 4 - 5.5^2 = 38.25.
        near(s.power_contrast, 38.25f64.sqrt() / 5.5);
        // Amplitudes 1, 1, 2, 4: mean 2, variance 22 / 4 - 4 = 1.5.
        near(s.amplitude_contrast, 1.5f64.sqrt() / 2.0);
        near(s.sharpness, 274.0 / 484.0);
    }

    /// Region larger than the limit for reading at once.
    #[test]
    fn windowed_statistics_equal_those_of_whole_region() {
        let (rows, columns) = (4100, 2200);
        let mut state = 1u32;
        let pixels = (0..rows * columns).map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match i % 100_003 {
                7 => Complex32::new(f32::NAN, 0.0),
                _ => Complex32::new((state >> 8) as f32 * 1e-6, (i % 17) as f32),
            }
        });
        let image = Image {
            rows,
            columns,
            pixels: pixels.collect(),
        };
        for region in [
            Region::whole(&image),
            Region {
                rows: 11..4099,
                columns: 3..2199,
            },
        ] {
            assert!(region.rows.len() * region.columns.len() > FEW_PIXELS);
            let whole = Statistics::of(&image, &region);
            let parts = Statistics::by_parts(&image, &region).unwrap();
            assert_eq!(
                (parts.num_pixels, parts.num_not_finite),
                (whole.num_pixels, whole.num_not_finite)
            );
            assert_eq!(parts.median_level_db, whole.median_level_db);
            assert_eq!(parts.peak_level_db, whole.peak_level_db);
            for figure in [
                |s: &Statistics| s.mean_level_db,
                |s: &Statistics| s.entropy,
                |s: &Statistics| s.power_contrast,
                |s: &Statistics| s.amplitude_contrast,
                |s: &Statistics| s.sharpness,
            ] {
                let (a, b) = (figure(&parts).unwrap(), figure(&whole).unwrap());
                assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} {b}");
            }
        }
    }

    #[test]
    fn statistics_of_empty_flat_and_single_point_regions() {
        let flat = image(&[2.0; 6], 2);
        let s = Statistics::of(&flat, &Region::whole(&flat));
        near(s.entropy, 6f64.ln());
        near(s.sharpness, 1.0 / 6.0);
        near(s.power_contrast, 0.0);
        let one = image(&[0.0, 3.0], 2);
        let s = Statistics::of(&one, &Region::whole(&one));
        assert_eq!((s.entropy, s.sharpness), (Some(0.0), Some(1.0)));
        for dark in [image(&[0.0; 4], 2), image(&[f32::NAN; 4], 2)] {
            let s = Statistics::of(&dark, &Region::whole(&dark));
            assert_eq!(
                (s.mean_level_db, s.entropy, s.sharpness),
                (None, None, None)
            );
        }
    }

    #[test]
    fn region_contains_pixel_centres_within_extent() {
        let grid: ImageGrid = "x=-1:1:0.5,y=0:3:1".parse().unwrap();
        let extent = |x_m, y_m| Extent { x_m, y_m };
        // x is -1, -0.5, 0, 0.5; y is 0, 1, 2.
        let region = Region::within(&extent((-0.5, 0.2), (0.5, 9.0)), &grid).unwrap();
        assert_eq!((region.rows.clone(), region.columns.clone()), (1..3, 1..3));
        let image = image(
            &[9.0, 9.0, 9.0, 9.0, 9.0, 1.0, 1.0, 9.0, 9.0, 1.0, 1.0, 9.0],
            4,
        );
        near(Statistics::of(&image, &region).mean_level_db, 0.0);
        let error = Region::within(&extent((0.1, 0.4), (0.0, 3.0)), &grid).unwrap_err();
        assert!(
            error.to_string().contains("reaches from x -1 to 0.5"),
            "{error}"
        );
        assert!(Region::within(&extent((-9.0, -8.0), (0.0, 3.0)), &grid).is_err());
    }
}
