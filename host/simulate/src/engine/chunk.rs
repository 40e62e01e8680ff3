//! Chunks of scatterers in lanes, and the arithmetic on them.
//!
//! Loops run over arrays of fixed length without branches, so that the compiler can vectorise them. Rounding is done by
//! adding and subtracting `1.5 2^52`, which leaves an integer in the lowest bits of a float64: `round` is a function
//! call on plain x86-64.

#![allow(
    clippy::needless_range_loop,
    reason = "lanes of several arrays of one fixed length, side by side"
)]

use std::borrow::Cow;

use glam::DVec3;

use crate::Scatterer;
use crate::scene::MovingPoint;

/// Scatterers per chunk.
pub(super) const LANES: usize = 256;

/// One value per scatterer of a chunk.
pub(super) type Lanes<T> = [T; LANES];

/// Rounding constant, `1.5 2^52`.
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
    /// Velocities along x, y and z, metres per second; `None` if the scatterers are static. Positions are at time 0.
    velocity_m_s: Option<Box<[Lanes<f64>; 3]>>,
}

impl Chunk {
    /// Make a chunk of at most [`LANES`] scatterers.
    pub(super) fn new(points: impl IntoIterator<Item = Scatterer>) -> Self {
        let mut chunk = Self {
            count: 0,
            x_m: [0.0; LANES],
            y_m: [0.0; LANES],
            z_m: [0.0; LANES],
            re: [0.0; LANES],
            im: [0.0; LANES],
            velocity_m_s: None,
        };
        for (i, point) in points.into_iter().take(LANES).enumerate() {
            [chunk.x_m[i], chunk.y_m[i], chunk.z_m[i]] = point.position_m.to_array();
            chunk.re[i] = point.amplitude.re as f32;
            chunk.im[i] = point.amplitude.im as f32;
            chunk.count = i + 1;
        }
        chunk
    }

    /// Make a chunk of at most [`LANES`] moving scatterers.
    pub(super) fn moving(points: &[MovingPoint]) -> Self {
        let mut velocity_m_s = Box::new([[0.0; LANES]; 3]);
        for (i, point) in points.iter().take(LANES).enumerate() {
            for (axis, component) in velocity_m_s.iter_mut().zip(point.velocity_m_s.to_array()) {
                axis[i] = component;
            }
        }
        Self {
            velocity_m_s: Some(velocity_m_s),
            ..Self::new(points.iter().map(|point| point.start))
        }
    }

    /// Whether the scatterers move.
    pub(super) fn moves(&self) -> bool {
        self.velocity_m_s.is_some()
    }

    /// Largest speed of the scatterers, metres per second.
    pub(super) fn speed_m_s(&self) -> f64 {
        let Some(velocity) = &self.velocity_m_s else {
            return 0.0;
        };
        let speeds = (0..self.count).map(|i| DVec3::from(velocity.map(|axis| axis[i])).length());
        speeds.fold(0.0, f64::max)
    }

    /// Size in memory, bytes.
    pub(super) fn held_bytes(&self) -> usize {
        size_of_val(self) + self.velocity_m_s.as_deref().map_or(0, size_of_val)
    }

    /// Chunk with the position of each scatterer `i` at `time_s(i)`.
    pub(super) fn at(&self, time_s: impl Fn(usize) -> f64) -> Cow<'_, Self> {
        let Some(velocity) = &self.velocity_m_s else {
            return Cow::Borrowed(self);
        };
        let mut chunk = Self {
            velocity_m_s: None,
            ..*self
        };
        let [vx, vy, vz] = &**velocity;
        for i in 0..LANES {
            let t = time_s(i);
            chunk.x_m[i] += vx[i] * t;
            chunk.y_m[i] += vy[i] * t;
            chunk.z_m[i] += vz[i] * t;
        }
        Cow::Owned(chunk)
    }

    /// Position of scatterer `i`, metres.
    pub(super) fn position_m(&self, i: usize) -> DVec3 {
        DVec3::new(self.x_m[i], self.y_m[i], self.z_m[i])
    }

    /// Centre and radius of a ball that contains the scatterers, metres.
    pub(super) fn ball(&self) -> (DVec3, f64) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for i in 0..self.count {
            let at = self.position_m(i);
            (low, high) = (low.min(at), high.max(at));
        }
        (0.5 * (low + high), 0.5 * low.distance(high))
    }

    /// Distances from `from_m`, metres.
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

/// Phases over a block of samples, in turns: `turns + slope k + bend kappa^2`, with `k` counted from the middle of the
/// block, and `kappa` the same in half lengths of the block.
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

/// Values and their positions on the NUFFT grid.
#[derive(Debug)]
pub(super) struct Values {
    /// First of the eight cells.
    pub(super) cell: Lanes<u32>,
    /// Position between the fourth and fifth cells, 0 to 1.
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

    /// Set the values to `amplitude gain exp(j 2 pi turns)`, at the grid positions given by `slope` on a grid of
    /// `length` cells.
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
            // A NaN position must not index outside the grid.
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
    /// Advance from term `p - 1` to term `p` of the series in the bend: multiply by `j 2 pi bend / p`.
    pub(super) fn next_term(&mut self, phases: &Phases, p: usize) {
        let factor = std::f64::consts::TAU / p as f64;
        for i in 0..LANES {
            let bend = (phases.bend[i] * factor) as f32;
            (self.re[i], self.im[i]) = (-self.im[i] * bend, self.re[i] * bend);
        }
    }
}

/// Sine and cosine of `turns`, `|turns| <= 1/2`, with an error of 1e-6: Taylor series of the half angle with remainders
/// 6e-8 and 7e-9, and the double-angle formulas, which multiply remainders and rounding errors by four.
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
    fn sine_and_cosine_error_is_below_1e_6() {
        for i in 0..=10_000 {
            let turns = i as f32 / 10_000.0 - 0.5;
            let (sin, cos) = sin_cos(turns);
            let exact = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            assert!((f64::from(sin) - exact.0).abs() < 1e-6, "{turns}");
            assert!((f64::from(cos) - exact.1).abs() < 1e-6, "{turns}");
        }
    }

    #[test]
    fn values_lie_at_grid_position_of_slope_and_never_outside() {
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
