//! Levels of black and white.

use std::ops::RangeInclusive;

use super::colours::Colours;

/// Range of levels of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// Automatic levels, unless given. Lower level: 6 dB below the median, which shows clutter or noise as dark grey, with a dynamic
    /// range of 40 to 60 dB. Whole decibels.
    FromData {
        /// Upper level of the scale, dB.
        top: Upper,
        /// Dynamic range, dB, positive. Default (`None`): automatic.
        span_db: Option<f64>,
    },
    /// NGA Density remap (as in sarpy): logarithmic about the mean magnitude `m`, 0.8 `m` at 30 of 255 greys and 40 times that and more at white.
    /// Bright points do not darken the rest.
    Density,
    /// Fixed levels, for comparable pictures.
    Fixed {
        /// Upper level, dB.
        top_db: f64,
        /// Dynamic range, dB, positive.
        span_db: f64,
    },
}

impl Default for Scale {
    fn default() -> Self {
        Self::FromData {
            top: Upper::Automatic,
            span_db: None,
        }
    }
}

/// Upper level of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Upper {
    /// Level exceeded by 0.1 % of the pixels, at most 12 dB below the peak: a few bright points do not darken the rest. Pixels above
    /// it are white.
    #[default]
    Automatic,
    /// Level of the brightest pixel.
    Peak,
    /// A level in dB. Pixels above it have a separate colour.
    Db(f64),
}

/// Lower and upper level, in the unit of the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    pub(super) bottom: f64,
    pub(super) top: f64,
    /// Whether values above the upper level have a separate colour.
    pub(super) marks_above: bool,
}

/// Tolerance above the upper level for rounding, relative to the dynamic range.
const ROUNDING: f64 = 1e-3;

impl Levels {
    /// Position of a level on the scale: 0 at the lower level, 1 at the upper.
    pub(super) fn part(&self, level: f64) -> f64 {
        (level - self.bottom) / (self.top - self.bottom)
    }

    /// Whether a position has the colour of values above the scale.
    pub(super) fn is_above(&self, part: f64) -> bool {
        part > 1.0 + ROUNDING && self.marks_above
    }

    /// Colour of a level (`absent` for NaN), and whether it is above the scale.
    pub(super) fn colour(&self, level: f64, colours: Colours, absent: [u8; 3]) -> ([u8; 3], bool) {
        let part = self.part(level);
        // Zero power is minus infinity and drawn dark; only NaN is missing.
        match part.is_nan() {
            true => (absent, false),
            false if self.is_above(part) => (colours.above(), true),
            false => (colours.at(part), false),
        }
    }

    /// Position of a power on the scale, 0 to 1; `None` for NaN.
    pub(super) fn part_of(&self, power: f64) -> Option<f64> {
        let part = self.part(10.0 * power.log10());
        (!part.is_nan()).then(|| part.clamp(0.0, 1.0))
    }
}

/// Density: lower limit over the mean magnitude, upper limit over the lower, fraction of greys below the lower limit.
const DENSITY: [f64; 3] = [0.8, 40.0, 30.0 / 255.0];

impl Scale {
    /// Levels for an image with these powers.
    pub(super) fn levels(self, powers: &[f64]) -> Levels {
        let sound_span = |span_db: &f64| *span_db > 0.0;
        let (top, span_db) = match self {
            Self::FromData { top, span_db } => (top, span_db),
            Self::Fixed { top_db, span_db } => (Upper::Db(top_db), Some(span_db)),
            Self::Density => return density(powers),
        };
        let top = match top {
            Upper::Db(top_db) if !top_db.is_finite() => Upper::Automatic,
            top => top,
        };
        let span_db = span_db.filter(sound_span).map(|span_db| span_db.min(1e3));
        let (top_db, span_db) = match (top, span_db) {
            (Upper::Db(top_db), Some(span_db)) => (top_db, span_db),
            _ => from_data(powers, top, span_db),
        };
        Levels {
            bottom: top_db - span_db,
            top: top_db,
            marks_above: matches!(top, Upper::Db(_)),
        }
    }
}

/// Automatic upper level and dynamic range of an image with these powers, whole dB, as in [`Scale::default`]. `None` if no power is positive and
/// finite.
pub fn automatic_levels_db(powers: &[f64]) -> Option<[f64; 2]> {
    let ranks = Ranks::of(powers)?;
    let (top_db, span_db) = ranks.levels_db(Upper::Automatic, None);
    Some([top_db, span_db])
}

/// Levels of [`Scale::Density`]; zeros are excluded from the mean.
fn density(powers: &[f64]) -> Levels {
    let seen = powers.iter().filter(|p| p.is_finite() && **p > 0.0);
    let (sum, count) = seen.fold((0.0, 0.0), |(sum, count), p| (sum + p.sqrt(), count + 1.0));
    let mean: f64 = if count > 0.0 { sum / count } else { 1.0 };
    let [low, span, below] = DENSITY;
    let low_db = 20.0 * (low * mean).log10();
    let span_db = 20.0 * span.log10();
    Levels {
        bottom: low_db - span_db * below / (1.0 - below),
        top: low_db + span_db,
        marks_above: false,
    }
}

/// Upper level and dynamic range; either may be given.
fn from_data(powers: &[f64], top: Upper, span_db: Option<f64>) -> (f64, f64) {
    let given_db = match top {
        Upper::Db(top_db) => top_db,
        Upper::Automatic | Upper::Peak => 0.0,
    };
    let without_data = (given_db, span_db.unwrap_or(60.0));
    Ranks::of(powers).map_or(without_data, |ranks| ranks.levels_db(top, span_db))
}

/// Share of the pixels that exceed the automatic upper level.
const ABOVE: f64 = 1e-3;

/// Largest distance of the automatic upper level below the peak, dB.
const BELOW_PEAK_DB: f64 = 12.0;

/// Distance of the lower level below the median, dB.
const BELOW_MEDIAN_DB: f64 = 6.0;

/// Order statistics of the positive finite powers of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ranks {
    peak: f64,
    /// Power exceeded by [`ABOVE`] of the pixels.
    high: f64,
    median: f64,
}

impl Ranks {
    fn levels_db(&self, top: Upper, span_db: Option<f64>) -> (f64, f64) {
        let [peak_db, high_db, median_db] =
            [self.peak, self.high, self.median].map(|power| 10.0 * power.log10());
        let top_db = match top {
            Upper::Automatic => high_db.max(peak_db - BELOW_PEAK_DB).ceil(),
            Upper::Peak => peak_db.ceil(),
            Upper::Db(top_db) => top_db,
        };
        let bottom_db = (median_db - BELOW_MEDIAN_DB).floor();
        let span_db = span_db.unwrap_or_else(|| (top_db - bottom_db).clamp(40.0, 60.0));
        (top_db, span_db)
    }
}

/// Low bits of a float64 ignored in the histogram: all but four of the fraction.
const BELOW: u32 = 48;

/// Bit patterns of positive finite numbers, ascending with the number.
const POSITIVE: RangeInclusive<u64> = 1..=f64::MAX.to_bits();

impl Ranks {
    /// `None` without positive finite powers. A histogram of leading bits finds the bin of each rank, and only that bin is searched.
    fn of(powers: &[f64]) -> Option<Self> {
        let seen = || {
            powers
                .iter()
                .map(|p| p.to_bits())
                .filter(|bits| POSITIVE.contains(bits))
        };
        let mut counts = vec![0usize; (POSITIVE.end() >> BELOW) as usize + 1];
        let (mut peak, mut total) = (0, 0usize);
        for bits in seen() {
            peak = bits.max(peak);
            total += 1;
            counts[(bits >> BELOW) as usize] += 1;
        }
        let last = total.checked_sub(1)?;
        let at = |rank: usize| {
            let mut before = 0;
            let bin = counts.iter().position(|count| {
                before += count;
                before > rank
            })?;
            before -= counts[bin];
            let mut around: Vec<u64> = seen().filter(|bits| bits >> BELOW == bin as u64).collect();
            let (_, power, _) = around.select_nth_unstable(rank - before);
            Some(f64::from_bits(*power))
        };
        Some(Self {
            peak: f64::from_bits(peak),
            high: at(last - (ABOVE * total as f64) as usize)?,
            median: at(last / 2)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_of_histogram_equal_those_of_sorted_powers() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            state >> 33
        };
        for count in [1, 2, 3, 10, 1001, 5000] {
            // Powers over the full range, over a few decades, and constant.
            for spread in [2000, 6, 0] {
                let mut powers: Vec<f64> = (0..count)
                    .map(|_| {
                        let octave = (random() % (spread + 1)) as i32 - (spread / 2) as i32;
                        (1.0 + random() as f64 / 2f64.powi(31)) * 2f64.powi(octave)
                    })
                    .collect();
                let mut sorted = powers.clone();
                sorted.sort_by(f64::total_cmp);
                let wanted = Ranks {
                    peak: sorted[count - 1],
                    high: sorted[count - 1 - count / 1000],
                    median: sorted[(count - 1) / 2],
                };
                powers.extend([0.0, f64::NAN, f64::INFINITY]);
                assert_eq!(Ranks::of(&powers), Some(wanted), "{count} {spread}");
            }
        }
        assert_eq!(Ranks::of(&[0.0, f64::NAN]), None);
        assert_eq!(Ranks::of(&[]), None);
    }

    /// 10,000 pixels of clutter at 0 dB, with points at 30 dB.
    #[test]
    fn automatic_upper_level_ignores_few_points_and_stays_near_peak() {
        let scene = |points: usize| {
            let mut powers = vec![1.0; 10_000];
            powers[..points].fill(1e3);
            powers
        };
        // 10 points are 0.1 %: the level is limited to 12 dB below the peak. 11 points are more: the level is their own.
        for (points, top_db) in [(1, 18.0), (10, 18.0), (11, 30.0)] {
            assert_eq!(automatic_levels_db(&scene(points)), Some([top_db, 40.0]));
        }
        let levels = Scale::default().levels(&scene(1));
        assert_eq!((levels.top, levels.bottom), (18.0, -22.0));
        assert!(!levels.marks_above);
        let from_peak = Scale::FromData {
            top: Upper::Peak,
            span_db: None,
        };
        assert_eq!(from_peak.levels(&scene(1)).top, 30.0);
    }

    /// sarpy's formula: `slope log10(max(amplitude, 1e-5)) + constant`, with `slope = (255 - 30) / log10(40)` and 30 at 0.8 of the mean.
    #[test]
    fn density_remap_agrees_with_sarpy_formula() {
        let amplitudes = [0.1f64, 1.0, 2.0, 0.5, 30.0, 0.01];
        let powers: Vec<f64> = amplitudes.iter().map(|a| a * a).collect();
        let mean = amplitudes.iter().sum::<f64>() / amplitudes.len() as f64;
        let slope = 225.0 / 40f64.log10();
        let levels = Scale::Density.levels(&powers);
        assert!(!levels.marks_above);
        for amplitude in amplitudes {
            let expected = slope * (amplitude / (0.8 * mean)).log10() + 30.0;
            let db = 20.0 * amplitude.log10();
            let got = 255.0 * (db - levels.bottom) / (levels.top - levels.bottom);
            assert!(
                (got - expected).abs() < 1e-9,
                "{amplitude}: {got} {expected}"
            );
        }
        // Zeros and NaN are excluded; without other pixels there are still levels.
        assert_eq!(
            Scale::Density.levels(&[4.0, 0.0, f64::NAN]),
            Scale::Density.levels(&[4.0])
        );
        assert!(Scale::Density.levels(&[]).top.is_finite());
    }
}
