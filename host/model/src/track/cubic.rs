//! Natural cubic spline.
//!
//! On the segment `t_n .. t_{n+1}` of length `h`, with `a = (t_{n+1} - t) / h`, `b = 1 - a`, values `y` and second
//! derivatives `m`,
//!
//! ```text
//! y(t) = a y_n + b y_{n+1} + ((a^3 - a) m_n + (b^3 - b) m_{n+1}) h^2 / 6
//! ```
//!
//! Continuity of the first derivative gives a tridiagonal system for `m`, with `m = 0` at both ends. Outside, the
//! curve is straight, which because of `m = 0` is twice continuously differentiable there too. (The second derivative
//! of a Catmull-Rom curve jumps at every point, which is a chirp rate that changes in steps.)
//!
//! Between points `h` apart the error is at most `5 / 384 h^4 max |y''''|` away from the ends. At an end with a true
//! `y''` it is at most `y'' h^2 / 8`, and decreases inwards by a factor of 3.7 per point. Cost: a binary search and
//! some 20 operations per value.

use super::piece;

/// Natural cubic spline through `N` values at each of ascending times.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cubic<const N: usize> {
    times: Vec<f64>,
    values: Vec<[f64; N]>,
    second: Vec<[f64; N]>,
}

impl<const N: usize> Cubic<N> {
    /// Spline through `values` at `times`: equal numbers, at least two, ascending.
    pub(super) fn new(times: Vec<f64>, values: Vec<[f64; N]>) -> Self {
        let count = times.len();
        let mut second = vec![[0.0; N]; count];
        // Row n: h_{n-1} m_{n-1} + 2 (h_{n-1} + h_n) m_n + h_n m_{n+1} = 6 (slope_n - slope_{n-1}). Forward
        // elimination keeps the upper band in `upper` and the right side in `second`.
        let mut upper = vec![0.0; count];
        for n in 1..count.saturating_sub(1) {
            let (before, after) = (times[n] - times[n - 1], times[n + 1] - times[n]);
            let pivot = 2.0 * (before + after) - before * upper[n - 1];
            upper[n] = after / pivot;
            let earlier = second[n - 1];
            second[n] = std::array::from_fn(|i| {
                let slopes = (values[n + 1][i] - values[n][i]) / after
                    - (values[n][i] - values[n - 1][i]) / before;
                (6.0 * slopes - before * earlier[i]) / pivot
            });
        }
        for n in (1..count.saturating_sub(1)).rev() {
            let later = second[n + 1];
            for (m, later) in second[n].iter_mut().zip(later) {
                *m -= upper[n] * later;
            }
        }
        Self {
            times,
            values,
            second,
        }
    }

    /// Times and values of the points.
    pub(super) fn points(&self) -> (&[f64], &[[f64; N]]) {
        (&self.times, &self.values)
    }

    /// First and last time.
    pub(super) fn span(&self) -> (f64, f64) {
        (self.times[0], self.times[self.times.len() - 1])
    }

    /// Value and first derivative at a time.
    pub(super) fn at(&self, time: f64) -> ([f64; N], [f64; N]) {
        let (first, last) = self.span();
        let inside = time.clamp(first, last);
        let n = piece(&self.times, inside);
        let h = self.times[n + 1] - self.times[n];
        let b = (inside - self.times[n]) / h;
        let a = 1.0 - b;
        let (mut value, mut slope) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            let (y0, y1) = (self.values[n][i], self.values[n + 1][i]);
            let (m0, m1) = (self.second[n][i], self.second[n + 1][i]);
            value[i] =
                a * y0 + b * y1 + ((a * a - 1.0) * a * m0 + (b * b - 1.0) * b * m1) * (h * h / 6.0);
            slope[i] =
                (y1 - y0) / h + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * (h / 6.0);
            value[i] += slope[i] * (time - inside);
        }
        (value, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uneven() -> Cubic<1> {
        let times = vec![0.0, 0.7, 1.1, 2.5, 3.0, 4.2];
        let values = vec![[1.0], [-2.0], [0.5], [4.0], [4.0], [-1.0]];
        Cubic::new(times, values)
    }

    #[test]
    fn spline_interpolates_and_is_twice_continuously_differentiable() {
        let spline = uneven();
        for (n, (&t, y)) in spline.times.iter().zip(&spline.values).enumerate() {
            let y_at = |t| spline.at(t).0[0];
            let slope_at = |t| spline.at(t).1[0];
            assert!((y_at(t) - y[0]).abs() < 1e-14);
            // Values and slopes on both sides differ by slope and curvature (below 40) times 2e-9.
            let e = 1e-9;
            assert!((y_at(t + e) - y_at(t - e)).abs() < 1e-7);
            assert!((slope_at(t + e) - slope_at(t - e)).abs() < 1e-7);
            // One-sided second derivatives from slopes over 1e-5: errors of the third derivative (below 400) times
            // 1e-5 / 2, and roundings of 1e-14 / 1e-5.
            let h = 1e-5;
            let right = (slope_at(t + h) - slope_at(t)) / h;
            let left = (slope_at(t) - slope_at(t - h)) / h;
            assert!((right - left).abs() < 5e-3, "point {n}: {left}, {right}");
            assert!((right - spline.second[n][0]).abs() < 5e-3);
        }
    }

    #[test]
    fn slopes_are_derivatives_of_values_inside_and_outside() {
        let spline = uneven();
        for i in -20..70 {
            let t = f64::from(i) * 0.1 + 0.03;
            let h = 1e-5;
            let difference = (spline.at(t + h).0[0] - spline.at(t - h).0[0]) / (2.0 * h);
            // Third derivative times h^2 / 6, and rounding 1e-15 / 1e-5.
            assert!((difference - spline.at(t).1[0]).abs() < 1e-7);
        }
    }

    #[test]
    fn straight_line_and_natural_cubic_are_reproduced() {
        let line = Cubic::new(vec![0.0, 1.0, 4.0], vec![[0.0], [2.0], [8.0]]);
        assert!((line.at(3.3).0[0] - 6.6).abs() < 1e-14);
        assert!((line.at(-3.0).0[0] + 6.0).abs() < 1e-14);
        // y'' = 6 min(t, 2 - t) is zero at both ends and continuous at the middle point: y = t^3 up to it,
        // and integrated twice beyond.
        let y = |t: f64| {
            if t <= 1.0 {
                t.powi(3)
            } else {
                6.0 * t * t - t.powi(3) - 6.0 * t + 2.0
            }
        };
        let kept = Cubic::new(
            vec![0.0, 1.0, 2.0],
            [0.0, 1.0, 2.0].map(|t| [y(t)]).to_vec(),
        );
        for i in 0..=20 {
            let t = f64::from(i) / 10.0;
            assert!((kept.at(t).0[0] - y(t)).abs() < 1e-14);
        }
        let two = Cubic::new(vec![0.0, 2.0], vec![[1.0], [5.0]]);
        assert_eq!(two.at(1.0), ([3.0], [2.0]));
    }
}
