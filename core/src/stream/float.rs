//! Range-Doppler maps in float32.
//!
//! **Equation**: that of [`super`]. Compensation: the phase `f_k rho_m / c` is held for every pulse as an integer
//! number of `2^-64` turns. Its phasor is computed at every [`ANCHOR`]-th frequency and advanced by a complex
//! rotation at the frequencies in between. The keystone transform is the Doppler transform scaled with frequency,
//! summed directly at the retained bins only. With `theta = 2 pi (f_k / f_ref) d / D`, and pulses `u` and `-u`
//! folded into `e = z(u) + z(-u)` and `o = z(u) - z(-u)`,
//!
//! ```text
//! A = z(0) + sum_{u > 0} e(u) cos(theta u),   B = sum_{u > 0} o(u) sin(theta u)
//! X(d) = A - j B,   X(-d) = A + j B
//! ```
//!
//! One rotation and four products thus serve two pulses and two bins: six instructions per pulse and bin under
//! QEMU's Cortex-M7. The method needs no minimum transform length, no table and no scratch memory beyond one column.
//! [`crate::keystone::chirp_z`] takes 31 k instructions for all 64 bins of 32 pulses, as many as this method
//! takes for five thousand pulse-bin products.
//!
//! **Neglected**: nothing. **Accuracy**: -127 dB or better against float64 (`tests/stream/float.rs`).
//! **Cost**: see `firmware/REPORT.md`. Memory: `8 (M + R)` bytes plus 32 bytes per pulse for phases, plus the map.

use num_complex::Complex32;

use super::engine::{Engine, Work};
use super::{Capacity, MapSamples, Setup};
use crate::{LengthError, Pulse, SPEED_OF_LIGHT_M_S, Turns, fft};

/// Number of frequencies from one directly computed phasor to the next. In between, the relative error of a rotated
/// phasor grows by at most `1.2e-7` per step, to at most `1.8e-6` (-115 dB) at the last if all rounding
/// errors have the same sign.
pub const ANCHOR: usize = 16;

/// Motion-compensation phase of one pulse.
#[derive(Clone, Copy, Debug)]
pub struct PulsePhase {
    /// Phase at frequency 0 and phase increment per frequency.
    start: Turns,
    step: Turns,
    /// `exp(+j phase)` at the current frequency times the pulse's weight, and the phasor of the increment.
    value: Complex32,
    rotation: Complex32,
}

impl PulsePhase {
    /// Zero phase; initial value of a buffer.
    pub const EMPTY: Self = Self {
        start: Turns(0),
        step: Turns(0),
        value: Complex32::ZERO,
        rotation: Complex32::ZERO,
    };
}

/// Compensation phase of a pulse to a point: phase at 0 Hz offset (`start_hz`) and increment per frequency step.
pub(crate) fn compensation(setup: &Setup, pulse: &Pulse, point_m: [f64; 3]) -> (Turns, Turns) {
    let delay_s = pulse.relative_path_m(point_m) / SPEED_OF_LIGHT_M_S;
    (
        Turns::from_f64(setup.start_hz * delay_s),
        Turns::from_f64(setup.step_hz * delay_s),
    )
}

/// Half of the phase advance per pulse at Doppler bin 1 and frequency `k`: `f_k / (2 D f_ref)` turns.
fn half_rate(setup: &Setup, k: usize) -> Turns {
    let bins = 2.0 * f64::from(setup.doppler_length);
    let centre = Turns::from_f64(1.0 / bins);
    let step = Turns::from_f64(setup.step_hz / setup.centre_hz() / bins);
    centre.plus(step.times(k as i64 - i64::from(setup.num_frequencies / 2)))
}

/// Float32 engine on borrowed buffers.
#[derive(Debug)]
pub struct FloatEngine<'a> {
    /// `[2Q+1]` rows of `max(F, 2G + 1)` samples during processing, of `2G + 1` samples in the finished map.
    map: &'a mut [Complex32],
    /// Range transform buffer, `R` samples.
    row: &'a mut [Complex32],
    /// One frequency of all pulses, `M` samples.
    column: &'a mut [Complex32],
    /// Compensation phases, `M` values.
    phases: &'a mut [PulsePhase],
}

impl<'a> FloatEngine<'a> {
    /// Create an engine on borrowed buffers: `map` of Doppler rows times frequencies, `row` of `R` samples, `column`
    /// and `phases` of `M`, each for the maximum that the capacity states. [`Engine::holds`] checks their lengths.
    pub fn new(
        map: &'a mut [Complex32],
        row: &'a mut [Complex32],
        column: &'a mut [Complex32],
        phases: &'a mut [PulsePhase],
    ) -> Self {
        Self {
            map,
            row,
            column,
            phases,
        }
    }

    /// Motion-compensate frequency `k` of every pulse into the column buffer.
    fn compensate(&mut self, work: &Work<'_, Complex32>, k: usize) {
        let num_frequencies = usize::from(work.setup.num_frequencies);
        let scale = work.weights.get(k).copied().unwrap_or(0.0) / work.pulses.len() as f32;
        let anchor = k.is_multiple_of(ANCHOR);
        let samples = work.samples.get(k..).unwrap_or(&[]);
        let samples = samples.iter().step_by(num_frequencies.max(1));
        let pulses = work.pulses.iter().zip(self.phases.iter_mut());
        for ((out, sample), (pulse, phase)) in self.column.iter_mut().zip(samples).zip(pulses) {
            if anchor {
                let turns = phase.start.plus(phase.step.times(k as i64));
                phase.value = turns.phasor() * pulse.weight;
            } else {
                phase.value *= phase.rotation;
            }
            *out = sample * phase.value * scale;
        }
    }
}

impl Engine for FloatEngine<'_> {
    type Sample = Complex32;

    fn holds(&self, capacity: &Capacity) -> Result<(), LengthError> {
        let pulses = usize::from(capacity.pulses);
        let cells = usize::from(capacity.doppler_bins) * usize::from(capacity.frequencies);
        LengthError::at_least("map", cells, self.map.len())?;
        LengthError::at_least("range row", capacity.range_bins.into(), self.row.len())?;
        LengthError::at_least("column", pulses, self.column.len())?;
        LengthError::at_least("pulse phases", pulses, self.phases.len())
    }

    fn begin(&mut self, work: &Work<'_, Complex32>) {
        for (pulse, phase) in work.pulses.iter().zip(self.phases.iter_mut()) {
            let (start, step) = compensation(work.setup, pulse, work.patch.centre_m);
            *phase = PulsePhase {
                start,
                step,
                value: Complex32::ZERO,
                rotation: step.phasor(),
            };
        }
    }

    fn column(&mut self, work: &Work<'_, Complex32>, k: usize) {
        self.compensate(work, k);
        let num_pulses = work.pulses.len();
        let stride = work.setup.row_stride(work.patch);
        let reach = usize::from(work.patch.doppler_reach);

        // Split into pulses at u < 0 (below) and u > 0 (above), each taken from the middle outwards.
        let Some(column) = self.column.get_mut(..num_pulses) else {
            return;
        };
        let Some((below, rest)) = column.split_at_mut_checked(num_pulses / 2) else {
            return;
        };
        let odd = num_pulses % 2;
        let Some((middle, above)) = rest.split_at_mut_checked(odd) else {
            return;
        };
        let middle = middle.first().copied().unwrap_or(Complex32::ZERO);
        let mut sum = middle;
        for (early, late) in below.iter_mut().rev().zip(above.iter_mut()) {
            (*early, *late) = (*late - *early, *late + *early);
            sum += *late;
        }

        let rows = self.map.get_mut(k..).unwrap_or(&mut []);
        if let Some(zero) = rows.get_mut(reach * stride) {
            *zero = sum;
        }
        let half_rate = half_rate(work.setup, k);
        for d in 1..=reach {
            let half = half_rate.times(d as i64).phasor();
            let step = half * half;
            let mut turn = if odd == 1 { step } else { half };
            let (mut a, mut b) = (middle, Complex32::ZERO);
            for (difference, sum) in below.iter().rev().zip(above.iter()) {
                a += sum * turn.re;
                b += difference * turn.im;
                turn *= step;
            }
            if let Some(out) = rows.get_mut((reach + d) * stride) {
                *out = Complex32::new(a.re + b.im, a.im - b.re);
            }
            if let Some(out) = rows.get_mut((reach - d) * stride) {
                *out = Complex32::new(a.re - b.im, a.im + b.re);
            }
        }
    }

    fn row(&mut self, work: &Work<'_, Complex32>, row: usize) {
        let frequencies = usize::from(work.setup.num_frequencies);
        let length = usize::from(work.setup.range_length);
        let stride = work.setup.row_stride(work.patch);
        let Some(buffer) = self.row.get_mut(..length) else {
            return;
        };
        let source = self.map.get(row * stride..).unwrap_or(&[]);
        let source = source.get(..frequencies).unwrap_or(&[]);
        // Frequency k goes to index -(k - F/2) modulo R: a forward FFT then evaluates the positive exponent.
        buffer.fill(Complex32::ZERO);
        let (below, above) = source.split_at(source.len().min(frequencies / 2 + 1));
        let places = buffer.iter_mut().take(frequencies / 2 + 1).rev();
        for (place, sample) in places.zip(below) {
            *place = *sample;
        }
        for (place, sample) in buffer.iter_mut().rev().zip(above) {
            *place = *sample;
        }
        fft::forward(buffer);
        let (reach, bins) = (
            usize::from(work.patch.range_reach),
            work.patch.num_range_bins(),
        );
        // Rows shrink in place to their range gate; a gate never overwrites a row that is not yet processed.
        let gate = self.map.get_mut(row * bins..).unwrap_or(&mut []);
        let negative = buffer.iter().skip(length.saturating_sub(reach));
        for (out, value) in gate
            .iter_mut()
            .zip(negative.chain(buffer.iter().take(reach + 1)))
        {
            *out = *value;
        }
    }

    fn map(&self, work: &Work<'_, Complex32>) -> MapSamples<'_> {
        MapSamples::Float(self.map.get(..work.patch.map_len()).unwrap_or(&[]))
    }

    fn saturated(&self) -> u32 {
        0
    }
}
