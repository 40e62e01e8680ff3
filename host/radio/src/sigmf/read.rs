//! Reader of SigMF recordings.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;
use subaperture_io::input::open_file;
use subaperture_io::json::{self, JsonError, Limits};

use super::metadata::{DATATYPE, Meta, SPACE, Setup, Step};
use super::{DATA, JOURNAL, META, SigmfError, beside};
use crate::plan::MAX_SAMPLES;
use crate::transceiver::Sample;

/// Limits on metadata and journals: an hour of steps every 5 ms. A step takes some hundred bytes, or some ten thousand
/// with the largest number of gaps.
const LIMITS: Limits = Limits {
    bytes: 512 << 20,
    string_bytes: 64 << 10,
    value_bytes: 1 << 20,
};

/// Memory per step, including the growth of the lists.
const STEP_BYTES: u64 = 3 * size_of::<Step>() as u64;

/// Recording opened for reading. Its steps are in memory; samples are read on request.
#[derive(Debug)]
pub struct Recording {
    setup: Setup,
    steps: Vec<Step>,
    data: File,
    path: PathBuf,
    interrupted: bool,
    bytes: Vec<u8>,
}

impl Recording {
    /// Open a recording by any of its files, or by its name. The complete part of an interrupted recording is opened.
    ///
    /// # Errors
    /// If a file is missing or has another format, or if a step extends beyond the data.
    pub fn open(path: &Path) -> Result<Self, SigmfError> {
        Self::open_within(path, u64::MAX)
    }

    /// Open like [`Self::open`], with at most `memory_bytes` for the steps.
    ///
    /// # Errors
    /// Those of [`Self::open`]; [`SigmfError::Memory`].
    pub fn open_within(path: &Path, memory_bytes: u64) -> Result<Self, SigmfError> {
        let (meta_path, path) = (beside(path, META), beside(path, DATA));
        let file = open_file(&meta_path).map_err(SigmfError::io(&meta_path))?;
        let mut annotated = Steps::within(memory_bytes);
        let mut index = 0;
        let read = json::each_element(file, LIMITS, "annotations", &["global"], &mut |element| {
            let annotation = annotation(element, index)?;
            index += 1;
            annotation.map_or(Ok(()), |step| annotated.push(step))
        });
        if annotated.are_too_many {
            return Err(annotated.too_many(&meta_path));
        }
        let no_metadata = |what: String| {
            SigmfError::format(&meta_path, format!("invalid SigMF metadata: {what}"))
        };
        let rest = read.map_err(|error| match error {
            JsonError::Io(source) => SigmfError::io(&meta_path)(source),
            error => no_metadata(error.to_string()),
        })?;
        let meta: Meta = serde_json::from_value(Value::Object(rest))
            .map_err(|error| no_metadata(error.to_string()))?;
        if meta.global.datatype != DATATYPE || meta.global.num_channels != 2 {
            let what = format!(
                "{} channels of type {}: expected two of {DATATYPE}, reference and echo",
                meta.global.num_channels, meta.global.datatype
            );
            return Err(SigmfError::format(&meta_path, what));
        }
        let Some(setup) = meta.global.setup else {
            let what = "SigMF file without \"subaperture:setup\": expected a stepped-frequency capture of this project";
            return Err(SigmfError::format(&meta_path, what));
        };
        check(&setup).map_err(|what| SigmfError::format(&meta_path, what))?;
        let data = open_file(&path).map_err(SigmfError::io(&path))?;
        let bytes = data.metadata().map_err(SigmfError::io(&path))?.len();
        let journal_path = beside(&path, JOURNAL);
        // Only NotFound means that there is no journal. Any other error must be reported, or its steps would be lost.
        let journal = match open_file(&journal_path) {
            Ok(journal) => Some(journal),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(SigmfError::io(&journal_path)(error)),
        };
        let interrupted = journal.is_some();
        let steps = match journal {
            Some(journal) => {
                let mut steps = lines(journal, memory_bytes, &journal_path)?;
                // Drop steps whose samples did not reach the disk before a power failure.
                steps.retain(|step| lies_within(step, bytes));
                steps
            }
            None => annotated.steps,
        };
        for (index, step) in steps.iter().enumerate() {
            let gaps = step
                .lost
                .iter()
                .all(|gap| gap.0 <= gap.1 && gap.1 <= step.samples);
            if !lies_within(step, bytes)
                || !gaps
                || !is_plausible(step)
                || step.samples > MAX_SAMPLES
                || step.step >= setup.steps
            {
                let what = format!(
                    "step {index} is invalid or extends beyond the data of {bytes} bytes: the file may be truncated, or belong to another recording"
                );
                return Err(SigmfError::format(&path, what));
            }
        }
        Ok(Self {
            setup,
            steps,
            data,
            path,
            interrupted,
            bytes: Vec::new(),
        })
    }

    /// Parameters of the recording.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Path of the sample file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Steps in recording order.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Whether the writer was killed or is still writing. The steps are then those of the journal.
    pub fn interrupted(&self) -> bool {
        self.interrupted
    }

    /// Read step `index` into two channels, which are resized to its length.
    ///
    /// # Errors
    /// If reading fails.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn read(
        &mut self,
        index: usize,
        channels: &mut [Vec<Sample>; 2],
    ) -> Result<(), SigmfError> {
        let step = &self.steps[index];
        self.bytes.resize(8 * step.samples, 0);
        self.data
            .seek(SeekFrom::Start(8 * step.start))
            .and_then(|_| self.data.read_exact(&mut self.bytes))
            .map_err(SigmfError::io(&self.path))?;
        for (c, channel) in channels.iter_mut().enumerate() {
            let part = |frame: &[u8], i: usize| {
                i16::from_le_bytes([frame[4 * c + i], frame[4 * c + i + 1]])
            };
            channel.clear();
            channel.extend(
                self.bytes
                    .chunks_exact(8)
                    .map(|frame| Sample::new(part(frame, 0), part(frame, 2))),
            );
        }
        Ok(())
    }
}

/// Highest frequency, hertz, and latest time, seconds (3000 years), accepted.
const MAX_HZ: f64 = 1e12;
const MAX_S: f64 = 1e11;

fn is_plausible(step: &Step) -> bool {
    (0.0..=MAX_HZ).contains(&step.carrier_hz) && step.time_s.abs() <= MAX_S
}

/// Whether a key belongs to the namespace of this project.
fn is_own(key: &str) -> bool {
    key.strip_prefix(SPACE)
        .is_some_and(|rest| rest.starts_with(':'))
}

fn lies_within(step: &Step, bytes: u64) -> bool {
    let end = step.start.checked_add(step.samples as u64);
    end.and_then(|end| end.checked_mul(8))
        .is_some_and(|end| end <= bytes)
}

fn check(setup: &Setup) -> Result<(), String> {
    let positive = |x: f64| x > 0.0 && x <= MAX_HZ;
    let sound = positive(setup.sample_rate_hz)
        && positive(setup.start_hz)
        && positive(setup.step_hz)
        && (1..=1 << 16).contains(&setup.steps)
        && (3..=65536).contains(&setup.period)
        && (1..=MAX_SAMPLES).contains(&setup.samples);
    match sound {
        true => Ok(()),
        false => Err("invalid \"subaperture:setup\": expected rates and frequencies above 0 and at most 1e12 Hz, 1 to 65536 steps, and periods of 3 to 65536 samples".to_owned()),
    }
}

/// Steps being read, with a memory limit.
struct Steps {
    steps: Vec<Step>,
    memory_bytes: u64,
    bytes: u64,
    are_too_many: bool,
}

impl Steps {
    fn within(memory_bytes: u64) -> Self {
        Self {
            steps: Vec::new(),
            memory_bytes,
            bytes: 0,
            are_too_many: false,
        }
    }

    fn push(&mut self, step: Step) -> Result<(), String> {
        let lists = size_of_val(step.flags.as_slice()) + size_of_val(step.lost.as_slice());
        self.bytes += STEP_BYTES + lists as u64;
        if self.bytes > self.memory_bytes {
            self.are_too_many = true;
            return Err("the steps exceed the memory limit".to_owned());
        }
        self.steps.push(step);
        Ok(())
    }

    fn too_many(&self, path: &Path) -> SigmfError {
        SigmfError::Memory {
            path: path.to_owned(),
            steps: self.steps.len(),
            allowed_bytes: self.memory_bytes,
        }
    }
}

/// Step of an annotation; `None` for an annotation of other software.
fn annotation(element: Value, index: usize) -> Result<Option<Step>, String> {
    if let Ok(step) = Step::deserialize(&element) {
        return Ok(Some(step));
    }
    let keys = element
        .as_object()
        .ok_or("expected an annotation to be an object")?;
    match keys.keys().find(|key| is_own(key)) {
        None => Ok(None),
        Some(own) => Err(format!(
            "annotation {index} has \"{own}\" but is not a valid step: a key is missing or has another type. Restore the file, or remove the \
             annotation"
        )),
    }
}

/// Steps of a journal up to the first invalid line.
fn lines(journal: File, memory_bytes: u64, path: &Path) -> Result<Vec<Step>, SigmfError> {
    let mut reader = BufReader::new(journal.take(LIMITS.bytes));
    let (mut steps, mut line) = (Steps::within(memory_bytes), Vec::new());
    loop {
        line.clear();
        reader
            .by_ref()
            .take(LIMITS.value_bytes)
            .read_until(b'\n', &mut line)
            .map_err(SigmfError::io(path))?;
        let whole = line.last() == Some(&b'\n');
        match serde_json::from_slice(&line) {
            Ok(step) if whole => steps.push(step).map_err(|_| steps.too_many(path))?,
            _ => return Ok(steps.steps),
        }
    }
}
