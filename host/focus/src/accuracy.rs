//! The accuracy contract: what every former says of its image's error, and that a bound asked for is
//! kept or its miss is told.
//!
//! **The error** is relative and RMS over all pixels of the grid, `sqrt(sum |I - E|^2 / sum |E|^2)`, in
//! dB: `I` the image, `E` the sum of [`super`] over the stored samples, evaluated exactly. It is relative to
//! what the grid shows: of a grid that leaves the bright scatterers out, the image is weak, and the
//! same errors are relatively larger.
//!
//! **What a former plans.** A former multiplies each of the sum's terms by `1 + d` (`d` complex, of pixel,
//! pulse and frequency). Before anything heavy it bounds the RMS of `d` for its track, band and
//! grid: the *planned* error. If that misses the bound asked, it refuses ([`Asked::check`]). Where terms add
//! in phase, as on a scatterer, the image's error is at most that of the value itself (Cauchy and Schwarz); where they
//! add at random, as in noise and clutter, powers add and it is that again.
//!
//! Where antennas move from sample to sample of a pulse and the former takes all samples at one place, what that leaves
//! ([`super::sweep::residual`]) is added for it.
//!
//! **What becomes of the image.** Neither holds where terms cancel: beside a bright scatterer that the grid leaves out, errors
//! cancel less than its side lobes do. No plan knows the scene, so every image is looked at: as the pulses are
//! read, the exact sum at 64 of its pixels is kept besides ([`Exact`](super::exact::Exact)'s; a small part of the
//! work), and with `s^2` the mean square error there and `M` the image's mean square
//!
//! ```text
//! predicted^2 = max(planned^2, C s^2 / M + e^2 T / M)
//! ```
//!
//! with `T` the terms' powers and `e` the rounding of the sum's own phases.
//! `C` is what a mean of so few squares scatters by: 1 where all pixels are sampled (128 or fewer), 1.6 where the image is as a plan
//! takes it, 2 where it errs by more than that, and 10 where errors may sit in few pixels: where `s^2 / M` is 6 dB above the
//! plan's, or the grid is dark, `M` less than 0.3 of `T`, which is what noise would show. Where a bound is missed in this
//! way, the image is formed once more with a plan for that much less ([`ImageFormer::planning_for`]; `planned_for_db` in
//! the settings), twice the work and more; one that is missed then is an error too, after the work.
//! A grid that is coarser than the resolution may show a lone scatterer by its side lobes only, which are what the ends of the band and
//! of the aperture make; errors that are larger there are larger in it, with the range-Doppler algorithm by up to 14 dB.
//! A prediction of -3 dB or more says that the image is worth nothing, not how far it errs.
//!
//! Accuracy: `tests/random_formers.rs` measures every former against the sum over thousands of random
//! geometries, scenes and grids.

use std::ops::Range;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::exact::{LANES, add_pulse};
use super::{FormError, Formed, ImageFormer, Task, rounding, sweep};
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::power;
use subaperture_model::phase_history::{Collection, InputFile, PhaseHistory, ReadError};
use subaperture_signal::phase::widen;

/// Pixels at which every image is compared with the sum.
const SAMPLED_PIXELS: usize = 4 * LANES;

/// Pixels of which all are sampled.
const FEW_PIXELS: usize = 2 * SAMPLED_PIXELS;

/// `C` of the module's formula where there are more pixels, where they err by more than planned, and where
/// errors may sit in few of them.
const SCATTER: f64 = 1.6;
const LARGER_SCATTER: f64 = 2.0;
const UNEVEN_SCATTER: f64 = 10.0;

/// Error over the planned, in power, above which it is uneven.
const UNEVEN: f64 = 4.0;

/// Mean square over the terms' powers below which a grid is dark.
const DARK: f64 = 0.3;

/// Error, relative to the image's mean square, above which that tells of the error more than of the scene.
const SPOILT: f64 = 0.01;

/// Pulses that a thread adds to the samples at a time; their order in the sum is fixed.
const PULSES_A_PART: usize = 16;

/// Least error that a sample shows: the image's own rounding to float32.
const LEAST_DB: f64 = -200.0;

/// Whether an image may be worse than asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misses {
    /// A missed bound is [`FormError::BoundMissed`].
    Refused,
    /// A missed bound is recorded.
    Allowed,
}

/// What is asked of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// Bound on the error, dB, if there is one.
    pub bound_db: Option<f64>,
    /// Whether it may be missed.
    pub misses: Misses,
}

impl Asked {
    /// Goes on if an image predicted to err by `predicted_db` will do. `limit` says what limits it and what
    /// to do.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`] if it will not.
    pub fn check(
        &self,
        predicted_db: f64,
        limit: impl FnOnce() -> String,
    ) -> Result<(), FormError> {
        match self.bound_db {
            Some(bound_db)
                if self.misses == Misses::Refused && misses(predicted_db, Some(bound_db)) =>
            {
                Err(FormError::BoundMissed {
                    predicted_db,
                    bound_db,
                    limit: limit(),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Whether a prediction misses a bound; one that is no number does.
pub(super) fn misses(predicted_db: f64, bound_db: Option<f64>) -> bool {
    bound_db.is_some_and(|bound_db| predicted_db.is_nan() || predicted_db > bound_db)
}

/// Forms an image of `former`'s by `form`, which returns it with its planned error, under the contract.
///
/// # Errors
/// Those of `form`; [`FormError::NotFinite`]; [`FormError::BoundMissed`].
pub(super) fn keep<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
    form: impl FnOnce(&Task, &Asked) -> Result<Formed, FormError>,
) -> Result<Formed, FormError> {
    let asked = former.asked(misses);
    attempt(former, task, &asked, form)?.judge(&asked)
}

/// [`keep`]; where the plan was kept and the scene makes more of it than was asked, once more with a plan for so much
/// less ([`ImageFormer::planning_for`]).
///
/// # Errors
/// As [`keep`].
pub(super) fn keep_replanning<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
) -> Result<Formed, FormError> {
    let asked = former.asked(misses);
    let first = attempt(former, task, &asked, |task, asked| {
        former.form_planned(task, asked)
    })?;
    let next = first.next_plan_db(&asked);
    let Some((next_db, stricter)) = next.and_then(|db| Some((db, former.planning_for(db)?))) else {
        return first.judge(&asked);
    };
    let missed = first.judge(&asked).map(drop);
    let second = attempt(&*stricter, task, &stricter.asked(misses), |task, asked| {
        stricter.form_planned(task, asked)
    });
    match (second, missed) {
        // No such plan: what the first one's miss says is what can be done.
        (Err(FormError::BoundMissed { .. }), Err(missed)) => Err(missed),
        (Err(error), _) => Err(error),
        (Ok(mut second), _) => {
            let settings = &mut second.formed.settings;
            settings.insert("planned_for_db".to_owned(), next_db.into());
            second.judge(&asked)
        }
    }
}

/// An image, and what is known of its error, dB.
struct Attempt {
    formed: Formed,
    planned_db: f64,
    /// At the sampled pixels.
    measured_db: f64,
    num_sampled: usize,
}

impl Attempt {
    /// What to plan for so that `bound_db` is kept, the scene making as much of that plan as of this one.
    fn plan_for_db(&self, bound_db: f64) -> f64 {
        bound_db + self.planned_db - self.measured_db - 1.0
    }

    /// That, if the bound is missed, and not by the plan itself.
    fn next_plan_db(&self, asked: &Asked) -> Option<f64> {
        let bound_db = asked.bound_db?;
        let is_of_scene = self.planned_db <= bound_db && self.measured_db > bound_db;
        let next_db = self.plan_for_db(bound_db);
        (is_of_scene && next_db.is_finite()).then_some(next_db)
    }

    /// The image with its prediction, if it is what was asked for or misses are allowed.
    fn judge(mut self, asked: &Asked) -> Result<Formed, FormError> {
        let planned_db = self.planned_db;
        self.formed
            .expect(asked.bound_db, planned_db.max(self.measured_db));
        let settings = &mut self.formed.settings;
        settings.insert("planned_error_db".to_owned(), planned_db.into());
        asked.check(self.formed.predicted_error_db, || {
            format!(
                "the former plans {planned_db:.1} dB, and its error at {} pixels is more: the grid is dark, beside \
                 something bright that it leaves out; include that in --grid, or plan for less with --error-db {:.0}",
                self.num_sampled,
                self.plan_for_db(asked.bound_db.unwrap_or(0.0))
            )
        })?;
        Ok(self.formed)
    }
}

fn attempt<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    asked: &Asked,
    form: impl FnOnce(&Task, &Asked) -> Result<Formed, FormError>,
) -> Result<Attempt, FormError> {
    task.check()?;
    let swept = match former.follows_sweeps() {
        true => 0.0,
        false => sweep::residual(task.history.collection(), task.grid),
    };
    asked.check(20.0 * swept.log10(), || {
        "the antennas move from sample to sample of a pulse, and this former takes all samples of one at one place: \
         use --algorithm rdbp or bp"
            .to_owned()
    })?;
    let sampled = Sampled::new(task);
    let sampled_task = Task {
        history: &sampled,
        ..*task
    };
    let formed = form(&sampled_task, asked)?;
    check_finite(&formed, task.grid)?;
    let planned_db = match swept > 0.0 {
        true => rounding::total_db(&[10f64.powf(formed.predicted_error_db / 20.0), swept]),
        false => formed.predicted_error_db,
    };
    let measured_db = sampled.error_db(&formed, planned_db);
    Ok(Attempt {
        formed,
        planned_db,
        measured_db,
        num_sampled: sampled.pixels.len(),
    })
}

/// [`keep`] of an image whose pixels are no places at rest, so that there is no sum to compare them with: by the plan alone.
pub(super) fn keep_planned<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
) -> Result<Formed, FormError> {
    task.check()?;
    let asked = former.asked(misses);
    let mut formed = former.form_planned(task, &asked)?;
    check_finite(&formed, task.grid)?;
    formed.expect(asked.bound_db, formed.predicted_error_db);
    Ok(formed)
}

/// Refuses an image with a pixel that is NaN or infinite.
pub fn check_finite(formed: &Formed, grid: &ImageGrid) -> Result<(), FormError> {
    let finite = |z: &Complex32| z.re.is_finite() && z.im.is_finite();
    match formed.image.pixels.iter().position(|z| !finite(z)) {
        None => Ok(()),
        Some(i) => {
            let (row, column) = (i / formed.image.columns, i % formed.image.columns);
            Err(FormError::NotFinite {
                row,
                column,
                position_m: grid.position_m(row, column).to_array(),
            })
        }
    }
}

/// A history that keeps the exact sum at some pixels as its pulses are read.
struct Sampled<'a> {
    task: &'a Task<'a>,
    /// Indices of pixels, ascending, and where they lie.
    pixels: Vec<usize>,
    points: Vec<DVec3>,
    sums: Mutex<Sums>,
}

/// Sums so far, and the pulses that are in them.
struct Sums {
    values: Vec<Complex64>,
    /// Power of all weighted samples: `sum_n sum_k |w_n w_k z[n][k]|^2`.
    terms: f64,
    pulses: Range<usize>,
}

impl<'a> Sampled<'a> {
    fn new(task: &'a Task<'a>) -> Self {
        let total = task.grid.num_pixels() as usize;
        let columns = task.grid.columns.count;
        // Golden-ratio places: spread evenly without a lattice.
        let place =
            |i: usize| (((i as f64 + 0.5) * 0.618_033_988_75).fract() * total as f64) as usize;
        let mut pixels: Vec<usize> = match total <= FEW_PIXELS {
            true => (0..total).collect(),
            false => (0..SAMPLED_PIXELS).map(place).collect(),
        };
        pixels.sort_unstable();
        pixels.dedup();
        let points: Vec<DVec3> = pixels
            .iter()
            .map(|i| task.grid.position_m(i / columns, i % columns))
            .collect();
        let sums = Mutex::new(Sums {
            values: vec![Complex64::ZERO; points.len()],
            terms: 0.0,
            pulses: 0..0,
        });
        Self {
            task,
            pixels,
            points,
            sums,
        }
    }

    /// Adds pulses, unless they are in the sums: a former may read some twice.
    fn add(&self, pulses: Range<usize>, samples: &[Complex32]) {
        let width = self.collection().num_samples;
        let weights = self.task.weights;
        let mut sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        if sums.pulses.end != pulses.start {
            return;
        }
        let numbers: Vec<usize> = pulses.clone().collect();
        let parts: Vec<Vec<Complex64>> = numbers
            .par_chunks(PULSES_A_PART)
            .zip(samples.par_chunks(PULSES_A_PART * width))
            .map(|(numbers, samples)| {
                let mut part = vec![Complex64::ZERO; self.points.len()];
                let lanes = part.chunks_mut(LANES).zip(self.points.chunks(LANES));
                for (sums, points) in lanes {
                    for (&n, row) in numbers.iter().zip(samples.chunks_exact(width)) {
                        let pulse = &self.collection().pulses[n];
                        add_pulse(pulse, weights.slow[n], &weights.fast, row, points, sums);
                    }
                }
                part
            })
            .collect();
        for part in parts {
            let both = sums.values.iter_mut().zip(part);
            both.for_each(|(sum, value)| *sum += value);
        }
        for (n, row) in pulses.clone().zip(samples.chunks_exact(width)) {
            let terms = row.iter().zip(&weights.fast);
            let sum: f64 = terms.map(|(&z, w)| w * w * power(z)).sum();
            sums.terms += weights.slow[n].powi(2) * sum;
        }
        sums.pulses.end = pulses.end;
    }

    /// `C s^2 / M` of the module's formula, dB.
    fn error_db(&self, formed: &Formed, planned_db: f64) -> f64 {
        let sums = self.sums.lock().unwrap_or_else(|e| e.into_inner());
        let norm = self.task.weights.normalisation();
        let image = &formed.image.pixels;
        let (mut error, mut exact) = (0.0, 0.0);
        for (&pixel, &sum) in self.pixels.iter().zip(&sums.values) {
            let expected = sum * norm;
            error += (widen(image[pixel]) - expected).norm_sqr();
            exact += expected.norm_sqr();
        }
        let mean = image.iter().map(|&z| power(z)).sum::<f64>() / image.len() as f64;
        let count = self.pixels.len() as f64;
        let shown = error / count / mean;
        let relative = if self.pixels.len() == image.len() {
            error / exact
        } else if shown > SPOILT {
            UNEVEN_SCATTER * error / exact
        } else {
            let dark = mean < DARK * sums.terms * norm * norm;
            let above = shown / 10f64.powf(planned_db / 10.0);
            shown
                * match () {
                    () if dark || above > UNEVEN => UNEVEN_SCATTER,
                    () if above > 1.0 => LARGER_SCATTER,
                    () => SCATTER,
                }
        };
        if sums.pulses.end != self.collection().pulses.len() {
            // A former that left pulses out has no image of them all.
            return f64::INFINITY;
        }
        // The sum's phases are rounded too. Terms do not share that, so that it is small relative to their powers, not to
        // what is left of them.
        let own = rounding::path_phase_rad(self.task).powi(2) * sums.terms * norm * norm / mean;
        // Of an image of zeros where there should be zeros, nothing is wrong.
        match error == 0.0 && !own.is_finite() {
            true => LEAST_DB,
            false => 10.0 * (relative + own).log10(),
        }
    }
}

impl PhaseHistory for Sampled<'_> {
    fn collection(&self) -> &Collection {
        self.task.history.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.task.history.read(pulses.clone(), samples)?;
        self.add(pulses, samples);
        Ok(())
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.task.history.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        self.task.history.held_bytes()
    }

    fn start_ns(&self) -> Option<i64> {
        self.task.history.start_ns()
    }

    fn warnings(&self) -> Vec<String> {
        self.task.history.warnings()
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.task.history.inputs()
    }
}
