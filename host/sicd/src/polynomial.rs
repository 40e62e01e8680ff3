//! Least-squares polynomials of time and of two coordinates.

use glam::DVec3;

use subaperture_signal::dense::Factor;

/// Position as polynomial of time in seconds; coefficients in ascending order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Path {
    pub(crate) coefficients: Vec<DVec3>,
    /// Largest deviation from the fitted positions, metres.
    pub(crate) off_m: f64,
}

/// Largest order: fits a tenth of an orbit, or several turns of an aircraft, to below a millimetre.
const MAX_ORDER: usize = 7;
/// Deviation at which the order is not increased further, metres.
const ENOUGH_M: f64 = 1e-4;

impl Path {
    /// Fit positions at ascending times with the lowest order that is accurate enough, or else the best order; `None` without positions.
    pub(crate) fn through(times_s: &[f64], places_m: &[DVec3]) -> Option<Self> {
        let most = MAX_ORDER.min(times_s.len().checked_sub(1)?);
        let mut best: Option<Self> = None;
        for order in 0..=most {
            let Some(path) = Self::of_order(order, times_s, places_m) else {
                continue;
            };
            if best.as_ref().is_none_or(|best| path.off_m < best.off_m) {
                best = Some(path);
            }
            if best.as_ref().is_some_and(|best| best.off_m < ENOUGH_M) {
                break;
            }
        }
        best
    }

    fn of_order(order: usize, times_s: &[f64], places_m: &[DVec3]) -> Option<Self> {
        let (from, to) = (*times_s.first()?, *times_s.last()?);
        // Time is centred and normalised for conditioning; positions are relative to the first, to keep digits.
        let (middle, half) = (
            0.5 * (from + to),
            (0.5 * (to - from)).max(f64::MIN_POSITIVE),
        );
        let about = places_m[0];
        let row = |t: f64| legendre((t - middle) / half, order + 1);
        let offsets = [0, 1, 2].map(|k| places_m.iter().map(move |p| p[k] - about[k]));
        let rows: Vec<Vec<f64>> = times_s.iter().map(|&t| row(t)).collect();
        let [x, y, z] = offsets.map(|values| least_squares(&rows, values));
        let (x, y, z) = (x?, y?, z?);
        // Legendre polynomials in powers of time.
        let basis = legendre_powers(order + 1, middle, half);
        let mut coefficients = vec![DVec3::ZERO; order + 1];
        for (j, polynomial) in basis.iter().enumerate() {
            for (k, &c) in polynomial.iter().enumerate() {
                coefficients[k] += DVec3::new(x[j], y[j], z[j]) * c;
            }
        }
        coefficients[0] += about;
        let mut path = Self {
            coefficients,
            off_m: 0.0,
        };
        let off = |(&t, place): (&f64, &DVec3)| path.at(t, 0).distance(*place);
        path.off_m = times_s.iter().zip(places_m).map(off).fold(0.0, f64::max);
        Some(path)
    }

    /// Position at a time, or its derivative of order `derivative`.
    pub(crate) fn at(&self, time_s: f64, derivative: usize) -> DVec3 {
        let factor = |k: usize| (0..derivative).map(|d| (k - d) as f64).product::<f64>();
        let powers = self.coefficients.iter().enumerate().skip(derivative).rev();
        powers.fold(DVec3::ZERO, |sum, (k, &c)| sum * time_s + c * factor(k))
    }
}

/// Bicubic polynomial: coefficients `[i][j]` of `x^i y^j`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surface {
    pub(crate) coefficients: [[f64; 4]; 4],
}

impl Surface {
    /// Fit values at points with coordinates within `half` of 0; `None` if the points do not determine the coefficients.
    pub(crate) fn through(points: &[([f64; 2], f64)], half: [f64; 2]) -> Option<Self> {
        let row = |&([x, y], _): &([f64; 2], f64)| {
            let (a, b) = (legendre(x / half[0], 4), legendre(y / half[1], 4));
            a.iter()
                .flat_map(|a| b.iter().map(move |b| a * b))
                .collect()
        };
        let rows: Vec<Vec<f64>> = points.iter().map(row).collect();
        let found = least_squares(&rows, points.iter().map(|point| point.1))?;
        let [a, b] = half.map(|half| legendre_powers(4, 0.0, half));
        let mut coefficients = [[0.0; 4]; 4];
        for (n, c) in found.into_iter().enumerate() {
            for (i, p) in a[n / 4].iter().enumerate() {
                for (j, q) in b[n % 4].iter().enumerate() {
                    coefficients[i][j] += c * p * q;
                }
            }
        }
        Some(Self { coefficients })
    }

    pub(crate) fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let of = |c: &[f64; 4], x: f64| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        of(&self.coefficients.map(|row| of(&row, y)), x)
    }
}

/// Legendre polynomials of orders below `count` at `x`.
fn legendre(x: f64, count: usize) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for n in 1..count.saturating_sub(1) {
        let next = ((2 * n + 1) as f64 * x * values[n] - n as f64 * values[n - 1]) / (n + 1) as f64;
        values.push(next);
    }
    values.truncate(count);
    values
}

/// Legendre polynomials of `(t - middle) / half` as coefficients of powers of `t`.
fn legendre_powers(count: usize, middle: f64, half: f64) -> Vec<Vec<f64>> {
    let times_x = |p: &[f64]| {
        let mut product = vec![0.0; p.len() + 1];
        for (k, c) in p.iter().enumerate() {
            product[k] -= c * middle / half;
            product[k + 1] += c / half;
        }
        product
    };
    let mut all = vec![vec![1.0], times_x(&[1.0])];
    for n in 1..count.saturating_sub(1) {
        let mut next = times_x(&all[n]);
        for c in &mut next {
            *c *= (2 * n + 1) as f64 / (n + 1) as f64;
        }
        for (c, before) in next.iter_mut().zip(&all[n - 1]) {
            *c -= before * n as f64 / (n + 1) as f64;
        }
        all.push(next);
    }
    all.truncate(count);
    all
}

/// Least-squares solution of `rows * coefficients = values`, by normal equations.
fn least_squares(rows: &[Vec<f64>], values: impl Iterator<Item = f64>) -> Option<Vec<f64>> {
    let count = rows.first()?.len();
    let mut matrix = vec![0.0; count * count];
    let mut right = vec![0.0; count];
    for (row, value) in rows.iter().zip(values) {
        for i in 0..count {
            right[i] += row[i] * value;
            for j in 0..count {
                matrix[i * count + j] += row[i] * row[j];
            }
        }
    }
    Factor::new(count, &matrix, 1e-13)?.solve(&mut right);
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cubic is fitted exactly. 10 s of an orbit, an arc of 0.01 rad, need order 3: the next term is 7000 km 0.005^4 / 24, and lower orders absorb half of it.
    #[test]
    fn position_polynomial_fits_cubic_and_orbit() {
        let times: Vec<f64> = (0..50).map(|n| 100.0 + 0.2 * f64::from(n)).collect();
        let cubic = |t: f64| DVec3::new(6e6 + 3.0 * t, -2.0 * t + 0.1 * t * t, 1e-3 * t * t * t);
        let places: Vec<DVec3> = times.iter().map(|&t| cubic(t)).collect();
        let path = Path::through(&times, &places).unwrap();
        assert!(
            path.off_m < ENOUGH_M && path.coefficients.len() == 4,
            "{path:?}"
        );
        let speed = DVec3::new(3.0, -2.0 + 0.2 * 103.0, 3e-3 * 103.0 * 103.0);
        assert!(path.at(103.0, 1).distance(speed) < 1e-4, "{path:?}");
        assert!(
            path.at(103.0, 2)
                .distance(DVec3::new(0.0, 0.2, 6e-3 * 103.0))
                < 1e-4
        );
        let orbit = |t: f64| 7e6 * DVec3::new((1e-3 * t).cos(), (1e-3 * t).sin(), 0.0);
        let times: Vec<f64> = (0..129).map(|n| 10.0 * f64::from(n) / 128.0).collect();
        let places: Vec<DVec3> = times.iter().map(|&t| orbit(t)).collect();
        let path = Path::through(&times, &places).unwrap();
        assert!(
            path.off_m < 2e-4 && path.coefficients.len() <= 5,
            "{path:?}"
        );
        assert_eq!(Path::through(&[], &[]), None);
        assert_eq!(
            Path::through(&[3.0], &[DVec3::X]).unwrap().at(9.0, 0),
            DVec3::X
        );
    }

    #[test]
    fn bicubic_surface_recovers_polynomial_values() {
        let truth = |x: f64, y: f64| 0.3 + 0.01 * x - 2e-4 * x * y + 1e-7 * x * x * y * y * y;
        let points: Vec<([f64; 2], f64)> = (0..49)
            .map(|n| {
                let (x, y) = (
                    f64::from(n / 7) * 10.0 - 30.0,
                    f64::from(n % 7) * 4.0 - 12.0,
                );
                ([x, y], truth(x, y))
            })
            .collect();
        let surface = Surface::through(&points, [30.0, 12.0]).unwrap();
        for (at, value) in points {
            assert!((surface.at(at) - value).abs() < 1e-12, "{surface:?}");
        }
        assert!((surface.coefficients[1][1] + 2e-4).abs() < 1e-12);
    }
}
