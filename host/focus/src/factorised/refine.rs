//! Computation of a patch history from that of a larger patch.
//!
//! Histories are decimated by two; the first decimation of each axis is by three where the plan says so, which fits the number of samples
//! better to patches whose size lies between two powers of two.
//!
//! **Error of a decimation.** It is evaluated in advance. Over pulses the kernel interpolates `exp(j phase_p(u))` of each pixel `p` from the
//! retained antenna positions to those between. This is evaluated for the corner with the fastest path change, at the highest frequency, on segments of
//! pulses at both ends, where the kernel extends past the data, and in between. Errors are weighted by the power of each pulse
//! ([`Thinned::weights`](super::thinned::Thinned): a pulse beyond the data has only the kernel's tails). The share is that of the mean over the patch,
//! whose pixels have tones evenly spread up to the corner's. Where the error of the corner exceeds the corresponding one, or where the antenna track is too rough for a patch of this size ([`super::thinned`]), the pulses of the patch are not decimated.
//!
//! Over frequency the signal is a tone of `step (path_p - path_q) / c` cycles per sample. Paths are convex in `p`: over a plane
//! patch, or the box around a curved one, they lie between the tangent at the centre and the maximum at the corners. The kernel
//! error is that for the resulting band.
//!
//! A patch larger than half its distance from the antennas is seen in all directions; its pulses are not decimated.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::decimations::{Decimations, FACTORS, pays};
use super::history::{Axes, PatchHistory};
use super::patch_view::{MARGIN, Patch, path_m};
use super::shares::{KernelChoice, Shares};
use super::thinned::{Antennas, Stretch};
use crate::FormError;
use subaperture_kernels::decimation::{self, Decimation, DecimationScratch, PhaseRamp, Rows, Taps};
use subaperture_kernels::lanes::Instructions;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::{Monitor, during};
use subaperture_model::phase_history::{Collection, PhaseHistory};
use subaperture_signal::phase::phasor;

/// Stage name.
pub(super) const HISTORIES: &str = "histories of patches";

/// Ratio of patch radius to antenna distance above which a patch counts as near.
const NEAR: f64 = 0.5;
/// Retained pulses at which paths are sampled.
const PLACES: usize = 17;
/// Retained pulses in each segment on which the decimation error is measured.
const RUN: usize = 4;
/// Segments between the two ends.
const INNER_RUNS: usize = 2;
/// Largest phase increment between pulses, cycles, for any kernel.
const FASTEST: f64 = 0.42;
/// Minimum pulses computed by a thread at a time.
const BLOCK: usize = 16;
/// Recorded pulses read together per thread, bytes; sized to stay in cache.
const READ_BYTES: usize = 1 << 20;

/// Recorded pulses of a block.
pub(super) struct Recorded<'a> {
    pub(super) history: &'a dyn PhaseHistory,
    /// Pulses read together.
    pub(super) at_once: usize,
    /// Source of cancellation while reading.
    pub(super) monitor: &'a dyn Monitor,
    pub(super) fast: Vec<f32>,
    /// Slow-time weight of each pulse of the block.
    pub(super) slow: Vec<f32>,
    /// Samples of the whole block, if held for all first patches.
    pub(super) held: Option<Vec<Complex32>>,
}

impl Recorded<'_> {
    /// All samples of the block, where held here or by the phase history.
    fn samples_in_memory(&self, stretch: &Stretch) -> Option<&[Complex32]> {
        let held = self.held.as_deref();
        held.or_else(|| self.history.samples_in_memory(stretch.pulses.clone()))
    }

    /// Given pulses of the block with their samples.
    fn before<'a>(&'a self, samples: &'a [Complex32], pulses: Range<usize>) -> Before<'a> {
        Before::Recorded {
            samples,
            first: pulses.start,
            fast: &self.fast,
            slow: &self.slow[pulses],
        }
    }
}

/// Input pulses of a decimation.
#[derive(Clone, Copy)]
enum Before<'a> {
    /// Recorded pulses, from this index of the block on.
    Recorded {
        samples: &'a [Complex32],
        first: usize,
        fast: &'a [f32],
        slow: &'a [f32],
    },
    History(&'a PatchHistory),
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct RefineScratch {
    decimation: DecimationScratch,
    phase_ramps: Vec<PhaseRamp>,
}

/// Computation of decimated histories.
pub(super) struct Refiner<'a> {
    collection: &'a Collection,
    shares: Shares,
    instructions: Instructions,
}

impl<'a> Refiner<'a> {
    /// Prepare for an error bound, dB, the recorded pulses and a kernel.
    pub(super) fn of(
        collection: &'a Collection,
        error_db: f64,
        kernel: Option<KernelChoice>,
    ) -> Self {
        let shares = Shares::of(error_db, kernel);
        Self {
            collection,
            shares,
            instructions: Instructions::best(),
        }
    }

    /// Decimations and their kernels.
    pub(super) fn decimations(&self) -> &Decimations {
        self.shares.decimations()
    }

    /// Number of kernel taps at each fraction.
    pub(super) fn taps(&self) -> usize {
        self.decimations().num_taps()
    }

    /// Axes of the recorded samples.
    pub(super) fn recorded(&self) -> Axes {
        Axes::recorded(self.collection, self.decimations())
    }

    /// Shares of the error bound.
    pub(super) fn shares(&self) -> &Shares {
        &self.shares
    }

    /// Whether a history may be decimated for a patch, over pulses and over samples.
    pub(super) fn decimates(&self, stretch: &Stretch, axes: &Axes, patch: &Patch) -> [bool; 2] {
        if !self.shares.decimate {
            return [false; 2];
        }
        let pulses = self.decimates_pulses(stretch, axes, patch);
        let kept = &stretch.thinned[axes.thinning + usize::from(pulses)].antennas;
        [pulses, self.decimates_samples(axes, patch, kept)]
    }

    fn decimates_samples(&self, axes: &Axes, patch: &Patch, antennas: &[Antennas]) -> bool {
        let continues = self.decimations().continues(1, axes.decimations);
        if !(continues && pays(axes.num_samples, axes.factor, self.taps())) {
            return false;
        }
        let band = axes.factor as f64 * samples_band(axes, patch, antennas);
        band <= self.shares.band(axes.factor)
    }

    fn decimates_pulses(&self, stretch: &Stretch, axes: &Axes, patch: &Patch) -> bool {
        let Some(after) = stretch.thinned.get(axes.thinning + 1) else {
            return false;
        };
        if !(patch.flat && self.decimations().continues(0, axes.thinning)) {
            return false;
        }
        let kept = &after.antennas;
        let distances = places(kept.len() - 1).map(|n| patch.distance_m(&kept[n]));
        let distance_m = distances.fold(f64::INFINITY, f64::min);
        if patch.radius_m > NEAR * distance_m {
            return false;
        }
        let cycles_m = axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let rough_rad = TAU * cycles_m * after.roughness_m * (patch.radius_m / distance_m);
        if rough_rad > self.shares.rough {
            return false;
        }
        // The corner with the fastest path change represents all.
        let (rate_m, fastest) = fastest(patch, kept);
        rate_m * cycles_m * MARGIN <= FASTEST
            && self.is_faithful(stretch, axes, patch.centre, fastest)
    }

    /// Factors of the first decimation over pulses and over samples for which a history of `patch`, decimated by two as often as possible to
    /// `axes`, becomes shortest.
    pub(super) fn first_factors(
        &self,
        stretch: &Stretch,
        axes: &Axes,
        patch: &Patch,
    ) -> [usize; 2] {
        let kept = &stretch.thinned[axes.thinning].antennas;
        // Beyond the data the kernel has at most this many pulses, of little power.
        let beyond = self.taps() - 2;
        let kept = match kept.len() > 2 * beyond + 1 {
            true => &kept[beyond..kept.len() - beyond],
            false => kept,
        };
        let cycles_m = axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let bands = [
            fastest(patch, kept).0 * cycles_m,
            samples_band(axes, patch, kept),
        ];
        let three = FACTORS[1];
        let allowed = [self.shares.slow_band(three), self.shares.band(three)];
        let done = axes.made();
        [0, 1].map(|axis| {
            let band = bands[axis] * three as f64 / FACTORS[0] as f64;
            match done[axis] > 0 && band <= allowed[axis] {
                true => three,
                false => FACTORS[0],
            }
        })
    }

    /// Whether decimation over pulses keeps its share of the error for a pixel relative to the centre, on each of several segments of pulses.
    fn is_faithful(&self, stretch: &Stretch, axes: &Axes, centre: DVec3, pixel: DVec3) -> bool {
        let [before, after] = [0, 1].map(|more| &stretch.thinned[axes.thinning + more]);
        let cycles_m = axes.highest_hz() / SPEED_OF_LIGHT_M_S;
        let phase = |antennas: &Antennas| {
            phasor((path_m(antennas, pixel) - path_m(antennas, centre)) * cycles_m)
        };
        let decimations = self.decimations();
        let factor = decimations.factor(0, axes.thinning);
        // Retained pulses; beyond the data there are as many as the length of the preceding kernel, more than in a segment.
        let (count, width) = (before.antennas.len() / factor, self.taps());
        let end = RUN + width / 4;
        let inner = (1..=INNER_RUNS).map(|i| i * count / (INNER_RUNS + 1));
        let inner = inner.map(|first| first..(first + RUN).min(count));
        let ends = [0..end.min(count), count.saturating_sub(end)..count];
        for run in ends.into_iter().chain(inner) {
            let start = run.start;
            let kept = &after.antennas[start..run.end + width - 1];
            let kept: Vec<Complex64> = kept.iter().map(phase).collect();
            let (mut error, mut weights) = (0.0, 0.0);
            let places = run.flat_map(|m| (1..factor).map(move |phase| (m, phase)));
            for (m, between) in places {
                let n = factor * m + between;
                let expected = phase(&before.antennas[n]);
                let taps = decimations.taps(factor, between);
                let terms = kept[m - start..m - start + width].iter().zip(taps);
                let got: Complex64 = terms.map(|(z, h)| z * f64::from(h)).sum();
                let weight = before.weights[n];
                error += weight * (got - expected).norm_sqr();
                // Includes a share of the neighbouring retained pulse, which is unchanged.
                weights += factor as f64 / (factor - 1) as f64 * weight;
            }
            // A segment without weight has no error.
            if error.is_nan() || error > self.shares.slow_edge(factor).powi(2) * weights {
                return false;
            }
        }
        true
    }

    /// Compute `own`, the history of a first patch, from recorded pulses, decimated as given by `decimates`.
    ///
    /// Pulses that are not held are read in order and once, block by block while the preceding ones are decimated.
    ///
    /// # Errors
    /// Errors of reading.
    pub(super) fn read(
        &self,
        stretch: &Stretch,
        recorded: &Recorded,
        patch: &Patch,
        decimates: [bool; 2],
        own: &mut PatchHistory,
    ) -> Result<(), FormError> {
        let axes = self.recorded();
        let (size, width) = (
            self.prepare(stretch, &axes, patch, decimates, own),
            axes.num_samples,
        );
        let (num_pulses, num_after) = (stretch.pulses.len(), own.num_pulses());
        let step = Step {
            stretch,
            patch,
            factor: self.factor(&axes, decimates),
            decimates,
            size,
            monitor: recorded.monitor,
        };
        if let Some(samples) = recorded.samples_in_memory(stretch) {
            let before = recorded.before(samples, 0..num_pulses);
            self.make_together(&step, before, 0, &mut own.values);
            return Ok(());
        }
        let at_once = recorded.at_once.min(num_pulses);
        let room = self.room(at_once);
        let [mut samples, mut ahead] = [(); 2].map(|()| vec![Complex32::ZERO; room]);
        // Pulses of the block currently buffered.
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
            // Outputs that need only the buffered pulses.
            let until = match (here.end == num_pulses, decimates[0]) {
                (true, _) => num_after,
                (false, true) => here.end / step.factor,
                (false, false) => here.end,
            };
            let before = recorded.before(&samples, here.clone());
            let out = &mut own.values[made * size..until * size];
            if here.end == num_pulses || recorded.monitor.cancelled() {
                self.make_together(&step, before, made, out);
                return Ok(());
            }
            let next = here.end..(here.end + at_once).min(num_pulses);
            let needed = step.needed(self.taps(), &(until..until + 1), num_pulses);
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

    /// Read all pulses of a block for use by several first patches.
    ///
    /// # Errors
    /// Errors of reading.
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

    /// Size of the samples of a block, bytes.
    pub(super) fn held_bytes(&self, stretch: &Stretch) -> u64 {
        8 * (stretch.pulses.len() * self.collection.num_samples) as u64
    }

    /// Number of recorded pulses read together: whole blocks, so that sums over pulses as they are read have the same order
    /// for any number of threads.
    pub(super) fn read_together(&self, threads: usize) -> usize {
        let pulse_bytes = 8 * self.collection.num_samples;
        let pulses = threads * READ_BYTES / pulse_bytes;
        let whole = pulses.max(1).next_multiple_of(BLOCK);
        whole.min(self.collection.pulses.len())
    }

    /// Number of buffered samples for the given pulses, including those kept from the preceding ones.
    fn room(&self, at_once: usize) -> usize {
        let factor = self.decimations().factor(0, 0);
        (at_once + factor * self.taps()) * self.collection.num_samples
    }

    /// Memory of buffered pulses and of those being read, bytes.
    pub(super) fn read_bytes(&self, threads: usize) -> u64 {
        2 * 8 * self.room(self.read_together(threads)) as u64
    }

    /// Compute `own`, the history of a patch, from a larger one, decimated as given by `decimates`: in the given thread's buffers, or on all threads.
    pub(super) fn refine(
        &self,
        stretch: &Stretch,
        parent: &PatchHistory,
        (patch, decimates): (&Patch, [bool; 2]),
        own: &mut PatchHistory,
        alone: Option<&mut RefineScratch>,
        monitor: &dyn Monitor,
    ) {
        let size = self.prepare(stretch, &parent.axes, patch, decimates, own);
        let before = Before::History(parent);
        let step = Step {
            stretch,
            patch,
            factor: self.factor(&parent.axes, decimates),
            decimates,
            size,
            monitor,
        };
        match alone {
            Some(scratch) => self.make(&step, before, 0, &mut own.values, scratch),
            None => self.make_together(&step, before, 0, &mut own.values),
        }
    }

    /// Compute pulses of a history from `first` on, divided among threads.
    fn make_together(&self, step: &Step, before: Before, first: usize, out: &mut [f32]) {
        let count = out.len() / step.size;
        // Several parts per thread balance threads of unequal speed.
        let even = count.div_ceil(rayon::current_num_threads());
        let block = even.min(even.div_ceil(4).max(8 * BLOCK)).max(BLOCK);
        let blocks = out.par_chunks_mut(block * step.size).enumerate();
        blocks.for_each_init(RefineScratch::default, |scratch, (i, out)| {
            self.make(step, before, first + i * block, out, scratch);
        });
    }

    /// Decimation factor over pulses of a history, 1 if they are not decimated.
    fn factor(&self, before: &Axes, decimates: [bool; 2]) -> usize {
        match decimates[0] {
            true => self.decimations().factor(0, before.thinning),
            false => 1,
        }
    }

    /// Prepare everything except the values; return the number of values per pulse.
    fn prepare(
        &self,
        stretch: &Stretch,
        before: &Axes,
        patch: &Patch,
        decimates: [bool; 2],
        own: &mut PatchHistory,
    ) -> usize {
        own.axes = before.after(decimates, self.taps());
        own.centre = patch.centre;
        own.data_m.clear();
        let antennas = &stretch.thinned[own.axes.thinning].antennas;
        let paths_m = antennas.iter().map(|a| path_m(a, patch.centre));
        own.data_m.extend(paths_m);
        let size = own.axes.layout().values();
        own.values.resize(antennas.len() * size, 0.0);
        size
    }

    /// Compute pulses of a history from `first` on.
    fn make(
        &self,
        step: &Step,
        before: Before,
        first: usize,
        out: &mut [f32],
        scratch: &mut RefineScratch,
    ) {
        let _making = during(step.monitor, HISTORIES);
        match self.taps() {
            6 => self.make_with::<6>(step, before, first, out, scratch),
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
        let RefineScratch {
            decimation: scratch,
            phase_ramps,
        } = scratch;
        let centre = step.patch.centre;
        let taps: Taps<W> = self.decimations().kernel();
        let range = first..first + out.len() / step.size;
        phase_ramps.clear();
        let ramp = |axes: &Axes, path_m: f64| PhaseRamp {
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
                phase_ramps.extend(
                    pulses
                        .iter()
                        .map(|p| ramp(&axes, p.relative_path_m(centre))),
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
                    phase_ramps.extend(paths_m.map(|path_m| ramp(axes, path_m)));
                }
                let size = axes.layout().values();
                let values = &parent.values[needed.start * size..needed.end * size];
                (Rows::Planes(values), axes.layout(), needed)
            }
        };
        let decimation = Decimation {
            pulses: step.factor,
            samples: step.decimates[1],
            layout,
            rows,
            first: needed.start,
            phase_ramps,
        };
        #[cfg(test)]
        {
            let (old, new) = (layout.count(), decimation.after(W).count());
            let [over_pulses, over_samples] = [
                step.factor,
                1 + usize::from(step.decimates[1]) * (layout.factor() - 1),
            ]
            .map(|factor| (factor - 1) * W);
            super::counted::refined(
                needed.len() * old,
                [
                    (over_pulses, range.len() * old),
                    (over_samples, range.len() * new),
                ],
            );
        }
        decimation.make(self.instructions, &taps, first, out, scratch);
    }
}

/// Largest change of a corner's path from pulse to pulse relative to that of the centre, metres, with the corner.
fn fastest(patch: &Patch, antennas: &[Antennas]) -> (f64, DVec3) {
    let (mut rate_m, mut fastest) = (0.0f64, patch.corners[0]);
    for n in places(antennas.len() - 1) {
        let [early, late] = [n, n + 1].map(|n| patch.offsets_m(&antennas[n]));
        for ((early, late), &corner) in early.zip(late).zip(&patch.corners) {
            if (late - early).abs() > rate_m {
                (rate_m, fastest) = ((late - early).abs(), corner);
            }
        }
    }
    (rate_m, fastest)
}

/// Half of the band of a patch over samples, cycles per sample.
fn samples_band(axes: &Axes, patch: &Patch, antennas: &[Antennas]) -> f64 {
    let depths = places(antennas.len()).map(|n| patch.depth_m(&antennas[n]));
    depths.fold(0.0, f64::max) * axes.step_hz.abs() / SPEED_OF_LIGHT_M_S
}

/// Parameters of a history being computed.
struct Step<'a> {
    stretch: &'a Stretch,
    patch: &'a Patch,
    /// Decimation factor over pulses, or 1.
    factor: usize,
    decimates: [bool; 2],
    /// Values per pulse.
    size: usize,
    /// Receiver of progress.
    monitor: &'a dyn Monitor,
}

impl Step<'_> {
    /// Input pulses, of `count`, needed for the output pulses of `range`.
    fn needed(&self, taps: usize, range: &Range<usize>, count: usize) -> Range<usize> {
        match self.factor {
            1 => range.clone(),
            factor => decimation::needed(factor, taps, range, count),
        }
    }
}

/// Evenly spaced indices of `count` pulses, from first to last.
fn places(count: usize) -> impl Iterator<Item = usize> {
    crate::patch::spread(count, PLACES)
}
