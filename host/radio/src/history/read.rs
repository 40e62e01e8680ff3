//! A capture's sweeps, mixed and referred.

use std::path::{Path, PathBuf};

use subaperture_model::phase_history::ReadError;

use super::HistoryError;
use super::motion::Timing;
use crate::profile::{self, Ranging, Sweep};
use crate::sigmf::{Recording, Setup};

/// How a capture is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// What phases are referred to, how far echoes reach, and the calibration.
    pub profile: profile::Options,
    /// Bytes that all sweeps together may take.
    pub memory_bytes: u64,
}

impl Default for Options {
    /// What the plan said, not calibrated, in 1 GiB: two hours of sweeps of 151 carriers by two receivers.
    fn default() -> Self {
        Self {
            profile: profile::Options::default(),
            memory_bytes: 1 << 30,
        }
    }
}

/// A sweep that is not in the history.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// Its index in the recording.
    pub sweep: u64,
    /// What is wrong with it.
    pub why: String,
}

/// A capture whose every sweep is mixed, calibrated and referred; where its antennas were is not said yet.
#[derive(Debug)]
pub struct Capture {
    pub(super) path: PathBuf,
    pub(super) setup: Setup,
    pub(super) reach_m: f64,
    /// Of each sweep, of each receiver.
    pub(super) sweeps: Vec<Vec<Sweep>>,
    receivers: &'static [usize],
    indices: Vec<u64>,
    left_out: Vec<LeftOut>,
    interrupted: bool,
}

impl Capture {
    /// Opens a recording by any of its files, or its name, and reads it once.
    ///
    /// # Errors
    /// If it is no recording; options that do not fit it; no sweep of use; more than the memory allowed.
    pub fn open(path: &Path, options: Options) -> Result<Self, HistoryError> {
        let mut recording = Recording::open(path)?;
        let setup = recording.setup().clone();
        let mut ranging = Ranging::new(&setup, options.profile)?;
        let receivers = ranging.reference().receivers();
        let mut all: Vec<u64> = recording.steps().iter().map(|step| step.sweep).collect();
        all.dedup();
        let bytes = all.len() as u64 * (receivers.len() * setup.steps * CARRIER_BYTES) as u64;
        if bytes > options.memory_bytes {
            let error = ReadError::Memory {
                path: path.to_owned(),
                needed_bytes: bytes,
                allowed_bytes: options.memory_bytes,
            };
            return Err(error.into());
        }
        let (mut sweeps, mut indices, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
        for &index in &all {
            // What cannot be filled is no pulse.
            let read = ranging
                .read(&mut recording, index)
                .and_then(|sweeps| sweeps.iter().try_for_each(Sweep::check).map(|()| sweeps));
            match read {
                Ok(of_receivers) if !Timing::of(&of_receivers[0]).is_finite() => {
                    left_out.push(LeftOut {
                        sweep: index,
                        why: "its steps have times that are none".to_owned(),
                    });
                }
                Ok(of_receivers) => {
                    sweeps.push(of_receivers);
                    indices.push(index);
                }
                Err(profile::ProfileError::Recording(error)) => return Err(error.into()),
                Err(error) => left_out.push(LeftOut {
                    sweep: index,
                    why: error.to_string(),
                }),
            }
        }
        if sweeps.is_empty() {
            return Err(HistoryError::NoSweep {
                path: path.display().to_string(),
                sweeps: all.len(),
                first: left_out
                    .first()
                    .map_or_else(|| "it has no steps".to_owned(), |left| left.why.clone()),
            });
        }
        Ok(Self {
            path: recording.path().to_owned(),
            reach_m: ranging.reach_m(),
            interrupted: recording.interrupted(),
            setup,
            sweeps,
            receivers,
            indices,
            left_out,
        })
    }

    /// What holds for all of the recording.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Sweeps that are pulses, by their indices in the recording.
    pub fn sweeps(&self) -> &[u64] {
        &self.indices
    }

    /// Sweeps that are none.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// Which of the radio's receivers the channels are of.
    pub fn receivers(&self) -> &'static [usize] {
        self.receivers
    }

    /// The response of receiver number `receiver` of [`Self::receivers`] in a sweep of [`Self::sweeps`].
    ///
    /// # Panics
    /// If there is no such sweep or receiver.
    pub fn response(&self, sweep: usize, receiver: usize) -> &Sweep {
        &self.sweeps[sweep][receiver]
    }

    /// Device times of the first and the last carrier, seconds.
    pub fn span_s(&self) -> (f64, f64) {
        let times = self.sweeps.iter().flat_map(|of| of[0].moments());
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), (_, at)| {
            (from.min(at), to.max(at))
        })
    }

    /// What has to be known before trusting it, a sentence each.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(first) = self.left_out.first() {
            warnings.push(format!(
                "{} of {} sweeps are left out, sweep {} for example: {}",
                self.left_out.len(),
                self.left_out.len() + self.indices.len(),
                first.sweep,
                first.why
            ));
        }
        if self.interrupted {
            warnings.push("the capture was cut off, or still goes on".to_owned());
        }
        warnings
    }
}

/// What a carrier of a receiver takes: its value, and its time.
const CARRIER_BYTES: usize = size_of::<Option<num_complex::Complex64>>() + size_of::<f64>();
