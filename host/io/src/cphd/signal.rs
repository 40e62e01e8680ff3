//! Samples as bytes: big endian, real part first.

use num_complex::Complex32;

use super::conventions::SignalFormat;

impl SignalFormat {
    /// Bytes of one complex sample.
    pub fn sample_bytes(self) -> usize {
        match self {
            Self::Ci2 => 2,
            Self::Ci4 => 4,
            Self::Cf8 => 8,
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
pub(super) fn encode(samples: &[Complex32], bytes: &mut Vec<u8>) {
    bytes.reserve(samples.len() * 8);
    for z in samples {
        bytes.extend_from_slice(&z.re.to_be_bytes());
        bytes.extend_from_slice(&z.im.to_be_bytes());
    }
}
