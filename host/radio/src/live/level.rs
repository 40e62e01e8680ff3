//! How much of the converter's range a channel takes.

use std::ops::Range;

use crate::transceiver::Sample;

/// The level of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// Root of the mean of `|s|^2`, of full scale: 1 for a tone that fills it.
    pub rms: f64,
    /// Largest I or Q, of full scale.
    pub peak: f64,
    /// Samples of which I or Q was at full scale.
    pub clipped: u64,
}

impl Level {
    /// Of a burst's samples, but for those that are none.
    pub fn of(samples: &[Sample], lost: &[Range<usize>], clipped: u32) -> Self {
        // |s|^2 is at most 2^31, and a burst has fewer than 2^32 samples.
        let (mut power, mut peak, mut count) = (0u64, 0u16, 0usize);
        let mut add = |samples: &[Sample]| {
            for s in samples {
                let [i, q] = [s.re.unsigned_abs(), s.im.unsigned_abs()];
                power += u64::from(i) * u64::from(i) + u64::from(q) * u64::from(q);
                peak = peak.max(i).max(q);
            }
            count += samples.len();
        };
        let mut from = 0;
        for gap in lost {
            let start = gap.start.clamp(from, samples.len());
            add(&samples[from..start]);
            from = gap.end.clamp(start, samples.len());
        }
        add(&samples[from..]);
        Self {
            rms: (power as f64 / count.max(1) as f64).sqrt() / 32768.0,
            peak: f64::from(peak) / 32768.0,
            clipped: clipped.into(),
        }
    }

    /// Of several bursts of equal length together.
    pub fn together(all: &[Self]) -> Self {
        let power: f64 = all.iter().map(|level| level.rms * level.rms).sum();
        Self {
            rms: (power / all.len().max(1) as f64).sqrt(),
            peak: all.iter().map(|level| level.peak).fold(0.0, f64::max),
            clipped: all.iter().map(|level| level.clipped).sum(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A burst of 3 + 4 j counts in thousands: 5000 of 32768, and 4000 the larger part; what lies in the gaps, which overlap and reach
    /// beyond the end, counts for nothing.
    #[test]
    fn the_level_is_of_the_samples_that_came() {
        let mut samples = vec![Sample::new(3000, -4000); 64];
        samples[10..20].fill(Sample::new(i16::MIN, 0));
        samples[60..].fill(Sample::ZERO);
        let level = Level::of(&samples, &[10..15, 12..20, 60..80], 7);
        assert!((level.rms - 5000.0 / 32768.0).abs() < 1e-15);
        assert_eq!((level.peak, level.clipped), (4000.0 / 32768.0, 7));
        assert_eq!(Level::of(&samples, &[10..12, 20..20], 0).peak, 1.0);
        assert_eq!(Level::of(&[], &[0..4, 0..9], 0), Level::default());
        assert_eq!(
            Level::of(&samples[..4], std::slice::from_ref(&(0..4)), 0).rms,
            0.0
        );
    }

    /// Powers are averaged, peaks and counts are not.
    #[test]
    fn levels_go_together_by_power() {
        let of = |rms, peak, clipped| Level { rms, peak, clipped };
        let both = Level::together(&[of(0.3, 0.5, 2), of(0.4, 0.45, 0)]);
        assert!((both.rms - (0.125f64).sqrt()).abs() < 1e-15);
        assert_eq!((both.peak, both.clipped), (0.5, 2));
        assert_eq!(Level::together(&[]), Level::default());
    }
}
