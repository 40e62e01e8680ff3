//! Messages from the module to the host. Layout and meaning: the tables at the head of [`crate::link`].

use core::fmt;

use serde::{Deserialize, Serialize};

use super::{ChipGrid, Encoding, LinkCounters, MAX_ANTENNAS, Message};
use crate::motion::{self, Step};
use crate::stream::{Capacity, MapHeader, PulseCounters, SetupError};
use crate::sweep;

/// Most bytes of the text of [`Report::Log`] and of the version of [`Report::Identity`].
pub const MAX_TEXT_BYTES: usize = 160;

/// What the module sends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Report<'a> {
    /// Opens the conversation: sent after a start of the module, and in answer to
    /// [`super::Command::Hello`].
    Identity {
        /// [`super::PROTOCOL_VERSION`].
        protocol: u8,
        /// The arithmetic of its maps.
        arithmetic: Arithmetic,
        /// The sizes its buffers were built for.
        capacity: Capacity,
        /// Name and version of its program, at most [`MAX_TEXT_BYTES`].
        version: &'a str,
    },
    /// Where it stands.
    Status(Status),
    /// A map begins.
    MapStart {
        /// Its number in the run, from 0.
        map: u32,
        /// What it is of.
        header: MapHeader,
        /// How its samples are encoded.
        encoding: Encoding,
    },
    /// The next Doppler bin's row of the map.
    MapRow {
        /// The map's number.
        map: u32,
        /// The row, from 0, the lowest Doppler bin.
        row: u16,
        /// The row's range bins; with [`Encoding::Sc16`] followed by the exponents ([`super::Row`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// The map is complete.
    MapEnd {
        /// The map's number.
        map: u32,
        /// Rows that were sent.
        rows: u16,
        /// [`super::TransferChecksum`] of header and rows.
        crc: u32,
    },
    /// A chip begins.
    ChipStart {
        /// Its number in the run, from 0.
        chip: u32,
        /// Its pixels.
        grid: ChipGrid,
        /// Maps that were added up to it.
        maps: u32,
        /// Sum of the weights of their pulses.
        weight_sum: f32,
    },
    /// The next row of the chip.
    ChipRow {
        /// The chip's number.
        chip: u32,
        /// The row, from 0.
        row: u16,
        /// Its pixels, [`Encoding::Complex32`].
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// The chip is complete.
    ChipEnd {
        /// The chip's number.
        chip: u32,
        /// Rows that were sent.
        rows: u16,
        /// [`super::TransferChecksum`] of grid and rows.
        crc: u32,
    },
    /// Detections on a map, a few a frame.
    Detections {
        /// The map's number.
        map: u32,
        /// Its sub-CPI.
        sub_cpi: u32,
        /// Its patch.
        patch: u16,
        /// Place of the first of these in the map's list.
        first: u16,
        /// Detections in the map's list.
        total: u16,
        /// At most [`super::MAX_DETECTIONS`], strongest first ([`super::detections`]).
        #[serde(serialize_with = "super::as_bytes")]
        list: &'a [u8],
    },
    /// A command was not obeyed; nothing has changed.
    Refused {
        /// Sequence number of its frame.
        sequence: u32,
        /// Why.
        what: Refusal,
    },
    /// A line for whoever looks after the module.
    Log {
        /// At most [`MAX_TEXT_BYTES`].
        text: &'a str,
    },
    /// What a pulse told of the radar's own motion.
    Increment(Increment),
    /// A range profile begins.
    ProfileStart {
        /// Number of the profile in the run, from 0.
        profile: u32,
        /// What it is of.
        header: ProfileHeader,
    },
    /// Bins of the profile that began last, in order.
    ProfileRow {
        /// Number of the profile.
        profile: u32,
        /// Number of the row, from 0.
        row: u16,
        /// [`ProfileHeader::row_bins`] values of 8 bytes ([`super::complex32s`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// The profile is complete.
    ProfileEnd {
        /// Number of the profile.
        profile: u32,
        /// Rows sent.
        rows: u16,
        /// [`super::TransferChecksum`] of the header and the rows.
        crc: u32,
    },
}

/// What a range profile is of: a [`sweep::SweepProfile`] without its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProfileHeader {
    /// Number of the sweep.
    pub sweep: u32,
    /// Carriers that it is made of.
    pub usable: u16,
    /// Samples of each channel that came.
    pub taken: u32,
    /// Bins; none where too few carriers are usable.
    pub bins: u16,
    /// Bins of a row, of which all rows have as many.
    pub row_bins: u16,
}

impl ProfileHeader {
    /// Rows.
    pub fn num_rows(&self) -> u16 {
        self.bins.checked_div(self.row_bins).unwrap_or(0)
    }
}

/// What a pulse told of the radar's own motion: a [`Step`] as it is sent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Increment {
    /// Number of the pulse.
    pub pulse: u32,
    /// That of the pulse from which the motion is told; of a run's first its own.
    pub since: u32,
    /// Targets seen in this pulse.
    pub targets: u16,
    /// Echoes in this pulse, of targets or not.
    pub echoes: u16,
    /// The motion; none of the first pulse, and where too few targets were seen in both.
    pub motion: Option<Motion>,
}

/// How the radar moved, in the array's frame at the former pulse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// Along the array and ahead, metres.
    pub moved_m: [f64; 2],
    /// Counterclockwise, radians.
    pub turn_rad: f64,
    /// What the targets' paths differ by from it, metres RMS.
    pub residual_m: f32,
    /// Targets seen in both pulses.
    pub targets: u16,
    /// Phases that may have wrapped.
    pub doubtful: u16,
}

impl From<&Step> for Increment {
    fn from(step: &Step) -> Self {
        let most = usize::from(u16::MAX);
        Self {
            pulse: step.pulse,
            since: step.since,
            targets: step.targets,
            echoes: step.echoes,
            motion: step.moved.map(|moved| Motion {
                moved_m: moved.increment.moved_m,
                turn_rad: moved.increment.turn_rad,
                residual_m: moved.residual_m as f32,
                targets: moved.targets.min(most) as u16,
                doubtful: moved.doubtful.min(most) as u16,
            }),
        }
    }
}

impl Message for Report<'_> {
    fn opens(&self) -> bool {
        matches!(self, Self::Identity { .. })
    }
}

/// The arithmetic of a module's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Arithmetic {
    /// Float32.
    Float,
    /// 16-bit integers in blocks of a common exponent.
    Fixed,
}

/// Where the module stands. All numbers are absolute, so that a lost status is made good by the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// What it is doing.
    pub state: State,
    /// Number of the configuration.
    pub configuration: u32,
    /// Number of the run.
    pub run: u32,
    /// Number of the pulse expected next.
    pub next_pulse: u32,
    /// Credit: pulses of numbers below this may be sent.
    pub accept_through: u32,
    /// Maps of the run sent or given up so far: numbers below this.
    pub maps: u32,
    /// What the module has received.
    pub link: LinkCounters,
    /// What became of the run's pulses.
    pub pulses: PulseCounters,
}

/// What the module is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Not fully configured.
    #[default]
    Idle,
    /// Setup, all weights and all patches are there.
    Ready,
    /// Takes pulses.
    Running,
    /// Takes no more pulses; maps are still to come.
    Finishing,
    /// The run is over; everything has been sent. As ready as [`State::Ready`].
    Done,
}

/// Why a command was not obeyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// It needs a complete configuration.
    NotConfigured,
    /// It is not possible during a run.
    Running,
    /// It is possible only during a run.
    NotRunning,
    /// The setup or a patch cannot be.
    Setup(SetupError),
    /// Weights beyond the frequencies, or not a whole number of them.
    Weights,
    /// A patch beyond its list, or of a list of another length than before; at a start, the patch of a
    /// chip beyond the list.
    PatchIndex,
    /// The arithmetic takes no samples of this encoding. Sent for the first pulse of a run that is refused.
    Encoding,
    /// A pulse is not of the setup's length. Sent for the first pulse of a run that is refused.
    PulseLength {
        /// Bytes of samples needed.
        expected: u32,
        /// Bytes that came.
        got: u32,
    },
    /// A chip of more pixels, or of more a row, than there is room for, or of none.
    Chip {
        /// Pixels wanted.
        wanted: u32,
        /// The most there is room for.
        most: u32,
    },
    /// Detection settings out of range.
    Detect,
    /// The module was built without this.
    Unsupported,
    /// The setup or the antennas of increments cannot be.
    Motion(motion::SetupError),
    /// More antennas than a message holds, no whole number of them, or fewer than are transmitters.
    Antennas,
    /// The setup or the weights of range profiles cannot be.
    Sweep(sweep::SetupError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConfigured => f.write_str(
                "not configured: send the setup, all weights and all patches before the start",
            ),
            Self::Running => f.write_str("a run is going on: stop or abort it first"),
            Self::NotRunning => f.write_str("no run is going on: start one first"),
            Self::Setup(error) => write!(f, "the setup cannot be: {error}"),
            Self::Weights => f.write_str(
                "window weights lie beyond the last frequency, or are not of 4 bytes each",
            ),
            Self::PatchIndex => f.write_str(
                "a patch's or chip's index is not below the count, or the count has changed",
            ),
            Self::Encoding => {
                f.write_str("the module's arithmetic takes samples of the other encoding")
            }
            Self::PulseLength { expected, got } => {
                write!(
                    f,
                    "a pulse of {got} bytes of samples: {expected} are needed"
                )
            }
            Self::Chip { wanted, most } => {
                write!(
                    f,
                    "a chip of {wanted} pixels, in all or a row: there is room for 1 to {most}"
                )
            }
            Self::Detect => f.write_str(
                "detection needs training cells and a false alarm rate above 0 and below 1",
            ),
            Self::Unsupported => f.write_str("the module was built without this"),
            Self::Sweep(error) => write!(f, "range profiles cannot be had so: {error}"),
            Self::Motion(error) => write!(f, "increments cannot be had so: {error}"),
            Self::Antennas => write!(
                f,
                "antennas are 3 to {MAX_ANTENNAS} places of 16 bytes each, transmitters first, and receivers among them"
            ),
        }
    }
}

impl core::error::Error for Refusal {}
