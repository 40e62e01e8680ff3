//! Folder of a capture: one Touchstone file per sweep, the recording's description, and the record.
//!
//! A sweep's file is written first and never changed. Description, times and record follow from the files: they are renewed at least once a second,
//! at the end, and when a capture is continued. A description edited meanwhile keeps its other keys.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use subaperture_describe::Description;
use subaperture_io::atomic::{AtomicFile, write_atomically};
use subaperture_io::npy::ArrayWriter;

use super::description::{self, POSITIONS};
use super::error::VnaError;
use super::fault::{Fault, FaultKind};
use super::instrument::Sweep;
use super::settings::{Mode, VnaExperiment};
use super::touchstone;

const RECORD: &str = "capture.json";
const DESCRIPTION: &str = "recording.toml";
/// Largest number of sweeps: that of the files of a recording.
pub(super) const MOST_SWEEPS: u64 = 100_000;
/// Largest number of faults with their text.
const MOST_FAULTS: usize = 10_000;
/// Largest size of a record or of positions, bytes.
const MOST_BYTES: u64 = 64 << 20;
/// Longest time until description and record contain a sweep.
const RENEWED: Duration = Duration::from_secs(1);

/// Fault with its sweep.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct RecordedFault {
    sweep: u64,
    #[serde(flatten)]
    fault: Fault,
}

/// Record of a capture, `capture.json`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Record {
    /// Settings that all sweeps share.
    pub settings: BTreeMap<String, String>,
    /// Identification of the analyser.
    pub instrument: String,
    /// Time 0 of the sweeps' times, milliseconds since 1970.
    pub started_unix_ms: u64,
    /// Number of sweeps in the folder.
    pub sweeps: u64,
    /// State: running, done, stopped or failed.
    pub state: String,
    /// Number of faults by kind.
    pub fault_counts: BTreeMap<FaultKind, u64>,
    /// The first faults, at most 10,000.
    faults: Vec<RecordedFault>,
}

pub(super) struct Folder<'a> {
    path: &'a Path,
    experiment: &'a VnaExperiment,
    pub(super) record: Record,
    /// Time of each sweep, seconds.
    times_s: Vec<f64>,
    /// Instant and time, seconds, of the first connection of this run; `None` before.
    begun: Option<(Instant, f64)>,
    renewed: Option<Instant>,
    /// Time of a sweep as stated by the analyser, seconds.
    sweep_s: f64,
}

fn refuse<T>(path: &Path, message: impl std::fmt::Display) -> Result<T, VnaError> {
    Err(VnaError::Folder(format!("{}: {message}", path.display())))
}

/// Bytes of a file of bounded size; `None` if it does not exist.
fn bytes_of(path: &Path) -> Result<Option<Vec<u8>>, VnaError> {
    let mut bytes = Vec::new();
    let read = fs::File::open(path).and_then(|file| file.take(MOST_BYTES).read_to_end(&mut bytes));
    match read {
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(VnaError::Read {
            path: path.to_owned(),
            source,
        }),
    }
}

impl<'a> Folder<'a> {
    /// Open a new folder, or the folder of a capture with the same settings, and write no file.
    pub(super) fn open(path: &'a Path, experiment: &'a VnaExperiment) -> Result<Self, VnaError> {
        let shared = experiment.shared().into_iter();
        let settings = shared.map(|(key, value)| (key.to_owned(), value)).collect();
        let mut folder = Self {
            path,
            experiment,
            record: Record {
                settings,
                ..Record::default()
            },
            times_s: Vec::new(),
            begun: None,
            renewed: None,
            sweep_s: experiment.analyser.sweep_s(),
        };
        let entries = match fs::read_dir(path) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(folder),
            Err(source) => {
                let path = path.to_owned();
                return Err(VnaError::Read { path, source });
            }
        };
        let names = entries.filter_map(|entry| Some(entry.ok()?.file_name().into_string()));
        let names: Vec<String> = names.filter_map(Result::ok).collect();
        match bytes_of(&path.join(RECORD))? {
            Some(bytes) => folder.continue_from(&bytes, &names)?,
            None if names.iter().all(|name| name.starts_with('.')) => {}
            None => {
                return refuse(
                    path,
                    format!(
                        "expected a new or empty folder, or that of a capture with its {RECORD}, found other files: choose another folder"
                    ),
                );
            }
        }
        Ok(folder)
    }

    fn continue_from(&mut self, record: &[u8], names: &[String]) -> Result<(), VnaError> {
        let earlier: Record = match serde_json::from_slice(record) {
            Ok(record) => record,
            Err(error) => {
                let message = format!("expected the record of a capture: {error}");
                return refuse(&self.path.join(RECORD), message);
            }
        };
        for (key, value) in &self.record.settings {
            let before = earlier.settings.get(key).map_or("absent", |value| value);
            if before != value {
                return refuse(
                    self.path,
                    format!(
                        "its sweeps have {key} = {before}, the experiment has {value}: restore the setting, or choose another folder"
                    ),
                );
            }
        }
        let mut sweeps: Vec<u64> = names.iter().filter_map(|n| touchstone::number(n)).collect();
        sweeps.sort_unstable();
        for (index, &number) in (0..).zip(&sweeps) {
            let path = self.sweep_path(index);
            if number != index {
                return refuse(&path, "this sweep is missing: restore its file");
            }
            let text = bytes_of(&path)?.unwrap_or_default();
            let Some(time_s) = touchstone::time_s(&String::from_utf8_lossy(&text)) else {
                return refuse(
                    &path,
                    "expected the time of the sweep in a comment, found no such line: restore the file",
                );
            };
            self.times_s.push(time_s);
        }
        self.record = earlier;
        self.record.sweeps = sweeps.len() as u64;
        Ok(())
    }

    fn sweep_path(&self, sweep: u64) -> PathBuf {
        let name = touchstone::name(sweep, self.experiment.analyser.parameter);
        self.path.join(name)
    }

    /// Whether the analyser was connected in this run.
    pub(super) fn has_begun(&self) -> bool {
        self.begun.is_some()
    }

    /// Number of sweeps in the folder.
    pub(super) fn count(&self) -> u64 {
        self.times_s.len() as u64
    }

    /// Take the identification of the analyser and the time of its sweep. The first call of a run begins the capture.
    pub(super) fn begin(&mut self, identity: &str, sweep_s: f64) -> Result<(), VnaError> {
        let earlier = &self.record.instrument;
        if !earlier.is_empty() && earlier != identity {
            return refuse(
                self.path,
                format!(
                    "its sweeps were measured by '{earlier}', the analyser is '{identity}': connect the former, or choose another folder"
                ),
            );
        }
        self.sweep_s = sweep_s.max(self.experiment.analyser.sweep_s());
        if self.begun.is_some() {
            return Ok(());
        }
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let now_ms = since_1970.unwrap_or_default().as_millis() as u64;
        if self.record.started_unix_ms == 0 {
            self.record.started_unix_ms = now_ms;
        }
        let time_s = (now_ms as f64 - self.record.started_unix_ms as f64) / 1e3;
        if self.times_s.last().is_some_and(|last_s| *last_s >= time_s) {
            return refuse(
                self.path,
                "the clock of this computer is before the last sweep: set the clock, or choose another folder",
            );
        }
        identity.clone_into(&mut self.record.instrument);
        "running".clone_into(&mut self.record.state);
        self.begun = Some((Instant::now(), time_s));
        self.copy_positions()?;
        self.renew()
    }

    /// Copy the positions, so that the folder is complete.
    fn copy_positions(&self) -> Result<(), VnaError> {
        let copy = self.path.join(POSITIONS);
        let Some(track) = self
            .experiment
            .scan
            .track
            .as_ref()
            .filter(|_| !copy.exists())
        else {
            return Ok(());
        };
        let Some(bytes) = bytes_of(track)? else {
            return refuse(
                track,
                "expected the positions of the stops, found no file: remove scan.positions, and complete the recording's description afterwards",
            );
        };
        Ok(write_atomically(&copy, bytes.len() as u64, |file| {
            file.write_all(&bytes)
        })?)
    }

    /// Record faults of the next sweep.
    pub(super) fn note(&mut self, faults: &[Fault]) -> Result<(), VnaError> {
        let sweep = self.count();
        for fault in faults {
            *self.record.fault_counts.entry(fault.kind).or_default() += 1;
            if self.record.faults.len() < MOST_FAULTS {
                let fault = fault.clone();
                self.record.faults.push(RecordedFault { sweep, fault });
            }
        }
        match self.begun {
            Some(_) if !faults.is_empty() => self.write_record(),
            _ => Ok(()),
        }
    }

    /// Write the file of the next sweep.
    pub(super) fn put(&mut self, sweep: &Sweep) -> Result<(), VnaError> {
        let (began, offset_s) = self.begun.unwrap_or((sweep.ended, 0.0));
        let since_s = sweep.ended.saturating_duration_since(began).as_secs_f64();
        // The middle of the sweep.
        let time_s = (offset_s + since_s - 0.5 * self.sweep_s).max(offset_s);
        let parameter = self.experiment.analyser.parameter;
        let text = touchstone::text(sweep, time_s, parameter, &self.record.instrument);
        let path = self.sweep_path(self.count());
        // The file's lock is held: no other capture creates it meanwhile.
        let mut file = AtomicFile::create(&path, text.len() as u64, ".part")?;
        if path.exists() {
            return refuse(
                &path,
                "it exists, and sweeps are never overwritten: end the other capture into this folder",
            );
        }
        let written = file.file().write_all(text.as_bytes());
        written.map_err(|error| file.failed(error))?;
        file.commit()?;
        self.times_s.push(time_s);
        match self.renewed {
            Some(at) if at.elapsed() < RENEWED => Ok(()),
            _ => self.renew(),
        }
    }

    /// Write the last state. It changes only after a connection in this run.
    pub(super) fn finish(&mut self, state: &str) -> Result<(), VnaError> {
        state.clone_into(&mut self.record.state);
        match self.begun {
            Some(_) => self.renew(),
            None => Ok(()),
        }
    }

    fn write_record(&mut self) -> Result<(), VnaError> {
        self.record.sweeps = self.count();
        let path = self.path.join(RECORD);
        Ok(write_atomically(&path, 0, |file| {
            serde_json::to_writer_pretty(&mut *file, &self.record)?;
            file.write_all(b"\n")
        })?)
    }

    /// Write times, description and record.
    fn renew(&mut self) -> Result<(), VnaError> {
        self.renewed = Some(Instant::now());
        self.write_record()?;
        let Some(last) = self.count().checked_sub(1) else {
            return Ok(());
        };
        let file = touchstone::name(0, self.experiment.analyser.parameter)
            .replace("00000", &format!("{{00000..{last:05}}}"));
        // The name contains the count, so that the description always fits its times.
        let times = format!("times{:05}.npy", self.count());
        let is_free = self.experiment.scan.mode == Mode::Free;
        if is_free {
            write_atomically(&self.path.join(&times), 0, |stream| {
                let mut writer = ArrayWriter::new(stream, &[self.times_s.len()])?;
                writer.put(&self.times_s)?;
                writer.finish()
            })?;
        }
        let path = self.path.join(DESCRIPTION);
        let text = match bytes_of(&path)? {
            None => description::text(self.experiment, &file, &times, self.sweep_s),
            Some(bytes) => {
                let text = String::from_utf8_lossy(&bytes).into_owned();
                let description = Description::new(path.display().to_string(), text, self.path);
                let mut values = vec![("recording.file", &*file)];
                if is_free {
                    values.push(("recording.times", &times));
                }
                match description.with_values(values) {
                    Ok(text) => text,
                    Err(message) => return refuse(&path, message),
                }
            }
        };
        write_atomically(&path, text.len() as u64, |stream| {
            stream.write_all(text.as_bytes())
        })?;
        self.remove_old_times(&times);
        Ok(())
    }

    /// Remove arrays of times that the description no longer names. One that cannot be removed does no harm.
    fn remove_old_times(&self, kept: &str) {
        for entry in fs::read_dir(self.path).into_iter().flatten().flatten() {
            let name = entry.file_name().into_string().unwrap_or_default();
            let digits = name
                .strip_prefix("times")
                .and_then(|n| n.strip_suffix(".npy"));
            if name != kept && digits.is_some_and(|d| d.bytes().all(|b| b.is_ascii_digit())) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}
