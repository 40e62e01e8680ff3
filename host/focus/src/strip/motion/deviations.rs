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
use subaperture_signal::dense::Factor;

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
    /// Middle of `1 / rho`, and half of its width, cycles a metre: kept, for they are asked for at every place of every pulse.
    inverse: [f64; 2],
}

impl Interval {
    pub(super) fn new(middle_m: f64, half_m: f64) -> Self {
        let (near, far) = (1.0 / (middle_m - half_m), 1.0 / (middle_m + half_m));
        Self {
            middle_m,
            half_m,
            inverse: [(near + far) / 2.0, (near - far) / 2.0],
        }
    }

    /// `1 / rho`, from -1 at the far end to 1 at the near one.
    fn place(&self, range_m: f64) -> f64 {
        let [middle, half] = self.inverse;
        (1.0 / range_m - middle) / half
    }

    /// The degree whose neglected terms are small, 1 or more.
    pub(super) fn degree(&self) -> usize {
        let [middle, half] = self.inverse;
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

/// Of all pulses, each on its interval, of one degree; none if a pulse has no such polynomial: its numbers are beyond float64.
pub(super) fn fitted(
    collection: &Collection,
    grid: &ImageGrid,
    motion: &Motion,
    intervals: &[Interval],
    degree: usize,
) -> Option<Vec<Deviation>> {
    let points = spread(grid, SIDE);
    let pulses = collection.pulses.par_iter().zip(intervals).enumerate();
    let each = pulses.map(|(n, (pulse, &interval))| {
        let count = degree + 1;
        let mut normal = vec![0.0; count * count];
        let mut coefficients = [0.0; COEFFICIENTS];
        let right = &mut coefficients[..count];
        for &point in &points {
            let range_m = motion.range_m(n, point);
            let excess_m = pulse.path_m(point) / 2.0 - range_m;
            let basis = chebyshev(interval.place(range_m));
            for i in 0..count {
                right[i] += basis[i] * excess_m;
                for j in 0..=i {
                    normal[i * count + j] += basis[i] * basis[j];
                }
            }
        }
        let ridge = RIDGE * points.len() as f64;
        (0..count).for_each(|i| normal[i * (count + 1)] += ridge);
        Factor::new(count, &normal, 0.0)?.solve(right);
        Some(Deviation {
            interval,
            coefficients,
        })
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
