//! Batch plan of one sub-CPI: all parameters validated and all tables computed in advance.
//!
//! [`Plan::process`] turns a windowed sub-CPI into its range-Doppler map by the sum in the crate documentation.
//! For each frequency it applies the keystone and Doppler transform and writes the result to that frequency's
//! column of the map; then it range-compresses each Doppler row in place. [`Plan::window`] precedes it: it stores one
//! pulse in frequency-major order, multiplied by the fast-time and slow-time weights. No intermediate copies are made.
//!
//! **Folded into the weights**: the normalisation, `(-1)^(k - F/2)` which centres the range axis,
//! and the `1/L` of the chirp transforms.

use core::fmt;

use num_complex::Complex32;

use crate::keystone::{KeystoneTable, chirp_z, sinc};
use crate::{Axes, ParamError, Shape, Turns, Window, fft, range};

/// Frequency axis and windows of a sub-CPI. Its dimensions are a [`Shape`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params<'a> {
    /// Frequency of sample 0 in hertz.
    pub start_hz: f64,
    /// Frequency step between samples in hertz; positive.
    pub step_hz: f64,
    /// Fast-time window, over the frequencies.
    pub fast_window: Window<'a>,
    /// Slow-time window, over the pulses.
    pub slow_window: Window<'a>,
}

/// Tables of a plan in memory lent by the caller.
#[derive(Debug)]
pub struct Tables<'a> {
    /// Fast-time weights, `F` values.
    pub fast_weights: &'a mut [f32],
    /// Slow-time weights, `M` values.
    pub slow_weights: &'a mut [f32],
    /// Keystone transform with its table.
    pub keystone: KeystoneTable<'a>,
}

/// Validated plan. It is `Sync`: one plan can process many sub-CPIs concurrently.
///
/// ```
/// use subaperture_core::keystone::KeystoneTable;
/// use subaperture_core::{Complex32, Params, Plan, Shape, Tables, Window};
///
/// let shape = Shape { num_pulses: 5, num_frequencies: 6, num_range_bins: 8, num_doppler_bins: 8 };
/// let params = Params {
///     start_hz: 1.0e9,
///     step_hz: 1.0e6,
///     fast_window: Window::Hamming,
///     slow_window: Window::Rectangular,
/// };
/// let (mut fast, mut slow) = (vec![0.0; 6], vec![0.0; 5]);
/// let tables = Tables {
///     fast_weights: &mut fast,
///     slow_weights: &mut slow,
///     keystone: KeystoneTable::ChirpZ { length: shape.chirp_length() },
/// };
/// let plan = Plan::new(shape, &params, tables)?;
/// let mut history = vec![Complex32::ZERO; shape.history_len()];
/// let mut scratch = vec![Complex32::ZERO; plan.scratch_len()];
/// let mut map = vec![Complex32::ZERO; shape.map_len()];
/// for m in 0..5 {
///     plan.window(m, &[Complex32::ONE; 6], &mut history)?;
/// }
/// plan.process(&history, &mut scratch, &mut map)?;
/// // Constant samples are a stationary scatterer at path 0: bins D/2 and R/2.
/// assert!((map[4 * 8 + 4] - 1.0).l1_norm() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    axes: Axes,
    fast_weights: &'a [f32],
    slow_weights: &'a [f32],
    keystone: Planned<'a>,
}

#[derive(Clone, Debug)]
enum Planned<'a> {
    Sinc(&'a [f32]),
    /// The chirp rate of frequency `k` is `centre + (k - F/2) step`, since rates are linear in frequency. The
    /// integer step is off by at most `2^-65` turns, which causes a phase error of `F/2 D^2 2^-65`, below `2^-30`,
    /// at the largest dimensions.
    ChirpZ {
        length: usize,
        centre: Turns,
        step: Turns,
    },
}

impl<'a> Plan<'a> {
    /// Validate all parameters and fill the tables.
    ///
    /// # Errors
    /// [`ParamError`] naming the invalid parameter or the table of wrong length.
    pub fn new(shape: Shape, params: &Params<'_>, tables: Tables<'a>) -> Result<Self, ParamError> {
        let axes = Axes::new(shape, params.start_hz, params.step_hz)?;
        let Tables {
            fast_weights,
            slow_weights,
            keystone,
        } = tables;
        let frequencies = shape.num_frequencies;
        LengthError::check("fast weights", frequencies, fast_weights.len())?;
        LengthError::check("slow weights", shape.num_pulses, slow_weights.len())?;
        params
            .fast_window
            .fill(fast_weights)
            .map_err(ParamError::FastWindow)?;
        params
            .slow_window
            .fill(slow_weights)
            .map_err(ParamError::SlowWindow)?;

        let ratio = |k: usize| axes.frequency_hz(k) / axes.centre_hz();
        let (keystone, scale) = match keystone {
            KeystoneTable::Sinc(matrix) => {
                LengthError::check("sinc matrix", shape.sinc_len(), matrix.len())?;
                let one = shape.num_pulses.saturating_mul(shape.num_pulses).max(1);
                for (k, one) in matrix.chunks_exact_mut(one).enumerate() {
                    sinc::fill_matrix(ratio(k), shape.num_pulses, one);
                }
                (Planned::Sinc(matrix), 1.0)
            }
            KeystoneTable::ChirpZ { length } => {
                let least = shape.chirp_length();
                if length < least || !fft::supports(length) {
                    return Err(ParamError::ChirpLength { least, got: length });
                }
                let step_ratio = axes.step_hz() / axes.centre_hz();
                let planned = Planned::ChirpZ {
                    length,
                    centre: chirp_z::rate(1.0, shape.num_doppler_bins),
                    step: chirp_z::rate(step_ratio, shape.num_doppler_bins),
                };
                (planned, 1.0 / length as f32)
            }
        };
        for (k, weight) in fast_weights.iter_mut().enumerate() {
            *weight *= range::sign(k, frequencies) * scale;
        }
        Ok(Self {
            axes,
            fast_weights,
            slow_weights,
            keystone,
        })
    }

    /// Physical axes of the map.
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// Number of scratch samples that [`Plan::process`] needs: `D` for the sinc keystone, `3 L` for chirp-z.
    pub fn scratch_len(&self) -> usize {
        match self.keystone {
            Planned::Sinc(_) => self.axes.shape().num_doppler_bins,
            Planned::ChirpZ { length, .. } => 3 * length,
        }
    }

    /// Multiply pulse `m` by the window and store it in `history`, samples `[frequency][pulse]`.
    ///
    /// # Errors
    /// [`LengthError`] if `m` is not below the number of pulses, `pulse` does not have one sample per frequency, or
    /// the length of `history` is not [`Shape::history_len`]. Nothing is then written.
    pub fn window(
        &self,
        m: usize,
        pulse: &[Complex32],
        history: &mut [Complex32],
    ) -> Result<(), LengthError> {
        let shape = self.axes.shape();
        let Some(slow) = self.slow_weights.get(m) else {
            return Err(LengthError {
                what: "pulses of a sub-CPI",
                expected: m.saturating_add(1),
                got: self.slow_weights.len(),
            });
        };
        LengthError::check("samples of a pulse", shape.num_frequencies, pulse.len())?;
        LengthError::check("history", shape.history_len(), history.len())?;
        let rows = history.chunks_exact_mut(self.slow_weights.len().max(1));
        for ((row, sample), fast) in rows.zip(pulse).zip(self.fast_weights) {
            if let Some(place) = row.get_mut(m) {
                *place = *sample * (*fast * *slow);
            }
        }
        Ok(())
    }

    /// Compute the map `[doppler][range]` of a complete windowed sub-CPI.
    ///
    /// # Errors
    /// [`LengthError`] if the lengths are not [`Shape::history_len`], [`Plan::scratch_len`] and [`Shape::map_len`].
    /// Nothing is then written.
    pub fn process(
        &self,
        history: &[Complex32],
        scratch: &mut [Complex32],
        map: &mut [Complex32],
    ) -> Result<(), LengthError> {
        let shape = self.axes.shape();
        LengthError::check("history", shape.history_len(), history.len())?;
        LengthError::check("scratch", self.scratch_len(), scratch.len())?;
        LengthError::check("map", shape.map_len(), map.len())?;

        // A validated shape has no zeros; `max` lets the compiler know.
        let (num_pulses, bins) = (shape.num_pulses.max(1), shape.num_range_bins.max(1));
        let frequencies = shape.num_frequencies;
        for (k, pulses) in history.chunks_exact(num_pulses).enumerate() {
            let column = map.get_mut(range::column(k, frequencies, bins)..);
            let column = column.unwrap_or(&mut []).iter_mut().step_by(bins);
            match self.keystone {
                Planned::Sinc(matrix) => {
                    let one = num_pulses.saturating_mul(num_pulses).max(1);
                    let matrix = matrix.chunks_exact(one).nth(k).unwrap_or(&[]);
                    sinc::transform(matrix, pulses, scratch, column);
                }
                Planned::ChirpZ { centre, step, .. } => {
                    let rate = centre.plus(step.times(k as i64 - (frequencies / 2) as i64));
                    chirp_z::transform(rate, pulses, shape.num_doppler_bins, scratch, column);
                }
            }
        }
        for row in map.chunks_exact_mut(bins) {
            range::compress(row, frequencies);
        }
        Ok(())
    }
}

/// Slice with a wrong length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LengthError {
    /// Name of the slice.
    pub what: &'static str,
    /// Expected number of elements (the minimum, for buffers that may be longer).
    pub expected: usize,
    /// Actual number of elements.
    pub got: usize,
}

impl LengthError {
    pub(crate) fn check(what: &'static str, expected: usize, got: usize) -> Result<(), Self> {
        if expected == got {
            return Ok(());
        }
        Err(Self {
            what,
            expected,
            got,
        })
    }
}

#[cfg(feature = "stream")]
impl LengthError {
    pub(crate) fn at_least(what: &'static str, expected: usize, got: usize) -> Result<(), Self> {
        if got >= expected {
            return Ok(());
        }
        Err(Self {
            what,
            expected,
            got,
        })
    }
}

impl fmt::Display for LengthError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            what,
            expected,
            got,
        } = self;
        write!(f, "{what}: expected {expected} elements, found {got}")
    }
}

impl core::error::Error for LengthError {}

impl From<LengthError> for ParamError {
    fn from(error: LengthError) -> Self {
        Self::Table(error)
    }
}
