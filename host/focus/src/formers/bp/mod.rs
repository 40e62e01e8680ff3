//! Backprojection: every pulse's range profile read at every pixel's range.
//!
//! ```text
//! I(p) = sum_n w_slow[n] exp(+j 2 pi f_c r_n(p) / c) profile_n(r_n(p)),   r_n(p) = path_n(p) - reference_path_n
//! ```
//!
//! (Schone 2020, chapter 2 and 5.1), with `f_c` the frequency of sample `K/2`. Profiles are upsampled
//! by zero padding, emphasised for linear interpolation ([`RangeProfiler`]), in float32; ranges and
//! phases are float64.
//!
//! Neglected: nothing but interpolation, whose error the upsampling is chosen for (`error_db`).
//! Each pulse's own positions and frequencies are used, so any track will do.
//!
//! **Motion from sample to sample** ([`subaperture_model::phase_history::Sweep`], whose terms these are) shifts a pixel's range
//! profile by `f_c r' / step`, which is added to the range that is read, and blurs it by the phase
//! `2 pi q d^2`, `q = (step r' + f_c r'' / 2) / c` turns, `d = k - K/2`. Profiles are made for even steps of `q` and read
//! linearly between the two nearest: the error of a sample at the band's edge is `h^2 / sqrt(120)`, `h` the step
//! there in radians. The term in `d^3` is neglected and predicted.
//!
//! Cost: a square root, a sine and cosine and about 20 operations a pixel and pulse; one transform a
//! pulse; with motion from sample to sample twice as much, and a transform for each step of `q`. Memory: a
//! block of upsampled profiles beside the image.
//!
//! Accuracy: the bound asked for, against [`crate::exact`], on the simulated and the recorded scenes of
//! the tests.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use serde_json::json;

use crate::budget::Budget;
use crate::pixels::add_to_each;
use crate::sweep::{self, places};
use crate::{Asked, FormError, Formed, ImageFormer, MARGIN_DB, Task, rounding};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::phase::phasor32;
use subaperture_signal::range_profile::RangeProfiler;

/// Backprojection with upsampled range profiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backprojection {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

/// What one pulse contributes with, beside its profiles.
struct Source<'a> {
    pulse: &'a Pulse,
    weight: f32,
    centre_cycles_m: f64,
    bins_m: f64,
    /// What phases are referred to, and how that changes from sample to sample.
    reference: PathTerms,
    /// `f_c / step`: samples by which a rate of a metre a sample shifts range, in metres.
    coupling: f64,
}

/// A target's place and velocity at the moment of a pulse, for a point of the grid. Metres, metres a second.
pub(crate) type Target = (DVec3, DVec3);

impl ImageFormer for Backprojection {
    fn name(&self) -> &'static str {
        "bp"
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn form_planned(&self, task: &Task, asked: &Asked) -> Result<Formed, FormError> {
        backproject(task, self.error_db, asked, |_, point| (point, DVec3::ZERO))
    }
}

/// Backprojection with `target(pulse, point)` for where a grid's point is.
pub(crate) fn backproject(
    task: &Task,
    error_db: f64,
    asked: &Asked,
    target: impl Fn(&Pulse, DVec3) -> Target + Sync,
) -> Result<Formed, FormError> {
    let collection = task.history.collection();
    let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
    let mut budget = Budget::for_task(task, 8)?;

    let sweeps = collection.sweeps();
    // Half of the error's power for either interpolation, where there are two.
    let share_db = error_db - MARGIN_DB - if sweeps { 10.0 * 2f64.log10() } else { 0.0 };
    let oversampling = RangeProfiler::oversampling_for(share_db);
    let blurs = if sweeps {
        Some(Blurs::new(task, share_db, &target))
    } else {
        None
    };
    let profiles_each = blurs.as_ref().map_or(1, |blurs| blurs.count);
    // Normalised here, before the transform sums: large samples stay within float32.
    let norm = task.weights.normalisation();
    let window: Vec<f64> = task.weights.fast.iter().map(|w| w * norm).collect();
    let profiler = RangeProfiler::new(&window, oversampling);
    let length = profiler.length();
    let pulse_bytes = 8 * (num_samples + profiles_each * (length + 1)) as u64;
    let block = budget.take_block(
        "a range profile",
        pulse_bytes,
        num_pulses.min(64),
        "raise --memory",
    )?;
    let planned_db = rounding::total_db(&[
        profiler.error(),
        blurs.as_ref().map_or(0.0, |blurs| blurs.error),
        profiler.rounding(),
        // Sums over a block, and over blocks.
        rounding::sum(block),
        rounding::sum(num_pulses.div_ceil(block)),
        rounding::path_phase_rad(task),
    ]);
    asked.check(planned_db, || {
        "float32 sums and profiles leave no less: use --algorithm exact".to_owned()
    })?;
    let mut samples = vec![Complex32::ZERO; block * num_samples];
    let mut profiles = vec![Complex32::ZERO; block * profiles_each * (length + 1)];
    let mut pixels = vec![Complex32::ZERO; task.grid.num_pixels() as usize];

    for first in (0..num_pulses).step_by(block) {
        let pulses = first..(first + block).min(num_pulses);
        let samples = &mut samples[..pulses.len() * num_samples];
        task.history.read(pulses.clone(), samples)?;
        let profiles = &mut profiles[..pulses.len() * profiles_each * (length + 1)];
        profiles
            .par_chunks_exact_mut(length + 1)
            .enumerate()
            .for_each_init(
                || {
                    let row = vec![Complex32::ZERO; num_samples];
                    (row, vec![Complex32::ZERO; profiler.scratch_length()])
                },
                |(row, scratch), (i, profile)| {
                    let first = i / profiles_each * num_samples;
                    let pulse = &samples[first..first + num_samples];
                    match &blurs {
                        None => profiler.profile(pulse, profile, scratch),
                        Some(blurs) => {
                            blurs.sharpen(i % profiles_each, pulse, row);
                            profiler.profile(row, profile, scratch);
                        }
                    }
                },
            );
        let sources: Vec<Source> = pulses
            .clone()
            .map(|n| {
                let pulse = &collection.pulses[n];
                let centre_hz = pulse.frequency_hz(num_samples / 2);
                Source {
                    pulse,
                    weight: task.weights.slow[n] as f32,
                    centre_cycles_m: centre_hz / SPEED_OF_LIGHT_M_S,
                    bins_m: pulse.step_hz / SPEED_OF_LIGHT_M_S,
                    reference: pulse.reference_terms(),
                    coupling: centre_hz / pulse.step_hz,
                }
            })
            .collect();
        add_to_each(task, &mut pixels, |point| match &blurs {
            None => contribution(point, &sources, profiles, length, &target),
            Some(blurs) => blurred(point, &sources, profiles, length, blurs, &target),
        });
        if task.monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        task.monitor.progress(pulses.end as f64 / num_pulses as f64);
    }

    let settings = json!({
        "profile_length": length,
        "oversampling": length as f64 / num_samples as f64,
        "profiles_each": profiles_each,
    });
    Ok(Formed::new(task, pixels, planned_db, settings))
}

/// What a block of pulses adds to one pixel.
fn contribution(
    point: DVec3,
    sources: &[Source],
    profiles: &[Complex32],
    length: usize,
    target: &impl Fn(&Pulse, DVec3) -> Target,
) -> Complex32 {
    let mut sum = Complex32::ZERO;
    for (source, profile) in sources.iter().zip(profiles.chunks_exact(length + 1)) {
        let path_m = source.pulse.relative_path_m(target(source.pulse, point).0);
        let (whole, fraction) = place(path_m * source.bins_m, length);
        let value = profile[whole] + (profile[whole + 1] - profile[whole]) * fraction;
        sum += phasor32(path_m * source.centre_cycles_m) * value * source.weight;
    }
    sum
}

/// The same with motion from sample to sample.
fn blurred(
    point: DVec3,
    sources: &[Source],
    profiles: &[Complex32],
    length: usize,
    blurs: &Blurs,
    target: &impl Fn(&Pulse, DVec3) -> Target,
) -> Complex32 {
    let mut sum = Complex32::ZERO;
    let each = blurs.count * (length + 1);
    for (source, profiles) in sources.iter().zip(profiles.chunks_exact(each)) {
        let (at, velocity_m_s) = target(source.pulse, point);
        let terms = source.pulse.path_terms(at, velocity_m_s) - source.reference;
        let turns = (terms.path_m + terms.rate_m * source.coupling) * source.bins_m;
        let (whole, fraction) = place(turns, length);
        let read = |level: usize| {
            let first = level * (length + 1) + whole;
            profiles[first] + (profiles[first + 1] - profiles[first]) * fraction
        };
        let (level, part) = blurs.level(blurs.turns(source.pulse, &terms));
        let mut value = read(level);
        if part > 0.0 {
            value += (read(level + 1) - value) * part;
        }
        sum += phasor32(terms.path_m * source.centre_cycles_m) * value * source.weight;
    }
    sum
}

/// The bin of a profile before a place given in turns of the profile, and the part of a bin beyond it.
fn place(turns: f64, length: usize) -> (usize, f32) {
    let bin = (turns - turns.floor()) * length as f64;
    // `turns - floor` may round to 1; the last whole bin then, where the repeated value stands.
    let whole = (bin as usize).min(length - 1);
    (whole, (bin - whole as f64) as f32)
}

/// Even steps of the phase `q (K/2)^2`, turns at the band's edge, that motion from sample to sample leaves.
struct Blurs {
    num_samples: usize,
    least_turns: f64,
    step_turns: f64,
    count: usize,
    /// Relative RMS error that is left: of the steps, and of what is no parabola.
    error: f64,
}

impl Blurs {
    /// For all pulses and points of a grid, so fine that reading between the steps errs by `error_db`.
    fn new(task: &Task, error_db: f64, target: &(impl Fn(&Pulse, DVec3) -> Target + Sync)) -> Self {
        let collection = task.history.collection();
        let mut blurs = Self {
            num_samples: collection.num_samples,
            least_turns: 0.0,
            step_turns: 0.0,
            count: 1,
            error: 0.0,
        };
        // Smooth over the grid, so its extremes are near those of 9 x 9 points, or of its edges.
        let points: Vec<DVec3> = places(task.grid, 9).collect();
        let of_pulse = |pulse: &Pulse| {
            let reference = pulse.reference_terms();
            let turns = points.iter().map(|&point| {
                let (at, velocity_m_s) = target(pulse, point);
                blurs.turns(pulse, &(pulse.path_terms(at, velocity_m_s) - reference))
            });
            turns.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
                (low.min(q), high.max(q))
            })
        };
        let (low, high) = collection.pulses.par_iter().map(of_pulse).reduce(
            || (f64::INFINITY, f64::NEG_INFINITY),
            |a, b| (a.0.min(b.0), a.1.max(b.1)),
        );
        let margin = 0.05 * (high - low);
        let span = high - low + 2.0 * margin;
        let allowed = 10f64.powf(error_db / 20.0);
        let most_rad = (allowed * 120f64.sqrt()).sqrt();
        // A single profile, halfway, errs by its distance from the halfway.
        if TAU * span / 2.0 <= allowed {
            blurs.least_turns = 0.5 * (low + high);
            blurs.error = TAU * span / 2.0;
        } else {
            let steps = (TAU * span / most_rad).ceil().clamp(1.0, 1e9);
            blurs.count = steps as usize + 1;
            blurs.least_turns = low - margin;
            blurs.step_turns = span / steps;
            blurs.error = (TAU * blurs.step_turns).powi(2) / 120f64.sqrt();
        }
        let cubic = sweep::worst(collection, task.grid, |pulse, point, after| {
            let (at, velocity_m_s) = target(pulse, point);
            let moved_m = velocity_m_s * (after * pulse.sweep.sample_s);
            let path_m = pulse.path_after_m(at + moved_m, after) - pulse.reference_drift_m(after);
            let terms = pulse.path_terms(at, velocity_m_s) - pulse.reference_terms();
            let frequency_hz =
                pulse.start_hz + (after + (collection.num_samples / 2) as f64) * pulse.step_hz;
            let centre_hz = pulse.frequency_hz(collection.num_samples / 2);
            let modelled = centre_hz * terms.path_m
                + after * (pulse.step_hz * terms.path_m + centre_hz * terms.rate_m)
                + after * after * (pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m);
            (frequency_hz * (path_m - pulse.reference_path_m) - modelled) / SPEED_OF_LIGHT_M_S
        });
        blurs.error = blurs.error.hypot(cubic);
        blurs
    }

    /// `q (K/2)^2`.
    fn turns(&self, pulse: &Pulse, terms: &PathTerms) -> f64 {
        let half = (self.num_samples / 2) as f64;
        let centre_hz = pulse.start_hz + half * pulse.step_hz;
        let q = pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m;
        q / SPEED_OF_LIGHT_M_S * half * half
    }

    /// The profile before a phase, and the part of a step beyond it.
    fn level(&self, turns: f64) -> (usize, f32) {
        if self.count == 1 {
            return (0, 0.0);
        }
        let place = ((turns - self.least_turns) / self.step_turns).max(0.0);
        let level = (place as usize).min(self.count - 2);
        (level, (place - level as f64) as f32)
    }

    /// A pulse without the blur of a level.
    fn sharpen(&self, level: usize, pulse: &[Complex32], row: &mut [Complex32]) {
        let turns = self.least_turns + level as f64 * self.step_turns;
        let half = (self.num_samples / 2).max(1) as f64;
        for (k, (out, z)) in row.iter_mut().zip(pulse).enumerate() {
            let x = (k as f64 - (self.num_samples / 2) as f64) / half;
            *out = z * phasor32(turns * x * x);
        }
    }
}
