//! Several recordings joined into one aperture.

use std::ops::Range;

use num_complex::Complex32;

use super::{Collection, InputFile, PhaseHistory, ReadError};

/// Recordings joined end to end, in the order given. One recording is the common case.
pub struct Aperture {
    collection: Collection,
    parts: Vec<Box<dyn PhaseHistory>>,
}

impl Aperture {
    /// Joins `parts`. They must agree in samples a pulse and in scene frame.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if there are none or they disagree.
    pub fn join(parts: Vec<Box<dyn PhaseHistory>>) -> Result<Self, ReadError> {
        let Some((first, rest)) = parts.split_first() else {
            return Err(ReadError::Mismatch("no input given".to_owned()));
        };
        let mut collection = first.collection().clone();
        for part in rest {
            let next = part.collection();
            if next.num_samples != collection.num_samples {
                return Err(ReadError::Mismatch(format!(
                    "{} has {} samples a pulse and {} has {}: give files of one radar mode",
                    collection.name, collection.num_samples, next.name, next.num_samples
                )));
            }
            if !next.frame.agrees_with(&collection.frame) {
                return Err(ReadError::Mismatch(format!(
                    "{} and {} do not share a scene frame: focus them one at a time",
                    collection.name, next.name
                )));
            }
            collection.pulses.extend_from_slice(&next.pulses);
            collection.timed &= next.timed;
        }
        if parts.len() > 1 {
            collection.name = format!("{} and {} more", collection.name, parts.len() - 1);
        }
        Ok(Self { collection, parts })
    }
}

impl PhaseHistory for Aperture {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, mut samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.collection.num_samples;
        let mut part_start = 0;
        for part in &self.parts {
            let count = part.collection().pulses.len();
            let begin = pulses.start.clamp(part_start, part_start + count) - part_start;
            let end = pulses.end.clamp(part_start, part_start + count) - part_start;
            if begin < end {
                let (head, tail) = samples.split_at_mut((end - begin) * width);
                part.read(begin..end, head)?;
                samples = tail;
            }
            part_start += count;
        }
        assert!(
            samples.is_empty(),
            "pulses {pulses:?} are past the last one"
        );
        Ok(())
    }

    fn held_bytes(&self) -> u64 {
        let own = size_of_val(self.collection.pulses.as_slice()) as u64;
        own + self.parts.iter().map(|part| part.held_bytes()).sum::<u64>()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let mut all = Vec::new();
        for part in &self.parts {
            all.extend(part.inputs()?);
        }
        Ok(all)
    }
}
