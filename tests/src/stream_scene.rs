//! Simulated pulses and float64 maps for tests of the streaming core; shares no code with it.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex32, Complex64};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture_core::Pulse;
use subaperture_core::stream::{Patch, PatchMap, Setup};

const C: f64 = 299_792_458.0;

/// A run of simulated pulses with its settings.
pub struct Scene {
    /// Settings.
    pub setup: Setup,
    /// Fast-time weights; they sum to 1.
    pub weights: Vec<f32>,
    /// Patches.
    pub patches: Vec<Patch>,
    /// Pulses, numbered from 0.
    pub pulses: Vec<Pulse>,
    /// Their samples.
    pub samples: Vec<Vec<Complex32>>,
}

/// A patch.
pub fn patch(centre_m: [f64; 3], range_reach: u16, doppler_reach: u16) -> Patch {
    Patch {
        centre_m,
        range_reach,
        doppler_reach,
    }
}

/// All samples of a map by row, in the map's own indexing.
pub fn at(map: &PatchMap<'_>) -> Vec<Complex32> {
    let patch = &map.header.patch;
    let (q, g) = (i32::from(patch.doppler_reach), i32::from(patch.range_reach));
    (-q..=q)
        .flat_map(|d| (-g..=g).map(move |r| (d, r)))
        .map(|(d, r)| map.at(d, r))
        .collect()
}

/// Relative RMS error, dB.
///
/// # Panics
/// If the lengths differ.
pub fn relative_error_db(got: &[Complex32], exact: &[Complex64]) -> f64 {
    assert_eq!(got.len(), exact.len());
    let wide = |z: &Complex32| Complex64::new(z.re.into(), z.im.into());
    let error: f64 = got
        .iter()
        .zip(exact)
        .map(|(a, b)| (wide(a) - b).norm_sqr())
        .sum();
    let power: f64 = exact.iter().map(Complex64::norm_sqr).sum();
    10.0 * (error / power).log10()
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    f64::from(rng.next_u32()) / 4_294_967_296.0 - 0.5
}

impl Scene {
    /// Nine scatterers over 16 m and noise, seen from 800 m on a bent track with jitter.
    pub fn new(
        num_pulses: u16,
        num_frequencies: u16,
        range_length: u16,
        doppler_length: u16,
        count: usize,
        patches: Vec<Patch>,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(
            u64::from(num_pulses) << 20 | u64::from(num_frequencies) << 4 | count as u64,
        );
        let scatterers: Vec<([f64; 3], Complex64)> = (0..9)
            .map(|i| {
                let place = [16.0 * uniform(&mut rng), 16.0 * uniform(&mut rng), 0.0];
                (
                    place,
                    Complex64::cis(TAU * uniform(&mut rng)) / f64::from(1 + i),
                )
            })
            .collect();
        let mut scene = Self {
            setup: Setup {
                num_pulses,
                num_channels: 1,
                num_frequencies,
                range_length,
                doppler_length,
                start_hz: 9.4e9,
                step_hz: 3.0e6,
            },
            weights: {
                let shape: Vec<f32> = (0..num_frequencies)
                    .map(|k| 1.0 + 0.5 * (f32::from(k) * 0.7).sin())
                    .collect();
                let sum: f32 = shape.iter().sum();
                shape.iter().map(|w| w / sum).collect()
            },
            patches,
            pulses: (0..count)
                .map(|n| {
                    let along = n as f64 * 0.35 - 4.0;
                    let position = |rng: &mut ChaCha8Rng| {
                        [
                            800.0 - along * along / 900.0 + 0.002 * uniform(rng),
                            along + 0.002 * uniform(rng),
                            300.0 + 0.002 * uniform(rng),
                        ]
                    };
                    let transmitter_m = position(&mut rng);
                    let mut receiver_m = position(&mut rng);
                    receiver_m[1] += 1.5;
                    Pulse {
                        number: n as u32,
                        time_s: n as f64 * 1e-3,
                        transmitter_m,
                        receiver_m,
                        reference_path_m: distance(transmitter_m, [0.0; 3])
                            + distance(receiver_m, [0.0; 3]),
                        weight: 0.75 + 0.25 * (n as f32 * 0.2).cos(),
                    }
                })
                .collect(),
            samples: Vec::new(),
        };
        scene.samples = scene
            .pulses
            .iter()
            .map(|pulse| {
                (0..num_frequencies)
                    .map(|k| {
                        let f = scene.setup.start_hz + f64::from(k) * scene.setup.step_hz;
                        let echo: Complex64 = scatterers
                            .iter()
                            .map(|(place, amplitude)| {
                                amplitude * Complex64::cis(-TAU * f * path(pulse, *place) / C)
                            })
                            .sum();
                        let noise = Complex64::new(uniform(&mut rng), uniform(&mut rng)) * 0.2;
                        let value = (echo + noise) * 0.2;
                        Complex32::new(value.re as f32, value.im as f32)
                    })
                    .collect()
            })
            .collect();
        scene
    }

    /// One unit scatterer without noise and windows, one sub-CPI.
    pub fn point(
        num_pulses: u16,
        num_frequencies: u16,
        range_length: u16,
        doppler_length: u16,
        patch: Patch,
        place: [f64; 3],
    ) -> Self {
        let mut scene = Self::new(
            num_pulses,
            num_frequencies,
            range_length,
            doppler_length,
            num_pulses.into(),
            vec![patch],
        );
        scene.weights.fill(1.0 / f32::from(num_frequencies));
        for (n, pulse) in scene.pulses.iter_mut().enumerate() {
            pulse.weight = 1.0;
            pulse.transmitter_m = [800.0, n as f64 * 0.1 - 1.5, 300.0];
            pulse.receiver_m = pulse.transmitter_m;
            pulse.reference_path_m = 2.0 * distance(pulse.transmitter_m, [0.0; 3]);
        }
        for (pulse, samples) in scene.pulses.iter().zip(&mut scene.samples) {
            for (k, sample) in samples.iter_mut().enumerate() {
                let f = scene.setup.start_hz + k as f64 * scene.setup.step_hz;
                let value = Complex64::cis(-TAU * f * path(pulse, place) / C);
                *sample = Complex32::new(value.re as f32, value.im as f32);
            }
        }
        scene
    }

    /// Image of a block of pulses at a point, in float64: the sum over pulses and frequencies of the samples, weighted, in phase with
    /// a scatterer there, divided by the sum of the weights.
    pub fn image_at(&self, pulses: Range<usize>, point_m: [f64; 3]) -> Complex64 {
        let (mut sum, mut weights) = (Complex64::ZERO, 0.0);
        for n in pulses {
            let pulse = &self.pulses[n];
            let weight = f64::from(pulse.weight);
            weights += weight;
            for (k, (sample, fast)) in self.samples[n].iter().zip(&self.weights).enumerate() {
                let f = self.setup.start_hz + k as f64 * self.setup.step_hz;
                let sample = Complex64::new(sample.re.into(), sample.im.into());
                let phase = TAU * f * path(pulse, point_m) / C;
                sum += weight * f64::from(*fast) * sample * Complex64::cis(phase);
            }
        }
        sum / weights
    }

    /// The defining sum at fractional bins, in float64.
    pub fn value(&self, pulses: Range<usize>, patch: usize, d: f64, r: f64) -> Complex64 {
        let setup = &self.setup;
        let num_frequencies = usize::from(setup.num_frequencies);
        let centre = (num_frequencies / 2) as f64;
        let reference_hz = setup.start_hz + centre * setup.step_hz;
        let middle = (pulses.len() as f64 - 1.0) / 2.0;
        let count = pulses.len() as f64;
        let mut sum = Complex64::ZERO;
        for (m, n) in pulses.enumerate() {
            let pulse = &self.pulses[n];
            let rho = path(pulse, self.patches[patch].centre_m);
            for k in 0..num_frequencies {
                let f = setup.start_hz + k as f64 * setup.step_hz;
                let turns = f * rho / C + (k as f64 - centre) * r / f64::from(setup.range_length)
                    - f / reference_hz * (m as f64 - middle) * d / f64::from(setup.doppler_length);
                let z = self.samples[n][k];
                sum += Complex64::new(z.re.into(), z.im.into())
                    * Complex64::cis(TAU * turns.fract())
                    * f64::from(self.weights[k])
                    * f64::from(pulse.weight);
            }
        }
        sum / count
    }

    /// [`Scene::value`] of sub-CPI `index`.
    pub fn value_at(&self, index: usize, patch: usize, d: f64, r: f64) -> Complex64 {
        let m = usize::from(self.setup.num_pulses);
        self.value(index * m..(index + 1) * m, patch, d, r)
    }

    /// A map by the defining sum.
    pub fn map(&self, pulses: Range<usize>, patch: usize) -> Vec<Complex64> {
        let reach = &self.patches[patch];
        let (q, g) = (i32::from(reach.doppler_reach), i32::from(reach.range_reach));
        (-q..=q)
            .flat_map(|d| (-g..=g).map(move |r| (d, r)))
            .map(|(d, r)| self.value(pulses.clone(), patch, d.into(), r.into()))
            .collect()
    }

    /// Least-squares line of a point's path relative to the patch centre: metres, and metres per pulse.
    pub fn line(&self, point: [f64; 3], patch: usize) -> (f64, f64) {
        let centre = self.patches[patch].centre_m;
        let middle = (self.pulses.len() as f64 - 1.0) / 2.0;
        let (mut a, mut b, mut square) = (0.0, 0.0, 0.0);
        for (m, pulse) in self.pulses.iter().enumerate() {
            let u = m as f64 - middle;
            let difference = path(pulse, point) - path(pulse, centre);
            a += difference / self.pulses.len() as f64;
            b += u * difference;
            square += u * u;
        }
        (a, b / square)
    }
}

/// Path via `point` less the reference, metres.
fn path(pulse: &Pulse, point: [f64; 3]) -> f64 {
    distance(pulse.transmitter_m, point) + distance(pulse.receiver_m, point)
        - pulse.reference_path_m
}
