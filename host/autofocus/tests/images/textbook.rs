//! Textbook phase gradient autofocus, an oracle that shares no code with the methods under test.
//!
//! Wahl, Eichel, Ghiglia and Jakowatz, Phase gradient autofocus, a robust tool for high resolution SAR phase correction, IEEE Trans.
//! AES 30(3), 1994. The scene is a small far one, so that the history of a range line is the recording compensated to the line's
//! middle and compressed in range there, and an image line is its discrete Fourier transform over the pulses. An iteration
//!
//! 1. shifts the brightest pixel of every range line to the middle;
//! 2. windows all lines equally: 1.5 times the width within which the energy summed over the lines is within 10 dB of its peak;
//! 3. estimates the phase gradient over all range lines, by linear unbiased minimum variance or by maximum likelihood;
//! 4. integrates the gradient, removes the linear trend and corrects all lines.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_model::phase_history::PhaseHistory;

use super::C_M_S;

/// Estimator of the phase gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kernel {
    /// `sum Im(g* g') / sum |g|^2`, the linear unbiased minimum variance estimate.
    Variance,
    /// `arg sum g*[n] g[n+1]`, the maximum likelihood estimate.
    Likelihood,
}

/// Histories of range lines with centres `lines_m`, one value per pulse.
pub(crate) fn range_lines(history: &dyn PhaseHistory, lines_m: &[DVec3]) -> Vec<Vec<Complex64>> {
    let collection = history.collection();
    let (pulses, width) = (collection.pulses.len(), collection.num_samples);
    let mut samples = vec![Complex32::ZERO; pulses * width];
    history.read(0..pulses, &mut samples).unwrap();
    let line = |line_m: &DVec3| {
        let value = |n: usize| -> Complex64 {
            let pulse = &collection.pulses[n];
            let delay_s = 2.0 * line_m.distance(pulse.receiver_m) / C_M_S;
            let samples = samples[n * width..(n + 1) * width].iter().enumerate();
            samples
                .map(|(k, z)| {
                    let hz = pulse.start_hz + k as f64 * pulse.step_hz;
                    let turns = (hz * delay_s).fract();
                    Complex64::new(z.re.into(), z.im.into())
                        * Complex64::cis(std::f64::consts::TAU * turns)
                })
                .sum()
        };
        (0..pulses).map(value).collect()
    };
    lines_m.iter().map(line).collect()
}

/// Discrete Fourier transform by its definition; frequency zero is at the centre of the result.
fn transform(values: &[Complex64], sign: f64) -> Vec<Complex64> {
    let count = values.len();
    let roots: Vec<Complex64> = (0..count)
        .map(|i| Complex64::cis(sign * std::f64::consts::TAU * i as f64 / count as f64))
        .collect();
    let half = count / 2;
    let at = |i: usize| -> Complex64 {
        let each = values.iter().enumerate();
        each.map(|(n, v)| v * roots[((i + count - half) * (n + count - half)) % count])
            .sum::<Complex64>()
            / (count as f64).sqrt()
    };
    (0..count).map(at).collect()
}

/// Phase error of every pulse, radians, after `most` iterations.
pub(crate) fn phase_error_rad(
    mut lines: Vec<Vec<Complex64>>,
    kernel: Kernel,
    most: usize,
) -> Vec<f64> {
    let count = lines[0].len();
    let half = count / 2;
    let mut all = vec![0.0; count];
    for _ in 0..most {
        let mut images: Vec<Vec<Complex64>> =
            lines.iter().map(|line| transform(line, -1.0)).collect();
        for image in &mut images {
            let power = |i: usize| image[i].norm_sqr();
            let brightest = (0..count)
                .max_by(|&a, &b| power(a).total_cmp(&power(b)))
                .unwrap();
            image.rotate_left((brightest + count - half) % count);
        }
        let energy: Vec<f64> = (0..count)
            .map(|i| images.iter().map(|image| image[i].norm_sqr()).sum())
            .collect();
        // Contiguous interval about the centre.
        let within = |i: &usize| energy[*i] > 0.1 * energy[half];
        let right = (half..count).take_while(within).count();
        let left = (0..=half).rev().take_while(within).count();
        let wide = (1.5 * (left + right) as f64).ceil() as usize;
        for image in &mut images {
            for (i, value) in image.iter_mut().enumerate() {
                if 2 * i.abs_diff(half) > wide {
                    *value = Complex64::ZERO;
                }
            }
        }
        let windowed: Vec<Vec<Complex64>> =
            images.iter().map(|image| transform(image, 1.0)).collect();
        let mut phases = vec![0.0; count];
        for n in 1..count {
            let product: Complex64 = windowed.iter().map(|g| g[n - 1].conj() * g[n]).sum();
            let step = match kernel {
                Kernel::Likelihood => product.arg(),
                Kernel::Variance => {
                    let power: f64 = windowed.iter().map(|g| g[n].norm_sqr()).sum();
                    product.im / power
                }
            };
            phases[n] = phases[n - 1] + step;
        }
        without_trend(&mut phases);
        for (n, phase) in phases.iter().enumerate() {
            all[n] += phase;
            for line in &mut lines {
                line[n] *= Complex64::cis(-phase);
            }
        }
        let rms = (phases.iter().map(|p| p * p).sum::<f64>() / count as f64).sqrt();
        if rms < 0.02 {
            break;
        }
    }
    all
}

/// Remove constant and slope by least squares.
pub(crate) fn without_trend(values: &mut [f64]) {
    let count = values.len() as f64;
    let middle = (count - 1.0) / 2.0;
    let mean = values.iter().sum::<f64>() / count;
    let (mut up, mut down) = (0.0, 0.0);
    for (n, value) in values.iter().enumerate() {
        let u = n as f64 - middle;
        up += u * value;
        down += u * u;
    }
    for (n, value) in values.iter_mut().enumerate() {
        *value -= mean + up / down * (n as f64 - middle);
    }
}

/// Rms difference of an error and its estimate modulo whole turns, without constant and slope; the slope maximises the sum of
/// the phasors.
pub(crate) fn residual_rad(error_rad: &[f64], found_rad: &[f64]) -> f64 {
    let left: Vec<f64> = error_rad
        .iter()
        .zip(found_rad)
        .map(|(a, b)| a - b)
        .collect();
    let count = left.len();
    let sum = |slope: f64| -> Complex64 {
        let each = left.iter().enumerate();
        each.map(|(n, x)| Complex64::cis(x - slope * n as f64))
            .sum()
    };
    let fine = std::f64::consts::TAU / (8 * count) as f64;
    let slope = (0..8 * count)
        .map(|i| i as f64 * fine)
        .max_by(|&a, &b| sum(a).norm_sqr().total_cmp(&sum(b).norm_sqr()))
        .unwrap();
    let constant = sum(slope).arg();
    let wrapped = |(n, x): (usize, &f64)| {
        let y = x - slope * n as f64 - constant;
        y - std::f64::consts::TAU * (y / std::f64::consts::TAU).round()
    };
    let mut left: Vec<f64> = left.iter().enumerate().map(wrapped).collect();
    without_trend(&mut left);
    (left.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt()
}
