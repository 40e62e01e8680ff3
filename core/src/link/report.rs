//! Messages from the module to the host. The tables in [`crate::link`] define their encoding.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::{ChipGrid, Encoding, Event, LinkCounters, MAX_ANTENNAS, Message, PixelEncoding};
use crate::dpca::DpcaError;
use crate::motion::{self, Step};
use crate::stream::{Capacity, MapHeader, PulseCounters, SetupError};
use crate::sweep;

/// Maximum length in bytes of the version of [`Report::Identity`].
pub const MAX_TEXT_BYTES: usize = 160;

/// Maximum length in bytes of the list of a [`Report::Accumulated`]: short, since short frames are less likely to be
/// damaged.
pub const MAX_ACCUMULATED_BYTES: usize = 64;

/// Report from the module to the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Report<'a> {
    /// Opens the conversation: sent after a reset of the module and in answer to [`super::Command::Hello`].
    Identity {
        /// Protocol version, [`super::PROTOCOL_VERSION`].
        protocol: u8,
        /// Arithmetic of the module's maps.
        arithmetic: Arithmetic,
        /// Maximum sizes that the module's buffers hold.
        capacity: Capacity,
        /// Maximum sizes of an accumulated image.
        image: ImageCapacity,
        /// Name and version of the module's program, at most [`MAX_TEXT_BYTES`].
        version: &'a str,
    },
    /// State and counters of the module.
    Status(Status),
    /// Start of a map.
    MapStart {
        /// Number of the map in the run, from 0.
        map: u32,
        /// Sub-CPI, patch and geometry of the map.
        header: MapHeader,
        /// Encoding of the samples.
        encoding: Encoding,
    },
    /// Next row (Doppler bin) of the map.
    MapRow {
        /// Number of the map.
        map: u32,
        /// Row index from 0, the lowest Doppler bin.
        row: u16,
        /// Range bins of the row, followed by the exponents in [`Encoding::Sc16`] ([`super::Row`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// End of a map.
    MapEnd {
        /// Number of the map.
        map: u32,
        /// Number of rows sent.
        rows: u16,
        /// [`super::TransferChecksum`] of header and rows.
        crc: u32,
    },
    /// Start of an image chip.
    ChipStart {
        /// Number of the transfer in the configuration, from 0.
        chip: u32,
        /// Pixel grid of the chip.
        grid: ChipGrid,
        /// Number of maps accumulated into the chip.
        maps: u32,
        /// Sum of the slow-time weights of the accumulated pulses.
        weight_sum: f32,
        /// Number of contributions left out because the pixel lies outside the map: 0 if the patch contains the chip.
        left_out: u32,
        /// Encoding of the pixels.
        encoding: PixelEncoding,
    },
    /// Next pixels of the chip, row-major.
    ChipPart {
        /// Number of the chip.
        chip: u32,
        /// Part index from 0.
        part: u16,
        /// [`super::CHIP_PART_PIXELS`] pixels, fewer in the last part, followed by the exponents in [`Encoding::Sc16`]
        /// ([`super::Row`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// End of an image chip.
    ChipEnd {
        /// Number of the chip.
        chip: u32,
        /// Number of parts sent.
        parts: u16,
        /// [`super::TransferChecksum`] of grid and parts.
        crc: u32,
    },
    /// Detections on a map, split over several frames.
    Detections {
        /// Number of the map.
        map: u32,
        /// Sub-CPI of the map.
        sub_cpi: u32,
        /// Patch index of the map.
        patch: u16,
        /// Index of the first of these detections in the map's list.
        first: u16,
        /// Number of detections in the map's list.
        total: u16,
        /// Number of channels whose values each detection has.
        channels: u16,
        /// Detections, at most [`super::MAX_LIST_BYTES`], strongest first ([`super::detections`]).
        #[serde(serialize_with = "super::as_bytes")]
        list: &'a [u8],
    },
    /// A command was refused and had no effect.
    Refused {
        /// Sequence number of the command's frame.
        sequence: u32,
        /// Reason of the refusal.
        what: Refusal,
    },
    /// Event for the operator, sent if [`super::Command::Log`] requested its level.
    Event(Event),
    /// Radar motion estimated from a pulse.
    Increment(Increment),
    /// Start of a range profile.
    ProfileStart {
        /// Number of the profile in the run, from 0.
        profile: u32,
        /// Sweep, carriers and sample count of the profile.
        header: ProfileHeader,
    },
    /// Next bins of the current range profile, in order.
    ProfileRow {
        /// Number of the profile.
        profile: u32,
        /// Row index from 0.
        row: u16,
        /// [`ProfileHeader::row_bins`] values of 8 bytes ([`super::complex32s`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// End of a range profile.
    ProfileEnd {
        /// Number of the profile.
        profile: u32,
        /// Number of rows sent.
        rows: u16,
        /// [`super::TransferChecksum`] of header and rows.
        crc: u32,
    },
    /// Sub-CPIs accumulated into the chips since the configuration.
    Accumulated {
        /// Sub-CPI of the lowest bit of the first byte.
        first: u32,
        /// One bit per sub-CPI, lowest bit first, at most [`super::MAX_ACCUMULATED_BYTES`]. Fewer at the end of the list.
        #[serde(serialize_with = "super::as_bytes")]
        bits: &'a [u8],
    },
}

/// Maximum sizes of an image that the module accumulates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ImageCapacity {
    /// Pixels of all chips together; 0 if the module accumulates no images.
    pub pixels: u32,
    /// Sub-CPIs.
    pub sub_cpis: u32,
}

/// Description of a range profile: a [`sweep::SweepProfile`] without its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ProfileHeader {
    /// Number of the sweep.
    pub sweep: u32,
    /// Number of carriers used.
    pub usable: u16,
    /// Number of samples received per channel.
    pub taken: u32,
    /// Number of range bins; 0 if too few carriers are usable.
    pub bins: u16,
    /// Number of range bins per row, equal for all rows.
    pub row_bins: u16,
}

impl ProfileHeader {
    /// Number of rows.
    pub fn num_rows(&self) -> u16 {
        self.bins.checked_div(self.row_bins).unwrap_or(0)
    }
}

/// Radar motion estimated from a pulse: wire format of a [`Step`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Increment {
    /// Pulse number.
    pub pulse: u32,
    /// Number of the earlier pulse that the motion is relative to. Equal to `pulse` for the first pulse of a run.
    pub since: u32,
    /// Number of tracked targets in this pulse.
    pub targets: u16,
    /// Number of echoes in this pulse, tracked or not.
    pub echoes: u16,
    /// Estimated motion. `None` for the first pulse, or if too few targets are common to both pulses.
    pub motion: Option<Motion>,
}

/// Radar motion in the array frame at the earlier pulse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// Displacement along the array and ahead (boresight) in metres.
    pub moved_m: [f64; 2],
    /// Rotation in radians, counterclockwise.
    pub turn_rad: f64,
    /// RMS residual of the target paths in metres.
    pub residual_m: f32,
    /// Number of targets common to both pulses.
    pub targets: u16,
    /// Number of phases near the unwrapping limit, which may be wrong by a cycle.
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

/// Arithmetic of the module's maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Arithmetic {
    /// Complex float32.
    Float,
    /// 16-bit block floating point.
    Fixed,
}

/// State and counters of the module. All values are absolute, so the next status replaces a lost one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Status {
    /// State of the module.
    pub state: State,
    /// Number of the current configuration.
    pub configuration: u32,
    /// Number of the current run.
    pub run: u32,
    /// Number of the next expected pulse.
    pub next_pulse: u32,
    /// Credit: pulses with numbers below this value may be sent.
    pub accept_through: u32,
    /// Number of maps of the run processed so far: sent if the configuration says so, and accumulated.
    pub maps: u32,
    /// Counters of frames that the module received.
    pub link: LinkCounters,
    /// Counters of the run's pulses.
    pub pulses: PulseCounters,
}

/// State of the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// Configuration incomplete.
    #[default]
    Idle,
    /// Configuration complete: setup, all weights and all patches.
    Ready,
    /// Run active, pulses accepted.
    Running,
    /// Input ended; maps still to be sent.
    Finishing,
    /// Run finished and everything sent. A new run can start as in [`State::Ready`].
    Done,
}

/// Reason why a command was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal {
    /// The command requires a complete configuration.
    NotConfigured,
    /// The command is not allowed during a run.
    Running,
    /// The command is only allowed during a run.
    NotRunning,
    /// The setup or a patch is invalid.
    Setup(SetupError),
    /// Weights beyond the last frequency, or a partial weight.
    Weights,
    /// A patch index beyond the list, or a list length that differs from before. For a chip: not the next patch. At a
    /// start: the number of chips differs from the number of patches.
    PatchIndex,
    /// The arithmetic does not accept this sample encoding. Sent for the first refused pulse of a run.
    Encoding,
    /// The number of samples differs from the setup. Sent for the first refused pulse of a run.
    PulseLength {
        /// Expected number of sample bytes.
        expected: u32,
        /// Received number of sample bytes.
        got: u32,
    },
    /// The chip has no pixels, or all chips together have more than the module can hold.
    Chip {
        /// Requested number of pixels.
        wanted: u32,
        /// Maximum number of pixels.
        most: u32,
    },
    /// The CFAR settings are invalid.
    Detect,
    /// The module was built without this function.
    Unsupported,
    /// The setup or the antennas of a motion configuration are invalid.
    Motion(motion::SetupError),
    /// More antennas than a message holds, a partial position, or fewer positions than transmitters.
    Antennas,
    /// The setup or the weights of a range-profile configuration are invalid.
    Sweep(sweep::SetupError),
    /// A chip needs a known number of pulses with at most this many sub-CPIs.
    SubCpis {
        /// Requested number of sub-CPIs; 0 if unknown.
        wanted: u32,
        /// Maximum number of sub-CPIs.
        most: u32,
    },
    /// More channels than the requested product is formed of.
    Channels {
        /// Requested number of channels.
        wanted: u16,
        /// Maximum number of channels: 1 for maps and images.
        most: u16,
    },
    /// The settings of the clutter cancellation are invalid.
    Dpca(DpcaError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotConfigured => f.write_str(
                "not configured: send the setup, all weights and all patches before the start",
            ),
            Self::Running => f.write_str("a run is active: stop or abort it first"),
            Self::NotRunning => f.write_str("no run is active: start one first"),
            Self::Setup(error) => write!(f, "invalid setup: {error}"),
            Self::Weights => f.write_str(
                "invalid window weights: expected 4 bytes each and none beyond the last frequency",
            ),
            Self::PatchIndex => f.write_str(
                "patch or chip index is not below the count, or the count has changed",
            ),
            Self::Encoding => {
                f.write_str("sample encoding does not match the module's arithmetic: use the other encoding")
            }
            Self::PulseLength { expected, got } => {
                write!(
                    f,
                    "pulse samples: expected {expected} bytes, found {got}"
                )
            }
            Self::Chip { wanted, most } => {
                write!(
                    f,
                    "chip pixels: expected 1 to {most} in all chips, found {wanted}"
                )
            }
            Self::Detect => f.write_str(
                "invalid CFAR settings: expected training cells and a false-alarm probability between 0 and 1",
            ),
            Self::Unsupported => f.write_str("the module was built without this function"),
            Self::Sweep(error) => write!(f, "invalid range-profile configuration: {error}"),
            Self::SubCpis { wanted, most } => write!(
                f,
                "sub-CPIs of an accumulated image: expected 1 to {most}, found {wanted}"
            ),
            Self::Channels { wanted, most } => write!(
                f,
                "channels: expected at most {most}, found {wanted}: maps and images are of one channel"
            ),
            Self::Dpca(error) => error.fmt(f),
            Self::Motion(error) => write!(f, "invalid motion configuration: {error}"),
            Self::Antennas => write!(
                f,
                "antennas: expected 3 to {MAX_ANTENNAS} positions of 16 bytes, transmitters first, with at least one receiver"
            ),
        }
    }
}

impl core::error::Error for Refusal {}
