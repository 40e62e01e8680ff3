//! Phase history held in memory.

use std::ops::Range;
use std::path::Path;

use num_complex::Complex32;

use super::{
    Beam, Channel, Collection, Defect, InputFile, NoBeam, PhaseConvention, PhaseHistory, ReadError,
    check_finite,
};
use crate::antenna::MountedAntennas;

/// Phase history with samples and geometry in memory, for small recordings and tests.
#[derive(Clone, Debug)]
pub struct InMemory {
    collection: Collection,
    samples: Vec<Complex32>,
    inputs: Vec<InputFile>,
    channels: Vec<Channel>,
    conventions: Vec<PhaseConvention>,
    warnings: Vec<String>,
    defects: Vec<Defect>,
    beam: Result<Option<Beam>, NoBeam>,
    antennas: Option<MountedAntennas>,
}

impl InMemory {
    /// Create a history from pulse-major `samples`, `collection.num_samples` in each pulse.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if there are no pulses or the lengths disagree;
    /// [`ReadError::NotFinite`] at the first sample that is NaN or infinite.
    pub fn new(collection: Collection, samples: Vec<Complex32>) -> Result<Self, ReadError> {
        let expected = collection.pulses.len() * collection.num_samples;
        if expected == 0 {
            return Err(ReadError::Mismatch(format!(
                "{}: expected at least one pulse and sample, found {} pulses of {} samples",
                collection.name,
                collection.pulses.len(),
                collection.num_samples
            )));
        }
        if samples.len() != expected {
            return Err(ReadError::Mismatch(format!(
                "{}: {} pulses of {} samples: expected {expected} values, found {}",
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
            conventions: Vec::new(),
            warnings: Vec::new(),
            defects: Vec::new(),
            beam: Ok(None),
            antennas: None,
        })
    }

    /// Read all pulses of `history` into memory. Samples and description are those of `history`; true positions and a moving target
    /// are not kept.
    ///
    /// # Errors
    /// [`ReadError`] of reading the pulses.
    pub fn copy_of(history: &dyn PhaseHistory) -> Result<Self, ReadError> {
        let collection = history.collection().clone();
        let count = collection.pulses.len();
        let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
        history.read(0..count, &mut samples)?;
        Ok(Self {
            inputs: history.inputs()?,
            channels: history.channels(),
            conventions: history.phase_conventions(),
            warnings: history.warnings(),
            defects: history.defects(),
            beam: history.stated_beam(),
            antennas: history.antennas(),
            ..Self::new(collection, samples)?
        })
    }

    /// Set the channels to which the pulses belong.
    #[must_use]
    pub fn with_channels(mut self, channels: Vec<Channel>) -> Self {
        self.channels = channels;
        self
    }

    /// Set the phase convention of the file.
    #[must_use]
    pub fn with_convention(mut self, convention: PhaseConvention) -> Self {
        self.conventions = vec![convention];
        self
    }

    /// Set the antenna beam, or the reason that the described antennas give none.
    #[must_use]
    pub fn with_stated_beam(mut self, beam: Result<Option<Beam>, NoBeam>) -> Self {
        self.beam = beam;
        self
    }

    /// Set the antennas with their attitudes at each pulse.
    #[must_use]
    pub fn with_antennas(mut self, antennas: Option<MountedAntennas>) -> Self {
        self.antennas = antennas;
        self
    }

    /// Add warnings for the user.
    #[must_use]
    pub fn with_warnings(mut self, warnings: Vec<String>) -> Self {
        self.warnings.extend(warnings);
        self
    }

    /// Add defects of the recording, without their warnings.
    #[must_use]
    pub fn with_defects(mut self, defects: Vec<Defect>) -> Self {
        self.defects.extend(defects);
        self
    }

    /// Set the files from which the samples were read.
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

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        Some(self.of(pulses))
    }

    fn channels(&self) -> Vec<Channel> {
        self.channels.clone()
    }

    fn path(&self) -> Option<&Path> {
        match self.inputs.as_slice() {
            [file, ..] => Some(&file.path),
            [] => None,
        }
    }

    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        self.conventions.clone()
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        self.antennas.clone()
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.beam.clone()
    }

    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    fn defects(&self) -> Vec<Defect> {
        self.defects.clone()
    }

    fn held_bytes(&self) -> u64 {
        let pulses = self.collection.pulses.as_slice();
        (size_of_val(pulses) + size_of_val(self.samples.as_slice())) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(self.inputs.clone())
    }
}
