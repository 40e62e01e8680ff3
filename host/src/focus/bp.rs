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
//! Cost: a square root, a sine and cosine and about 20 operations a pixel and pulse; one transform a
//! pulse. Memory: a block of upsampled profiles beside the image.
//!
//! Accuracy: the bound asked for, against [`super::exact`], on the simulated and the recorded scenes of
//! the tests.

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;
use serde_json::json;

use super::budget::Budget;
use super::pixels::add_to_each;
use super::{Asked, FormError, Formed, ImageFormer, MARGIN_DB, Task, rounding};
use crate::SPEED_OF_LIGHT_M_S;
use crate::phase_history::Pulse;
use crate::signal::phase::phasor32;
use crate::signal::range_profile::RangeProfiler;

/// Backprojection with upsampled range profiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backprojection {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

/// What one pulse contributes with, beside its profile.
struct Source<'a> {
    pulse: &'a Pulse,
    weight: f32,
    centre_cycles_m: f64,
    bins_m: f64,
}

impl ImageFormer for Backprojection {
    fn name(&self) -> &'static str {
        "bp"
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn form_planned(&self, task: &Task, asked: &Asked) -> Result<Formed, FormError> {
        backproject(task, self.error_db, asked, Pulse::relative_path_m)
    }
}

/// Backprojection with `path_m(pulse, point)` for the path of a grid's point relative to the pulse's
/// reference, metres.
pub(super) fn backproject(
    task: &Task,
    error_db: f64,
    asked: &Asked,
    path_m: impl Fn(&Pulse, DVec3) -> f64 + Sync,
) -> Result<Formed, FormError> {
    let collection = task.history.collection();
    let (num_samples, num_pulses) = (collection.num_samples, collection.pulses.len());
    let mut budget = Budget::for_task(task, 8)?;

    let oversampling = RangeProfiler::oversampling_for(error_db - MARGIN_DB);
    // Normalised here, before the transform sums: large samples stay within float32.
    let norm = task.weights.normalisation();
    let window: Vec<f64> = task.weights.fast.iter().map(|w| w * norm).collect();
    let profiler = RangeProfiler::new(&window, oversampling);
    let length = profiler.length();
    let pulse_bytes = 8 * (num_samples + length + 1) as u64;
    let block = budget.take_block(
        "a range profile",
        pulse_bytes,
        num_pulses.min(64),
        "raise --memory",
    )?;
    let planned_db = rounding::total_db(&[
        profiler.error(),
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
    let mut profiles = vec![Complex32::ZERO; block * (length + 1)];
    let mut pixels = vec![Complex32::ZERO; task.grid.num_pixels() as usize];

    for first in (0..num_pulses).step_by(block) {
        let pulses = first..(first + block).min(num_pulses);
        let samples = &mut samples[..pulses.len() * num_samples];
        task.history.read(pulses.clone(), samples)?;
        let profiles = &mut profiles[..pulses.len() * (length + 1)];
        profiles
            .par_chunks_exact_mut(length + 1)
            .zip(samples.par_chunks_exact(num_samples))
            .for_each_init(
                || vec![Complex32::ZERO; profiler.scratch_length()],
                |scratch, (profile, pulse)| profiler.profile(pulse, profile, scratch),
            );
        let sources: Vec<Source> = pulses
            .clone()
            .map(|n| {
                let pulse = &collection.pulses[n];
                Source {
                    pulse,
                    weight: task.weights.slow[n] as f32,
                    centre_cycles_m: pulse.frequency_hz(num_samples / 2) / SPEED_OF_LIGHT_M_S,
                    bins_m: pulse.step_hz / SPEED_OF_LIGHT_M_S,
                }
            })
            .collect();
        add_to_each(task, &mut pixels, |point| {
            contribution(point, &sources, profiles, length, &path_m)
        });
        if task.monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        task.monitor.progress(pulses.end as f64 / num_pulses as f64);
    }

    let settings = json!({
        "profile_length": length,
        "oversampling": length as f64 / num_samples as f64,
    });
    Ok(Formed::new(task, pixels, planned_db, settings))
}

/// What a block of pulses adds to one pixel.
fn contribution(
    point: DVec3,
    sources: &[Source],
    profiles: &[Complex32],
    length: usize,
    path_m: &impl Fn(&Pulse, DVec3) -> f64,
) -> Complex32 {
    let mut sum = Complex32::ZERO;
    for (source, profile) in sources.iter().zip(profiles.chunks_exact(length + 1)) {
        let path_m = path_m(source.pulse, point);
        let turns = path_m * source.bins_m;
        let bin = (turns - turns.floor()) * length as f64;
        // `turns - floor` may round to 1; the last whole bin then, where the repeated value stands.
        let whole = (bin as usize).min(length - 1);
        let fraction = (bin - whole as f64) as f32;
        let value = profile[whole] + (profile[whole + 1] - profile[whole]) * fraction;
        sum += phasor32(path_m * source.centre_cycles_m) * value * source.weight;
    }
    sum
}
