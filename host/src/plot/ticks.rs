//! Round numbers along an axis.

/// Values at multiples of 1, 2 or 5 times a power of ten within `low..=high`, at most `most` of them
/// (at least one is allowed), and their labels.
pub(super) fn ticks(low: f64, high: f64, most: usize) -> Vec<(f64, String)> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return Vec::new();
    }
    let least = span / most.max(1) as f64;
    let power = least.log10().floor();
    let unit = 10f64.powf(power);
    let (factor, power) = [(1.0, power), (2.0, power), (5.0, power)]
        .into_iter()
        .find(|(f, _)| f * unit >= least * (1.0 - 1e-9))
        .unwrap_or((1.0, power + 1.0));
    let step = factor * 10f64.powf(power);
    let digits = (-power).clamp(0.0, 15.0) as usize;
    // A thousandth of a step is forgiven at the ends, for float rounding.
    let first = (low / step - 1e-3).ceil();
    let last = (high / step + 1e-3).floor();
    let count = (last - first + 1.0).clamp(0.0, most as f64 + 1.0) as usize;
    (0..count)
        .map(|i| {
            // Adding zero turns -0 into 0.
            let value = (first + i as f64) * step + 0.0;
            (value, format!("{value:.digits$}").replace('-', "\u{2212}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::ticks;

    fn labels(low: f64, high: f64, most: usize) -> Vec<String> {
        ticks(low, high, most).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn round_numbers_within_the_range() {
        assert_eq!(labels(-50.1, 49.9, 6), ["−40", "−20", "0", "20", "40"]);
        assert_eq!(
            labels(0.0, 1.0, 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(
            labels(9990.0, 10_012.0, 5),
            ["9990", "9995", "10000", "10005", "10010"]
        );
        assert_eq!(labels(-120.0, -60.0, 4), ["−120", "−100", "−80", "−60"]);
        assert_eq!(labels(0.000_3, 0.000_9, 3), ["0.0004", "0.0006", "0.0008"]);
        assert!(labels(1.0, 1.0, 5).is_empty());
        assert!(labels(f64::NAN, 1.0, 5).is_empty());
    }
}
