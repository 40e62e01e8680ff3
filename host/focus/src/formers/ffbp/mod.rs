//! Fast factorised backprojection: patches within patches, each with no more pulses and frequencies
//! than it needs.
//!
//! Compensated to a patch's centre `q`, the phase history of the patch's own pixels varies slowly: by
//! `2 pi f (path_n(p) - path_n(q)) / c`, over frequency as the patch is deep, over slow time as it is
//! wide. Of a patch half as large, half of the pulses and half of the frequencies say all. So
//!
//! ```text
//! y[n][k]   = z[n][k] exp(+j 2 pi f_k (path_n(q) - reference_path_n) / c)        compensate to q
//! y'[i][l]  = sum_n sum_k h(n / q_n - i) h(k / q_k - l) y[n][k]                  decimate
//! ```
//!
//! and the same again from each patch to its four quarters, with their own centres, until a patch has a
//! few pixels and few pulses; there plain backprojection ends it. `h` is the interpolation kernel
//! ([`subaperture_signal::windowed_sinc`]) of the pixels' own phase, `exp(j phase(n)) = sum_i h(n / q_n - i) exp(j
//! phase(i q_n))`, which is all that the sum over pulses and frequencies needs; it makes no matter what lies outside
//! the patch. At the ends, `h` reaches past the data: decimated histories are by `W` longer,
//! and there the antennas continue on the fitted track (`track`).
//!
//! This is the quadtree form (S. Xiao, D. Munson, S. Basu and Y. Bresler, 2000) of fast backprojection,
//! not the one that merges images of sub-apertures (Ulander, Hellsten and Stenstroem, 2003): a merge
//! interpolates complex images in two dimensions, `W^2` operations a value, where decimation is
//! separable, `2 W`, and its error is the kernel's alone. It is also [`crate::rdbp`]'s patch compensation,
//! over several levels.
//!
//! Neglected: the kernel's error, once a level and direction; the range profiles' ([`crate::bp`]); the
//! track's departure from its fit where slow time is decimated: positions themselves
//! are used up to there, so that only its part that differs across the patch counts; and what becomes of the phase beyond the data's
//! ends and of antennas that turn quickly. Each has its share of the bound, and every decimation is held to
//! them on the patch and the pulses it is made of, before it is made (`patch_history`): one that would cost more is
//! made by a smaller factor or not at all. A track on which slow time cannot be decimated (jitter, antennas in turn, a patch around the
//! antennas) so costs what plain backprojection does, and errs no more.
//!
//! Cost: for `N x N` pixels, `N` pulses and `N` frequencies, about `4 W` real operations a sample and level in each
//! direction, `log2(N / 16)` levels of `N^2` samples or more, and some `4 W` pulses a pixel at the end: `N^2 log N`
//! where backprojection takes `N^3`. The kernel's reach makes small histories grow, so it pays from some
//! hundreds of pixels and pulses on (`cost`).
//!
//! Memory: a stretch of pulses, and at most four times as much again a thread; the image.
//!
//! Accuracy: the bound asked for, against [`crate::exact`], in `tests/formers/pfa_ffbp.rs`.

mod cost;
#[cfg(test)]
mod counted;
mod descent;
mod leaf;
mod patch_history;
mod patch_view;
mod shares;
mod target;
mod track;

use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use serde_json::json;

use super::options::ERROR_DB;
use super::{Entry, of};
use crate::budget::{Budget, on_threads};
use crate::former::{chosen, misfit};
use crate::patch::{self, PatchSize, Patches};
use crate::sub_cpi::{self, shared_band};
use crate::{
    Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer, Reason, Remedy, Tile,
    Work, rounding,
};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::Pulse;

use descent::{Descent, Scratch};
use patch_history::{PatchHistory, Refiner};
use shares::Shares;
use target::Target;
use track::Track;

/// Patches a side that the image is cut into first: work for threads.
const FIRST_PATCHES: usize = 4;
/// Pixels a side of these at most, so that tiles of a large image need no larger patch's work.
const LARGEST_FIRST_PIXELS: usize = 1024;
/// Pixels a side at which a patch is not cut further.
const LEAF_PIXELS: usize = 16;
/// Copies of a stretch of pulses that a thread's patches within patches may take: each is at most 0.8
/// of the one before.
const SCRATCH_COPIES: u64 = 4;

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

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        Some(Box::new(Self { error_db }))
    }

    fn decide(&self, aim: &Aim, asked: &Asked, _: &dyn Monitor) -> Result<Decision, FormError> {
        let collection = aim.collection;
        let num_pulses = collection.pulses.len();
        let num_samples = shared_band(collection)?.count;
        let (taps, shares) = Shares::of(self.error_db, aim.grid);
        let arithmetic = rounding::path_phase_rad(aim).hypot(rounding::band_phase_rad(aim));
        let planned_db = shares.planned_db(num_pulses, arithmetic);
        asked.check(planned_db, || {
            Reason::new("kernels and float32 sums leave no less")
                .helped_by(&[Remedy::OtherFormer(&["bp", "exact"])])
        })?;
        let longest = aim.scratch_bytes / stretch_bytes(num_samples);
        let longest = longest.clamp(1, num_pulses as u64) as usize;
        let first = PatchSize {
            rows: first_side(aim.grid.rows.count),
            columns: first_side(aim.grid.columns.count),
        };
        let stretches = stretches(aim, &shares, first, longest);
        let patches = Patches::new(aim.grid, first);
        Ok(Decision {
            settings: json!({
                "stretches": stretches.len(),
                "levels": shares.levels,
                "kernel_taps": taps,
            }),
            planned_db,
            grain: patches.size(),
            cost: cost::cost(aim, &stretches, &patches, taps, &shares),
            choices: json!(Choices {
                error_db: self.error_db,
                stretches,
                patch_rows: first.rows,
                patch_columns: first.columns,
            }),
        })
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        let choices: Choices = chosen("ffbp", choices)?;
        let (taps, shares) = Shares::of(choices.error_db, aim.grid);
        Ok(match taps {
            6 => Box::new(Opened::<6>::new(aim, &choices, shares)?),
            8 => Box::new(Opened::<8>::new(aim, &choices, shares)?),
            10 => Box::new(Opened::<10>::new(aim, &choices, shares)?),
            12 => Box::new(Opened::<12>::new(aim, &choices, shares)?),
            14 => Box::new(Opened::<14>::new(aim, &choices, shares)?),
            _ => Box::new(Opened::<16>::new(aim, &choices, shares)?),
        })
    }
}

/// What a plan fixes: the rest follows from it.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Choices {
    error_db: f64,
    /// Pulses of each stretch, one after another.
    stretches: Vec<usize>,
    /// Of the first patches.
    patch_rows: usize,
    patch_columns: usize,
}

/// Bytes a pulse of a stretch, and of a thread's patches within patches.
fn stretch_bytes(num_samples: usize) -> u64 {
    pulse_bytes(num_samples) * (1 + SCRATCH_COPIES)
}

fn pulse_bytes(num_samples: usize) -> u64 {
    8 * num_samples as u64 + PatchHistory::PULSE_BYTES
}

impl Choices {
    fn size(&self) -> PatchSize {
        PatchSize {
            rows: self.patch_rows,
            columns: self.patch_columns,
        }
    }

    /// The stretches' fitted tracks; `None` if they are not of these pulses.
    fn tracks(&self, pulses: &[Pulse]) -> Option<Vec<Track>> {
        let mut first = 0;
        let mut tracks = Vec::with_capacity(self.stretches.len().min(pulses.len()));
        for &count in &self.stretches {
            if count == 0 || count > pulses.len() - first {
                return None;
            }
            tracks.push(Track::new(pulses, first..first + count));
            first += count;
        }
        (first == pulses.len()).then_some(tracks)
    }
}

/// Stretches of at most `longest` pulses, on whose fitted tracks patches of size `first` keep their share of the bound: how
/// many pulses each has.
fn stretches(aim: &Aim, shares: &Shares, first: PatchSize, longest: usize) -> Vec<usize> {
    let collection = aim.collection;
    let highest_hz = rounding::highest_hz(aim);
    let rectangles = patch::rectangles(aim.grid, first);
    let patches: Vec<(DVec3, f64)> = rectangles
        .iter()
        .map(|rectangle| {
            let centre = rectangle.centre_m(aim.grid);
            let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
            let radii = corners.map(|(r, c)| rectangle.point_m(aim.grid, r, c).distance(centre));
            (centre, radii.into_iter().fold(0.0, f64::max))
        })
        .collect();
    let phase_rad = |track: &Track| {
        let last = (track.pulses().len() - 1) as f64;
        let antennas = [0.0, 0.5, 1.0].map(|part| track.at(part * last));
        let each = patches.iter().map(|&(centre, radius_m)| {
            let distances = antennas.iter().flatten().map(|at| at.distance(centre));
            track.phase_rad(
                highest_hz,
                radius_m,
                distances.fold(f64::INFINITY, f64::min),
            )
        });
        each.fold(0.0, f64::max)
    };
    let mut stretches = Vec::new();
    let breaks = sub_cpi::breaks(collection);
    for pulses in sub_cpi::cut(collection.pulses.len(), &breaks, longest) {
        track::halve(
            &collection.pulses,
            pulses,
            shares.track,
            &phase_rad,
            &mut stretches,
        );
    }
    stretches
}

/// Ready to form.
struct Opened<'a, const W: usize> {
    aim: Aim<'a>,
    tracks: Vec<Track>,
    patches: Patches,
    refiner: Refiner<'a, W>,
}

impl<'a, const W: usize> Opened<'a, W> {
    fn new(aim: Aim<'a>, choices: &Choices, shares: Shares) -> Result<Self, FormError> {
        shared_band(aim.collection)?;
        let tracks = choices.tracks(&aim.collection.pulses);
        let patches = choices.patch_rows > 0 && choices.patch_columns > 0;
        let known = patches && (-300.0..=0.0).contains(&choices.error_db);
        let (Some(tracks), true) = (tracks, known) else {
            let what = "its stretches are not of these pulses, its patches are empty, or its bound is none";
            return Err(misfit(ENTRY.name, what));
        };
        Ok(Self {
            tracks,
            patches: Patches::new(aim.grid, choices.size()),
            refiner: Refiner::new(aim.grid, shares),
            aim,
        })
    }

    /// The samples of a stretch, weighted.
    fn read(&self, work: &Work, track: &Track) -> Result<PatchHistory, FormError> {
        let Aim {
            collection,
            weights,
            ..
        } = self.aim;
        let mut top = PatchHistory::of_pulses(collection, track.pulses());
        work.history.read(track.pulses(), top.samples_mut())?;
        let norm = weights.normalisation();
        let fast: Vec<f32> = weights.fast.iter().map(|&w| w as f32).collect();
        let rows = top.samples_mut().par_chunks_exact_mut(fast.len());
        rows.zip(track.pulses()).for_each(|(row, n)| {
            let slow = (weights.slow[n] * norm) as f32;
            row.iter_mut().zip(&fast).for_each(|(z, w)| *z *= w * slow);
        });
        Ok(top)
    }

    fn add_all(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let done = AtomicUsize::new(0);
        for track in &self.tracks {
            let top = self.read(work, track)?;
            let mut patches = self.patches.split(tiles);
            let parts = (self.tracks.len() * patches.len()) as f64;
            patches.par_iter_mut().for_each_init(
                Scratch::default,
                |scratch, (rectangle, segments)| {
                    let mut descent = Descent {
                        monitor: work.monitor,
                        refiner: &self.refiner,
                        track,
                        target: Target { segments },
                        scratch,
                    };
                    descent.descend(&top, *rectangle);
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    work.monitor.progress(done as f64 / parts);
                },
            );
            if work.monitor.cancelled() {
                return Err(FormError::Cancelled);
            }
        }
        Ok(())
    }
}

impl<const W: usize> Forming for Opened<'_, W> {
    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let mut budget = Budget::new(work.memory_bytes);
        budget.take(
            "patches",
            self.patches.account_bytes(tiles).into(),
            &[Remedy::MoreMemory],
        )?;
        let longest = self.tracks.iter().map(|track| track.pulses().len());
        let longest = longest.max().unwrap_or(0) as u64;
        let num_samples = self.aim.collection.num_samples;
        let bytes = u128::from(longest * stretch_bytes(num_samples));
        budget.take("a stretch of pulses", bytes, &[Remedy::MoreMemory])?;
        let copies = pulse_bytes(num_samples) * SCRATCH_COPIES * longest;
        let more = budget.left_bytes() / copies.max(1);
        on_threads(more.saturating_add(1) as usize, || {
            self.add_all(work, tiles)
        })
    }
}

/// Pixels a side of a first patch.
fn first_side(count: usize) -> usize {
    count
        .div_ceil(FIRST_PATCHES)
        .clamp(LEAF_PIXELS, LARGEST_FIRST_PIXELS)
}
