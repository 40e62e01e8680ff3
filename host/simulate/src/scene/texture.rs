//! Texture of clutter: gamma-distributed variation of the mean backscatter, which makes the amplitude K-distributed.
//!
//! The power of a point is multiplied by the texture `tau(x, y) > 0` of mean 1, which has the gamma distribution of the order (shape) `nu`. A
//! resolution cell with many points has complex Gaussian speckle of the power `tau`; if `tau` is constant over the cell, the intensity of pixels
//! has the moments of the K distribution (Jakeman and Pusey 1976; Ward, Tough and Watts, "Sea Clutter", 2nd ed., 2013)
//!
//! ```text
//! <I^n> / <I>^n = n! Gamma(nu + n) / (nu^n Gamma(nu)),      <I^2> / <I>^2 = 2 (1 + 1 / nu)
//! ```
//!
//! The texture is a memoryless transform of a Gaussian field `g` of mean 0, variance 1 and correlation `exp(-d^2 / L^2)`:
//! `tau = F^-1(Phi(g))` with the distribution functions of the gamma (`F`) and the normal distribution (`Phi`). The field is white noise smoothed
//! by `exp(-2 d^2 / L^2)` on nodes `L / 4` apart, bilinear in between; it is divided by the standard deviation of the interpolation at each
//! place, so that the distribution of `tau` is the same everywhere. The correlation length of `tau` is that of the field to some percent for
//! `nu >= 1`.
//!
//! **Accuracy.** A table over `g` from -6 to 6 gives `ln tau` with an error below `2e-6 / nu` by linear interpolation. A texture that varies within a
//! resolution cell of the width `w` is averaged there: the excess moment `2 / nu` falls by about `(w / L)^2` of it. Choose `L` of five cells or more.

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::SceneError;
use crate::random::normal;
use subaperture_model::geometry::Extent;

/// Random stream of the field.
const TEXTURE: u64 = u64::from_be_bytes(*b"texture\0");

/// Nodes per correlation length.
const NODES: f64 = 4.0;

/// Half-width of the smoothing kernel in nodes: the weight beyond is below `exp(-12)` of the centre's.
const REACH: usize = 10;

/// Largest number of nodes: 0.5 GB.
const MAX_NODES: f64 = (1u64 << 26) as f64;

/// Range of the Gaussian field in the table, and steps per unit.
const WIDEST: f64 = 6.0;
const STEPS: f64 = 256.0;

/// Gamma-distributed texture of a stated order and correlation length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Order (shape) of the gamma distribution, 0.05 to 1000; the variance of the texture is its inverse.
    pub shape: f64,
    /// Correlation length of the Gaussian field, metres.
    pub length_m: f64,
}

/// Texture over an extent.
#[derive(Clone, Debug)]
pub(crate) struct TextureField {
    start_m: DVec2,
    step_m: f64,
    columns: usize,
    rows: usize,
    /// Gaussian field at the nodes, row by row, of variance 1.
    field: Vec<f64>,
    /// Correlation between neighbouring nodes along an axis.
    neighbour: f64,
    /// Logarithm of the texture by the Gaussian field.
    table: Vec<f64>,
}

impl Texture {
    /// Texture over an extent, within `most` nodes; the same seed and index give the same texture.
    pub(crate) fn over(
        &self,
        extent: &Extent,
        seed: u64,
        index: u32,
        most: f64,
    ) -> Result<TextureField, SceneError> {
        let known = (0.05..=1000.0).contains(&self.shape) && self.length_m > 0.0;
        if !(known && self.length_m.is_finite()) {
            return Err(SceneError(format!(
                "texture of the shape {} and the correlation length {} m: expected a shape of 0.05 to 1000 and a positive length",
                self.shape, self.length_m
            )));
        }
        let step_m = self.length_m / NODES;
        let count = |(low, high): (f64, f64)| ((high - low) / step_m).ceil() + 2.0;
        let (columns, rows) = (count(extent.x_m), count(extent.y_m));
        if columns * rows > most.min(MAX_NODES) {
            return Err(SceneError(format!(
                "texture of {columns} x {rows} nodes exceeds the {} that fit into memory: give a greater texture_length",
                most.min(MAX_NODES)
            )));
        }
        let (columns, rows) = (columns as usize, rows as usize);
        let weights = kernel();
        let neighbour = (1..weights.len())
            .map(|i| weights[i] * weights[i - 1])
            .sum();
        Ok(TextureField {
            start_m: DVec2::new(extent.x_m.0, extent.y_m.0),
            step_m,
            columns,
            rows,
            field: field(columns, rows, &weights, seed, index),
            neighbour,
            table: table(self.shape),
        })
    }
}

impl TextureField {
    /// Texture at a position; outside of the extent that of its edge.
    pub(crate) fn at(&self, place_m: DVec2) -> f64 {
        let at = (place_m - self.start_m) / self.step_m;
        let last = DVec2::new((self.columns - 1) as f64, (self.rows - 1) as f64);
        let at = at.max(DVec2::ZERO).min(last);
        let column = (at.x as usize).min(self.columns - 2);
        let row = (at.y as usize).min(self.rows - 2);
        let (u, v) = (at.x - column as f64, at.y - row as f64);
        let pair = |row: usize| {
            let first = row * self.columns + column;
            self.field[first] * (1.0 - u) + self.field[first + 1] * u
        };
        // Variance of a sum of two neighbours, along both axes.
        let variance =
            |u: f64| (1.0 - u) * (1.0 - u) + u * u + 2.0 * u * (1.0 - u) * self.neighbour;
        let deviation = (variance(u) * variance(v)).sqrt();
        let g = (pair(row) * (1.0 - v) + pair(row + 1) * v) / deviation;
        let place = (g.clamp(-WIDEST, WIDEST) + WIDEST) * STEPS;
        let i = (place as usize).min(self.table.len() - 2);
        let log = self.table[i] + (self.table[i + 1] - self.table[i]) * (place - i as f64);
        libm::exp(log)
    }
}

/// Smoothing weights along one axis, of unit energy.
fn kernel() -> Vec<f64> {
    let weight = |i: usize| {
        let d = (i as f64 - REACH as f64) / NODES;
        libm::exp(-2.0 * d * d)
    };
    let weights: Vec<f64> = (0..=2 * REACH).map(weight).collect();
    let energy: f64 = weights.iter().map(|w| w * w).sum();
    weights.iter().map(|w| w / energy.sqrt()).collect()
}

/// White noise smoothed along both axes.
fn field(columns: usize, rows: usize, weights: &[f64], seed: u64, index: u32) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(TEXTURE.wrapping_add(u64::from(index)));
    let wide = columns + 2 * REACH;
    // Rows of smoothed noise within the kernel's reach.
    let mut held: Vec<Vec<f64>> = Vec::new();
    let mut smoothed = Vec::with_capacity(columns * rows);
    for _ in 0..rows + 2 * REACH {
        let noise: Vec<f64> = (0..wide).map(|_| normal(&mut random)).collect();
        let row = noise
            .windows(weights.len())
            .map(|part| part.iter().zip(weights).map(|(a, w)| a * w).sum());
        held.push(row.collect());
        if held.len() == weights.len() {
            for column in 0..columns {
                let rows = held.iter().zip(weights);
                smoothed.push(rows.map(|(row, w)| row[column] * w).sum::<f64>());
            }
            held.remove(0);
        }
    }
    smoothed
}

/// Logarithms of the gamma variate of mean 1 for Gaussian variates from `-WIDEST` to `WIDEST`.
fn table(shape: f64) -> Vec<f64> {
    let count = (2.0 * WIDEST * STEPS) as usize + 1;
    let mut log = f64::NAN;
    (0..count)
        .map(|i| {
            let g = i as f64 / STEPS - WIDEST;
            log = log_quantile(shape, g, log);
            log - libm::log(shape)
        })
        .collect()
}

/// Logarithm of the gamma variate of unit scale whose probability is that of the Gaussian variate `g`, by bisection of
/// `ln x`, which starts next to `near` if that is known.
fn log_quantile(shape: f64, g: f64, near: f64) -> f64 {
    let lower = g < 0.0;
    // The smaller of both tails keeps its relative accuracy.
    let tail = 0.5 * libm::erfc(g.abs() * std::f64::consts::FRAC_1_SQRT_2);
    let beyond = |log: f64| {
        let [below, above] = incomplete_gamma(shape, libm::exp(log));
        match lower {
            true => below > tail,
            false => above < tail,
        }
    };
    let (mut low, mut high) = match near.is_nan() {
        false => (near, near + 4.0 / (STEPS * shape.min(1.0)) + 1.0),
        true => (-60.0 / shape.min(1.0), libm::log(shape + 60.0)),
    };
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match beyond(middle) {
            true => high = middle,
            false => low = middle,
        }
    }
    0.5 * (low + high)
}

/// Regularised incomplete gamma functions, lower and upper: series for `x < a + 1`, otherwise the continued fraction (Abramowitz and Stegun
/// 6.5.29, 6.5.31).
fn incomplete_gamma(a: f64, x: f64) -> [f64; 2] {
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        let below = front * sum;
        return [below, 1.0 - below];
    }
    // Lentz's method.
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..10_000 {
        let an = -(f64::from(i)) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        let change = c * d;
        h *= change;
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    let above = front * h;
    [1.0 - above, above]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(side_m: f64) -> Extent {
        Extent {
            x_m: (0.0, side_m),
            y_m: (0.0, side_m),
        }
    }

    #[test]
    fn quantiles_have_closed_forms_of_exponential_and_erlang_variates() {
        for g in [-5.0, -2.0, -0.3, 0.0, 0.7, 3.0, 5.0f64] {
            let above = 0.5 * libm::erfc(g / 2f64.sqrt());
            // Shape 1: exponential, x = -ln(above).
            let x = libm::exp(log_quantile(1.0, g, f64::NAN));
            assert!((x / -above.ln() - 1.0).abs() < 1e-9, "{g}: {x}");
            // Shape 3: above = exp(-x) (1 + x + x^2 / 2).
            let x = libm::exp(log_quantile(3.0, g, f64::NAN));
            let tail = (-x).exp() * (1.0 + x + x * x / 2.0);
            assert!((tail / above - 1.0).abs() < 1e-9, "{g}: {tail}, {above}");
            // Shape 1/2: half the square of a Gaussian variate, above = erfc(sqrt x).
            let x = libm::exp(log_quantile(0.5, g, f64::NAN));
            assert!((libm::erfc(x.sqrt()) / above - 1.0).abs() < 1e-9, "{g}");
        }
        let table = table(0.05);
        assert!(table.windows(2).all(|pair| pair[1] > pair[0]));
        assert!((table[0] + libm::log(0.05) - log_quantile(0.05, -6.0, f64::NAN)).abs() < 1e-9);
    }

    #[test]
    fn texture_has_gamma_moments_everywhere_and_stated_correlation() {
        for shape in [0.5, 2.0, 10.0] {
            let texture = Texture {
                shape,
                length_m: 4.0,
            };
            let (mut first, mut second, mut count) = (0.0, 0.0, 0.0);
            let mut apart = 0.0;
            // 12 fields of 400 x 400 m. An area of pi L^2 / 2 = 25 m^2 is one independent value: 76,000.
            for seed in 0..12 {
                let field = texture.over(&square(400.0), seed, 0, 1e9).unwrap();
                // Between nodes, which are 1 m apart, and not only on them.
                for i in 0..40_000 {
                    let at = DVec2::new(
                        0.37 + 1.99 * f64::from(i % 200),
                        0.81 + 1.97 * f64::from(i / 200),
                    );
                    let (a, b) = (field.at(at), field.at(at + DVec2::new(2.0, 2.0)));
                    first += a;
                    second += a * a;
                    apart += (a - 1.0) * (b - 1.0);
                    count += 1.0;
                }
            }
            // Standard errors of the mean, sqrt(1 / (76,000 nu)), and of the mean square, sqrt((m4 - m2^2) / 76,000) with
            // m4 = (nu+1)(nu+2)(nu+3)/nu^3; four of each are allowed.
            let m2 = 1.0 + 1.0 / shape;
            let m4 = (shape + 1.0) * (shape + 2.0) * (shape + 3.0) / shape.powi(3);
            let allowed = 4.0 * ((m4 - m2 * m2) / 76_000.0).sqrt();
            assert!(
                (first / count - 1.0).abs() < 4.0 / (76_000.0 * shape).sqrt(),
                "{shape}"
            );
            assert!(
                (second / count - m2).abs() < allowed,
                "{shape}: {} of {m2}",
                second / count
            );
            // At 2.83 m = 0.707 L the field has the correlation exp(-1/2) = 0.607; the gamma variate slightly less: by Mehler's series
            // between rho^2 and rho.
            let correlation = apart / count * shape;
            assert!(
                (0.607 * 0.607..0.63).contains(&correlation),
                "{shape}: {correlation}"
            );
        }
    }

    #[test]
    fn texture_depends_on_seed_and_index_and_invalid_textures_are_refused() {
        let texture = Texture {
            shape: 1.0,
            length_m: 3.0,
        };
        let at = DVec2::new(4.0, 5.0);
        let value = |seed, index| {
            texture
                .over(&square(20.0), seed, index, 1e9)
                .unwrap()
                .at(at)
        };
        assert_eq!(value(1, 0), value(1, 0));
        assert!(value(1, 0) != value(2, 0) && value(1, 0) != value(1, 1));
        let flat = Texture {
            shape: 0.0,
            ..texture
        };
        assert!(flat.over(&square(1.0), 0, 0, 1e9).is_err());
        let error = texture.over(&square(1e6), 0, 0, 1e9).unwrap_err();
        assert!(error.to_string().contains("texture_length"), "{error}");
    }
}
