//! A pulse's deviation from the line as a function of range.
//!
//! `d_n(rho)` is the polynomial in `1 / rho` that is nearest, in the sense of least squares, to half of the excess path at [`SIDE`] by
//! [`SIDE`] pixels of the grid. In `1 / rho`, for so the deviation is nearly one: with the grid's plane `h` off the line the components of
//! the direction across the track are `h / rho` and `sqrt(1 - (h / rho)^2)`, and the terms that are left of a polynomial of degree `p`
//! fall as `eta^(p + 1)` or faster, with `eta` half the interval of `1 / rho` over its middle ([`Interval::degree`]).

use super::Motion;
use crate::probes::spread;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;

use rayon::prelude::*;

/// Pixels a side of the grid that a polynomial is fitted to: others than those at which what it leaves is looked at.
const SIDE: usize = 12;

/// Coefficients of the highest degree.
pub(super) const COEFFICIENTS: usize = 5;

/// What the terms left out may be, relative to the deviation.
const LEFT_OUT: f64 = 1e-5;

/// Of the diagonal, so that where all pixels are at one range there is a solution, too: the flattest.
const RIDGE: f64 = 1e-13;

/// Interval of ranges on which a polynomial is defined, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) middle_m: f64,
    pub(super) half_m: f64,
}

impl Interval {
    /// Middle of `1 / rho`, and half of its width, cycles a metre.
    fn inverse(&self) -> [f64; 2] {
        let (near, far) = (
            1.0 / (self.middle_m - self.half_m),
            1.0 / (self.middle_m + self.half_m),
        );
        [(near + far) / 2.0, (near - far) / 2.0]
    }

    /// `1 / rho`, from -1 at the far end to 1 at the near one.
    fn place(&self, range_m: f64) -> f64 {
        let [middle, half] = self.inverse();
        (1.0 / range_m - middle) / half
    }

    /// The degree whose neglected terms are small, 1 or more.
    pub(super) fn degree(&self) -> usize {
        let [middle, half] = self.inverse();
        let terms = libm::log(LEFT_OUT) / libm::log(half / middle);
        (terms.ceil().max(2.0) as usize).min(COEFFICIENTS) - 1
    }
}

/// `d` of one pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deviation {
    pub(super) interval: Interval,
    /// Of Chebyshev's polynomials, metres.
    coefficients: [f64; COEFFICIENTS],
}

impl Deviation {
    /// Half of the path by which a point at `range_m` from the line is farther from the pulse, metres.
    pub(super) fn at(&self, range_m: f64) -> f64 {
        let t = self.interval.place(range_m);
        let (mut last, mut before) = (0.0, 0.0);
        for &coefficient in self.coefficients[1..].iter().rev() {
            (last, before) = (2.0 * t * last - before + coefficient, last);
        }
        t * last - before + self.coefficients[0]
    }
}

/// Of all pulses, each on its interval, of one degree.
pub(super) fn fitted(
    collection: &Collection,
    grid: &ImageGrid,
    motion: &Motion,
    intervals: &[Interval],
    degree: usize,
) -> Vec<Deviation> {
    let points = spread(grid, SIDE);
    let pulses = collection.pulses.par_iter().zip(intervals).enumerate();
    let each = pulses.map(|(n, (pulse, &interval))| {
        let count = degree + 1;
        let mut normal = [[0.0; COEFFICIENTS]; COEFFICIENTS];
        let mut right = [0.0; COEFFICIENTS];
        for &point in &points {
            let range_m = motion.range_m(n, point);
            let excess_m = pulse.path_m(point) / 2.0 - range_m;
            let basis = chebyshev(interval.place(range_m));
            for i in 0..count {
                right[i] += basis[i] * excess_m;
                for j in 0..=i {
                    normal[i][j] += basis[i] * basis[j];
                }
            }
        }
        let ridge = RIDGE * points.len() as f64;
        (0..count).for_each(|i| normal[i][i] += ridge);
        Deviation {
            interval,
            coefficients: solved(normal, right, count),
        }
    });
    each.collect()
}

fn chebyshev(t: f64) -> [f64; COEFFICIENTS] {
    let mut values = [1.0; COEFFICIENTS];
    values[1] = t;
    for i in 2..COEFFICIENTS {
        values[i] = 2.0 * t * values[i - 1] - values[i - 2];
    }
    values
}

/// The solution of `count` normal equations, of which the lower half is given, by Cholesky's factors.
fn solved(
    mut normal: [[f64; COEFFICIENTS]; COEFFICIENTS],
    mut right: [f64; COEFFICIENTS],
    count: usize,
) -> [f64; COEFFICIENTS] {
    for i in 0..count {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| normal[i][k] * normal[j][k]).sum();
            let left = normal[i][j] - known;
            normal[i][j] = if i == j {
                left.sqrt()
            } else {
                left / normal[j][j]
            };
        }
        let known: f64 = (0..i).map(|k| normal[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / normal[i][i];
    }
    for i in (0..count).rev() {
        let known: f64 = (i + 1..count).map(|k| normal[k][i] * right[k]).sum();
        right[i] = (right[i] - known) / normal[i][i];
    }
    right
}
