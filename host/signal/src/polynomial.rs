//! Interpolating polynomials.

/// Coefficients, lowest first, of the polynomial with the given values at distinct places: Newton's form, expanded.
pub fn through<const N: usize>(places: [f64; N], mut values: [f64; N]) -> [f64; N] {
    for order in 1..N {
        for k in (order..N).rev() {
            values[k] = (values[k] - values[k - 1]) / (places[k] - places[k - order]);
        }
    }
    let mut coefficients = [0.0; N];
    for k in (0..N).rev() {
        // Previous polynomial times (x - places[k]), plus this value.
        for i in (0..N).rev() {
            let lower = if i > 0 { coefficients[i - 1] } else { 0.0 };
            coefficients[i] = lower - places[k] * coefficients[i];
        }
        coefficients[0] += values[k];
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomial_has_its_values() {
        let places = [0.3, -1.0, 0.9, 0.0];
        let cubic = |x: f64| 2.0 - x + 0.5 * x * x - 3.0 * x * x * x;
        let got = through(places, places.map(cubic));
        for (got, expected) in got.into_iter().zip([2.0, -1.0, 0.5, -3.0]) {
            assert!((got - expected).abs() < 1e-13);
        }
    }
}
