//! Raw recordings described in TOML: sample format, waveform, times and antenna track.
//!
//! A description is TOML text like a scenario: quantities have units, every key is checked against the schema, which
//! [`reference()`] prints, and errors state their line. It names the files of the samples, the radar type (`[radar]
//! kind`) and the motion of the antennas (`[platform]`). [`crate::receive`] converts the recording to phase history,
//! as for simulated echoes.
//!
//! ```text
//! text ─> values ─> arrays (files, each read once) ─> pulses (times, track, selection)
//!                         └─> samples (codes, defects, I/Q, sign, background) ──┴─> receive ─> phase history, in memory
//! ```
//!
//! | `[radar] kind` | samples | adapter |
//! |---|---|---|
//! | `fmcw` | beats of linear sweeps | [`Deskewed`](crate::receive::Deskewed) |
//! | `pulsed` | echoes of a known pulse | [`Compressed`](crate::receive::Compressed) |
//! | `stepped` | a complex number per carrier | [`Referenced`](crate::receive::Referenced) |
//! | `profiles` | range profiles, real waveforms or complex | [`Profiles`](crate::receive::Profiles) |
//!
//! An unknown geometry parameter (the length of an arm, a cable delay, a clock offset) is a key like any
//! other: [`RecordingFile::set`] overrides it, and `subaperture-autofocus` estimates it by maximising image sharpness.
//!
//! - `range_bias` is the excess of the recorded ranges: the reference path of the samples is lengthened by
//!   twice that before phases are referred to it, at every frequency.
//! - `radar.first_pulse` is the time of the first pulse on the platform's clock.
//! - Pulses of zeros are left out. Defects of the samples (bias and imbalance of I and Q, clipped values, gaps in the times) are
//!   warnings of the history, and [`PhaseHistory::defects`] has their numbers.
//! - `radar.motion` states whether the radar moves during a sweep, or between transmission and reception of a pulse.
//!
//! A radar with several alternating transmitters and several receivers is one description: every antenna pair in use is a pulse, and the
//! pairs of a pulse follow each other in order of time. Phase offset and level of an antenna are keys of its section.
//!
//! [`write()`] writes echoes, also simulated ones, as such a recording. Memory: the arrays, the samples and the phase history at once,
//! within the allowed bytes.

mod adapt;
mod analytic;
mod arrays;
mod beam;
mod defects;
mod earth;
pub mod examples;
mod files;
mod in_flight;
mod int16;
mod keys;
mod moving;
mod network;
mod open;
mod phase;
mod pulses;
mod samples;
mod table;
mod text;
mod track;
mod waveform;
mod write;

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use arrays::Arrays;
use keys::RecordingDescription;
use subaperture_describe::error::Fault;
use subaperture_describe::{DEFAULT_MEMORY_BYTES, Description, DescriptionError};
use subaperture_model::phase_history::{
    Channel, Channels, Collection, InMemory, InputFile, PhaseHistory, ReadError,
};

use num_complex::Complex32;

pub use open::{open, open_channels};
pub use samples::SignStated;
pub use write::{Raw, WriteError, add_to, describes_antennas, names, write};

/// Faults of a description before they are formatted.
type Faults = Vec<Fault>;

/// Phase history of a recording, and its source.
#[derive(Clone, Debug)]
pub struct Take {
    /// Phase history.
    pub history: InMemory,
    /// Recorded pulse of each pulse, from 0: the pulse's number times the number of channels in use, plus the channel's.
    pub pulses: Vec<usize>,
    /// Channels in use, in the order of their numbers.
    pub channels: Vec<Channel>,
    /// Recorded pulses, from 0, that contain only zeros in some channel and are left out of it.
    pub zeros: BTreeSet<usize>,
    /// Bias of the recorded paths, metres: the recorded path of a point is that of the history's geometry plus this.
    pub bias_path_m: f64,
    /// Sign of the phase as described.
    pub sign: SignStated,
    /// Whether the order of I and Q is stated, or does not apply. An order that is not stated is read as `iiqq`.
    pub order_is_stated: bool,
}

impl Take {
    /// Split the phase history into parallel channels, without [`Self::zeros`]. Temporarily needs a second copy of the samples, less memory
    /// than reading them.
    ///
    /// # Errors
    /// [`ReadError::Channels`] if the channels do not share pulses; [`ReadError::Mismatch`] if a channel has none.
    pub fn side_by_side(self) -> Result<Channels<'static>, ReadError> {
        let collection = self.history.collection();
        let (width, count) = (collection.num_samples, self.channels.len());
        let inputs = self.history.inputs()?;
        let of_channel = |(c, about): (usize, &Channel)| {
            let own: Vec<usize> = (0..self.pulses.len())
                .filter(|&n| {
                    self.pulses[n] % count == c && !self.zeros.contains(&(self.pulses[n] / count))
                })
                .collect();
            if own.is_empty() {
                return Err(ReadError::Mismatch(format!(
                    "{}: every pulse contains only zeros in a channel: choose the others by [recording] receiver or transmitter",
                    collection.name
                )));
            }
            let part = Collection {
                name: match count {
                    1 => collection.name.clone(),
                    _ => format!("{} channel {}", collection.name, about.name),
                },
                pulses: own.iter().map(|&n| collection.pulses[n]).collect(),
                ..*collection
            };
            let mut samples = vec![Complex32::ZERO; own.len() * width];
            for (row, &n) in samples.chunks_exact_mut(width).zip(&own) {
                self.history.read(n..n + 1, row)?;
            }
            let mut history = (InMemory::new(part, samples)?.with_inputs(inputs.clone()))
                .with_channels(vec![about.clone()]);
            if c == 0 {
                history = (history.with_warnings(self.history.warnings()))
                    .with_defects(self.history.defects());
            }
            if count == 1 {
                let antennas = self.history.antennas().map(|mut mounted| {
                    mounted.attitudes = own.iter().map(|&n| mounted.attitudes[n]).collect();
                    mounted
                });
                history = history
                    .with_stated_beam(self.history.stated_beam())
                    .with_antennas(antennas);
            }
            if let [convention, ..] = *self.history.phase_conventions() {
                history = history.with_convention(convention);
            }
            Ok((about.clone(), Box::new(history) as Box<dyn PhaseHistory>))
        };
        let channels = self.channels.iter().enumerate().map(of_channel);
        Ok(Channels::new(channels.collect::<Result<_, ReadError>>()?)?)
    }
}

/// Description of a recording with the settings that override it. Files named by it are read once.
#[derive(Debug)]
pub struct RecordingFile {
    description: Description,
    /// Path of the description, if it is a file.
    path: Option<PathBuf>,
    arrays: Arrays,
}

impl RecordingFile {
    /// Create a description from text. `file` names it in errors; paths in it are relative to `folder`.
    pub fn new(
        file: impl Into<String>,
        text: impl Into<String>,
        folder: impl Into<PathBuf>,
    ) -> Self {
        Self {
            description: Description::new(file, text, folder),
            path: None,
            arrays: Arrays::default(),
        }
    }

    /// Read a description. Parsing may take [`DEFAULT_MEMORY_BYTES`].
    ///
    /// # Errors
    /// As [`Description::read_within`].
    pub fn read(path: &Path) -> io::Result<Self> {
        Self::read_within(path, DEFAULT_MEMORY_BYTES)
    }

    /// Read a description whose text takes at most `memory_bytes` when parsed.
    ///
    /// # Errors
    /// As [`Description::read_within`].
    pub fn read_within(path: &Path, memory_bytes: u64) -> io::Result<Self> {
        Ok(Self {
            description: Description::read_within(path, memory_bytes)?,
            path: Some(path.to_owned()),
            arrays: Arrays::default(),
        })
    }

    /// Override the key at a dotted path, such as `platform.radius`. The value is written as in the text, except that
    /// quotes may be omitted. Later settings override earlier ones.
    ///
    /// # Errors
    /// [`DescriptionError`] if the key does not exist. Values are checked by [`Self::history`].
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), DescriptionError> {
        self.description.set(&keys::SCHEMA, "--set", key, value)
    }

    /// Copy with some keys varied, which shares the files read; errors name them as `--vary KEY=VALUE`.
    ///
    /// # Errors
    /// As [`Self::set`].
    pub fn with<'a>(
        &self,
        settings: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, DescriptionError> {
        let mut varied = Self {
            description: self.description.clone(),
            path: self.path.clone(),
            arrays: self.arrays.clone(),
        };
        for (key, value) in settings {
            varied
                .description
                .set(&keys::SCHEMA, "--vary", key, value)?;
        }
        Ok(varied)
    }

    /// Whether the description states the place of the scene: its extent, or the reference point of the phases. True for an invalid
    /// description, whose faults [`Self::history`] reports.
    pub fn states_scene(&self) -> bool {
        let top = self
            .description
            .resolve_as::<RecordingDescription>(&keys::SCHEMA);
        top.map_or(true, |RecordingDescription { scene, .. }| {
            scene.reference_m.is_some() || (scene.x_m.is_some() && scene.y_m.is_some())
        })
    }

    /// Text of the description as read.
    pub fn text(&self) -> &str {
        self.description.text()
    }

    /// Text of the description with keys at dotted paths set to values; comments, order and spaces are unchanged. Settings are not
    /// included.
    ///
    /// # Errors
    /// A message, if the text has no place for a key.
    pub fn text_with<'a>(
        &self,
        values: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<String, String> {
        self.description.with_values(values)
    }

    /// Phase history of the described recording, within `memory_bytes`.
    ///
    /// # Errors
    /// [`ReadError::Description`] with all faults of text and files, as far as one fault does not hide another.
    pub fn history(&self, memory_bytes: u64) -> Result<InMemory, ReadError> {
        self.take(memory_bytes, None).map(|take| take.history)
    }

    /// Parallel channels, one per pair of transmitter and receiver in use.
    ///
    /// # Errors
    /// As [`Self::history`]; [`ReadError::Channels`] if the pairs do not share pulses, for instance if the antennas of one pair already
    /// moved in a pulse and those of another did not.
    pub fn channels(&self, memory_bytes: u64) -> Result<Channels<'static>, ReadError> {
        self.take(memory_bytes, None)?.side_by_side()
    }

    /// Phase history as by [`Self::history`], with its source. `pulses` overrides the pulses selected by the
    /// description. A track is extrapolated beyond its end.
    ///
    /// # Errors
    /// As [`Self::history`].
    pub fn take(&self, memory_bytes: u64, pulses: Option<&[usize]>) -> Result<Take, ReadError> {
        let built = self.build(memory_bytes, pulses);
        built.map_err(|faults| self.description.explain(faults).into())
    }

    fn build(&self, memory_bytes: u64, given: Option<&[usize]>) -> Result<Take, Faults> {
        let one = |found| vec![found];
        if let (None, Some(at)) = (
            self.description.has_section("recording"),
            self.description.has_section("radar"),
        ) {
            return Err(one(Fault::new(
                &at,
                "the section [recording] is missing. If the text is a scenario, simulate it \
                 (subap simulate SCENARIO.toml -o FILE.cphd) and take the file",
            )));
        }
        let top: RecordingDescription = self.description.resolve_as(&keys::SCHEMA)?;
        let source = arrays::Source {
            arrays: &self.arrays,
            folder: self.description.folder(),
            recording: &top.recording,
            memory_bytes,
        };
        let mut samples = samples::read(&top.radar.kind, &source).map_err(one)?;
        let sign = samples.sign();
        let mut pulses = pulses::select(
            &top,
            &source,
            samples.num_sweeps / top.recording.sweeps_a_pulse(),
            given,
        )
        .map_err(one)?;
        adapt::check_memory(&source, pulses.chosen.len(), samples.num_samples).map_err(one)?;
        let name = adapt::name(&top, &source);
        let about = defects::About {
            name: &name,
            recording: &top.recording,
            kind: &top.radar.kind,
        };
        let found = match given {
            None => about.examine(&mut samples, &mut pulses),
            Some(_) => about.correct(&mut samples, &pulses),
        };
        let found = found.map_err(one)?;
        let history = adapt::adapt(&top, &source, samples, &pulses).map_err(one)?;
        let history = (history.with_warnings(pulses.antennas.warnings().to_vec()))
            .with_warnings(found.report.warnings)
            .with_defects(found.report.defects)
            .with_stated_beam(beam::stated(&pulses.antennas, &pulses.chosen))
            .with_antennas(beam::mounted(&pulses.antennas, &pulses.chosen));
        Ok(Take {
            history,
            pulses: pulses
                .chosen
                .iter()
                .map(|pulse| pulse.index * pulses.antennas.channels.len() + pulse.channel)
                .collect(),
            channels: (pulses.antennas.channels.iter())
                .map(|channel| channel.about())
                .collect(),
            zeros: found.zeros,
            bias_path_m: 2.0 * top.recording.range_bias_m,
            sign,
            order_is_stated: !top.recording.order_is_unstated(),
        })
    }

    /// Files read so far, the description first, with their checksums.
    ///
    /// # Errors
    /// [`ReadError::Io`]; [`ReadError::Changed`] if a file has changed since it was read.
    pub fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        let own = self.path.iter().map(|path| arrays::input(path, None));
        let mut inputs = own.collect::<Result<Vec<_>, _>>()?;
        inputs.extend(self.arrays.inputs()?);
        Ok(inputs)
    }
}

/// Text with unit, default and meaning of every key.
pub fn reference() -> String {
    keys::SCHEMA.reference()
}
