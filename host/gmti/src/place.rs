//! Place of a target in the image: mean over pixels, its error by noise, and that by the distance of pixels.
//!
//! The place is the mean of the pixels' places `x_p`, weighted by the excess of their powers `P_p` over a tenth of the largest, `P_m`. Weights that fall to 0 at the edge of the target avoid a step, which would draw the mean to the pixels:
//!
//! ```text
//! x = sum_p w_p x_p / W,   w_p = max(P_p - c P_m, 0),   W = sum_p w_p,   c = 1/10.
//! ```
//!
//! A change of the powers moves it by
//!
//! ```text
//! dx = sum_p a_p dP_p,   a_p = ([w_p > 0] (x_p - x) - c [p = m] sum_q [w_q > 0] (x_q - x)) / W,
//! ```
//!
//! and its covariance by noise is that of these sums ([`crate::noise`]).
//!
//! A mean over pixels differs from that over the continuous response, since the weights are not band-limited. The RMS error over all places of a point target between pixels is computed from the response of the windows: 0.002 range cells with the default window and two pixels per
//! cell, 0.02 with one. That of a defocused target is smaller.

use std::f64::consts::TAU;

use crate::noise::NoiseSpectrum;

/// Least power of a used pixel, relative to the largest: 10 dB.
pub(crate) const USED: f64 = 0.1;

/// Places of a point target between pixels, along either axis, for the error by the distance of pixels.
const SHIFTS: usize = 8;

/// Samples of a window for the response of a point target.
const SAMPLES: usize = 32;

/// Mean place of a target, pixels.
pub(crate) struct Place {
    /// Row and column, fractional pixels.
    pub(crate) mean: [f64; 2],
    /// Change of the mean by a change of each power.
    pub(crate) factors: Vec<[f64; 2]>,
}

impl Place {
    /// Mean over pixels of these places and powers; at least one power is positive.
    pub(crate) fn of(places: &[[f64; 2]], powers: &[f64]) -> Self {
        let order = |&a: &usize, &b: &usize| powers[a].total_cmp(&powers[b]);
        let strongest = (0..powers.len()).max_by(order).unwrap_or_default();
        let least = USED * powers[strongest];
        let weights = powers.iter().map(|&power| (power - least).max(0.0));
        let weights: Vec<f64> = weights.collect();
        let total: f64 = weights.iter().sum();
        let mean = [0, 1].map(|axis| {
            let terms = places.iter().zip(&weights);
            terms
                .map(|(place, weight)| weight * place[axis])
                .sum::<f64>()
                / total
        });
        let offsets = places.iter().zip(&weights).map(|(place, &weight)| {
            let is_used = weight > 0.0;
            [0, 1].map(|axis| {
                if is_used {
                    place[axis] - mean[axis]
                } else {
                    0.0
                }
            })
        });
        let mut factors: Vec<[f64; 2]> = offsets.collect();
        let sum = [0, 1].map(|axis| factors.iter().map(|offset| offset[axis]).sum::<f64>());
        for axis in [0, 1] {
            factors[strongest][axis] -= USED * sum[axis];
            for factor in &mut factors {
                factor[axis] /= total;
            }
        }
        Self { mean, factors }
    }
}

impl NoiseSpectrum<'_> {
    /// RMS error of the mean place of a point target by the distance of pixels, rows and columns, with pixels up to `reach` rows and columns from it. Response in the middle of the grid.
    pub(crate) fn sampling_deviation(&self, reach: [usize; 2]) -> [f64; 2] {
        let middle = [self.grid.rows.count / 2, self.grid.columns.count / 2];
        let cells = |row: usize, column: usize| {
            let (path_m, rate) = self.track.path_and_rate(self.grid.position_m(row, column));
            [path_m / self.cells[0], rate / self.cells[1]]
        };
        let [row, column] = middle;
        let here = cells(row, column);
        // Resolution cells of path and path rate from pixel to pixel, along rows and columns of the grid.
        let steps = [cells(row + 1, column), cells(row, column + 1)]
            .map(|next| [next[0] - here[0], next[1] - here[1]]);
        let windows = self.windows.map(|window| window.weights(SAMPLES));
        // Sum over the upper half of a symmetric window, by the recurrence of cosines of odd multiples.
        let response = |axis: usize, cells: f64| {
            let first = libm::cos(0.5 * TAU * cells / SAMPLES as f64);
            let double = 2.0 * (2.0 * first * first - 1.0);
            let [mut before, mut own, mut sum] = [first, first, 0.0];
            for weight in &windows[axis][SAMPLES / 2..] {
                sum += weight * own;
                (before, own) = (own, double * own - before);
            }
            sum
        };
        let shift = |i: usize| (i as f64 + 0.5) / SHIFTS as f64 - 0.5;
        let [rows, columns] = reach.map(|reach| -(reach as i32)..reach as i32 + 1);
        let places: Vec<[f64; 2]> = rows
            .flat_map(|row| {
                columns
                    .clone()
                    .map(move |column| [row, column].map(f64::from))
            })
            .collect();
        let mut squares = [0.0; 2];
        for i in 0..SHIFTS * SHIFTS {
            let true_place = [shift(i / SHIFTS), shift(i % SHIFTS)];
            let power = |place: &[f64; 2]| {
                let [down, across] = [0, 1].map(|axis| place[axis] - true_place[axis]);
                let amplitude = [0, 1]
                    .map(|axis| response(axis, down * steps[0][axis] + across * steps[1][axis]));
                (amplitude[0] * amplitude[1]).powi(2)
            };
            let powers: Vec<f64> = places.iter().map(power).collect();
            let mean = Place::of(&places, &powers).mean;
            for axis in [0, 1] {
                squares[axis] += (mean[axis] - true_place[axis]).powi(2);
            }
        }
        squares.map(|square| (square / (SHIFTS * SHIFTS) as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use subaperture_focus::sub_cpi::SubCpi;
    use subaperture_model::SPEED_OF_LIGHT_M_S;
    use subaperture_model::geometry::ImageGrid;
    use subaperture_signal::window::Window;

    use super::*;

    /// Derivatives of the mean by differences, at powers without symmetry.
    #[test]
    fn factors_are_derivatives_of_the_mean() {
        let places: Vec<[f64; 2]> = (0..20)
            .map(|p| [f64::from(p / 5), f64::from(p % 5)])
            .collect();
        let powers: Vec<f64> = (0..20)
            .map(|p| (f64::from(p * p) * 0.37).sin().powi(2))
            .collect();
        let place = Place::of(&places, &powers);
        for p in 0..20 {
            let step = 1e-6;
            let mean = |sign: f64| {
                let mut moved = powers.clone();
                moved[p] += sign * step;
                Place::of(&places, &moved).mean
            };
            let (ahead, behind) = (mean(1.0), mean(-1.0));
            for axis in [0, 1] {
                let expected = (ahead[axis] - behind[axis]) / (2.0 * step);
                let found = place.factors[p][axis];
                assert!((found - expected).abs() < 1e-7, "{p}: {found} {expected}");
            }
        }
    }

    /// Taylor window of -35 dB, pixels of 0.49 and 0.51 cells, 0.25 cells, and 0.98 and 1 cells: by 6000 random places in a program without common code.
    #[test]
    fn error_by_the_distance_of_pixels_agrees_with_random_places() {
        let half = ((1000.0f64 * 1000.0 - 1.0) / 12.0).sqrt();
        let nodes = [-half, half].map(|offset| [DVec3::new(0.125 * offset, -5000.0, 0.0); 2]);
        let track = SubCpi::from_nodes(1000, nodes);
        for ([y, x], expected) in [
            ([0.49, 0.51], [0.00217, 0.00424]),
            ([0.25, 0.25], [0.00036, 0.00036]),
            ([0.98, 1.0], [0.01984, 0.02843]),
        ] {
            // Cells of 1 m in range and, at 5 km and 10 GHz over 125 m, 0.59958 m along the track.
            let grid = format!("x=-12:12:{},y=-20:20:{y},z=0", x * 0.599_584_916);
            let grid: ImageGrid = grid.parse().unwrap();
            let noise = NoiseSpectrum {
                windows: [Window::default(); 2],
                track: &track,
                grid: &grid,
                cells: [2.0, SPEED_OF_LIGHT_M_S / 10e9 / 1000.0],
                centre_hz: 10e9,
            };
            let found = noise.sampling_deviation([(3.0 / y) as usize, (3.0 / x) as usize]);
            let found = [found[0] * y, found[1] * x];
            println!("pixels of {y} and {x} cells: {found:.5?} cells, expected {expected:.5?}");
            // 6000 random places determine a deviation to 1 %, here three of them, and the figures have five digits.
            for (found, expected) in found.into_iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 0.03 * expected + 5e-6,
                    "{found} {expected}"
                );
            }
        }
    }
}
