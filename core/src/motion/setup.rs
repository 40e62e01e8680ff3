//! What an odometer is told before it begins, and why some of it cannot be.

use core::fmt;

use super::MotionError;
use crate::{SPEED_OF_LIGHT_M_S, fft};

/// What stays the same for a run. A cell is a range resolution, `c / (2 F step_hz)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Frequencies a pulse, `F`, at least 8.
    pub num_frequencies: u16,
    /// Points of the range transform, `R`: a power of two, at least `2 F` and at most 4096.
    pub range_length: u16,
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Step from sample to sample, hertz.
    pub step_hz: f64,
    /// Side lobes of Taylor's window over frequency, dB below the peak, 15 to 100. What is below them beside the strongest target is not looked for.
    pub side_lobe_db: f64,
    /// Ranges of targets, metres: nearest, and farthest, not farther apart than `c / (2 step_hz)`, after which ranges repeat.
    pub ranges_m: [f64; 2],
    /// Guard cells on either side.
    pub guard: u16,
    /// Training cells on either side, 1 to 64.
    pub training: u16,
    /// What of the training cells is compared with: the cell of this rank, as a fraction of their number up to 1, which other targets among them raise little; 0 for their mean, which is best in even
    /// noise.
    pub rank: f64,
    /// Wanted false alarms a cell, above 0 and below 1.
    pub false_alarm_probability: f64,
    /// Echoes nearer to noise in any channel are left out, dB.
    pub least_snr_db: f64,
    /// How targets are followed.
    pub follow: Follow,
}

/// How targets are followed from pulse to pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Follow {
    /// How far an echo may be from where its target is predicted, cells.
    pub gate_cells: f64,
    /// Standard deviation of a target's acceleration, cells a pulse squared.
    pub acceleration_cells: f64,
    /// Nearer targets disturb each other: nothing is told of them.
    pub apart_cells: f64,
    /// In so many of its first pulses a candidate has to be seen,
    pub seen: u16,
    /// which are so many, at most [`MOST_BRIDGED`].
    pub within: u16,
    /// Pulses in a row in which a target may be unseen, at most [`MOST_BRIDGED`].
    pub bridge: u16,
}

impl Default for Follow {
    /// As the host follows them.
    fn default() -> Self {
        Self {
            gate_cells: 0.5,
            acceleration_cells: 0.01,
            apart_cells: 1.5,
            seen: 5,
            within: 8,
            bridge: 30,
        }
    }
}

/// Why a setup was refused. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SetupError {
    /// Fewer than 8 frequencies, or more than there is room for.
    Frequencies {
        /// What was wanted.
        wanted: u16,
        /// The most there is room for.
        most: u16,
    },
    /// The range transform is no power of two, shorter than two pulses, or longer than there is room for.
    RangeLength {
        /// What was wanted.
        wanted: u16,
        /// The most there is room for.
        most: u16,
    },
    /// Frequencies must be positive and finite.
    Band,
    /// Side lobes are outside 15 to 100 dB.
    Window,
    /// Ranges are no numbers, below 0, not ascending, or farther apart than they repeat.
    Ranges,
    /// Training cells are none, more than 64 or, with the guard cells, more than half of the profile; or the rank is not 0 to 1, the probability not above 0 and below 1, or the least SNR no
    /// number.
    Detection,
    /// A length is not above 0, a candidate is not to be seen in 1 to all of its first pulses, or these or the pulses that are bridged are more than [`MOST_BRIDGED`].
    Follow,
    /// Transmitters times receivers are none or more than there is room for, or receivers less than two.
    Channels {
        /// The most channels there is room for.
        most: u16,
    },
    /// A place is no number, or the nearest receivers are not apart, or by more than half a wavelength.
    Array,
}

/// Most training cells on a side: beyond, a profile's noise is hardly even.
pub const MOST_TRAINING: u16 = 64;

/// Most pulses that a target is followed through unseen: each is a step of every prediction, in one piece of work.
pub const MOST_BRIDGED: u16 = 255;

/// What follows of a setup for the axis of range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) frequencies: usize,
    pub(super) bins: usize,
    pub(super) cells_a_bin: f64,
    /// Bins a cell, rounded.
    pub(super) stride: usize,
    /// Nearest and farthest range, in cells.
    pub(super) ranges_cells: [f64; 2],
    pub(super) cell_m: f64,
    /// Of the middle of the band.
    pub(super) wavelength_m: f64,
}

impl Axis {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        frequencies: 0,
        bins: 0,
        cells_a_bin: 0.0,
        stride: 0,
        ranges_cells: [0.0; 2],
        cell_m: 0.0,
        wavelength_m: 0.0,
    };
}

impl Setup {
    /// What fills empty storage.
    pub(super) const EMPTY: Self = Self {
        num_frequencies: 0,
        range_length: 0,
        start_hz: 0.0,
        step_hz: 0.0,
        side_lobe_db: 0.0,
        ranges_m: [0.0; 2],
        guard: 0,
        training: 0,
        rank: 0.0,
        false_alarm_probability: 0.0,
        least_snr_db: 0.0,
        follow: Follow {
            gate_cells: 0.0,
            acceleration_cells: 0.0,
            apart_cells: 0.0,
            seen: 0,
            within: 0,
            bridge: 0,
        },
    };

    /// Checks all but the antennas against the room for frequencies and bins.
    pub(super) fn axis(&self, frequencies: usize, bins: usize) -> Result<Axis, SetupError> {
        let (f, r) = (
            usize::from(self.num_frequencies),
            usize::from(self.range_length),
        );
        if f < 8 || f > frequencies {
            return Err(SetupError::Frequencies {
                wanted: self.num_frequencies,
                most: frequencies.min(fft::MAX_LENGTH) as u16,
            });
        }
        if !fft::supports(r) || r < 2 * f || r > bins {
            return Err(SetupError::RangeLength {
                wanted: self.range_length,
                most: bins.min(fft::MAX_LENGTH) as u16,
            });
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !(positive(self.start_hz) && positive(self.step_hz)) {
            return Err(SetupError::Band);
        }
        let count = f64::from(self.num_frequencies);
        let cell_m = 0.5 * SPEED_OF_LIGHT_M_S / (count * self.step_hz);
        let middle_hz = self.start_hz + 0.5 * (count - 1.0) * self.step_hz;
        let wavelength_m = SPEED_OF_LIGHT_M_S / middle_hz;
        if !(positive(cell_m) && positive(wavelength_m)) {
            return Err(SetupError::Band);
        }
        let ranges_cells = self.ranges_m.map(|range_m| range_m / cell_m);
        let [near, far] = ranges_cells;
        // So far that bins can still be counted.
        if !(near >= 0.0 && near < far && far - near <= count && far < 1e9) {
            return Err(SetupError::Ranges);
        }
        let stride = (r + f / 2) / f;
        let reach = (usize::from(self.guard) + usize::from(self.training)) * stride;
        let probability = self.false_alarm_probability;
        let is_rare = probability > 0.0 && probability < 1.0;
        let trained = (1..=MOST_TRAINING).contains(&self.training) && 2 * reach < r;
        let ranked = (0.0..=1.0).contains(&self.rank);
        if !(trained && ranked && is_rare && self.least_snr_db.abs() < 1000.0) {
            return Err(SetupError::Detection);
        }
        let Follow {
            gate_cells,
            acceleration_cells,
            apart_cells,
            seen,
            within,
            bridge,
        } = self.follow;
        let lengths = [gate_cells, acceleration_cells, apart_cells];
        let counted = (1..=within).contains(&seen) && within.max(bridge) <= MOST_BRIDGED;
        if !(lengths.into_iter().all(positive) && counted) {
            return Err(SetupError::Follow);
        }
        Ok(Axis {
            frequencies: f,
            bins: r,
            cells_a_bin: count / f64::from(self.range_length),
            stride,
            ranges_cells,
            cell_m,
            wavelength_m,
        })
    }
}

impl SetupError {
    /// What is wrong with the antennas.
    pub(super) fn of_antennas(error: MotionError, channels: usize) -> Self {
        match error {
            MotionError::Channels => Self::Channels {
                most: channels.min(usize::from(u16::MAX)) as u16,
            },
            _ => Self::Array,
        }
    }
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frequencies { wanted, most } => {
                write!(
                    f,
                    "{wanted} frequencies a pulse: there is room for 8 to {most}"
                )
            }
            Self::RangeLength { wanted, most } => write!(
                f,
                "a range transform of {wanted} points: a power of two is needed, at least twice the frequencies of a pulse and at most {most}"
            ),
            Self::Band => f.write_str("frequencies must be positive and finite"),
            Self::Window => f.write_str("side lobes must be 15 to 100 dB below the peak"),
            Self::Ranges => f.write_str(
                "ranges must ascend from 0 or more, and not be farther apart than they repeat",
            ),
            Self::Detection => f.write_str(
                "detection needs 1 to 64 training cells on a side, with the guard cells less than half of the profile, a rank of 0 to 1, a false alarm rate above 0 \
                 and below 1, and a least SNR",
            ),
            Self::Follow => write!(
                f,
                "gate, acceleration and distance of targets must be above 0, a candidate be seen in 1 to all of its first pulses, and these and the pulses that are bridged be {MOST_BRIDGED} at most"
            ),
            Self::Channels { most } => write!(
                f,
                "transmitters times receivers must be 2 to {most} channels, of two receivers or more"
            ),
            Self::Array => f.write_str(
                "places must be numbers, and the nearest receivers at most half a wavelength apart",
            ),
        }
    }
}

impl core::error::Error for SetupError {}
