//! Some of an image's pixels compared with the exact sum, whose pulses are added as a former reads them.

use std::ops::Range;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::exact::{LANES, add_pulse};
use super::stages::{READING, SAMPLES, during};
use super::{Aim, Tile};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::{horner, power};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channel, Collection, InputFile, PhaseHistory, ReadError};
use subaperture_signal::phase::phasor;

/// Pixels at which every image is compared with the sum.
const SAMPLED_PIXELS: usize = 4 * LANES;

/// Least bound, dB, for which the exact sums at these are told well enough with runs of samples in float32.
const NARROW_DB: f64 = -80.0;

/// Pixels of which all are sampled.
const FEW_PIXELS: usize = 2 * SAMPLED_PIXELS;

/// Pulses that a thread adds to the samples at a time; their order in the sum is fixed.
const PULSES_A_PART: usize = 16;

/// Pixels of `grid` at which an image is compared with the sum, ascending.
pub(super) fn sampled_pixels(grid: &ImageGrid) -> Vec<usize> {
    let total = grid.num_pixels() as usize;
    // Golden-ratio places: spread evenly without a lattice.
    let place = |i: usize| (((i as f64 + 0.5) * 0.618_033_988_75).fract() * total as f64) as usize;
    let mut pixels: Vec<usize> = match total <= FEW_PIXELS {
        true => (0..total).collect(),
        false => (0..SAMPLED_PIXELS).map(place).collect(),
    };
    pixels.sort_unstable();
    pixels.dedup();
    pixels
}

/// What is kept of a formed tile, so that all of them together tell the image's error.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TileRecord {
    /// Sum of `|I|^2` over its pixels.
    pub power: f64,
    /// Its pixels that are compared with the sum.
    pub seen: Vec<Seen>,
    /// Power of all weighted samples, over the weights' sum: what noise would show in a pixel.
    pub terms: f64,
    /// Whether the exact sums are of runs of samples in float32.
    #[serde(default)]
    pub narrow: bool,
}

/// A pixel that is compared with the sum.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Seen {
    /// Its index in the grid, row-major.
    pub pixel: usize,
    /// Real and imaginary part of what was formed.
    pub formed: [f32; 2],
    /// The same of the exact sum.
    pub exact: [f64; 2],
}

/// The exact sum at some pixels, kept as pulses are read.
pub(super) struct Probes<'a> {
    aim: Aim<'a>,
    /// Indices of pixels, ascending, and where they lie.
    pixels: Vec<usize>,
    points: Vec<DVec3>,
    /// Whether float32 is good enough for runs of samples.
    narrow: bool,
    sums: Mutex<Sums>,
}

/// A history whose pulses go to probes as they are read.
pub(super) struct Sampled<'a> {
    pub(super) history: &'a dyn PhaseHistory,
    pub(super) probes: &'a Probes<'a>,
    pub(super) monitor: &'a dyn Monitor,
}

/// Sums so far, and the pulses that are in them.
struct Sums {
    values: Vec<Complex64>,
    /// Power of all weighted samples: `sum_n sum_k |w_n w_k z[n][k]|^2`.
    terms: f64,
    pulses: Range<usize>,
}

impl<'a> Probes<'a> {
    /// To tell errors down to about `bound_db`.
    pub(super) fn new(aim: Aim<'a>, bound_db: f64) -> Self {
        let columns = aim.grid.columns.count;
        let pixels = sampled_pixels(aim.grid);
        let points: Vec<DVec3> = pixels
            .iter()
            .map(|i| aim.grid.position_m(i / columns, i % columns))
            .collect();
        let sums = Mutex::new(Sums {
            values: vec![Complex64::ZERO; points.len()],
            terms: 0.0,
            pulses: 0..0,
        });
        Self {
            narrow: bound_db >= NARROW_DB && !aim.collection.sweeps(),
            aim,
            pixels,
            points,
            sums,
        }
    }

    /// Adds a pulse to the points' sums.
    fn add_pulse(&self, n: usize, row: &[Complex32], fast: &[f32], sums: &mut [Complex64]) {
        let (pulse, weights) = (&self.aim.collection.pulses[n], self.aim.weights);
        if !self.narrow {
            let lanes = sums.chunks_mut(LANES).zip(self.points.chunks(LANES));
            for (sums, points) in lanes {
                add_pulse(pulse, weights.slow[n], &weights.fast, row, points, sums);
            }
            return;
        }
        let lanes = sums.chunks_mut(horner::NARROW_TOGETHER);
        for (sums, points) in lanes.zip(self.points.chunks(horner::NARROW_TOGETHER)) {
            let mut steps = [Complex64::ZERO; horner::NARROW_TOGETHER];
            let mut delays_s = [0.0; horner::NARROW_TOGETHER];
            for ((step, delay_s), &point) in steps.iter_mut().zip(&mut delays_s).zip(points) {
                *delay_s = pulse.relative_path_m(point) / SPEED_OF_LIGHT_M_S;
                *step = phasor(pulse.step_hz * *delay_s);
            }
            let over_frequency = horner::narrow_sums(Instructions::best(), row, fast, &steps);
            for ((sum, value), delay_s) in sums.iter_mut().zip(over_frequency).zip(delays_s) {
                *sum += value * phasor(pulse.start_hz * delay_s) * weights.slow[n];
            }
        }
    }

    /// Adds pulses, unless they are in the sums: a former may read some twice.
    fn add(&self, pulses: Range<usize>, samples: &[Complex32], monitor: &dyn Monitor) {
        let width = self.aim.collection.num_samples;
        let weights = self.aim.weights;
        let fast: Vec<f32> = weights.fast.iter().map(|&w| w as f32).collect();
        let mut sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != pulses.start {
            return;
        }
        let numbers: Vec<usize> = pulses.clone().collect();
        let parts: Vec<(Vec<Complex64>, f64)> = numbers
            .par_chunks(PULSES_A_PART)
            .zip(samples.par_chunks(PULSES_A_PART * width))
            .map(|(numbers, samples)| {
                let _summing = during(monitor, SAMPLES);
                let mut part = vec![Complex64::ZERO; self.points.len()];
                let mut terms = 0.0;
                for (&n, row) in numbers.iter().zip(samples.chunks_exact(width)) {
                    self.add_pulse(n, row, &fast, &mut part);
                    let sum = power::power(Instructions::best(), row, &fast);
                    terms += weights.slow[n].powi(2) * sum;
                }
                (part, terms)
            })
            .collect();
        for (part, terms) in parts {
            let both = sums.values.iter_mut().zip(part);
            both.for_each(|(sum, value)| *sum += value);
            sums.terms += terms;
        }
        sums.pulses.end = pulses.end;
    }

    /// What is to be kept of `tile`, formed of these pulses. `None` if they were not all read.
    pub(super) fn record(&self, tile: &Tile) -> Option<TileRecord> {
        let sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != self.aim.collection.pulses.len() {
            return None;
        }
        let norm = self.aim.weights.normalisation();
        let columns = self.aim.grid.columns.count;
        let seen = self.pixels.iter().zip(&sums.values);
        let seen = seen.filter_map(|(&pixel, &sum)| {
            let formed = tile.at(pixel / columns, pixel % columns)?;
            let exact = sum * norm;
            Some(Seen {
                pixel,
                formed: [formed.re, formed.im],
                exact: [exact.re, exact.im],
            })
        });
        Some(TileRecord {
            power: tile.pixels.iter().map(|&z| image::power(z)).sum(),
            seen: seen.collect(),
            terms: sums.terms * norm * norm,
            narrow: self.narrow,
        })
    }
}

impl PhaseHistory for Sampled<'_> {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let reading = during(self.monitor, READING);
        self.history.read(pulses.clone(), samples)?;
        drop(reading);
        self.probes.add(pulses, samples, self.monitor);
        Ok(())
    }

    fn at_hand(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        let samples = self.history.at_hand(pulses.clone())?;
        self.probes.add(pulses, samples, self.monitor);
        Some(samples)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.history.true_antennas()
    }

    fn channels(&self) -> Vec<Channel> {
        self.history.channels()
    }

    fn held_bytes(&self) -> u64 {
        self.history.held_bytes()
    }

    fn start_ns(&self) -> Option<i64> {
        self.history.start_ns()
    }

    fn warnings(&self) -> Vec<String> {
        self.history.warnings()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.history.inputs()
    }
}
