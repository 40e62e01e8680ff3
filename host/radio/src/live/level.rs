//! Level of a channel relative to the converter's full scale.

use std::ops::Range;

use crate::transceiver::Sample;

/// Level of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// Root of the mean of `|s|^2`, relative to full scale: 1 for a full-scale tone.
    pub rms: f64,
    /// Largest magnitude of I or Q, relative to full scale.
    pub peak: f64,
    /// Number of samples with I or Q at full scale.
    pub clipped: u64,
}

impl Level {
    /// Level of a burst's samples, without the lost ones.
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

    /// Combined level of several bursts of equal length.
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

    /// A burst of 3000 - 4000 j counts has an RMS of 5000 of 32768 and a peak of 4000. Samples in the gaps, which
    /// overlap and extend beyond the end, are ignored.
    #[test]
    fn level_ignores_lost_samples() {
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

    /// Powers are averaged; peaks combine by maximum, and counts are summed.
    #[test]
    fn combined_level_averages_power() {
        let of = |rms, peak, clipped| Level { rms, peak, clipped };
        let both = Level::together(&[of(0.3, 0.5, 2), of(0.4, 0.45, 0)]);
        assert!((both.rms - (0.125f64).sqrt()).abs() < 1e-15);
        assert_eq!((both.peak, both.clipped), (0.5, 2));
        assert_eq!(Level::together(&[]), Level::default());
    }
}
