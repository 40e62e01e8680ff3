//! Factorisation of the image: nested patches, each with only the pulses and frequencies
//! that it needs.
//!
//! After motion compensation to a patch centre `q`, the phase history of the patch's pixels varies slowly: by
//! `2 pi f (path_n(p) - path_n(q)) / c`. Its bandwidth over frequency is proportional to the depth of the patch, over slow time to its
//! width. A patch of half the size therefore needs half of the pulses and half of the frequencies:
//!
//! ```text
//! y[n][k]   = z[n][k] exp(+j 2 pi f_k (path_n(q) - reference_path_n) / c)            compensate to q
//! y'[i][l]  = y[2 i'][2 l'] + interpolation from odd pulses and frequencies         decimate by two (first: by two or three)
//! ```
//!
//! The step is repeated from each patch to its four quarters, each with its own centre, down to small patches
//! with few pulses, which plain backprojection images (`leaf`), or to patches of some hundred pixels, which range-Doppler maps image (`maps`). Omitted samples are transferred to the retained ones around them by an
//! interpolation kernel of the pixels' phase, `exp(j phase(n)) = sum_i h[i] exp(j phase(2 i))`
//! ([`subaperture_signal::decimation_kernel`], [`subaperture_kernels::decimation`]). The sum over pulses and frequencies needs no more, and
//! scatterers outside the patch do not matter. At the ends `h` extends past the data: decimated histories are `W - 1` samples longer than
//! half, and the antenna track is extrapolated smoothly there (`thinned`). Retained pulses keep their positions.
//!
//! This is the quadtree form (S. Xiao, D. Munson, S. Basu and Y. Bresler, 2000) of fast backprojection,
//! rather than the merging of sub-aperture images (Ulander, Hellsten and Stenstroem, 2003). Merging
//! interpolates complex images in two dimensions, `W^2` operations a value, whereas decimation is
//! separable, `2 W`, and its only error is that of the kernel. It is equivalent to the patch compensation of [`crate::rdbp`]
//! over several levels.
//!
//! The first decimation of each axis is by two or three: histories of a patch then have between 1.0 and 1.5 times the samples that its kernel
//! needs, instead of up to twice as many.
//!
//! Neglected: the kernel error per decimation and direction; the range profile error ([`crate::bp`]); the part of the track that is
//! not smooth from pulse to pulse, as far as it differs across the patch; and the phase beyond the ends of the data
//! where antennas turn quickly. Each has a share of the bound. Every decimation is checked against
//! its share for the actual patch and pulses in advance (`refine`) and omitted if it exceeds
//! it. A track that does not permit decimation in slow time (jitter, alternating antennas, a patch around the
//! antennas) therefore costs as much as plain backprojection and has no larger error.
//!
//! Cost: for `N x N` pixels, `N` pulses and `N` frequencies, about `18 + 6 W` real operations per sample and level (each of the four
//! quarters processes the samples of a patch), `log2(N / 64)` levels of `N^2` samples or more, and about 100 pulses per pixel at the leaves:
//! `N^2 log N` compared with `N^3` of backprojection. The length of the kernel enlarges small histories, so the factorisation is profitable from some
//! hundreds of pixels and pulses on. Sizes of leaves, first patches and pulse blocks are chosen by a cost model
//! (`choice`, `cost`).
//!
//! Memory: the histories along the descent to one leaf, the first patch's being the largest; a few megabytes per thread; the image.
//! First patches and pulse blocks are chosen to fit the scratch memory of the plan.
//!
//! Accuracy: the requested bound, against [`crate::exact`], in `tests/formers/pfa_ffbp.rs`.

mod choice;
mod cost;
#[cfg(test)]
mod counted;
mod decimations;
mod descent;
mod history;
mod leaf;
mod maps;
mod patch_view;
mod refine;
mod shares;
mod thinned;
mod tree;

use std::sync::Mutex;
use std::sync::atomic::AtomicUsize;

use serde_json::json;

use crate::budget::{Budget, on_threads};
use crate::former_choices::misfit;
use crate::goal::misses;
use crate::patch::{Patches, Rectangle};
use crate::sub_cpi::shared_band;
use crate::{
    Decision, ErrorGoal, FormError, Forming, ImageSpec, Reason, Remedy, Tile, Work, rounding,
};

use choice::Chosen;
pub(crate) use choice::{Choices, Leaves};
use cost::Demand;
use descent::{Descent, MapLeaves, Pool, Wanted};
use maps::MapKernels;
use refine::{Recorded, Refiner};
use thinned::Stretch;
use tree::Node;

/// Choose how to form the image of `spec`. `None` if maps are asked for and do not keep the bound or do not suit the patch in the middle of the
/// grid.
///
/// # Errors
/// [`FormError::Unsuited`] if pulses differ in their frequencies; [`FormError::BoundMissed`].
pub(super) fn decide(
    error_db: f64,
    leaves: Leaves,
    spec: &ImageSpec,
    goal: &ErrorGoal,
) -> Result<Option<Decision<Choices>>, FormError> {
    shared_band(spec.collection)?;
    let Some(Chosen {
        choices,
        refiner,
        kernels,
    }) = Chosen::of(error_db, leaves, spec)
    else {
        return Ok(None);
    };
    let phases = [
        rounding::path_phase_rad(spec.collection, spec.grid),
        rounding::band_phase_rad(spec),
    ];
    let arithmetic = libm::hypot(phases[0], phases[1]);
    let num_pulses = spec.collection.pulses.len();
    let planned_db = refiner.shares().planned_db(num_pulses, arithmetic);
    if leaves == Leaves::Maps && misses(planned_db, Some(error_db)) {
        return Ok(None);
    }
    goal.check(planned_db, || {
        Reason::new("kernels and the rounding of float32 sums limit the error")
            .helped_by(&[Remedy::OtherFormer(&["bp", "exact"])])
    })?;
    let stretches = choices.stretches(spec, refiner.decimations());
    let tree = choices.tree;
    let descents = cost::descents(
        spec,
        &refiner,
        &stretches,
        &tree,
        choices.map_level.zip(kernels.as_ref()),
    );
    let mut settings = json!({
        "stretches": stretches.len(),
        "levels": tree.levels,
        "leaf_rows": tree.leaf[0],
        "leaf_columns": tree.leaf[1],
        "kernel_taps": refiner.taps(),
        "first_decimation": [refiner.decimations().factor(0, 0), refiner.decimations().factor(1, 0)],
    });
    if let Some(level) = choices.map_level {
        let [rows, columns] = tree.size(level);
        settings["map_rows"] = rows.into();
        settings["map_columns"] = columns.into();
        if let Some(device) = spec.numerics.device {
            settings["device"] = device.name().into();
        }
    }
    Ok(Some(Decision {
        settings,
        planned_db,
        grain: tree.patch_size(choices.map_level.unwrap_or(0)),
        cost: cost::cost(&descents, &refiner),
        choices,
    }))
}

/// Open a plan of the former `name`.
///
/// # Errors
/// [`FormError::Choices`] if the choices do not belong to this image.
pub(super) fn open<'a>(
    name: &'static str,
    spec: ImageSpec<'a>,
    choices: Choices,
) -> Result<Box<dyn Forming + 'a>, FormError> {
    Ok(Box::new(Opened::new(name, spec, choices)?))
}

/// Plan opened for forming.
struct Opened<'a> {
    spec: ImageSpec<'a>,
    choices: Choices,
    refiner: Refiner<'a>,
    /// Kernels of maps, where there are maps.
    kernels: Option<MapKernels>,
    stretches: Vec<Stretch>,
    demand: Demand,
    tasks: Patches,
}

impl<'a> Opened<'a> {
    fn new(name: &'static str, spec: ImageSpec<'a>, choices: Choices) -> Result<Self, FormError> {
        shared_band(spec.collection)?;
        if !choices.are_of(&spec) {
            let mismatch = "expected blocks that cover these pulses, leaves of a possible size, and a kernel that keeps the error bound";
            return Err(misfit(name, mismatch));
        }
        let refiner = Refiner::of(spec.collection, choices.error_db, choices.kernel);
        let stretches = choices.stretches(&spec, refiner.decimations());
        let kernels = match choices.map_level {
            None => None,
            Some(_) => {
                let kernels = shares::map_kernels(choices.error_db);
                let mismatch = "expected an error bound that range-Doppler maps keep";
                Some(kernels.ok_or_else(|| misfit(name, mismatch))?)
            }
        };
        let descents = cost::descents(
            &spec,
            &refiner,
            &stretches,
            &choices.tree,
            choices.map_level.zip(kernels.as_ref()),
        );
        Ok(Self {
            demand: cost::demand(&descents),
            tasks: Patches::of_size(
                spec.grid,
                choices
                    .tree
                    .patch_size(choices.tree.task_level(choices.map_level)),
            ),
            kernels,
            stretches,
            refiner,
            choices,
            spec,
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
        let weights = self.spec.weights;
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
        let fault = Mutex::new(None);
        let maps = self.kernels.as_ref().zip(self.choices.map_level);
        let maps = maps.map(|(kernels, level)| MapLeaves {
            kernels,
            level,
            device: self.spec.numerics.device,
            fault: &fault,
        });
        for stretch in &self.stretches {
            let recorded = self.recorded(work, reading, stretch)?;
            let descent = Descent {
                monitor: work.monitor,
                grid: self.spec.grid,
                tree: &self.choices.tree,
                task_level: self.choices.tree.task_level(self.choices.map_level),
                maps,
                refiner: &self.refiner,
                transforms: self.spec.numerics.transforms,
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

/// Reading strategy for recorded pulses.
#[derive(Clone, Copy)]
struct Reading {
    /// Pulses read together.
    at_once: usize,
    /// Whether the samples of a block are held for all first patches.
    hold: bool,
    /// Whether a first patch is read while another one is processed.
    ahead: bool,
}

/// Levels computed in parallel, each with four histories of up to half the size of the parent.
const BREADTH: u64 = 8;
/// Size per thread, bytes, above which all threads decimate a history together.
const LARGEST_BREADTH: u64 = 5 << 20;

/// First patches of some tiles, and the use of memory for them.
struct Arrangement {
    roots: Vec<Node>,
    reading: Reading,
    /// Memory that remains for the histories of threads.
    budget: Budget,
}

impl Opened<'_> {
    /// Divide the memory of `work` for tiles at the given places.
    fn arrange(&self, work: &Work, places: &[Rectangle]) -> Result<Arrangement, FormError> {
        let mut budget = Budget::new(work.memory_bytes);
        let account = self.tasks.account_bytes(places.iter().copied());
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
        let roots = self.choices.tree.roots_of(self.spec.grid, places);
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
        let hold = several
            && work.history.samples_in_memory(0..0).is_none()
            && held <= budget.left_bytes() / 2;
        if hold {
            budget.take("recorded pulses", held.into(), &[Remedy::MoreMemory])?;
        }
        let reading = Reading {
            at_once: self.refiner.read_together(reading_for),
            hold,
            ahead,
        };
        Ok(Arrangement {
            roots,
            reading,
            budget,
        })
    }
}

impl Forming for Opened<'_> {
    fn pulses_read(&self, work: &Work, places: &[Rectangle]) -> Result<u64, FormError> {
        let Arrangement { roots, reading, .. } = self.arrange(work, places)?;
        let times = if reading.hold { 1 } else { roots.len() };
        Ok((times * self.spec.collection.pulses.len()) as u64)
    }

    fn form(&self, work: &Work, tiles: &mut [Tile]) -> Result<(), FormError> {
        let places: Vec<Rectangle> = tiles.iter().map(|tile| tile.place).collect();
        let Arrangement {
            roots,
            reading,
            budget,
        } = self.arrange(work, &places)?;
        let largest = rayon::current_num_threads() as u64 * LARGEST_BREADTH;
        let breadth_bytes = (budget.left_bytes() / 2 / BREADTH).min(largest);
        let more = budget.left_bytes() / 2 / self.demand.thread_bytes.max(1);
        on_threads(more.saturating_add(1) as usize, || {
            self.add_all(work, (&roots, reading), breadth_bytes, tiles)
        })
    }
}
