//! Phase history: the input of every image former and the output of every reader.
//!
//! A [`PhaseHistory`] is a [`Collection`] (geometry and frequencies of every pulse, held in memory,
//! 264 bytes a pulse) and a method that reads the samples of any block of pulses. Samples are read on demand, so a
//! file may be larger than memory.
//!
//! Sample `k` of pulse `n` for a unit scatterer at `p` is `exp(-j 2 pi f (path_n(p) - reference_path_n) / c)` at
//! `f = start_hz + k step_hz` (Schone 2020 (2.11), relative to the pulse's reference point). For samples taken one
//! after another, both paths are those at the time of the sample: [`Sweep`].

mod beam;
mod block_illumination;
mod channels;
mod coherent_sum;
pub mod convention;
mod defect;
mod in_memory;
mod joined;
mod misplaced;
mod on_track;
mod order;
pub mod physical;
mod pulse;
mod pulse_defects;
mod pulse_gaps;
mod pulse_range;
mod shared;
mod sweep;
mod track_error;
mod troposphere_corrected;
mod weights;

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use num_complex::Complex32;

use crate::SPEED_OF_LIGHT_M_S;
use crate::antenna::MountedAntennas;
use crate::geometry::{Extent, SceneFrame};
use crate::quantity::bytes;
use crate::track::Displacement;

pub use beam::{Aim, Beam, BeamSource, NoBeam, headings};
pub use block_illumination::BlockIllumination;
pub use channels::{Channel, ChannelError, ChannelHistory, Channels, which_channel};
pub use coherent_sum::CoherentSum;
pub use convention::{Basis, Inference, PhaseConvention, PhaseReference, PhaseSign};
pub use defect::{Defect, DefectKind, Examined};
pub use in_memory::InMemory;
pub use joined::Joined;
pub use misplaced::{Excluding, misplaced, named as named_pulses};
pub use on_track::OnTrack;
use order::{is_one_pass, ranks_by_angle};
pub use pulse_defects::{LEAST_PULSES, examined_pulses, pulse_defects};
pub use pulse_range::PulseRange;
pub use sweep::{PathTerms, Sweep};
pub use track_error::TrackError;
pub use troposphere_corrected::TroposphereCorrected;
pub use weights::Weights;

pub use pulse::Pulse;

/// Geometry, frequencies and frame of a collection, without its samples.
#[derive(Clone, Debug)]
pub struct Collection {
    /// A name for titles and reports.
    pub name: String,
    /// Frequency samples in every pulse.
    pub num_samples: usize,
    /// Geometry of every pulse, in the order of the samples.
    pub pulses: Vec<Pulse>,
    /// Position and orientation of the scene frame.
    pub frame: SceneFrame,
    /// Intended image area, if the recording states one.
    pub extent: Option<Extent>,
    /// Whether the recording contains pulse times. Without them, pulse times are the pulse numbers in seconds. Pulses of several
    /// recordings are ordered by time, or by angle without times ([`Joined`]). Pulses of several channels are ordered
    /// channel by channel ([`CoherentSum`]).
    pub timed: bool,
}

/// Frequency axis shared by every pulse of a collection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Step from sample to sample, hertz.
    pub step_hz: f64,
    /// Number of frequency samples in a pulse.
    pub count: usize,
}

impl Band {
    /// Frequency of sample `k`, hertz.
    #[inline]
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }

    /// Reference frequency of all phase and Keystone terms: that of sample `count / 2`, hertz.
    #[inline]
    pub fn centre_hz(&self) -> f64 {
        self.frequency_hz(self.count / 2)
    }

    /// Ratio of every frequency to the centre frequency: the slow-time scale factors of the Keystone transform.
    pub fn scales(&self) -> Vec<f64> {
        let ratio = |k| self.frequency_hz(k) / self.centre_hz();
        (0..self.count).map(ratio).collect()
    }

    /// Bandwidth `count * step_hz`, hertz. Range resolution is `c / (2 bandwidth)`.
    pub fn bandwidth_hz(&self) -> f64 {
        self.count as f64 * self.step_hz
    }

    /// Two-way path over which range profiles repeat, `c / step_hz`, metres.
    pub fn unambiguous_path_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / self.step_hz
    }
}

impl Collection {
    /// Whether any pulse has intra-pulse motion.
    #[inline]
    pub fn sweeps(&self) -> bool {
        self.pulses.iter().any(|pulse| !pulse.sweep.is_at_once())
    }

    /// Number of pulses per channel: all pulses, except for channels one after another ([`CoherentSum`]), where times
    /// decrease after this number of pulses.
    pub fn num_turns(&self) -> usize {
        let count = self.pulses.len();
        let falls_back = |n: &usize| self.pulses[*n].time_s < self.pulses[*n - 1].time_s;
        let Some(turns) = (1..count).find(falls_back) else {
            return count;
        };
        let falls = (1..count).filter(falls_back);
        let even = count.is_multiple_of(turns) && falls.eq((turns..count).step_by(turns));
        if even { turns } else { count }
    }

    /// The frequency axis if all pulses share it (to 1e-9 of the start frequency), else `None`.
    pub fn band(&self) -> Option<Band> {
        let first = self.pulses.first()?;
        let band = Band {
            start_hz: first.start_hz,
            step_hz: first.step_hz,
            count: self.num_samples,
        };
        let tolerance_hz = first.start_hz.abs() * 1e-9;
        let last = self.num_samples.saturating_sub(1);
        let same = |p: &Pulse| {
            (p.start_hz - band.start_hz).abs() <= tolerance_hz
                && (p.frequency_hz(last) - band.frequency_hz(last)).abs() <= tolerance_hz
        };
        self.pulses.iter().all(same).then_some(band)
    }
}

/// Input file of a collection, recorded in an image's metadata.
#[derive(Clone, Debug, serde::Serialize)]
pub struct InputFile {
    /// Path as given by the user. JSON replaces bytes that are not valid UTF-8.
    #[serde(serialize_with = "lossily")]
    pub path: PathBuf,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Identity of the content. Its name is a key of the JSON object.
    #[serde(flatten)]
    pub identity: FileIdentity,
}

/// Identity of a file's content.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FileIdentity {
    /// CRC-32 (IEEE) of the whole file, in hexadecimal.
    Crc32(String),
    /// Version of a file at a URL, as its server states it: the file is not read whole.
    Version(String),
}

impl FileIdentity {
    /// Text of the checksum or of the version.
    pub fn text(&self) -> &str {
        match self {
            Self::Crc32(text) | Self::Version(text) => text,
        }
    }
}

impl InputFile {
    /// A file of `bytes` bytes with its CRC-32 in hexadecimal.
    pub fn with_crc32(path: &Path, bytes: u64, crc32: String) -> Self {
        Self {
            path: path.to_owned(),
            bytes,
            identity: FileIdentity::Crc32(crc32),
        }
    }
}

/// Write a path as text. Bytes that are not valid UTF-8 are replaced, so that the image can still be written.
fn lossily<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Error of reading pulses.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// Input error of the operating system.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path of the file that failed.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file violates its format.
    #[error("{path}: {what}")]
    Malformed {
        /// Path of the file that failed.
        path: PathBuf,
        /// Description of the fault, its place and the remedy.
        what: String,
    },
    /// A sample is NaN or infinite.
    #[error(
        "{name}: sample {sample} of pulse {pulse} is not a finite number; repair or drop that pulse"
    )]
    NotFinite {
        /// Name of the collection or file.
        name: String,
        /// Pulse index, from 0.
        pulse: usize,
        /// Sample index, from 0.
        sample: usize,
    },
    /// The data to be held exceed the memory limit.
    #[error(
        "{} needs {} of memory, but {} are left",
        path.display(), bytes((*needed_bytes).into()), bytes((*allowed_bytes).into())
    )]
    Memory {
        /// Path of the file that failed.
        path: PathBuf,
        /// Memory needed, bytes.
        needed_bytes: u64,
        /// Memory still available under the limit, bytes.
        allowed_bytes: u64,
    },
    /// A file was written to while it was read.
    #[error("{} was changed while it was read ({how}): start again when it is complete", path.display())]
    Changed {
        /// Path of the file that failed.
        path: PathBuf,
        /// Evidence of the change.
        how: String,
    },
    /// A recording's description is invalid or contradicts its files.
    #[error(transparent)]
    Description(Box<dyn std::error::Error + Send + Sync>),
    /// Channels are absent or cannot be combined.
    #[error(transparent)]
    Channels(Box<ChannelError>),
    /// Inputs that cannot form one aperture.
    #[error("{0}")]
    Mismatch(String),
}

impl ReadError {
    /// Make [`Self::Io`] of errors of the operating system about a file.
    pub fn io(path: &Path) -> impl Fn(std::io::Error) -> Self {
        |source| Self::Io {
            path: path.to_owned(),
            source,
        }
    }

    /// [`Self::Malformed`] about a file.
    pub fn malformed(path: &Path, what: impl Into<String>) -> Self {
        Self::Malformed {
            path: path.to_owned(),
            what: what.into(),
        }
    }
}

impl From<ChannelError> for ReadError {
    fn from(error: ChannelError) -> Self {
        Self::Channels(Box::new(error))
    }
}

/// Collection with random access to the samples of its pulses.
pub trait PhaseHistory: Sync + Send {
    /// Geometry and frequencies of every pulse.
    fn collection(&self) -> &Collection;

    /// Read pulses `pulses` into `samples`: pulse `n`, sample `k` at
    /// `[(n - pulses.start) * num_samples + k]`, in the sign convention of this module, every value
    /// finite.
    ///
    /// # Panics
    /// Panics if `samples.len() != pulses.len() * num_samples` or `pulses.end` is beyond the last pulse.
    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError>;

    /// History whose pulses this one presents with changes, if there is one. What describes the recording (start, channels, phase
    /// conventions, warnings, defects, input files) is then that history's unless overridden. Samples, true positions, beam and antennas are not passed on:
    /// a change of pulses changes them.
    fn inner(&self) -> Option<&dyn PhaseHistory> {
        None
    }

    /// Samples of `pulses` without a copy; `None` if they are not held in memory.
    ///
    /// # Panics
    /// Panics if `pulses.end` is beyond the last pulse.
    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        let _ = pulses;
        None
    }

    /// True positions of transmitter and receiver in every pulse, metres in the scene frame. Only simulations have them;
    /// [`Pulse`] holds the measured positions.
    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        None
    }

    /// UTC of time zero, nanoseconds since 1970-01-01, if the recording states it.
    fn start_ns(&self) -> Option<i64> {
        self.inner()?.start_ns()
    }

    /// Channels to which the pulses belong; empty if the recording does not name them.
    fn channels(&self) -> Vec<Channel> {
        self.inner().map_or_else(Vec::new, |inner| inner.channels())
    }

    /// File from which the pulses are read, if there is a single one.
    fn path(&self) -> Option<&Path> {
        None
    }

    /// Distinct phase conventions of the files from which the samples were read; empty without files.
    fn phase_conventions(&self) -> Vec<PhaseConvention> {
        self.inner()
            .map_or_else(Vec::new, |inner| inner.phase_conventions())
    }

    /// Antenna beam, if the recording describes one. `None` without antenna patterns.
    ///
    /// # Errors
    /// [`NoBeam`] if the described patterns give no such beam.
    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        Ok(None)
    }

    /// Antennas with their attitudes at each pulse, if the recording describes patterns for all pulses.
    fn antennas(&self) -> Option<MountedAntennas> {
        None
    }

    /// Displacement of the target in whose frame the geometry is given; `None` for a frame at rest.
    fn target(&self) -> Option<&Displacement> {
        self.inner()?.target()
    }

    /// [`Self::stated_beam`]; `None` also where the patterns give no beam.
    fn beam(&self) -> Option<Beam> {
        self.stated_beam().unwrap_or(None)
    }

    /// Warnings about the quality of an image formed from this history, one sentence each.
    fn warnings(&self) -> Vec<String> {
        self.inner().map_or_else(Vec::new, |inner| inner.warnings())
    }

    /// Defects of the recorded pulses and samples, as measured. [`Self::warnings`] contains each as a sentence.
    fn defects(&self) -> Vec<Defect> {
        self.inner().map_or_else(Vec::new, |inner| inner.defects())
    }

    /// Memory held during the lifetime of this history, bytes: at least the geometry of all pulses.
    fn held_bytes(&self) -> u64 {
        let inner = self.inner().map_or(0, |inner| inner.held_bytes());
        inner + size_of_val(self.collection().pulses.as_slice()) as u64
    }

    /// Input files with checksums. Every file is read completely.
    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.inner().map_or(Ok(Vec::new()), |inner| inner.inputs())
    }
}

/// Fail with [`ReadError::NotFinite`] if a sample is NaN or infinite. `first_pulse` is the index
/// of the pulse that `samples` starts with.
pub fn check_finite(
    name: &str,
    first_pulse: usize,
    num_samples: usize,
    samples: &[Complex32],
) -> Result<(), ReadError> {
    match samples
        .iter()
        .position(|z| !(z.re.is_finite() && z.im.is_finite()))
    {
        None => Ok(()),
        Some(i) => Err(ReadError::NotFinite {
            name: name.to_owned(),
            pulse: first_pulse + i / num_samples,
            sample: i % num_samples,
        }),
    }
}
