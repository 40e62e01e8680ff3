//! Block of samples: chunks of scatterers to one NUFFT or a series of them.
//!
//! If a scatterer's phase is a parabola over the block ([`super::arc`]),
//!
//! ```text
//! exp(j 2 pi c2 kappa^2) = exp(j pi c2) sum_p (j 2 pi c2)^p / p! (kappa^2 - 1/2)^p,
//! ```
//!
//! truncated where the remainder, `|pi c2|^P / P!`, is below [`SERIES_RAD`]: one NUFFT per `p`, multiplied by its power
//! of `kappa` afterwards. 150 MHz swept in 1 ms at 125 m/s needs one block and 5 terms.
//!
//! Phases are reduced in float64 and converted to float32 phasors, with errors of at most 1e-6 that differ between
//! scatterers.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use num_complex::Complex64;

use super::View;
use super::arc::Arc;
use super::chunk::{Chunk, LANES, Lanes, Phases, Values};
use super::illumination::Illumination;
use super::nufft::{Grid, Nufft};
use crate::scene::Mover;
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Truncation error of the series, radians.
const SERIES_RAD: f64 = 1e-5;

/// Scratch memory: some 30 KB, and 32 bytes per cell of each grid.
#[derive(Debug)]
pub(super) struct Work {
    nuffts: Vec<Nufft>,
    grids: Vec<Grid>,
    pub(super) phases: Box<Phases>,
    values: Box<Values>,
    gain: Box<Lanes<f32>>,
    pub(super) ranges_m: Box<[Lanes<f64>; 2]>,
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

/// Samples of one NUFFT, or of a series of them.
pub(super) struct Run<'a> {
    pub(super) work: &'a mut Work,
    nufft: usize,
    /// Number of series terms in use.
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

    /// Set the gain of each scatterer.
    pub(super) fn illuminate(&mut self, illumination: &Illumination, chunk: &Chunk) {
        let gain = &mut self.work.gain;
        if illumination.is_even() {
            gain.fill(1.0);
        } else {
            let (centre_m, radius_m) = chunk.ball();
            let obstacles = illumination.obstacles_before(centre_m, radius_m);
            for (i, gain) in gain[..chunk.count].iter_mut().enumerate() {
                *gain = illumination.beam_past(chunk.position_m(i), &obstacles) as f32;
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

    /// Set the phases for static scatterers and a stop-and-go radar.
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

    /// Set the phases of moving targets, and return those without a parabolic phase, whose gain is set to 0.
    pub(super) fn follow<'m>(
        &mut self,
        arc: &Arc,
        view: &View,
        movers: &'m [Mover],
    ) -> Vec<&'m Mover> {
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

    /// Add a chunk with as many series terms as its curvature needs.
    pub(super) fn add_bent(&mut self, chunk: &Chunk) {
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

    /// Prepare grids for `terms` terms.
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

    /// Add the first `count` of the values set by `fill`.
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

    /// Add a chunk with `terms` series terms.
    pub(super) fn add(&mut self, chunk: &Chunk, terms: usize) {
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

    /// Add the samples to `out`.
    pub(super) fn finish(self, out: &mut [Complex64]) {
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
