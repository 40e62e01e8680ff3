//! Sizes and axes of a sub-CPI and its map.

use core::fmt;

use crate::fft;
use crate::window::WindowError;

/// Sizes of a sub-CPI and of its range-Doppler map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Pulses a sub-CPI, `M`; at least 1.
    pub num_pulses: usize,
    /// Frequency samples a pulse, `F`; at least 1.
    pub num_frequencies: usize,
    /// Range bins of the map, `R`: a power of two, at least `F`, 2 to 4096.
    pub num_range_bins: usize,
    /// Doppler bins of the map, `D`: a power of two, at least `M`, 2 to 4096.
    pub num_doppler_bins: usize,
}

impl Shape {
    /// Samples of a sub-CPI, `F M`.
    pub const fn history_len(&self) -> usize {
        self.num_frequencies.saturating_mul(self.num_pulses)
    }

    /// Samples of a map, `D R`.
    pub const fn map_len(&self) -> usize {
        self.num_doppler_bins.saturating_mul(self.num_range_bins)
    }

    /// Weights of the sinc Keystone's matrix, `F M M`.
    pub const fn sinc_len(&self) -> usize {
        self.history_len().saturating_mul(self.num_pulses)
    }

    /// Shortest transform that the chirp-z Keystone can use: the power of two at or above
    /// `M + D - 1`.
    pub const fn chirp_length(&self) -> usize {
        let least = self
            .num_pulses
            .saturating_add(self.num_doppler_bins)
            .saturating_sub(1);
        match least.checked_next_power_of_two() {
            Some(length) => length,
            None => usize::MAX,
        }
    }

    /// Whether the sizes can be: the bounds stated at each.
    pub const fn is_valid(&self) -> bool {
        self.num_pulses >= 1
            && self.num_frequencies >= 1
            && fft::supports(self.num_range_bins)
            && fft::supports(self.num_doppler_bins)
            && self.num_range_bins >= self.num_frequencies
            && self.num_doppler_bins >= self.num_pulses
    }
}

/// A checked shape with its frequency axis: what a map's bins mean.
///
/// ```
/// use subaperture_core::{Axes, SPEED_OF_LIGHT_M_S, Shape};
/// let shape = Shape { num_pulses: 8, num_frequencies: 10, num_range_bins: 16, num_doppler_bins: 16 };
/// let axes = Axes::new(shape, 1.0e9, 1.0e6)?;
/// assert_eq!(axes.centre_hz(), 1.005e9);
/// assert_eq!(axes.path_m(8), 0.0);
/// assert_eq!(axes.path_m(16), SPEED_OF_LIGHT_M_S / 1.0e6 / 2.0);
/// # Ok::<(), subaperture_core::ParamError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    shape: Shape,
    start_hz: f64,
    step_hz: f64,
}

impl Axes {
    /// Checks `shape` and the frequencies `start_hz + k step_hz`.
    ///
    /// # Errors
    /// [`ParamError::Shape`] or [`ParamError::Band`].
    pub fn new(shape: Shape, start_hz: f64, step_hz: f64) -> Result<Self, ParamError> {
        if !shape.is_valid() {
            return Err(ParamError::Shape(shape));
        }
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !(positive(start_hz) && positive(step_hz)) {
            return Err(ParamError::Band { start_hz, step_hz });
        }
        Ok(Self {
            shape,
            start_hz,
            step_hz,
        })
    }

    /// The sizes.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// Frequency step, hertz.
    pub const fn step_hz(&self) -> f64 {
        self.step_hz
    }

    /// Frequency of sample `k`, hertz.
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }

    /// Reference frequency: that of sample `F / 2`, hertz.
    pub fn centre_hz(&self) -> f64 {
        self.frequency_hz(self.shape.num_frequencies / 2)
    }

    /// Relative two-way path of a range bin, metres: `(bin - R/2) c / (R step_hz)`.
    pub fn path_m(&self, range_bin: usize) -> f64 {
        (range_bin as f64 - (self.shape.num_range_bins / 2) as f64) / self.range_bins_per_metre()
    }

    /// Range bins a metre of two-way path, `R step_hz / c`.
    pub fn range_bins_per_metre(&self) -> f64 {
        self.shape.num_range_bins as f64 * self.step_hz / crate::SPEED_OF_LIGHT_M_S
    }
}

/// Why a sub-CPI cannot be planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParamError {
    /// Sizes that cannot be; the bounds are stated at [`Shape`]'s fields.
    Shape(Shape),
    /// Frequencies must be positive and finite.
    Band {
        /// Frequency of sample 0, hertz.
        start_hz: f64,
        /// Frequency step, hertz.
        step_hz: f64,
    },
    /// The fast-time window.
    FastWindow(WindowError),
    /// The slow-time window.
    SlowWindow(WindowError),
    /// The chirp-z Keystone's transform is too short, or no power of two up to 4096.
    ChirpLength {
        /// Shortest that would do.
        least: usize,
        /// Length given.
        got: usize,
    },
    /// A table has the wrong length.
    Table(crate::LengthError),
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape(s) => write!(
                f,
                "{} pulses x {} frequencies do not fit {} Doppler x {} range bins: bins are powers \
                 of two from 2 to 4096, Doppler bins at least the pulses, range bins at least the \
                 frequencies, none zero",
                s.num_pulses, s.num_frequencies, s.num_doppler_bins, s.num_range_bins
            ),
            Self::Band { start_hz, step_hz } => write!(
                f,
                "frequencies from {start_hz} Hz in steps of {step_hz} Hz: both must be positive \
                 and finite"
            ),
            Self::FastWindow(error) => write!(f, "fast-time window: {error}"),
            Self::SlowWindow(error) => write!(f, "slow-time window: {error}"),
            Self::ChirpLength { least, .. } if *least > fft::MAX_LENGTH => write!(
                f,
                "pulses and Doppler bins together need chirp transforms of {least} points, more \
                 than {}: take fewer, or the sinc Keystone",
                fft::MAX_LENGTH
            ),
            Self::ChirpLength { least, got } => write!(
                f,
                "chirp transforms of {got} points: a power of two from {least} to 4096 is needed"
            ),
            Self::Table(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ParamError {}
