//! Factors of the pixels of a block with matched weights, interpolated from few exact ones.
//!
//! The factor `sum_n w_n W_n(c) / D(p)` ([`BlockIllumination::gain`]) is a smooth function of the pixel, each value a sum over all pulses of the block. Over a
//! rectangle the divisor `D(p)` is interpolated by cubic polynomials through 4 x 4 pixels and compared with the exact one at 9 pixels between them. A rectangle in which one of
//! them is off by more than the tolerance is divided along its longer side, down to rectangles of some pixels, which are computed exactly. A pixel between the
//! compared ones may be off by more: cubic interpolation of a smooth function has its largest errors near the compared pixels.
//!
//! **Cost.** 25 sums over the pulses for each rectangle; a block of a smooth pattern is one.

use num_complex::Complex32;
use rayon::prelude::*;

use subaperture_model::phase_history::BlockIllumination;

/// Largest relative error of an interpolated factor, -72 dB, for any bound.
const MAX_TOLERANCE: f64 = 2.5e-4;

/// Largest relative error of an interpolated factor relative to the error bound.
const OF_BOUND: f64 = 0.05;

/// Nodes along an axis.
const NODES: usize = 4;

/// Number of pixels of a rectangle that is computed exactly.
const FEW: usize = 32;

/// Exact factors of a rectangle, for the timing model.
pub(super) const SUMS_A_BLOCK: f64 = 25.0;

/// Tolerance of factors of an image with a bound, dB; 0 without one: all factors are exact.
pub(super) fn tolerance(bound_db: Option<f64>) -> f64 {
    bound_db.map_or(0.0, |db| {
        (OF_BOUND * libm::pow(10.0, db / 20.0)).min(MAX_TOLERANCE)
    })
}

/// Factors of the pixels of one block.
struct Factors<'a> {
    illumination: &'a BlockIllumination,
    slow: &'a [f64],
    /// First row and column of the block, and its number of columns.
    first: [usize; 2],
    columns: usize,
    tolerance: f64,
}

/// Multiply the pixels of a block, formed with its weights `slow`, by their factors.
pub(super) fn normalise(
    illumination: &BlockIllumination,
    block: usize,
    slow: &[f64],
    tolerance: f64,
    pixels: &mut [Complex32],
) {
    let [rows, columns] = illumination.place(block);
    let factors = Factors {
        illumination,
        slow,
        first: [rows.start, columns.start],
        columns: columns.len(),
        tolerance,
    };
    factors.apply([0, 0], [rows.len(), columns.len()], pixels);
}

impl Factors<'_> {
    /// Exact factor of a pixel of the block.
    fn exact(&self, row: usize, column: usize) -> f64 {
        let [first_row, first_column] = self.first;
        self.illumination
            .gain(self.slow, first_row + row, first_column + column)
    }

    fn apply(&self, from: [usize; 2], counts: [usize; 2], pixels: &mut [Complex32]) {
        let [rows, columns] = counts;
        if self.tolerance == 0.0 || rows * columns <= FEW {
            let exact: Vec<f64> = (0..rows * columns)
                .into_par_iter()
                .map(|i| self.exact(from[0] + i / columns, from[1] + i % columns))
                .collect();
            for (i, factor) in exact.into_iter().enumerate() {
                self.scale(from, [i / columns, i % columns], factor, pixels);
            }
            return;
        }
        match self.interpolation(from, counts) {
            Some(interpolation) => {
                for row in 0..rows {
                    let line = interpolation.line(row);
                    for column in 0..columns {
                        let factor = interpolation.factor(&line, column);
                        self.scale(from, [row, column], factor, pixels);
                    }
                }
            }
            None => {
                let axis = usize::from(columns > rows);
                let half = counts[axis].div_ceil(2);
                let (mut near, mut far, mut beyond) = (counts, counts, from);
                (near[axis], far[axis], beyond[axis]) =
                    (half, counts[axis] - half, from[axis] + half);
                self.apply(from, near, pixels);
                self.apply(beyond, far, pixels);
            }
        }
    }

    fn scale(&self, from: [usize; 2], at: [usize; 2], factor: f64, pixels: &mut [Complex32]) {
        let pixel = &mut pixels[(from[0] + at[0]) * self.columns + from[1] + at[1]];
        *pixel *= factor as f32;
    }

    /// Interpolation over a rectangle; `None` if it exceeds the tolerance.
    fn interpolation(&self, from: [usize; 2], counts: [usize; 2]) -> Option<Interpolation> {
        let nodes = counts.map(nodes);
        let between = counts.map(middles);
        let at = |axes: &[Vec<usize>; 2]| -> Vec<[usize; 2]> {
            let rows = axes[0].iter();
            rows.flat_map(|&row| axes[1].iter().map(move |&column| [row, column]))
                .collect()
        };
        let mut places = at(&nodes);
        let num_nodes = places.len();
        places.extend(at(&between));
        let exact: Vec<f64> = places
            .par_iter()
            .map(|[row, column]| self.exact(from[0] + row, from[1] + column))
            .collect();
        // A pixel that is not formed has no finite divisor.
        if exact.contains(&0.0) {
            return None;
        }
        let interpolation = Interpolation {
            divisors: exact[..num_nodes]
                .iter()
                .map(|factor| 1.0 / factor)
                .collect(),
            nodes,
        };
        let close = places
            .iter()
            .zip(&exact)
            .skip(num_nodes)
            .all(|([row, column], exact)| {
                let factor = interpolation.factor(&interpolation.line(*row), *column);
                (factor / exact - 1.0).abs() <= self.tolerance
            });
        close.then_some(interpolation)
    }
}

/// Nodes along an axis of pixels, denser towards its ends: all of a short one.
fn nodes(count: usize) -> Vec<usize> {
    match count <= NODES {
        true => (0..count).collect(),
        false => {
            let quarter = (count - 1) as f64 / 4.0;
            let inner = [quarter, 3.0 * quarter].map(|x| x.round() as usize);
            vec![0, inner[0], inner[1], count - 1]
        }
    }
}

/// Pixels in the middle between the nodes.
fn middles(count: usize) -> Vec<usize> {
    let nodes = nodes(count);
    match nodes.len() {
        1 => nodes,
        _ => nodes
            .windows(2)
            .map(|pair| usize::midpoint(pair[0], pair[1]))
            .collect(),
    }
}

/// Polynomial of the divisors through the nodes.
struct Interpolation {
    nodes: [Vec<usize>; 2],
    /// Divisors at the nodes relative to the block's sum of weights, rows outermost.
    divisors: Vec<f64>,
}

impl Interpolation {
    /// Values of a row at the nodes along the columns.
    fn line(&self, row: usize) -> Vec<f64> {
        let shares = shares(&self.nodes[0], row);
        let columns = self.nodes[1].len();
        let value = |column: usize| {
            let of_row = |(i, share): (usize, &f64)| share * self.divisors[i * columns + column];
            shares.iter().enumerate().map(of_row).sum()
        };
        (0..columns).map(value).collect()
    }

    fn factor(&self, line: &[f64], column: usize) -> f64 {
        let shares = shares(&self.nodes[1], column);
        let divisor: f64 = shares.iter().zip(line).map(|(share, d)| share * d).sum();
        1.0 / divisor
    }
}

/// Lagrange polynomials of the nodes at a place.
fn shares(nodes: &[usize], at: usize) -> [f64; NODES] {
    let mut shares = [0.0; NODES];
    for (i, share) in shares.iter_mut().enumerate().take(nodes.len()) {
        *share = 1.0;
        for (j, &other) in nodes.iter().enumerate() {
            if i != j {
                *share *= (at as f64 - other as f64) / (nodes[i] as f64 - other as f64);
            }
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_reproduces_cubics_in_both_axes() {
        let nodes = [nodes(57), nodes(3)];
        let value = |row: usize, column: usize| {
            let (x, y) = (row as f64 / 56.0, column as f64 / 2.0);
            1.0 + x * x * x - 0.3 * x * y * y + 0.2 * y
        };
        let rows = nodes[0].iter();
        let divisors = rows.flat_map(|&row| nodes[1].iter().map(move |&column| value(row, column)));
        let interpolation = Interpolation {
            divisors: divisors.collect(),
            nodes: nodes.clone(),
        };
        for row in 0..57 {
            for column in 0..3 {
                let factor = interpolation.factor(&interpolation.line(row), column);
                // Sums of 16 products near 1.
                assert!((factor * value(row, column) - 1.0).abs() < 1e-13);
            }
        }
        assert_eq!(middles(1), [0]);
        assert_eq!(middles(57), [7, 28, 49]);
    }

    #[test]
    fn tolerance_follows_the_bound() {
        assert_eq!(tolerance(None), 0.0);
        assert_eq!(tolerance(Some(-30.0)), MAX_TOLERANCE);
        assert!((tolerance(Some(-80.0)) - 5e-6).abs() < 1e-18);
    }
}
