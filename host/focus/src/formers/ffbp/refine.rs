//! From a patch's history to that of a smaller patch in it.
//!
//! **What a halving costs is measured before it is made.** Over pulses the kernel interpolates `exp(j phase_p(u))` of each pixel `p` from the
//! antennas that are kept to those between. That is evaluated for the corner whose path changes the fastest, at the highest frequency, on runs of
//! pulses at both ends, where the kernel reaches past the data, and between, and weighted by what each pulse holds
//! ([`Thinned::weights`](super::thinned::Thinned): a pulse beyond the data's end has the kernel's tails only). Where it costs more than is
//! allowed, or where antennas are too rough for a patch of this size ([`super::thinned`]), pulses stay as they are, for this patch.
//!
//! Over frequency it is a tone, of `step (path_p - path_q) / c` cycles a sample: paths are convex in `p`, so over a
//! patch of a plane, or the box that holds one of a surface, they lie between the tangent at its centre and the largest at its corners, and the kernel's
//! error is that of its band.
//!
//! A patch as large as half its distance from the antennas is seen in all directions: its pulses are not halved.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::history::{Axes, PatchHistory};
use super::patch_view::{MARGIN, Patch, path_m};
use super::shares::Shares;
use super::thinned::{Antennas, Stretch, pays};
use crate::FormError;
use subaperture_kernels::halving::{self, Halving, HalvingScratch, Rows, Turning};
use subaperture_kernels::lanes::Instructions;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::{Collection, PhaseHistory};
use subaperture_signal::phase::phasor;

/// The stage.
pub(super) const HISTORIES: &str = "histories of patches";

/// A patch that reaches further from its centre, in parts of its distance from the antennas, is near.
const NEAR: f64 = 0.5;
/// Pulses kept at which paths are looked at.
const PLACES: usize = 17;
/// Pulses left out in each run on which a halving is measured.
const RUN: usize = 4;
/// Runs between the ends.
const INNER_RUNS: usize = 2;
/// Largest phase from pulse to pulse, cycles, whatever the kernel makes of it.
const FASTEST: f64 = 0.3;
/// Pulses, at least, that a thread makes at a time.
const BLOCK: usize = 16;
/// Bytes of recorded pulses that are read together, for each thread: what stays in caches.
const READ_BYTES: usize = 1 << 20;

/// Pulses as recorded.
pub(super) struct Recorded<'a> {
    pub(super) history: &'a dyn PhaseHistory,
    /// Pulses that are read together.
    pub(super) at_once: usize,
    /// Asked whether to read on.
    pub(super) monitor: &'a dyn Monitor,
    pub(super) fast: Vec<f32>,
    /// One a pulse of the stretch.
    pub(super) slow: Vec<f32>,
    /// Samples of the whole stretch, if they are held for all first patches.
    pub(super) held: Option<Vec<Complex32>>,
}

impl Recorded<'_> {
    /// All samples of the stretch, where they are held, here or by the history.
    fn at_hand(&self, stretch: &Stretch) -> Option<&[Complex32]> {
        let held = self.held.as_deref();
        held.or_else(|| self.history.at_hand(stretch.pulses.clone()))
    }

    /// These pulses of the stretch, of which the samples are.
    fn before<'a>(&'a self, samples: &'a [Complex32], pulses: Range<usize>) -> Before<'a> {
        Before::Recorded {
            samples,
            first: pulses.start,
            fast: &self.fast,
            slow: &self.slow[pulses],
        }
    }
}

/// Pulses before.
#[derive(Clone, Copy)]
enum Before<'a> {
    /// Some recorded ones, from this of the stretch on.
    Recorded {
        samples: &'a [Complex32],
        first: usize,
        fast: &'a [f32],
        slow: &'a [f32],
    },
    History(&'a PatchHistory),
}

/// One thread's buffers.
#[derive(Default)]
pub(super) struct RefineScratch {
    halving: HalvingScratch,
    turnings: Vec<Turning>,
}

/// Makes smaller histories.
pub(super) struct Refiner<'a> {
    collection: &'a Collection,
    taps: Vec<f32>,
    shares: Shares,
    instructions: Instructions,
}

impl<'a> Refiner<'a> {
    /// For a bound on the error, dB, of histories of these pulses.
    pub(super) fn of(collection: &'a Collection, error_db: f64) -> Self {
        let counts = [collection.pulses.len(), collection.num_samples];
        let shares = Shares::of(error_db.clamp(-300.0, 0.0), counts);
        Self {
            collection,
            taps: shares.taps(),
            shares,
            instructions: Instructions::best(),
        }
    }

    /// The kernel at the fraction 1/2.
    pub(super) fn taps(&self) -> &[f32] {
        &self.taps
    }

    /// What recorded pulses are of.
    pub(super) fn recorded(&self) -> Axes {
        Axes::recorded(self.collection)
    }

    /// How the bound is shared out.
    pub(super) fn shares(&self) -> &Shares {
        &self.shares
    }

    /// Whether a history may be halved for a patch, over pulses and over samples.
    pub(super) fn halves(&self, stretch: &Stretch, axes: &Axes, patch: &Patch) -> [bool; 2] {
        if !self.shares.decimate {
            return [false; 2];
        }
        let pulses = self.halves_pulses(stretch, axes, patch);
        let kept = &stretch.thinned[axes.thinning + usize::from(pulses)].antennas;
        [pulses, self.halves_samples(axes, patch, kept)]
    }

    fn halves_samples(&self, axes: &Axes, patch: &Patch, antennas: &[Antennas]) -> bool {
        if !pays(axes.num_samples, self.taps.len()) {
            return false;
        }
        let depths = places(antennas.len()).map(|n| patch.depth_m(&antennas[n]));
        let depth_m = depths.fold(0.0, f64::max);
        2.0 * depth_m * axes.step_hz.abs() / SPEED_OF_LIGHT_M_S <= self.shares.band
    }

    fn halves_pulses(&self, stretch: &Stretch, axes: &Axes, patch: &Patch) -> bool {
        let Some(after) = stretch.thinned.get(axes.thinning + 1) else {
            return false;
        };
        if !patch.flat {
            return false;
        }
        let kept = &after.antennas;
        let looked_at = || places(kept.len() - 1);
        let distances = looked_at().map(|n| patch.distance_m(&kept[n]));
        let distance_m = distances.fold(f64::INFINITY, f64::min);
        if patch.radius_m > NEAR * distance_m {
            return false;
        }
        let cycles_m = axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let rough_rad = TAU * cycles_m * after.roughness_m * (patch.radius_m / distance_m);
        if rough_rad > self.shares.rough {
            return false;
        }
        // The fastest corner stands for all.
        let (mut rate_m, mut fastest) = (0.0f64, patch.corners[0]);
        for n in looked_at() {
            let [early, late] = [n, n + 1].map(|n| patch.offsets_m(&kept[n]));
            for ((early, late), &corner) in early.zip(late).zip(&patch.corners) {
                if (late - early).abs() > rate_m {
                    (rate_m, fastest) = ((late - early).abs(), corner);
                }
            }
        }
        rate_m * cycles_m * MARGIN <= FASTEST
            && self.is_faithful(stretch, axes, patch.centre, fastest)
    }

    /// Whether a halving over pulses costs no more than is allowed, for a pixel against the centre, on each of some runs of pulses.
    fn is_faithful(&self, stretch: &Stretch, axes: &Axes, centre: DVec3, pixel: DVec3) -> bool {
        let [before, after] = [0, 1].map(|more| &stretch.thinned[axes.thinning + more]);
        let cycles_m = axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let phase = |antennas: &Antennas| {
            phasor((path_m(antennas, pixel) - path_m(antennas, centre)) * cycles_m)
        };
        // Odd pulses; beyond the data there are as many as the kernel before reached, and more than in a run.
        let (count, width) = (before.antennas.len() / 2, self.taps.len());
        let end = RUN + width / 4;
        let inner = (1..=INNER_RUNS).map(|i| i * count / (INNER_RUNS + 1));
        let inner = inner.map(|first| first..(first + RUN).min(count));
        let ends = [0..end.min(count), count.saturating_sub(end)..count];
        for run in ends.into_iter().chain(inner) {
            let kept = &after.antennas[run.start..run.end + width - 1];
            let kept: Vec<Complex64> = kept.iter().map(phase).collect();
            let (mut error, mut weights) = (0.0, 0.0);
            for (i, m) in run.enumerate() {
                let expected = phase(&before.antennas[2 * m + 1]);
                let terms = kept[i..i + width].iter().zip(&self.taps);
                let got: Complex64 = terms.map(|(z, &h)| z * f64::from(h)).sum();
                let weight = before.weights[2 * m + 1];
                error += weight * (got - expected).norm_sqr();
                // With the even pulse beside it, which stays as it is.
                weights += 2.0 * weight;
            }
            // A run of no weight has nothing to lose.
            if error.is_nan() || error > self.shares.slow.powi(2) * weights {
                return false;
            }
        }
        true
    }

    /// Makes `own`, the history of a first patch, from recorded pulses, halved as `halves` says.
    ///
    /// Where they are not at hand they are read in order and once, some at a time while those before are halved.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn read(
        &self,
        stretch: &Stretch,
        recorded: &Recorded,
        patch: &Patch,
        halves: [bool; 2],
        own: &mut PatchHistory,
    ) -> Result<(), FormError> {
        let axes = self.recorded();
        let (size, width) = (
            self.prepare(stretch, &axes, patch, halves, own),
            axes.num_samples,
        );
        let (num_pulses, num_after) = (stretch.pulses.len(), own.num_pulses());
        let step = Step {
            stretch,
            patch,
            halves,
            size,
            monitor: recorded.monitor,
        };
        if let Some(samples) = recorded.at_hand(stretch) {
            let before = recorded.before(samples, 0..num_pulses);
            self.make_together(&step, before, 0, &mut own.values);
            return Ok(());
        }
        let at_once = recorded.at_once.min(num_pulses);
        let room = self.room(at_once);
        let [mut samples, mut ahead] = [(); 2].map(|()| vec![Complex32::ZERO; room]);
        // Pulses of the stretch in hand.
        let mut here = 0..at_once;
        let reading = |range: Range<usize>, to: &mut [Complex32]| {
            let pulses = stretch.pulses.start + range.start..stretch.pulses.start + range.end;
            recorded
                .history
                .read(pulses, &mut to[..range.len() * width])
        };
        reading(here.clone(), &mut samples)?;
        let mut made = 0;
        loop {
            // What needs no more than is here.
            let until = match (here.end == num_pulses, halves[0]) {
                (true, _) => num_after,
                (false, true) => here.end / 2,
                (false, false) => here.end,
            };
            let before = recorded.before(&samples, here.clone());
            let out = &mut own.values[made * size..until * size];
            if here.end == num_pulses || recorded.monitor.cancelled() {
                self.make_together(&step, before, made, out);
                return Ok(());
            }
            let next = here.end..(here.end + at_once).min(num_pulses);
            let needed = step.needed(self.taps.len(), &(until..until + 1), num_pulses);
            let kept = needed.start.clamp(here.start, here.end)..here.end;
            let from = kept.start - here.start;
            ahead[..kept.len() * width]
                .copy_from_slice(&samples[from * width..(from + kept.len()) * width]);
            let (read, ()) = rayon::join(
                || reading(next.clone(), &mut ahead[kept.len() * width..]),
                || self.make_together(&step, before, made, out),
            );
            read?;
            std::mem::swap(&mut samples, &mut ahead);
            (here, made) = (kept.start..next.end, until);
        }
    }

    /// Reads all pulses of a stretch, for more than one first patch.
    ///
    /// # Errors
    /// Those of reading.
    pub(super) fn hold(
        &self,
        stretch: &Stretch,
        history: &dyn PhaseHistory,
        at_once: usize,
    ) -> Result<Vec<Complex32>, FormError> {
        let width = self.collection.num_samples;
        let mut samples = vec![Complex32::ZERO; stretch.pulses.len() * width];
        let mut first = stretch.pulses.start;
        for part in samples.chunks_mut(at_once * width) {
            let next = first + part.len() / width;
            history.read(first..next, part)?;
            first = next;
        }
        Ok(samples)
    }

    /// Bytes of the samples of a stretch.
    pub(super) fn held_bytes(&self, stretch: &Stretch) -> u64 {
        8 * (stretch.pulses.len() * self.collection.num_samples) as u64
    }

    /// Recorded pulses that are read together: whole blocks, so that whoever sums pulses as they are read does it in the same order
    /// for any number of threads.
    pub(super) fn read_together(&self, threads: usize) -> usize {
        let pulse_bytes = 8 * self.collection.num_samples;
        let pulses = threads * READ_BYTES / pulse_bytes;
        let whole = pulses.max(1).next_multiple_of(BLOCK);
        whole.min(self.collection.pulses.len())
    }

    /// Samples that are held of so many pulses, beside them what is kept of those before.
    fn room(&self, at_once: usize) -> usize {
        (at_once + 2 * self.taps.len()) * self.collection.num_samples
    }

    /// Bytes of the pulses in hand and of those being read.
    pub(super) fn read_bytes(&self, threads: usize) -> u64 {
        2 * 8 * self.room(self.read_together(threads)) as u64
    }

    /// Makes `own`, the history of a patch, from one around it, halved as `halves` says: on this thread with its buffers, else on all.
    pub(super) fn refine(
        &self,
        stretch: &Stretch,
        parent: &PatchHistory,
        (patch, halves): (&Patch, [bool; 2]),
        own: &mut PatchHistory,
        alone: Option<&mut RefineScratch>,
        monitor: &dyn Monitor,
    ) {
        let size = self.prepare(stretch, &parent.axes, patch, halves, own);
        let before = Before::History(parent);
        let step = Step {
            stretch,
            patch,
            halves,
            size,
            monitor,
        };
        match alone {
            Some(scratch) => self.make(&step, before, 0, &mut own.values, scratch),
            None => self.make_together(&step, before, 0, &mut own.values),
        }
    }

    /// Pulses of a history from `first` on, some of them on each thread.
    fn make_together(&self, step: &Step, before: Before, first: usize, out: &mut [f32]) {
        let count = out.len() / step.size;
        // Of many, several parts a thread: threads are not equally fast.
        let even = count.div_ceil(rayon::current_num_threads());
        let block = even.min(even.div_ceil(4).max(8 * BLOCK)).max(BLOCK);
        let blocks = out.par_chunks_mut(block * step.size).enumerate();
        blocks.for_each_init(RefineScratch::default, |scratch, (i, out)| {
            self.make(step, before, first + i * block, out, scratch);
        });
    }

    /// Everything but the values; numbers a pulse.
    fn prepare(
        &self,
        stretch: &Stretch,
        before: &Axes,
        patch: &Patch,
        halves: [bool; 2],
        own: &mut PatchHistory,
    ) -> usize {
        own.axes = before.after(halves, self.taps.len());
        own.centre = patch.centre;
        own.data_m.clear();
        let antennas = &stretch.thinned[own.axes.thinning].antennas;
        let paths_m = antennas.iter().map(|a| path_m(a, patch.centre));
        own.data_m.extend(paths_m);
        let size = own.axes.layout().values();
        own.values.resize(antennas.len() * size, 0.0);
        size
    }

    /// Pulses of a history from `first` on.
    fn make(
        &self,
        step: &Step,
        before: Before,
        first: usize,
        out: &mut [f32],
        scratch: &mut RefineScratch,
    ) {
        let _making = during(step.monitor, HISTORIES);
        match self.taps.len() {
            8 => self.make_with::<8>(step, before, first, out, scratch),
            10 => self.make_with::<10>(step, before, first, out, scratch),
            12 => self.make_with::<12>(step, before, first, out, scratch),
            _ => self.make_with::<16>(step, before, first, out, scratch),
        }
    }

    fn make_with<const W: usize>(
        &self,
        step: &Step,
        before: Before,
        first: usize,
        out: &mut [f32],
        scratch: &mut RefineScratch,
    ) {
        let RefineScratch { halving, turnings } = scratch;
        let centre = step.patch.centre;
        let taps: &[f32; W] = self.taps.as_slice().try_into().expect("as many taps");
        let range = first..first + out.len() / step.size;
        turnings.clear();
        let turning = |axes: &Axes, path_m: f64| Turning {
            start: axes.start_hz * (path_m / SPEED_OF_LIGHT_M_S),
            step: axes.step_hz * (path_m / SPEED_OF_LIGHT_M_S),
        };
        let (rows, layout, needed) = match before {
            Before::Recorded {
                samples,
                first,
                fast,
                slow,
            } => {
                let axes = self.recorded();
                let needed = step.needed(W, &range, step.stretch.pulses.len());
                let start = step.stretch.pulses.start;
                let pulses = &self.collection.pulses[start + needed.start..start + needed.end];
                turnings.extend(
                    pulses
                        .iter()
                        .map(|p| turning(&axes, p.relative_path_m(centre))),
                );
                let part = needed.start - first..needed.end - first;
                let width = axes.num_samples;
                let samples = &samples[part.start * width..part.end * width];
                let rows = Rows::Samples {
                    samples,
                    fast,
                    slow: &slow[part],
                };
                (rows, axes.layout(), needed)
            }
            Before::History(parent) => {
                let axes = &parent.axes;
                let needed = step.needed(W, &range, parent.num_pulses());
                if parent.centre != centre {
                    let antennas = &step.stretch.thinned[axes.thinning].antennas[needed.clone()];
                    let each = antennas.iter().zip(&parent.data_m[needed.clone()]);
                    let paths_m = each.map(|(a, datum_m)| path_m(a, centre) - datum_m);
                    turnings.extend(paths_m.map(|path_m| turning(axes, path_m)));
                }
                let size = axes.layout().values();
                let values = &parent.values[needed.start * size..needed.end * size];
                (Rows::Planes(values), axes.layout(), needed)
            }
        };
        let [pulses, samples] = step.halves;
        let halving_of = Halving {
            pulses,
            samples,
            layout,
            rows,
            first: needed.start,
            turnings,
        };
        #[cfg(test)]
        {
            let (old, new) = (layout.count(), halving_of.after(W).count());
            let over = |halved: bool, count: usize| usize::from(halved) * range.len() * count;
            super::counted::refined(
                W,
                needed.len() * old,
                [over(pulses, old), over(samples, new)],
            );
        }
        halving_of.make(self.instructions, taps, first, out, halving);
    }
}

/// A history in the making.
struct Step<'a> {
    stretch: &'a Stretch,
    patch: &'a Patch,
    halves: [bool; 2],
    /// Numbers a pulse.
    size: usize,
    /// Told of it.
    monitor: &'a dyn Monitor,
}

impl Step<'_> {
    /// The pulses before that those of `range` are made of, of `count`.
    fn needed(&self, taps: usize, range: &Range<usize>, count: usize) -> Range<usize> {
        match self.halves[0] {
            true => halving::needed(taps, range, count),
            false => range.clone(),
        }
    }
}

/// Some of `count` pulses, from the first to the last.
fn places(count: usize) -> impl Iterator<Item = usize> {
    crate::patch::spread(count, PLACES)
}
