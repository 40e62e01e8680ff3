//! Constant false-alarm rate (CFAR) detection in a range profile whose power is summed over channels.
//!
//! **Equation.** [`subaperture_core::motion::threshold`], for cell averaging and order statistics. C (7.8) multiplies the sum of the training cells' powers, not
//! amplitudes.
//!
//! **Windows.** A window over frequency correlates neighbouring cells. The sum of training cells then scatters like that of `N_eff = N^2 / sum_ij |rho_ij|^2` independent cells, `rho` being the correlation of the noise,
//! and is taken for a Gamma variable of that mean and variance; ordered cells are taken for independent. False alarms relative to the set probability, in 51200 cells at 0.01 (`tests/noise.rs`): 0.98 to 1.04 without a window;
//! under Hamming's window 0.92 to 1.06 for averages, 1.25 to 1.27 for order statistics.
//!
//! At the ends of a profile the existing cells count, with the factor of their number. Cells that are not finite are skipped. The first of equal neighbours is the peak.
//!
//! The core's detector (`subaperture_core::cfar`) averages over one channel's map in bounded memory. This detector handles channels, windows and order statistics.

use subaperture_core::motion::threshold::{
    Bisection, cell_averaging_factor, log_order_density, order_statistic_factor, rank_of,
};

/// Largest number of training cells on a side: noise is hardly homogeneous over more.
pub const MAX_TRAINING: usize = 64;

/// Settings of the detector, in range cells of `c / (2 B)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cfar {
    /// Guard cells next to the cell under test, on either side; 3 by default.
    pub guard: usize,
    /// Training cells beyond the guard cells, on either side, 1 to [`MAX_TRAINING`]; 12 by default.
    pub training: usize,
    /// Probability of false alarm a cell, above 0 and below 1; 1e-5 by default.
    pub false_alarm_probability: f64,
    /// Statistic of the training cells; the order statistic of rank 0.6 by default.
    pub level: Level,
}

/// Statistic of the training cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// Mean (cell averaging): best in homogeneous noise.
    Mean,
    /// Order statistic of this rank, as a fraction of their number, above 0 and at most 1: other targets among the training cells raise it little.
    Ordered(f64),
}

impl Default for Cfar {
    /// Three guard cells and 12 training cells on either side, rank 15 of 24: up to nine training cells may be other targets.
    fn default() -> Self {
        Self {
            guard: 3,
            training: 12,
            false_alarm_probability: 1e-5,
            level: Level::Ordered(0.6),
        }
    }
}

/// Peak above the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Bin of the peak.
    pub bin: usize,
    /// Power of the bin, summed over channels.
    pub power: f64,
    /// Ratio of the power to the threshold.
    pub above: f64,
}

/// Result of a search.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Search {
    /// Detected peaks, strongest first.
    pub peaks: Vec<Peak>,
    /// Number of bins tested.
    pub tested: usize,
    /// Number of bins above the threshold, peaks or not.
    pub above: usize,
    /// Highest ratio of a bin's power to its threshold.
    pub most: f64,
}

/// Detector for profiles of one length and window.
#[derive(Clone, Debug)]
pub struct Detector {
    cfar: Cfar,
    /// Bins a range cell.
    stride: usize,
    /// Factors from the statistic to the threshold, by the numbers of training cells on either side.
    factors: Vec<f64>,
}

impl Detector {
    /// Detector for powers summed over `channels`, with `stride` bins a cell and the `window` weights over frequency.
    ///
    /// # Errors
    /// Text that names the invalid setting.
    pub fn new(
        cfar: Cfar,
        channels: usize,
        stride: usize,
        window: &[f64],
    ) -> Result<Self, &'static str> {
        let probability = cfar.false_alarm_probability;
        if !(probability > 0.0 && probability < 1.0) {
            return Err("expected a probability of false alarm above 0 and below 1");
        }
        if !(1..=MAX_TRAINING).contains(&cfar.training) {
            return Err("expected 1 to 64 training cells on a side");
        }
        if cfar.guard > MAX_TRAINING {
            return Err("expected at most 64 guard cells on a side");
        }
        if let Level::Ordered(rank) = cfar.level
            && !(rank > 0.0 && rank <= 1.0)
        {
            return Err("expected a rank of the ordered training cell above 0 and at most 1");
        }
        if channels == 0 || stride == 0 || window.is_empty() {
            return Err("expected at least one channel, one bin per range cell and one sample");
        }
        let width = cfar.training + 1;
        let scatter = scatter(window, cfar.training);
        let mut ordered = vec![None; 2 * cfar.training + 1];
        let mut factor = |before: usize, after: usize| {
            let count = before + after;
            match cfar.level {
                _ if count == 0 => f64::INFINITY,
                Level::Mean => {
                    let effective = (count * count) as f64 / (scatter[before] + scatter[after]);
                    effective * cell_averaging_factor(probability, channels, effective, SEARCH)
                }
                Level::Ordered(rank) => *ordered[count].get_or_insert_with(|| {
                    ordering(probability, channels, count, rank_of(rank, count))
                }),
            }
        };
        let factors = (0..width * width).map(|i| factor(i / width, i % width));
        Ok(Self {
            cfar,
            stride,
            factors: factors.collect(),
        })
    }

    /// Search a profile's powers. Only bins of power `least` or more are peaks.
    pub fn search(&self, power: &[f64], least: f64) -> Search {
        let mut search = Search::default();
        let mut cells = Vec::with_capacity(2 * self.cfar.training);
        for (bin, &own) in power.iter().enumerate() {
            let Some(threshold) = self.threshold(power, bin, &mut cells) else {
                continue;
            };
            if !own.is_finite() {
                continue;
            }
            search.tested += 1;
            let above = match threshold > 0.0 {
                true => own / threshold,
                false if own > 0.0 => f64::INFINITY,
                false => 0.0,
            };
            search.most = search.most.max(above);
            if above > 1.0 {
                search.above += 1;
                if own >= least && self.is_peak(power, bin) {
                    search.peaks.push(Peak {
                        bin,
                        power: own,
                        above,
                    });
                }
            }
        }
        search.peaks.sort_by(|a, b| b.power.total_cmp(&a.power));
        search
    }

    /// Number of training cells on a side.
    pub(crate) fn training_cells(&self) -> usize {
        self.cfar.training
    }

    /// Bins of the training cells of a bin among `count`, nearest first, before and after it: up to `times` as many as the detector trains on.
    pub(crate) fn cells(
        &self,
        bin: usize,
        count: usize,
        times: usize,
    ) -> [impl Iterator<Item = usize> + use<>; 2] {
        let (guard, stride) = (self.cfar.guard, self.stride);
        let cells = times * self.cfar.training;
        [true, false].map(move |before| {
            (0..cells).filter_map(move |i| {
                let away = (guard + 1 + i) * stride;
                match before {
                    true => bin.checked_sub(away),
                    false => Some(bin + away).filter(|bin| *bin < count),
                }
            })
        })
    }

    /// Powers of the training cells of a bin, before and after it.
    fn training<'p>(
        &self,
        power: &'p [f64],
        bin: usize,
    ) -> [impl Iterator<Item = f64> + use<'p>; 2] {
        let is_number = |p: &f64| p.is_finite();
        self.cells(bin, power.len(), 1)
            .map(|cells| cells.map(|cell| power[cell]).filter(is_number))
    }

    fn threshold(&self, power: &[f64], bin: usize, cells: &mut Vec<f64>) -> Option<f64> {
        let [before, after] = self.training(power, bin);
        cells.clear();
        cells.extend(before);
        let before = cells.len();
        cells.extend(after);
        let count = cells.len();
        if count == 0 {
            return None;
        }
        let level = match self.cfar.level {
            Level::Mean => cells.iter().sum::<f64>() / count as f64,
            Level::Ordered(rank) => {
                let place = rank_of(rank, count) - 1;
                *cells.select_nth_unstable_by(place, f64::total_cmp).1
            }
        };
        let width = self.cfar.training + 1;
        Some(level * self.factors[before * width + count - before])
    }

    /// Whether no bin within a cell exceeds this one.
    fn is_peak(&self, power: &[f64], bin: usize) -> bool {
        let own = power[bin];
        let first = bin.saturating_sub(self.stride);
        let last = (bin + self.stride).min(power.len() - 1);
        !power[first..bin].iter().any(|&p| p >= own)
            && !power[bin + 1..=last].iter().any(|&p| p > own)
    }
}

/// Variance of the sum of 0 to `most` neighbouring cells, in units of that of one cell: `sum_ij |rho_(i-j)|^2`.
fn scatter(window: &[f64], most: usize) -> Vec<f64> {
    let total: f64 = window.iter().map(|w| w * w).sum();
    let alike = |lag: usize| {
        let turns = lag as f64 / window.len() as f64;
        let (re, im) = window
            .iter()
            .enumerate()
            .fold((0.0, 0.0), |(re, im), (k, w)| {
                let (sin, cos) = libm::sincos(std::f64::consts::TAU * (turns * k as f64).fract());
                (re + w * w * cos, im + w * w * sin)
            });
        (re * re + im * im) / (total * total)
    };
    let alike: Vec<f64> = (0..most.max(1)).map(alike).collect();
    let of = |count: usize| {
        let apart = |lag: usize| {
            let pairs = (count - lag) as f64 * if lag == 0 { 1.0 } else { 2.0 };
            pairs * alike[lag]
        };
        (0..count).map(apart).sum()
    };
    (0..=most).map(of).collect()
}

/// Search to the precision of float64.
const SEARCH: Bisection = Bisection {
    log2: [-60.0, 60.0],
    steps: 60,
};

/// Factor that a cell exceeds with this probability, over the `rank`-th smallest of `count` cells.
fn ordering(probability: f64, channels: usize, count: usize, rank: usize) -> f64 {
    /// Steps over the logarithm of the level: rare false alarms come from low levels.
    const STEPS: usize = 1000;
    const LOWEST: f64 = 1e-14;
    // The density is below 1e-15 beyond.
    let most = channels as f64 + 12.0 * (channels as f64).sqrt() + 40.0;
    let (n, r, shape) = (count as f64, rank as f64, channels as f64);
    let log_choices = libm::lgamma(n + 1.0) - libm::lgamma(r) - libm::lgamma(n - r + 1.0);
    let step = libm::log(most / LOWEST) / STEPS as f64;
    // At the middle of each step.
    let level = |i: usize| {
        let x = LOWEST * libm::exp((i as f64 + 0.5) * step);
        let [smaller, larger, own] = log_order_density(channels, (rank, count), x, leading);
        let log = log_choices + smaller + larger + (own - libm::lgamma(shape));
        (x, libm::exp(log))
    };
    let levels: Vec<(f64, f64)> = (0..STEPS).map(level).collect();
    order_statistic_factor(probability, channels, levels.iter().copied(), SEARCH)
}

/// Leading term of [`threshold::gamma_lower_tail`](subaperture_core::motion::threshold::gamma_lower_tail) for any number of channels.
fn leading(shape: usize, x: f64) -> f64 {
    libm::exp(shape as f64 * libm::log(x) - x - libm::lgamma(shape as f64 + 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C (7.8) for one channel without a window, and Rohling's product for order statistics.
    #[test]
    fn threshold_factors_agree_with_closed_forms_for_one_channel() {
        for (probability, cells) in [(1e-2f64, 5), (1e-4, 16), (1e-6, 32)] {
            let n = cells as f64;
            let known = probability.powf(-1.0 / n) - 1.0;
            let got = cell_averaging_factor(probability, 1, n, SEARCH);
            assert!((got / known - 1.0).abs() < 1e-12, "{cells}: {got} {known}");
            // Pfa = prod_(i < r) (N - i) / (N - i + k) (Rohling 1983).
            let rank = (3 * cells) / 4;
            let factor = ordering(probability, 1, cells, rank);
            let product: f64 = (0..rank)
                .map(|i| (n - i as f64) / (n - i as f64 + factor))
                .product();
            // The numerical integral over 1000 steps has a relative error of a few thousandths.
            assert!((product / probability - 1.0).abs() < 0.02, "{product}");
        }
    }

    #[test]
    fn profile_edges_and_non_finite_cells_are_skipped() {
        let cfar = Cfar {
            guard: 1,
            training: 3,
            false_alarm_probability: 1e-3,
            level: Level::Mean,
        };
        let detector = Detector::new(cfar, 1, 1, &[1.0; 64]).unwrap();
        let mut power = vec![1.0; 20];
        power[0] = 100.0;
        power[9] = 400.0;
        power[11] = f64::NAN;
        let search = detector.search(&power, 0.0);
        let bins: Vec<usize> = search.peaks.iter().map(|peak| peak.bin).collect();
        assert_eq!((bins, search.tested), (vec![9, 0], 19));
        // Three cells after the first one: 1000^(1/3) - 1 times their sum of 3.
        let above = search.peaks[1].above;
        assert!((above - 100.0 / 27.0).abs() < 1e-9, "{above}");
        assert_eq!(detector.search(&power, 200.0).peaks.len(), 1);
        assert_eq!(detector.search(&[], 0.0), Search::default());
        assert_eq!(detector.search(&[0.0; 30], 0.0).peaks, []);
    }

    #[test]
    fn invalid_detector_settings_are_refused() {
        let with = |change: fn(&mut Cfar)| {
            let mut cfar = Cfar::default();
            change(&mut cfar);
            Detector::new(cfar, 2, 2, &[1.0; 8]).is_err()
        };
        assert!(!with(|_| ()));
        assert!(with(|cfar| cfar.false_alarm_probability = f64::NAN));
        assert!(with(|cfar| cfar.training = 0));
        assert!(with(|cfar| cfar.guard = usize::MAX));
        assert!(with(|cfar| cfar.level = Level::Ordered(0.0)));
    }
}
