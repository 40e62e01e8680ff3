//! Rank-2 model of the paths from a track to the points of a patch.
//!
//! ```text
//! path_n(p) - path_n(q) = alpha_n a(p) + beta_n b(p) + residual
//! ```
//!
//! `q` is the centre of the patch. The first functions are the mean and the slope over slow time, `a = mean_n D`, `b = slope_n D` of the table
//! `D` of path differences. Coefficients and functions are then solved in turn by weighted least squares, which converges to the
//! dominant singular vectors of the table. The model contains the linear path of [`crate::paths::lines`] (`alpha = 1`, `beta = u`) and in
//! addition the rotation of the line of sight, which is exact for points in a plane far away (polar format).
//!
//! Float64; sums in a fixed order, bit-identical in all instruction sets. **Cost** per pulse: 2 distances and 20 multiply-adds for each point.

use crate::lanes::{Instructions, Kernel, Lanes};
use crate::paths::{Antennas, paths};

/// Number of points at which paths are fitted.
pub const POINTS: usize = 32;

/// Coordinates x, y and z of the points, metres.
pub type Places = [[f64; POINTS]; 3];

/// Path differences of one pulse, metres.
pub type Differences = [f64; POINTS];

/// Compute the path differences of every pulse: each path minus the pulse's datum.
///
/// # Panics
/// If `table` does not have one row for each pulse.
pub fn differences(
    instructions: Instructions,
    antennas: &[Antennas],
    places: &Places,
    table: &mut [Differences],
) {
    assert_eq!(antennas.len(), table.len());
    instructions.run(Table {
        antennas,
        places,
        table,
    });
}

struct Table<'a> {
    antennas: &'a [Antennas],
    places: &'a Places,
    table: &'a mut [Differences],
}

impl Kernel for Table<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let [x, y, z] = self.places;
        for (antennas, row) in self.antennas.iter().zip(self.table) {
            paths(antennas, [x, y, z], row);
        }
    }
}

/// Model fitted to a table of path differences.
#[derive(Clone, Debug, Default)]
pub struct RankTwo {
    /// `alpha` and `beta` of each pulse; the weighted mean of `alpha` is 1.
    pub coefficients: Vec<[f64; 2]>,
    /// `a` and `b` at the points, metres, and metres per pulse.
    pub functions: [[f64; POINTS]; 2],
    /// Weighted mean square of the residual, square metres.
    pub mean_square_m2: f64,
}

/// Iterations: the mean and slope are close to the singular vectors already.
const ITERATIONS: usize = 2;

impl RankTwo {
    /// Fit a table with the given weights of pulses and of points. Returns whether the table has rank 2; otherwise the model is not usable.
    ///
    /// # Panics
    /// If the numbers of weights and pulses differ.
    pub fn fit(
        &mut self,
        instructions: Instructions,
        table: &[Differences],
        pulse_weights: &[f64],
        point_weights: &[f64; POINTS],
    ) -> bool {
        assert_eq!(table.len(), pulse_weights.len());
        instructions.run(Fit {
            model: self,
            table,
            pulse_weights,
            point_weights,
        })
    }
}

struct Fit<'a> {
    model: &'a mut RankTwo,
    table: &'a [Differences],
    pulse_weights: &'a [f64],
    point_weights: &'a [f64; POINTS],
}

/// Partial sums, which the compiler keeps in vectors.
const PARTS: usize = 8;

/// Sum of products over the points.
#[inline(always)]
fn dot(a: &[f64; POINTS], b: &[f64; POINTS]) -> f64 {
    let mut parts = [0.0; PARTS];
    for i in 0..POINTS / PARTS {
        for (j, part) in parts.iter_mut().enumerate() {
            *part += a[PARTS * i + j] * b[PARTS * i + j];
        }
    }
    let [a, b, c, d, e, f, g, h] = parts;
    ((a + b) + (c + d)) + ((e + f) + (g + h))
}

/// Solution of the symmetric equations of two unknowns; `None` if they are nearly dependent.
#[inline(always)]
fn inverse([aa, ab, bb]: [f64; 3]) -> Option<[f64; 3]> {
    let determinant = aa * bb - ab * ab;
    let independent = determinant > 1e-12 * aa * bb;
    independent.then(|| [bb / determinant, -ab / determinant, aa / determinant])
}

impl Kernel for Fit<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> bool {
        let Self {
            model,
            table,
            pulse_weights,
            point_weights,
        } = self;
        let total: f64 = pulse_weights.iter().sum();
        let places = || (0..table.len()).map(|n| n as f64);
        let middle = places().zip(pulse_weights).map(|(n, w)| n * w).sum::<f64>() / total;
        model.coefficients.clear();
        model
            .coefficients
            .extend(places().map(|n| [1.0, n - middle]));
        for iteration in 0..=ITERATIONS {
            // Functions of the points from the coefficients of the pulses.
            let mut squares = [0.0; 3];
            let mut sums = [[0.0; POINTS]; 2];
            for ((row, &weight), &[alpha, beta]) in
                table.iter().zip(pulse_weights).zip(&model.coefficients)
            {
                let [a, b] = [weight * alpha, weight * beta];
                squares[0] += a * alpha;
                squares[1] += a * beta;
                squares[2] += b * beta;
                for i in 0..POINTS {
                    sums[0][i] += a * row[i];
                    sums[1][i] += b * row[i];
                }
            }
            let Some([aa, ab, bb]) = inverse(squares) else {
                return false;
            };
            let [mut a, mut b] = [[0.0; POINTS]; 2];
            for i in 0..POINTS {
                a[i] = aa * sums[0][i] + ab * sums[1][i];
                b[i] = ab * sums[0][i] + bb * sums[1][i];
            }
            // Coefficients of the pulses from the functions of the points.
            let [mut weighted_a, mut weighted_b] = [[0.0; POINTS]; 2];
            for i in 0..POINTS {
                weighted_a[i] = point_weights[i] * a[i];
                weighted_b[i] = point_weights[i] * b[i];
            }
            let squares = [
                dot(&weighted_a, &a),
                dot(&weighted_a, &b),
                dot(&weighted_b, &b),
            ];
            let Some([aa, ab, bb]) = inverse(squares) else {
                return false;
            };
            let (mut mean_alpha, mut residual) = (0.0, 0.0);
            for ((row, &weight), own) in
                table.iter().zip(pulse_weights).zip(&mut model.coefficients)
            {
                let [pa, pb] = [dot(&weighted_a, row), dot(&weighted_b, row)];
                let [alpha, beta] = [aa * pa + ab * pb, ab * pa + bb * pb];
                *own = [alpha, beta];
                mean_alpha += weight * alpha;
                if iteration == ITERATIONS {
                    let mut square = [0.0; POINTS];
                    for i in 0..POINTS {
                        let rest = row[i] - alpha * a[i] - beta * b[i];
                        square[i] = rest * rest;
                    }
                    residual += weight * dot(point_weights, &square);
                }
            }
            mean_alpha /= total;
            for own in &mut model.coefficients {
                own[0] /= mean_alpha;
            }
            for a in &mut a {
                *a *= mean_alpha;
            }
            model.functions = [a, b];
            model.mean_square_m2 = residual / total / point_weights.iter().sum::<f64>();
        }
        model.mean_square_m2.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Numbers;

    /// A table of rank 2 plus a known third term: its rows are recovered, and the residual is the term's.
    #[test]
    fn model_recovers_rank_and_residual() {
        let mut numbers = Numbers::new(3);
        let functions: [[f64; POINTS]; 3] = [0; 3].map(|_| [0; POINTS].map(|_| numbers.signed()));
        let weights: [f64; POINTS] = [0; POINTS].map(|_| 0.5 + numbers.unit());
        let count = 80;
        for size in [0.0, 1e-5] {
            let table: Vec<Differences> = (0..count)
                .map(|n| {
                    let u = f64::from(n) / 40.0 - 1.0;
                    let third = size * (u * u - 1.0 / 3.0);
                    std::array::from_fn(|i| {
                        let [a, b, c] = [0, 1, 2].map(|j| functions[j][i]);
                        (1.0 - 1e-3 * u * u) * 30.0 * a + (u + 1e-3 * u * u * u) * b + third * c
                    })
                })
                .collect();
            let pulses: Vec<f64> = table.iter().map(|_| 0.5 + numbers.unit()).collect();
            let mut models = Vec::new();
            for instructions in Instructions::available() {
                let mut model = RankTwo::default();
                assert!(model.fit(instructions, &table, &pulses, &weights));
                models.push(model);
            }
            let model = &models[0];
            for other in &models {
                assert_eq!(other.coefficients, model.coefficients);
                assert_eq!(other.functions, model.functions);
            }
            let mut worst = 0.0f64;
            for (row, [alpha, beta]) in table.iter().zip(&model.coefficients) {
                for i in 0..POINTS {
                    let [a, b] = model.functions.map(|f| f[i]);
                    worst = worst.max((row[i] - alpha * a - beta * b).abs());
                }
            }
            assert!(worst < 1e-12 + 2.0 * size, "{worst}");
            let rms = model.mean_square_m2.sqrt();
            // The RMS of `u^2 - 1/3` is 0.3, of the function 0.58; some of it fits the two other terms.
            assert!(rms < 1e-12 + 0.2 * size && rms >= 0.1 * size, "{rms}");
        }
        let flat = vec![[1.0; POINTS]; 10];
        let mut model = RankTwo::default();
        assert!(!model.fit(Instructions::best(), &flat, &[1.0; 10], &weights));
    }
}
