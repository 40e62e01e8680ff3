//! Missing pulses: gaps in the times of pulses with a regular interval.
//!
//! The interval is the median of the time differences. A difference of more than `1 + max(0.5, 10 d)` intervals is a
//! gap, with `d` the median deviation of the differences in intervals, and lacks as many pulses as fit into it. Times
//! with `d > 0.1`, or with gaps after more than a quarter of the pulses, are irregular and have no gaps.

use super::DefectKind;

/// Gaps in the times of pulses.
#[derive(Clone, Debug, PartialEq)]
struct Gaps {
    /// Usual interval of the pulses, seconds.
    interval_s: f64,
    /// Number of missing pulses, and of gaps.
    missing: u64,
    count: usize,
    /// Index of the pulse before the first gap, its time, and the length of that gap, seconds.
    after: usize,
    after_s: f64,
    first_s: f64,
}

impl DefectKind {
    /// Missing pulses in ascending pulse times, seconds; `first` is the index of the first of these pulses. `None` without gaps, and for times
    /// without a regular interval.
    pub fn gaps(times_s: &[f64], first: usize) -> Option<Self> {
        let gaps = Gaps::of(times_s)?;
        Some(Self::Gaps {
            missing_pulses: gaps.missing,
            share: gaps.missing as f64 / (gaps.missing + times_s.len() as u64) as f64,
            gaps: gaps.count,
            after_pulse: first + gaps.after,
            after_s: gaps.after_s,
            first_gap_s: gaps.first_s,
            interval_s: gaps.interval_s,
        })
    }
}

impl Gaps {
    /// Gaps in ascending times, if they have a regular interval and gaps.
    fn of(times_s: &[f64]) -> Option<Self> {
        let steps_s = || times_s.windows(2).map(|pair| pair[1] - pair[0]);
        if times_s.len() < 4 || steps_s().any(|step_s| step_s.is_nan() || step_s <= 0.0) {
            return None;
        }
        let interval_s = median(steps_s().collect());
        let deviation = median(steps_s().map(|s| (s / interval_s - 1.0).abs()).collect());
        if deviation > 0.1 {
            return None;
        }
        let limit_s = interval_s * (1.0 + (10.0 * deviation).max(0.5));
        let gaps = || steps_s().enumerate().filter(|(_, s)| *s > limit_s);
        let (after, first_s) = gaps().next()?;
        let count = gaps().count();
        if 4 * count > times_s.len() - 1 {
            return None;
        }
        Some(Self {
            interval_s,
            missing: gaps()
                .map(|(_, s)| (s / interval_s).round() as u64 - 1)
                .sum(),
            count,
            after,
            after_s: times_s[after],
            first_s,
        })
    }
}

/// Median of a non-empty list.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_state_missing_pulses_and_first_place() {
        // 1 ms apart, without pulses 40 to 46 and 90.
        let numbers = (0..120usize).filter(|n| !(40..47).contains(n) && *n != 90);
        let times_s: Vec<f64> = numbers.map(|n| 5.0 + n as f64 * 1e-3).collect();
        let gaps = Gaps::of(&times_s).unwrap();
        assert_eq!((gaps.missing, gaps.count, gaps.after), (8, 2, 39));
        assert!((gaps.interval_s - 1e-3).abs() < 1e-12);
        assert!((gaps.after_s - 5.039).abs() < 1e-12);
        assert!((gaps.first_s - 8e-3).abs() < 1e-12);
        let DefectKind::Gaps {
            missing_pulses,
            share,
            after_pulse,
            ..
        } = DefectKind::gaps(&times_s, 3).unwrap()
        else {
            panic!("another kind");
        };
        assert_eq!((missing_pulses, after_pulse), (8, 42));
        assert!((share - 8.0 / 120.0).abs() < 1e-12);
    }

    #[test]
    fn regular_jittered_and_irregular_times_have_no_gaps() {
        let even: Vec<f64> = (0..500).map(|n| f64::from(n) * 2e-3).collect();
        assert_eq!(Gaps::of(&even), None);
        // Jitter of 9 % of the interval on each time, by a linear congruential generator.
        let mut state = 1u64;
        let mut jitter = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24) - 0.5
        };
        let jittered: Vec<f64> = even.iter().map(|t| t + 0.18 * 2e-3 * jitter()).collect();
        assert_eq!(Gaps::of(&jittered), None);
        // Two intervals in turn: every other step would be a gap.
        let staggered: Vec<f64> = (0..200).map(|n| f64::from(n / 2 * 3 + n % 2)).collect();
        assert_eq!(Gaps::of(&staggered), None);
        // Times of several channels, and too few.
        assert_eq!(Gaps::of(&[0.0, 1.0, 1.0, 2.0, 9.0]), None);
        assert_eq!(Gaps::of(&[0.0, 1.0, 9.0]), None);
    }
}
