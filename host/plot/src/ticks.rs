//! Tick values at round numbers.

/// Multiples of 1, 2 or 5 times a power of ten within `low..=high`, at most `most`
/// (and at least one), with labels.
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
    // Below float64 resolution, or all labels would read 0.000000000000000.
    let peak = low.abs().max(high.abs());
    let exponential = peak >= 1e16 || power < -15.0;
    let mantissa = (peak.log10().floor() - power).clamp(0.0, 16.0) as usize;
    // Tolerance of a thousandth of a step at the ends, for rounding.
    let first = (low / step - 1e-3).ceil();
    let last = (high / step + 1e-3).floor();
    let count = (last - first + 1.0).clamp(0.0, most as f64 + 1.0) as usize;
    (0..count)
        .map(|i| {
            // Adding zero converts -0 to 0.
            let value = (first + i as f64) * step + 0.0;
            let text = match exponential {
                true => format!("{value:.mantissa$e}"),
                false => format!("{value:.digits$}"),
            };
            (value, text.replace('-', "\u{2212}"))
        })
        .collect()
}

/// As [`ticks`], reduced until centred labels do not overlap on an
/// axis of `length`, where `room` is the length of a label.
pub(super) fn ticks_apart(
    low: f64,
    high: f64,
    most: usize,
    length: f64,
    room: impl Fn(&str) -> f64,
) -> Vec<(f64, String)> {
    let mut fewest = Vec::new();
    for most in (1..=most).rev() {
        let found = ticks(low, high, most);
        let apart = found.windows(2).all(|pair| {
            let distance = (pair[1].0 - pair[0].0) / (high - low) * length;
            distance >= (room(&pair[0].1) + room(&pair[1].1)) / 2.0
        });
        // A coarse step may have no multiple in the range.
        if !found.is_empty() {
            fewest = found;
            if apart {
                return fewest;
            }
        }
    }
    fewest.truncate(1);
    fewest
}

#[cfg(test)]
mod tests {
    use super::{ticks, ticks_apart};

    fn labels(low: f64, high: f64, most: usize) -> Vec<String> {
        ticks(low, high, most).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round_numbers_in_range() {
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

    #[test]
    fn labels_of_extreme_values_are_short() {
        assert_eq!(labels(0.5e300, 2.5e300, 2), ["1e300", "2e300"]);
        assert_eq!(
            labels(0.0, 2e-20, 2),
            ["0e0", "1e\u{2212}20", "2e\u{2212}20"]
        );
    }

    /// Labels of ten pixels per character, with a gap of two characters.
    fn apart(low: f64, high: f64, most: usize, length: f64) -> Vec<String> {
        let room = |label: &str| (label.chars().count() * 10 + 20) as f64;
        ticks_apart(low, high, most, length, room)
            .into_iter()
            .map(|t| t.1)
            .collect()
    }

    #[test]
    fn tick_labels_do_not_overlap() {
        // Steps of 20 are 66 pixels apart; the widest label with its gap needs 50.
        assert_eq!(
            apart(-45.0, 45.0, 5, 300.0),
            ["−40", "−20", "0", "20", "40"]
        );
        // Ten characters and the gap need 120 pixels. With 960 pixels for 0.3, 0.02 has 64, 0.05 has 160.
        assert_eq!(
            apart(3_999_999.995, 4_000_000.295, 16, 960.0),
            [
                "4000000.00",
                "4000000.05",
                "4000000.10",
                "4000000.15",
                "4000000.20",
                "4000000.25"
            ]
        );
        // Touching labels are allowed: 1 and 2 need 30 each.
        assert_eq!(apart(1.0, 2.0, 1, 30.0), ["1", "2"]);
        // Overlapping labels are not; one remains.
        assert_eq!(apart(1.0, 2.0, 1, 29.0), ["1"]);
        // No multiple of 1 in the range, but one label.
        assert_eq!(apart(0.1, 0.7, 3, 60.0), ["0.5"]);
    }
}
