//! Reading of a capture: all sweeps mixed and divided by their reference.

use std::path::{Path, PathBuf};

use subaperture_model::phase_history::ReadError;

use super::HistoryError;
use super::motion::Timing;
use crate::profile::{self, Ranging, Sweep};
use crate::sigmf::{Recording, Setup};

/// Options of reading a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Phase reference, maximum range and calibration.
    pub profile: profile::Options,
    /// Memory limit for all sweeps, bytes.
    pub memory_bytes: u64,
}

impl Default for Options {
    /// Reference of the plan, no calibration, and 1 GiB: two hours of sweeps with 151 carriers and two receivers.
    fn default() -> Self {
        Self {
            profile: profile::Options::default(),
            memory_bytes: 1 << 30,
        }
    }
}

/// Sweep skipped as unusable.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// Index of the sweep in the recording.
    pub sweep: u64,
    /// Reason why it was skipped, for the report.
    pub why: String,
}

/// Capture whose sweeps are mixed, calibrated and divided by their reference. Antenna positions are given later, by a
/// [`Placement`](super::Placement).
#[derive(Debug)]
pub struct Capture {
    pub(super) path: PathBuf,
    pub(super) setup: Setup,
    pub(super) reach_m: f64,
    /// Responses by sweep, then by receiver.
    pub(super) sweeps: Vec<Vec<Sweep>>,
    receivers: &'static [usize],
    indices: Vec<u64>,
    left_out: Vec<LeftOut>,
    interrupted: bool,
}

impl Capture {
    /// Open a recording by any of its files, or by its name, and read it once.
    ///
    /// # Errors
    /// If the path is not a recording, the options do not fit it, no sweep is usable, or the memory limit is exceeded.
    pub fn open(path: &Path, options: Options) -> Result<Self, HistoryError> {
        let mut recording = Recording::open_within(path, options.memory_bytes)?;
        let setup = recording.setup().clone();
        let mut ranging = Ranging::new(&setup, options.profile)?;
        let receivers = ranging.reference().receivers();
        let mut all: Vec<u64> = recording.steps().iter().map(|step| step.sweep).collect();
        all.dedup();
        let bytes =
            all.len() as u64 * (receivers.len() * setup.band().count * CARRIER_BYTES) as u64;
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
            // A sweep with too few carriers to be interpolated is skipped.
            let read = ranging
                .read(&mut recording, index)
                .and_then(|sweeps| sweeps.iter().try_for_each(Sweep::check).map(|()| sweeps));
            match read {
                Ok(of_receivers) if !Timing::of(&of_receivers[0]).is_finite() => {
                    left_out.push(LeftOut {
                        sweep: index,
                        why: "its steps have non-finite times".to_owned(),
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
                first: left_out.first().map_or_else(
                    || "the recording has no steps".to_owned(),
                    |left| left.why.clone(),
                ),
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

    /// Parameters of the recording.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Indices in the recording of the sweeps that became pulses.
    pub fn sweeps(&self) -> &[u64] {
        &self.indices
    }

    /// Sweeps skipped as unusable.
    pub fn left_out(&self) -> &[LeftOut] {
        &self.left_out
    }

    /// Receivers of the radio to which the channels belong.
    pub fn receivers(&self) -> &'static [usize] {
        self.receivers
    }

    /// Response of receiver `receiver` (index into [`Self::receivers`]) in sweep `sweep` (index into [`Self::sweeps`]).
    ///
    /// # Panics
    /// If `sweep` or `receiver` is out of range.
    pub fn response(&self, sweep: usize, receiver: usize) -> &Sweep {
        &self.sweeps[sweep][receiver]
    }

    /// Device times of the first and last carriers, seconds.
    pub fn span_s(&self) -> (f64, f64) {
        let times = self.sweeps.iter().flat_map(|of| of[0].moments());
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(from, to), (_, at)| {
            (from.min(at), to.max(at))
        })
    }

    /// Warnings about the capture, one sentence each.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let Some(first) = self.left_out.first() {
            warnings.push(format!(
                "{} of {} sweeps are skipped, for example sweep {}: {}",
                self.left_out.len(),
                self.left_out.len() + self.indices.len(),
                first.sweep,
                first.why
            ));
        }
        if self.interrupted {
            warnings.push("the capture was interrupted or is still running".to_owned());
        }
        warnings
    }
}

/// Memory of a carrier of one receiver: its value and its time.
const CARRIER_BYTES: usize = size_of::<Option<num_complex::Complex64>>() + size_of::<f64>();
