//! The image and the samples by their defining sums in plain float64, the oracle for tests of the library.
//!
//! ```text
//! z[n][k] = sum_s a_s exp(-j 2 pi f_nk r_nk(s) / c)                                                 (echoes)
//! I(p)    = sum_n sum_k w_n v_k z[n][k] exp(+j 2 pi f_nk r_nk(p) / c) / (sum_n w_n  sum_k v_k)       (image)
//! ```
//!
//! with `f_nk = start_hz + k step_hz` and `r_nk` the two-way path less the pulse's reference path (Schone 2020, (2.11) and section 1.2).
//!
//! This module uses only `std` (`tests/cli/sources.rs` checks it): no code of the library, no complex type, no vector type. Every term has
//! its own sine and cosine without approximations. The error is that of `f r / c` in float64, `2^-53` of some 10^5 to 10^6 cycles, 1e-10
//! cycles or -180 dB.

use std::f64::consts::TAU;
use std::ops::Range;

/// Speed of light in vacuum, m/s.
pub const LIGHT_M_S: f64 = 299_792_458.0;

/// Real and imaginary part.
pub type Complex = [f64; 2];

/// Parameters of a pulse in the sums.
#[derive(Clone, Copy, Debug)]
pub struct PlainPulse {
    /// Transmitter, metres.
    pub transmitter_m: [f64; 3],
    /// Receiver, metres.
    pub receiver_m: [f64; 3],
    /// Two-way path to which the samples' phases refer, metres; 0 for raw echoes.
    pub reference_path_m: f64,
    /// Frequency of sample 0, hertz.
    pub start_hz: f64,
    /// Frequency step between samples, hertz.
    pub step_hz: f64,
    /// Slow-time weight.
    pub weight: f64,
}

impl PlainPulse {
    /// Frequency of sample `k`, hertz.
    pub fn frequency_hz(&self, k: usize) -> f64 {
        self.start_hz + k as f64 * self.step_hz
    }

    /// Two-way path of a point less the reference path, metres.
    pub fn relative_path_m(&self, point_m: [f64; 3]) -> f64 {
        distance_m(self.transmitter_m, point_m) + distance_m(point_m, self.receiver_m)
            - self.reference_path_m
    }

    /// Sample `k` of an echo of scatterers `(position, amplitude)`.
    pub fn echo(&self, k: usize, scatterers: &[([f64; 3], Complex)]) -> Complex {
        let mut sum = [0.0; 2];
        for &(point_m, amplitude) in scatterers {
            let unit = unit_echo(self.frequency_hz(k), self.relative_path_m(point_m));
            add_product(&mut sum, amplitude, unit);
        }
        sum
    }

    /// Contribution of this pulse to a point, not normalised; `relative_path_m(k)` is the path of sample `k`.
    pub fn matched(
        &self,
        samples: &[Complex],
        fast: &[f64],
        relative_path_m: impl Fn(usize) -> f64,
    ) -> Complex {
        assert_eq!(samples.len(), fast.len(), "one weight a sample");
        let mut sum = [0.0; 2];
        for (k, (&sample, v)) in samples.iter().zip(fast).enumerate() {
            let [re, im] = unit_echo(self.frequency_hz(k), relative_path_m(k));
            let weight = self.weight * v;
            add_product(&mut sum, sample, [re * weight, -im * weight]);
        }
        sum
    }
}

/// Pulses, their samples and weights.
#[derive(Clone, Debug)]
pub struct PlainSum {
    /// Pulses with their slow-time weights.
    pub pulses: Vec<PlainPulse>,
    /// Samples by pulse.
    pub samples: Vec<Complex>,
    /// Weights over the samples of a pulse.
    pub fast: Vec<f64>,
}

impl PlainSum {
    /// Samples of pulse `n`.
    pub fn row(&self, n: usize) -> &[Complex] {
        &self.samples[n * self.fast.len()..(n + 1) * self.fast.len()]
    }

    /// Image at stationary points, without intra-pulse motion.
    pub fn at(&self, points_m: &[[f64; 3]]) -> Vec<Complex> {
        self.by_paths(points_m.len(), |i, n, _| {
            self.pulses[n].relative_path_m(points_m[i])
        })
    }

    /// Image at `count` points with arbitrary motion: `relative_path_m(i, n, k)` is the path of point `i` in sample `k` of pulse `n`.
    pub fn by_paths(
        &self,
        count: usize,
        relative_path_m: impl Fn(usize, usize, usize) -> f64 + Sync,
    ) -> Vec<Complex> {
        let weights = self.pulses.iter().map(|pulse| pulse.weight).sum::<f64>()
            * self.fast.iter().sum::<f64>();
        let one = |i: usize| {
            let mut sum = [0.0; 2];
            for (n, pulse) in self.pulses.iter().enumerate() {
                let [re, im] = pulse.matched(self.row(n), &self.fast, |k| relative_path_m(i, n, k));
                sum = [sum[0] + re, sum[1] + im];
            }
            sum.map(|part| part / weights)
        };
        in_parts(count, |points| points.map(one).collect())
    }
}

/// Sample of a unit scatterer at a frequency with its path less the reference path: `exp(-j 2 pi f r / c)`.
pub fn unit_echo(frequency_hz: f64, relative_path_m: f64) -> Complex {
    let cycles = frequency_hz * (relative_path_m / LIGHT_M_S);
    let (sin, cos) = (-TAU * (cycles - cycles.round())).sin_cos();
    [cos, sin]
}

/// Hamming weights at the centres of `count` equal parts of the window.
pub fn hamming(count: usize) -> Vec<f64> {
    let at = |k: usize| (k as f64 + 0.5) / count as f64 - 0.5;
    (0..count)
        .map(|k| 0.54 + 0.46 * (TAU * at(k)).cos())
        .collect()
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [x, y, z] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (x * x + y * y + z * z).sqrt()
}

fn add_product(sum: &mut Complex, [a, b]: Complex, [c, d]: Complex) {
    sum[0] += a * c - b * d;
    sum[1] += a * d + b * c;
}

/// Results of `0..count` in order, computed on all processors.
fn in_parts(count: usize, work: impl Fn(Range<usize>) -> Vec<Complex> + Sync) -> Vec<Complex> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let length = count.div_ceil(threads).max(1);
    let work = &work;
    std::thread::scope(|scope| {
        let parts: Vec<_> = (0..count)
            .step_by(length)
            .map(|from| scope.spawn(move || work(from..count.min(from + length))))
            .collect();
        parts
            .into_iter()
            .flat_map(|part| part.join().expect("the sum does not panic"))
            .collect()
    })
}
