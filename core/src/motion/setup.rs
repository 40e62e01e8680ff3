//! Settings of the odometer and their validation.

use core::fmt;

use super::MotionError;
use crate::{SPEED_OF_LIGHT_M_S, fft};

/// Settings of an odometer run. A cell is the range resolution, `c / (2 F step_hz)`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Setup {
    /// Frequencies per pulse, `F >= 8`.
    pub num_frequencies: u16,
    /// Length of the range transform, `R`: a power of two, at least `2 F` and at most 4096.
    pub range_length: u16,
    /// Frequency of sample 0 in hertz.
    pub start_hz: f64,
    /// Frequency step between samples in hertz.
    pub step_hz: f64,
    /// Sidelobe level of the Taylor window over frequency in dB below the peak, 15 to 100. Targets below the sidelobes of the strongest target are not detected.
    pub side_lobe_db: f64,
    /// Nearest and farthest target range in metres. Their difference must not exceed the unambiguous range `c / (2 step_hz)`.
    pub ranges_m: [f64; 2],
    /// Guard cells on each side.
    pub guard: u16,
    /// Training cells on each side, 1 to 64.
    pub training: u16,
    /// Rank of the order-statistic CFAR as a fraction of the training cells, above 0 to 1; robust against other targets among
    /// them. 0 selects cell averaging, which is best in uniform noise.
    pub rank: f64,
    /// Probability of false alarm per cell, between 0 and 1 exclusive.
    pub false_alarm_probability: f64,
    /// Minimum SNR in dB. Echoes with a lower SNR in any channel are ignored.
    pub least_snr_db: f64,
    /// Settings of the target tracker.
    pub follow: TrackerSettings,
}

/// Settings of the multi-target tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TrackerSettings {
    /// Half-width of the range gate around the predicted range, in cells.
    pub gate_cells: f64,
    /// Standard deviation of a target's acceleration in cells per pulse squared.
    pub acceleration_cells: f64,
    /// Crossing distance in cells. Targets closer together are not reported.
    pub apart_cells: f64,
    /// Minimum number of detections within the first `within` pulses that confirms a candidate.
    pub seen: u16,
    /// Number of pulses in which a candidate must be confirmed, at most [`MAX_BRIDGED`].
    pub within: u16,
    /// Maximum number of consecutive pulses without detection that a target survives, at most [`MAX_BRIDGED`].
    pub bridge: u16,
}

impl Default for TrackerSettings {
    /// Defaults of the host's tracker.
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

/// Reason why a setup was rejected. The odometer is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "link", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SetupError {
    /// Fewer than 8 frequencies, or more than the capacity.
    Frequencies {
        /// Requested number.
        wanted: u16,
        /// Maximum number.
        most: u16,
    },
    /// The range transform length is not a power of two, is less than twice the frequencies, or exceeds the capacity.
    RangeLength {
        /// Requested length.
        wanted: u16,
        /// Maximum length.
        most: u16,
    },
    /// Start frequency or frequency step is not positive and finite.
    Band,
    /// The sidelobe level is outside 15 to 100 dB.
    Window,
    /// The ranges are not finite, negative, not ascending, or farther apart than the unambiguous range.
    Ranges,
    /// The number of training cells is not 1 to 64, or guard and training cells cover more than half of the profile; the rank is
    /// outside 0 to 1, the false-alarm probability outside 0 to 1, or the minimum SNR not finite.
    Detection,
    /// A gate, acceleration or distance is not positive, the confirmation rule is impossible, or a number of pulses exceeds
    /// [`MAX_BRIDGED`].
    Tracker,
    /// Transmitters times receivers is zero or exceeds the capacity, or there are fewer than two receivers.
    Channels {
        /// Maximum number of channels.
        most: u16,
    },
    /// A position is not finite, or the closest receivers coincide or are more than half a wavelength apart.
    Array,
}

/// Maximum training cells per side. Over a wider region noise is rarely uniform.
pub const MAX_TRAINING: u16 = 64;

/// Maximum number of pulses that a target can be bridged. Each takes a prediction step within one call of `work`.
pub const MAX_BRIDGED: u16 = 255;

/// Range axis derived from a setup.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub(super) frequencies: usize,
    pub(super) bins: usize,
    pub(super) cells_a_bin: f64,
    /// Bins per cell, rounded.
    pub(super) stride: usize,
    /// Nearest and farthest range in cells.
    pub(super) ranges_cells: [f64; 2],
    pub(super) cell_m: f64,
    /// Wavelength at the middle of the band.
    pub(super) wavelength_m: f64,
}

impl Axis {
    /// Initial value of a buffer.
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
    /// Initial value of a buffer.
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
        follow: TrackerSettings {
            gate_cells: 0.0,
            acceleration_cells: 0.0,
            apart_cells: 0.0,
            seen: 0,
            within: 0,
            bridge: 0,
        },
    };

    /// Validate everything except the antennas against the capacity for frequencies and bins.
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
        // Limited so that bins can be counted.
        if !(near >= 0.0 && near < far && far - near <= count && far < 1e9) {
            return Err(SetupError::Ranges);
        }
        let stride = (r + f / 2) / f;
        let reach = (usize::from(self.guard) + usize::from(self.training)) * stride;
        let probability = self.false_alarm_probability;
        let is_rare = probability > 0.0 && probability < 1.0;
        let trained = (1..=MAX_TRAINING).contains(&self.training) && 2 * reach < r;
        let ranked = (0.0..=1.0).contains(&self.rank);
        if !(trained && ranked && is_rare && self.least_snr_db.abs() < 1000.0) {
            return Err(SetupError::Detection);
        }
        let TrackerSettings {
            gate_cells,
            acceleration_cells,
            apart_cells,
            seen,
            within,
            bridge,
        } = self.follow;
        let lengths = [gate_cells, acceleration_cells, apart_cells];
        let counted = (1..=within).contains(&seen) && within.max(bridge) <= MAX_BRIDGED;
        if !(lengths.into_iter().all(positive) && counted) {
            return Err(SetupError::Tracker);
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
    /// Convert an error of the antenna array.
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
                    "frequencies per pulse: expected 8 to {most}, found {wanted}"
                )
            }
            Self::RangeLength { wanted, most } => write!(
                f,
                "range transform length: expected a power of two, at least twice the frequencies per pulse and at most {most}, found {wanted}"
            ),
            Self::Band => f.write_str("start frequency and frequency step must be positive and finite"),
            Self::Window => f.write_str("sidelobe level must be 15 to 100 dB"),
            Self::Ranges => f.write_str(
                "ranges must be ascending from 0 or more, and their difference within the unambiguous range",
            ),
            Self::Detection => f.write_str(
                "invalid CFAR settings: expected 1 to 64 training cells per side, less than half of the profile with the guard cells, a rank of 0 to 1, \
                 a false-alarm probability between 0 and 1, and a finite minimum SNR",
            ),
            Self::Tracker => write!(
                f,
                "invalid tracker settings: expected positive gate, acceleration and crossing distance, 1 <= seen <= within, and within and bridge of at most {MAX_BRIDGED} pulses"
            ),
            Self::Channels { most } => write!(
                f,
                "antenna channels: expected 2 to {most} transmitter-receiver pairs with at least two receivers"
            ),
            Self::Array => f.write_str(
                "antenna array: expected finite positions and closest receivers at most half a wavelength apart",
            ),
        }
    }
}

impl core::error::Error for SetupError {}
