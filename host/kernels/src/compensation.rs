//! Compensation of a pulse's samples to another reference path: a phase ramp over frequency.
//!
//! ```text
//! out[k] = w[k] z[k] exp(+j 2 pi (a + b k)) s,    k = 0 .. K-1
//! ```
//!
//! The phase is a [`Ramp`]: a float64 phasor recurrence, with an error of `K`
//! roundings of 2.5e-16, rounded to float32 at each sample: 3e-7 of a sample in total. By groups ([`GroupRamp`]) it is the product of two
//! rounded phasors, of the group's first sample and relative to it: 5e-7.

use num_complex::{Complex32, Complex64};
use subaperture_signal::phase::{narrow, phasor};

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};

/// Phase ramp `exp(j 2 pi (a + b k))` times a factor, for `k` = 0, 1, ...
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    turn: Complex64,
    step: Complex64,
}

impl Ramp {
    /// Ramp from `start_turns` in steps of `step_turns` (cycles), times `factor`.
    #[inline]
    pub fn new(start_turns: f64, step_turns: f64, factor: f64) -> Self {
        Self {
            turn: phasor(start_turns) * factor,
            step: phasor(step_turns),
        }
    }
}

impl Iterator for Ramp {
    type Item = Complex64;

    #[inline]
    fn next(&mut self) -> Option<Complex64> {
        let turn = self.turn;
        self.turn *= self.step;
        Some(turn)
    }
}

/// Multiply samples by ramp and weights in place; ramp and weights are multiplied in float64.
///
/// # Panics
/// If the numbers of weights and samples differ.
#[inline]
pub fn refer(samples: &mut [Complex32], weights: &[f64], ramp: Ramp) {
    assert_eq!(samples.len(), weights.len());
    for ((z, w), turn) in samples.iter_mut().zip(weights).zip(ramp) {
        *z *= narrow(turn * w);
    }
}

/// Ramp by groups of samples.
#[derive(Clone, Copy, Debug)]
pub struct GroupRamp {
    turn: Complex64,
    /// Phasor from group to group.
    step: Complex64,
    /// Phasors of a group's samples relative to the first: cosines and sines.
    within: [[f32; GROUP]; 2],
}

impl GroupRamp {
    /// Convert a ramp.
    #[inline]
    pub fn new(Ramp { turn, step }: Ramp) -> Self {
        let [mut cos, mut sin] = [[0.0; GROUP]; 2];
        let mut from_first = Complex64::ONE;
        for (cos, sin) in cos.iter_mut().zip(&mut sin) {
            (*cos, *sin) = (from_first.re as f32, from_first.im as f32);
            from_first *= step;
        }
        Self {
            turn,
            step: from_first,
            within: [cos, sin],
        }
    }
}

/// Compensate and weight samples of several pulses into planes `[pulse][real, imaginary][stride]`, one pulse per ramp. Pulses are `row_length`
/// apart in `rows`; of each, the first samples are used, one per weight. The ramps advance by whole groups of samples.
/// Values beyond the samples, up to a whole group, become 0.
///
/// # Panics
/// If lengths are inconsistent, or the stride is not a multiple of [`GROUP`].
pub fn refer_to_planes(
    instructions: Instructions,
    rows: &[Complex32],
    row_length: usize,
    weights: &[f32],
    ramps: &mut [GroupRamp],
    planes: &mut [f32],
    stride: usize,
) {
    assert!(stride.is_multiple_of(GROUP) && weights.len() <= stride);
    assert!(ramps.is_empty() || rows.len() >= (ramps.len() - 1) * row_length + weights.len());
    assert!(planes.len() >= 2 * stride * ramps.len());
    instructions.run(ToPlanes {
        rows,
        row_length,
        weights,
        ramps,
        planes,
        stride,
    });
}

struct ToPlanes<'a> {
    rows: &'a [Complex32],
    row_length: usize,
    weights: &'a [f32],
    ramps: &'a mut [GroupRamp],
    planes: &'a mut [f32],
    stride: usize,
}

impl Kernel for ToPlanes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let count = self.weights.len();
        let pulses = self.planes.chunks_exact_mut(2 * self.stride);
        for (pulse, (ramp, planes)) in self.ramps.iter_mut().zip(pulses).enumerate() {
            let row = &self.rows[pulse * self.row_length..][..count];
            let (real, imaginary) = planes.split_at_mut(self.stride);
            for first in (0..count).step_by(GROUP) {
                let (mut parts, mut weights) = ([[0.0f32; GROUP]; 2], [0.0f32; GROUP]);
                let width = GROUP.min(count - first);
                if width == GROUP {
                    // Constant length, for vectorisation.
                    for (i, z) in row[first..first + GROUP].iter().enumerate() {
                        (parts[0][i], parts[1][i]) = (z.re, z.im);
                    }
                    weights.copy_from_slice(&self.weights[first..first + GROUP]);
                } else {
                    for (i, z) in row[first..].iter().enumerate() {
                        (parts[0][i], parts[1][i]) = (z.re, z.im);
                    }
                    weights[..width].copy_from_slice(&self.weights[first..]);
                }
                let re = lanes.splat(ramp.turn.re as f32);
                let im = lanes.splat(ramp.turn.im as f32);
                for i in (0..GROUP).step_by(L::COUNT) {
                    let [cos, sin] = [&ramp.within[0][i..], &ramp.within[1][i..]];
                    let [cos, sin] = [lanes.load(cos), lanes.load(sin)];
                    let turn_re = lanes.neg_mul_add(im, sin, lanes.mul(re, cos));
                    let turn_im = lanes.mul_add(im, cos, lanes.mul(re, sin));
                    let weight = lanes.load(&weights[i..]);
                    let (a, b) = (lanes.load(&parts[0][i..]), lanes.load(&parts[1][i..]));
                    let (a, b) = (lanes.mul(a, weight), lanes.mul(b, weight));
                    let out_re = lanes.neg_mul_add(b, turn_im, lanes.mul(a, turn_re));
                    let out_im = lanes.mul_add(b, turn_re, lanes.mul(a, turn_im));
                    lanes.store(out_re, &mut real[first + i..]);
                    lanes.store(out_im, &mut imaginary[first + i..]);
                }
                ramp.turn *= ramp.step;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, turned, wide};

    #[test]
    fn phase_ramp_error_is_within_bound() {
        let (start, step, count) = (-12_345.678, 0.0123, 100_000);
        let last = Ramp::new(start, step, 3.0).nth(count).unwrap();
        let expected = turned(start + step * count as f64) * 3.0;
        // Each product and the step's phase and sine are rounded to 2.5e-16; start and last to 1e-12.
        let allowed = 3.0 * (count as f64 * 5e-16 + 1e-11);
        assert!((last - expected).norm() < allowed, "{last} {expected}");
    }

    /// Error for a sample of magnitude 1: phasor (4e-8 per part), product (1.3e-7), weight (8e-8).
    #[test]
    fn refer_multiplies_samples_by_ramp_and_weights() {
        let mut numbers = Numbers::new(1);
        let samples = numbers.samples(301);
        let weights: Vec<f64> = (0..301).map(|_| numbers.unit()).collect();
        let (start, step, factor) = (831.25, -0.377, 0.75);
        let ramp = Ramp::new(start, step, factor);
        let plain = |k: usize| wide(samples[k]) * turned(start + step * k as f64) * factor;

        let mut in_place = samples.clone();
        refer(&mut in_place, &weights, ramp);
        for k in 0..301 {
            let weighted = plain(k) * weights[k];
            let error = (wide(in_place[k]) - weighted).norm();
            assert!(error < 3e-7, "{k}: {error}");
        }
    }

    /// As above, plus another phasor rounding (8e-8) and product (1.3e-7).
    #[test]
    fn refer_to_planes_compensates_several_pulses() {
        let (count, row_length, stride) = (77, 90, 96);
        let mut numbers = Numbers::new(2);
        let rows = numbers.samples(3 * row_length);
        let weights: Vec<f32> = (0..count).map(|_| numbers.unit() as f32).collect();
        let pulses = [(831.25, -0.377, 0.75), (0.1, 0.013, 1.0), (-5.5, 0.0, 0.5)];
        let all = |instructions| {
            let ramp = |&(start, step, factor)| GroupRamp::new(Ramp::new(start, step, factor));
            let mut ramps: Vec<GroupRamp> = pulses.iter().map(ramp).collect();
            let mut planes = vec![7.0f32; 3 * 2 * stride];
            // In two calls, the first of whole groups.
            let cut = 48;
            for part in [0..cut, cut..count] {
                let (from, to) = (&rows[part.start..], &mut planes[part.start..]);
                let own = &weights[part.clone()];
                let mut moved = vec![7.0f32; 3 * 2 * stride];
                refer_to_planes(
                    instructions,
                    from,
                    row_length,
                    own,
                    &mut ramps,
                    &mut moved,
                    stride,
                );
                for (to, from) in to.chunks_mut(stride).zip(moved.chunks(stride)) {
                    let whole = part.len().next_multiple_of(GROUP);
                    to[..whole].copy_from_slice(&from[..whole]);
                }
            }
            planes
        };
        let planes = all(Instructions::Portable);
        for (n, (start, step, factor)) in pulses.into_iter().enumerate() {
            let [re, im] = [0, 1].map(|part| &planes[(2 * n + part) * stride..][..stride]);
            for (k, (&re, &im)) in re.iter().zip(im).enumerate() {
                let got = Complex64::new(re.into(), im.into());
                if k >= count {
                    // 0 up to a whole group, unchanged beyond.
                    let left = if k < 80 { 0.0 } else { 7.0 };
                    assert_eq!(got, Complex64::new(left, left));
                    continue;
                }
                let turn = turned(start + step * k as f64) * factor * f64::from(weights[k]);
                let error = (got - wide(rows[n * row_length + k]) * turn).norm();
                assert!(error < 5e-7, "{n} {k}: {error}");
            }
        }
        for instructions in Instructions::available() {
            assert!(all(instructions) == planes, "{}", instructions.name());
        }
    }
}
