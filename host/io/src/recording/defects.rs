//! Defects of the recorded samples: pulses of zeros are left out, I and Q are examined and corrected on request.
//!
//! I and Q are examined by receiver, over the pulses that `[recording]` selects. The result does not depend on a
//! smaller choice of pulses, so that all histories of a recording have the same correction.

use std::collections::BTreeSet;
use std::convert::Infallible;

use super::keys::{IqCorrection, RecordingKeys, WaveformKeys};
use super::pulses::{Pulses, asked};
use super::samples::{Rows, Samples};
use crate::raw_check::balance::Correction;
use crate::raw_check::{Cures, Defects, Named, Raw, Report, examine};
use subaperture_describe::error::Fault;
use subaperture_model::phase_history::DefectKind;

/// Recording whose samples are examined.
#[derive(Clone, Copy)]
pub(super) struct About<'a> {
    pub(super) name: &'a str,
    pub(super) recording: &'a RecordingKeys,
    pub(super) kind: &'a WaveformKeys,
}

/// Defects of a recording.
#[derive(Default)]
pub(super) struct Found {
    pub(super) report: Report,
    /// Indices of pulses that contain only zeros in some channel.
    pub(super) zeros: BTreeSet<usize>,
}

impl About<'_> {
    /// Leave out pulses of zeros and correct I and Q, if that is requested.
    pub(super) fn examine(
        self,
        samples: &mut Samples,
        pulses: &mut Pulses,
    ) -> Result<Found, Fault> {
        let mut found = self.leave_out(samples, pulses)?;
        if let Some((gaps, count)) = &pulses.gaps {
            let cure = ". Select a block of pulses without gaps by [recording] first and count";
            let defect = self.named().defect([*count; 2], gaps.clone());
            found.report.add(defect, cure);
        }
        found.report.extend(self.receivers(samples, pulses)?);
        Ok(found)
    }

    /// The recording as a whole.
    fn named(&self) -> Named<'_> {
        Named {
            recording: self.name,
            ..Named::default()
        }
    }

    /// Correct I and Q as [`Self::examine`] does, for a given choice of pulses.
    pub(super) fn correct(self, samples: &mut Samples, pulses: &Pulses) -> Result<Found, Fault> {
        if *self.recording.iq == IqCorrection::Correct {
            self.receivers(samples, pulses)?;
        }
        Ok(Found::default())
    }

    /// Remove pulses from the selection that contain only zeros.
    fn leave_out(self, samples: &Samples, pulses: &mut Pulses) -> Result<Found, Fault> {
        let recording = self.recording;
        let mut found = Found::default();
        let mut sweeps = 0;
        let chosen = std::mem::take(&mut pulses.chosen);
        let count = chosen.len();
        for pulse in chosen {
            let rows = pulses.rows(recording, pulse.index, pulse.channel);
            let is_zero = |sweep: &usize| samples.is_zero(*sweep, rows.receiver);
            let zeros = rows.sweeps().filter(is_zero).count();
            if zeros < rows.count {
                sweeps += zeros;
                pulses.chosen.push(pulse);
            } else {
                found.zeros.insert(pulse.index);
            }
        }
        if let Some(&first) = found.zeros.first() {
            if pulses.chosen.is_empty() {
                return Err(recording.file.fault(format!(
                    "expected samples other than zero, found {count} pulses of zeros: check the file, the format and the selected pulses"
                )));
            }
            let zeros = DefectKind::ZeroPulses {
                count: count - pulses.chosen.len(),
                first_pulse: first,
                channels: pulses.antennas.channels.len(),
                left_out: true,
            };
            let defect = self.named().defect([count; 2], zeros);
            found.report.add(defect, "");
        }
        if sweeps > 0 {
            let zeros = DefectKind::ZeroSweeps {
                count: sweeps,
                averaged: *recording.average,
            };
            let defect = self.named().defect([count; 2], zeros);
            found.report.add(defect, "");
        }
        Ok(found)
    }

    /// Examine the samples of every receiver in use, and correct them if that is requested.
    fn receivers(self, samples: &mut Samples, pulses: &Pulses) -> Result<Report, Fault> {
        let recording = self.recording;
        let corrects = *recording.iq == IqCorrection::Correct;
        if corrects && samples.real {
            return Err(recording.iq.fault(
                "iq = \"correct\" applies to complex samples, and these are real: remove it",
            ));
        }
        let channels = &pulses.antennas.channels;
        let num_pulses = samples.num_sweeps / recording.sweeps_a_pulse();
        let selected = asked(recording, num_pulses, channels.len(), None)?;
        let numbers: BTreeSet<usize> = channels.iter().map(|channel| channel.receiver).collect();
        let mut report = Report::default();
        for &receiver in &numbers {
            let rows = selected.iter();
            let rows = rows.map(|&(index, channel)| pulses.rows(recording, index, channel));
            let is_used =
                |rows: &Rows| rows.receiver == receiver && !samples.is_zero(rows.first, receiver);
            let sweeps: Vec<usize> = rows.filter(is_used).map(|rows| rows.first).collect();
            let found = self.of_receiver(samples, receiver, &sweeps);
            let named = Named {
                receiver: (numbers.len() > 1).then_some(receiver + 1),
                ..self.named()
            };
            if !corrects {
                report.extend(found.report(&named, &Cures::of_description(samples.real)));
                continue;
            }
            let correction = Correction::of(&found.balance);
            let correction = correction.map_err(|message| recording.iq.fault(message))?;
            report.extend(found.corrected(&named));
            if let Some(correction) = correction {
                samples.correct(receiver, correction);
            }
        }
        Ok(report)
    }

    /// Defects of the first sweep of each pulse of a receiver.
    fn of_receiver(self, samples: &Samples, receiver: usize, sweeps: &[usize]) -> Defects {
        let raw = Raw {
            num_pulses: sweeps.len(),
            num_samples: samples.num_samples,
            real: samples.real,
            integer_range: samples.integer_range(),
        };
        let read = |pulse: usize, row: &mut [_]| {
            samples.read(sweeps[pulse], receiver, row);
            Ok::<(), Infallible>(())
        };
        let Ok(mut found) = examine(&raw, read);
        if samples.real && matches!(self.kind, WaveformKeys::Profiles(_)) {
            // The band excludes 0 Hz, and with it the bias.
            found.balance.bias = None;
        }
        found
    }
}
