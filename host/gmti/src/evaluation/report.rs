//! Curves of an evaluation.

use super::method::Method;
use super::trials::{Evaluation, Trial, Trials};

/// Intervals of radial speed per decade.
const A_DECADE: f64 = 5.0;

/// Probability of detection at the minimum detectable velocity.
const DETECTABLE: f64 = 0.5;

/// Half-width of a confidence interval of 95 %, standard deviations.
const CONFIDENCE: f64 = 1.959_964;

/// Probabilities of false alarm whose rate is measured.
const REQUESTED: [f64; 4] = [1e-1, 1e-2, 1e-3, 1e-4];

/// Points of an ROC curve per decade, and its decades.
const ROC_POINTS: i32 = 4;
const ROC_DECADES: i32 = 9;

/// Performance of all methods.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Probability of false alarm of the curves.
    pub false_alarm_probability: f64,
    /// Methods, from one sub-CPI of one channel to the integration of all.
    pub methods: Vec<MethodReport>,
}

/// Performance of a method.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MethodReport {
    /// Method that was tested.
    pub method: Method,
    /// Performance over radial speed, ascending.
    pub curve: Vec<AtVelocity>,
    /// Smallest radial speed with a measured probability of detection of 0.5, metres per second.
    pub mdv_m_s: Option<f64>,
    /// The same by theory.
    pub predicted_mdv_m_s: Option<f64>,
    /// Probability of false alarm, and of detection of all targets.
    pub roc: Vec<[f64; 2]>,
    /// Rates of false alarms.
    pub false_alarms: Vec<FalseAlarms>,
}

/// Performance in an interval of radial speeds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct AtVelocity {
    /// Radial speed, geometric middle of the interval, metres per second.
    pub speed_m_s: f64,
    /// Number of targets in the interval.
    pub targets: usize,
    /// Fraction that was detected.
    pub detected: f64,
    /// Confidence interval of 95 % of the probability of detection (Wilson 1927).
    pub interval: [f64; 2],
    /// Mean probability of detection by theory.
    pub predicted: Option<f64>,
    /// Mean ratio of signal to interference and noise (SINR) by the estimated covariance, dB.
    pub sinr_db: Option<f64>,
}

/// Measured rate of false alarms.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FalseAlarms {
    /// Requested probability of false alarm.
    pub requested: f64,
    /// Number of motions without a target.
    pub tested: usize,
    /// Number of false alarms.
    pub found: usize,
}

impl FalseAlarms {
    /// Measured over requested probability.
    pub fn ratio(&self) -> f64 {
        self.found as f64 / self.tested as f64 / self.requested
    }
}

impl Evaluation {
    /// Performance of all methods at a probability of false alarm.
    pub fn report(&self, false_alarm_probability: f64) -> Report {
        let of = |trials: &Trials| MethodReport::of(trials, false_alarm_probability);
        Report {
            false_alarm_probability,
            methods: self.trials.iter().map(of).collect(),
        }
    }
}

impl MethodReport {
    fn of(trials: &Trials, false_alarm_probability: f64) -> Self {
        let curve = curve(&trials.targets, false_alarm_probability);
        let speeds = |of: &dyn Fn(&AtVelocity) -> Option<f64>| {
            let points = curve.iter().filter_map(|at| Some((at.speed_m_s, of(at)?)));
            crossing(&points.collect::<Vec<_>>())
        };
        let count = trials.targets.len() as f64;
        let roc = (0..=ROC_POINTS * ROC_DECADES).map(|i| {
            let p = 10f64.powf(f64::from(i) / f64::from(ROC_POINTS) - f64::from(ROC_DECADES));
            let detected = trials.targets.iter().filter(|trial| trial.probability <= p);
            [p, detected.count() as f64 / count]
        });
        let false_alarms = REQUESTED.map(|requested| FalseAlarms {
            requested,
            tested: trials.clutter.len(),
            found: trials.clutter.iter().filter(|&&p| p <= requested).count(),
        });
        Self {
            method: trials.method,
            mdv_m_s: speeds(&|at| Some(at.detected)),
            predicted_mdv_m_s: speeds(&|at| at.predicted),
            roc: roc.collect(),
            false_alarms: false_alarms.to_vec(),
            curve,
        }
    }
}

/// Performance over intervals of radial speed that are equal in logarithm.
fn curve(targets: &[Trial], false_alarm_probability: f64) -> Vec<AtVelocity> {
    let interval = |trial: &Trial| (trial.speed_m_s.log10() * A_DECADE).floor() as i64;
    let mut intervals: Vec<i64> = targets.iter().map(interval).collect();
    intervals.sort_unstable();
    intervals.dedup();
    let at = |index: i64| {
        let own: Vec<&Trial> = targets
            .iter()
            .filter(|trial| interval(trial) == index)
            .collect();
        let count = own.len() as f64;
        let detected = own
            .iter()
            .filter(|trial| trial.probability <= false_alarm_probability);
        let detected = detected.count() as f64 / count;
        let mean = |of: &dyn Fn(&Trial) -> Option<f64>| {
            let sum: Option<f64> = own.iter().map(|trial| of(trial)).sum();
            sum.map(|sum| sum / count)
        };
        AtVelocity {
            speed_m_s: 10f64.powf((index as f64 + 0.5) / A_DECADE),
            targets: own.len(),
            detected,
            interval: wilson(detected, count),
            predicted: mean(&|trial| Some(trial.predicted?.probability)),
            sinr_db: mean(&|trial| Some(trial.predicted?.sinr)).map(|sinr| 10.0 * sinr.log10()),
        }
    };
    intervals.into_iter().map(at).collect()
}

/// Confidence interval of a probability, for a measured fraction of `count` trials.
fn wilson(fraction: f64, count: f64) -> [f64; 2] {
    let square = CONFIDENCE * CONFIDENCE / count;
    let middle = fraction + square / 2.0;
    let half = (square * (fraction * (1.0 - fraction) + square / 4.0)).sqrt();
    [middle - half, middle + half].map(|end| (end / (1.0 + square)).clamp(0.0, 1.0))
}

/// First speed at which a probability rises through [`DETECTABLE`], linear in the logarithm between points.
fn crossing(points: &[(f64, f64)]) -> Option<f64> {
    let rising = points
        .windows(2)
        .find(|pair| pair[0].1 < DETECTABLE && pair[1].1 >= DETECTABLE)?;
    let [(low, below), (high, above)] = [rising[0], rising[1]];
    let part = (DETECTABLE - below) / (above - below);
    Some(low * (high / low).powf(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_interval_contains_the_true_probability() {
        // Exact binomial coverage of the Wilson interval for 40 trials.
        let count = 40;
        for p in [0.05, 0.3, 0.5, 0.9] {
            let mut term = (1.0f64 - p).powi(count);
            let mut covered = 0.0;
            for k in 0..=count {
                let [low, high] = wilson(f64::from(k) / f64::from(count), f64::from(count));
                if (low..=high).contains(&p) {
                    covered += term;
                }
                term *= f64::from(count - k) / f64::from(k + 1) * p / (1.0 - p);
            }
            assert!((0.91..=0.99).contains(&covered), "{p}: {covered}");
        }
    }

    #[test]
    fn minimum_detectable_velocity_is_interpolated_in_the_logarithm() {
        let mdv = crossing(&[(0.1, 0.0), (1.0, 1.0), (10.0, 0.2), (100.0, 1.0)]);
        assert!((mdv.unwrap() - 0.1f64.sqrt()).abs() < 1e-12);
        assert_eq!(crossing(&[(0.1, 0.6), (1.0, 0.9)]), None);
    }
}
