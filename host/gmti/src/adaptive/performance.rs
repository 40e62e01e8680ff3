//! False-alarm and detection probabilities, and thresholds.

use super::exceedance::{exponential_exceedance, gamma_exceedance, marcum_q};
use super::loss::{LossFactor, expectation};
use super::{AdaptiveError, Statistic};

/// Fluctuation of a target's amplitude from cell to cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetModel {
    /// Steady amplitude (Swerling 0, Marcum).
    Swerling0,
    /// Complex Gaussian amplitude, hence exponential power (Swerling 1).
    Swerling1,
}

/// Detection performance of a statistic for one steering vector, `N` degrees of freedom and `K` training snapshots: thresholds and probabilities.
///
/// For homogeneous Gaussian training without diagonal loading. **Accuracy**: 1e-6 relative or better, unless the rounding of a threshold near 1 (Kelly, ACE) limits it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Performance {
    statistic: Statistic,
    degrees_of_freedom: usize,
    snapshots: usize,
}

impl Performance {
    /// Performance of `statistic` for `N` degrees of freedom and `K` snapshots. The matched filter of a known covariance depends on neither.
    ///
    /// # Errors
    /// [`AdaptiveError::Training`] unless `1 <= N <= K`, for ACE `2 <= N <= K`: with `N = 1` ACE is always 1.
    pub fn new(
        statistic: Statistic,
        degrees_of_freedom: usize,
        snapshots: usize,
    ) -> Result<Self, AdaptiveError> {
        let least = match statistic {
            Statistic::Ace => 2,
            _ => 1,
        };
        let valid = (least..=snapshots).contains(&degrees_of_freedom);
        if !valid && statistic != Statistic::MatchedFilter {
            return Err(AdaptiveError::Training {
                least,
                degrees_of_freedom,
                snapshots,
            });
        }
        Ok(Self {
            statistic,
            degrees_of_freedom,
            snapshots,
        })
    }

    /// Probability that clutter alone exceeds `threshold`, a value of the statistic.
    pub fn false_alarm_probability(&self, threshold: f64) -> f64 {
        match self.odds(threshold) {
            Odds::Always => 1.0,
            Odds::Never => 0.0,
            Odds::Scale(scale) => self.exceedance(scale),
        }
    }

    /// Threshold of the statistic that clutter alone exceeds with this probability, above 0 and below 1.
    ///
    /// # Errors
    /// [`AdaptiveError::Probability`].
    pub fn threshold(&self, false_alarm_probability: f64) -> Result<f64, AdaptiveError> {
        if !(false_alarm_probability > 0.0 && false_alarm_probability < 1.0) {
            return Err(AdaptiveError::Probability(false_alarm_probability));
        }
        let log = libm::log(false_alarm_probability);
        if self.statistic == Statistic::MatchedFilter {
            return Ok(-log);
        }
        // Scale of Kelly's statistic; lower bound of the others, whose loss factors are at most 1.
        let least = libm::expm1(-log / self.shape() as f64);
        Ok(match self.statistic {
            Statistic::Kelly => least / (1.0 + least),
            Statistic::Ace => {
                let scale = self.solve(false_alarm_probability, least);
                scale / (1.0 + scale)
            }
            Statistic::Amf | Statistic::MatchedFilter => self.solve(false_alarm_probability, least),
        })
    }

    /// Probability that a cell with a target exceeds `threshold`. `snr` is the output SNR of the filter matched to the true covariance, `|a|^2 s^H R^-1 s` with `|a|^2` the mean power: a power ratio.
    ///
    /// # Panics
    /// If `snr` is negative or NaN.
    pub fn detection_probability(&self, threshold: f64, snr: f64, target: TargetModel) -> f64 {
        assert!(snr >= 0.0, "expected an SNR of 0 or more, found {snr}");
        let scale = match self.odds(threshold) {
            Odds::Always => return 1.0,
            Odds::Never => return 0.0,
            Odds::Scale(scale) => scale,
        };
        let shape = self.shape();
        match (self.statistic, target) {
            (Statistic::MatchedFilter, TargetModel::Swerling0) => marcum_q(snr, scale),
            (Statistic::MatchedFilter, TargetModel::Swerling1) => libm::exp(-scale / (1.0 + snr)),
            (_, TargetModel::Swerling0) => self.mean(|loss| {
                gamma_exceedance(snr * loss.value, self.conditional(scale, loss), shape)
            }),
            (_, TargetModel::Swerling1) => self.mean(|loss| {
                let power = 1.0 + snr * loss.value;
                exponential_exceedance(self.conditional(scale, loss) / power, shape)
            }),
        }
    }

    /// Shape `L = K - N + 1` of the Gamma variable.
    fn shape(&self) -> usize {
        (self.snapshots + 1).saturating_sub(self.degrees_of_freedom)
    }

    fn odds(&self, threshold: f64) -> Odds {
        if threshold <= 0.0 {
            return Odds::Always;
        }
        match self.statistic {
            Statistic::MatchedFilter | Statistic::Amf => Odds::Scale(threshold),
            Statistic::Kelly | Statistic::Ace if threshold >= 1.0 => Odds::Never,
            Statistic::Kelly | Statistic::Ace => Odds::Scale(threshold / (1.0 - threshold)),
        }
    }

    /// Level of `u` (module documentation) for a given loss factor.
    fn conditional(&self, scale: f64, loss: LossFactor) -> f64 {
        match self.statistic {
            Statistic::MatchedFilter | Statistic::Kelly => scale,
            Statistic::Amf => scale * loss.value,
            Statistic::Ace => scale * loss.complement,
        }
    }

    fn exceedance(&self, scale: f64) -> f64 {
        match self.statistic {
            Statistic::MatchedFilter => libm::exp(-scale),
            Statistic::Kelly => exponential_exceedance(scale, self.shape()),
            Statistic::Amf | Statistic::Ace => self
                .mean(|loss| exponential_exceedance(self.conditional(scale, loss), self.shape())),
        }
    }

    fn mean(&self, function: impl Fn(LossFactor) -> f64) -> f64 {
        expectation(self.degrees_of_freedom, self.snapshots, function)
    }

    /// Scale of `least` or more with this false-alarm probability, between powers of two times `least`, by the Illinois method on the logarithm of the
    /// probability, which is nearly linear.
    fn solve(&self, probability: f64, least: f64) -> f64 {
        let excess = |scale: f64| libm::log(self.exceedance(scale) / probability);
        let mut high = (2.0 * least, excess(2.0 * least));
        let mut low = high;
        while high.1 > 0.0 {
            low = high;
            high = (2.0 * high.0, excess(2.0 * high.0));
        }
        if low.0 == high.0 {
            low = (0.5 * high.0, excess(0.5 * high.0));
        }
        let mut last_was_high = None;
        for _ in 0..MAX_STEPS {
            let middle = match low.1.is_finite() && high.1.is_finite() {
                true => low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1),
                false => 0.5 * (low.0 + high.0),
            };
            let there = (middle, excess(middle));
            if there.1.abs() <= SOLVED || middle <= low.0 || middle >= high.0 {
                return middle;
            }
            let is_high = there.1 <= 0.0;
            // The other end is weighted down if it stays.
            let weight = if last_was_high == Some(is_high) {
                0.5
            } else {
                1.0
            };
            match is_high {
                true => (high, low.1) = (there, weight * low.1),
                false => (low, high.1) = (there, weight * high.1),
            }
            last_was_high = Some(is_high);
        }
        high.0
    }
}

/// Relative error of the probability of a solved scale, and the largest number of steps to it.
const SOLVED: f64 = 1e-12;
const MAX_STEPS: usize = 100;

/// Threshold as a scale of the Gamma variable.
enum Odds {
    /// Threshold of 0 or less.
    Always,
    /// Threshold of 1 or more, for a statistic of at most 1.
    Never,
    Scale(f64),
}
