//! Writer of echoes as a recording: arrays, and the description for [`super::RecordingFile`].
//!
//! | file | content |
//! |---|---|
//! | `echoes.npy` | samples as received, complex64, pulses x samples |
//! | `times.npy` | times of the pulses, seconds |
//! | `track-times.npy` | times of the track, seconds |
//! | `transmitter.npy` | transmitter positions by the measured track, x, y, z, metres |
//! | `receiver.npy` | receiver positions, if they differ |
//! | `transmitter-pattern.csv`, `receiver-pattern.csv` | antenna patterns given as tables |
//! | `recording.toml` | the description |
//!
//! With several channels the file names end in the channel's identifier: `echoes-T1R2.npy`. A recording has one
//! antenna pair, so each channel has a description.
//!
//! The track has one fix per pulse, at which spline and record agree to the last digit. For a radar that moves during
//! its sweeps it has [`FIXES`] per sweep, including one at the middle. The error of the spline in between is `5/384
//! h^4` of the path's fourth derivative, `h` an eighth of the sweep duration: 5 nm for 1 cm at 2 Hz and sweeps of 50
//! ms.
//!
//! Samples are written in float32 as delivered by the echoes, all numbers with all digits. The phase history read
//! back equals that of the echoes within float64 rounding. (Positions in CPHD are Earth-centred and rounded to 1 nm,
//! a phase of `4 pi 1 nm / lambda`.)
//!
//! Memory: blocks of 1 MiB, or one pulse. Cost: that of reading the echoes.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;
use serde_json::Value;

use super::text::{Facts, describe, describes_attitude};
use crate::atomic;
use crate::npy::ArrayWriter;
use crate::ours::{array_line, marked_description};
use crate::pattern_csv;
use crate::receive::Echoes;
use crate::staging::{Contents, Staged, StagedEntry, StagedFile};
use crate::together::FileSet;
use crate::written::{ChannelSize, FileKind, WrittenFile};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::ReadError;
use subaperture_model::radar::{MountedAntennas, Pattern, PatternTable, Waveform};

/// Maximum bytes of samples read at a time, unless one pulse is larger.
const BLOCK_BYTES: usize = 1 << 20;

/// Fixes of the track per sweep, first and last sample included.
const FIXES: usize = 9;

/// Echoes to write.
pub struct Raw<'a> {
    /// Identifier of the channel: letters, digits, `-` and `_`. Part of the file names if there are several channels.
    pub id: String,
    /// Echoes of the channel.
    pub echoes: &'a dyn Echoes,
    /// Antennas, described if one of them has a pattern, and [`describes_antennas`].
    pub antennas: Option<MountedAntennas>,
}

/// Whether [`write()`] describes the antennas of a channel: one has a pattern, and their attitude is constant or the
/// heading of the track. Antennas with another attitude are not described, since a reader would point their pattern
/// along the heading.
pub fn describes_antennas(raw: &Raw) -> bool {
    described(raw).is_some()
}

fn described<'r>(raw: &'r Raw) -> Option<&'r MountedAntennas> {
    let pulses = &raw.echoes.collection().pulses;
    let carried = raw.antennas.as_ref();
    carried.filter(|carried| carried.is_directive() && describes_attitude(carried, pulses))
}

/// Reason why echoes were not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The files could not be written.
    #[error(transparent)]
    Write(#[from] atomic::WriteError),
    /// The echoes could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The echoes cannot be described as a recording.
    #[error("{name}: cannot be described as a recording: {what}")]
    Unsuited {
        /// Name of the collection.
        name: String,
        /// Reason.
        what: String,
    },
    /// The monitor asked to stop.
    #[error("interrupted")]
    Cancelled,
}

/// Names of the files that [`write()`] writes for channels with these identifiers. A receiver's file is written only
/// if it is separate, a pattern only if it is a table.
pub fn names(ids: &[&str]) -> Vec<String> {
    let stems = [
        ("echoes", "npy"),
        ("times", "npy"),
        ("track-times", "npy"),
        ("transmitter", "npy"),
        ("receiver", "npy"),
        ("transmitter-pattern", "csv"),
        ("receiver-pattern", "csv"),
        ("recording", "toml"),
    ];
    let of = |id: &str| stems.map(|(stem, end)| name(stem, end, id, ids.len() > 1));
    ids.iter().flat_map(|id| of(id)).collect()
}

fn name(stem: &str, end: &str, id: &str, several: bool) -> String {
    match several {
        true => format!("{stem}-{id}.{end}"),
        false => format!("{stem}.{end}"),
    }
}

/// Write `channels` into `folder`, atomically: in a staging folder first, then renamed. In an existing folder,
/// descriptions are removed first and renamed last, so that a description always has its arrays.
///
/// # Errors
/// [`WriteError`]; the folder is then unchanged.
pub fn write(
    folder: &Path,
    channels: &[Raw],
    monitor: &dyn Monitor,
) -> Result<Vec<WrittenFile>, WriteError> {
    let mut alone = FileSet::new();
    add_to(&mut alone, folder, channels, monitor)?;
    Ok(alone.commit()?)
}

/// Like [`write()`], renamed together with the other files of a set.
///
/// # Errors
/// [`WriteError`].
pub fn add_to(
    files: &mut FileSet,
    folder: &Path,
    channels: &[Raw],
    monitor: &dyn Monitor,
) -> Result<(), WriteError> {
    let plans: Vec<Plan> = channels
        .iter()
        .map(|raw| Plan::new(raw, channels.len() > 1))
        .collect::<Result<_, _>>()?;
    let mut seen = BTreeSet::new();
    if let Some(plan) = plans.iter().find(|plan| !seen.insert(&plan.description)) {
        return Err(plan.unsuited("two channels have the same identifier"));
    }
    let total_bytes = plans.iter().map(Plan::bytes).sum();
    let staged = Staged::begin(folder, total_bytes)?;
    let names: Vec<&str> = plans.iter().flat_map(Plan::arrays).collect();
    let marks: Vec<&str> = plans.iter().map(|p| p.description.as_str()).collect();
    staged.check(names.iter().chain(&marks).copied())?;
    let mut done: u64 = 0;
    for plan in &plans {
        let mut arrays = plan.write_track(&staged)?;
        let echoes = plan.write_echoes(&staged, monitor, |bytes| {
            done += bytes;
            monitor.progress(done as f64 / total_bytes as f64);
        })?;
        arrays.push((&plan.samples, echoes));
        for (name, table) in &plan.tables {
            let about = staged.write(name, |file| {
                io::Write::write_all(file, pattern_csv::text(table).as_bytes())
            })?;
            arrays.push((name, about));
        }
        // Lets a later run recognise the arrays that it may replace.
        let mut text = plan.text.clone() + "\n";
        for (name, about) in arrays {
            let (bytes, crc32) = (about["bytes"].as_u64(), about["crc32"].as_str());
            let line = array_line(name, bytes.unwrap_or(0), crc32.unwrap_or_default());
            text += &format!("{line}\n");
        }
        let text = marked_description(&text);
        staged.write(&plan.description, |file| {
            io::Write::write_all(file, text.as_bytes())
        })?;
    }
    if monitor.cancelled() {
        return Err(WriteError::Cancelled);
    }
    files.add_folder(staged.complete(Contents {
        files: plans.iter().flat_map(Plan::entries).collect(),
        gone: Vec::new(),
    }));
    Ok(())
}

/// Files of one channel.
struct Plan<'a> {
    id: &'a str,
    echoes: &'a dyn Echoes,
    samples: String,
    times: String,
    track_times: String,
    transmitter: String,
    receiver: Option<String>,
    /// Names and samples of the patterns that are tables.
    tables: Vec<(String, PatternTable)>,
    description: String,
    text: String,
    /// Indices of the samples of a pulse at which the track is written, including the middle one.
    fixes: Vec<usize>,
}

impl<'a> Plan<'a> {
    fn new(raw: &'a Raw<'a>, several: bool) -> Result<Self, WriteError> {
        let echoes = raw.echoes;
        let collection = echoes.collection();
        let name = |stem: &str, end: &str| name(stem, end, &raw.id, several);
        let apart = collection
            .pulses
            .iter()
            .any(|pulse| pulse.transmitter_m != pulse.receiver_m);
        let moves = moves(echoes);
        let middle = collection.waveform.num_samples() / 2;
        let last = collection.waveform.num_samples() - 1;
        let spread = (0..if moves { FIXES } else { 0 }).map(|i| i * last / (FIXES - 1));
        let fixes: BTreeSet<usize> = spread.chain([middle]).collect();
        let mut plan = Self {
            id: &raw.id,
            echoes,
            samples: name("echoes", "npy"),
            times: name("times", "npy"),
            track_times: name("track-times", "npy"),
            transmitter: name("transmitter", "npy"),
            receiver: apart.then(|| name("receiver", "npy")),
            tables: Vec::new(),
            description: name("recording", "toml"),
            text: String::new(),
            fixes: fixes.into_iter().collect(),
        };
        let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if !raw.id.chars().all(plain) {
            return Err(plan.unsuited(&format!(
                "channel '{}': expected letters, digits, - and _, as for a file name",
                raw.id
            )));
        }
        let patterns = ["transmitter-pattern", "receiver-pattern"].map(|stem| name(stem, "csv"));
        let antennas = described(raw);
        for (name, antenna) in patterns
            .iter()
            .zip(antennas.iter().flat_map(|a| &a.antennas))
        {
            if let Pattern::Table(table) = &antenna.pattern {
                plan.tables.push((name.clone(), table.clone()));
            }
        }
        let facts = Facts {
            samples: &plan.samples,
            times: &plan.times,
            track_times: &plan.track_times,
            transmitter: &plan.transmitter,
            receiver: plan.receiver.as_deref(),
            moves,
            antennas,
            tables: patterns.each_ref().map(String::as_str),
        };
        plan.text = describe(collection, &facts).map_err(|what| plan.unsuited(&what))?;
        Ok(plan)
    }

    fn unsuited(&self, what: &str) -> WriteError {
        WriteError::Unsuited {
            name: self.echoes.collection().name.clone(),
            what: what.to_owned(),
        }
    }

    fn arrays(&self) -> impl Iterator<Item = &str> {
        let names = [
            &self.samples,
            &self.times,
            &self.track_times,
            &self.transmitter,
        ];
        let tables = self.tables.iter().map(|(name, _)| name);
        let names = names.into_iter().chain(&self.receiver).chain(tables);
        names.map(String::as_str)
    }

    /// Arrays and description of the channel.
    fn entries(&self) -> impl Iterator<Item = StagedEntry> {
        let collection = self.echoes.collection();
        let channel = ChannelSize {
            channel: self.id.to_owned(),
            pulses: collection.pulses.len(),
            samples: collection.waveform.num_samples(),
        };
        let arrays = self.arrays().map(|name| StagedEntry {
            file: WrittenFile::new(name, FileKind::Array),
            is_mark: false,
        });
        let description = WrittenFile::new(&self.description, FileKind::Recording);
        arrays.chain([StagedEntry {
            file: description.with_channels(vec![channel]),
            is_mark: true,
        }])
    }

    /// Size of the samples in bytes, which dominate the output.
    fn bytes(&self) -> u64 {
        let collection = self.echoes.collection();
        8 * collection.pulses.len() as u64 * collection.waveform.num_samples() as u64
    }

    /// Write times and antenna positions. Returns size and CRC-32 of every array.
    fn write_track(&self, staged: &Staged) -> Result<Vec<(&str, Value)>, WriteError> {
        let pulses = &self.echoes.collection().pulses;
        let mut written: Vec<(&str, Value)> = Vec::new();
        let about = self.array(staged, &self.times, &[pulses.len()], |times| {
            pulses
                .iter()
                .try_for_each(|pulse| times.put(&[pulse.time_s]))
        })?;
        written.push((&self.times, about));
        // A track has at least two fixes: a single one is repeated one second later.
        let lone = pulses.len() * self.fixes.len() == 1;
        let count = if lone {
            2
        } else {
            pulses.len() * self.fixes.len()
        };
        let all =
            || (0..pulses.len()).flat_map(|n| self.fixes.iter().map(move |&k| self.fix(n, k)));
        let again = || lone.then(|| all().last()).flatten();
        let about = self.array(staged, &self.track_times, &[count], |times| {
            for (time_s, _) in all() {
                times.put(&[time_s])?;
            }
            again().map_or(Ok(()), |(time_s, _)| times.put(&[time_s + 1.0]))
        })?;
        written.push((&self.track_times, about));
        for (name, antenna) in [Some(&self.transmitter), self.receiver.as_ref()]
            .into_iter()
            .zip(0..)
        {
            let Some(name) = name else { continue };
            let about = self.array(staged, name, &[count, 3], |positions| {
                let mut fixes = all().chain(again());
                fixes.try_for_each(|(_, at)| positions.put(&at[antenna].to_array()))
            })?;
            written.push((name, about));
        }
        Ok(written)
    }

    /// Time of sample `k` of pulse `n`, and the positions of transmitter and receiver.
    fn fix(&self, n: usize, k: usize) -> (f64, [DVec3; 2]) {
        let collection = self.echoes.collection();
        let (pulse, waveform) = (&collection.pulses[n], &collection.waveform);
        let middle = waveform.num_samples() / 2;
        if k == middle {
            return (pulse.time_s, [pulse.transmitter_m, pulse.receiver_m]);
        }
        let after_s = waveform.sample_s(k);
        let time_s = pulse.time_s + (after_s - waveform.middle_s());
        (time_s, self.echoes.antennas_m(n, after_s))
    }

    /// Write an array of float64.
    fn array(
        &self,
        staged: &Staged,
        name: &str,
        shape: &[usize],
        write: impl FnOnce(&mut ArrayWriter<&mut StagedFile, f64>) -> io::Result<()>,
    ) -> Result<Value, WriteError> {
        let about = staged.write(name, |file| {
            let mut array = ArrayWriter::new(file, shape)?;
            write(&mut array)?;
            array.finish()
        })?;
        Ok(about)
    }

    fn write_echoes(
        &self,
        staged: &Staged,
        monitor: &dyn Monitor,
        mut written: impl FnMut(u64),
    ) -> Result<Value, WriteError> {
        let collection = self.echoes.collection();
        let (count, width) = (collection.pulses.len(), collection.waveform.num_samples());
        let failed = |source| staged.failed(&self.samples, source);
        let mut file = staged.create(&self.samples)?;
        let mut array = ArrayWriter::new(&mut file, &[count, width]).map_err(failed)?;
        let at_once = (BLOCK_BYTES / (8 * width)).clamp(1, count);
        let mut block = vec![Complex32::ZERO; at_once * width];
        for first in (0..count).step_by(at_once) {
            if monitor.cancelled() {
                return Err(WriteError::Cancelled);
            }
            let pulses = first..count.min(first + at_once);
            let block = &mut block[..pulses.len() * width];
            self.echoes.read(pulses, block)?;
            array.put(block).map_err(failed)?;
            written(8 * block.len() as u64);
        }
        array.finish().map_err(failed)?;
        Ok(staged.finish(&self.samples, file)?)
    }
}

/// Whether the radar moves during a sweep.
fn moves(echoes: &dyn Echoes) -> bool {
    // A pulse is short: its filter uses one path for the whole pulse.
    let waveform = &echoes.collection().waveform;
    let swept = matches!(waveform, Waveform::Fmcw { .. } | Waveform::Stepped { .. });
    swept && echoes.moves()
}
