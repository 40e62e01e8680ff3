//! Recurrences along a column of groups: positions of the pixels, and the carrier phasor.
//!
//! With the position `t(i + x, j + y)` of a pixel at `x` and `y` from its group's centre,
//!
//! ```text
//! t(i + x, j + y) = t(i, j) + v_j(x, y),    exp(j 2 pi kappa t(i + x, j + y)) = exp(j 2 pi kappa t(i, j)) z_j(x, y)
//! ```
//!
//! The term of the centre is computed in float64, once per group. The rest varies slowly from group to group: over a block of [`TURNED`](super::shape::TURNED) groups,
//! `v` is linear in `j`, one addition per group, and its carrier phasors, `2 pi kappa d` apart, follow the recurrence
//!
//! ```text
//! z_(j + 1) = 2 cos(2 pi kappa d) z_j - z_(j - 1)
//! ```
//!
//! times the phasor of the centre: six operations per pixel, a third of those of a direct phasor. A rounding error of `z_j` grows
//! at most linearly. The deviation of the third-degree polynomial from the line is included in
//! [`Shape::left_out`](super::shape::Shape::left_out).

use super::expansion::Column;
use super::groups::Offsets;
use crate::lanes::{GROUP, Lanes};
use crate::phasor::{Polynomials, reduced};

/// Paths of a pulse along a column of groups.
#[derive(Clone, Copy)]
pub(super) struct Path {
    pub(super) column: Column,
    /// Position of the tile's centre among the pieces, bins.
    pub(super) place: f64,
    /// Carrier phase at the tile's centre, cycles, modulo 1.
    pub(super) turns: f64,
    /// Carrier cycles per bin.
    pub(super) kappa: f64,
}

/// Start of a block's recurrences: positions of the pixels, bins, and carrier phasors.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Start {
    /// Positions in the first group, relative to its centre.
    place: [f32; GROUP],
    /// Position step per group.
    step: [f32; GROUP],
    /// Carrier phasor at the first group.
    z: [[f32; GROUP]; 2],
    /// Carrier phasor at the group before.
    before: [[f32; GROUP]; 2],
    /// Twice the cosine of the phase step per group.
    twice: [f32; GROUP],
}

impl Start {
    pub(super) const ZERO: Self = Self {
        place: [0.0; GROUP],
        step: [0.0; GROUP],
        z: [[0.0; GROUP]; 2],
        before: [[0.0; GROUP]; 2],
        twice: [0.0; GROUP],
    };

    /// Set up for groups with centres at these pixel rows.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(
        &mut self,
        lanes: L,
        phasors: &Polynomials<L>,
        Path { column, kappa, .. }: &Path,
        offsets: &Offsets,
        middles: &[f64],
    ) {
        let (first, last) = (middles[0], middles[middles.len() - 1]);
        let groups = middles.len() as f64;
        let m = (first + last) / 2.0;
        let pixels = (last - first) / (groups - 1.0).max(1.0);
        // Mean square about the centre: the least-squares line.
        let mean = pixels * pixels * (groups * groups - 1.0) / 12.0;
        let back = (groups - 1.0) / 2.0;
        let [b0, b1, b2] = column.along;
        let [d0, d1, d2] = column.across;
        let along_step = (b1 + 2.0 * m * b2) * pixels;
        let across_step = (d1 + 2.0 * m * d2) * pixels;
        let along = b0 + m * b1 + (m * m + mean) * b2 - back * along_step;
        let across = d0 + m * d1 + (m * m + mean) * d2 - back * across_step;
        let [along, along_step, across, across_step] =
            [along, along_step, across, across_step].map(|x| lanes.splat(x as f32));
        let [c20, c11, c02] = column.bend.map(|x| lanes.splat(x as f32));
        let kappa = lanes.splat(*kappa as f32);
        for part in (0..GROUP).step_by(L::COUNT) {
            let x = lanes.load(&offsets.along[part..]);
            let y = lanes.load(&offsets.across[part..]);
            let xx = lanes.mul(x, x);
            let second = lanes.load(&offsets.second[part..]);
            // For a row, `second` is `x x` and there is no bend; for a block it is `y`.
            let bend = lanes.mul_add(
                c20,
                xx,
                lanes.mul(y, lanes.mul_add(c11, x, lanes.mul(c02, y))),
            );
            let place = lanes.mul_add(x, along, lanes.mul_add(second, across, bend));
            let step = lanes.mul_add(x, along_step, lanes.mul(second, across_step));
            let [cos, sin] = phasors.at(lanes, reduced(lanes, lanes.mul(kappa, place)));
            let [step_cos, step_sin] = phasors.at(lanes, reduced(lanes, lanes.mul(kappa, step)));
            lanes.store(place, &mut self.place[part..]);
            lanes.store(step, &mut self.step[part..]);
            lanes.store(cos, &mut self.z[0][part..]);
            lanes.store(sin, &mut self.z[1][part..]);
            let before = lanes.mul_add(cos, step_cos, lanes.mul(sin, step_sin));
            lanes.store(before, &mut self.before[0][part..]);
            let before = lanes.neg_mul_add(cos, step_sin, lanes.mul(sin, step_cos));
            lanes.store(before, &mut self.before[1][part..]);
            lanes.store(lanes.add(step_cos, step_cos), &mut self.twice[part..]);
        }
    }

    /// Midpoint of two lanes: position in the first group, and step per group.
    #[inline(always)]
    pub(super) fn middle(&self, first: usize, last: usize) -> [f32; 2] {
        [&self.place, &self.step].map(|all| (all[first] + all[last]) / 2.0)
    }
}

/// Recurrence state of the pixels in a register.
#[derive(Clone, Copy)]
pub(super) struct CarrierRecurrence<L: Lanes> {
    place: L::Numbers,
    step: L::Numbers,
    z: [L::Numbers; 2],
    before: [L::Numbers; 2],
    twice: L::Numbers,
}

impl<L: Lanes> CarrierRecurrence<L> {
    /// State for the lanes from `part` on.
    #[inline(always)]
    pub(super) fn new(lanes: L, start: &Start, part: usize) -> Self {
        Self {
            place: lanes.load(&start.place[part..]),
            step: lanes.load(&start.step[part..]),
            z: [
                lanes.load(&start.z[0][part..]),
                lanes.load(&start.z[1][part..]),
            ],
            before: [
                lanes.load(&start.before[0][part..]),
                lanes.load(&start.before[1][part..]),
            ],
            twice: lanes.load(&start.twice[part..]),
        }
    }

    /// Positions at the next group, from that of its centre.
    #[inline(always)]
    pub(super) fn place(&mut self, lanes: L, at: f32) -> L::Numbers {
        let place = lanes.add(self.place, lanes.splat(at));
        self.place = lanes.add(self.place, self.step);
        place
    }

    /// Carrier at the next group, from that of its centre.
    #[inline(always)]
    pub(super) fn turned(&mut self, lanes: L, [cos, sin]: [f32; 2]) -> [L::Numbers; 2] {
        let (cos, sin) = (lanes.splat(cos), lanes.splat(sin));
        let ([re, im], before) = (self.z, self.before);
        self.before = self.z;
        self.z = [
            lanes.mul_sub(self.twice, re, before[0]),
            lanes.mul_sub(self.twice, im, before[1]),
        ];
        [
            lanes.neg_mul_add(im, sin, lanes.mul(re, cos)),
            lanes.mul_add(re, sin, lanes.mul(im, cos)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::lanes::Portable;
    use crate::phasor::PHASOR_RMS;
    use crate::tile::shape::{Shape, TURNED};
    use crate::trial::Numbers;

    /// Phase steps from zero to half a cycle, against float64 phasors of the same positions.
    #[test]
    fn phasor_recurrence_error_is_as_documented() {
        let (lanes, mut numbers) = (Portable, Numbers::new(7));
        let phasors = Polynomials::new(lanes);
        let offsets = Offsets::new(Shape::ROW);
        let (mut squares, mut count) = (0.0, 0);
        for _ in 0..2000 {
            let along = libm::pow(10.0, -5.0 * numbers.unit());
            let column = Column {
                place: [0.0; 4],
                along: [
                    along * numbers.signed(),
                    0.05 * along * numbers.signed(),
                    0.0,
                ],
                across: [0.0; 3],
                bend: [0.0; 3],
            };
            // A carrier of one cycle per bin separates phasor errors from float32 position errors.
            let middles: [f64; TURNED] = std::array::from_fn(|row| row as f64);
            let path = Path {
                column,
                place: 0.0,
                turns: 0.0,
                kappa: 1.0,
            };
            let mut start = Start::ZERO;
            start.set(lanes, &phasors, &path, &offsets, &middles);
            for part in (0..GROUP).step_by(Portable::COUNT) {
                let mut pixels = CarrierRecurrence::new(lanes, &start, part);
                for row in 0..TURNED {
                    let [cos, sin] = pixels.turned(lanes, [1.0, 0.0]);
                    for lane in 0..Portable::COUNT {
                        let of = |all: &[f32; GROUP]| f64::from(all[part + lane]);
                        let turns = of(&start.place) + row as f64 * of(&start.step);
                        let (s, c) = libm::sincos(TAU * turns);
                        squares += (f64::from(cos[lane]) - c).powi(2);
                        squares += (f64::from(sin[lane]) - s).powi(2);
                        count += 1;
                    }
                }
            }
        }
        let rms = (squares / f64::from(count)).sqrt();
        assert!(rms <= PHASOR_RMS && rms > 0.5 * PHASOR_RMS, "{rms}");
    }
}
