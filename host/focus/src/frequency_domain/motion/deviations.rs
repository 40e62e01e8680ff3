//! Deviation of a pulse from the line as a function of range.
//!
//! `d_n(rho)` is the polynomial in `1 / rho` fitted by least squares to half of the excess path at [`SIDE`] by
//! [`SIDE`] pixels of the grid. The deviation is nearly polynomial in `1 / rho`: with the grid plane at a distance `h` from the line, the components of
//! the direction across the track are `h / rho` and `sqrt(1 - (h / rho)^2)`. The terms beyond degree `p`
//! decay as `eta^(p + 1)` or faster, where `eta` is half the interval of `1 / rho` over its centre ([`Interval::degree`]).

use super::positions::Positions;
use crate::probes::spread;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::dense::Factor;

use rayon::prelude::*;

/// Pixels per side of the grid used for the fit; they differ from those at which the residual is evaluated.
const SIDE: usize = 12;

/// Number of coefficients of the highest degree.
pub(super) const COEFFICIENTS: usize = 5;

/// Largest neglected terms relative to the deviation.
const LEFT_OUT: f64 = 1e-5;

/// Ridge regularisation relative to the diagonal, so that pixels at a single range have a unique solution with minimal slope.
const RIDGE: f64 = 1e-13;

/// Interval of ranges on which a polynomial is defined, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) middle_m: f64,
    pub(super) half_m: f64,
    /// Centre and half-width of `1 / rho`, per metre; stored because they are used for every position of every pulse.
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

    /// Normalised `1 / rho`, from -1 at the far end to 1 at the near end.
    fn place(&self, range_m: f64) -> f64 {
        let [middle, half] = self.inverse;
        (1.0 / range_m - middle) / half
    }

    /// Smallest degree, at least 1, with negligible higher terms.
    pub(super) fn degree(&self) -> usize {
        let [middle, half] = self.inverse;
        let terms = libm::log(LEFT_OUT) / libm::log(half / middle);
        (terms.ceil().max(2.0) as usize).min(COEFFICIENTS) - 1
    }
}

/// Deviation `d` of one pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deviation {
    pub(super) interval: Interval,
    /// Chebyshev coefficients, metres.
    coefficients: [f64; COEFFICIENTS],
}

impl Deviation {
    /// Half of the excess two-way path of a point at `range_m` from the line, metres.
    pub(super) fn at(&self, range_m: f64) -> f64 {
        let t = self.interval.place(range_m);
        let (mut last, mut before) = (0.0, 0.0);
        for &coefficient in self.coefficients[1..].iter().rev() {
            (last, before) = (2.0 * t * last - before + coefficient, last);
        }
        t * last - before + self.coefficients[0]
    }
}

/// Fit deviations of all pulses with one degree, each on its interval; `None` if the fit of a pulse exceeds the range of float64.
pub(super) fn fitted(
    collection: &Collection,
    grid: &ImageGrid,
    positions: &Positions,
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
            let range_m = positions.range_m(n, point);
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
