//! Raw samples held in memory, for small recordings.

use std::ops::Range;

use num_complex::Complex32;

use super::{EchoCollection, Echoes, ReceiveError};
use subaperture_model::phase_history::{ReadError, check_finite};

/// Echoes and their description in memory.
#[derive(Clone, Debug)]
pub struct StoredEchoes {
    collection: EchoCollection,
    samples: Vec<Complex32>,
}

impl StoredEchoes {
    /// Make echoes from pulse-major `samples`, with as many samples per pulse as the waveform has.
    ///
    /// # Errors
    /// [`ReceiveError`] if there are no samples, the lengths disagree, or a sample is not finite.
    pub fn new(collection: EchoCollection, samples: Vec<Complex32>) -> Result<Self, ReceiveError> {
        let (pulses, width) = (collection.pulses.len(), collection.waveform.num_samples());
        if samples.is_empty() || samples.len() != pulses * width {
            let what = format!(
                "{pulses} pulses of {width} samples: expected as many values and at least one, got {}",
                samples.len()
            );
            return Err(ReceiveError::new(&collection, what));
        }
        check_finite(&collection.name, 0, width, &samples)
            .map_err(|error| ReceiveError::new(&collection, error.to_string()))?;
        Ok(Self {
            collection,
            samples,
        })
    }
}

impl Echoes for StoredEchoes {
    fn collection(&self) -> &EchoCollection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.collection.waveform.num_samples();
        samples.copy_from_slice(&self.samples[pulses.start * width..pulses.end * width]);
        Ok(())
    }

    fn held_bytes(&self) -> u64 {
        let pulses = size_of_val(self.collection.pulses.as_slice());
        (pulses + size_of_val(self.samples.as_slice())) as u64
    }
}
