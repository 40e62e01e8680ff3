//! Keystone and Doppler transforms combined: a discrete Fourier transform over slow time whose frequency axis scales
//! with the radio frequency.
//!
//! For frequency `k` with scale `s_k = f_k / f_c`,
//!
//! ```text
//! X_k[d] = sum_m a_k[m] x[m] exp(+j 2 pi s_k delta (m - m_c) (d - d_c))
//! ```
//!
//! With [`Shape::input_drift`], the pulses of frequency `k` are taken `input_drift (k - K/2)` pulses later: `m_c` is
//! lower by this amount. This models the samples of a sweep, which have exact times of their own.
//!
//! In this sum, a scatterer whose path changes by `v` metres per pulse, with phase `-2 pi f_k v m / c`, has its peak at
//! the same `d` for every `k`. This removes range migration like the Keystone transform of Schone 2020 (2.26), but
//! without resampling in slow time, so that no edge of the sub-CPI is lost or doubled.
//!
//! Evaluated by Bluestein's chirp-z identity `2 m d = m^2 + d^2 - (d - m)^2`: two FFTs of length `L >= M + D - 1` per
//! frequency. Tables are computed in float64 and stored in float32.
//!
//! Memory: `K (M + D + L)` complex float32. Error: about 3e-7 relative (float32 FFTs); see the test.

use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{Fft, Transforms};

use super::fast_length::fast_length;
use super::phase::{narrow, phasor};

/// Dimensions and axes of a [`ScaledDft`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Number of input pulses, `M`.
    pub inputs: usize,
    /// Pulse index of zero phase, `m_c`, at frequency `K/2`.
    pub input_centre: f64,
    /// Decrease of that index from one frequency to the next, pulses.
    pub input_drift: f64,
    /// Number of Doppler bins, `D`.
    pub outputs: usize,
    /// Bin index of zero Doppler, `d_c`.
    pub output_centre: f64,
    /// Doppler bin spacing `delta`, cycles per pulse at `f_c`; its sign is that of the exponent.
    pub spacing: f64,
}

impl Shape {
    /// Pulse index of zero phase at frequency `k` of `count`.
    #[inline]
    pub fn centre_of(&self, k: usize, count: usize) -> f64 {
        self.input_centre - self.input_drift * (k as f64 - (count / 2) as f64)
    }
}

/// Scaled Doppler transform for every frequency of a band.
pub struct ScaledDft {
    shape: Shape,
    before: Vec<Complex32>,
    kernel: Vec<Complex32>,
    after: Vec<Complex32>,
    forward: Arc<dyn Fft<f32>>,
    inverse: Arc<dyn Fft<f32>>,
}

impl ScaledDft {
    /// Plan the transform for `scales[k] = f_k / f_c`; `input_weight(k, m)` is `a_k[m]`.
    pub fn new(
        transforms: Transforms,
        scales: &[f64],
        shape: Shape,
        input_weight: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let Shape {
            inputs,
            input_centre: _,
            input_drift: _,
            outputs,
            output_centre,
            spacing,
        } = shape;
        let length = fast_length(inputs + outputs - 1);
        let (forward, inverse) = (transforms.forward(length), transforms.inverse(length));
        let forward64 = transforms.forward(length);
        let chirp = |scale: f64, i: f64| phasor(0.5 * scale * spacing * i * i);
        let mut before = Vec::with_capacity(scales.len() * inputs);
        let mut kernel = Vec::with_capacity(scales.len() * length);
        let mut after = Vec::with_capacity(scales.len() * outputs);
        let mut row = vec![Complex64::ZERO; length];
        for (k, &scale) in scales.iter().enumerate() {
            let input_centre = shape.centre_of(k, scales.len());
            before.extend(
                (0..inputs)
                    .map(|m| narrow(chirp(scale, m as f64 - input_centre) * input_weight(k, m))),
            );
            after.extend((0..outputs).map(|d| narrow(chirp(scale, d as f64 - output_centre))));
            row.fill(Complex64::ZERO);
            let first = 1 - inputs as isize;
            for i in first..outputs as isize {
                let place = i.rem_euclid(length as isize) as usize;
                // Includes the 1 / L of the inverse transform.
                row[place] =
                    chirp(scale, i as f64 + input_centre - output_centre).conj() / length as f64;
            }
            forward64.process(&mut row);
            kernel.extend(row.iter().copied().map(narrow));
        }
        Self {
            shape,
            before,
            kernel,
            after,
            forward,
            inverse,
        }
    }

    /// Dimensions and axes for which it was planned.
    #[inline]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Memory of the tables for a band of `frequencies`, bytes.
    pub fn table_bytes(frequencies: usize, inputs: usize, outputs: usize) -> u64 {
        8 * (frequencies * (inputs + outputs + fast_length(inputs + outputs - 1))) as u64
    }

    /// Number of complex scratch values required by [`Self::transform`].
    pub fn scratch_length(&self) -> usize {
        let extra = self
            .forward
            .get_inplace_scratch_len()
            .max(self.inverse.get_inplace_scratch_len());
        self.forward.len() + extra
    }

    /// Transform the slow-time row `x` (`M` values) of frequency `k`, and call `output(d, value)` for each Doppler bin
    /// in order.
    ///
    /// # Panics
    /// If a length is wrong.
    #[inline]
    pub fn transform(
        &self,
        k: usize,
        x: &[Complex32],
        scratch: &mut [Complex32],
        mut output: impl FnMut(usize, Complex32),
    ) {
        let Shape {
            inputs, outputs, ..
        } = self.shape;
        assert_eq!(x.len(), inputs);
        let length = self.forward.len();
        let (work, scratch) = scratch.split_at_mut(length);
        let before = &self.before[k * inputs..(k + 1) * inputs];
        for ((w, x), b) in work.iter_mut().zip(x).zip(before) {
            *w = x * b;
        }
        work[inputs..].fill(Complex32::ZERO);
        self.forward.process_with_scratch(work, scratch);
        for (w, h) in work
            .iter_mut()
            .zip(&self.kernel[k * length..(k + 1) * length])
        {
            *w *= h;
        }
        self.inverse.process_with_scratch(work, scratch);
        let after = &self.after[k * outputs..(k + 1) * outputs];
        for (d, (w, a)) in work.iter().zip(after).enumerate() {
            output(d, w * a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scaled_dft_matches_direct_sum() {
        let scales = [0.97, 1.0, 1.033];
        for (inputs, outputs, spacing, input_drift) in [
            (1, 4, 0.5, 0.0),
            (1, 4, 0.5, 0.3),
            (39, 22, 1.0 / 78.0, 0.0),
            (130, 300, -1.0 / 256.0, -0.4),
        ] {
            let shape = Shape {
                inputs,
                input_centre: (inputs as f64 - 1.0) / 2.0,
                input_drift,
                outputs,
                output_centre: outputs as f64 / 2.0 - 0.25,
                spacing,
            };
            let weight = |k: usize, m: usize| 1.0 + 0.1 * (k as f64) - 0.001 * m as f64;
            let dft = ScaledDft::new(Transforms::Fastest, &scales, shape, weight);
            let x: Vec<Complex32> = (0..inputs)
                .map(|m| Complex32::cis((m * m) as f32 * 0.37).scale(1.0 + m as f32 * 0.01))
                .collect();
            let mut scratch = vec![Complex32::ZERO; dft.scratch_length()];
            let (mut error, mut power) = (0.0, 0.0);
            for (k, scale) in scales.iter().enumerate() {
                dft.transform(k, &x, &mut scratch, |d, got| {
                    let expected: Complex64 = x
                        .iter()
                        .enumerate()
                        .map(|(m, x)| {
                            let turns = scale
                                * spacing
                                * (m as f64 - shape.input_centre + input_drift * (k as f64 - 1.0))
                                * (d as f64 - shape.output_centre);
                            Complex64::new(x.re.into(), x.im.into())
                                * weight(k, m)
                                * Complex64::cis(std::f64::consts::TAU * turns)
                        })
                        .sum();
                    error += (Complex64::new(got.re.into(), got.im.into()) - expected).norm_sqr();
                    power += expected.norm_sqr();
                });
            }
            let db = 10.0 * f64::log10(error / power);
            println!("{inputs} pulses, {outputs} bins: {db:.1} dB");
            // float32 with two FFTs of up to 2^9: 6e-8 * sqrt(2 * 9) times a few = 1e-6.
            assert!(db < -120.0, "{inputs} {outputs}: {db}");
        }
    }
}
