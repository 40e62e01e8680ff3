//! Third-degree Taylor expansion of paths from a pulse's antennas to the pixels of a tile.
//!
//! With `D` from an antenna to the tile's centre, `R = |D|`, and a pixel at `u` from the centre, `s = D.u / R`, `w = |u|^2 - s^2`:
//!
//! ```text
//! |D + u| = R + s + w / (2 R) - s w / (2 R^2) + ...,   u = i (step along a row) + j (step from row to row)
//! ```
//!
//! This is the series of Gegenbauer polynomials of order -1/2: its term of degree `n` is `R x^n C_n`, `x = |u| / R`, with `|C_4| <=
//! 1/8` and `|C_n| <= 2 / (2 n - 1)`. The truncation error is at most `R (x^4 / 8 + (2/9) x^5 / (1 - x))`
//! ([`left_out_m`]); the RMS of its first term over a square with corners at `x` is 0.23 of
//! that.

use crate::lanes::GROUP;
use crate::paths::Antennas;

/// Pixel raster of a tile: regular on a parallelogram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// Midpoint of the first and last pixel, metres.
    pub centre_m: [f64; 3],
    /// Step along a row, metres.
    pub along_m: [f64; 3],
    /// Step from row to row, metres.
    pub across_m: [f64; 3],
    /// Number of rows.
    pub rows: usize,
    /// Pixels per row.
    pub columns: usize,
}

impl Raster {
    /// Largest distance of a pixel from the centre, metres.
    pub fn radius_m(&self) -> f64 {
        self.farthest_m(0)
    }

    /// Largest distance from the centre including the padding of the last groups, metres.
    pub fn reach_m(&self) -> f64 {
        self.farthest_m(BEYOND)
    }

    fn farthest_m(&self, beyond: usize) -> f64 {
        let [a, b] = self.corners_m(beyond).map(|u| dot(&u, &u).sqrt());
        a.max(b)
    }

    /// Two adjacent corners relative to the centre; the others are opposite.
    fn corners_m(&self, beyond: usize) -> [[f64; 3]; 2] {
        let reach = |count: usize| (count.saturating_sub(1) as f64) / 2.0 + beyond as f64;
        let (i, j) = (reach(self.columns), reach(self.rows));
        [1.0, -1.0]
            .map(|sign| std::array::from_fn(|d| self.along_m[d] * i + self.across_m[d] * j * sign))
    }

    /// Lower and upper bound of the paths to all pixels minus the datum, metres.
    ///
    /// Paths are convex: above the tangent at the centre and below the value at the farthest corner.
    pub fn paths_m(&self, antennas: &Antennas) -> [f64; 2] {
        let [mut least, mut largest] = [-antennas.datum_m; 2];
        let [a, b] = self.corners_m(0);
        let corners = [a, b, a.map(|x| -x), b.map(|x| -x)];
        for antenna_m in [&antennas.transmitter_m, &antennas.receiver_m] {
            let from: [f64; 3] = std::array::from_fn(|d| self.centre_m[d] - antenna_m[d]);
            let at_m = dot(&from, &from).sqrt();
            let slopes = corners.map(|u| {
                if at_m > 0.0 {
                    dot(&from, &u) / at_m
                } else {
                    0.0
                }
            });
            least += at_m + slopes.into_iter().fold(f64::INFINITY, f64::min);
            let lengths = corners.map(|u| {
                let to: [f64; 3] = std::array::from_fn(|d| from[d] + u[d]);
                dot(&to, &to).sqrt()
            });
            largest += lengths.into_iter().fold(0.0, f64::max);
        }
        [least, largest]
    }
}

/// Largest padding of a tile's last groups, pixels.
const BEYOND: usize = GROUP - 1;

/// Bound on the truncation error of one antenna's distance, metres, for a tile of radius `radius_m` at the distance `distance_m`;
/// infinite if the antenna is within the radius.
pub fn left_out_m(distance_m: f64, radius_m: f64) -> f64 {
    let x = radius_m / distance_m;
    match x < 1.0 {
        true => distance_m * (x.powi(4) / 8.0 + 2.0 / 9.0 * x.powi(5) / (1.0 - x)),
        false => f64::INFINITY,
    }
}

/// Coefficients of the expansion over columns `i` and rows `j` from the centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expansion {
    /// Distances of transmitter and receiver, metres.
    pub legs_m: [f64; 2],
    /// Constant term.
    pub at: f64,
    /// Coefficients of `i` and `j`.
    pub first: [f64; 2],
    /// Coefficients of `i i`, `i j` and `j j`.
    pub second: [f64; 3],
    /// Coefficients of `i i i`, `i i j`, `i j j` and `j j j`.
    pub third: [f64; 4],
}

/// Expansion along a column of groups: polynomials in `j`.
#[derive(Clone, Copy)]
pub(super) struct Column {
    /// Position of group centres relative to the tile's centre.
    pub(super) place: [f64; 4],
    /// Gradient along a group.
    pub(super) along: [f64; 3],
    /// Gradient across a group; for rows of 16, half the second derivative along it.
    pub(super) across: [f64; 3],
    /// Second-degree terms within a block; rows of 16 have them in `across`.
    pub(super) bend: [f64; 3],
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Expansion {
    /// Expansion of paths minus the datum, times `scale`.
    pub fn new(antennas: &Antennas, raster: &Raster, scale: f64) -> Self {
        let squares = [
            dot(&raster.along_m, &raster.along_m),
            2.0 * dot(&raster.along_m, &raster.across_m),
            dot(&raster.across_m, &raster.across_m),
        ];
        let transmitter = leg(&antennas.transmitter_m, raster, squares);
        let receiver = match antennas.transmitter_m == antennas.receiver_m {
            true => None,
            false => Some(leg(&antennas.receiver_m, raster, squares)),
        };
        let add = |a: f64, b: f64| (a + b) * scale;
        let (a, b) = (&transmitter, receiver.as_ref().unwrap_or(&transmitter));
        Self {
            legs_m: [a.at, b.at],
            at: (a.at + b.at - antennas.datum_m) * scale,
            first: std::array::from_fn(|i| add(a.first[i], b.first[i])),
            second: std::array::from_fn(|i| add(a.second[i], b.second[i])),
            third: std::array::from_fn(|i| add(a.third[i], b.third[i])),
        }
    }

    /// Exchange columns and rows.
    pub(super) fn transposed(&self) -> Self {
        let reversed = |mut values: [f64; 4]| {
            values.reverse();
            values
        };
        Self {
            legs_m: self.legs_m,
            at: self.at,
            first: [self.first[1], self.first[0]],
            second: [self.second[2], self.second[1], self.second[0]],
            third: reversed(self.third),
        }
    }

    /// Expansion for groups with centres at column `i`. For rows of 16, `line` is the fraction of the cubic term along the row that a
    /// straight line absorbs.
    #[inline(always)]
    pub(super) fn column(&self, i: f64, line: Option<f64>) -> Column {
        let ([c10, c01], [c20, c11, c02], [c30, c21, c12, c03]) =
            (self.first, self.second, self.third);
        let place = [
            i * (c10 + i * (c20 + i * c30)),
            c01 + i * (c11 + i * c21),
            c02 + i * c12,
            c03,
        ];
        Column {
            along: [
                c10 + i * (2.0 * c20 + 3.0 * i * c30) + line.unwrap_or(0.0) * c30,
                c11 + 2.0 * i * c21,
                c12,
            ],
            across: match line {
                Some(_) => [c20 + 3.0 * i * c30, c21, 0.0],
                None => [place[1], 2.0 * place[2], 3.0 * c03],
            },
            bend: match line {
                Some(_) => [0.0; 3],
                None => [c20 + 3.0 * c30 * i, c11 + 2.0 * c21 * i, c02 + c12 * i],
            },
            place,
        }
    }

    /// Bound on the gradients over `i` and `j` within `i` and `j` of the centre.
    pub(super) fn steepest(&self, i: f64, j: f64) -> [f64; 2] {
        let ([a, b, c], [d, e, f, g]) = (self.second, self.third);
        let along = 2.0 * a.abs() * i + b.abs() * j + 3.0 * d.abs() * i * i;
        let across = 2.0 * c.abs() * j + b.abs() * i + 3.0 * g.abs() * j * j;
        [
            self.first[0].abs() + along + 2.0 * e.abs() * i * j + f.abs() * j * j,
            self.first[1].abs() + across + 2.0 * f.abs() * i * j + e.abs() * i * i,
        ]
    }

    /// Bound on the magnitude within `i` and `j` pixels of the centre.
    pub(super) fn bound(&self, within: [f64; 2]) -> f64 {
        self.at.abs() + self.linear_bound(within) + self.bend_bound(within)
    }

    /// Bound on the RMS truncation error over a raster of this radius ([`Raster::radius_m`]), metres; NaN for positions that are not finite.
    ///
    /// It grows at least with the fourth power of the distance, so that its RMS over a
    /// rectangle is at most a third of that at the corners.
    pub fn truncation_m(&self, radius_m: f64) -> f64 {
        let [out_m, back_m] = self.legs_m.map(|leg_m| left_out_m(leg_m, radius_m) / 3.0);
        out_m + back_m
    }

    /// Bound on the magnitude of the linear terms within `i` and `j` pixels of the centre.
    pub fn linear_bound(&self, [i, j]: [f64; 2]) -> f64 {
        self.first[0].abs() * i + self.first[1].abs() * j
    }

    /// Bound on the magnitude of the terms of second and third degree within `i` and `j` pixels of the centre.
    pub fn bend_bound(&self, [i, j]: [f64; 2]) -> f64 {
        let ([c, d, e], [f, g, h, k]) = (self.second, self.third);
        let squares = c.abs() * i * i + d.abs() * i * j + e.abs() * j * j;
        let cubes = (f.abs() * i + g.abs() * j) * i * i + (h.abs() * i + k.abs() * j) * j * j;
        squares + cubes
    }
}

/// One antenna's distance, metres, and its Taylor coefficients.
struct Leg {
    at: f64,
    first: [f64; 2],
    second: [f64; 3],
    third: [f64; 4],
}

fn leg(antenna_m: &[f64; 3], raster: &Raster, squares: [f64; 3]) -> Leg {
    let from: [f64; 3] = std::array::from_fn(|d| raster.centre_m[d] - antenna_m[d]);
    let at = dot(&from, &from).sqrt();
    let inverse = 1.0 / at;
    let first = [&raster.along_m, &raster.across_m].map(|step_m| dot(&from, step_m) * inverse);
    let [g, h] = first;
    let w = [
        squares[0] - g * g,
        squares[1] - 2.0 * g * h,
        squares[2] - h * h,
    ];
    let half = 0.5 * inverse;
    let cubic = -half * inverse;
    Leg {
        at,
        first,
        second: w.map(|w| w * half),
        third: [
            g * w[0] * cubic,
            (g * w[1] + h * w[0]) * cubic,
            (g * w[2] + h * w[1]) * cubic,
            h * w[2] * cubic,
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::Numbers;

    #[test]
    fn expansion_truncation_error_is_bounded() {
        let mut numbers = Numbers::new(3);
        let mut nearest = 0.0f64;
        for _ in 0..3000 {
            let mut direction = || {
                let v: [f64; 3] = std::array::from_fn(|_| numbers.signed());
                let length = v.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-3);
                v.map(|x| x / length)
            };
            let (line, u) = (direction(), direction());
            let x = 0.02 + 0.7 * numbers.unit();
            let at = line.map(|x| x * 100.0);
            let antennas = Antennas {
                transmitter_m: at,
                receiver_m: at,
                datum_m: 0.0,
            };
            // End pixel of a row of two.
            let raster = Raster {
                centre_m: [0.0; 3],
                along_m: u.map(|u| 2.0 * u * x * 100.0),
                across_m: [0.0; 3],
                rows: 1,
                columns: 2,
            };
            let Expansion {
                at,
                first,
                second,
                third,
                ..
            } = Expansion::new(&antennas, &raster, 1.0);
            let i = 0.5;
            let got_m = at + i * (first[0] + i * (second[0] + i * third[0]));
            let pixel: [f64; 3] = std::array::from_fn(|d| raster.along_m[d] * i);
            let from = antennas.transmitter_m;
            let across = (pixel[0] - from[0]).hypot(pixel[1] - from[1]);
            let path_m = 2.0 * across.hypot(pixel[2] - from[2]);
            let error_m = (got_m - path_m).abs();
            let bound_m = 2.0 * left_out_m(100.0, raster.radius_m());
            assert!(error_m <= bound_m * 1.000_001, "{x}: {error_m} {bound_m}");
            nearest = nearest.max(error_m / bound_m);
        }
        assert!(nearest > 0.7, "{nearest}");
        assert_eq!(left_out_m(1.0, 1.0), f64::INFINITY);
    }
}
