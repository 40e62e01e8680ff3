//! Fixed-point engine: 16-bit samples in, block floating-point map out, integer arithmetic in between.
//!
//! [`FixedEngine`] computes the map defined in [`crate::stream`] with its phases, weights and normalisation:
//! `mantissa 2^exponent` is the value of the map. It is intended for processors without a floating-point unit:
//! samples and bins are processed in integer arithmetic only. Float64 (in software on such processors) is used
//! only in [`Engine::begin`]: two square roots and a few products per pulse.
//!
//! **Data flow and precision.**
//!
//! ```text
//! 16-bit samples -> x weight x phasor -> 32 bit -> Doppler, 64-bit sums -> 16 bit, an exponent a column
//!                -> 32 bit -> range, block floating point -> 16 bit, an exponent for 32 range bins
//! ```
//!
//! The 16-bit store between the transforms keeps a map cell as small as a sample (4 bytes). Its rounding is the
//! largest error: half a unit of `2^-15` relative to the power of two of its column. **Accuracy** of all
//! arithmetic against a float64 sum over the same samples, relative RMS over the map (`tests/stream/fixed.rs`):
//! -84.6 dB or better for 30 pulses, 424 frequencies and 41 x 201 bins, on several points, a single point and
//! noise, with samples at full scale and 30 dB and 60 dB below; -74.3 dB for the worst of all shapes tested, 200
//! pulses and 201 Doppler bins.
//!
//! **Headroom**: no sum overflows, whatever the samples; the bounds are derived in `column`, [`fft`] and `row`.
//! Only an exponent outside `-128 ..= 127`, which no practical window causes, leads to saturation. Mantissas are
//! then clamped and counted by [`Engine::saturated`].
//!
//! **Memory**: see [`FixedSlices`]. **Cost**: a column takes one rotation per pulse (a directly computed phasor every
//! 16th frequency), then `M/2` times `Q` steps of eight multiplications. A row takes one transform of `R` points.
//!
//! ```
//! use subaperture_core::fixed_point::{FixedSlices, FixedEngine};
//! use subaperture_core::stream::{Capacity, Engine, MapSamples, Patch, Setup, Work};
//! use subaperture_core::{Complex32, Pulse, Sc16};
//!
//! let capacity = Capacity { pulses: 2, frequencies: 4, range_bins: 4, doppler_bins: 1, patches: 1 };
//! let (mut cells, mut work) = ([Sc16::ZERO; 4], [Default::default(); 4]);
//! let (mut columns, mut rows) = ([0; 4], [0; 1]);
//! let (mut phases, mut folded) = ([Default::default(); 2], [Default::default(); 2]);
//! let mut engine = FixedEngine::new(
//!     FixedSlices {
//!         cells: &mut cells,
//!         column_exponents: &mut columns,
//!         row_exponents: &mut rows,
//!         work: &mut work,
//!         phases: &mut phases,
//!         folded: &mut folded,
//!     },
//!     &capacity,
//! )?;
//! // Samples of 1/2 from the patch centre at path 0: the map is 1/2 there.
//! let setup = Setup {
//!     num_pulses: 2, num_channels: 1, num_frequencies: 4, range_length: 4, doppler_length: 2,
//!     start_hz: 1.0e9, step_hz: 1.0e6,
//! };
//! let patch = Patch { centre_m: [0.0; 3], range_reach: 0, doppler_reach: 0 };
//! let pulse = Pulse { weight: 1.0, ..Pulse::EMPTY };
//! let work = Work {
//!     setup: &setup,
//!     patch: &patch,
//!     weights: &[0.25; 4],
//!     pulses: &[pulse; 2],
//!     samples: &[Sc16::from_bits(16384, 0); 8],
//! };
//! engine.begin(&work);
//! (0..4).for_each(|k| engine.column(&work, k));
//! engine.row(&work, 0);
//! let MapSamples::Fixed(map) = engine.map(&work) else { unreachable!() };
//! let value = map.mantissas[0].to_complex32() * f32::powi(2.0, map.exponents[0].into());
//! assert_eq!(value, Complex32::new(0.5, 0.0));
//! # Ok::<(), subaperture_core::LengthError>(())
//! ```

mod block;
mod buffers;
mod column;
pub mod fft;
mod row;
pub mod sine;

use core::cell::Cell;
use core::num::NonZeroU32;

use num_complex::Complex;

use self::block::{Narrowing, Scaled};
pub use self::buffers::FixedSlices;
pub use self::column::PulsePhase;
use crate::stream::{
    BlockFloat, Capacity, Engine, MapSamples, Patch, Quantity, Setup, SetupError, Work,
    compensation,
};
use crate::{LengthError, Pulse, Sc16, Turns};

/// Fixed-point engine on borrowed buffers. See the module documentation.
#[derive(Debug)]
pub struct FixedEngine<'a> {
    buffers: FixedSlices<'a>,
    /// Values computed by `begin`. `None` if the patch does not fit the buffers.
    prepared: Option<Prepared>,
    rows_done: usize,
    saturated: u32,
}

/// Values shared by all columns of a patch.
#[derive(Clone, Copy, Debug)]
struct Prepared {
    num_pulses: usize,
    /// Power of two that the pulse weights are relative to, divided by `M`.
    scale: Scaled,
    /// Phase of Doppler bin 1 at half a pulse from the middle, `a_k / (2 D)` turns, at frequency `F/2`, and its
    /// increment per frequency. Both are truncated to `2^-64` turns. The largest phase multiplies the truncation by
    /// `M D F / 4`: `2^-40` turns at 64 pulses, 64 Doppler bins and 4096 frequencies.
    half_turn: Turns,
    half_turn_step: Turns,
}

impl<'a> FixedEngine<'a> {
    /// Create an engine on `buffers`.
    ///
    /// # Errors
    /// [`LengthError`] naming the first buffer that is shorter than `capacity` requires.
    pub fn new(buffers: FixedSlices<'a>, capacity: &Capacity) -> Result<Self, LengthError> {
        buffers.check(capacity)?;
        Ok(Self {
            buffers,
            prepared: None,
            rows_done: 0,
            saturated: 0,
        })
    }

    /// Check that the buffers are large enough for `patch`.
    ///
    /// If they are not, [`Engine::begin`] counts one saturated result and the map has no rows.
    ///
    /// # Errors
    /// [`SetupError::Size`] naming the first size that exceeds the buffers.
    pub fn check(&self, setup: &Setup, patch: &Patch) -> Result<(), SetupError> {
        let within = |what, wanted: usize, most: usize| {
            let (wanted_32, most) = (wanted as u32, most as u32);
            let error = SetupError::Size {
                what,
                wanted: wanted_32,
                most,
            };
            if wanted_32 <= most {
                Ok(())
            } else {
                Err(error)
            }
        };
        let Self { buffers, .. } = self;
        let frequencies = buffers.column_exponents.len();
        let pulses = buffers.phases.len().min(buffers.folded.len());
        within(Quantity::Pulses, setup.num_pulses.into(), pulses)?;
        within(
            Quantity::Frequencies,
            setup.num_frequencies.into(),
            frequencies,
        )?;
        let work = buffers.work.len();
        within(Quantity::RangeLength, setup.range_length.into(), work)?;
        let gate = patch.num_range_bins();
        within(Quantity::RangeGate, gate, setup.range_length.into())?;
        let rows = patch.num_doppler_bins();
        let blocks = buffers.row_exponents.len() / BlockFloat::blocks(gate).max(1);
        within(Quantity::DopplerBand, rows, work.min(blocks))?;
        // Each factor is below 2^17; the product can exceed 32 bits.
        let wanted = rows.saturating_mul(setup.row_stride(patch));
        within(Quantity::Map, wanted, buffers.cells.len())
    }
}

impl Engine for FixedEngine<'_> {
    type Sample = Sc16;

    fn holds(&self, capacity: &Capacity) -> Result<(), LengthError> {
        self.buffers.check(capacity)
    }

    fn begin(&mut self, work: &Work<'_, Sc16>) {
        self.rows_done = 0;
        self.prepared = None;
        let fits = work.pulses.len() <= usize::from(work.setup.num_pulses)
            && self.check(work.setup, work.patch).is_ok();
        let num_pulses = u32::try_from(work.pulses.len())
            .ok()
            .and_then(NonZeroU32::new);
        let (true, Some(num_pulses)) = (fits, num_pulses) else {
            self.saturated = self.saturated.saturating_add(1);
            return;
        };

        let mut scale = Scaled::reciprocal(num_pulses);
        let largest = self.largest_exponent(work.pulses);
        scale.exponent += largest;
        for (state, pulse) in self.buffers.phases.iter_mut().zip(work.pulses) {
            let (start, step) = compensation(work.setup, pulse, work.patch.centre_m);
            let weight = Scaled::from_f32(pulse.weight).unwrap_or(Scaled::ZERO);
            // A zero weight has exponent 0, which may be above the largest.
            let drop = (largest - weight.exponent).clamp(0, 31) as u32;
            *state = PulsePhase {
                start,
                step,
                weight: weight.mantissa >> drop,
                value: Complex::new(0, 0),
                rotation: sine::phasor(step),
            };
        }
        let half_cycle = 0.5 / f64::from(work.setup.doppler_length);
        let step_ratio = work.setup.step_hz / work.setup.centre_hz();
        self.prepared = Some(Prepared {
            num_pulses: work.pulses.len(),
            scale,
            half_turn: Turns::from_f64(half_cycle),
            half_turn_step: Turns::from_f64(half_cycle * step_ratio),
        });
    }

    fn column(&mut self, work: &Work<'_, Sc16>, k: usize) {
        let frequencies = usize::from(work.setup.num_frequencies);
        let stride = work.setup.row_stride(work.patch).max(1);
        let Some(prepared) = self.prepared.filter(|_| k < frequencies) else {
            return;
        };
        let Prepared { num_pulses, .. } = prepared;
        let FixedSlices {
            cells,
            column_exponents,
            work: values,
            phases,
            folded,
            ..
        } = &mut self.buffers;
        let (rows, reach) = (
            work.patch.num_doppler_bins(),
            usize::from(work.patch.doppler_reach),
        );
        let (Some(phases), Some(folded), Some(values), Some(cells), Some(exponent)) = (
            phases.get_mut(..num_pulses),
            folded.get_mut(..num_pulses),
            values.get_mut(..rows),
            cells.get_mut(k..),
            column_exponents.get_mut(k),
        ) else {
            return;
        };

        let samples = work.samples.get(..num_pulses * frequencies);
        let samples = samples.unwrap_or_default().chunks_exact(frequencies.max(1));
        let samples = samples.map(|pulse| pulse.get(k).copied().unwrap_or_default());
        let guard_bits = column::guard_bits(num_pulses);
        let folded = column::fold(phases, samples, k, guard_bits, folded);
        let from_centre = k as i64 - (frequencies / 2) as i64;
        let half_turn = prepared
            .half_turn
            .plus(prepared.half_turn_step.times(from_centre));

        let weight = work.weights.get(k).copied().unwrap_or(0.0);
        let weight = Scaled::from_f32(weight).unwrap_or_else(|| {
            self.saturated = self.saturated.saturating_add(1);
            Scaled::ZERO
        });
        let scale = prepared.scale.times(weight);
        let gain = column::Gain::new(scale.mantissa);
        let Some((zero, bins)) = values.split_first_mut() else {
            return;
        };
        let value = folded.zero_bin();
        *zero = Complex::new(gain.times(value.re), gain.times(value.im));
        let mut peak = block::peak(0, *zero);
        if !bins.is_empty() {
            let bins = Cell::from_mut(&mut *bins).as_slice_of_cells();
            let (bins, _) = bins.as_chunks();
            peak = peak.max(folded.bins(half_turn, bins, gain));
        }

        let unit = scale.exponent + guard_bits as i32 - 27;
        let narrowing = Narrowing::new(peak, unit);
        *exponent = narrowing.exponent;
        let mut saturated = 0;
        let mut narrow = |cell: &mut Sc16, value: Complex<i32>| {
            let (narrow, clamped) = narrowing.apply(value);
            *cell = narrow;
            saturated += u32::from(clamped);
        };
        let (bins, _) = bins.as_chunks();
        let (below, above) = cells
            .split_at_mut_checked(reach * stride)
            .unwrap_or_default();
        for (cell, [value, _]) in below.iter_mut().step_by(stride).zip(bins.iter().rev()) {
            narrow(cell, *value);
        }
        if let Some((cell, above)) = above.split_first_mut() {
            narrow(cell, *zero);
            let above = above.get_mut(stride - 1..).unwrap_or_default().iter_mut();
            for (cell, [_, value]) in above.step_by(stride).zip(bins) {
                narrow(cell, *value);
            }
        }
        self.saturated = self.saturated.saturating_add(saturated);
    }

    fn row(&mut self, work: &Work<'_, Sc16>, row: usize) {
        let (width, rows) = (work.patch.num_range_bins(), work.patch.num_doppler_bins());
        let blocks = BlockFloat::blocks(width);
        if self.prepared.is_none() || row >= rows {
            return;
        }
        let frequencies = usize::from(work.setup.num_frequencies);
        let FixedSlices {
            cells,
            column_exponents,
            row_exponents,
            work: values,
            ..
        } = &mut self.buffers;
        let stride = work.setup.row_stride(work.patch);
        let (Some(values), Some(exponents), Some(input)) = (
            values.get_mut(..usize::from(work.setup.range_length)),
            column_exponents.get(..frequencies),
            cells.get(row * stride..),
        ) else {
            return;
        };
        let unit = row::compress(input, exponents, values);
        // A finished row ends at or before its own input: width <= stride.
        if let (Some(out), Some(exponents)) = (
            cells.get_mut(row * width..(row + 1) * width),
            row_exponents.get_mut(row * blocks..(row + 1) * blocks),
        ) {
            let clamped = row::gate(values, unit, out, exponents);
            self.saturated = self.saturated.saturating_add(clamped);
            self.rows_done = row + 1;
        }
    }

    fn map(&self, work: &Work<'_, Sc16>) -> MapSamples<'_> {
        let width = work.patch.num_range_bins();
        let (cells, exponents) = (&self.buffers.cells, &self.buffers.row_exponents);
        let done = self.rows_done;
        MapSamples::Fixed(BlockFloat {
            mantissas: cells.get(..done * width).unwrap_or_default(),
            exponents: exponents
                .get(..done * BlockFloat::blocks(width))
                .unwrap_or_default(),
        })
    }

    fn saturated(&self) -> u32 {
        self.saturated
    }
}

impl FixedEngine<'_> {
    /// Largest exponent of the pulse weights, 0 if all are zero. A weight that is not finite counts as saturated and is
    /// treated as zero.
    fn largest_exponent(&mut self, pulses: &[Pulse]) -> i32 {
        let mut largest: Option<i32> = None;
        for pulse in pulses {
            match Scaled::from_f32(pulse.weight) {
                None => self.saturated = self.saturated.saturating_add(1),
                Some(weight) if weight.mantissa == 0 => {}
                Some(weight) => largest = largest.max(Some(weight.exponent)),
            }
        }
        largest.unwrap_or(0)
    }
}
