//! Atmospheric screen: a phase that is constant or linear in range.

use num_complex::Complex64;
use subaperture_signal::phase::cis;

/// Largest change of the refractive index between two passes.
const LARGEST_INDEX: f64 = 1e-4;

/// Points used for the start at most.
const START_POINTS: usize = 2000;

/// Constant of Tukey's biweight: 95 % efficiency for Gaussian residuals.
const BIWEIGHT: f64 = 4.685;

/// Iterations of robust fits; weights settle within some ten.
const ITERATIONS: usize = 30;

/// Design of the fit: scaled range of each point, deviation, and membership.
pub(super) struct Design {
    /// `(r - mean) / scale`, dimensionless; 0 for a constant screen.
    pub(super) across: Vec<f64>,
    /// Phase deviation of each point in one pass, radians.
    pub(super) deviations: Vec<f64>,
    /// Points that may determine the screen.
    pub(super) members: Vec<bool>,
    /// Metres of range per unit of `across`.
    pub(super) scale_m: f64,
    /// Number of estimated terms: 1 or 2.
    pub(super) terms: usize,
}

/// Constant and slope per unit of `across`, radians.
pub(super) type Screen = [f64; 2];

/// Symmetric matrix of two terms.
type Square = [[f64; 2]; 2];

/// Fit of all passes.
pub(super) struct Joint {
    /// Screen of each pass.
    pub(super) screens: Vec<Screen>,
    /// Robust weight of each point, 0 to 1.
    pub(super) weights: Vec<f64>,
    /// Inverse of the normal matrix.
    inverse: Square,
    /// Covariance of the terms of one pass.
    pub(super) covariance: Square,
}

fn product([a, b]: Screen, x: f64) -> f64 {
    a + b * x
}

/// `j M j'` for `j = [1, x]`.
fn form(matrix: &Square, x: f64) -> f64 {
    matrix[0][0] + x * (matrix[0][1] + matrix[1][0]) + x * x * matrix[1][1]
}

impl Design {
    /// Phase of a screen at a point.
    pub(super) fn phase(&self, screen: Screen, point: usize) -> f64 {
        product(screen, self.across[point])
    }

    /// Leave doubtful points out of the fit, as long as twice as many points as terms are left.
    pub(super) fn leave_out(&mut self, doubtful: &[Option<usize>]) {
        let sure = |p: &usize| doubtful[*p].is_none();
        if self.members().filter(sure).count() >= 2 * self.terms {
            for (member, doubtful) in self.members.iter_mut().zip(doubtful) {
                *member &= doubtful.is_none();
            }
        }
    }

    fn members(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.across.len()).filter(|&p| self.members[p])
    }

    /// Sum of `w j'j`.
    fn normal(&self, weight: impl Fn(usize) -> f64) -> Square {
        let mut sum = [[0.0; 2]; 2];
        for p in self.members() {
            let (w, x) = (weight(p), self.across[p]);
            sum[0][0] += w;
            sum[0][1] += w * x;
            sum[1][1] += w * x * x;
        }
        sum[1][0] = sum[0][1];
        sum
    }

    /// Inverse of a normal matrix; zero for a slope that is not estimated, or not determined.
    fn inverse(&self, [[a, b], [_, c]]: Square) -> Square {
        let determinant = a * c - b * b;
        if self.terms == 2 && determinant > 1e-12 * a * c {
            let d = 1.0 / determinant;
            return [[c * d, -b * d], [-b * d, a * d]];
        }
        match a > 0.0 {
            true => [[1.0 / a, 0.0], [0.0, 0.0]],
            false => [[0.0; 2]; 2],
        }
    }

    /// Least-squares screen of phases under weights.
    fn solve(&self, inverse: &Square, weight: impl Fn(usize) -> f64, phases: &[f64]) -> Screen {
        let mut right = [0.0; 2];
        for p in self.members() {
            let value = weight(p) * phases[p];
            right[0] += value;
            right[1] += value * self.across[p];
        }
        [0, 1].map(|i| inverse[i][0] * right[0] + inverse[i][1] * right[1])
    }

    /// Precision of a point: inverse of its variance.
    fn precision(&self, p: usize) -> f64 {
        1.0 / (self.deviations[p] * self.deviations[p])
    }

    /// Screen of wrapped phases: periodogram over the slope, then robust least squares of phases wrapped about the fit.
    pub(super) fn of_wrapped(&self, phases: &[f64], wavelength_m: f64) -> Screen {
        let mut screen = self.start(phases, wavelength_m);
        for _ in 0..ITERATIONS {
            let about: Vec<f64> = (phases.iter().enumerate())
                .map(|(p, &phase)| wrapped(phase - self.phase(screen, p)))
                .collect();
            let normalised = |p: usize| about[p] / self.deviations[p];
            let scale = self.scale(normalised);
            let weight = |p: usize| self.precision(p) * biweight(normalised(p) / scale);
            let inverse = self.inverse(self.normal(weight));
            let step = self.solve(&inverse, weight, &about);
            screen = [screen[0] + step[0], screen[1] + step[1]];
            if step[0].abs() + step[1].abs() < 1e-9 {
                break;
            }
        }
        screen
    }

    fn start(&self, phases: &[f64], wavelength_m: f64) -> Screen {
        let members: Vec<usize> = self.members().collect();
        let every = members.len().div_ceil(START_POINTS);
        let members: Vec<usize> = members.into_iter().step_by(every.max(1)).collect();
        let sum = |slope: f64| -> Complex64 {
            let terms = members.iter();
            terms
                .map(|&p| cis(phases[p] - slope * self.across[p]))
                .sum()
        };
        let mut best = (sum(0.0), 0.0);
        if self.terms == 2 {
            // A quarter of a turn from end to end between steps loses less than 3 % of the peak.
            let ends = members.iter().fold([0.0f64; 2], |[low, high], &p| {
                [low.min(self.across[p]), high.max(self.across[p])]
            });
            let step = 0.5 * std::f64::consts::PI / (ends[1] - ends[0]).max(1e-9);
            let most = 4.0 * std::f64::consts::PI / wavelength_m * LARGEST_INDEX * self.scale_m;
            let steps = (most / step).ceil().min(1e5) as i64;
            for n in (-steps..=steps).filter(|&n| n != 0) {
                let slope = n as f64 * step;
                let found = sum(slope);
                // Of equal peaks the smallest slope.
                if found.norm() > best.0.norm() * (1.0 + 1e-9) {
                    best = (found, slope);
                }
            }
        }
        [best.0.arg(), best.1]
    }

    /// Robust scale of normalised residuals of the members: median magnitude over that of a unit Gaussian, at least 1.
    fn scale(&self, normalised: impl Fn(usize) -> f64) -> f64 {
        let mut sizes: Vec<f64> = self.members().map(|p| normalised(p).abs()).collect();
        let middle = sizes.len() / 2;
        match sizes.is_empty() {
            true => 1.0,
            false => (*sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.674_49).max(1.0),
        }
    }

    /// Screens of all passes after the first from unwrapped phases relative to it, with one robust weight per point: that of its largest residual.
    pub(super) fn joint(&self, phases: &[Vec<f64>]) -> Joint {
        let count = self.across.len();
        let mut weights: Vec<f64> = self
            .members
            .iter()
            .map(|&m| f64::from(u8::from(m)))
            .collect();
        let mut screens = Vec::new();
        let mut inverse = [[0.0; 2]; 2];
        for iteration in 0..=ITERATIONS {
            let weight = |p: usize| weights[p] * self.precision(p);
            inverse = self.inverse(self.normal(weight));
            screens = (phases.iter())
                .map(|phases| self.solve(&inverse, weight, phases))
                .collect();
            if iteration == ITERATIONS {
                break;
            }
            let mut largest = vec![0.0f64; count];
            for (phases, screen) in phases.iter().zip(&screens) {
                // Differences of two passes have twice the variance.
                let normalised = |p: usize| {
                    (phases[p] - self.phase(*screen, p))
                        / (std::f64::consts::SQRT_2 * self.deviations[p])
                };
                let scale = self.scale(normalised);
                for p in self.members() {
                    largest[p] = largest[p].max((normalised(p) / scale).abs());
                }
            }
            let next: Vec<f64> = (0..count)
                .map(|p| {
                    if self.members[p] {
                        biweight(largest[p])
                    } else {
                        0.0
                    }
                })
                .collect();
            // Without any weight left, as for two points that disagree, the plain fit stays.
            if self.normal(|p| next[p])[0][0] < self.terms as f64 {
                break;
            }
            let moved = (next.iter().zip(&weights)).map(|(a, b)| (a - b).abs());
            let settled = moved.fold(0.0, f64::max) < 1e-6;
            weights = next;
            if settled {
                break;
            }
        }
        let middle = self.normal(|p| weights[p] * weights[p] * self.precision(p));
        let covariance = between(&inverse, &middle);
        Joint {
            screens,
            weights,
            inverse,
            covariance,
        }
    }

    /// Variance of a point's phase after removal of the screen, for the noise of one pass, rad^2.
    pub(super) fn variance(&self, joint: &Joint, point: usize) -> f64 {
        let x = self.across[point];
        let own = self.deviations[point] * self.deviations[point];
        let shared = 2.0 * joint.weights[point] * form(&joint.inverse, x);
        // Rounding can leave a negative value where the fit follows a point entirely.
        (own + form(&joint.covariance, x) - shared).max(0.0)
    }

    /// Mean square of the normalised residuals of the points of the fit, where it exceeds 1 by more than three of its standard deviations; else 1.
    pub(super) fn excess(&self, joint: &Joint, phases: &[f64], screen: Screen) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for p in self.members() {
            let residual = phases[p] - self.phase(screen, p);
            sum += joint.weights[p] * 0.5 * residual * residual * self.precision(p);
            total += joint.weights[p];
        }
        let freedom = total - self.terms as f64;
        let excess = sum / freedom.max(1.0);
        match excess > 1.0 + 3.0 * (2.0 / freedom.max(1.0)).sqrt() {
            true => excess,
            false => 1.0,
        }
    }
}

/// `A M A` of symmetric matrices.
fn between(a: &Square, m: &Square) -> Square {
    let times = |l: &Square, r: &Square| -> Square {
        [0, 1].map(|i| [0, 1].map(|j| l[i][0] * r[0][j] + l[i][1] * r[1][j]))
    };
    times(&times(a, m), a)
}

/// Tukey's biweight of a normalised residual.
fn biweight(u: f64) -> f64 {
    let v = u / BIWEIGHT;
    match v.abs() < 1.0 {
        true => (1.0 - v * v) * (1.0 - v * v),
        false => 0.0,
    }
}

/// Phase within half a turn of zero.
pub(super) fn wrapped(phase: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    phase - turn * (phase / turn).round()
}
