//! Statistics of times for benchmarks.

/// Exponent of a power law: slope of the least-squares line through the logarithms of `(size, time)`. `None` for fewer than two sizes.
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

/// Lower quartile, median and upper quartile, interpolated linearly; `None` without values.
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

/// Whether `ratios` of new times to old ones indicate a slowdown by more than `limit`: three quarters of them exceed it.
pub fn is_slower(ratios: &[f64], limit: f64) -> bool {
    quartiles(ratios).is_some_and(|[lower, _, _]| lower > limit)
}

/// Index of the shortest time among `(error, time)` whose error is at most `error`; `None` if all errors are larger.
pub fn fastest_within(error: f64, measured: &[(f64, f64)]) -> Option<usize> {
    let within = measured.iter().enumerate().filter(|(_, m)| m.0 <= error);
    let fastest = within.min_by(|(_, a), (_, b)| a.1.total_cmp(&b.1));
    fastest.map(|(index, _)| index)
}
