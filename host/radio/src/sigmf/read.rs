//! Recordings, read.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::metadata::{Annotation, DATATYPE, Meta, SPACE, Setup, Step};
use super::{DATA, JOURNAL, META, SigmfError, beside};
use crate::plan::MOST_SAMPLES;
use crate::transceiver::Sample;

/// Longest metadata or journal that is read, bytes: an hour of steps every 5 ms.
const LONGEST_BYTES: u64 = 512 << 20;
/// Longest line of a journal, bytes; far longer than a step with all the gaps that it can have.
const LONGEST_LINE: u64 = 1 << 20;

/// A recording's steps and its samples, which are read when asked for.
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
    /// Opens a recording by any of its files, or its name. One that was killed while it was written opens with what is whole.
    ///
    /// # Errors
    /// If a file is missing or is not what is written here; steps that point beyond the data.
    pub fn open(path: &Path) -> Result<Self, SigmfError> {
        let (meta_path, path) = (beside(path, META), beside(path, DATA));
        let meta = File::open(&meta_path).map_err(SigmfError::io(&meta_path))?;
        short(&meta, &meta_path)?;
        let meta: Meta = serde_json::from_reader(BufReader::new(meta)).map_err(|error| {
            SigmfError::format(&meta_path, format!("no SigMF metadata: {error}"))
        })?;
        if meta.global.datatype != DATATYPE || meta.global.num_channels != 2 {
            let what = format!(
                "{} channels of {}; two of {DATATYPE}, reference and echo, are wanted",
                meta.global.num_channels, meta.global.datatype
            );
            return Err(SigmfError::format(&meta_path, what));
        }
        let Some(setup) = meta.global.setup else {
            let what = "this is SigMF, but no capture of stepped carriers: it has no \"subaperture:setup\"";
            return Err(SigmfError::format(&meta_path, what));
        };
        check(&setup).map_err(|what| SigmfError::format(&meta_path, what))?;
        let data = File::open(&path).map_err(SigmfError::io(&path))?;
        let bytes = data.metadata().map_err(SigmfError::io(&path))?.len();
        let journal_path = beside(&path, JOURNAL);
        // Only one that is not there is none: steps of one that cannot be read are lost otherwise.
        let journal = match File::open(&journal_path) {
            Ok(journal) => Some(journal),
            Err(error) if error.kind() == ErrorKind::NotFound => None,
            Err(error) => return Err(SigmfError::io(&journal_path)(error)),
        };
        let interrupted = journal.is_some();
        let steps = match journal {
            Some(journal) => {
                short(&journal, &journal_path)?;
                let mut steps = lines(journal).map_err(SigmfError::io(&journal_path))?;
                // What a machine without power has not brought to disk.
                steps.retain(|step| lies_within(step, bytes));
                steps
            }
            None => {
                let all = meta.annotations.into_iter().enumerate();
                let steps = all.filter_map(|(index, annotation)| match annotation {
                    Annotation::Step(step) => Some(Ok(*step)),
                    Annotation::Other(keys) => {
                        let own = keys.into_keys().find(|key| is_own(key))?;
                        let what = format!(
                            "annotation {index} has \"{own}\" and is no step, for a key is missing or has another type: restore the \
                             file, or take the annotation out"
                        );
                        Some(Err(SigmfError::format(&meta_path, what)))
                    }
                });
                steps.collect::<Result<_, _>>()?
            }
        };
        for (index, step) in steps.iter().enumerate() {
            let gaps = step
                .lost
                .iter()
                .all(|gap| gap.0 <= gap.1 && gap.1 <= step.samples);
            if !lies_within(step, bytes)
                || !gaps
                || !makes_sense(step)
                || step.samples > MOST_SAMPLES
                || step.step >= setup.steps
            {
                let what = format!(
                    "step {index} makes no sense, or does not lie in the data of {bytes} bytes; is this file cut off, or another's?"
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

    /// What holds for all steps.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The file of samples.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The steps in the order of the recording.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Whether its writer was killed, or still writes: its steps are those of the journal.
    pub fn interrupted(&self) -> bool {
        self.interrupted
    }

    /// Reads step `index` into two channels, which become as long as it.
    ///
    /// # Errors
    /// If the system refuses.
    ///
    /// # Panics
    /// If there is no such step.
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

/// Highest frequency, hertz, and farthest time, seconds: 3000 years.
const MOST_HZ: f64 = 1e12;
const MOST_S: f64 = 1e11;

fn makes_sense(step: &Step) -> bool {
    (0.0..=MOST_HZ).contains(&step.carrier_hz) && step.time_s.abs() <= MOST_S
}

/// Whether a key is of our own namespace.
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
    let positive = |x: f64| x > 0.0 && x <= MOST_HZ;
    let sound = positive(setup.sample_rate_hz)
        && positive(setup.start_hz)
        && positive(setup.step_hz)
        && (1..=1 << 16).contains(&setup.steps)
        && (3..=65536).contains(&setup.period)
        && (1..=MOST_SAMPLES).contains(&setup.samples);
    match sound {
        true => Ok(()),
        false => Err("\"subaperture:setup\" makes no sense: rates and frequencies are above 0 and at most 1e12 Hz, steps 1 to 65536, periods 3 to 65536".to_owned()),
    }
}

fn short(file: &File, path: &Path) -> Result<(), SigmfError> {
    let length = file.metadata().map_err(SigmfError::io(path))?.len();
    if length > LONGEST_BYTES {
        return Err(SigmfError::format(
            path,
            format!("{length} bytes of metadata; {LONGEST_BYTES} are the most that is read"),
        ));
    }
    Ok(())
}

/// The steps of a journal up to the first line that is none.
fn lines(journal: File) -> std::io::Result<Vec<Step>> {
    let mut reader = BufReader::new(journal);
    let (mut steps, mut line) = (Vec::new(), Vec::new());
    loop {
        line.clear();
        reader
            .by_ref()
            .take(LONGEST_LINE)
            .read_until(b'\n', &mut line)?;
        let whole = line.last() == Some(&b'\n');
        match serde_json::from_slice(&line) {
            Ok(step) if whole => steps.push(step),
            _ => return Ok(steps),
        }
    }
}
