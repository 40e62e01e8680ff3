//! Errors of a parameter of the phase of a weighted response.

/// Second central moments of a `parameter` of each sample with the `weights`, and with their squares about the same mean.
///
/// The phase of a response is the parameter times an unknown. At an SNR of 1 in the maximum of the response with these weights the variance of the unknown is `squared / (2 own^2)`: `own` is the curvature of the
/// response, and `squared` the power of the slope of noise.
pub(crate) fn moments(weights: &[f64], parameter: impl Fn(usize) -> f64) -> [f64; 2] {
    let mean = |of: &dyn Fn(usize) -> f64, power: i32| {
        let weight = |n: usize| weights[n].powi(power);
        let total: f64 = (0..weights.len()).map(weight).sum();
        let sum: f64 = (0..weights.len()).map(|n| weight(n) * of(n)).sum();
        sum / total
    };
    let middle = mean(&parameter, 1);
    [1, 2].map(|power| mean(&|n| (parameter(n) - middle).powi(2), power))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// Moments of `x` from -1/2 to 1/2 of the weights 1 and `1 + cos(2 pi x)`, by integrals in closed form.
    #[test]
    fn moments_of_windows_agree_with_integrals() {
        let count = 1000;
        let x = |n: usize| (n as f64 + 0.5) / count as f64 - 0.5;
        let uniform = moments(&vec![1.0; count], x);
        let hann: Vec<f64> = (0..count).map(|n| 1.0 + (2.0 * PI * x(n)).cos()).collect();
        let hann = moments(&hann, x);
        let square = PI * PI;
        let expected = [
            1.0 / 12.0 - 1.0 / (2.0 * square),
            (0.125 - 15.0 / (16.0 * square)) / 1.5,
        ];
        // The rule of midpoints has an error of some 1e-6.
        for (found, expected) in uniform
            .into_iter()
            .zip([1.0 / 12.0; 2])
            .chain(hann.into_iter().zip(expected))
        {
            assert!((found - expected).abs() < 2e-6, "{found} {expected}");
        }
    }
}
