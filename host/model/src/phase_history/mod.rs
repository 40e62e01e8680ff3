//! Phase history: what every image former consumes and every reader delivers.
//!
//! A [`PhaseHistory`] is a [`Collection`] (geometry and frequencies of every pulse, held in memory,
//! 240 bytes a pulse) and a way to read any run of pulses. Samples are read on demand, so a
//! file larger than memory is no obstacle.
//!
//! Sample `k` of pulse `n` for a unit scatterer at `p` is
//! `exp(-j 2 pi f (path_n(p) - reference_path_n) / c)` at `f = start_hz + k step_hz`
//! (Schone 2020 (2.11), moved to the pulse's reference point). Where samples are taken one after another, both paths
//! are those of the sample's moment: [`Sweep`].

mod channels;
mod coherent_sum;
mod in_memory;
mod joined;
mod on_track;
mod order;
pub mod physical;
mod stretch;
mod sweep;
mod through_air;
mod track_error;
mod weights;

use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use num_complex::Complex32;

use crate::SPEED_OF_LIGHT_M_S;
use crate::geometry::{Extent, SceneFrame};
use crate::quantity::bytes;

pub use channels::{Channel, ChannelError, ChannelHistory, Channels, which_channel};
pub use coherent_sum::CoherentSum;
pub use in_memory::InMemory;
pub use joined::Joined;
pub use on_track::OnTrack;
use order::ranks_by_angle;
pub use stretch::Stretch;
pub use sweep::{PathTerms, Sweep};
pub use through_air::ThroughAir;
pub use track_error::TrackError;
pub use weights::Weights;

/// Geometry and frequency axis of one pulse. Positions in metres in the scene frame, at the moment of sample `K/2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Time of the pulse, seconds from the collection's start.
    pub time_s: f64,
    /// Phase centre of the transmitting antenna.
    pub transmitter_m: DVec3,
    /// Phase centre of the receiving antenna.
    pub receiver_m: DVec3,
    /// Point to which the phase is compensated (CPHD's SRP).
    pub reference_m: DVec3,
    /// Two-way path length to which the phase is compensated. Usually [`Pulse::path_m`] of `reference_m`, computed of
    /// the same stored positions, so that their rounding cancels in [`Self::relative_path_m`]; a path stored beside
    /// them was rounded on its own, from pulse to pulse, which is noise of phase.
    pub reference_path_m: f64,
    /// Frequency of sample 0.
    pub start_hz: f64,
    /// Frequency step from sample to sample; positive.
    pub step_hz: f64,
    /// How the antennas move while the samples are taken.
    pub sweep: Sweep,
}

impl Pulse {
    /// Two-way path from transmitter to `point` to receiver, metres, at the moment of sample `K/2`.
    #[inline]
    pub fn path_m(&self, point: DVec3) -> f64 {
        (point - self.transmitter_m).length() + (point - self.receiver_m).length()
    }

    /// Path to `point` relative to the one the phase is compensated to, metres.
    #[inline]
    pub fn relative_path_m(&self, point: DVec3) -> f64 {
        self.path_m(point) - self.reference_path_m
    }

    /// Frequency of sample `k`, hertz.
    #[inline]
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }
}

/// What a collection holds beside its samples.
#[derive(Clone, Debug)]
pub struct Collection {
    /// A name for titles and reports.
    pub name: String,
    /// Frequency samples in every pulse.
    pub num_samples: usize,
    /// Every pulse, in the order of its samples.
    pub pulses: Vec<Pulse>,
    /// Where the scene frame lies.
    pub frame: SceneFrame,
    /// The part of the scene the collection is meant for, if it says so.
    pub extent: Option<Extent>,
    /// Whether the recording tells times; if not, pulses are numbered as if a second apart. Pulses of several
    /// recordings are in the order of time, or of angle where it tells none ([`Joined`]); of several channels
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
    /// Number of samples.
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

    /// Every frequency over the centre's: what Keystone scales slow time by.
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
    /// Whether antennas move from sample to sample of any pulse.
    #[inline]
    pub fn sweeps(&self) -> bool {
        self.pulses.iter().any(|pulse| !pulse.sweep.is_at_once())
    }

    /// How many pulses go over the collection's moments once: all of them, but where channels follow one another
    /// ([`CoherentSum`]), so that times fall back after every so many pulses, as many as each channel has.
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

/// A file that went into a collection, for the record in an image's metadata.
#[derive(Clone, Debug, serde::Serialize)]
pub struct InputFile {
    /// Path as given by the user; in JSON with what is no UTF-8 replaced.
    #[serde(serialize_with = "lossily")]
    pub path: PathBuf,
    /// Size in bytes.
    pub bytes: u64,
    /// CRC-32 (IEEE) of the whole file, in hexadecimal.
    pub crc32: String,
}

/// A path as text. A name that is no UTF-8 must not cost the image that it was recorded for.
fn lossily<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&path.to_string_lossy())
}

/// Why pulses could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File concerned.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file does not hold what its format promises.
    #[error("{path}: {what}")]
    Malformed {
        /// File concerned.
        path: PathBuf,
        /// What is wrong, where, and what to do about it.
        what: String,
    },
    /// A sample is NaN or infinite.
    #[error(
        "{name}: sample {sample} of pulse {pulse} is not a finite number; repair or drop that pulse"
    )]
    NotFinite {
        /// Collection or file.
        name: String,
        /// Pulse index, from 0.
        pulse: usize,
        /// Sample index, from 0.
        sample: usize,
    },
    /// What has to be held does not fit the memory allowed.
    #[error(
        "{} needs {} of memory and {} are left",
        path.display(), bytes((*needed_bytes).into()), bytes((*allowed_bytes).into())
    )]
    Memory {
        /// File concerned.
        path: PathBuf,
        /// Bytes needed.
        needed_bytes: u64,
        /// Bytes left for it.
        allowed_bytes: u64,
    },
    /// A file was written to while it was read.
    #[error("{} was changed while it was read ({how}): start again when it is whole", path.display())]
    Changed {
        /// File concerned.
        path: PathBuf,
        /// How that shows.
        how: String,
    },
    /// A recording's description does not make sense, or not with its files.
    #[error(transparent)]
    Description(Box<dyn std::error::Error + Send + Sync>),
    /// Channels that are not there, or do not belong together.
    #[error(transparent)]
    Channels(Box<ChannelError>),
    /// Inputs that cannot form one aperture.
    #[error("{0}")]
    Mismatch(String),
}

impl From<ChannelError> for ReadError {
    fn from(error: ChannelError) -> Self {
        Self::Channels(Box::new(error))
    }
}

/// A collection whose samples can be read, any run of pulses at a time.
pub trait PhaseHistory: Sync + Send {
    /// Geometry and frequencies.
    fn collection(&self) -> &Collection;

    /// Reads pulses `pulses` into `samples`: pulse `n`, sample `k` at
    /// `[(n - pulses.start) * num_samples + k]`, in the sign convention of this module, every value
    /// finite.
    ///
    /// # Panics
    /// If `samples.len() != pulses.len() * num_samples` or `pulses.end` is past the last pulse.
    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError>;

    /// The same samples, where they lie in memory anyway.
    ///
    /// # Panics
    /// If `pulses.end` is past the last pulse.
    fn at_hand(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        let _ = pulses;
        None
    }

    /// Where transmitter and receiver truly were in every pulse, metres in the scene frame, if that is
    /// known: simulations know it, and [`Pulse`] holds what was measured.
    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        None
    }

    /// When time zero was, nanoseconds since the beginning of 1970 (UTC), if the recording says.
    fn start_ns(&self) -> Option<i64> {
        None
    }

    /// The channels of the recording that its pulses are of, where it names them.
    fn channels(&self) -> Vec<Channel> {
        Vec::new()
    }

    /// What its user has to know before trusting an image of it, a sentence each.
    fn warnings(&self) -> Vec<String> {
        Vec::new()
    }

    /// Bytes held in memory for as long as this lives: at least the geometry of all pulses.
    fn held_bytes(&self) -> u64 {
        size_of_val(self.collection().pulses.as_slice()) as u64
    }

    /// The files behind this collection; computing their checksums reads them whole.
    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        Ok(Vec::new())
    }
}

/// Fails with [`ReadError::NotFinite`] if a sample is NaN or infinite. `first_pulse` is the index
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
