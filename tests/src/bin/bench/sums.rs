//! Samples of scatterers and the image at single points by their defining sums in float64, written out here, so that no measured code is
//! its own oracle.
//!
//! ```text
//! z[n][k] = sum_s a_s exp(-j 2 pi f_k (path_n(s) - reference_path_n) / c)
//! I(p)    = sum_n sum_k w_slow[n] w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c) / (sum w_slow  sum w_fast)
//! ```
//!
//! Phasors are computed by multiplication from sample to sample: off by some roundings of 1e-16 each, 1e-12 at the end of the longest pulse.

use std::f64::consts::TAU;

use rayon::prelude::*;
use subaperture::glam::DVec3;
use subaperture::num_complex::{Complex32, Complex64};
use subaperture::phase_history::{Collection, Pulse, Weights};

const LIGHT_M_S: f64 = 299_792_458.0;

/// Scatterers or points computed together.
const TOGETHER: usize = 8;

/// A scatterer.
#[derive(Clone, Copy)]
pub(crate) struct Scatterer {
    pub(crate) position_m: DVec3,
    pub(crate) amplitude: Complex64,
}

fn turned(cycles: f64) -> Complex64 {
    Complex64::cis(TAU * (cycles - cycles.round()))
}

/// Pseudo-random numbers, uniform in -1/2 to 1/2, the same in every run.
fn numbers() -> impl FnMut() -> f64 {
    let mut state = 1u64;
    move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

/// `count` scatterers of magnitude 1 on a square.
pub(crate) fn scatterers(count: usize, side_m: f64) -> Vec<Scatterer> {
    let mut number = numbers();
    let scatterer = |_| Scatterer {
        position_m: DVec3::new(number(), number(), 0.0) * side_m,
        amplitude: turned(number()),
    };
    (0..count).map(scatterer).collect()
}

/// Delay of a point minus that of the reference, seconds.
fn delay_s(pulse: &Pulse, point_m: DVec3) -> f64 {
    (2.0 * point_m.distance(pulse.transmitter_m) - pulse.reference_path_m) / LIGHT_M_S
}

/// Recorded samples of some pulses.
pub(crate) fn samples(pulses: &[Pulse], num_samples: usize, scene: &[Scatterer]) -> Vec<Complex32> {
    let mut samples = vec![Complex32::ZERO; pulses.len() * num_samples];
    let rows = samples.par_chunks_exact_mut(num_samples).zip(pulses);
    rows.for_each(|(row, pulse)| {
        let mut sums = vec![Complex64::ZERO; num_samples];
        for together in scene.chunks(TOGETHER) {
            let [mut re, mut im, mut step_re, mut step_im] = [[0.0; TOGETHER]; 4];
            for (i, scatterer) in together.iter().enumerate() {
                let delay_s = delay_s(pulse, scatterer.position_m);
                let value = scatterer.amplitude * turned(-pulse.start_hz * delay_s);
                let step = turned(-pulse.step_hz * delay_s);
                (re[i], im[i], step_re[i], step_im[i]) = (value.re, value.im, step.re, step.im);
            }
            for sum in &mut sums {
                *sum += Complex64::new(re.iter().sum(), im.iter().sum());
                for i in 0..TOGETHER {
                    let (a, b) = (re[i], im[i]);
                    re[i] = a * step_re[i] - b * step_im[i];
                    im[i] = a * step_im[i] + b * step_re[i];
                }
            }
        }
        for (sample, sum) in row.iter_mut().zip(sums) {
            *sample = Complex32::new(sum.re as f32, sum.im as f32);
        }
    });
    samples
}

/// Image at some points: the sum over all pulses and frequencies.
pub(crate) fn image(
    collection: &Collection,
    samples: &[Complex32],
    weights: &Weights,
    points_m: &[DVec3],
) -> Vec<Complex64> {
    let scale = 1.0 / (weights.slow.iter().sum::<f64>() * weights.fast.iter().sum::<f64>());
    let groups: Vec<&[DVec3]> = points_m.chunks(TOGETHER).collect();
    let rows = samples.par_chunks_exact(collection.num_samples);
    let pulses = rows.zip(&collection.pulses).zip(&weights.slow);
    let zeros = || vec![[Complex64::ZERO; TOGETHER]; groups.len()];
    let add = |mut sums: Vec<[Complex64; TOGETHER]>,
               ((row, pulse), slow): ((&[Complex32], &Pulse), &f64)| {
        let weighted: Vec<Complex64> = row
            .iter()
            .zip(&weights.fast)
            .map(|(z, w)| Complex64::new(z.re.into(), z.im.into()) * w * slow)
            .collect();
        for (points_m, sums) in groups.iter().zip(&mut sums) {
            for (sum, value) in sums.iter_mut().zip(pulse_at(pulse, &weighted, points_m)) {
                *sum += value;
            }
        }
        sums
    };
    let both = |mut a: Vec<[Complex64; TOGETHER]>, b: Vec<[Complex64; TOGETHER]>| {
        for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
            *a += b;
        }
        a
    };
    let sums = pulses.fold(zeros, add).reduce(zeros, both);
    let mut sums: Vec<Complex64> = sums.iter().flatten().map(|sum| sum * scale).collect();
    sums.truncate(points_m.len());
    sums
}

/// Contribution of a pulse of weighted samples at up to [`TOGETHER`] points.
fn pulse_at(pulse: &Pulse, weighted: &[Complex64], points_m: &[DVec3]) -> [Complex64; TOGETHER] {
    let [mut step_re, mut step_im, mut re, mut im] = [[0.0; TOGETHER]; 4];
    for (i, &point_m) in points_m.iter().enumerate() {
        let step = turned(pulse.step_hz * delay_s(pulse, point_m));
        (step_re[i], step_im[i]) = (step.re, step.im);
    }
    // A polynomial in the step, evaluated from its last coefficient.
    for z in weighted.iter().rev() {
        for i in 0..TOGETHER {
            let (a, b) = (re[i], im[i]);
            re[i] = a * step_re[i] - b * step_im[i] + z.re;
            im[i] = a * step_im[i] + b * step_re[i] + z.im;
        }
    }
    let mut sums = [Complex64::ZERO; TOGETHER];
    for (i, &point_m) in points_m.iter().enumerate() {
        let start = turned(pulse.start_hz * delay_s(pulse, point_m));
        sums[i] = Complex64::new(re[i], im[i]) * start;
    }
    sums
}
