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
//! Accuracy: `tests/formers/random.rs` measures every former against the sum over thousands of random
//! geometries, scenes and grids.

use std::ops::Range;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::budget::Budget;
use super::exact::{LANES, add_pulse};
use super::{
    Aim, Decision, FormError, Formed, ImageFormer, Reason, Remedy, Task, Tile, Work, rounding,
    sweep,
};
use subaperture_kernels::horner;
use subaperture_kernels::lanes::Instructions;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::power;
use subaperture_model::phase_history::{Channel, Collection, InputFile, PhaseHistory, ReadError};
use subaperture_signal::phase::phasor;

/// Pixels at which every image is compared with the sum.
const SAMPLED_PIXELS: usize = 4 * LANES;

/// Least bound, dB, for which the exact sums at these are told well enough with runs of samples in float32.
const NARROW_DB: f64 = -80.0;

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
    /// would help.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`] if it will not.
    pub fn check(
        &self,
        predicted_db: f64,
        limit: impl FnOnce() -> Reason,
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

/// Forms the image of `task` as `former` decides, by `form`, under the contract.
///
/// # Errors
/// Those of the former and `form`; [`FormError::NotFinite`]; [`FormError::BoundMissed`].
pub(super) fn keep<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<Formed, FormError> {
    let asked = former.asked(misses);
    attempt(former, task, &asked, form)?.judge(&asked)
}

/// The image of `task`; where the plan was kept and the scene makes more of it than was asked, once more with a plan for so much
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
    let first = attempt(former, task, &asked, opened(former, task))?;
    let next = first.judgement.next_plan_db(&asked);
    let Some((next_db, stricter)) = next.and_then(|db| Some((db, former.planning_for(db)?))) else {
        return first.judge(&asked);
    };
    let missed = first.judge(&asked).map(drop);
    let second = attempt(
        &*stricter,
        task,
        &stricter.asked(misses),
        opened(&*stricter, task),
    );
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

/// What opens a decision and forms by it.
fn opened<'a, F: ImageFormer + ?Sized>(
    former: &'a F,
    task: &'a Task,
) -> impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError> + 'a {
    |decision, work, tiles| {
        former
            .open(task.aim(), &decision.choices)?
            .form(work, tiles)
    }
}

/// What is known of an image's error, dB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// As it was planned.
    pub planned_db: f64,
    /// As it shows at the sampled pixels; infinite of an image for which not all pulses were read.
    pub measured_db: f64,
    /// These pixels.
    pub num_sampled: usize,
}

impl Judgement {
    /// The error to expect: the larger of both.
    pub fn predicted_db(&self) -> f64 {
        self.planned_db.max(self.measured_db)
    }

    /// What to plan for so that `bound_db` is kept, the scene making as much of that plan as of this one.
    pub fn plan_for_db(&self, bound_db: f64) -> f64 {
        bound_db + self.planned_db - self.measured_db - 1.0
    }

    /// That, if what was asked is missed, and not by the plan itself.
    pub fn next_plan_db(&self, asked: &Asked) -> Option<f64> {
        let bound_db = asked.bound_db?;
        let is_of_scene = self.planned_db <= bound_db && self.measured_db > bound_db;
        let next_db = self.plan_for_db(bound_db);
        (is_of_scene && next_db.is_finite()).then_some(next_db)
    }

    /// Goes on if the image is what was asked for, or misses are allowed.
    ///
    /// # Errors
    /// [`FormError::BoundMissed`].
    pub fn check(&self, asked: &Asked) -> Result<(), FormError> {
        asked.check(self.predicted_db(), || {
            let error_db = self.plan_for_db(asked.bound_db.unwrap_or(0.0));
            let why = format!(
                "the former plans {:.1} dB, and its error at {} pixels is more: the grid is dark, beside \
                 something bright that it leaves out",
                self.planned_db, self.num_sampled,
            );
            Reason::new(why).helped_by(&[Remedy::GridWith, Remedy::PlanFor { error_db }])
        })
    }

    /// Notes it among the settings of an image, with the bound asked. Whether that is missed.
    pub fn note(&self, bound_db: Option<f64>, settings: &mut Settings) -> bool {
        settings.insert("planned_error_db".to_owned(), self.planned_db.into());
        note_error(bound_db, self.predicted_db(), settings)
    }
}

/// What an image was formed with, as its record has it.
pub type Settings = serde_json::Map<String, serde_json::Value>;

/// Notes the error to expect, and the bound it is to keep, among settings. Whether that is missed.
pub(super) fn note_error(
    bound_db: Option<f64>,
    predicted_db: f64,
    settings: &mut Settings,
) -> bool {
    let missed = misses(predicted_db, bound_db);
    settings.insert("predicted_error_db".to_owned(), predicted_db.into());
    if let Some(bound_db) = bound_db {
        settings.insert("error_db".to_owned(), bound_db.into());
        settings.insert("bound_missed".to_owned(), missed.into());
    }
    missed
}

/// An image, and what is known of its error.
struct Attempt {
    formed: Formed,
    judgement: Judgement,
}

impl Attempt {
    /// The image with its prediction, if it is what was asked for or misses are allowed.
    fn judge(mut self, asked: &Asked) -> Result<Formed, FormError> {
        let Self { formed, judgement } = &mut self;
        formed.predicted_error_db = judgement.predicted_db();
        formed.bound_missed = judgement.note(asked.bound_db, &mut formed.settings);
        judgement.check(asked)?;
        Ok(self.formed)
    }
}

fn attempt<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    asked: &Asked,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<Attempt, FormError> {
    task.check()?;
    let aim = task.aim();
    let swept = swept(former, &aim, asked)?;
    let probes = Probes::new(aim, asked.bound_db.unwrap_or(f64::NEG_INFINITY));
    let sampled = Sampled {
        history: task.history,
        probes: &probes,
    };
    let (tile, decision) = whole(former, task, asked, &sampled, form)?;
    let planned_db = with_sweep(decision.planned_db, swept);
    let judgement = match probes.record(&tile) {
        Some(record) => judge(&aim, &[record], planned_db),
        // A former that left pulses out has no image of them all.
        None => Judgement {
            planned_db,
            measured_db: f64::INFINITY,
            num_sampled: 0,
        },
    };
    Ok(Attempt {
        formed: Formed::on(task.grid, tile.pixels, planned_db, decision.settings),
        judgement,
    })
}

/// What taking all samples of a pulse at one place leaves, if `former` does, relative.
///
/// # Errors
/// [`FormError::BoundMissed`] if that alone is too much.
pub(super) fn swept<F: ImageFormer + ?Sized>(
    former: &F,
    aim: &Aim,
    asked: &Asked,
) -> Result<f64, FormError> {
    if former.follows_sweeps() {
        return Ok(0.0);
    }
    let swept = sweep::residual(aim.collection, aim.grid);
    asked.check(20.0 * swept.log10(), || {
        Reason::new(
            "the antennas move from sample to sample of a pulse, and this former takes all samples of one at one place",
        )
        .helped_by(&[Remedy::OtherFormer(&["rdbp", "bp"])])
    })?;
    Ok(swept)
}

/// A planned error with what taking all samples of a pulse at one place leaves.
pub(super) fn with_sweep(planned_db: f64, swept: f64) -> f64 {
    match swept > 0.0 {
        true => rounding::total_db(&[10f64.powf(planned_db / 20.0), swept]),
        false => planned_db,
    }
}

/// The whole image of `task` in memory, its pulses read from `history`.
fn whole<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    asked: &Asked,
    history: &dyn PhaseHistory,
    form: impl FnOnce(&Decision, &Work, &mut [Tile]) -> Result<(), FormError>,
) -> Result<(Tile, Decision), FormError> {
    // Before pixels are looked at: there may be far too many.
    let budget = Budget::for_task(task, 8)?;
    let decision = former.decide(&task.aim(), asked, task.monitor)?;
    let work = Work {
        history,
        memory_bytes: budget.left_bytes(),
        monitor: task.monitor,
    };
    let mut tile = Tile::whole(task.grid);
    form(&decision, &work, std::slice::from_mut(&mut tile))?;
    tile.check_finite(task.grid)?;
    Ok((tile, decision))
}

/// [`keep`] of an image whose pixels are no places at rest, so that there is no sum to compare them with: by the plan alone.
pub(super) fn keep_planned<F: ImageFormer + ?Sized>(
    former: &F,
    task: &Task,
    misses: Misses,
) -> Result<Formed, FormError> {
    task.check()?;
    let asked = former.asked(misses);
    let (tile, decision) = whole(former, task, &asked, task.history, opened(former, task))?;
    let planned_db = decision.planned_db;
    let mut formed = Formed::on(task.grid, tile.pixels, planned_db, decision.settings);
    formed.expect(asked.bound_db, planned_db);
    Ok(formed)
}

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
    /// Relative RMS error of the exact sums' own arithmetic, of samples that add at random.
    #[serde(default)]
    pub rounding: f64,
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

/// What the records of all tiles tell of an image that was planned to err by `planned_db`: `C s^2 / M` of the module's
/// formula.
pub(super) fn judge(aim: &Aim, records: &[TileRecord], planned_db: f64) -> Judgement {
    let total = aim.grid.num_pixels() as usize;
    let (mut error, mut exact, mut count) = (0.0, 0.0, 0usize);
    for seen in records.iter().flat_map(|record| &record.seen) {
        let formed = Complex64::new(seen.formed[0].into(), seen.formed[1].into());
        let expected = Complex64::new(seen.exact[0], seen.exact[1]);
        error += (formed - expected).norm_sqr();
        exact += expected.norm_sqr();
        count += 1;
    }
    let mean = records.iter().map(|record| record.power).sum::<f64>() / total as f64;
    let terms = records.iter().fold(0.0f64, |most, r| most.max(r.terms));
    let shown = error / count as f64 / mean;
    let relative = if count == total {
        error / exact
    } else if shown > SPOILT {
        UNEVEN_SCATTER * error / exact
    } else {
        let dark = mean < DARK * terms;
        let above = shown / 10f64.powf(planned_db / 10.0);
        shown
            * match () {
                () if dark || above > UNEVEN => UNEVEN_SCATTER,
                () if above > 1.0 => LARGER_SCATTER,
                () => SCATTER,
            }
    };
    // The sum's phases are rounded too. Terms do not share that, so that it is small relative to their powers, not to
    // what is left of them.
    let rounding = records.iter().fold(0.0f64, |most, r| most.max(r.rounding));
    let own = rounding.powi(2) * terms / mean;
    // Of an image of zeros where there should be zeros, nothing is wrong.
    let measured_db = match error == 0.0 && !own.is_finite() {
        true => LEAST_DB,
        false => 10.0 * (relative + own).log10(),
    };
    Judgement {
        planned_db,
        measured_db,
        num_sampled: count,
    }
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

    /// Relative RMS error of the sums' own phases.
    fn rounding(&self) -> f64 {
        let paths = rounding::path_phase_rad(&self.aim);
        if self.narrow {
            paths.hypot(horner::NARROW_RMS)
        } else {
            paths
        }
    }

    /// Adds pulses, unless they are in the sums: a former may read some twice.
    fn add(&self, pulses: Range<usize>, samples: &[Complex32]) {
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
                let mut part = vec![Complex64::ZERO; self.points.len()];
                let mut terms = 0.0;
                for (&n, row) in numbers.iter().zip(samples.chunks_exact(width)) {
                    self.add_pulse(n, row, &fast, &mut part);
                    let sum = horner::power(Instructions::best(), row, &fast);
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
            power: tile.pixels.iter().map(|&z| power(z)).sum(),
            seen: seen.collect(),
            terms: sums.terms * norm * norm,
            rounding: self.rounding(),
        })
    }
}

impl PhaseHistory for Sampled<'_> {
    fn collection(&self) -> &Collection {
        self.history.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses.clone(), samples)?;
        self.probes.add(pulses, samples);
        Ok(())
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
