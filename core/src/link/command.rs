//! Messages from the host to the module. The tables in [`crate::link`] define their encoding.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use super::{Level, Message};
use crate::Pulse;
use crate::accumulate::PixelGrid;
use crate::cfar::Cfar;
use crate::dpca::Dpca;
use crate::stream::{Patch, Setup};
use crate::{motion, sweep};

/// Command from the host to the module. Every command except those that carry samples is answered, see
/// [`crate::link`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command<'a> {
    /// Open the conversation. Only resets the sequence count. The module answers with [`super::Report::Identity`].
    Hello,
    /// Begin a map configuration. Discards the previous weights, patches and options.
    Configure(Configuration),
    /// Set weights of the fast-time window.
    Weights {
        /// Index of the frequency of the first weight.
        first: u16,
        /// Weights as float32, little endian ([`super::f32s`]).
        #[serde(serialize_with = "super::as_bytes")]
        weights: &'a [u8],
    },
    /// Set one patch of the patch list.
    Patch {
        /// Index in the list, from 0.
        index: u16,
        /// Number of patches in the list. The list is complete once the last one was received.
        count: u16,
        /// Centre and extent of the patch.
        patch: Patch,
    },
    /// Start a run. Maps are numbered from 0.
    Start {
        /// Run number chosen by the host; must differ from that of the previous run.
        run: u32,
        /// Number of the first pulse, which must be the first pulse of a sub-CPI.
        first: u32,
    },
    /// Send one pulse of the run.
    Pulse {
        /// Pulse metadata.
        pulse: Pulse,
        /// Encoding of the samples.
        encoding: Encoding,
        /// Samples, one per frequency.
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// End the input. Stored pulses are still processed, including a partial sub-CPI.
    Stop,
    /// Request a status report.
    Status,
    /// Abort the run immediately. Stored pulses are discarded.
    Abort,
    /// Configure the image chip of a patch: every map of the patch is accumulated into it, until the next configuration.
    /// Either no patch has a chip or every patch has one; chips are configured in the order of the patches.
    Chip(ChipGrid),
    /// Configure CFAR detection: detections are sent after each map.
    Detect(Cfar),
    /// Begin a motion configuration: increments instead of maps. Discards the previous configuration.
    Motion(MotionConfiguration),
    /// Set the antennas of a motion configuration, which completes it.
    Antennas {
        /// Number of positions that are transmitters. The remaining ones are receivers.
        transmitters: u16,
        /// Positions in the array frame, at most [`super::MAX_ANTENNAS`]: x along the array and y along boresight in metres, as float64, little endian ([`super::places`]).
        #[serde(serialize_with = "super::as_bytes")]
        places: &'a [u8],
    },
    /// Send the samples of one channel of a pulse, in a motion run.
    Channel {
        /// Pulse number.
        pulse: u32,
        /// Channel index: transmitters outermost, receivers innermost.
        channel: u16,
        /// Two-way path in metres that sample phases are referenced to; 0 for raw phases.
        reference_path_m: f64,
        /// Encoding of the samples. Both are accepted by either arithmetic.
        encoding: Encoding,
        /// Samples, one per frequency.
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// Begin a range-profile configuration for a stepped-frequency radar. Discards the previous configuration. [`Command::Weights`], one per carrier, complete it.
    Profiles(SweepConfiguration),
    /// Send a part of a burst, in a range-profile run. Samples between the received parts count as missing.
    Burst {
        /// Sweep number.
        sweep: u32,
        /// Carrier index.
        carrier: u16,
        /// Index of the first sample in the burst.
        first: u32,
        /// Samples of reference and echo channel ([`super::pairs`]).
        #[serde(serialize_with = "super::as_bytes")]
        samples: &'a [u8],
    },
    /// Request the range profile of a sweep after all its bursts. May be repeated.
    Sweep {
        /// Sweep number.
        sweep: u32,
    },
    /// Request the sub-CPIs accumulated into the chips so far ([`super::Report::Accumulated`]).
    Accumulated {
        /// First sub-CPI of the answer, a multiple of 8.
        first: u32,
    },
    /// Request an image chip, between runs. May be repeated.
    SendChip {
        /// Index of the patch.
        patch: u16,
    },
    /// Request events ([`super::Report::Event`]), until the next reset. The first one is [`super::Event::Started`].
    Log {
        /// Least severe level to send. `None` for no events, as after a reset.
        least: Option<Level>,
    },
    /// Like [`Command::Start`], with samples from the front end of the module.
    StartFrontEnd {
        /// Run number chosen by the host; must differ from that of the previous run.
        run: u32,
        /// Number of the first pulse, which must be the first pulse of a sub-CPI.
        first: u32,
    },
    /// Send the geometry of one pulse, in a run with samples from the front end.
    Geometry {
        /// Number, time and geometry of the pulse.
        pulse: Pulse,
    },
    /// Accumulate the power of each sub-CPI into the chips in place of the coherent sum, until the next configuration. Allowed
    /// before the first run.
    Power,
    /// Detect on the difference of the aligned maps of two channels (DPCA), until the next configuration. The values of a detection are
    /// then the aligned values of both channels.
    Dpca(Dpca),
}

impl Message for Command<'_> {
    fn opens(&self) -> bool {
        matches!(self, Self::Hello)
    }
}

/// Map configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Configuration {
    /// Configuration number chosen by the host. [`super::Status::configuration`] reports it.
    pub id: u32,
    /// Settings of the stream processor.
    pub setup: Setup,
    /// Number of pulses of all runs, from pulse 0; 0 if unknown. The last sub-CPI may have fewer pulses than the setup.
    /// Any other sub-CPI with fewer pulses is discarded.
    pub total_pulses: u32,
    /// Whether maps are sent.
    pub send_maps: bool,
}

/// Motion configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MotionConfiguration {
    /// Configuration number chosen by the host. [`super::Status::configuration`] reports it.
    pub id: u32,
    /// Settings of the odometer.
    pub setup: motion::Setup,
}

/// Range-profile configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SweepConfiguration {
    /// Configuration number chosen by the host. [`super::Status::configuration`] reports it.
    pub id: u32,
    /// Settings of the range profiler.
    pub setup: sweep::Setup,
}

/// Encoding of samples in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Encoding {
    /// Real and imaginary part as float32, little endian: 8 bytes per sample.
    Complex32,
    /// Real and imaginary part as Q15 (16-bit integers in units of `2^-15`), little endian: 4 bytes per sample.
    Sc16,
}

impl Encoding {
    /// Number of bytes per sample.
    pub const fn sample_bytes(self) -> usize {
        match self {
            Self::Complex32 => 8,
            Self::Sc16 => 4,
        }
    }
}

/// Encoding of the pixels of an image chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum PixelEncoding {
    /// Complex pixels as in [`Encoding::Complex32`].
    Complex32,
    /// Complex pixels as in [`Encoding::Sc16`], with exponents.
    Sc16,
    /// Power ([`Command::Power`]) as float32, little endian: 4 bytes per pixel.
    Power,
}

impl From<Encoding> for PixelEncoding {
    fn from(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Complex32 => Self::Complex32,
            Encoding::Sc16 => Self::Sc16,
        }
    }
}

/// Pixel grid of an image chip: `origin + column * column_step + row * row_step`, metres. The chip is the sum of a
/// patch's maps over all sub-CPIs divided by the sum of their pulse weights, so a scatterer of unit amplitude has
/// amplitude 1. With [`Command::Power`] it is the mean over the sub-CPIs of the power of each one's image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ChipGrid {
    /// Index of the patch.
    pub patch: u16,
    /// Position of the pixel in row 0, column 0, in metres.
    pub origin_m: [f64; 3],
    /// Vector from one column to the next in metres.
    pub column_step_m: [f64; 3],
    /// Vector from one row to the next in metres.
    pub row_step_m: [f64; 3],
    /// Number of columns.
    pub num_columns: u16,
    /// Number of rows.
    pub num_rows: u16,
}

impl ChipGrid {
    /// Maximum number of pixels per step of a module that adds a map ([`Self::step`]).
    pub const STEP_PIXELS: usize = 32;

    /// Number of pixels, columns times rows.
    pub fn num_pixels(&self) -> usize {
        usize::from(self.num_columns).saturating_mul(self.num_rows.into())
    }

    /// Pixels of step `index`, as a range in row-major order, and their grid: at most [`Self::STEP_PIXELS`] neighbours in
    /// one row. `None` after the last step. A module adds a map step by step; the position of a step's first pixel is
    /// rounded once.
    pub fn step(&self, index: usize) -> Option<(Range<usize>, PixelGrid)> {
        let columns = usize::from(self.num_columns);
        let steps_per_row = columns.div_ceil(Self::STEP_PIXELS);
        let row = index.checked_div(steps_per_row)?;
        let column = (index % steps_per_row) * Self::STEP_PIXELS;
        if row >= usize::from(self.num_rows) {
            return None;
        }
        let num_columns = Self::STEP_PIXELS.min(columns - column);
        let first = row * columns + column;
        let grid = PixelGrid {
            origin_m: [0, 1, 2].map(|i| {
                self.origin_m[i]
                    + row as f64 * self.row_step_m[i]
                    + column as f64 * self.column_step_m[i]
            }),
            column_step_m: self.column_step_m,
            row_step_m: [0.0; 3],
            num_columns,
            num_rows: 1,
        };
        Some((first..first + num_columns, grid))
    }
}
