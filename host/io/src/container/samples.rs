//! Sample formats of CPHD and CRSD: big endian, real part first.

use std::fmt;

use num_complex::Complex32;

use super::source::{CHUNK_BYTES, Source};
use super::{Element, MetadataError};
use subaperture_model::phase_history::ReadError;

/// Storage format of a complex sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalFormat {
    /// Two signed bytes.
    Ci2,
    /// Two signed 16-bit integers.
    Ci4,
    /// Two float32.
    Cf8,
}

impl fmt::Display for SignalFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ci2 => "CI2",
            Self::Ci4 => "CI4",
            Self::Cf8 => "CF8",
        })
    }
}

impl SignalFormat {
    /// Format stated by the child `SignalArrayFormat`.
    pub(crate) fn of(data: &Element) -> Result<Self, MetadataError> {
        let format = data.child("SignalArrayFormat")?;
        match &*format.text() {
            "CI2" => Ok(Self::Ci2),
            "CI4" => Ok(Self::Ci4),
            "CF8" => Ok(Self::Cf8),
            other => Err(format.fault(format!("expected CI2, CI4 or CF8, found '{other}'"))),
        }
    }

    /// Bytes of one complex sample.
    pub fn sample_bytes(self) -> usize {
        match self {
            Self::Ci2 => 2,
            Self::Ci4 => 4,
            Self::Cf8 => 8,
        }
    }

    /// Limits of the integer type; `None` for floating point.
    pub(crate) fn integer_range(self) -> Option<[f32; 2]> {
        match self {
            Self::Ci2 => Some([i8::MIN, i8::MAX].map(f32::from)),
            Self::Ci4 => Some([i16::MIN, i16::MAX].map(f32::from)),
            Self::Cf8 => None,
        }
    }

    /// Decodes as many samples as `samples` holds. Integers are exact in float32.
    pub(crate) fn decode(self, bytes: &[u8], samples: &mut [Complex32]) {
        debug_assert_eq!(bytes.len(), samples.len() * self.sample_bytes());
        let pairs = samples.iter_mut();
        match self {
            Self::Ci2 => {
                for (z, &[re, im]) in pairs.zip(bytes.as_chunks().0) {
                    *z = Complex32::new(f32::from(re as i8), f32::from(im as i8));
                }
            }
            Self::Ci4 => {
                for (z, &[a, b, c, d]) in pairs.zip(bytes.as_chunks().0) {
                    let (re, im) = (i16::from_be_bytes([a, b]), i16::from_be_bytes([c, d]));
                    *z = Complex32::new(f32::from(re), f32::from(im));
                }
            }
            Self::Cf8 => {
                for (z, &[a, b, c, d, e, f, g, h]) in pairs.zip(bytes.as_chunks().0) {
                    *z = Complex32::new(
                        f32::from_be_bytes([a, b, c, d]),
                        f32::from_be_bytes([e, f, g, h]),
                    );
                }
            }
        }
    }
}

/// Appends `samples` as CF8.
pub(crate) fn encode(samples: &[Complex32], bytes: &mut Vec<u8>) {
    bytes.reserve(samples.len() * 8);
    for z in samples {
        bytes.extend_from_slice(&z.re.to_be_bytes());
        bytes.extend_from_slice(&z.im.to_be_bytes());
    }
}

impl Source {
    /// Read stored samples, converted only in number format, of an array that begins at `offset`, from flat index `first` on.
    pub(crate) fn read_samples(
        &self,
        format: SignalFormat,
        offset: u64,
        first: usize,
        samples: &mut [Complex32],
    ) -> Result<(), ReadError> {
        let width = format.sample_bytes();
        let chunk = CHUNK_BYTES / width;
        let mut bytes = vec![0; samples.len().min(chunk) * width];
        for (i, part) in samples.chunks_mut(chunk).enumerate() {
            let bytes = &mut bytes[..part.len() * width];
            let at = (first + i * chunk) as u64 * width as u64;
            self.read_at(offset + at, bytes)?;
            format.decode(bytes, part);
        }
        Ok(())
    }
}
