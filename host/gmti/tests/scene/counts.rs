//! Detections compared with the movers of scenes.

use std::ops::RangeInclusive;

/// Probability that an error is within 1.96 stated standard deviations: 0.95 for a normal error of that deviation.
const COVERAGE: [f64; 2] = [0.90, 0.98];

/// Number of detections and false targets, and errors of `N` kinds in units of the stated standard deviations.
pub(crate) struct Counts<const N: usize> {
    names: [&'static str; N],
    total: usize,
    detected: usize,
    false_targets: usize,
    errors: [Vec<f64>; N],
}

impl<const N: usize> Counts<N> {
    /// Make counts of errors with these names.
    pub(crate) fn new(names: [&'static str; N]) -> Self {
        Self {
            names,
            total: 0,
            detected: 0,
            false_targets: 0,
            errors: [const { Vec::new() }; N],
        }
    }

    /// Compare the targets of a scene with its movers. `errors` returns the errors of a target that is near a mover.
    pub(crate) fn add<M: std::fmt::Debug, T: std::fmt::Debug>(
        &mut self,
        scene: u64,
        movers: &[M],
        found: &[T],
        errors: impl Fn(&M, &T) -> Option<[f64; N]>,
    ) {
        self.total += movers.len();
        let mut left: Vec<&T> = found.iter().collect();
        for mover in movers {
            let near = |(i, target): (usize, &&T)| Some((i, errors(mover, target)?));
            let Some((i, own)) = left.iter().enumerate().find_map(near) else {
                println!("scene {scene}: missed {mover:.2?}");
                continue;
            };
            left.remove(i);
            self.detected += 1;
            self.errors
                .iter_mut()
                .zip(own)
                .for_each(|(all, own)| all.push(own));
        }
        self.false_targets += left.len();
        for target in left {
            println!("scene {scene}: false {target:.2?}");
        }
    }

    /// Print the counts, and assert that the number of errors of each kind within 1.96 standard deviations agrees with a probability within [`COVERAGE`].
    pub(crate) fn assert_covered(&self) {
        println!(
            "detected {} of {}, {} false",
            self.detected, self.total, self.false_targets
        );
        for (name, errors) in self.names.iter().zip(&self.errors) {
            let count = errors.len();
            let rms = (errors.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
            let inside = errors.iter().filter(|e| e.abs() < 1.96).count();
            let percent = 100.0 * inside as f64 / count as f64;
            println!("{name}: RMS {rms:.2} sigma, {percent:.1} % within 1.96 sigma, {errors:.2?}");
            let limits = limits(count, COVERAGE);
            assert!(
                limits.contains(&inside),
                "{name}: {inside}, expected {limits:?}"
            );
        }
    }

    /// Assert that at least `percent` of all movers are detected, and at most `most_false` targets are false.
    pub(crate) fn assert_detected(&self, percent: usize, most_false: u64) {
        let Self {
            total, detected, ..
        } = self;
        assert!(100 * detected >= percent * total, "{detected} of {total}");
        assert!(
            self.false_targets as u64 <= most_false,
            "{}",
            self.false_targets
        );
    }
}

/// Probability of a wrong verdict at either limit.
const WRONG: f64 = 0.01;

/// Numbers of successes of `count` trials that agree with a probability in an interval: fewer have a probability below [`WRONG`] with the lower end, and more with the upper end.
fn limits(count: usize, [low, high]: [f64; 2]) -> RangeInclusive<usize> {
    let below = |limit: usize, probability: f64| {
        let ratio = probability / (1.0 - probability);
        let mut log = count as f64 * (1.0 - probability).ln();
        let mut sum = 0.0;
        for k in 0..limit {
            sum += log.exp();
            log += (ratio * (count - k) as f64 / (k + 1) as f64).ln();
        }
        sum
    };
    let least = (0..count)
        .take_while(|&k| below(k + 1, low) < WRONG)
        .count();
    let most = (least..count).find(|&k| below(k + 1, high) > 1.0 - WRONG);
    least..=most.unwrap_or(count)
}

/// By tables of the binomial distribution: with 20 trials of 0.9, 14 successes or fewer have a probability of 0.0113, and 13 of 0.0024; with 100 trials of 0.5, 63 or more have one of 0.0060, and 62 of 0.0105.
#[test]
fn limits_are_those_of_the_binomial_distribution() {
    assert_eq!(limits(20, [0.9, 0.95]), 14..=20);
    assert_eq!(limits(100, [0.5, 0.5]), 38..=62);
}
