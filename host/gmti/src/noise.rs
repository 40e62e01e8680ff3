//! Errors of sums of powers over the pixels of a target, by noise and by clutter that remains.
//!
//! White noise, and scatterers of equal power everywhere, pass the sum that forms a pixel, with the weights `w` over frequency and slow time. Both have the spectrum `w^2` in the image, and unit noise in the pixels `p` and `q` has the correlation
//!
//! ```text
//! <n_p n_q*> = sum_k w_k^2 exp(+j theta_k (x_p - x_q)) / sum_k w_k^2
//! ```
//!
//! `k` counts the samples over frequency and slow time, and `theta_k x_p` is the phase of sample `k` in pixel `p`. In first order, noise changes the power of a pixel of amplitude `s_p` by `2 Re(s_p* n_p)`. Two sums of powers with the factors `a_p` and `b_p`
//! have the covariance
//!
//! ```text
//! 2 Re sum_pq a_p b_q s_p* s_q <n_p n_q*> = 2 Re sum_k w_k^2 A_k* B_k / sum_k w_k^2,   A_k = sum_p a_p s_p exp(-j theta_k x_p).
//! ```
//!
//! The second form has no sum over pairs of pixels. The measured amplitudes take the place of `s_p`: their noise raises the variance by the order of `1 / SNR`.
//!
//! The phase is taken as linear in frequency at the middle of the aperture, and linear in slow time at the centre frequency: migration between the pixels of a target is neglected.

use std::f64::consts::TAU;

use num_complex::Complex64;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::window::Window;

/// Samples of the spectrum for each resolution cell between the outermost pixels. With `n` samples the midpoint rule repeats the correlation after `n` cells, twice the distance of these pixels.
const SAMPLES_A_CELL: f64 = 2.0;

/// Samples of the spectrum for a target of one pixel: the correlation of pixels closer than 8 cells.
const MARGIN: usize = 16;

/// Spectrum of noise in an image.
pub(crate) struct NoiseSpectrum<'a> {
    /// Windows over frequency and slow time.
    pub(crate) windows: [Window; 2],
    /// Track that determines path and path rate.
    pub(crate) track: &'a SubCpi,
    /// Grid of the image's pixels.
    pub(crate) grid: &'a ImageGrid,
    /// Resolution cells of path, metres, and path rate, metres per pulse: speed of light over bandwidth, and wavelength over number of pulses.
    pub(crate) cells: [f64; 2],
    /// Frequency of sample `K/2`, the reference of phases, hertz.
    pub(crate) centre_hz: f64,
}

/// Pixel of a target.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Echo {
    /// Path and path rate, resolution cells.
    place: [f64; 2],
    /// Amplitude in units of the noise, without the carrier of the image.
    amplitude: Complex64,
}

impl Echo {
    /// Ratio of the power to that of noise.
    pub(crate) fn power(&self) -> f64 {
        self.amplitude.norm_sqr()
    }
}

impl NoiseSpectrum<'_> {
    /// Echo of the pixel with this index and amplitude.
    pub(crate) fn echo(&self, pixel: usize, amplitude: Complex64) -> Echo {
        let columns = self.grid.columns.count;
        let position_m = self.grid.position_m(pixel / columns, pixel % columns);
        let (path_m, rate) = self.track.path_and_rate(position_m);
        let cycles = self.centre_hz * path_m / SPEED_OF_LIGHT_M_S;
        Echo {
            place: [path_m / self.cells[0], rate / self.cells[1]],
            amplitude: amplitude * Complex64::cis(-TAU * cycles.fract()),
        }
    }

    /// Covariance of sums of the powers of `echoes` with the factors `factors(p)`.
    pub(crate) fn covariance<const N: usize>(
        &self,
        echoes: &[Echo],
        factors: impl Fn(usize) -> [f64; N],
    ) -> [[f64; N]; N] {
        let [fast, slow] = [0, 1].map(|axis| self.samples(echoes, axis));
        let echoes = echoes.iter().enumerate();
        let terms: Vec<[Complex64; N]> = echoes
            .map(|(p, echo)| factors(p).map(|factor| echo.amplitude * factor))
            .collect();
        let mut covariance = [[0.0; N]; N];
        for Sample { share, phases } in &fast {
            let turned = terms.iter().zip(phases);
            let turned: Vec<[Complex64; N]> = turned
                .map(|(terms, phase)| terms.map(|term| term * phase))
                .collect();
            for own in &slow {
                let mut sums = [Complex64::ZERO; N];
                for (terms, phase) in turned.iter().zip(&own.phases) {
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        *sum += term * phase;
                    }
                }
                let share = share * own.share;
                for (line, a) in covariance.iter_mut().zip(sums) {
                    for (element, b) in line.iter_mut().zip(sums) {
                        *element += 2.0 * share * (a.conj() * b).re;
                    }
                }
            }
        }
        covariance
    }

    /// Samples of the spectrum along an axis.
    fn samples(&self, echoes: &[Echo], axis: usize) -> Vec<Sample> {
        let places = echoes.iter().map(|echo| echo.place[axis]);
        let ends = [f64::INFINITY, f64::NEG_INFINITY];
        let [low, high] = places.fold(ends, |[low, high], x| [low.min(x), high.max(x)]);
        let count = (SAMPLES_A_CELL * (high - low)).ceil() as usize + MARGIN;
        let weights = self.windows[axis].weights(count);
        let total: f64 = weights.iter().map(|weight| weight * weight).sum();
        let sample = |(k, weight): (usize, &f64)| {
            let cycles = (k as f64 + 0.5) / count as f64 - 0.5;
            let phase = |echo: &Echo| Complex64::cis(-TAU * cycles * (echo.place[axis] - low));
            Sample {
                share: weight * weight / total,
                phases: echoes.iter().map(phase).collect(),
            }
        };
        weights.iter().enumerate().map(sample).collect()
    }
}

/// Sample of the spectrum along an axis.
struct Sample {
    /// Share of the power of noise.
    share: f64,
    /// Conjugate phase factor of each echo.
    phases: Vec<Complex64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const CENTRE_HZ: f64 = 10e9;
    const BANDWIDTH_HZ: f64 = 150e6;
    const RANGE_M: f64 = 5000.0;
    const PULSES: usize = 64;
    const SAMPLES: usize = 32;
    /// Track of 130 m.
    const STEP_M: f64 = 130.0 / PULSES as f64;

    fn antenna_m(offset: f64) -> DVec3 {
        DVec3::new(offset * STEP_M, -RANGE_M, 0.0)
    }

    /// Covariances by the sum over pairs of pixels, with the exact path of every pulse and the sample of every frequency, on a grid that is rotated against the track.
    #[test]
    fn covariance_agrees_with_the_sum_over_pairs_of_pixels() {
        let half = (((PULSES * PULSES - 1) as f64) / 12.0).sqrt();
        let nodes = [-half, half].map(|offset| [antenna_m(offset); 2]);
        let track = SubCpi::from_nodes(PULSES, nodes);
        let mut grid: ImageGrid = "x=-1.2:1.2:0.3,y=-1.5:1.5:0.5,z=0".parse().unwrap();
        let (sin, cos) = libm::sincos(0.4);
        [grid.x_axis, grid.y_axis] = [DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0)];
        let windows = [Window::default(), Window::Hamming];
        let noise = NoiseSpectrum {
            windows,
            track: &track,
            grid: &grid,
            cells: [
                SPEED_OF_LIGHT_M_S / BANDWIDTH_HZ,
                SPEED_OF_LIGHT_M_S / CENTRE_HZ / PULSES as f64,
            ],
            centre_hz: CENTRE_HZ,
        };
        let count = grid.rows.count * grid.columns.count;
        let position_m = |p: usize| grid.position_m(p / grid.columns.count, p % grid.columns.count);
        let weights = [windows[0].weights(SAMPLES), windows[1].weights(PULSES)];
        // Phase factor of each sample in each pixel.
        let phases = |p: usize| -> Vec<Complex64> {
            let of_pulse = |n: usize| {
                let antenna_m = antenna_m(n as f64 - 0.5 * (PULSES - 1) as f64);
                let delay_s = 2.0 * position_m(p).distance(antenna_m) / SPEED_OF_LIGHT_M_S;
                (0..SAMPLES).map(move |k| {
                    let offset = (k as f64 + 0.5) / SAMPLES as f64 - 0.5;
                    let cycles = (CENTRE_HZ + offset * BANDWIDTH_HZ) * delay_s;
                    Complex64::cis(TAU * cycles.fract())
                })
            };
            (0..PULSES).flat_map(of_pulse).collect()
        };
        let phases: Vec<Vec<Complex64>> = (0..count).map(phases).collect();
        let weight = |i: usize| weights[0][i % SAMPLES] * weights[1][i / SAMPLES];
        let squares: Vec<f64> = (0..SAMPLES * PULSES).map(|i| weight(i).powi(2)).collect();
        let total: f64 = squares.iter().sum();
        let correlation = |p: usize, q: usize| {
            let terms = squares.iter().zip(phases[p].iter().zip(&phases[q]));
            terms
                .map(|(w, (a, b))| w * (a * b.conj()))
                .sum::<Complex64>()
                / total
        };
        // Response of a point target in the middle, and factors without symmetry.
        let middle = count / 2;
        let amplitude = |p: usize| {
            let terms = phases[p].iter().zip(&phases[middle]).enumerate();
            terms
                .map(|(i, (a, b))| weight(i) * (a * b.conj()))
                .sum::<Complex64>()
        };
        let amplitudes: Vec<Complex64> = (0..count).map(amplitude).collect();
        let factor = |p: usize| {
            let (row, column) = (p / grid.columns.count, p % grid.columns.count);
            [row as f64 - 3.0, column as f64 - 2.0]
        };
        let mut expected = [[0.0; 2]; 2];
        for p in 0..count {
            for q in 0..count {
                let power = 2.0 * (amplitudes[p].conj() * amplitudes[q] * correlation(p, q)).re;
                let (a, b) = (factor(p), factor(q));
                for i in [0, 1] {
                    for j in [0, 1] {
                        expected[i][j] += a[i] * b[j] * power;
                    }
                }
            }
        }
        let echoes: Vec<Echo> = (0..count).map(|p| noise.echo(p, amplitudes[p])).collect();
        let found = noise.covariance(&echoes, factor);
        println!("{found:?}, expected {expected:?}");
        let scale = expected[0][0].min(expected[1][1]);
        // Pixels are up to 2.9 cells from the target along the track. Migration changes a phase by up to 2 pi 2.9 (1.5 % / 2) / 2 = 0.068 rad at the ends of band and aperture, with both signs: relative to a spectrum that is symmetric, by 0.068^2 / 2.
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!(
                (found - expected).abs() < 2.3e-3 * scale,
                "{found} {expected}"
            );
        }
    }
}
