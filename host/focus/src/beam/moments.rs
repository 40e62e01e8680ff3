//! Circular moments of the azimuth Doppler spectrum, by autocorrelation over pulses.

use std::ops::Range;

use num_complex::{Complex32, Complex64};

use crate::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Pulse};
use subaperture_signal::phase::{phasor, widen};

/// Relative half-width of the frequency band used for the moments; `nu` varies by the same fraction across it.
const BAND: f64 = 0.025;
/// Approximate samples read at a time: 1 MiB.
const BLOCK_SAMPLES: usize = 1 << 17;
/// Assumed number of correlated frequency samples per independent one, for scenes that fill a part of the unambiguous range.
const ALIKE: f64 = 4.0;
/// Largest standard deviation of the unambiguous centroid, turns, that resolves the Doppler ambiguity.
const DECIDED: f64 = 0.15;

/// Circular moments of the azimuth spectrum: means over the pulses and pairs of pulses that were read.
pub(super) struct Moments {
    pub(super) all: f64,
    pub(super) first: Complex64,
    pub(super) second: Complex64,
    /// Unambiguous centroid at the centre frequency, turns per pulse, from the phase slope of the first moment over frequency, and its standard deviation.
    turns: Option<[f64; 2]>,
}

impl Moments {
    /// Doppler centroid, turns per pulse, modulo one turn.
    pub(super) fn centre(&self) -> f64 {
        angle(self.first) / std::f64::consts::TAU
    }

    /// Unambiguous centroid, turns per pulse, and its standard deviation, if it resolves the ambiguity. It must agree with the aliased centroid within a few
    /// hundredths of a turn.
    pub(super) fn decided(&self) -> Option<[f64; 2]> {
        let centre = self.centre();
        self.turns.filter(|&[turns, deviation]| {
            let fraction = turns - centre - (turns - centre).round();
            deviation < DECIDED && fraction.abs() < 2.0 * DECIDED
        })
    }
}

/// Sums at one frequency: power, and products with the pulse one and two steps before.
#[derive(Clone, Copy, Default)]
struct Sums {
    power: f64,
    first: Complex64,
    second: Complex64,
}

/// Sums over the pulses of a block, and the last two pulses with their numbers.
struct Correlation {
    sums: Vec<Sums>,
    /// Number of pulses, and of pairs one and two steps apart.
    counts: [usize; 3],
    before: [(Option<usize>, Vec<Complex64>); 2],
    row: Vec<Complex64>,
}

impl Correlation {
    fn new(width: usize) -> Self {
        Self {
            sums: vec![Sums::default(); width],
            counts: [0; 3],
            before: [(); 2].map(|()| (None, vec![Complex64::ZERO; width])),
            row: vec![Complex64::ZERO; width],
        }
    }

    /// Forget the last pulses.
    fn restart(&mut self) {
        self.before.iter_mut().for_each(|before| before.0 = None);
    }

    /// Add a pulse at an evenly spaced position, unless it is missing.
    fn add(&mut self, number: usize, pulse: &Pulse, samples: &[Complex32]) {
        if samples.iter().all(|z| *z == Complex32::ZERO) {
            return;
        }
        for (k, (value, z)) in self.row.iter_mut().zip(samples).enumerate() {
            let turns = pulse.frequency_hz(k) * pulse.reference_path_m / SPEED_OF_LIGHT_M_S;
            *value = widen(*z) * phasor(-turns);
        }
        self.counts[0] += 1;
        for (sum, value) in self.sums.iter_mut().zip(&self.row) {
            sum.power += value.norm_sqr();
        }
        for (earlier, row) in &self.before {
            let lag = earlier.map_or(0, |earlier| number - earlier);
            if !(1..=2).contains(&lag) {
                continue;
            }
            self.counts[lag] += 1;
            for ((sum, value), other) in self.sums.iter_mut().zip(&self.row).zip(row) {
                let product = value * other.conj();
                match lag {
                    1 => sum.first += product,
                    _ => sum.second += product,
                }
            }
        }
        let [last, last_but_one] = &mut self.before;
        std::mem::swap(last, last_but_one);
        last.0 = Some(number);
        std::mem::swap(&mut last.1, &mut self.row);
    }
}

/// Moments over the pulses of some blocks; `numbers` are the evenly spaced positions of all pulses.
///
/// # Errors
/// [`FormError::Cancelled`], [`FormError::Read`].
pub(super) fn moments(
    history: &dyn PhaseHistory,
    numbers: &[usize],
    blocks: &[Range<usize>],
    monitor: &dyn Monitor,
) -> Result<Moments, FormError> {
    let collection = history.collection();
    let width = collection.num_samples;
    let pulse = &collection.pulses[0];
    let centre_hz = pulse.frequency_hz(width / 2);
    let off: Vec<f64> = (0..width)
        .map(|k| pulse.frequency_hz(k) / centre_hz - 1.0)
        .collect();
    let mut correlation = Correlation::new(width);
    let most = (BLOCK_SAMPLES / width.max(1)).max(1);
    let mut rows = vec![Complex32::ZERO; most.min(collection.pulses.len()) * width];
    for block in blocks {
        correlation.restart();
        for from in block.clone().step_by(most) {
            if monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
            let pulses = from..(from + most).min(block.end);
            let rows = &mut rows[..pulses.len() * width];
            history.read(pulses.clone(), rows)?;
            for (n, row) in pulses.zip(rows.chunks_exact(width)) {
                correlation.add(numbers[n], &collection.pulses[n], row);
            }
        }
    }
    let Correlation { sums, counts, .. } = correlation;
    // The means over pairs, times the number of pulses.
    let scale = [1, 2].map(|lag| counts[0] as f64 / counts[lag].max(1) as f64);
    let near = || {
        sums.iter()
            .zip(&off)
            .filter(|(_, off)| off.abs() <= BAND)
            .map(|(sum, _)| sum)
    };
    let first: Complex64 = near().map(|sum| sum.first).sum();
    let by_frequency = sums.iter().zip(&off).map(|(sum, &off)| {
        let turned = sum.first * first.conj();
        [off, angle(turned), sum.first.norm()]
    });
    Ok(Moments {
        all: near().map(|sum| sum.power).sum(),
        first: first * scale[0],
        second: near().map(|sum| sum.second).sum::<Complex64>() * scale[1],
        turns: slope(&by_frequency.collect::<Vec<_>>()),
    })
}

/// Slope of phase (radians) over position in turns, and its standard deviation. Each point is (position, phase, weight).
fn slope(points: &[[f64; 3]]) -> Option<[f64; 2]> {
    let weights: f64 = points.iter().map(|[.., w]| w).sum();
    let mean = |i: usize| points.iter().map(|p| p[i] * p[2]).sum::<f64>() / weights;
    let [at, phase_rad] = [mean(0), mean(1)];
    let moment = |f: &dyn Fn(f64, f64) -> f64| {
        points
            .iter()
            .map(|p| p[2] * f(p[0] - at, p[1] - phase_rad))
            .sum::<f64>()
            / weights
    };
    let spread = moment(&|x, _| x * x);
    let slope = moment(&|x, y| x * y) / spread;
    let left = moment(&|x, y| (y - slope * x).powi(2));
    let independent = points.len() as f64 / ALIKE - 2.0;
    let deviation = (left / (spread * independent)).sqrt();
    let turns = [slope, deviation].map(|rad| rad / std::f64::consts::TAU);
    (independent > 0.0 && turns.iter().all(|x| x.is_finite())).then_some(turns)
}

/// Angle of `z`, radians: the same on every platform.
fn angle(z: Complex64) -> f64 {
    libm::atan2(z.im, z.re)
}
