//! Samples taken one after another in motion: several profiles a pulse, and paths with their rates.

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::blurs::Blurs;
use super::cost::{PIXELS, PROFILES};
use super::{Choices, MOST_OVERSAMPLING, MOST_PARTS, Meaning, SUMMED_BLURRED, Way};
use crate::budget::Budget;
use crate::pixels::for_each_run;
use crate::read_ahead::{BLOCKS_HELD, blocks_of, read_ahead};
use crate::{Aim, FormError, Forming, Remedy, Tile, Work};
use subaperture_kernels::blurred::{self, Blurred, Scale};
use subaperture_kernels::paths::Points;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::range_profile::RangeProfiler;

/// Bytes of a pulse and its upsampled profiles.
pub(super) fn pulse_bytes(num_samples: usize, blurs: &Blurs, length: usize) -> u64 {
    8 * (BLOCKS_HELD * num_samples + blurs.count * (length + 1)) as u64
}

/// Chooses for a relative RMS error of `error_db`; and the error of the steps between profiles.
pub(super) fn choose(aim: &Aim, error_db: f64, meaning: Meaning) -> (Choices, f64) {
    let num_samples = aim.collection.num_samples;
    // Half of the error's power for either interpolation.
    let share_db = error_db - 10.0 * libm::log10(2.0);
    let oversampling = RangeProfiler::oversampling_for(1, share_db);
    let oversampling = oversampling.min(MOST_OVERSAMPLING);
    let (blurs, blurs_error) = Blurs::new(aim, share_db, meaning);
    let length = RangeProfiler::length_for(num_samples, oversampling);
    let fit = aim.scratch_bytes / pulse_bytes(num_samples, &blurs, length);
    let choices = Choices {
        degree: 1,
        oversampling,
        margin: 1,
        summed_pulses: fit.clamp(1, SUMMED_BLURRED as u64) as usize,
        way: Way::Blurs(blurs),
    };
    (choices, blurs_error)
}

/// What one pulse contributes with, beside its profiles.
struct Source<'a> {
    pulse: &'a Pulse,
    scale: Scale,
    /// What phases are referred to, and how that changes from sample to sample.
    reference: PathTerms,
    /// `f_c / step`: samples by which a rate of a metre a sample shifts range, in metres.
    coupling: f64,
}

/// One thread's buffers, for a run of pixels.
#[derive(Default)]
struct Scratch {
    sums: Vec<Complex32>,
    blurred: Vec<Blurred>,
}

pub(super) struct Opened<'a> {
    pub(super) aim: Aim<'a>,
    pub(super) summed_pulses: usize,
    pub(super) blurs: Blurs,
    pub(super) profiler: RangeProfiler,
    pub(super) meaning: Meaning,
}

impl Forming for Opened<'_> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let collection = self.aim.collection;
        let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
        let (length, each) = (self.profiler.length(), self.blurs.count);
        let summed = self.summed_pulses;
        let parts = Budget::new(work.memory_bytes).take_block(
            "range profiles of some pulses",
            pulse_bytes(num_samples, &self.blurs, length) * summed.min(num_pulses) as u64,
            num_pulses.div_ceil(summed).min(MOST_PARTS),
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
                let sources: Vec<Source> = pulses.clone().map(|n| self.source(n)).collect();
                let add = |scratch: &mut Scratch, points: &Points, pixels: &mut [Complex32]| {
                    let profiles = profiles.chunks(summed * each * (length + 1));
                    for (sources, profiles) in sources.chunks(summed).zip(profiles) {
                        self.sum(sources, profiles, points, scratch);
                        let sums = pixels.iter_mut().zip(&scratch.sums);
                        sums.for_each(|(pixel, sum)| *pixel += sum);
                    }
                };
                let (grid, monitor) = (self.aim.grid, work.monitor);
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

impl Opened<'_> {
    /// The profiles of `samples`, pulse by pulse.
    fn profiles(&self, samples: &[Complex32], profiles: &mut [Complex32], monitor: &dyn Monitor) {
        let num_samples = self.aim.collection.num_samples;
        let (profiler, each) = (&self.profiler, self.blurs.count);
        let scratch = || {
            let row = vec![Complex32::ZERO; num_samples];
            let fft = vec![Complex32::ZERO; profiler.scratch_length()];
            (row, fft, during(monitor, PROFILES))
        };
        profiles
            .par_chunks_exact_mut(profiler.length() + 1)
            .enumerate()
            .for_each_init(scratch, |(row, scratch, _), (i, profile)| {
                let first = i / each * num_samples;
                let pulse = &samples[first..first + num_samples];
                self.blurs.sharpen(i % each, pulse, row);
                profiler.profile(row, profile, scratch);
            });
    }

    /// What pulse `n` contributes with.
    fn source(&self, n: usize) -> Source<'_> {
        let collection = self.aim.collection;
        let pulse = &collection.pulses[n];
        let centre_hz = pulse.frequency_hz(collection.num_samples / 2);
        Source {
            pulse,
            scale: Scale {
                cycles_m: centre_hz / SPEED_OF_LIGHT_M_S,
                weight: self.aim.weights.slow[n] as f32,
            },
            reference: pulse.reference_terms(),
            coupling: centre_hz / pulse.step_hz,
        }
    }

    /// Sums what some pulses add to a run of pixels, into the scratch.
    fn sum(
        &self,
        sources: &[Source],
        profiles: &[Complex32],
        points: &Points,
        scratch: &mut Scratch,
    ) {
        let length = self.profiler.length();
        let Scratch { sums, blurred } = scratch;
        sums.clear();
        sums.resize(points.len(), Complex32::ZERO);
        let each = profiles.chunks_exact(self.blurs.count * (length + 1));
        for (source, profiles) in sources.iter().zip(each) {
            blurred.clear();
            let places = points.iter().map(DVec3::from);
            blurred.extend(places.map(|point| self.blurred(source, point)));
            blurred::add(profiles, length, &source.scale, blurred, sums);
        }
    }

    /// Where a point reads the profiles of a pulse.
    #[inline(always)]
    fn blurred(&self, source: &Source, point: DVec3) -> Blurred {
        let (at, velocity_m_s) = self.meaning.target(source.pulse, point);
        let terms = source.pulse.path_terms(at, velocity_m_s) - source.reference;
        let turns_m = source.pulse.step_hz / SPEED_OF_LIGHT_M_S;
        Blurred {
            path_m: terms.path_m,
            turns: (terms.path_m + terms.rate_m * source.coupling) * turns_m,
            level: self.blurs.level(self.blurs.turns(source.pulse, &terms)),
        }
    }
}
