//! A phase history held whole in memory.

use std::ops::Range;

use num_complex::Complex32;

use super::{Channel, Collection, InputFile, PhaseHistory, ReadError, check_finite};

/// Samples and geometry in memory: small recordings and tests.
#[derive(Clone, Debug)]
pub struct InMemory {
    collection: Collection,
    samples: Vec<Complex32>,
    inputs: Vec<InputFile>,
    channels: Vec<Channel>,
}

impl InMemory {
    /// Takes `samples` as pulse-major, `collection.num_samples` each.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if there are no pulses or the lengths disagree;
    /// [`ReadError::NotFinite`] at the first sample that is NaN or infinite.
    pub fn new(collection: Collection, samples: Vec<Complex32>) -> Result<Self, ReadError> {
        let expected = collection.pulses.len() * collection.num_samples;
        if expected == 0 {
            return Err(ReadError::Mismatch(format!(
                "{}: holds no pulses ({} pulses of {} samples)",
                collection.name,
                collection.pulses.len(),
                collection.num_samples
            )));
        }
        if samples.len() != expected {
            return Err(ReadError::Mismatch(format!(
                "{}: {} pulses of {} samples need {expected} values, not {}",
                collection.name,
                collection.pulses.len(),
                collection.num_samples,
                samples.len()
            )));
        }
        check_finite(&collection.name, 0, collection.num_samples, &samples)?;
        Ok(Self {
            collection,
            samples,
            inputs: Vec::new(),
            channels: Vec::new(),
        })
    }

    /// Says which channels the pulses are of.
    #[must_use]
    pub fn with_channels(mut self, channels: Vec<Channel>) -> Self {
        self.channels = channels;
        self
    }

    /// Names the files that the samples came from.
    #[must_use]
    pub fn with_inputs(mut self, inputs: Vec<InputFile>) -> Self {
        self.inputs = inputs;
        self
    }

    fn of(&self, pulses: Range<usize>) -> &[Complex32] {
        let width = self.collection.num_samples;
        &self.samples[pulses.start * width..pulses.end * width]
    }
}

impl PhaseHistory for InMemory {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        samples.copy_from_slice(self.of(pulses));
        Ok(())
    }

    fn at_hand(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        Some(self.of(pulses))
    }

    fn channels(&self) -> Vec<Channel> {
        self.channels.clone()
    }

    fn held_bytes(&self) -> u64 {
        let pulses = self.collection.pulses.as_slice();
        (size_of_val(pulses) + size_of_val(self.samples.as_slice())) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(self.inputs.clone())
    }
}
