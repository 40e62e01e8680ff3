//! Which levels are black and white.

use std::ops::RangeInclusive;

use super::colours::Colours;

/// The range of levels that a picture shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// From the image, as far as it is not given. The top is its peak, so that nothing is above it; the
    /// bottom lies 6 dB below the median, which shows clutter or noise as dark grey; the span is kept
    /// within 40 and 60 dB. Whole decibels.
    FromData {
        /// Level of the brightest colour, dB.
        top_db: Option<f64>,
        /// How far below it the darkest lies, dB; positive.
        span_db: Option<f64>,
    },
    /// About the mean magnitude `m` of what is shown: the logarithm, with 0.8 `m` at 30 of 255 greys and 40 times that white, as is all above it. NGA's
    /// and sarpy's Density: bright points do not make the rest dark.
    Density,
    /// Given, so that pictures can be compared.
    Fixed {
        /// Level of the brightest colour, dB.
        top_db: f64,
        /// How far below it the darkest lies, dB; positive.
        span_db: f64,
    },
}

impl Default for Scale {
    fn default() -> Self {
        Self::FromData {
            top_db: None,
            span_db: None,
        }
    }
}

/// Bottom and top, in the unit shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Levels {
    pub(super) bottom: f64,
    pub(super) top: f64,
    /// Whether what lies above has a colour of its own.
    pub(super) marks_above: bool,
}

/// Levels this far above the top, as a part of the span, are rounding and not above it.
const ROUNDING: f64 = 1e-3;

impl Levels {
    /// How far from the darkest to the brightest a level lies: 0 to 1 within the scale.
    pub(super) fn part(&self, level: f64) -> f64 {
        (level - self.bottom) / (self.top - self.bottom)
    }

    /// Whether what lies so far up has the colour of what is above.
    pub(super) fn is_above(&self, part: f64) -> bool {
        part > 1.0 + ROUNDING && self.marks_above
    }

    /// The colour of a level, `absent` of NaN, and whether it lies above the scale.
    pub(super) fn colour(&self, level: f64, colours: Colours, absent: [u8; 3]) -> ([u8; 3], bool) {
        let part = self.part(level);
        // Zero power is minus infinity, and dark; only NaN is absent.
        match part.is_nan() {
            true => (absent, false),
            false if self.is_above(part) => (colours.above(), true),
            false => (colours.at(part), false),
        }
    }

    /// How far from the darkest to the brightest a power lies, 0 to 1; `None` of what is no number.
    pub(super) fn part_of(&self, power: f64) -> Option<f64> {
        let part = self.part(10.0 * power.log10());
        (!part.is_nan()).then(|| part.clamp(0.0, 1.0))
    }
}

/// Density's lower limit, in mean magnitudes; its upper one, in lower ones; the part of the greys that lies below the lower one.
const DENSITY: [f64; 3] = [0.8, 40.0, 30.0 / 255.0];

impl Scale {
    /// The levels for an image whose shown pixels have these powers.
    pub(super) fn levels(self, powers: &[f64]) -> Levels {
        let sound_top = |top_db: &f64| top_db.is_finite();
        let sound_span = |span_db: &f64| *span_db > 0.0;
        let (given_top, given_span) = match self {
            Self::FromData { top_db, span_db } => (top_db, span_db),
            Self::Fixed { top_db, span_db } => (Some(top_db), Some(span_db)),
            Self::Density => return density(powers),
        };
        let top_db = given_top.filter(sound_top);
        let span_db = given_span
            .filter(sound_span)
            .map(|span_db| span_db.min(1e3));
        let (top_db, span_db) = match (top_db, span_db) {
            (Some(top_db), Some(span_db)) => (top_db, span_db),
            _ => from_data(powers, top_db, span_db),
        };
        Levels {
            bottom: top_db - span_db,
            top: top_db,
            marks_above: true,
        }
    }
}

/// The levels of [`Scale::Density`]; zeros are no part of the mean.
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

/// Top and span, of which one may be given.
fn from_data(powers: &[f64], top_db: Option<f64>, span_db: Option<f64>) -> (f64, f64) {
    let Some((peak, median)) = peak_and_median(powers) else {
        return (top_db.unwrap_or(0.0), span_db.unwrap_or(60.0));
    };
    let top_db = top_db.unwrap_or_else(|| (10.0 * peak.log10()).ceil());
    let bottom_db = (10.0 * median.log10() - 6.0).floor();
    let span_db = span_db.unwrap_or_else(|| (top_db - bottom_db).clamp(40.0, 60.0));
    (top_db, span_db)
}

/// Bits of a float64 number that are left out where powers are counted: all but four of its fraction.
const BELOW: u32 = 48;

/// Bits of the numbers that are positive and finite: they grow with the number.
const POSITIVE: RangeInclusive<u64> = 1..=f64::MAX.to_bits();

/// The largest and the median of the powers that are positive and finite; `None` if there are none. Those with the same leading
/// bits are counted, and only those around the middle are put in order.
fn peak_and_median(powers: &[f64]) -> Option<(f64, f64)> {
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
    let middle = total.checked_sub(1)? / 2;
    let mut before = 0;
    let run = counts.iter().position(|count| {
        before += count;
        before > middle
    })?;
    before -= counts[run];
    let mut around: Vec<u64> = seen().filter(|bits| bits >> BELOW == run as u64).collect();
    let (_, median, _) = around.select_nth_unstable(middle - before);
    Some((f64::from_bits(peak), f64::from_bits(*median)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_that_of_all_in_order() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            state >> 33
        };
        for count in [1, 2, 3, 10, 1001, 5000] {
            // Over all magnitudes, over some, and all the same.
            for spread in [2000, 6, 0] {
                let mut powers: Vec<f64> = (0..count)
                    .map(|_| {
                        let octave = (random() % (spread + 1)) as i32 - (spread / 2) as i32;
                        (1.0 + random() as f64 / 2f64.powi(31)) * 2f64.powi(octave)
                    })
                    .collect();
                let mut sorted = powers.clone();
                sorted.sort_by(f64::total_cmp);
                let wanted = (sorted[count - 1], sorted[(count - 1) / 2]);
                powers.extend([0.0, f64::NAN, f64::INFINITY]);
                assert_eq!(peak_and_median(&powers), Some(wanted), "{count} {spread}");
            }
        }
        assert_eq!(peak_and_median(&[0.0, f64::NAN]), None);
        assert_eq!(peak_and_median(&[]), None);
    }

    /// By sarpy's own words: `slope log10(max(amplitude, 1e-5)) + constant`, with `slope = (255 - 30) / log10(40)` and 30 at 0.8 of the mean.
    #[test]
    fn density_is_that_of_sarpy() {
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
        // What is zero or no number does not count, and where there is nothing else there are levels too.
        assert_eq!(
            Scale::Density.levels(&[4.0, 0.0, f64::NAN]),
            Scale::Density.levels(&[4.0])
        );
        assert!(Scale::Density.levels(&[]).top.is_finite());
    }
}
