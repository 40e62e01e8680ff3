//! Radio-frequency interference from other transmitters.
//!
//! A tone at `f` is mixed like the echo, with an oscillator that starts every pulse with phase 0: sample `k` is `exp(j
//! 2 pi f t) exp(-j 2 pi phase_lo(t_k))`. The filter before the converter is ideal: it passes frequencies within half
//! the sample rate of the oscillator. In an FMCW sweep, a tone therefore appears as a chirp. For a carrier averaged
//! over its dwell time, the factor is `sinc((f - f_k) dwell_s)`.
//!
//! A noise-like signal is a sum of tones over its band with complex Gaussian amplitudes, drawn anew for every pulse.
//! There are two tones per cell `1 / T` for a pulse of duration `T`, 16 to 4096 in total, so that the signal does not
//! repeat within a pulse (beyond 2048 cells it does).
//!
//! All receivers have the same interference: angle of arrival and propagation are neglected.

use num_complex::Complex64;

use super::Moment;
use super::stream::{Kind, stream};
use crate::random::{complex_normal, unit};
use subaperture_model::radar::{Interferer, Radar, Waveform};
use subaperture_model::units::amplitude_of_db;
use subaperture_signal::phase::phasor;

/// Prepared interferer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interference {
    interferer: Interferer,
    amplitude: f64,
    pri_s: f64,
}

impl Interference {
    pub(super) fn new(interferer: &Interferer, radar: &Radar) -> Result<Self, String> {
        let i = interferer;
        let amplitude = amplitude_of_db(i.power_db);
        let sound = i.frequency_hz.is_finite() && i.bandwidth_hz.is_finite();
        if !(sound
            && i.bandwidth_hz >= 0.0
            && amplitude.is_finite()
            && (0.0..=1.0).contains(&i.duty))
        {
            return Err(format!(
                "{i:?}: expected finite values, a bandwidth that is not negative, and a duty from 0 to 1"
            ));
        }
        Ok(Self {
            interferer: *interferer,
            amplitude,
            pri_s: radar.pri_s,
        })
    }

    /// Add the interferer with this `index` to the samples of a pulse.
    pub(super) fn add(&self, moment: &Moment, seed: u64, index: usize, samples: &mut [Complex64]) {
        let Interferer {
            frequency_hz,
            bandwidth_hz,
            duty,
            ..
        } = self.interferer;
        let mut random = stream(seed, Kind::Interference, index, moment.pulse);
        if unit(&mut random) >= duty {
            return;
        }
        if bandwidth_hz == 0.0 {
            self.add_tone(moment, frequency_hz, self.amplitude.into(), samples);
            return;
        }
        let waveform = moment.waveform;
        let length_s = waveform.sample_s(samples.len()) - waveform.sample_s(0);
        let count = (2.0 * bandwidth_hz * length_s).ceil().clamp(16.0, 4096.0);
        let deviation = self.amplitude / (2.0 * count).sqrt();
        for tone in 0..count as usize {
            let part = (tone as f64 + unit(&mut random)) / count - 0.5;
            let amplitude = complex_normal(&mut random) * deviation;
            let tone_hz = frequency_hz + part * bandwidth_hz;
            self.add_tone(moment, tone_hz, amplitude, samples);
        }
    }

    fn add_tone(
        &self,
        moment: &Moment,
        tone_hz: f64,
        amplitude: Complex64,
        samples: &mut [Complex64],
    ) {
        let waveform = moment.waveform;
        for (k, z) in samples.iter_mut().enumerate() {
            let after_s = waveform.sample_s(k);
            let mixed = Mixed::at(waveform, after_s, k, self.pri_s);
            let pass = mixed.pass(tone_hz);
            if pass != 0.0 {
                let turns = tone_hz * (moment.time_s + after_s) - mixed.turns;
                *z += amplitude * pass * phasor(turns);
            }
        }
    }
}

/// Oscillator at a sample, and the receiver's filter.
struct Mixed {
    frequency_hz: f64,
    /// Phase since the start of the pulse, turns.
    turns: f64,
    filter: Pass,
}

enum Pass {
    /// Ideal low-pass filter with half of this sample rate, hertz.
    Rate(f64),
    /// Average over this dwell time, seconds.
    Dwell(f64),
}

impl Mixed {
    fn at(waveform: &Waveform, after_s: f64, k: usize, pri_s: f64) -> Self {
        let steady = |frequency_hz: f64, filter| Self {
            frequency_hz,
            turns: frequency_hz * after_s,
            filter,
        };
        match *waveform {
            Waveform::Ideal { band } => {
                let dwell_s = pri_s / band.count as f64;
                steady(band.frequency_hz(k), Pass::Dwell(dwell_s))
            }
            Waveform::Stepped { band, dwell_s, .. } => {
                steady(band.frequency_hz(k), Pass::Dwell(dwell_s))
            }
            Waveform::Pulsed {
                centre_hz,
                sample_rate_hz,
                ..
            } => steady(centre_hz, Pass::Rate(sample_rate_hz)),
            Waveform::Fmcw {
                start_hz,
                chirp_hz_s,
                sample_rate_hz,
                mixer_delay_s,
                ..
            } => {
                let t = after_s - mixer_delay_s;
                Self {
                    frequency_hz: start_hz + chirp_hz_s * t,
                    turns: (start_hz + 0.5 * chirp_hz_s * t) * t,
                    filter: Pass::Rate(sample_rate_hz),
                }
            }
        }
    }

    fn pass(&self, tone_hz: f64) -> f64 {
        let away_hz = tone_hz - self.frequency_hz;
        match self.filter {
            Pass::Rate(rate_hz) => f64::from(away_hz.abs() < 0.5 * rate_hz),
            Pass::Dwell(dwell_s) => {
                let half = std::f64::consts::PI * away_hz * dwell_s;
                if half == 0.0 {
                    1.0
                } else {
                    libm::sin(half) / half
                }
            }
        }
    }
}
