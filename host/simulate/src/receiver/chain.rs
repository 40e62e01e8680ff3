//! The receiver of a radar for signals that are made elsewhere, as a simulated radio's are: the very same disturbances.

use num_complex::Complex64;

use super::{Impairments, Moment};
use subaperture_model::radar::Radar;

/// A receiver made ready. What it does to a signal depends on the seed, the pulse's index and the receiver alone.
#[derive(Debug)]
pub struct Chain {
    impairments: Impairments,
}

impl Chain {
    /// The receiver of a radar; 1 is the magnitude of the echo of 1 m² at `range_m`, for a link budget.
    ///
    /// # Errors
    /// In words, what of it makes no sense.
    pub fn new(radar: &Radar, seed: u64, range_m: f64) -> Result<Self, String> {
        let impairments = Impairments::of(radar, seed, range_m)?;
        Ok(Self { impairments })
    }

    /// Noise of the oscillator's phase, interference and thermal noise, as they are before the receiver's gain.
    pub fn receive(&self, moment: &Moment, samples: &mut [Complex64]) {
        self.impairments.receive(moment, samples);
    }

    /// Converts to the steps of its converter, if it has one; the number of samples of which I or Q was beyond full scale.
    pub fn convert(&self, samples: &mut [Complex64]) -> u32 {
        self.impairments.convert(samples)
    }
}
