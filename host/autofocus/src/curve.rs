//! Cubic B-spline curves over the turns of an aperture, from a few coefficients up to one per turn.

/// Curves over `turns` with `knots` coefficients.
#[derive(Clone, Debug)]
pub(crate) struct Curves {
    /// For each turn, the index of the first coefficient that contributes, and the weights.
    weights: Vec<(usize, Vec<f64>)>,
    /// Number of coefficients of a curve.
    pub(crate) count: usize,
}

impl Curves {
    /// Cubic B-splines with about `intervals` equal intervals over the aperture; one coefficient per turn if there would be more than half as many as turns.
    pub(crate) fn new(intervals: usize, turns: usize) -> Self {
        let count = intervals.max(1) + 3;
        if 2 * count > turns {
            return Self {
                weights: (0..turns).map(|n| (n, vec![1.0])).collect(),
                count: turns,
            };
        }
        let at = |n: usize| {
            let u = (n as f64 + 0.5) * (count - 3) as f64 / turns as f64;
            let first = (u.floor() as usize).min(count - 4);
            let t = u - first as f64;
            let s = 1.0 - t;
            let weights = [
                s * s * s,
                3.0 * t * t * t - 6.0 * t * t + 4.0,
                3.0 * s * s * s - 6.0 * s * s + 4.0,
                t * t * t,
            ];
            (first, weights.iter().map(|w| w / 6.0).collect())
        };
        Self {
            weights: (0..turns).map(at).collect(),
            count,
        }
    }

    /// A quadratic with one coefficient: `u^2 - 1/3` for `u` from -1 to 1 over the aperture.
    pub(crate) fn quadratic(turns: usize) -> Self {
        let at = |n: usize| {
            let u = 2.0 * (n as f64 + 0.5) / turns as f64 - 1.0;
            (0, vec![u * u - 1.0 / 3.0])
        };
        Self {
            weights: (0..turns).map(at).collect(),
            count: 1,
        }
    }

    /// Values of the curve at all turns.
    pub(crate) fn values(&self, numbers: &[f64]) -> Vec<f64> {
        let at = |(first, weights): &(usize, Vec<f64>)| -> f64 {
            weights
                .iter()
                .zip(&numbers[*first..])
                .map(|(w, x)| w * x)
                .sum()
        };
        self.weights.iter().map(at).collect()
    }

    /// Gradient with respect to the coefficients, from that with respect to the values.
    pub(crate) fn gradient(&self, by_values: &[f64]) -> Vec<f64> {
        let mut gradient = vec![0.0; self.count];
        for ((first, weights), value) in self.weights.iter().zip(by_values) {
            for (to, weight) in gradient[*first..].iter_mut().zip(weights) {
                *to += weight * value;
            }
        }
        gradient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_reproduce_lines_and_gradient_is_transpose() {
        let curves = Curves::new(7, 100);
        assert_eq!(curves.count, 10);
        // B-splines with the coefficients i have the value i at the knots: the curve is the line u + 1 at u intervals.
        let line: Vec<f64> = (0..10).map(f64::from).collect();
        for (n, value) in curves.values(&line).iter().enumerate() {
            assert!((value - 1.0 - (n as f64 + 0.5) * 0.07).abs() < 1e-12);
        }
        let any: Vec<f64> = (0..100).map(|n| (f64::from(n) * 0.7).sin()).collect();
        let forward: f64 = curves
            .values(&line)
            .iter()
            .zip(&any)
            .map(|(a, b)| a * b)
            .sum();
        let backward: f64 = curves
            .gradient(&any)
            .iter()
            .zip(&line)
            .map(|(a, b)| a * b)
            .sum();
        assert!((forward - backward).abs() < 1e-9);
        assert_eq!(Curves::new(60, 100).values(&any), any);
    }
}
