//! Backprojection with intra-pulse motion: several profiles per pulse or part of one, and paths with their range rates.

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::blurs::Blurs;
use super::cost::{PIXELS, PROFILES};
use super::parts::{MAX_PARTS as MAX_PULSE_PARTS, PulseParts};
use super::{Choices, GridPoints, MAX_OVERSAMPLING, MAX_PARTS, PixelPaths, SUMMED_BLURRED};
use crate::budget::Budget;
use crate::pixels::for_each_run;
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{FormError, Forming, ImageSpec, Remedy, Tile, Work};
use subaperture_kernels::paths::Points;
use subaperture_kernels::range_migration_blur::{self, Scale, SmearedPosition};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::range_profile::RangeProfiler;

/// Bytes for a pulse and its upsampled profiles.
pub(super) fn pulse_bytes(num_samples: usize, blurs: &Blurs, length: usize) -> u64 {
    8 * (BLOCKS_HELD * num_samples + blurs.parts * blurs.count * (length + 1)) as u64
}

/// Share of the error power of the bound for neglected terms of the intra-pulse motion, and the error below which float32 is the limit.
const NEGLECTED: f64 = 0.4;
const MIN_NEGLECTED: f64 = 3e-7;

/// Choose parameters for a relative RMS error of `error_db`. Return them with the errors of the steps between profiles and of the neglected terms of
/// the motion.
pub(super) fn choose(
    spec: &ImageSpec,
    error_db: f64,
    grid_points: GridPoints,
) -> (Choices, [f64; 2]) {
    let num_samples = spec.collection.num_samples;
    // Half of the error power for each of the two interpolations.
    let share_db = error_db - 10.0 * libm::log10(2.0);
    let allowed = libm::pow(10.0, error_db / 20.0) * NEGLECTED.sqrt();
    let allowed = allowed.max(MIN_NEGLECTED);
    let oversampling = RangeProfiler::oversampling_for(1, share_db);
    let oversampling = oversampling.min(MAX_OVERSAMPLING);
    let (blurs, errors) = divide(spec, share_db, grid_points, allowed);
    let length = RangeProfiler::length_for(blurs.width(), oversampling);
    let fit = spec.scratch_bytes / pulse_bytes(num_samples, &blurs, length);
    let choices = Choices {
        degree: 1,
        oversampling,
        margin: 1,
        summed_pulses: fit.clamp(1, (SUMMED_BLURRED / blurs.parts).max(1) as u64) as usize,
        paths: PixelPaths::Blurs(blurs),
    };
    (choices, errors)
}

/// Divide pulses into the fewest parts whose neglected terms are at most `allowed`. They decrease with the cube of the number of parts.
fn divide(
    spec: &ImageSpec,
    share_db: f64,
    grid_points: GridPoints,
    allowed: f64,
) -> (Blurs, [f64; 2]) {
    let most = MAX_PULSE_PARTS.min(spec.collection.num_samples.max(1));
    let mut count = 1;
    loop {
        let parts = PulseParts::new(&spec.weights.fast, count);
        let (blurs, errors) = Blurs::new(spec, &parts, share_db, grid_points);
        let times = libm::cbrt(errors[1] / allowed);
        if times <= 1.0 || !times.is_finite() || count >= most {
            return (blurs, errors);
        }
        let next = (count as f64 * times).ceil().min(most as f64) as usize;
        count = next.max(count + 1);
    }
}

/// Profilers of the parts of a pulse.
pub(super) fn profilers(
    spec: &ImageSpec,
    parts: &PulseParts,
    choices: &Choices,
) -> Vec<RangeProfiler> {
    let of = |part| {
        let window = parts.window(part);
        let transforms = spec.numerics.transforms;
        RangeProfiler::new(choices.degree, window, choices.oversampling, transforms)
    };
    (0..parts.count()).map(of).collect()
}

/// Data of a part of a pulse except its profiles.
struct Source {
    pulse: Pulse,
    scale: Scale,
    /// Reference path of the phases and its change from sample to sample.
    reference: PathTerms,
    /// Factor `f_c / step` from range rate, metres per sample, to apparent range shift, metres.
    coupling: f64,
    /// Factor from range acceleration, metres per sample squared, to apparent range shift, metres.
    bend: f64,
}

/// Buffers of one thread for a row of pixels.
#[derive(Default)]
struct Scratch {
    sums: Vec<Complex32>,
    blurred: Vec<SmearedPosition>,
}

pub(super) struct Opened<'a> {
    pub(super) spec: ImageSpec<'a>,
    pub(super) summed_pulses: usize,
    pub(super) blurs: Blurs,
    pub(super) parts: PulseParts,
    /// Profiler of each part.
    pub(super) profilers: Vec<RangeProfiler>,
    pub(super) grid_points: GridPoints,
}

impl Forming for Opened<'_> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let collection = self.spec.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let length = self.length();
        // Profiles, and profiles of all parts, of a pulse.
        let each = self.parts.count() * self.blurs.count;
        let summed = self.summed_pulses;
        let parts = Budget::new(work.memory_bytes).take_block(
            "range profiles of some pulses",
            pulse_bytes(num_samples, &self.blurs, length) * summed.min(num_pulses) as u64,
            num_pulses.div_ceil(summed).min(MAX_PARTS),
            &[Remedy::MoreMemory],
        )?;
        let block = (parts * summed).min(num_pulses);
        let mut profiles = vec![Complex32::ZERO; block * each * (length + 1)];
        read_ahead(
            work.history,
            blocks_of(num_pulses, block),
            |pulses, samples| {
                let profiles = &mut profiles[..pulses.len() * each * (length + 1)];
                self.profiles(samples, profiles, work.monitor);
                let sources = pulses.clone().flat_map(|n| self.sources(n));
                let sources: Vec<Source> = sources.collect();
                let add = |scratch: &mut Scratch, points: &Points, pixels: &mut [Complex32]| {
                    let profiles = profiles.chunks(summed * each * (length + 1));
                    for (sources, profiles) in
                        sources.chunks(summed * self.parts.count()).zip(profiles)
                    {
                        self.sum(sources, profiles, points, scratch);
                        let sums = pixels.iter_mut().zip(&scratch.sums);
                        sums.for_each(|(pixel, sum)| *pixel += sum);
                    }
                };
                let (grid, monitor) = (self.spec.grid, work.monitor);
                for_each_run(grid, tiles, monitor, PIXELS, Scratch::default, add);
                if work.monitor.cancelled() {
                    return Err(FormError::Cancelled);
                }
                work.monitor.progress(pulses.end as f64 / num_pulses as f64);
                Ok(())
            },
        )
    }
}

impl<'a> Opened<'a> {
    pub(super) fn new(
        spec: ImageSpec<'a>,
        choices: &Choices,
        blurs: Blurs,
        window: &[f64],
        grid_points: GridPoints,
    ) -> Self {
        let parts = PulseParts::new(window, blurs.parts);
        let profilers = profilers(&spec, &parts, choices);
        Self {
            summed_pulses: choices.summed_pulses,
            spec,
            blurs,
            parts,
            profilers,
            grid_points,
        }
    }

    /// Length of the range profile of a part, samples.
    fn length(&self) -> usize {
        self.profilers[0].length()
    }

    /// Compute the profiles of `samples` pulse by pulse.
    fn profiles(&self, samples: &[Complex32], profiles: &mut [Complex32], monitor: &dyn Monitor) {
        let num_samples = self.spec.collection.num_samples;
        let (levels, num_parts) = (self.blurs.count, self.parts.count());
        let scratch = || {
            let row = vec![Complex32::ZERO; self.parts.width()];
            let fft = vec![Complex32::ZERO; self.profilers[0].scratch_length()];
            (row, fft, during(monitor, PROFILES))
        };
        profiles
            .par_chunks_exact_mut(self.length() + 1)
            .enumerate()
            .for_each_init(scratch, |(row, scratch, _), (i, profile)| {
                let (part, level) = (i / levels % num_parts, i % levels);
                let first = i / (levels * num_parts) * num_samples;
                let pulse = &samples[first..first + num_samples];
                self.blurs
                    .sharpen(level, &pulse[self.parts.samples(part)], row);
                self.profilers[part].profile(row, profile, scratch);
            });
    }

    /// Data of the parts of pulse `n`.
    fn sources(&self, n: usize) -> impl Iterator<Item = Source> + '_ {
        (0..self.parts.count()).map(move |part| {
            let pulse = self.parts.of(&self.spec.collection.pulses[n], part);
            let centre_hz = pulse.frequency_hz(self.parts.width() / 2);
            Source {
                scale: Scale {
                    cycles_m: centre_hz / SPEED_OF_LIGHT_M_S,
                    weight: self.spec.weights.slow[n] as f32,
                },
                reference: pulse.reference_terms(),
                coupling: centre_hz / pulse.step_hz,
                bend: 0.5 * self.parts.regression(part),
                pulse,
            }
        })
    }

    /// Sum the contributions of a block of pulses to a row of pixels in the scratch buffer.
    fn sum(
        &self,
        sources: &[Source],
        profiles: &[Complex32],
        points: &Points,
        scratch: &mut Scratch,
    ) {
        let length = self.length();
        let Scratch { sums, blurred } = scratch;
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        let each = profiles.chunks_exact(self.blurs.count * (length + 1));
        for (source, profiles) in sources.iter().zip(each) {
            blurred.clear();
            let places = points.iter().map(DVec3::from);
            blurred.extend(places.map(|point| self.blurred(source, point)));
            range_migration_blur::add(profiles, length, &source.scale, blurred, sums);
        }
    }

    /// Fractional index in the profiles of a pulse for a point.
    #[inline(always)]
    fn blurred(&self, source: &Source, point: DVec3) -> SmearedPosition {
        let (at, velocity_m_s) = self.grid_points.target(&source.pulse, point);
        let terms = source.pulse.path_terms(at, velocity_m_s) - source.reference;
        let turns_m = source.pulse.step_hz / SPEED_OF_LIGHT_M_S;
        SmearedPosition {
            path_m: terms.path_m,
            turns: (terms.path_m + terms.rate_m * source.coupling + terms.bend_m * source.bend)
                * turns_m,
            level: self.blurs.level(self.blurs.turns(&source.pulse, &terms)),
        }
    }
}
