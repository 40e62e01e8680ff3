//! Dimensions and axes of a sub-CPI and its map.

use core::fmt;

use crate::fft;
use crate::window::WindowError;

/// Dimensions of a sub-CPI and of its range-Doppler map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Pulses per sub-CPI, `M >= 1`.
    pub num_pulses: usize,
    /// Frequency samples per pulse, `F >= 1`.
    pub num_frequencies: usize,
    /// Range bins of the map, `R`: a power of two from 2 to 4096, at least `F`.
    pub num_range_bins: usize,
    /// Doppler bins of the map, `D`: a power of two from 2 to 4096, at least `M`.
    pub num_doppler_bins: usize,
}

impl Shape {
    /// Number of samples of a sub-CPI, `F M`.
    pub const fn history_len(&self) -> usize {
        self.num_frequencies.saturating_mul(self.num_pulses)
    }

    /// Number of samples of a map, `D R`.
    pub const fn map_len(&self) -> usize {
        self.num_doppler_bins.saturating_mul(self.num_range_bins)
    }

    /// Number of weights of the sinc keystone matrices, `F M M`.
    pub const fn sinc_len(&self) -> usize {
        self.history_len().saturating_mul(self.num_pulses)
    }

    /// Minimum transform length of the chirp-z keystone: the smallest power of two at least `M + D - 1`.
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

    /// Whether the dimensions satisfy the bounds stated at each field.
    pub const fn is_valid(&self) -> bool {
        self.num_pulses >= 1
            && self.num_frequencies >= 1
            && fft::supports(self.num_range_bins)
            && fft::supports(self.num_doppler_bins)
            && self.num_range_bins >= self.num_frequencies
            && self.num_doppler_bins >= self.num_pulses
    }
}

/// Validated dimensions with the frequency axis: the physical axes of a map.
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
    /// Validate `shape` and the frequency axis `start_hz + k step_hz`.
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

    /// Dimensions.
    pub const fn shape(&self) -> Shape {
        self.shape
    }

    /// Frequency step in hertz.
    pub const fn step_hz(&self) -> f64 {
        self.step_hz
    }

    /// Frequency of sample `k` in hertz.
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }

    /// Reference frequency in hertz: the frequency of sample `F / 2`.
    pub fn centre_hz(&self) -> f64 {
        self.frequency_hz(self.shape.num_frequencies / 2)
    }

    /// Relative two-way path of a range bin in metres: `(bin - R/2) c / (R step_hz)`.
    pub fn path_m(&self, range_bin: usize) -> f64 {
        (range_bin as f64 - (self.shape.num_range_bins / 2) as f64) / self.range_bins_per_metre()
    }

    /// Range bins per metre of two-way path, `R step_hz / c`.
    pub fn range_bins_per_metre(&self) -> f64 {
        self.shape.num_range_bins as f64 * self.step_hz / crate::SPEED_OF_LIGHT_M_S
    }
}

/// Reason why a sub-CPI cannot be planned.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ParamError {
    /// Invalid dimensions; the bounds are stated at the fields of [`Shape`].
    Shape(Shape),
    /// Start frequency or frequency step is not positive and finite.
    Band {
        /// Frequency of sample 0 in hertz.
        start_hz: f64,
        /// Frequency step in hertz.
        step_hz: f64,
    },
    /// The fast-time window is invalid.
    FastWindow(WindowError),
    /// The slow-time window is invalid.
    SlowWindow(WindowError),
    /// The transform length of the chirp-z keystone is too short, or not a power of two up to 4096.
    ChirpLength {
        /// Minimum length.
        least: usize,
        /// Requested length.
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
                "invalid shape of {} pulses x {} frequencies and {} Doppler x {} range bins: expected bins in powers \
                 of two from 2 to 4096, Doppler bins >= pulses >= 1, range bins >= frequencies >= 1",
                s.num_pulses, s.num_frequencies, s.num_doppler_bins, s.num_range_bins
            ),
            Self::Band { start_hz, step_hz } => write!(
                f,
                "invalid band from {start_hz} Hz in steps of {step_hz} Hz: expected positive finite start and step"
            ),
            Self::FastWindow(error) => write!(f, "fast-time window: {error}"),
            Self::SlowWindow(error) => write!(f, "slow-time window: {error}"),
            Self::ChirpLength { least, .. } if *least > fft::MAX_LENGTH => write!(
                f,
                "pulses and Doppler bins need chirp transforms of {least} points, more \
                 than {}: reduce them or use the sinc keystone",
                fft::MAX_LENGTH
            ),
            Self::ChirpLength { least, got } => write!(
                f,
                "chirp transform length: expected a power of two from {least} to 4096, found {got}"
            ),
            Self::Table(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ParamError {}
