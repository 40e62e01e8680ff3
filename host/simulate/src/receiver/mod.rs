//! What a receiver adds to the echoes: one disturbance a file, each absent at no cost.
//!
//! In the order in which they come: [`phase_noise`], [`interference`], [`thermal`], [`converter`]. Errors of
//! the clock ([`clock`]) are errors of frequencies and times, so they act on the echo's making.
//!
//! Powers relate to a raw sample of the echo of 1 m² at the reference point, whose magnitude is 1.
//! Everything random comes from a stream of its own for each kind, channel and pulse (`stream`).

mod chain;
pub mod clock;
pub mod converter;
pub mod interference;
pub mod phase_noise;
mod stream;
pub mod thermal;

use num_complex::Complex64;

use super::experiment::Experiment;
use converter::Quantiser;
use interference::Interference;
use phase_noise::Oscillator;
use subaperture_model::radar::{Radar, Waveform};

pub use chain::Chain;

/// All disturbances of a radar, made ready.
#[derive(Debug)]
pub(super) struct Impairments {
    seed: u64,
    /// Standard deviation of noise in I and in Q.
    noise: Option<f64>,
    oscillator: Option<Oscillator>,
    interference: Vec<Interference>,
    quantiser: Option<Quantiser>,
}

/// The pulse whose samples are disturbed.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// What is truly transmitted and sampled.
    pub waveform: &'a Waveform,
    /// Index of the pulse among those of all transmitters.
    pub pulse: usize,
    /// Index of the receiver.
    pub receiver: usize,
    /// True time of the pulse, seconds.
    pub time_s: f64,
    /// Delay of the reference, seconds.
    pub delay_s: f64,
}

impl Impairments {
    /// `range_m` is the range of the reference. The text of an error says what is wrong.
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

    /// Disturbs the samples of a pulse; the number of them that saturated the converter.
    pub(super) fn apply(&self, moment: &Moment, samples: &mut [Complex64]) -> u32 {
        self.receive(moment, samples);
        self.convert(samples)
    }

    /// All that comes before the converter.
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
