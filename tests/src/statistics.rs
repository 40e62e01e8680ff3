//! What benches make of times.

/// The slope of the line of least squares through the logarithms of `(size, time)`: the exponent of a power law. `None` of fewer than two sizes.
pub fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs = points.iter().map(|(size, time)| (size.ln(), time.ln()));
    let count = points.len() as f64;
    let (x_sum, y_sum) = logs
        .clone()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let (x_mean, y_mean) = (x_sum / count, y_sum / count);
    let (mut products, mut squares) = (0.0, 0.0);
    for (x, y) in logs {
        products += (x - x_mean) * (y - y_mean);
        squares += (x - x_mean).powi(2);
    }
    (squares > 0.0).then(|| products / squares)
}

/// The lower quartile, the median and the upper quartile, between values where none is at the place; `None` of nothing.
pub fn quartiles(values: &[f64]) -> Option<[f64; 3]> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some([0.25, 0.5, 0.75].map(|part| {
        let place = part * last as f64;
        let whole = place as usize;
        let next = values[(whole + 1).min(last)];
        values[whole] + (place - whole as f64) * (next - values[whole])
    }))
}

/// Whether `ratios` of new times to old ones tell of a slowdown by more than `limit`: three quarters of them exceed it.
pub fn is_slower(ratios: &[f64], limit: f64) -> bool {
    quartiles(ratios).is_some_and(|[lower, _, _]| lower > limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exponent_is_that_of_the_power_law() {
        let points = [1.0, 2.0, 4.0, 8.0].map(|x: f64| (x, 3.0 * x.powf(1.7)));
        assert!((exponent(&points).unwrap() - 1.7).abs() < 1e-12);
        // Logarithms 0, 0 and 1 over 0, 1 and 2: a slope of a half.
        let e = std::f64::consts::E;
        let bent = [(1.0, 1.0), (e, 1.0), (e * e, e)];
        assert!((exponent(&bent).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(exponent(&points[..1]), None);
        assert_eq!(exponent(&[]), None);
    }

    #[test]
    fn quartiles_lie_between_sorted_values() {
        assert_eq!(quartiles(&[5.0, 1.0, 3.0, 2.0, 4.0]), Some([2.0, 3.0, 4.0]));
        assert_eq!(quartiles(&[2.0, 1.0]), Some([1.25, 1.5, 1.75]));
        assert_eq!(quartiles(&[7.0]), Some([7.0; 3]));
        assert_eq!(quartiles(&[]), None);
    }

    #[test]
    fn what_spreads_about_the_limit_is_not_slower() {
        assert!(is_slower(&[1.2, 1.15, 1.3, 1.05, 1.2, 1.25, 1.18], 1.1));
        assert!(!is_slower(&[1.2, 1.0, 1.3, 1.05, 1.2, 0.9, 1.18], 1.1));
        assert!(!is_slower(&[1.0; 7], 1.1));
        assert!(!is_slower(&[], 1.1));
    }
}
