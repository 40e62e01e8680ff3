//! Fast factorised backprojection: patches within patches, each with no more pulses and frequencies
//! than it needs.
//!
//! Compensated to a patch's centre `q`, the phase history of the patch's own pixels varies slowly: by
//! `2 pi f (path_n(p) - path_n(q)) / c`, over frequency as the patch is deep, over slow time as it is
//! wide. Of a patch half as large, half of the pulses and half of the frequencies say all. So
//!
//! ```text
//! y[n][k]   = z[n][k] exp(+j 2 pi f_k (path_n(q) - reference_path_n) / c)            compensate to q
//! y'[i][l]  = y[2 i'][2 l'] + what of odd pulses and frequencies goes there         halve
//! ```
//!
//! and the same again from each patch to its four quarters, with their own centres, until a patch is a small
//! one of few pulses; there plain backprojection ends it (`leaf`). Odd places go to the even ones about them by an
//! interpolation kernel of the pixels' own phase, `exp(j phase(n)) = sum_i h[i] exp(j phase(2 i))`
//! ([`subaperture_signal::halfway`], [`subaperture_kernels::halving`]), which is all that the sum over pulses and frequencies needs; it
//! makes no matter what lies outside the patch. At the ends, `h` reaches past the data: halved histories are by `W - 1` longer than
//! half, and there the antennas go on smoothly (`thinned`). Pulses that are kept are where they were.
//!
//! This is the quadtree form (S. Xiao, D. Munson, S. Basu and Y. Bresler, 2000) of fast backprojection,
//! not the one that merges images of sub-apertures (Ulander, Hellsten and Stenstroem, 2003): a merge
//! interpolates complex images in two dimensions, `W^2` operations a value, where halving is
//! separable, `2 W`, and its error is the kernel's alone. It is also [`crate::rdbp`]'s patch compensation,
//! over several levels.
//!
//! Neglected: the kernel's error, once a halving and direction; the range profiles' ([`crate::bp`]); what of the antennas' way from
//! pulse to pulse is not smooth, so far as it differs across the patch; and what becomes of the phase beyond the data's
//! ends and of antennas that turn quickly. Each has its share of the bound, and every halving is held to
//! them on the patch and the pulses it is made of, before it is made (`refine`): one that would cost more is
//! not made. A track on which slow time cannot be halved (jitter, antennas in turn, a patch around the
//! antennas) so costs what plain backprojection does, and errs no more.
//!
//! Cost: for `N x N` pixels, `N` pulses and `N` frequencies, about `18 + 6 W` real operations a sample and level (a sample of a patch
//! is looked at by each of its quarters), `log2(N / 64)` levels of `N^2` samples or more, and some 100 pulses a pixel at the end:
//! `N^2 log N` where backprojection takes `N^3`. The kernel's reach makes small histories grow, so it pays from some
//! hundreds of pixels and pulses on. Sizes of leaves and first patches, and stretches of pulses, are chosen by an account of time
//! (`choice`, `cost`).
//!
//! Memory: the histories on the way to one leaf, of which the first patch's is the largest; a few megabytes a thread; the image.
//! First patches and stretches are chosen such that this fits the plan's scratch.
//!
//! Accuracy: the bound asked for, against [`crate::exact`], in `tests/formers/pfa_ffbp.rs`.

mod choice;
mod cost;
#[cfg(test)]
mod counted;
mod descent;
mod history;
mod leaf;
mod patch_view;
mod refine;
mod shares;
mod thinned;
mod tree;

use std::sync::atomic::AtomicUsize;

use serde_json::json;

use super::options::ERROR_DB;
use super::{Entry, of};
use crate::budget::{Budget, on_threads};
use crate::former::{chosen, misfit};
use crate::patch::Patches;
use crate::sub_cpi::shared_band;
use crate::{
    Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer, Reason, Remedy, Tile,
    Work, rounding,
};
use subaperture_model::monitor::Monitor;

use choice::Choices;
use cost::Demand;
use descent::{Descent, Pool, Wanted, task_level};
use refine::{Recorded, Refiner};
use thinned::Stretch;
use tree::Node;

/// Fast factorised backprojection.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FastFactorised {
    /// Bound on the relative RMS error of the image, dB (negative).
    pub error_db: f64,
}

impl Default for FastFactorised {
    fn default() -> Self {
        Self {
            error_db: DEFAULT_ERROR_DB,
        }
    }
}

impl FastFactorised {
    /// With this bound on the relative RMS error of the image, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db }
    }
}

/// In the list of formers.
pub(super) const ENTRY: Entry = Entry {
    name: "ffbp",
    summary: "fast factorised backprojection: patches within patches, any track",
    options: &[ERROR_DB],
    of: of::<FastFactorised>,
};

impl ImageFormer for FastFactorised {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_relief(&self) -> bool {
        true
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn decide(&self, aim: &Aim, asked: &Asked, _: &dyn Monitor) -> Result<Decision, FormError> {
        shared_band(aim.collection)?;
        let refiner = Refiner::of(aim.collection, self.error_db);
        let phases = [
            rounding::path_phase_rad(aim.collection, aim.grid),
            rounding::band_phase_rad(aim),
        ];
        let arithmetic = libm::hypot(phases[0], phases[1]);
        let num_pulses = aim.collection.pulses.len();
        let planned_db = refiner.shares().planned_db(num_pulses, arithmetic);
        asked.check(planned_db, || {
            Reason::new("kernels and float32 sums leave no less")
                .helped_by(&[Remedy::OtherFormer(&["bp", "exact"])])
        })?;
        let choices = Choices::of(self.error_db, aim, &refiner);
        let stretches = choices.stretches(aim, refiner.taps());
        let tree = choices.tree;
        let ways = cost::ways(aim, &refiner, &stretches, &tree);
        Ok(Decision {
            settings: json!({
                "stretches": stretches.len(),
                "levels": tree.levels,
                "leaf_rows": tree.leaf[0],
                "leaf_columns": tree.leaf[1],
                "kernel_taps": refiner.taps().len(),
            }),
            planned_db,
            grain: tree.patch_size(tree.levels),
            cost: cost::cost(&ways, &refiner),
            choices: json!(choices),
        })
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(Box::new(Opened::new(aim, chosen(ENTRY.name, choices)?)?))
    }
}

/// Ready to form.
struct Opened<'a> {
    aim: Aim<'a>,
    choices: Choices,
    refiner: Refiner<'a>,
    stretches: Vec<Stretch>,
    demand: Demand,
    tasks: Patches,
}

impl<'a> Opened<'a> {
    fn new(aim: Aim<'a>, choices: Choices) -> Result<Self, FormError> {
        shared_band(aim.collection)?;
        if !choices.are_of(&aim) {
            let what = "its stretches are not of these pulses, its leaves are of no size that there is, or its bound is none";
            return Err(misfit(ENTRY.name, what));
        }
        let refiner = Refiner::of(aim.collection, choices.error_db);
        let stretches = choices.stretches(&aim, refiner.taps());
        let tree = choices.tree;
        Ok(Self {
            demand: cost::demand(&cost::ways(&aim, &refiner, &stretches, &tree)),
            tasks: Patches::of_size(aim.grid, tree.patch_size(task_level(&tree))),
            stretches,
            refiner,
            choices,
            aim,
        })
    }

    fn recorded<'b>(
        &self,
        work: &'b Work,
        Reading { at_once, hold, .. }: Reading,
        stretch: &Stretch,
    ) -> Result<Recorded<'b>, FormError> {
        let held = match hold {
            true => Some(self.refiner.hold(stretch, work.history, at_once)?),
            false => None,
        };
        let weights = self.aim.weights;
        let norm = weights.normalisation();
        let slow = &weights.slow[stretch.pulses.clone()];
        Ok(Recorded {
            history: work.history,
            at_once,
            monitor: work.monitor,
            fast: weights.fast.iter().map(|&w| w as f32).collect(),
            slow: slow.iter().map(|w| (w * norm) as f32).collect(),
            held,
        })
    }

    fn add_all(
        &self,
        work: &Work,
        (roots, reading): (&[Node], Reading),
        breadth_bytes: u64,
        tiles: &mut [Tile],
    ) -> Result<(), FormError> {
        let wanted: Wanted = self.tasks.split_by_place(tiles);
        let (done, pool) = (AtomicUsize::new(0), Pool::default());
        let tasks = self.stretches.len() * wanted.len();
        for stretch in &self.stretches {
            let recorded = self.recorded(work, reading, stretch)?;
            let descent = Descent {
                monitor: work.monitor,
                grid: self.aim.grid,
                tree: &self.choices.tree,
                refiner: &self.refiner,
                transforms: self.aim.means.transforms,
                stretch,
                wanted: &wanted,
                pool: &pool,
                breadth_bytes,
                done: &done,
                tasks,
            };
            descent.all(&recorded, roots, reading.ahead)?;
            if work.monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
        }
        Ok(())
    }
}

/// How recorded pulses are read.
#[derive(Clone, Copy)]
struct Reading {
    /// So many together.
    at_once: usize,
    /// All of a stretch, once for all first patches.
    hold: bool,
    /// For a first patch while there is another one's work to do.
    ahead: bool,
}

/// Levels that are made side by side, each of four histories of up to half of one before.
const BREADTH: u64 = 8;
/// A history larger than as much for each thread is halved by all threads together.
const LARGEST_BREADTH: u64 = 5 << 20;

impl Forming for Opened<'_> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let mut budget = Budget::new(work.memory_bytes);
        let account = self.tasks.account_bytes(tiles);
        budget.take("patches", account.into(), &[Remedy::MoreMemory])?;
        let held = self.demand.held_bytes;
        budget.take("histories of patches", held.into(), &[Remedy::MoreMemory])?;
        let threads = rayon::current_num_threads();
        let mut reading_for = threads;
        while reading_for > 1 && self.refiner.read_bytes(reading_for) > budget.left_bytes() / 4 {
            reading_for /= 2;
        }
        let bytes = self.refiner.read_bytes(reading_for);
        budget.take("pulses being read", bytes.into(), &[Remedy::MoreMemory])?;
        let stretches = self.stretches.iter();
        let held = stretches.map(|s| self.refiner.held_bytes(s)).max();
        let held = held.unwrap_or(0);
        let roots = self.choices.tree.roots_of(self.aim.grid, tiles);
        let several = roots.len() > 1;
        let ahead = several && threads > 1 && self.demand.held_bytes <= budget.left_bytes() / 4;
        if ahead {
            let bytes = self.demand.held_bytes;
            budget.take(
                "the next patch's histories",
                bytes.into(),
                &[Remedy::MoreMemory],
            )?;
        }
        let hold =
            several && work.history.at_hand(0..0).is_none() && held <= budget.left_bytes() / 2;
        if hold {
            budget.take("recorded pulses", held.into(), &[Remedy::MoreMemory])?;
        }
        let reading = Reading {
            at_once: self.refiner.read_together(reading_for),
            hold,
            ahead,
        };
        let largest = threads as u64 * LARGEST_BREADTH;
        let breadth_bytes = (budget.left_bytes() / 2 / BREADTH).min(largest);
        let more = budget.left_bytes() / 2 / self.demand.thread_bytes.max(1);
        on_threads(more.saturating_add(1) as usize, || {
            self.add_all(work, (&roots, reading), breadth_bytes, tiles)
        })
    }
}
