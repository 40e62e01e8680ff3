//! A patch's own phase history, and its refinement to a smaller patch.
//!
//! **What a decimation costs is measured before it is made.** Over slow time the kernel interpolates
//! `exp(j phase_p(u))` of each pixel `p` from the decimated antennas to those before. That is evaluated
//! for the patch's corners, at the highest frequency, on runs of pulses at both ends, where the kernel reaches past the data, and
//! between, and weighted by what each pulse holds ([`PatchHistory::weights`]: a decimated pulse beyond the data's end has the
//! kernel's tails only). A factor that costs more than is allowed is halved, in the end to 1: slow time
//! then stays as it is, for this patch. Where the recorded antennas leave the fitted track, what that turns is bounded
//! ([`Track::phase_rad`]) and counts too.
//!
//! Over frequency it is a tone, of `step (path_p - path_q) / c` cycles a sample: paths are convex in `p`, so over a
//! patch of a plane they lie between the tangent at its centre and the largest at its corners, and the kernel's error is
//! that of its band.
//!
//! A patch as large as half its distance from the antennas is seen in all directions: its slow time is not decimated.

use std::ops::Range;

use glam::DVec3;
use num_complex::{Complex32, Complex64};

use super::patch_view::{Antennas, MARGIN, Patch};
use super::shares::Shares;
use super::track::Track;
use crate::patch::Rectangle;
use subaperture_kernels::compensation::{self, Ramp};
use subaperture_kernels::decimation;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::phase::phasor;
use subaperture_signal::windowed_sinc::WindowedSinc;

/// A decimated history must be at most this much of the one before, or is not made.
pub(super) const WORTHWHILE: f64 = 0.8;
/// A patch that reaches further from its centre, in parts of its distance from the antennas, is near.
const NEAR: f64 = 0.5;
/// Pulses in each run on which a decimation is measured.
const RUN: usize = 8;
/// Runs between the ends.
const INNER_RUNS: usize = 3;

/// Samples of some pulses and frequencies, pulse by pulse.
#[derive(Default)]
pub(super) struct PatchHistory {
    start_hz: f64,
    pub(super) step_hz: f64,
    pub(super) num_samples: usize,
    /// Place of the first pulse on the track, and from pulse to pulse.
    first_u: f64,
    step_u: f64,
    pub(super) antennas: Vec<Antennas>,
    /// Power of a pulse's share of the recorded pulses: 1 of these, the kernels' squares' sum of decimated ones.
    weights: Vec<f64>,
    pub(super) samples: Vec<Complex32>,
}

impl PatchHistory {
    /// Bytes a pulse beside its samples.
    pub(super) const PULSE_BYTES: u64 = (size_of::<Antennas>() + size_of::<f64>()) as u64;

    /// Recorded pulses, samples still to be filled in.
    pub(super) fn of_pulses(collection: &Collection, pulses: Range<usize>) -> Self {
        let track = &collection.pulses[pulses];
        Self {
            start_hz: track[0].start_hz,
            step_hz: track[0].step_hz,
            num_samples: collection.num_samples,
            first_u: 0.0,
            step_u: 1.0,
            antennas: track
                .iter()
                .map(|p| Antennas {
                    transmitter_m: p.transmitter_m,
                    receiver_m: p.receiver_m,
                    datum_m: p.reference_path_m,
                })
                .collect(),
            weights: vec![1.0; track.len()],
            samples: vec![Complex32::ZERO; track.len() * collection.num_samples],
        }
    }

    pub(super) fn samples_mut(&mut self) -> &mut [Complex32] {
        &mut self.samples
    }

    pub(super) fn num_pulses(&self) -> usize {
        self.antennas.len()
    }

    pub(super) fn frequency_hz(&self, k: f64) -> f64 {
        self.start_hz + k * self.step_hz
    }

    pub(super) fn highest_hz(&self) -> f64 {
        let last_hz = self.frequency_hz((self.num_samples - 1) as f64);
        last_hz.abs().max(self.start_hz.abs())
    }

    /// The fitted antennas at pulse `n`, whole or not.
    fn on_track(&self, track: &Track, n: f64) -> Antennas {
        let [transmitter_m, receiver_m] = track.at(self.first_u + n * self.step_u);
        Antennas {
            transmitter_m,
            receiver_m,
            datum_m: 0.0,
        }
    }

    /// Whether the antennas are the recorded ones, not those of the fitted track.
    fn is_recorded(&self) -> bool {
        self.step_u == 1.0
    }
}

/// How many are left of `count` if `by` are made one.
fn decimated<const W: usize>(count: usize, by: usize) -> usize {
    match by {
        1 => count,
        _ => (count - 1) / by + W,
    }
}

/// How far before the first of the old the first of the new lies, as the kernel reaches.
fn before<const W: usize>(by: usize) -> f64 {
    match by {
        1 => 0.0,
        _ => ((W / 2 - 1) * by) as f64,
    }
}

/// Makes smaller histories, and images of them.
pub(super) struct Refiner<'a, const W: usize> {
    grid: &'a ImageGrid,
    kernel: WindowedSinc,
    shares: Shares,
}

impl<'a, const W: usize> Refiner<'a, W> {
    pub(super) fn new(grid: &'a ImageGrid, shares: Shares) -> Self {
        Self {
            grid,
            kernel: WindowedSinc::new(W, 0.25),
            shares,
        }
    }

    /// The pixels.
    pub(super) fn grid(&self) -> &ImageGrid {
        self.grid
    }

    /// How the bound is shared out.
    pub(super) fn shares(&self) -> &Shares {
        &self.shares
    }

    /// Whether there is anything to be won by smaller patches.
    pub(super) fn decimates(&self) -> bool {
        self.shares.decimate
    }

    /// Makes `own`, the history of `rectangle`, from that of a patch around it. False if it would not be
    /// smaller; `own` is then left as it was.
    pub(super) fn refine(
        &self,
        parent: &PatchHistory,
        track: &Track,
        rectangle: Rectangle,
        own: &mut PatchHistory,
    ) -> bool {
        if !self.shares.decimate {
            return false;
        }
        let patch = Patch::new(self.grid, rectangle);
        let by_pulse = self.by_pulse(parent, track, &patch);
        self.place(parent, track, by_pulse, own);
        let by_sample = self.by_sample(parent, own, &patch);
        if by_pulse == 1 && by_sample == 1 {
            return false;
        }
        own.num_samples = decimated::<W>(parent.num_samples, by_sample);
        own.start_hz = parent.frequency_hz(-before::<W>(by_sample));
        own.step_hz = parent.step_hz * by_sample as f64;
        own.first_u = parent.first_u - before::<W>(by_pulse) * parent.step_u;
        own.step_u = parent.step_u * by_pulse as f64;
        for antennas in &mut own.antennas {
            antennas.datum_m = antennas.path_m(patch.centre);
        }
        self.decimate(parent, patch.centre, by_pulse, by_sample, own);
        true
    }

    /// The antennas of one pulse of `by`.
    fn place(&self, parent: &PatchHistory, track: &Track, by: usize, own: &mut PatchHistory) {
        own.antennas.clear();
        if by == 1 {
            own.antennas.extend_from_slice(&parent.antennas);
            return;
        }
        let count = decimated::<W>(parent.num_pulses(), by);
        let each = (0..count).map(|i| self.decimated_antennas(parent, track, by, i));
        own.antennas.extend(each);
    }

    /// Samples and weights of `own`, compensated to `centre`.
    fn decimate(
        &self,
        parent: &PatchHistory,
        centre: DVec3,
        by_pulse: usize,
        by_sample: usize,
        own: &mut PatchHistory,
    ) {
        let width = own.num_samples;
        own.weights.clear();
        own.weights.resize(own.antennas.len(), 0.0);
        own.samples.clear();
        own.samples
            .resize(own.antennas.len() * width, Complex32::ZERO);
        let fast_weights: Vec<[f32; W]> = self.phases(by_sample);
        let slow_weights: Vec<[f32; W]> = self.phases(by_pulse);
        #[cfg(test)]
        super::counted::refined(
            W,
            [parent.num_pulses(), parent.num_samples],
            width,
            [by_pulse, by_sample],
        );
        let mut row = vec![Complex32::ZERO; width];
        let rows = parent.samples.chunks_exact(parent.num_samples);
        for (n, (antennas, samples)) in parent.antennas.iter().zip(rows).enumerate() {
            let delay_s = (antennas.path_m(centre) - antennas.datum_m) / SPEED_OF_LIGHT_M_S;
            let ramp = Ramp::new(parent.start_hz * delay_s, parent.step_hz * delay_s, 1.0);
            if by_sample == 1 {
                compensation::turn(samples, ramp, &mut row);
            } else {
                row.fill(Complex32::ZERO);
                decimation::add_samples(samples, ramp, &fast_weights, &mut row);
            }
            if by_pulse == 1 {
                own.weights[n] = parent.weights[n];
                own.samples[n * width..(n + 1) * width].copy_from_slice(&row);
                continue;
            }
            let (first, weights) = (n / by_pulse, &slow_weights[n % by_pulse]);
            for (own, &weight) in own.weights[first..].iter_mut().zip(weights) {
                *own += f64::from(weight * weight) * parent.weights[n];
            }
            let new = &mut own.samples[first * width..(first + W) * width];
            decimation::add_pulse(&row, weights, new);
        }
    }

    /// Weights of every fraction that a decimation meets.
    fn phases(&self, by: usize) -> Vec<[f32; W]> {
        (0..by)
            .map(|i| self.kernel.weights::<W>(i as f32 / by as f32))
            .collect()
    }

    /// Pulse `i` of those that `by` of the parent's make.
    fn decimated_antennas(
        &self,
        parent: &PatchHistory,
        track: &Track,
        by: usize,
        i: usize,
    ) -> Antennas {
        let place = (i * by) as f64 - ((W / 2 - 1) * by) as f64;
        parent.on_track(track, place)
    }

    /// `by` if so few of `count` are left that it pays, else 1.
    fn worthwhile(&self, by: usize, count: usize) -> usize {
        let after = count as f64 / by.max(1) as f64 + W as f64;
        if by >= 2 && after <= WORTHWHILE * count as f64 {
            by
        } else {
            1
        }
    }

    /// How many can be made one, of `count` that are `cycles` apart: within a quarter of a cycle.
    fn allowed(&self, cycles: f64, count: usize) -> usize {
        let by = (0.25 / (cycles * MARGIN)).min(count as f64) as usize;
        self.worthwhile(by, count)
    }

    /// How many pulses are made one.
    fn by_pulse(&self, parent: &PatchHistory, track: &Track, patch: &Patch) -> usize {
        let mut by = self.by_rates(parent, track, patch);
        while by > 1 && !self.is_faithful(parent, track, patch, by) {
            by = self.worthwhile(by / 2, parent.num_pulses());
        }
        by
    }

    /// How many pulses can be made one by the rates of paths, were the track as fitted and nothing lost at its
    /// ends.
    fn by_rates(&self, parent: &PatchHistory, track: &Track, patch: &Patch) -> usize {
        if parent.num_pulses() == 1 || !patch.flat {
            return 1;
        }
        let distances = parent.antennas.iter().map(|a| patch.distance_m(a));
        let distance_m = distances.fold(f64::INFINITY, f64::min);
        if patch.radius_m > NEAR * distance_m {
            return 1;
        }
        if parent.is_recorded()
            && track.phase_rad(parent.highest_hz(), patch.radius_m, distance_m) > self.shares.track
        {
            return 1;
        }
        let mut rate_m = 0.0f64;
        for eighth in 0..=8 {
            let n = f64::from(eighth) / 8.0 * (parent.num_pulses() as f64 - 2.0);
            let [early, late] = [n, n + 1.0].map(|n| parent.on_track(track, n));
            let offset_m = |antennas: &Antennas, point: DVec3| {
                antennas.path_m(point) - antennas.path_m(patch.centre)
            };
            for &point in &patch.corners {
                rate_m = rate_m.max((offset_m(&late, point) - offset_m(&early, point)).abs());
            }
        }
        let cycles = rate_m * parent.highest_hz() / SPEED_OF_LIGHT_M_S;
        self.allowed(cycles, parent.num_pulses())
    }

    /// How many frequencies can be made one, for the antennas of `own`.
    fn by_sample(&self, parent: &PatchHistory, own: &PatchHistory, patch: &Patch) -> usize {
        let depths = own.antennas.iter().map(|a| patch.depth_m(a));
        let cycles = depths.fold(0.0, f64::max) * parent.step_hz.abs() / SPEED_OF_LIGHT_M_S;
        self.allowed(cycles, parent.num_samples)
    }

    /// Whether making one pulse of `by` costs no more than is allowed, on each of some runs of pulses.
    fn is_faithful(&self, parent: &PatchHistory, track: &Track, patch: &Patch, by: usize) -> bool {
        let count = parent.num_pulses();
        let cycles_m = parent.highest_hz() / SPEED_OF_LIGHT_M_S;
        let phases = |antennas: &Antennas| {
            let centre_m = antennas.path_m(patch.centre);
            patch
                .corners
                .map(|corner| phasor((antennas.path_m(corner) - centre_m) * cycles_m))
        };
        // Beyond the data there are as many pulses as the kernel before reached, and more than in a run.
        let end = RUN + W / 2;
        let inner = (1..=INNER_RUNS).map(|i| i * count / (INNER_RUNS + 1));
        let inner = inner.map(|first| first..(first + RUN).min(count));
        let ends = [0..end.min(count), count.saturating_sub(end)..count];
        for run in ends.into_iter().chain(inner) {
            let first = run.start / by;
            let last = (run.end - 1) / by + W;
            let coarse: Vec<[Complex64; 4]> = (first..last)
                .map(|i| phases(&self.decimated_antennas(parent, track, by, i)))
                .collect();
            let (mut errors, mut weights) = ([0.0; 4], 0.0);
            for n in run {
                // Where recorded antennas are off the fitted track is bounded apart from this.
                let expected = phases(&parent.on_track(track, n as f64));
                let kernel = self.kernel.weights::<W>((n % by) as f32 / by as f32);
                let around = &coarse[n / by - first..][..W];
                let weight = parent.weights[n];
                for (corner, error) in errors.iter_mut().enumerate() {
                    let got: Complex64 = around
                        .iter()
                        .zip(kernel)
                        .map(|(phases, h)| phases[corner] * f64::from(h))
                        .sum();
                    *error += weight * (got - expected[corner]).norm_sqr();
                }
                weights += weight;
            }
            let worst = errors.into_iter().fold(0.0, f64::max);
            // A run of no weight has nothing to lose.
            let allowed = self.shares.slow.powi(2) * weights;
            if worst.is_nan() || worst > allowed {
                return false;
            }
        }
        true
    }
}
