//! Detection at a constant false-alarm rate in a range profile whose power is summed over channels.
//!
//! **Equation.** Of a cell of power `p`, summed over `C` channels of independent noise, and `N` training cells around it, beyond the guard cells:
//!
//! ```text
//! averaging   detected if  p > k sum x_n,    Pfa = sum_(i < C) binom(C N + i - 1, i) k^i / (1 + k)^(C N + i)
//! ordered     detected if  p > k x_(r),      Pfa = E Q(C, k x_(r)),   x_(r) the r-th smallest,  Q(C, x) = exp(-x) sum_(i < C) x^i / i!
//! ```
//!
//! Of complex Gaussian noise the power of a cell is Gamma distributed with shape `C`, the sum of `N` of them with shape `C N`; given the sum, the
//! cell is above with probability `Q(C, k sum)`, whose mean is the series above: `p / (p + sum)` is Beta distributed. For `C = 1` it
//! is `(1 + k)^-N`, so that `k = Pfa^(-1/N) - 1`: C (7.8), which multiplies the sum of the training cells' powers and not an amplitude.
//! The density of `x_(r)` is that of the order statistic, `r binom(N, r) F^(r-1) (1 - F)^(N-r) f`, and its mean of `Q` is summed numerically.
//!
//! **Windows.** A window over frequency makes neighbouring cells alike. The sum of training cells then scatters as one of fewer,
//! `N_eff = N^2 / sum_ij |rho_ij|^2`, with `rho` the noise's correlation, and is taken for a Gamma variable of that mean and scatter; ordered cells are taken as if they
//! were independent. False alarms counted in 51200 cells at 0.01 asked for (`tests/noise.rs`): 0.98 to 1.04 times as many without a window; under Hamming's 0.92 to 1.06
//! times by averages, 1.25 to 1.27 times by order.
//!
//! At a profile's ends the cells that there are count, with the factor of their number. Cells that are no numbers are as if they were not there. Of
//! equal neighbours the first is the peak.
//!
//! The core's detector (`subaperture_core::cfar`) averages over one channel's map in bounded memory; this one knows channels, windows and order.

/// Most training cells on a side: beyond, a profile's noise is hardly even.
pub const MOST_TRAINING: usize = 64;

/// Settings of the detector, in cells of a range resolution `c / (2 B)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cfar {
    /// Cells next to the cell, on either side, that are not trained on.
    pub guard: usize,
    /// Training cells next to those, on either side, 1 to [`MOST_TRAINING`].
    pub training: usize,
    /// Wanted false alarms a cell, above 0 and below 1.
    pub false_alarm_probability: f64,
    /// What of the training cells is compared with.
    pub level: Level,
}

/// What of the training cells is compared with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Level {
    /// Their mean: best in even noise.
    Mean,
    /// The cell of this rank, as a fraction of their number above 0 and at most 1: other targets among them raise it little.
    Ordered(f64),
}

impl Default for Cfar {
    /// Three guard cells, 12 training cells on either side, of which the 15th counts: up to nine of them may be other targets.
    fn default() -> Self {
        Self {
            guard: 3,
            training: 12,
            false_alarm_probability: 1e-5,
            level: Level::Ordered(0.6),
        }
    }
}

/// A peak above the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Its bin.
    pub bin: usize,
    /// Its power.
    pub power: f64,
    /// How far above the threshold, as a ratio of powers.
    pub above: f64,
}

/// What was found in a profile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Search {
    /// Strongest first.
    pub peaks: Vec<Peak>,
    /// Bins compared.
    pub tested: usize,
    /// Of these above the threshold, peaks or not.
    pub above: usize,
    /// The most that any bin reached, as a ratio of its threshold.
    pub most: f64,
}

/// The detector for profiles of one kind.
#[derive(Clone, Debug)]
pub struct Detector {
    cfar: Cfar,
    /// Bins a cell.
    stride: usize,
    /// Threshold over the level of training cells, by how many there are on either side.
    factors: Vec<f64>,
}

impl Detector {
    /// For powers summed over `channels`, `stride` bins a cell; `window` are the weights over frequency.
    ///
    /// # Errors
    /// What is wrong with the settings.
    pub fn new(
        cfar: Cfar,
        channels: usize,
        stride: usize,
        window: &[f64],
    ) -> Result<Self, &'static str> {
        let probability = cfar.false_alarm_probability;
        if !(probability > 0.0 && probability < 1.0) {
            return Err("the probability of false alarm must be above 0 and below 1");
        }
        if !(1..=MOST_TRAINING).contains(&cfar.training) {
            return Err("training cells must be 1 to 64 on a side");
        }
        if cfar.guard > MOST_TRAINING {
            return Err("guard cells must be 64 at most on a side");
        }
        if let Level::Ordered(rank) = cfar.level
            && !(rank > 0.0 && rank <= 1.0)
        {
            return Err("the rank of the ordered training cell must be above 0 and at most 1");
        }
        if channels == 0 || stride == 0 || window.is_empty() {
            return Err("a detector is for one channel, bin and sample at least");
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
                    effective * averaging(probability, channels, effective)
                }
                Level::Ordered(rank) => *ordered[count].get_or_insert_with(|| {
                    ordering(probability, channels, count, place(rank, count))
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

    /// Searches a profile's powers; what lies below `least` is no target, whatever is around it.
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

    /// Powers of the training cells of a bin, before it and after it.
    pub(crate) fn training<'p>(
        &self,
        power: &'p [f64],
        bin: usize,
    ) -> [impl Iterator<Item = f64> + 'p; 2] {
        let (guard, stride, count) = (self.cfar.guard, self.stride, self.cfar.training);
        let cell = move |at: Option<usize>| power.get(at?).copied().filter(|p| p.is_finite());
        let away = move |i: usize| (guard + 1 + i) * stride;
        [true, false].map(move |before| {
            (0..count).filter_map(move |i| {
                cell(match before {
                    true => bin.checked_sub(away(i)),
                    false => Some(bin + away(i)),
                })
            })
        })
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
                let place = place(rank, count) - 1;
                *cells.select_nth_unstable_by(place, f64::total_cmp).1
            }
        };
        let width = self.cfar.training + 1;
        Some(level * self.factors[before * width + count - before])
    }

    /// Whether no bin within a cell exceeds it.
    fn is_peak(&self, power: &[f64], bin: usize) -> bool {
        let own = power[bin];
        let first = bin.saturating_sub(self.stride);
        let last = (bin + self.stride).min(power.len() - 1);
        !power[first..bin].iter().any(|&p| p >= own)
            && !power[bin + 1..=last].iter().any(|&p| p > own)
    }
}

/// The rank of so many cells, from 1.
fn place(rank: f64, count: usize) -> usize {
    ((rank * count as f64).ceil() as usize).clamp(1, count)
}

/// By how many cells' worth sums of up to `most` cells in a row scatter: `sum_ij |rho_(i-j)|^2`.
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

/// The factor of a Gamma variable of shape `channels * cells`, of which a cell of shape `channels` is above so rarely.
fn averaging(probability: f64, channels: usize, cells: f64) -> f64 {
    let shape = channels as f64 * cells;
    solve(probability, |k| {
        let (mut term, mut sum) = (libm::exp(-shape * libm::log1p(k)), 0.0);
        for i in 0..channels {
            sum += term;
            term *= (shape + i as f64) / (i as f64 + 1.0) * k / (1.0 + k);
        }
        sum
    })
}

/// The factor of the `rank`-th smallest of `count` cells, of which another is above so rarely.
fn ordering(probability: f64, channels: usize, count: usize, rank: usize) -> f64 {
    /// Of the sum over the logarithm of the level: rare false alarms come of low levels.
    const STEPS: usize = 1000;
    const LOWEST: f64 = 1e-14;
    // Beyond, the density is below 1e-15.
    let most = channels as f64 + 12.0 * (channels as f64).sqrt() + 40.0;
    let (n, r, shape) = (count as f64, rank as f64, channels as f64);
    let log_choices = libm::lgamma(n + 1.0) - libm::lgamma(r) - libm::lgamma(n - r + 1.0);
    let step = libm::log(most / LOWEST) / STEPS as f64;
    // At the middle of each step.
    let density = |i: usize| {
        let x = LOWEST * libm::exp((i as f64 + 0.5) * step);
        let log_own = shape * libm::log(x) - x - libm::lgamma(shape);
        let below = match rank {
            1 => 0.0,
            _ => (r - 1.0) * libm::log(head(channels, x)),
        };
        let log = log_choices + below + (n - r) * libm::log(tail(channels, x)) + log_own;
        (x, libm::exp(log))
    };
    let densities: Vec<(f64, f64)> = (0..STEPS).map(density).collect();
    let total: f64 = densities.iter().map(|(_, weight)| weight).sum();
    solve(probability, |k| {
        let each = densities.iter();
        each.map(|(x, weight)| weight * tail(channels, k * x))
            .sum::<f64>()
            / total
    })
}

/// `exp(-x) sum_(i < shape) x^i / i!`: how often a Gamma variable is above.
fn tail(shape: usize, x: f64) -> f64 {
    let (mut term, mut sum) = (libm::exp(-x), 0.0);
    for i in 0..shape {
        sum += term;
        term *= x / (i as f64 + 1.0);
    }
    sum
}

/// How often it is below: what [`tail`] leaves, without the rounding of 1.
fn head(shape: usize, x: f64) -> f64 {
    if x > 1.0 {
        return 1.0 - tail(shape, x);
    }
    let first = libm::exp(shape as f64 * libm::log(x) - x - libm::lgamma(shape as f64 + 1.0));
    let (mut term, mut sum) = (first, 0.0);
    for i in 0..20 {
        sum += term;
        term *= x / (shape + i + 1) as f64;
    }
    sum
}

/// Where what falls from 1 to 0 has come down to `probability`.
fn solve(probability: f64, falling: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (-60.0, 60.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match falling(libm::exp2(middle)) > probability {
            true => low = middle,
            false => high = middle,
        }
    }
    libm::exp2(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C (7.8) for one channel without a window, and the known product for ordered cells.
    #[test]
    fn factors_are_the_known_ones_of_one_channel() {
        for (probability, cells) in [(1e-2f64, 5), (1e-4, 16), (1e-6, 32)] {
            let n = cells as f64;
            let known = probability.powf(-1.0 / n) - 1.0;
            let got = averaging(probability, 1, n);
            assert!((got / known - 1.0).abs() < 1e-12, "{cells}: {got} {known}");
            // Pfa = prod_(i < r) (N - i) / (N - i + k) (Rohling 1983).
            let rank = (3 * cells) / 4;
            let factor = ordering(probability, 1, cells, rank);
            let product: f64 = (0..rank)
                .map(|i| (n - i as f64) / (n - i as f64 + factor))
                .product();
            // Sums of a thousand steps are good to a few thousandths.
            assert!((product / probability - 1.0).abs() < 0.02, "{product}");
        }
    }

    #[test]
    fn edges_and_numbers_that_are_none_are_left_out() {
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
    fn settings_that_cannot_be_are_refused() {
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
