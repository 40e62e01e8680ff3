//! Receiver chain for signals computed elsewhere, for example by a simulated radio; with the same impairments as the
//! simulator's channels.

use num_complex::Complex64;

use super::{Impairments, Moment};
use subaperture_model::radar::Radar;

/// Prepared receiver chain. Its effect depends only on the seed, the pulse index and the receiver.
#[derive(Debug)]
pub struct Chain {
    impairments: Impairments,
}

impl Chain {
    /// Make the receiver chain of a radar. For a link budget, an amplitude of 1 is the echo of 1 m² at `range_m`.
    ///
    /// # Errors
    /// Message that describes an invalid receiver parameter.
    pub fn new(radar: &Radar, seed: u64, range_m: f64) -> Result<Self, String> {
        let impairments = Impairments::of(radar, seed, range_m)?;
        Ok(Self { impairments })
    }

    /// Apply the effects before the converter: phase noise, interference and thermal noise.
    pub fn receive(&self, moment: &Moment, samples: &mut [Complex64]) {
        self.impairments.receive(moment, samples);
    }

    /// Quantise the samples by the converter, if there is one, and return the number of samples whose I or Q exceeds
    /// full scale.
    pub fn convert(&self, samples: &mut [Complex64]) -> u32 {
        self.impairments.convert(samples)
    }
}
