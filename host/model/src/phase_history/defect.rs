//! Defects of recorded pulses and samples, as numbers.

use std::fmt;

use crate::quantity::{seconds, significant};

/// Defect of the recorded pulses or samples, with its measured size.
///
/// [`Display`](fmt::Display) is the statement in [`Self::warning`], without the recording's name. JSON is a single object with the fields of
/// [`Examined`], the name of the kind as `kind`, and its values.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Defect {
    /// Recording and examined pulses.
    #[serde(flatten)]
    pub examined: Examined,
    /// Kind of the defect, with the measured values.
    #[serde(flatten)]
    pub kind: DefectKind,
}

/// Recording that was examined for defects, and the number of its examined pulses.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Examined {
    /// Name of the recording.
    pub recording: String,
    /// Channel of the file, if the file names its channels.
    pub channel: Option<String>,
    /// Number of the receiver, from 1; `None` if the recording has a single one or all were examined together.
    pub receiver: Option<usize>,
    /// Number of examined pulses.
    pub examined_pulses: usize,
    /// Number of pulses from which the examined ones were chosen.
    pub pulses: usize,
}

/// Kind of a [`Defect`], with the measured values. Values of samples are in the file's units.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum DefectKind {
    /// Pulses missing in regular pulse times.
    Gaps {
        /// Number of missing pulses.
        missing_pulses: u64,
        /// Ratio of missing pulses to missing and recorded ones, 0 to 1.
        share: f64,
        /// Number of gaps between the recorded pulses.
        gaps: usize,
        /// Index of the pulse before the first gap, from 0.
        after_pulse: usize,
        /// Time of that pulse, seconds.
        after_s: f64,
        /// Length of the first gap, seconds.
        first_gap_s: f64,
        /// Usual interval of the pulses, seconds.
        interval_s: f64,
    },
    /// Pulses that contain only zeros.
    ZeroPulses {
        /// Number of these pulses among the examined ones.
        count: usize,
        /// Index of the first one in the file, from 0.
        first_pulse: usize,
        /// Number of channels whose pulses are counted.
        channels: usize,
        /// Whether these pulses are left out of the phase history.
        left_out: bool,
    },
    /// Sweeps of zeros that are left out of the averages of sweeps.
    ZeroSweeps {
        /// Number of these sweeps.
        count: usize,
        /// Number of sweeps in an average.
        averaged: usize,
    },
    /// Significant mean of I and Q.
    Bias {
        /// Mean of I, or of real samples.
        re: f64,
        /// Mean of Q; `None` for real samples.
        im: Option<f64>,
        /// Standard deviation of I, or of real samples.
        re_deviation: f64,
        /// Standard deviation of Q; `None` for real samples.
        im_deviation: Option<f64>,
        /// Whether the samples are corrected.
        corrected: bool,
    },
    /// Significant imbalance of I and Q.
    Imbalance {
        /// Gain of Q relative to I, dB; infinite if I or Q is constant.
        gain_db: f64,
        /// Phase error of Q relative to I, degrees.
        phase_deg: f64,
        /// Level of the image at mirrored frequencies relative to the echo, dB.
        image_db: f64,
        /// Whether the samples are corrected.
        corrected: bool,
    },
    /// Samples at the limits of the receiver.
    Clipped {
        /// Ratio of clipped values to all values of I and Q, 0 to 1.
        share: f64,
        /// Smallest value of I and Q.
        low: f64,
        /// Largest value of I and Q.
        high: f64,
    },
}

impl Examined {
    /// Recording and receiver, with which the warning begins.
    pub fn subject(&self) -> String {
        match self.receiver {
            None => self.recording.clone(),
            Some(receiver) => format!("{}, receiver {receiver}", self.recording),
        }
    }

    /// Number of examined pulses as text, such as `, in 512 of 4000 pulses`; empty if all were examined.
    pub fn of_pulses(&self) -> String {
        match self.examined_pulses == self.pulses {
            true => String::new(),
            false => format!(", in {} of {} pulses", self.examined_pulses, self.pulses),
        }
    }
}

impl Defect {
    /// Warning: the recording, the measured values, and the effect on an image.
    pub fn warning(&self) -> String {
        let effect = match self.kind {
            DefectKind::Gaps { .. } => {
                ": the image is normalised by the recorded pulses, and its side lobes rise"
            }
            DefectKind::ZeroPulses {
                left_out: false, ..
            } => ": the normalisation of the image counts them",
            DefectKind::ZeroPulses { left_out: true, .. } => {
                ": the image is normalised by the others"
            }
            _ => "",
        };
        format!("{}: {self}{effect}", self.examined.subject())
    }

    /// Measured values as text, without [`Examined::of_pulses`].
    pub fn measured(&self) -> String {
        match self.kind {
            DefectKind::Gaps {
                missing_pulses,
                gaps,
                after_pulse,
                after_s,
                first_gap_s,
                interval_s,
                ..
            } => format!(
                "{missing_pulses} pulse{} missing in {gaps} gap{} of the pulse times, the first of {} after pulse {after_pulse} at {after_s:.6} s (usual \
                 interval {})",
                if missing_pulses == 1 { " is" } else { "s are" },
                if gaps == 1 { "" } else { "s" },
                seconds(first_gap_s),
                seconds(interval_s)
            ),
            DefectKind::ZeroPulses {
                count,
                first_pulse,
                channels,
                left_out,
            } => format!(
                "{count} of {} pulses{} contain only zeros{}, the first is pulse {first_pulse}",
                self.examined.examined_pulses,
                if channels == 1 {
                    ""
                } else {
                    " of all channels"
                },
                if left_out { " and are left out" } else { "" }
            ),
            DefectKind::ZeroSweeps { count, averaged } => format!(
                "{count} sweeps contain only zeros and are left out of the averages of {averaged} sweeps"
            ),
            DefectKind::Bias {
                re,
                im,
                re_deviation,
                im_deviation,
                ..
            } => match im.zip(im_deviation) {
                None => format!("bias of the samples of {}", mean(re, re_deviation)),
                Some((im, im_deviation)) => format!(
                    "I/Q bias of {} in I and {} in Q",
                    mean(re, re_deviation),
                    mean(im, im_deviation)
                ),
            },
            DefectKind::Imbalance {
                gain_db,
                phase_deg,
                image_db,
                ..
            } => format!(
                "I/Q imbalance, Q has a gain of {gain_db:+.2} dB relative to I and a phase error of {phase_deg:+.2} deg, which gives images of {image_db:.1} dB \
                 at mirrored frequencies"
            ),
            DefectKind::Clipped { share, low, high } => format!(
                "{} % of the values are clipped, at {} or {}",
                significant(100.0 * share, 2),
                significant(low, 6),
                significant(high, 6)
            ),
        }
    }
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.measured(), self.examined.of_pulses())
    }
}

/// Mean and its ratio to the standard deviation as text.
fn mean(mean: f64, deviation: f64) -> String {
    let percent = match deviation > 0.0 {
        true => format!(
            " ({:.1} % of its standard deviation)",
            100.0 * mean.abs() / deviation
        ),
        false => String::new(),
    };
    format!("{}{percent}", significant(mean, 4))
}
