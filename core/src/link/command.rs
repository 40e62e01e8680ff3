//! Messages from the host to the module. Layout and meaning: the tables at the head of [`crate::link`].

use serde::{Deserialize, Serialize};

use super::Message;
use crate::Pulse;
use crate::cfar::Cfar;
use crate::stream::{Patch, Setup};
use crate::{motion, sweep};

/// What the host sends. Every command but those that carry samples is answered, see [`crate::link`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command<'a> {
    /// Opens the conversation; changes nothing but the sequence count. Answered by
    /// [`super::Report::Identity`].
    Hello,
    /// Begins a configuration: weights, patches and options sent before are forgotten.
    Configure(Configuration),
    /// Weights of the fast-time window.
    Weights {
        /// Frequency of the first.
        first: u16,
        /// Float32, little endian ([`super::f32s`]).
        #[serde(serialize_with = "super::as_bytes")]
        weights: &'a [u8],
    },
    /// One patch of the list.
    Patch {
        /// Its place in the list, from 0.
        index: u16,
        /// Patches of the list; with the last of them it is complete.
        count: u16,
        /// The patch.
        patch: Patch,
    },
    /// Begins a run; maps are numbered from 0.
    Start {
        /// Number of the run, the host's choice; other than the last.
        run: u32,
        /// Number of its first pulse, the first of a sub-CPI.
        first: u32,
    },
    /// A pulse of the run.
    Pulse {
        /// All of it but the samples.
        pulse: Pulse,
        /// How the samples are encoded.
        encoding: Encoding,
        /// One sample a frequency.
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// No more pulses: what is held is mapped too, a partial sub-CPI included.
    Stop,
    /// Asks for a status.
    Status,
    /// Ends the run at once; what is held is dropped.
    Abort,
    /// Option of a configuration: a patch's maps are also added up to a chip, sent after the last map.
    Chip(ChipGrid),
    /// Option of a configuration: detections are sent after each map.
    Detect(Cfar),
    /// Begins a configuration of another kind: increments instead of maps. What was configured before is forgotten.
    Motion(MotionConfiguration),
    /// The antennas of such a configuration, with which it is complete.
    Antennas {
        /// How many of the places are transmitters; the rest are receivers.
        transmitters: u16,
        /// Places in the array's frame, at most [`super::MAX_ANTENNAS`]: x along the array, y where it looks, as float64, little endian ([`super::places`]).
        #[serde(serialize_with = "super::as_bytes")]
        places: &'a [u8],
    },
    /// A pulse of such a run, as one channel sampled it.
    Channel {
        /// Number of the pulse.
        pulse: u32,
        /// Of the channel: transmitter by transmitter, receiver by receiver.
        channel: u16,
        /// Two-way path to which the samples' phase is compensated, metres; 0 if to none.
        reference_path_m: f64,
        /// How the samples are encoded: either way, whatever the module's arithmetic.
        encoding: Encoding,
        /// One sample a frequency.
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// Begins a configuration of a third kind: range profiles of a stepped-carrier radar. What was configured before is forgotten; [`Command::Weights`], one a carrier, make it complete.
    Profiles(SweepConfiguration),
    /// A part of a burst of such a run. What lies between the parts that come is missing.
    Burst {
        /// Number of the sweep.
        sweep: u32,
        /// Index of the carrier.
        carrier: u16,
        /// Number of the first sample in the burst.
        first: u32,
        /// Counts of reference and echo ([`super::pairs`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// All bursts of a sweep have been sent: answered by its profile, as often as it is asked.
    Sweep {
        /// Number of the sweep.
        sweep: u32,
    },
}

impl Message for Command<'_> {
    fn opens(&self) -> bool {
        matches!(self, Self::Hello)
    }
}

/// Name and setup of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// Number, the host's choice; [`super::Status::configuration`] repeats it.
    pub id: u32,
    /// The setup.
    pub setup: Setup,
}

/// Name and setup of a configuration that brings increments.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionConfiguration {
    /// Number, the host's choice; [`super::Status::configuration`] repeats it.
    pub id: u32,
    /// The setup.
    pub setup: motion::Setup,
}

/// Name and setup of a configuration that brings range profiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SweepConfiguration {
    /// Number, the host's choice; [`super::Status::configuration`] repeats it.
    pub id: u32,
    /// The setup.
    pub setup: sweep::Setup,
}

/// How samples lie in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Encoding {
    /// Real and imaginary part as float32, little endian: 8 bytes.
    Complex32,
    /// Real and imaginary part as 16-bit integers in units of `2^-15`, little endian: 4 bytes.
    Sc16,
}

impl Encoding {
    /// Bytes of a sample.
    pub const fn sample_bytes(self) -> usize {
        match self {
            Self::Complex32 => 8,
            Self::Sc16 => 4,
        }
    }
}

/// Pixels of a chip: `origin + column * column_step + row * row_step`, metres. Of the sum of a patch's
/// maps, divided by that of their pulses' weights: a unit scatterer reads 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChipGrid {
    /// Index of the patch.
    pub patch: u16,
    /// Pixel of row 0 and column 0.
    pub origin_m: [f64; 3],
    /// From column to column.
    pub column_step_m: [f64; 3],
    /// From row to row.
    pub row_step_m: [f64; 3],
    /// Pixels a row.
    pub num_columns: u16,
    /// Rows.
    pub num_rows: u16,
}
