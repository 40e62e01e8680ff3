//! Several recordings joined into one aperture.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::{Collection, InputFile, PhaseHistory, ReadError};

/// Recordings joined end to end, in the order given. One recording is the common case.
pub struct Aperture {
    /// That of all parts, if there are several; the only one's own is not copied.
    joined: Option<Collection>,
    /// True positions of all parts, if there are several and all know them.
    true_antennas: Option<Vec<[DVec3; 2]>>,
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
        if rest.is_empty() {
            return Ok(Self {
                joined: None,
                true_antennas: None,
                parts,
            });
        }
        let collection = first.collection();
        let mut timed = collection.timed;
        let mut num_pulses = collection.pulses.len();
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
            timed &= next.timed;
            num_pulses += next.pulses.len();
        }
        let mut pulses = Vec::with_capacity(num_pulses);
        for part in &parts {
            pulses.extend_from_slice(&part.collection().pulses);
        }
        let joined = Collection {
            name: format!("{} and {} more", collection.name, rest.len()),
            num_samples: collection.num_samples,
            pulses,
            frame: collection.frame,
            extent: collection.extent,
            timed,
        };
        let mut true_antennas = Some(Vec::new());
        for part in &parts {
            match (&mut true_antennas, part.true_antennas()) {
                (Some(all), Some(of_part)) => all.extend_from_slice(of_part),
                _ => true_antennas = None,
            }
        }
        Ok(Self {
            joined: Some(joined),
            true_antennas,
            parts,
        })
    }
}

impl PhaseHistory for Aperture {
    fn collection(&self) -> &Collection {
        match &self.joined {
            Some(joined) => joined,
            None => self.parts[0].collection(),
        }
    }

    fn read(&self, pulses: Range<usize>, mut samples: &mut [Complex32]) -> Result<(), ReadError> {
        let width = self.collection().num_samples;
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

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        match &self.joined {
            Some(_) => self.true_antennas.as_deref(),
            None => self.parts[0].true_antennas(),
        }
    }

    fn warnings(&self) -> Vec<String> {
        let parts = self.parts.iter();
        parts.flat_map(|part| part.warnings()).collect()
    }

    fn held_bytes(&self) -> u64 {
        let own = self.joined.as_ref();
        let own = own.map_or(0, |joined| size_of_val(joined.pulses.as_slice()))
            + self.true_antennas.as_deref().map_or(0, size_of_val);
        own as u64 + self.parts.iter().map(|part| part.held_bytes()).sum::<u64>()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let mut all = Vec::new();
        for part in &self.parts {
            all.extend(part.inputs()?);
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase_history::Recorded;
    use crate::simulate::{Preset, Variation};

    /// The first pulses of a simulation, as recordings of these lengths.
    fn parts(lengths: &[usize]) -> (Vec<Complex32>, Vec<Box<dyn PhaseHistory>>) {
        let whole = Preset::Table41.simulate(&Variation::default());
        let width = whole.collection().num_samples;
        let mut samples = vec![Complex32::ZERO; lengths.iter().sum::<usize>() * width];
        whole.read(0..samples.len() / width, &mut samples).unwrap();
        let mut first = 0;
        let parts = lengths.iter().map(|length| {
            let pulses = first..first + length;
            first = pulses.end;
            let mut collection = whole.collection().clone();
            collection.pulses = collection.pulses[pulses.clone()].to_vec();
            let samples = samples[pulses.start * width..pulses.end * width].to_vec();
            Box::new(Recorded::new(collection, samples).unwrap()) as Box<dyn PhaseHistory>
        });
        let parts = parts.collect();
        (samples, parts)
    }

    #[test]
    fn reading_across_joints_is_reading_the_whole() {
        let (samples, parts) = parts(&[3, 1, 4]);
        let aperture = Aperture::join(parts).unwrap();
        let width = aperture.collection().num_samples;
        assert_eq!(aperture.collection().pulses.len(), 8);
        for start in 0..8 {
            for end in start..=8 {
                let mut got = vec![Complex32::ZERO; (end - start) * width];
                aperture.read(start..end, &mut got).unwrap();
                assert_eq!(got, samples[start * width..end * width], "{start}..{end}");
            }
        }
        // Geometry of both the parts and the aperture, and the samples of the parts.
        assert_eq!(aperture.held_bytes(), 2 * 8 * 104 + 8 * 8 * width as u64);
    }

    #[test]
    fn a_lone_part_is_not_copied() {
        let (samples, parts) = parts(&[3]);
        let aperture = Aperture::join(parts).unwrap();
        let width = aperture.collection().num_samples;
        assert_eq!(aperture.collection().pulses.len(), 3);
        let mut got = vec![Complex32::ZERO; 3 * width];
        aperture.read(0..3, &mut got).unwrap();
        assert_eq!(got, samples);
        assert_eq!(aperture.held_bytes(), 3 * 104 + 3 * 8 * width as u64);
    }

    #[test]
    fn what_does_not_belong_together_is_refused() {
        assert!(Aperture::join(Vec::new()).is_err());
        let (_, mut parts) = parts(&[2, 2]);
        let mut other = parts[1].collection().clone();
        other.frame = crate::geometry::SceneFrame::Local;
        let samples = vec![Complex32::ZERO; 2 * other.num_samples];
        parts[1] = Box::new(Recorded::new(other, samples).unwrap());
        let error = Aperture::join(parts).err().unwrap().to_string();
        assert!(error.contains("do not share a scene frame"), "{error}");
    }
}
