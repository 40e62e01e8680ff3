//! Comparison of selected pixels with the exact sum, accumulated while a former reads the pulses.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::coverage::Coverage;
use super::drawn::{SampledPixels, power_about};
use super::exact::{LANES, add_pulse};
use super::probes::spread;
use super::stages::{READING, SAMPLES, during};
use super::stray::{self, Buffers, Profiles, RecordedEnergy};
use super::{GridPoints, ImageSpec, Tile};
use subaperture_kernels::folded_sums::{self, folded_sums};
use subaperture_kernels::lanes::Instructions;
use subaperture_kernels::phasor::phasors;
use subaperture_kernels::power;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Beam, Collection, NoBeam, PhaseHistory, ReadError};

/// Number of pixels of every image that are compared with the exact sum.
const SAMPLED_PIXELS: usize = 4 * LANES;

/// Smallest bound, dB, that float32 accumulation of sample blocks can verify.
const NARROW_DB: f64 = -80.0;

/// Fractional part of the golden ratio: its multiples are evenly spread without a lattice.
const GOLDEN: f64 = 0.618_033_988_75;

/// Largest number of pixels of an image that is compared pixel by pixel.
const FEW_PIXELS: usize = 2 * SAMPLED_PIXELS;

/// Pulses that one thread adds at a time; the summation order is fixed.
const PULSES_A_PART: usize = 16;

/// Indices of the pixels of `grid` compared with the exact sum, ascending.
pub(super) fn sampled_pixels(grid: &ImageGrid) -> Vec<usize> {
    let total = grid.num_pixels() as usize;
    let place = |i: usize| (((i as f64 + 0.5) * GOLDEN).fract() * total as f64) as usize;
    let mut pixels: Vec<usize> = match total <= FEW_PIXELS {
        true => (0..total).collect(),
        false => (0..SAMPLED_PIXELS).map(place).collect(),
    };
    pixels.sort_unstable();
    pixels.dedup();
    pixels
}

/// Record of a formed tile; the records of all tiles determine the image error.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TileRecord {
    /// Sum of `|I|^2` over the pixels of the tile.
    pub power: f64,
    /// Pixels of the tile that are compared with the exact sum.
    pub seen: Vec<ComparedPixel>,
    /// Power of all weighted samples over the sum of weights: the pixel power of noise of that power.
    pub terms: f64,
    /// Energy of the recorded samples (`stray.rs`) at all ranges and at the ranges of the grid; 0 if not measured.
    #[serde(default)]
    pub recorded: [RecordedEnergy; 2],
    /// Whether the exact sums accumulate blocks of samples in float32.
    #[serde(default)]
    pub narrow: bool,
    /// Pixels drawn in proportion to local power, for a second comparison.
    #[serde(default)]
    pub drawn: SampledPixels,
    /// Whether the exact sums, `terms` and `recorded` are missing: the tile was formed from some of the pulses. They are computed from all pulses when
    /// every tile of the image exists.
    #[serde(default)]
    pub pending: bool,
}

/// Pixel compared with the exact sum.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ComparedPixel {
    /// Index in the grid, row-major.
    pub pixel: usize,
    /// Real and imaginary part of the formed pixel.
    pub formed: [f32; 2],
    /// Real and imaginary part of the exact sum.
    pub exact: [f64; 2],
    /// Mean power of the formed pixels around this one, plus that of the tile.
    #[serde(default)]
    pub about: f64,
}

/// Exact sums at selected pixels, accumulated as pulses are read.
pub(super) struct Probes<'a> {
    spec: ImageSpec<'a>,
    /// Indices of the compared pixels, ascending, and their positions.
    pixels: Vec<usize>,
    points: Vec<DVec3>,
    /// Factors that normalise their sums; 0 for pixels that are not covered.
    norms: Vec<f64>,
    /// Whether blocks of samples are accumulated in float32.
    narrow: bool,
    /// Range profiles; `None` if every pixel is compared.
    profiles: Option<Profiles>,
    /// Block of each pixel, for images formed block by block from different pulses.
    blocks: Option<Vec<usize>>,
    /// Positions of the grid corners, the midpoints of its sides and its centre.
    edges: Vec<DVec3>,
    sums: Mutex<Sums>,
}

/// Phase history that passes the pulses it reads to the probes.
pub(super) struct Sampled<'a> {
    pub(super) history: &'a dyn PhaseHistory,
    pub(super) probes: &'a Probes<'a>,
    pub(super) monitor: &'a dyn Monitor,
}

/// Partial sums and the pulses already added.
struct Sums {
    values: Vec<Complex64>,
    levels: Vec<PulseLevels>,
    /// Levels of all pulses, once every pulse has been added.
    total: Option<Total>,
    pulses: Range<usize>,
}

/// Minimum number of pulses whose levels are measured, where there are more, and largest number of pulses that share levels.
const MEASURED_PULSES: usize = 128;
const MOST_SHARED: usize = 16;

/// Sample levels of one pulse, without its slow-time weight.
#[derive(Clone, Copy, Debug, Default)]
struct PulseLevels {
    /// Power of the weighted samples, `sum_k |w_k z[n][k]|^2`.
    power: f64,
    /// Sums over the range profile, at all ranges and at the ranges of the grid.
    profiles: [stray::Sums; 2],
}

/// Sample levels of all pulses, normalised like pixels.
#[derive(Clone, Copy, Debug)]
struct Total {
    /// Power of all terms ([`TileRecord::terms`]).
    terms: f64,
    /// Recorded energy ([`TileRecord::recorded`]).
    recorded: [RecordedEnergy; 2],
}

impl<'a> Probes<'a> {
    /// Prepare probes that resolve errors down to about `bound_db`.
    pub(super) fn new(spec: ImageSpec<'a>, bound_db: f64) -> Self {
        let narrow = bound_db >= NARROW_DB && !spec.collection.sweeps();
        let pixels = sampled_pixels(spec.grid);
        let profiles = (pixels.len() < spec.grid.num_pixels() as usize)
            .then(|| Profiles::new(spec.collection.num_samples, spec.numerics.transforms));
        Self {
            profiles,
            ..Self::at(spec, pixels, narrow)
        }
    }

    /// Prepare probes at given pixels; `narrow` as in [`TileRecord::narrow`].
    pub(super) fn at(spec: ImageSpec<'a>, pixels: Vec<usize>, narrow: bool) -> Self {
        let columns = spec.grid.columns.count;
        let points: Vec<DVec3> = pixels
            .iter()
            .map(|i| spec.grid.position_m(i / columns, i % columns))
            .collect();
        let sums = Mutex::new(Sums {
            values: vec![Complex64::ZERO; points.len()],
            levels: Vec::new(),
            total: None,
            pulses: 0..0,
        });
        let illumination = spec.weights.illumination.as_ref();
        let blocks = illumination.map(|illumination| {
            let block = |i: &usize| illumination.block_of(i / columns, i % columns);
            pixels.iter().map(block).collect()
        });
        let coverage = Coverage::new(spec, GridPoints::Positions);
        let norm = |i: &usize| match coverage.covers(i / columns, i % columns) {
            true => spec.weights.normalisation_at(i / columns, i % columns),
            false => 0.0,
        };
        Self {
            norms: pixels.par_iter().map(norm).collect(),
            blocks,
            narrow,
            profiles: None,
            edges: spread(spec.grid, 3),
            spec,
            pixels,
            points,
            sums,
        }
    }

    /// Smallest and largest delay of the edge points in pulse `n`, turns per frequency step.
    fn turns(&self, n: usize) -> [f64; 2] {
        let pulse = &self.spec.collection.pulses[n];
        let turns_m = pulse.step_hz / SPEED_OF_LIGHT_M_S;
        let turns = self
            .edges
            .iter()
            .map(|&point| pulse.relative_path_m(point) * turns_m);
        turns.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], turns| {
            [low.min(turns), high.max(turns)]
        })
    }

    /// Add a pulse to the sums of the points it illuminates.
    fn add_pulse(&self, n: usize, row: &[Complex32], fast: &[f32], sums: &mut [Complex64]) {
        let weights = self.spec.weights;
        let (Some(illumination), Some(blocks)) = (&weights.illumination, &self.blocks) else {
            self.add_weighted(n, weights.slow[n], (row, fast), &self.points, sums);
            return;
        };
        // Only pixels formed from this pulse contribute, each with its own weight.
        let weighted: Vec<(usize, f64)> = blocks
            .iter()
            .map(|&block| illumination.weight(block, n))
            .enumerate()
            .filter(|(_, weight)| *weight != 0.0)
            .collect();
        let points: Vec<DVec3> = weighted.iter().map(|&(i, _)| self.points[i]).collect();
        let mut own = vec![Complex64::ZERO; points.len()];
        self.add_weighted(n, 1.0, (row, fast), &points, &mut own);
        for ((i, weight), value) in weighted.into_iter().zip(own) {
            sums[i] += value * weight;
        }
    }

    /// Add a pulse to the sums of points with equal weight.
    fn add_weighted(
        &self,
        n: usize,
        weight: f64,
        (row, fast): (&[Complex32], &[f32]),
        points: &[DVec3],
        sums: &mut [Complex64],
    ) {
        let pulse = &self.spec.collection.pulses[n];
        if !self.narrow {
            let lanes = sums.chunks_mut(LANES).zip(points.chunks(LANES));
            for (sums, points) in lanes {
                add_pulse(pulse, weight, &self.spec.weights.fast, row, points, sums);
            }
            return;
        }
        const TOGETHER: usize = folded_sums::TOGETHER;
        let instructions = Instructions::best();
        let lanes = sums.chunks_mut(TOGETHER);
        for (sums, points) in lanes.zip(points.chunks(TOGETHER)) {
            let [mut step_turns, mut start_turns] = [[0.0; TOGETHER]; 2];
            let turns = step_turns.iter_mut().zip(&mut start_turns);
            for ((step, start), &point) in turns.zip(points) {
                let delay_s = pulse.relative_path_m(point) / SPEED_OF_LIGHT_M_S;
                (*step, *start) = (pulse.step_hz * delay_s, pulse.start_hz * delay_s);
            }
            let mut starts = [Complex64::ZERO; TOGETHER];
            phasors(instructions, &start_turns, &mut starts);
            let over_frequency = folded_sums(instructions, row, fast, &step_turns);
            for ((sum, value), start) in sums.iter_mut().zip(over_frequency).zip(starts) {
                *sum += value * start * weight;
            }
        }
    }

    /// Add pulses that are not yet in the sums; a former may read a pulse more than once.
    pub(super) fn add(&self, pulses: Range<usize>, samples: &[Complex32], monitor: &dyn Monitor) {
        let width = self.spec.collection.num_samples;
        let weights = self.spec.weights;
        let fast: Vec<f32> = weights.fast.iter().map(|&w| w as f32).collect();
        let mut sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != pulses.start {
            return;
        }
        let numbers: Vec<usize> = pulses.clone().collect();
        let parts: Vec<(Vec<Complex64>, Vec<PulseLevels>)> = numbers
            .par_chunks(PULSES_A_PART)
            .zip(samples.par_chunks(PULSES_A_PART * width))
            .map(|(numbers, samples)| {
                let _summing = during(monitor, SAMPLES);
                let mut part = vec![Complex64::ZERO; self.points.len()];
                let mut levels = Vec::with_capacity(numbers.len());
                let mut buffers = Buffers::default();
                for (&n, row) in numbers.iter().zip(samples.chunks_exact(width)) {
                    self.add_pulse(n, row, &fast, &mut part);
                    let mut own = PulseLevels::default();
                    if self.measured(n) == n {
                        let profiles = self
                            .profiles
                            .as_ref()
                            .map(|of_pulse| of_pulse.of(row, &fast, self.turns(n), &mut buffers));
                        own = PulseLevels {
                            power: power::power(Instructions::best(), row, &fast),
                            profiles: profiles.unwrap_or_default(),
                        };
                    }
                    levels.push(own);
                }
                (part, levels)
            })
            .collect();
        for (part, levels) in parts {
            let both = sums.values.iter_mut().zip(part);
            both.for_each(|(sum, value)| *sum += value);
            sums.levels.extend(levels);
        }
        sums.pulses.end = pulses.end;
        if sums.pulses.end == self.spec.collection.pulses.len() {
            for n in 0..sums.levels.len() {
                sums.levels[n] = sums.levels[self.measured(n)];
            }
        }
    }

    /// Pulse whose levels represent those of pulse `n`.
    fn measured(&self, n: usize) -> usize {
        let count = self.spec.collection.pulses.len();
        let shared = (count / MEASURED_PULSES).clamp(1, MOST_SHARED);
        let group = n / shared;
        // Another place in each group, so that a period of the pulses is not mistaken for their level.
        let place = (group as f64 * GOLDEN).fract() * shared as f64;
        (group * shared + place as usize).min(count - 1)
    }

    /// Exact sums of all pulses, normalised like pixels; `None` if a pulse is missing.
    pub(super) fn values(&self) -> Option<Vec<Complex64>> {
        let sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != self.spec.collection.pulses.len() {
            return None;
        }
        let values = self.norms.iter().zip(&sums.values);
        Some(values.map(|(norm, sum)| sum * norm).collect())
    }

    /// Levels of all pulses.
    ///
    /// Blocks formed from different pulses count as separate images. Their energies add, as the energies of their pixels do. Term power and
    /// energy of strong scatterers take the maximum over blocks: the echo of a scatterer outside the grid is assumed to lie in one
    /// block.
    fn total(&self, levels: &[PulseLevels]) -> Total {
        let weights = self.spec.weights;
        let Some(illumination) = &weights.illumination else {
            return total(&weights.fast, &weights.slow, levels);
        };
        // Blocks formed from the same pulses have the same levels: one of them, and their number.
        let mut alike = BTreeMap::<(usize, usize, usize), (usize, f64)>::new();
        for block in 0..illumination.num_blocks() {
            let pulses = illumination.pulses(block);
            if !pulses.is_empty() {
                // Matched weights differ from block to block.
                let own = if illumination.is_matched() { block } else { 0 };
                alike
                    .entry((pulses.start, pulses.end, own))
                    .or_insert((block, 0.0))
                    .1 += 1.0;
            }
        }
        let mut sum = Total {
            terms: 0.0,
            recorded: Default::default(),
        };
        let mut longest = 0..0;
        for (block, count) in alike.into_values() {
            let pulses = illumination.pulses(block);
            let own = total(
                &weights.fast,
                &illumination.slow(block).0,
                &levels[pulses.clone()],
            );
            let gain = libm::pow(illumination.centre_gain(block), 2.0);
            sum.terms = sum.terms.max(gain * own.terms);
            for (sum, own) in sum.recorded.iter_mut().zip(own.recorded) {
                sum.all += count * gain * own.all;
                sum.strong = sum.strong.max(gain * own.strong);
            }
            if pulses.len() > longest.len() {
                longest = pulses;
            }
        }
        // Resolution cells of the longest block are larger than those of all pulses, which are the unit of these energies.
        let of_block = Collection {
            name: String::new(),
            pulses: self.spec.collection.pulses[longest].to_vec(),
            ..*self.spec.collection
        };
        let pixels = |collection| {
            stray::pixels_a_cell(&ImageSpec {
                collection,
                ..self.spec
            })
        };
        let larger = (pixels(&of_block) / pixels(self.spec.collection)).max(1.0);
        for recorded in &mut sum.recorded {
            recorded.all *= larger;
            recorded.strong *= larger;
        }
        sum
    }

    /// Energy of all pulses at all ranges and at the ranges of the grid; `None` if a pulse is missing.
    pub(super) fn recorded(&self) -> Option<[RecordedEnergy; 2]> {
        let sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        let all = sums.pulses.end == self.spec.collection.pulses.len();
        all.then(|| self.total(&sums.levels).recorded)
    }

    /// Record of a `tile` without the exact sums.
    pub(super) fn pending(&self, tile: &Tile) -> TileRecord {
        let columns = self.spec.grid.columns.count;
        let drawn = SampledPixels::of(tile, columns);
        let mean = drawn.mean(tile.pixels.len());
        let seen = self.pixels.iter().filter_map(|&pixel| {
            let (row, column) = (pixel / columns, pixel % columns);
            let formed = tile.at(row, column)?;
            let place = tile.place;
            Some(ComparedPixel {
                pixel,
                formed: [formed.re, formed.im],
                exact: [0.0; 2],
                about: power_about(tile, row - place.row, column - place.column) + mean,
            })
        });
        TileRecord {
            power: tile.pixels.iter().map(|&z| image::power(z)).sum(),
            seen: seen.collect(),
            terms: 0.0,
            recorded: Default::default(),
            narrow: self.narrow,
            drawn,
            pending: true,
        }
    }

    /// Add the exact sums of all pulses to the record of a tile. Returns whether it is complete; it is not if a pulse is missing.
    pub(super) fn complete(&self, record: &mut TileRecord) -> bool {
        let mut sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != self.spec.collection.pulses.len() {
            return false;
        }
        let total = match sums.total {
            Some(total) => total,
            None => {
                let total = self.total(&sums.levels);
                *sums.total.insert(total)
            }
        };
        for seen in &mut record.seen {
            let Ok(at) = self.pixels.binary_search(&seen.pixel) else {
                return false;
            };
            let exact = sums.values[at] * self.norms[at];
            seen.exact = [exact.re, exact.im];
        }
        (record.terms, record.recorded) = (total.terms, total.recorded);
        (record.narrow, record.pending) = (self.narrow, false);
        true
    }

    /// Record of a `tile` formed from these pulses; `None` if a pulse was not read.
    pub(super) fn record(&self, tile: &Tile) -> Option<TileRecord> {
        let mut record = self.pending(tile);
        self.complete(&mut record).then_some(record)
    }
}

/// Levels of pulses with the given weights.
fn total(fast: &[f64], slow: &[f64], levels: &[PulseLevels]) -> Total {
    let (mut terms, mut profiles) = (0.0, [stray::Sums::default(); 2]);
    for (&weight, level) in slow.iter().zip(levels) {
        terms += weight * weight * level.power;
        for (sum, own) in profiles.iter_mut().zip(&level.profiles) {
            sum.add(own, weight);
        }
    }
    let norm = 1.0 / (fast.iter().sum::<f64>() * slow.iter().sum::<f64>());
    Total {
        terms: terms * norm * norm,
        recorded: profiles.map(|sums| sums.energy(fast, slow)),
    }
}

impl PhaseHistory for Sampled<'_> {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let reading = during(self.monitor, READING);
        self.history.read(pulses.clone(), samples)?;
        drop(reading);
        self.probes.add(pulses, samples, self.monitor);
        Ok(())
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        let samples = self.history.samples_in_memory(pulses.clone())?;
        self.probes.add(pulses, samples, self.monitor);
        Some(samples)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.history.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        self.history.held_bytes()
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }
}
