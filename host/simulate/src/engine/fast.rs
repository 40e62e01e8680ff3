//! The fast sum: a NUFFT a pulse, over chunks of scatterers in lanes.
//!
//! With the radar standing still a scatterer's phase is linear in `k`, a place of the NUFFT. With true
//! motion it is a parabola over each of some runs of samples ([`super::arc`]), and
//!
//! ```text
//! exp(j 2 pi c2 kappa^2) = exp(j pi c2) sum_p (j 2 pi c2)^p / p! (kappa^2 - 1/2)^p,
//! ```
//!
//! cut where the rest, `|pi c2|^P / P!`, is below [`SERIES_RAD`]: a NUFFT for each `p`, multiplied by its power of
//! `kappa` afterwards. 150 MHz swept in 1 ms at 125 m/s needs one run and 5 terms.
//!
//! Phases are reduced in float64 and turned into float32 phasors, errors of 1e-6 at most that differ from scatterer
//! to scatterer.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use glam::DVec3;
use num_complex::Complex64;

use super::View;
use super::arc::{Arc, Reach};
use super::chunk::{Chunk, LANES, Lanes, Phases};
use super::illumination::Illumination;
use super::lattice::Lattice;
use super::nufft::{Grid, Nufft, Values};
use super::sum::{self, Adder};
use crate::Scatterer;
use crate::scene::{Mover, Scene};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::Motion;

/// What the series may leave out.
const SERIES_RAD: f64 = 1e-5;

/// Working memory: some 30 KB, and 32 bytes a cell of a grid.
#[derive(Debug)]
pub(super) struct Work {
    nuffts: Vec<Nufft>,
    grids: Vec<Grid>,
    phases: Box<Phases>,
    values: Box<Values>,
    gain: Box<Lanes<f32>>,
    ranges_m: Box<[Lanes<f64>; 2]>,
}

impl Default for Work {
    fn default() -> Self {
        Self {
            nuffts: Vec::new(),
            grids: Vec::new(),
            phases: Box::new(Phases::new()),
            values: Box::new(Values::new()),
            gain: Box::new([1.0; LANES]),
            ranges_m: Box::new([[0.0; LANES]; 2]),
        }
    }
}

/// Sets `out` to the sum over `scene`, whose points are `points`.
pub(super) fn pulse(
    scene: &Scene,
    points: &[Chunk],
    lattice: Option<&Lattice>,
    view: &View,
    work: &mut Work,
    out: &mut [Complex64],
) {
    let illumination = Illumination::new(view, &scene.blocks);
    let corners = chunks(scene.corners.iter().map(|corner| Scatterer {
        position_m: corner.position_m,
        amplitude: illumination.corner(corner).into(),
    }));
    let middle_s = view.middle_s();
    let movers = chunks(scene.movers.iter().map(|mover| Scatterer {
        position_m: mover.motion.pose(middle_s).position_m,
        amplitude: mover.amplitude,
    }));
    out.fill(Complex64::ZERO);
    match view.motion {
        Motion::StopAndGo => {
            let recycled = lattice.and_then(|l| l.shift(view).map(|shift| (l, shift)));
            if let Some((lattice, shift)) = recycled {
                let mut run = Run::new(work, out.len());
                lattice.add(shift, &mut run);
                run.finish(out);
                lattice.refer(view, out);
            }
            let points = if recycled.is_some() { &[] } else { points };
            let mut run = Run::new(work, out.len());
            for chunk in points.iter().chain(&corners).chain(&movers) {
                run.illuminate(&illumination, chunk);
                run.stand_still(view, chunk);
                run.add(chunk, 1);
            }
            run.finish(out);
        }
        Motion::True => {
            let still = || points.iter().chain(&corners);
            let reaches = [illumination.transmitter_m, illumination.receiver_m]
                .map(|from_m| reach(work, still(), from_m));
            let Some(arcs) = Arc::split(view, reaches[0], reaches[1]) else {
                return sum::pulse(scene, view, out);
            };
            for arc in &arcs {
                let samples = arc.first..arc.first + arc.count;
                let mut run = Run::new(work, arc.count);
                for chunk in still() {
                    run.illuminate(&illumination, chunk);
                    arc.phases(chunk, &mut run.work.phases);
                    run.add_bent(chunk);
                }
                let mut rest = Vec::new();
                for (chunk, movers) in movers.iter().zip(scene.movers.chunks(LANES)) {
                    run.illuminate(&illumination, chunk);
                    rest.extend(run.follow(arc, view, movers));
                    run.add_bent(chunk);
                }
                run.finish(&mut out[samples.clone()]);
                if !rest.is_empty() {
                    let adder = Adder::of_samples(view, samples.clone());
                    for mover in rest {
                        let amplitude = mover.amplitude
                            * illumination.of(mover.motion.pose(middle_s).position_m);
                        let place = |t| mover.motion.pose(t).position_m;
                        adder.add(amplitude, place, &mut out[samples.clone()]);
                    }
                }
            }
        }
    }
}

/// Scatterers in chunks.
pub(super) fn chunks(scatterers: impl Iterator<Item = Scatterer>) -> Vec<Chunk> {
    let mut scatterers = scatterers.peekable();
    let mut chunks = Vec::new();
    while scatterers.peek().is_some() {
        chunks.push(Chunk::new(scatterers.by_ref().take(LANES)));
    }
    chunks
}

/// Distances of the nearest and farthest from `from_m`; infinitely wide if one is not a number.
fn reach<'a>(work: &mut Work, chunks: impl Iterator<Item = &'a Chunk>, from_m: DVec3) -> Reach {
    let mut reach: Option<Reach> = None;
    for chunk in chunks {
        let ranges_m = &mut work.ranges_m[0];
        chunk.ranges_m(from_m, ranges_m);
        let (mut near_m, mut far_m) = (f64::INFINITY, 0.0f64);
        for &range_m in &ranges_m[..chunk.count] {
            near_m = near_m.min(range_m);
            far_m = far_m.max(range_m);
        }
        let so_far = reach.unwrap_or(Reach { near_m, far_m });
        reach = Some(Reach {
            near_m: so_far.near_m.min(near_m),
            far_m: so_far.far_m.max(far_m),
        });
    }
    // Nothing stands still: any distance will do.
    reach.unwrap_or(Reach {
        near_m: 1e6,
        far_m: 1e6,
    })
}

/// One NUFFT's samples, or a series of them.
pub(super) struct Run<'a> {
    work: &'a mut Work,
    nufft: usize,
    /// Terms of the series in use.
    terms: usize,
}

impl<'a> Run<'a> {
    pub(super) fn new(work: &'a mut Work, samples: usize) -> Self {
        let planned = work.nuffts.iter().position(|n| n.samples() == samples);
        let nufft = planned.unwrap_or_else(|| {
            work.nuffts.push(Nufft::new(samples));
            work.nuffts.len() - 1
        });
        Self {
            work,
            nufft,
            terms: 0,
        }
    }

    /// Sets the gain of each scatterer.
    pub(super) fn illuminate(&mut self, illumination: &Illumination, chunk: &Chunk) {
        let gain = &mut self.work.gain;
        if illumination.is_even() {
            gain.fill(1.0);
        } else {
            for (i, gain) in gain[..chunk.count].iter_mut().enumerate() {
                *gain = illumination.beam(chunk.position_m(i)) as f32;
            }
        }
        if let Some(from_m) = illumination.spreading_from_m() {
            let [out_m, back_m] = &mut *self.work.ranges_m;
            chunk.ranges_m(illumination.transmitter_m, out_m);
            chunk.ranges_m(illumination.receiver_m, back_m);
            for i in 0..LANES {
                gain[i] *= (from_m * from_m / (out_m[i] * back_m[i])) as f32;
            }
        }
    }

    /// Sets the phases of scatterers and a radar that stand still.
    pub(super) fn stand_still(&mut self, view: &View, chunk: &Chunk) {
        let transmitter_m = view.transmitter_m(view.time_s);
        let receiver_m = view.receiver_m(view.time_s);
        let [out_m, back_m] = &mut *self.work.ranges_m;
        chunk.ranges_m(transmitter_m, out_m);
        if receiver_m == transmitter_m {
            back_m.copy_from_slice(out_m);
        } else {
            chunk.ranges_m(receiver_m, back_m);
        }
        let sweep = &view.sweep;
        let centre_hz = sweep.start_hz + sweep.step_hz * (sweep.count / 2) as f64;
        let half_residual = sweep.residual_hz_s / 2.0;
        let phases = &mut self.work.phases;
        for i in 0..LANES {
            let d = (out_m[i] + back_m[i]) / SPEED_OF_LIGHT_M_S - view.reference_s;
            phases.turns[i] = (half_residual * d - centre_hz) * d;
            phases.slope[i] = -sweep.step_hz * d;
        }
    }

    /// Sets the phases of movers; gives back those that it cannot, with gain 0.
    fn follow<'m>(&mut self, arc: &Arc, view: &View, movers: &'m [Mover]) -> Vec<&'m Mover> {
        let mut rest = Vec::new();
        for (i, mover) in movers.iter().enumerate() {
            let found = arc.phase(view, |t| mover.motion.pose(t).position_m);
            if found.is_none() {
                self.work.gain[i] = 0.0;
                rest.push(mover);
            }
            let phases = &mut self.work.phases;
            [phases.turns[i], phases.slope[i], phases.bend[i]] = found.unwrap_or_default();
        }
        rest
    }

    /// Adds a chunk with all the terms that its bends need.
    fn add_bent(&mut self, chunk: &Chunk) {
        let phases = &mut self.work.phases;
        let mut largest = 0.0f64;
        for i in 0..chunk.count {
            largest = largest.max(phases.bend[i].abs());
        }
        for i in 0..LANES {
            phases.turns[i] += phases.bend[i] / 2.0;
        }
        let largest = largest * std::f64::consts::PI;
        let (mut terms, mut left) = (1, largest);
        while left > SERIES_RAD && terms < 12 {
            terms += 1;
            left *= largest / terms as f64;
        }
        self.add(chunk, terms);
    }

    /// Makes grids for so many terms ready.
    fn open(&mut self, terms: usize) {
        let Work { nuffts, grids, .. } = &mut *self.work;
        while self.terms < terms {
            if grids.len() <= self.terms {
                grids.push(Grid::default());
            }
            grids[self.terms].fit(&nuffts[self.nufft]);
            self.terms += 1;
        }
    }

    /// Values of a chunk whose gains and phases are set.
    pub(super) fn values(&mut self, chunk: &Chunk) -> &Values {
        let Work {
            nuffts,
            phases,
            values,
            gain,
            ..
        } = &mut *self.work;
        let length = nuffts[self.nufft].length();
        values.set((&chunk.re, &chunk.im), gain, phases, length);
        values
    }

    /// Adds the first `count` of the values that `fill` sets.
    pub(super) fn add_values(&mut self, count: usize, fill: impl FnOnce(&mut Values)) {
        self.open(1);
        let Work {
            nuffts,
            grids,
            values,
            ..
        } = &mut *self.work;
        fill(values);
        nuffts[self.nufft].spread(values, count, &mut grids[0]);
    }

    /// Adds a chunk with some terms of the series.
    fn add(&mut self, chunk: &Chunk, terms: usize) {
        self.open(terms);
        let Work {
            nuffts,
            grids,
            phases,
            values,
            gain,
            ..
        } = &mut *self.work;
        let nufft = &nuffts[self.nufft];
        values.set((&chunk.re, &chunk.im), gain, phases, nufft.length());
        for (p, grid) in grids[..terms].iter_mut().enumerate() {
            if p > 0 {
                values.next_term(phases, p);
            }
            nufft.spread(values, chunk.count, grid);
        }
    }

    /// Adds the samples to `out`.
    fn finish(self, out: &mut [Complex64]) {
        let Work { nuffts, grids, .. } = self.work;
        let samples = out.len();
        let half = (samples / 2).max(1) as f64;
        for (p, grid) in grids[..self.terms].iter_mut().enumerate() {
            nuffts[self.nufft].finish(grid, |k, z| {
                let kappa = (k as f64 - (samples / 2) as f64) / half;
                out[k] += z * (kappa * kappa - 0.5).powi(p as i32);
            });
        }
    }
}
