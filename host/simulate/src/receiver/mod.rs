//! Receiver impairments, one per module; each costs nothing when absent.
//!
//! Order of application: [`phase_noise`], [`interference`], [`thermal`], [`converter`]. Errors of the clock ([`clock`])
//! change frequencies and times, so that they act on the computation of the echo.
//!
//! Powers are relative to a raw sample of the echo of 1 m² at the reference point, whose magnitude is 1. Every kind of
//! random effect has its own random stream per channel and pulse (`stream`).

mod chain;
pub mod clock;
pub mod converter;
pub mod interference;
mod moment;
pub mod phase_noise;
mod stream;
pub mod thermal;

use num_complex::Complex64;

use super::experiment::Experiment;
use converter::Quantiser;
use interference::Interference;
use phase_noise::Oscillator;
use subaperture_model::radar::Radar;

pub use chain::Chain;

pub use moment::Moment;

/// Prepared receiver impairments of a radar.
#[derive(Debug)]
pub(super) struct Impairments {
    seed: u64,
    /// Standard deviation of the thermal noise in I and in Q.
    noise: Option<f64>,
    oscillator: Option<Oscillator>,
    interference: Vec<Interference>,
    quantiser: Option<Quantiser>,
}

impl Impairments {
    /// Make the impairments; `range_m` is the range of the reference. The error is a message.
    pub(super) fn new(experiment: &Experiment, range_m: f64) -> Result<Self, String> {
        Self::of(&experiment.radar, experiment.seed, range_m)
    }

    fn of(radar: &Radar, seed: u64, range_m: f64) -> Result<Self, String> {
        let receiver = &radar.receiver;
        let noise = receiver.noise.as_ref();
        let noise = noise.map(|noise| thermal::deviation(noise, radar, range_m));
        let oscillator = receiver.phase_noise.as_ref();
        let oscillator = oscillator.map(|noise| Oscillator::new(noise, seed));
        let interference = receiver.interference.iter();
        let interference = interference.map(|i| Interference::new(i, radar));
        clock::check(receiver.clock.unwrap_or_default())?;
        Ok(Self {
            seed,
            noise: noise.transpose()?,
            oscillator: oscillator.transpose()?,
            interference: interference.collect::<Result<_, _>>()?,
            quantiser: receiver.converter.map(Quantiser::new).transpose()?,
        })
    }

    /// Apply all impairments to the samples of a pulse, and return the number of samples that saturate the converter.
    pub(super) fn apply(&self, moment: &Moment, samples: &mut [Complex64]) -> u32 {
        self.receive(moment, samples);
        self.convert(samples)
    }

    /// Apply the impairments before the converter.
    fn receive(&self, moment: &Moment, samples: &mut [Complex64]) {
        if let Some(oscillator) = &self.oscillator {
            oscillator.disturb(moment, samples);
        }
        for (index, interference) in self.interference.iter().enumerate() {
            interference.add(moment, self.seed, index, samples);
        }
        if let Some(deviation) = self.noise {
            thermal::add(moment, self.seed, deviation, samples);
        }
    }

    fn convert(&self, samples: &mut [Complex64]) -> u32 {
        match &self.quantiser {
            Some(quantiser) => quantiser.convert(samples),
            None => 0,
        }
    }
}
