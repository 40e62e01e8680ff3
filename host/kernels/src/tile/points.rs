//! Backprojection of a pulse onto arbitrary points: positions and phases in float64.

use num_complex::Complex32;

use super::pieces::Pieces;
use super::pulse::TilePulse;
use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::paths::{Points, paths};
use crate::phasor::Polynomials;

/// Points per block (2 KiB).
const RUN: usize = 256;

/// Add a pulse to the sums of arbitrary points. `pieces` are those of the pulse, in the layout `layout`.
///
/// Paths and phases are float64 up to the fraction of a bin and the reduced phase; the rest is float32. For
/// values of magnitude 1 the error of a term is below 2e-6, mostly 3e-7, for any path.
///
/// # Panics
/// If the numbers of sums and points differ, or `pieces` does not have [`Pieces::values`].
pub fn add_points(
    instructions: Instructions,
    layout: &Pieces,
    pulse: &TilePulse,
    pieces: &[f32],
    points: &Points,
    sums: &mut [Complex32],
) {
    assert_eq!(points.len(), sums.len());
    assert_eq!(pieces.len(), layout.values());
    instructions.run(AddPoints {
        layout,
        pulse,
        pieces,
        points,
        sums,
    });
}

struct AddPoints<'a> {
    layout: &'a Pieces,
    pulse: &'a TilePulse,
    pieces: &'a [f32],
    points: &'a Points,
    sums: &'a mut [Complex32],
}

impl Kernel for AddPoints<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let planes = 2 * (self.layout.degree() + 1);
        let (row, length) = (self.layout.row(), self.layout.length() as f64);
        let first = self.layout.shift() + self.layout.first();
        let bins_m = self.pulse.turns_m * length;
        let kappa = self.pulse.cycles_a_bin;
        let phasor = Polynomials::new(lanes);
        let mut paths_m = [0.0; RUN];
        let mut places = [0usize; GROUP];
        let [mut parts, mut turns, mut real, mut imaginary, mut value] = [[0.0f32; GROUP]; 5];
        for (run, sums) in self.sums.chunks_mut(RUN).enumerate() {
            let from = run * RUN;
            let paths_m = &mut paths_m[..sums.len()];
            paths(
                &self.pulse.antennas,
                self.points.part(from..from + sums.len()),
                paths_m,
            );
            for (paths_m, sums) in paths_m.chunks(GROUP).zip(sums.chunks_mut(GROUP)) {
                for (i, path_m) in paths_m.iter().enumerate() {
                    let at = path_m * bins_m;
                    let turn = self.layout.turn(at);
                    let place = at - turn * length - first;
                    let whole = (place + 0.5).floor();
                    let part = place - whole;
                    let cycles = kappa * at;
                    places[i] = whole as usize;
                    parts[i] = part as f32;
                    turns[i] = (cycles - cycles.round()) as f32;
                }
                for group in (0..GROUP).step_by(L::COUNT) {
                    let f = lanes.load(&parts[group..]);
                    let mut sum = [lanes.splat(0.0); 2];
                    for k in (0..planes / 2).rev() {
                        for (sum, plane) in sum.iter_mut().zip([2 * k, 2 * k + 1]) {
                            let plane = &self.pieces[plane * row..(plane + 1) * row];
                            for (value, &place) in
                                value.iter_mut().zip(&places[group..group + L::COUNT])
                            {
                                *value = plane[place];
                            }
                            *sum = lanes.mul_add(*sum, f, lanes.load(&value));
                        }
                    }
                    let [cos, sin] = phasor.at(lanes, lanes.load(&turns[group..]));
                    let re = lanes.neg_mul_add(sin, sum[1], lanes.mul(cos, sum[0]));
                    let im = lanes.mul_add(sin, sum[0], lanes.mul(cos, sum[1]));
                    lanes.store(re, &mut real[group..]);
                    lanes.store(im, &mut imaginary[group..]);
                }
                for ((sum, re), im) in sums.iter_mut().zip(&real).zip(&imaginary) {
                    *sum += Complex32::new(*re, *im);
                }
            }
        }
    }
}
