//! The pixels of a column of groups, from group to group: their places and the carrier there.
//!
//! With the place `t(i + x, j + y)` of a pixel at `x` and `y` from its group's middle,
//!
//! ```text
//! t(i + x, j + y) = t(i, j) + v_j(x, y),    exp(j 2 pi kappa t(i + x, j + y)) = exp(j 2 pi kappa t(i, j)) z_j(x, y)
//! ```
//!
//! What is of the middle is made in float64, once a group. The rest changes slowly from group to group: over a run of [`TURNED`](super::shape::TURNED) of them
//! `v` is taken as a straight line in `j`, so that it takes an addition, and the carrier as its phasors, `2 pi kappa d` apart,
//!
//! ```text
//! z_(j + 1) = 2 cos(2 pi kappa d) z_j - z_(j - 1)
//! ```
//!
//! and that times the middle's: six operations a pixel, where a phasor by itself takes three times as many. A rounding of `z_j` grows
//! linearly from there on at most. What the line leaves of the polynomial's third degree is counted with what groups lose
//! ([`Shape::left_out`](super::shape::Shape::left_out)).

use super::expansion::Column;
use super::groups::Offsets;
use crate::lanes::{GROUP, Lanes};
use crate::phasor::{Polynomials, reduced};

/// A pulse's paths along a column of groups.
#[derive(Clone, Copy)]
pub(super) struct Path {
    pub(super) column: Column,
    /// Place of the tile's centre among the pieces.
    pub(super) place: f64,
    /// Turns of the carrier there, less whole ones,
    pub(super) turns: f64,
    /// and a bin.
    pub(super) kappa: f64,
}

/// Where a run of groups begins: what its pixels' places follow from, bins, and the carrier there.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Start {
    /// Of the first group, from its middle.
    place: [f32; GROUP],
    /// From group to group.
    step: [f32; GROUP],
    /// The carrier at the first group,
    z: [[f32; GROUP]; 2],
    /// at the one before,
    before: [[f32; GROUP]; 2],
    /// and twice the cosine from group to group.
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

    /// Of groups whose middles are at these rows of pixels.
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
        // The mean of the square about the middle: the line is that of least squares.
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
            // Of a row `second` is `x x` and there is no bend, of a block it is `y`.
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

    /// About halfway between two lanes: the place in the first group, and from group to group.
    #[inline(always)]
    pub(super) fn middle(&self, first: usize, last: usize) -> [f32; 2] {
        [&self.place, &self.step].map(|all| (all[first] + all[last]) / 2.0)
    }
}

/// The pixels of some lanes, on their way along a run.
#[derive(Clone, Copy)]
pub(super) struct Turning<L: Lanes> {
    place: L::Numbers,
    step: L::Numbers,
    z: [L::Numbers; 2],
    before: [L::Numbers; 2],
    twice: L::Numbers,
}

impl<L: Lanes> Turning<L> {
    /// Of the lanes from `part` on.
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

    /// Places at the next group, whose middle's is given.
    #[inline(always)]
    pub(super) fn place(&mut self, lanes: L, at: f32) -> L::Numbers {
        let place = lanes.add(self.place, lanes.splat(at));
        self.place = lanes.add(self.place, self.step);
        place
    }

    /// The carrier at the next group, whose middle's is given.
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

    /// From steps of nothing to half a turn, against float64 on what the pixels' own numbers say.
    #[test]
    fn phasors_are_as_good_as_stated() {
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
            // Of a carrier of one turn a bin, what float32 makes of places is not of phasors.
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
                let mut pixels = Turning::new(lanes, &start, part);
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
