//! Scatterers side by side, and the arithmetic that runs over them in lanes.
//!
//! Loops here are over arrays of one fixed length without branches, so that the compiler uses whatever
//! vectors the target has. Rounding is done by adding and subtracting `1.5 2^52`, which leaves an integer in a
//! float64's lowest bits: `round` is a call where the target is plain x86-64.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use glam::DVec3;

use crate::Scatterer;

/// Scatterers in a chunk.
pub(super) const LANES: usize = 256;

/// A value for every scatterer of a chunk.
pub(super) type Lanes<T> = [T; LANES];

/// `1.5 2^52`.
const INTEGER: f64 = 6_755_399_441_055_744.0;

/// Up to [`LANES`] scatterers; those past `count` have amplitude 0.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    pub(super) count: usize,
    pub(super) x_m: Lanes<f64>,
    pub(super) y_m: Lanes<f64>,
    pub(super) z_m: Lanes<f64>,
    pub(super) re: Lanes<f32>,
    pub(super) im: Lanes<f32>,
}

impl Chunk {
    /// Of at most [`LANES`] scatterers.
    pub(super) fn new(points: impl IntoIterator<Item = Scatterer>) -> Self {
        let mut chunk = Self {
            count: 0,
            x_m: [0.0; LANES],
            y_m: [0.0; LANES],
            z_m: [0.0; LANES],
            re: [0.0; LANES],
            im: [0.0; LANES],
        };
        for (i, point) in points.into_iter().take(LANES).enumerate() {
            [chunk.x_m[i], chunk.y_m[i], chunk.z_m[i]] = point.position_m.to_array();
            chunk.re[i] = point.amplitude.re as f32;
            chunk.im[i] = point.amplitude.im as f32;
            chunk.count = i + 1;
        }
        chunk
    }

    /// Where scatterer `i` is.
    pub(super) fn position_m(&self, i: usize) -> DVec3 {
        DVec3::new(self.x_m[i], self.y_m[i], self.z_m[i])
    }

    /// Distances from `from_m`.
    pub(super) fn ranges_m(&self, from_m: DVec3, out: &mut Lanes<f64>) {
        for i in 0..LANES {
            let (x, y, z) = (
                self.x_m[i] - from_m.x,
                self.y_m[i] - from_m.y,
                self.z_m[i] - from_m.z,
            );
            out[i] = (x * x + y * y + z * z).sqrt();
        }
    }
}

/// Phases over a run of samples, in turns: `turns + slope k + bend kappa^2`, with `k` counted from
/// the run's middle and `kappa` the same in half lengths of the run.
#[derive(Debug)]
pub(super) struct Phases {
    pub(super) turns: Lanes<f64>,
    pub(super) slope: Lanes<f64>,
    pub(super) bend: Lanes<f64>,
}

impl Phases {
    pub(super) fn new() -> Self {
        Self {
            turns: [0.0; LANES],
            slope: [0.0; LANES],
            bend: [0.0; LANES],
        }
    }
}

/// Values and where they go on a NUFFT's grid.
#[derive(Debug)]
pub(super) struct Values {
    /// First cell of the eight.
    pub(super) cell: Lanes<u32>,
    /// Place between the fourth and the fifth, 0 to 1.
    pub(super) fraction: Lanes<f32>,
    /// Real parts.
    pub(super) re: Lanes<f32>,
    /// Imaginary parts.
    pub(super) im: Lanes<f32>,
}

impl Values {
    pub(super) fn new() -> Self {
        Self {
            cell: [0; LANES],
            fraction: [0.0; LANES],
            re: [0.0; LANES],
            im: [0.0; LANES],
        }
    }

    /// `amplitude gain exp(j 2 pi turns)` at the places `slope` of a grid of `length` cells.
    pub(super) fn set(
        &mut self,
        amplitude: (&Lanes<f32>, &Lanes<f32>),
        gain: &Lanes<f32>,
        phases: &Phases,
        length: usize,
    ) {
        let cells = length as f64;
        let last = length as u32;
        for i in 0..LANES {
            let u = phases.slope[i];
            let place = (u - ((u + INTEGER) - INTEGER) + 0.5) * cells;
            let whole = (place - 0.5) + INTEGER;
            self.fraction[i] = (place - (whole - INTEGER)) as f32;
            // A place that is not a number must not lead outside the grid.
            self.cell[i] = (whole.to_bits() as u32).min(last);
        }
        for i in 0..LANES {
            let turns = phases.turns[i];
            let (sin, cos) = sin_cos((turns - ((turns + INTEGER) - INTEGER)) as f32);
            let (re, im) = (amplitude.0[i] * gain[i], amplitude.1[i] * gain[i]);
            self.re[i] = re * cos - im * sin;
            self.im[i] = re * sin + im * cos;
        }
    }
}

impl Values {
    /// From term `p - 1` of the series in the bend to term `p`: times `j 2 pi bend / p`.
    pub(super) fn next_term(&mut self, phases: &Phases, p: usize) {
        let factor = std::f64::consts::TAU / p as f64;
        for i in 0..LANES {
            let bend = (phases.bend[i] * factor) as f32;
            (self.re[i], self.im[i]) = (-self.im[i] * bend, self.re[i] * bend);
        }
    }
}

/// Sine and cosine of `turns`, `|turns| <= 1/2`, error 1e-6: Taylor series of the half angle, of
/// remainders 6e-8 and 7e-9, and the double-angle formulas, which make four times of it and of rounding.
#[inline(always)]
fn sin_cos(turns: f32) -> (f32, f32) {
    let x = turns * std::f32::consts::PI;
    let y = x * x;
    let sin = x
        * (1.0
            + y * (-1.0 / 6.0
                + y * (1.0 / 120.0
                    + y * (-1.0 / 5040.0 + y * (1.0 / 362_880.0 - y / 39_916_800.0)))));
    let cos = 1.0
        + y * (-0.5
            + y * (1.0 / 24.0
                + y * (-1.0 / 720.0
                    + y * (1.0 / 40_320.0
                        + y * (-1.0 / 3_628_800.0 + y * (1.0 / 479_001_600.0))))));
    (2.0 * sin * cos, 1.0 - 2.0 * sin * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_cosines_are_right_to_1e_6() {
        for i in 0..=10_000 {
            let turns = i as f32 / 10_000.0 - 0.5;
            let (sin, cos) = sin_cos(turns);
            let exact = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            assert!((f64::from(sin) - exact.0).abs() < 1e-6, "{turns}");
            assert!((f64::from(cos) - exact.1).abs() < 1e-6, "{turns}");
        }
    }

    #[test]
    fn values_lie_where_their_slope_says_and_never_outside() {
        let mut phases = Phases::new();
        phases.slope[..6].copy_from_slice(&[0.0, 0.5, -0.5, 17.25, -1e9 + 0.125, f64::NAN]);
        let mut values = Values::new();
        let ones = [1.0; LANES];
        values.set((&ones, &ones), &ones, &phases, 64);
        for (i, &u) in phases.slope[..5].iter().enumerate() {
            let place = f64::from(values.cell[i]) + f64::from(values.fraction[i]);
            let off = (place / 64.0 - 0.5 - u).rem_euclid(1.0);
            assert!(off.min(1.0 - off) < 1e-7, "{u}: {place}");
            assert!((0.0..=1.0).contains(&values.fraction[i]), "{u}");
        }
        assert!(values.cell.iter().all(|&cell| cell <= 64));
    }
}
