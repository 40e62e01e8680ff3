//! A plan: everything about a sub-CPI that is known before its pulses, checked once.
//!
//! **What it does.** [`Plan::process`] turns a windowed sub-CPI into its range-Doppler map by the
//! sum at the head of this crate: for each frequency the Keystone and Doppler transform, scattered
//! into that frequency's column of the map; then range compression along each Doppler row in place.
//! [`Plan::window`] is the step before: one pulse into frequency-major storage, fast and slow weight
//! in one product. Nothing is copied between.
//!
//! **Folded into the weights**: the normalisation, `(-1)^(k - F/2)` which centres the range axis,
//! and the `1/L` of the chirp transforms.

use core::fmt;

use num_complex::Complex32;

use crate::keystone::{KeystoneTable, chirp_z, sinc};
use crate::{Axes, ParamError, Shape, Turns, Window, fft, range};

/// Values of a sub-CPI; its sizes are a [`Shape`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params<'a> {
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Step from sample to sample, hertz; positive.
    pub step_hz: f64,
    /// Window over the frequencies.
    pub fast_window: Window<'a>,
    /// Window over the pulses.
    pub slow_window: Window<'a>,
}

/// Tables that a plan fills and keeps; lent by the caller.
#[derive(Debug)]
pub struct Tables<'a> {
    /// `F` values.
    pub fast_weights: &'a mut [f32],
    /// `M` values.
    pub slow_weights: &'a mut [f32],
    /// The form of Keystone, with its table.
    pub keystone: KeystoneTable<'a>,
}

/// A checked plan. `Sync`: one plan serves many sub-CPIs at once.
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
///     plan.window(m, &[Complex32::ONE; 6], &mut history);
/// }
/// plan.process(&history, &mut scratch, &mut map)?;
/// // Constant samples are a scatterer at path 0 that does not move: bins D/2 and R/2.
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
    /// The rate of frequency `k` is `centre + (k - F/2) step`: rates are linear in frequency, and
    /// integer steps off by `2^-65` turns at most lead to `F/2 D^2 2^-65`, below `2^-30`, at the
    /// largest sizes.
    ChirpZ {
        length: usize,
        centre: Turns,
        step: Turns,
    },
}

impl<'a> Plan<'a> {
    /// Checks everything and fills the tables.
    ///
    /// # Errors
    /// See [`ParamError`].
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

    /// What the map's bins mean.
    pub fn axes(&self) -> &Axes {
        &self.axes
    }

    /// Samples of scratch that [`Plan::process`] needs: `D` for the sinc form, `3 L` for chirp-z.
    pub fn scratch_len(&self) -> usize {
        match self.keystone {
            Planned::Sinc(_) => self.axes.shape().num_doppler_bins,
            Planned::ChirpZ { length, .. } => 3 * length,
        }
    }

    /// Windows pulse `m` into `history`, samples `[frequency][pulse]`.
    ///
    /// Does nothing if the sub-CPI has no pulse `m`. Samples and frequencies are taken in pairs, as
    /// far as `pulse` and `history` both go; the rest is left as it is.
    pub fn window(&self, m: usize, pulse: &[Complex32], history: &mut [Complex32]) {
        let Some(slow) = self.slow_weights.get(m) else {
            return;
        };
        let rows = history.chunks_exact_mut(self.slow_weights.len().max(1));
        for ((row, sample), fast) in rows.zip(pulse).zip(self.fast_weights) {
            if let Some(place) = row.get_mut(m) {
                *place = *sample * (*fast * *slow);
            }
        }
    }

    /// Computes the map, samples `[doppler][range]`, of a full windowed sub-CPI.
    ///
    /// # Errors
    /// [`LengthError`] unless the lengths are [`Shape::history_len`], [`Plan::scratch_len`] and
    /// [`Shape::map_len`]; nothing is then written.
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

        // A checked shape has no zeros; `max` lets the compiler see it.
        let (num_pulses, bins) = (shape.num_pulses.max(1), shape.num_range_bins.max(1));
        let frequencies = shape.num_frequencies;
        for (k, pulses) in history.chunks_exact(num_pulses).enumerate() {
            let column = map.get_mut(range::column(k, frequencies, bins)..);
            let column = column.unwrap_or(&mut []).iter_mut().step_by(bins);
            match self.keystone {
                Planned::Sinc(matrix) => {
                    let one = num_pulses.saturating_mul(num_pulses);
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

/// A slice has the wrong length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LengthError {
    /// Which slice.
    pub what: &'static str,
    /// Elements needed.
    pub expected: usize,
    /// Elements given.
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

impl fmt::Display for LengthError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            what,
            expected,
            got,
        } = self;
        write!(f, "{what}: {got} elements given, {expected} needed")
    }
}

impl core::error::Error for LengthError {}

impl From<LengthError> for ParamError {
    fn from(error: LengthError) -> Self {
        Self::Table(error)
    }
}
