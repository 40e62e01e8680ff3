//! Defects of the samples of a file's channel, read from the file for this purpose.

use std::collections::BTreeMap;

use num_complex::Complex32;

use super::absent::{ABSENT, is_absent};
use super::{Cures, Named, Raw, Report, examine};
use subaperture_model::phase_history::{DefectKind, ReadError};

/// Channel of a file whose samples are examined.
pub(crate) struct Stored<'a> {
    pub(crate) named: Named<'a>,
    /// Format for the warnings, such as `CRSD`.
    pub(crate) format: &'a str,
    pub(crate) num_pulses: usize,
    pub(crate) num_samples: usize,
    /// Limits of the integer type of the samples.
    pub(crate) integer_range: Option<[f32; 2]>,
}

impl Stored<'_> {
    /// Examine pulses that `read` writes into a row, [`ABSENT`] where no sample was recorded. `number` is a pulse's index in the file.
    ///
    /// Pulses of zeros are counted and do not contribute to the other defects. A failure of `read` becomes a warning.
    pub(crate) fn examine(
        &self,
        number: impl Fn(usize) -> usize,
        read: impl Fn(usize, &mut [Complex32]) -> Result<(), ReadError>,
    ) -> Report {
        let raw = Raw {
            num_pulses: self.num_pulses,
            num_samples: self.num_samples,
            real: false,
            integer_range: self.integer_range,
        };
        let mut zeros = BTreeMap::new();
        let found = examine(&raw, |pulse, row: &mut [Complex32]| {
            read(pulse, row)?;
            if row.iter().all(|z| is_absent(*z) || *z == Complex32::ZERO) {
                zeros.insert(pulse, number(pulse));
                row.fill(ABSENT);
            }
            Ok(())
        });
        let mut report = Report::default();
        let found = match found {
            Ok(found) => found,
            Err(error) => {
                let error: ReadError = error;
                report.warnings.push(format!(
                    "{}: the samples were not examined for defects: {error}",
                    self.named.recording
                ));
                return report;
            }
        };
        if let Some(&first_pulse) = zeros.values().next() {
            let zeros = DefectKind::ZeroPulses {
                count: zeros.len(),
                first_pulse,
                channels: 1,
                left_out: false,
            };
            let defect = self.named.defect(found.examined, zeros);
            report.add(defect, "");
        }
        let described = format!(
            ": no setting corrects it in a {} file. Write the samples as arrays with a description to correct it by [recording] iq = \"correct\"",
            self.format
        );
        let cures = Cures {
            bias: &described,
            imbalance: &described,
            clipped: ": no setting restores them. Record with less gain",
        };
        report.extend(found.report(&self.named, &cures));
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const STORED: Stored<'_> = Stored {
        named: Named {
            recording: "scene",
            channel: Some("R"),
            receiver: None,
        },
        format: "CRSD",
        num_pulses: 44,
        num_samples: 1 << 17,
        integer_range: None,
    };

    /// Pulses of 2^17 samples: 32 of 44 are examined, pulse `i * 44 / 32`. Odd pulses contain only zeros: 1, 5, 9, 13, 15, 19 and so on.
    #[test]
    fn zero_pulses_are_counted_among_the_examined_pulses() {
        let report = STORED.examine(
            |pulse| pulse + 100,
            |pulse, row| {
                for (k, z) in row.iter_mut().enumerate() {
                    // Values from -0.5 to 0.5 in an order without a pattern. They do not pile up.
                    let hash = ((pulse << 17 | k) as u32).wrapping_mul(0x9e37_79b9);
                    let part = |bits: u32| f32::from(bits as u16) / 65536.0 - 0.5;
                    *z = Complex32::new(
                        part(hash >> 16),
                        part(hash.wrapping_mul(0x85eb_ca6b) >> 16),
                    );
                }
                if pulse % 2 == 1 {
                    row.fill(Complex32::ZERO);
                }
                Ok(())
            },
        );
        let count = (0..32).filter(|i| i * 44 / 32 % 2 == 1).count();
        let [text] = &report.warnings[..] else {
            panic!("{:?}", report.warnings);
        };
        let expected = format!(
            "scene: {count} of 32 pulses contain only zeros, the first is pulse 101, in 32 of 44 pulses: the normalisation of the image counts them"
        );
        assert_eq!(text, &expected);
        let [defect] = &report.defects[..] else {
            panic!("{:?}", report.defects);
        };
        let expected = DefectKind::ZeroPulses {
            count,
            first_pulse: 101,
            channels: 1,
            left_out: false,
        };
        assert_eq!(defect.kind, expected);
    }

    #[test]
    fn failure_to_read_is_a_warning() {
        let report = STORED.examine(
            |pulse| pulse,
            |_, _| {
                Err(ReadError::malformed(
                    Path::new("scene.crsd"),
                    "is cut short",
                ))
            },
        );
        assert_eq!(
            report.warnings,
            ["scene: the samples were not examined for defects: scene.crsd: is cut short"]
        );
        assert!(report.defects.is_empty());
    }
}
