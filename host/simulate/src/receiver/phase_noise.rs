//! Phase noise of the oscillator.
//!
//! One random process for the whole collection, evaluated at any time: a sum of sinusoids, one in each of 24 cells
//! per octave of the table's offset frequencies, at a random frequency in its cell and with random phase,
//!
//! ```text
//! phi(t) = sum_i 2 sqrt(L(f_i) df_i) cos(2 pi f_i t + theta_i)
//! ```
//!
//! Its one-sided spectrum is `2 L(f)`, according to the definition of `L`: each term has the power `2 L df`. Memory is
//! bounded by the number of octaves, and samples are computed independently.
//!
//! Transmission and reception share the oscillator. An echo with delay `tau` therefore has `phi(t - tau) - phi(t -
//! t_m)`, with `t_m` the delay of the copy with which it is mixed (0 except for some FMCW radars): at offset `f`, a
//! factor of `2 sin(pi f (tau - t_m))` in amplitude (range correlation).
//!
//! Neglected: one delay, that of the reference, is used for all scatterers of a pulse. The noise of an echo that
//! arrives `e` later differs at offset `f` by the fraction `2 sin(pi f e)`: 6 % for 100 m and 30 kHz. Offsets beyond
//! half the sample rate alias, as without a filter. At resolutions finer than 1/24 octave the spectrum consists of
//! lines.
//!
//! Cost: 10 operations per sinusoid and sample. Accuracy: the test below compares the spectrum with `L`.

use num_complex::Complex64;

use super::Moment;
use super::stream::{Kind, stream};
use crate::random::unit;
use subaperture_model::radar::{PhaseNoise, Waveform};
use subaperture_model::units::power_of_db;
use subaperture_signal::phase::{cis, phasor};

/// Sinusoids per octave of offset frequency.
const PER_OCTAVE: f64 = 24.0;

/// Phase noise process.
#[derive(Clone, Debug)]
pub(super) struct Oscillator {
    lines: Vec<Line>,
}

#[derive(Clone, Copy, Debug)]
struct Line {
    offset_hz: f64,
    amplitude: f64,
    /// Phase at time 0, turns.
    turns: f64,
}

impl Oscillator {
    pub(super) fn new(noise: &PhaseNoise, seed: u64) -> Result<Self, String> {
        let levels = &noise.levels;
        let rising = levels.windows(2).all(|pair| pair[0].0 < pair[1].0);
        let sound = |&(offset_hz, level): &(f64, f64)| {
            offset_hz > 0.0 && offset_hz.is_finite() && level.is_finite()
        };
        if levels.len() < 2 || !rising || !levels.iter().all(sound) {
            return Err(format!(
                "phase noise {levels:?}: expected two or more positive, ascending offsets with finite levels"
            ));
        }
        let (first_hz, last_hz) = (levels[0].0, levels[levels.len() - 1].0);
        let octaves = libm::log2(last_hz / first_hz);
        let cells = (octaves * PER_OCTAVE).ceil() as usize;
        let edge = |i: usize| first_hz * libm::exp2(octaves * i as f64 / cells as f64);
        let mut random = stream(seed, Kind::PhaseNoise, 0, 0);
        let lines = (0..cells).map(|i| {
            let (low_hz, high_hz) = (edge(i), edge(i + 1));
            let place = unit(&mut random);
            let offset_hz = low_hz * libm::pow(high_hz / low_hz, place);
            let power = power_of_db(level_db(levels, (low_hz * high_hz).sqrt()));
            Line {
                offset_hz,
                amplitude: 2.0 * (power * (high_hz - low_hz)).sqrt(),
                turns: unit(&mut random),
            }
        });
        Ok(Self {
            lines: lines.collect(),
        })
    }

    /// Rotate the samples of a pulse by the phase noise at their times.
    pub(super) fn disturb(&self, moment: &Moment, samples: &mut [Complex64]) {
        let mixer_s = match *moment.waveform {
            Waveform::Fmcw { mixer_delay_s, .. } => mixer_delay_s,
            _ => 0.0,
        };
        let begin_s = moment.waveform.sample_s(0);
        let step_s = moment.waveform.sample_s(1) - begin_s;
        let begin_s = moment.time_s + begin_s;
        let mut phase_rad = vec![0.0; samples.len()];
        for line in &self.lines {
            let at = |time_s: f64| phasor(line.offset_hz * time_s + line.turns);
            let difference = at(begin_s - moment.delay_s) - at(begin_s - mixer_s);
            let mut value = difference * line.amplitude;
            let step = phasor(line.offset_hz * step_s);
            for phase in &mut phase_rad {
                *phase += value.re;
                value *= step;
            }
        }
        for (z, phase) in samples.iter_mut().zip(phase_rad) {
            *z *= cis(phase);
        }
    }
}

/// `L` interpolated between the table's offsets, linear on logarithmic axes.
fn level_db(levels: &[(f64, f64)], offset_hz: f64) -> f64 {
    let above = levels.partition_point(|&(f, _)| f < offset_hz);
    let above = above.clamp(1, levels.len() - 1);
    let ((f0, l0), (f1, l1)) = (levels[above - 1], levels[above]);
    l0 + (l1 - l0) * libm::log(offset_hz / f0) / libm::log(f1 / f0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compare the spectrum of the difference process at several offsets with `4 sin^2(pi f tau) L(f)`.
    ///
    /// Samples at 1 MHz for 65.536 ms, Hann window, power summed over a band of half an octave and over 16 seeds: 12
    /// lines per seed. The power of each line is exact except for its position in the cell (slope of the spectrum times
    /// the cell, random, below 10 % per line) and for lines at the band's edges (2 of 12, inside or outside: 8 % RMS
    /// per seed). Over 16 seeds: below 3 %. Beats between lines, 12 per band and seed, average to at most `1 / sqrt(12
    /// * 16)`, 7 %. Bound: 3 times 8 % is 1 dB.
    #[test]
    fn phase_noise_spectrum_matches_table() {
        let noise = PhaseNoise {
            levels: vec![(1e3, -90.0), (1e4, -100.0), (4e5, -120.0)],
        };
        let delay_s = 1.7e-6;
        let (rate_hz, count) = (1e6, 65536usize);
        let waveform = Waveform::Fmcw {
            start_hz: 1e9,
            chirp_hz_s: 1e9,
            sample_rate_hz: rate_hz,
            num_samples: count,
            mixer_delay_s: 0.0,
        };
        let bands = [2e3, 5e3, 2e4, 5e4, 2e5];
        let mut measured = [0.0; 5];
        let seeds = 16;
        let fft = subaperture_fft::forward(count);
        for seed in 0..seeds {
            let oscillator = Oscillator::new(&noise, seed).unwrap();
            let moment = Moment {
                waveform: &waveform,
                pulse: 0,
                receiver: 0,
                time_s: 3.0,
                delay_s,
            };
            let mut samples = vec![Complex64::ONE; count];
            oscillator.disturb(&moment, &mut samples);
            let hann = |i: usize| {
                let u = std::f64::consts::TAU * i as f64 / count as f64;
                (0.5 - 0.5 * u.cos()) / 0.375f64.sqrt()
            };
            let mut spectrum: Vec<_> = samples
                .iter()
                .enumerate()
                .map(|(i, z)| Complex64::from(z.arg() * hann(i)))
                .collect();
            fft.process(&mut spectrum);
            for (sum, centre_hz) in measured.iter_mut().zip(bands) {
                let bin = |f: f64| (f / rate_hz * count as f64).round() as usize;
                let band = bin(centre_hz * 0.5f64.powf(0.25))..bin(centre_hz * 2f64.powf(0.25));
                // One-sided power: both halves of the spectrum of a real signal.
                let power: f64 = spectrum[band].iter().map(Complex64::norm_sqr).sum();
                *sum += 2.0 * power / (count as f64 * count as f64) / seeds as f64;
            }
        }
        for (power, centre_hz) in measured.into_iter().zip(bands) {
            // Integral of 2 L 4 sin^2 over the band in 1000 steps; L is written out from the table.
            let (low, high) = (centre_hz * 0.5f64.powf(0.25), centre_hz * 2f64.powf(0.25));
            let step = (high - low) / 1000.0;
            let expected: f64 = (0..1000)
                .map(|i| {
                    let f = low + (f64::from(i) + 0.5) * step;
                    let slope = 20.0 / 40f64.log10();
                    let level_db = if f < 1e4 {
                        -90.0 - 10.0 * (f / 1e3).log10()
                    } else {
                        -100.0 - slope * (f / 1e4).log10()
                    };
                    let sine = (std::f64::consts::PI * f * delay_s).sin();
                    2.0 * 10f64.powf(level_db / 10.0) * 4.0 * sine * sine * step
                })
                .sum();
            let error_db = 10.0 * (power / expected).log10();
            println!("{centre_hz} Hz: {error_db:.2} dB off");
            assert!(error_db.abs() < 1.0, "{centre_hz} Hz: {error_db} dB");
        }
    }

    #[test]
    fn phase_noise_tables_without_ascending_offsets_are_refused() {
        for levels in [vec![(1e3, -90.0)], vec![(1e4, -90.0), (1e3, -100.0)]] {
            assert!(Oscillator::new(&PhaseNoise { levels }, 1).is_err());
        }
    }
}
