//! Expected values of items, and their comparison with the values that items print.

use subaperture_gallery::Check;

/// Expected check of an item, with one or several numbers.
pub(crate) struct Figure {
    /// Name of the check in the item.
    name: &'static str,
    /// Text of the thesis's value in the item; `None` if the item computes it, with the same numbers.
    quoted: Option<&'static str>,
    /// Text of the item's value, with `{}` for numbers.
    shape: &'static str,
    /// Expected numbers.
    numbers: Vec<Expected>,
    /// Derivation of the numbers and tolerances.
    from: &'static str,
    /// Whether the thesis prints the value: then the verdict must follow from the digits printed.
    printed: bool,
}

/// Expected number, before rounding for print.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Expected {
    /// A value and its tolerance.
    About(f64, f64),
    /// Interval.
    Within(f64, f64),
}

pub(crate) use Expected::{About, Within};

pub(crate) fn at_most(value: f64) -> Expected {
    Within(f64::NEG_INFINITY, value)
}

pub(crate) fn at_least(value: f64) -> Expected {
    Within(value, f64::INFINITY)
}

/// Row of a table.
pub(crate) fn figure(
    name: &'static str,
    quoted: &'static str,
    shape: &'static str,
    numbers: impl IntoIterator<Item = Expected>,
    from: &'static str,
) -> Figure {
    Figure {
        name,
        quoted: Some(quoted),
        shape,
        numbers: numbers.into_iter().collect(),
        from,
        printed: false,
    }
}

impl Figure {
    /// Mark as printed by the thesis: values within half a unit of its last digit agree, others differ.
    pub(crate) fn printed(self) -> Self {
        Self {
            printed: true,
            ..self
        }
    }

    /// Mark as computed by the item from a formula.
    pub(crate) fn computed(self) -> Self {
        Self {
            quoted: None,
            ..self
        }
    }

    /// Deviation of a text from the expected numbers; `None` if they agree.
    fn fault(&self, text: &str) -> Option<String> {
        let (shape, numbers) = read(text);
        if shape != self.shape || numbers.len() != self.numbers.len() {
            return Some(format!("'{text}' is not '{}'", self.shape));
        }
        let outside = |(expected, number): &(&Expected, &Number)| !expected.allows(number);
        let (expected, number) = self.numbers.iter().zip(&numbers).find(outside)?;
        let value = number.value;
        Some(format!("{value}, and not {expected:?} ({})", self.from))
    }
}

impl Expected {
    fn allows(self, number: &Number) -> bool {
        // Plus the rounding of the binary fraction.
        let rounding = number.rounding * (1.0 + 1e-9);
        let (low, high) = match self {
            About(value, tolerance) => (value - tolerance, value + tolerance),
            Within(low, high) => (low, high),
        };
        (low - rounding..=high + rounding).contains(&number.value)
    }
}

/// A number as printed.
#[derive(Debug, PartialEq)]
struct Number {
    value: f64,
    /// Half of its last printed digit.
    rounding: f64,
}

/// Extract the numbers of a text, and the text with placeholders.
fn read(text: &str) -> (String, Vec<Number>) {
    let mut numbers = Vec::new();
    let shape = text.split(' ').map(|word| {
        let bare = word.trim_end_matches(',');
        let Ok(value) = bare.parse() else {
            return word.to_owned();
        };
        let (mantissa, exponent) = bare.split_once('e').unwrap_or((bare, "0"));
        let decimals = mantissa.split_once('.').map_or(0, |(_, after)| after.len());
        let exponent: i32 = exponent.parse().unwrap_or(0);
        numbers.push(Number {
            value,
            rounding: 0.5 * 10f64.powi(exponent - decimals as i32),
        });
        format!("{{}}{}", &word[bare.len()..])
    });
    let shape = shape.collect::<Vec<_>>().join(" ");
    (shape, numbers)
}

/// Assert that `found` agrees with `expected`; reports all deviations.
#[track_caller]
pub(crate) fn compare(expected: &[Figure], found: &[Check]) {
    let names: Vec<&str> = expected.iter().map(|figure| figure.name).collect();
    let given: Vec<&str> = found.iter().map(|check| check.what.as_str()).collect();
    assert_eq!(
        given, names,
        "the item's figures are not those of the table"
    );
    let wrong: Vec<String> = expected
        .iter()
        .zip(found)
        .filter_map(|(figure, check)| fault(figure, check))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Deviation of a check; `None` if it agrees.
fn fault(figure: &Figure, check: &Check) -> Option<String> {
    let quoted = match figure.quoted {
        None => figure.fault(&check.thesis),
        Some(quoted) => (check.thesis != quoted).then(|| format!("not '{quoted}'")),
    };
    let quoted = quoted.map(|fault| format!("quoted as '{}': {fault}", check.thesis));
    let fault = quoted
        .or_else(|| figure.fault(&check.ours))
        .or_else(|| figure.printed.then(|| verdict_fault(check)).flatten())?;
    Some(format!("{}: {fault}", figure.name))
}

/// Error of the verdict on a printed number; `None` if it is right, or undecidable because of the rounding of our value.
fn verdict_fault(check: &Check) -> Option<String> {
    let one = |text: &str| read(text).1.into_iter().next();
    let (thesis, ours) = (one(&check.thesis)?, one(&check.ours)?);
    let off = (ours.value - thesis.value).abs();
    let agrees = match off {
        off if off > (thesis.rounding + ours.rounding) * (1.0 + 1e-9) => false,
        off if off < (thesis.rounding - ours.rounding) * (1.0 - 1e-9) => true,
        // Undecidable from the printed value.
        _ => return None,
    };
    (agrees != check.agrees).then(|| {
        format!(
            "said to {}, and is {} for {}",
            if check.agrees { "agree" } else { "differ" },
            check.ours,
            check.thesis
        )
    })
}

#[test]
fn verdict_follows_digits_printed_in_thesis() {
    let table = || figure("width", "6.3 m", "{} m", [Within(6.0, 7.0)], "a test").printed();
    let check = |ours: &str, agrees| Check::claim("width", "6.3 m", ours.to_owned(), agrees);
    for (ours, agrees) in [("6.172 m", false), ("6.349 m", true), ("6.351 m", false)] {
        assert_eq!(fault(&table(), &check(ours, agrees)), None, "{ours}");
        assert!(fault(&table(), &check(ours, !agrees)).is_some(), "{ours}");
    }
    // The library's verdict.
    for (ours, agrees) in [(6.172, false), (6.349, true), (6.25, true), (6.249, false)] {
        assert_eq!(
            Check::printed("width", "6.3", ours, 3, "m").agrees,
            agrees,
            "{ours}"
        );
    }
    assert!(Check::printed("width", "200", 200.4, 1, "MHz").agrees);
    assert!(!Check::printed("width", "5.12", 0.512, 3, "s").agrees);
}

#[test]
fn numbers_are_parsed_with_their_rounding() {
    let (shape, numbers) = read("-17.13 degrees for 0, 5.0e-10 1/m");
    assert_eq!(shape, "{} degrees for {}, {} 1/m");
    let read: Vec<f64> = numbers.iter().map(|number| number.value).collect();
    assert_eq!(read, [-17.13, 0.0, 5e-10]);
    for (number, rounding) in numbers.iter().zip([0.005, 0.5, 5e-12]) {
        assert!(
            (number.rounding / rounding - 1.0).abs() < 1e-12,
            "{number:?}"
        );
    }
}

#[test]
fn deviations_from_table_are_reported() {
    let check = |ours: &str| Check::claim("width", "0.5 m", ours.to_owned(), true);
    let table = || figure("width", "0.5 m", "{} m", [About(0.5, 0.1)], "a test");
    // 0.6 rounds to all of these, 0.61 does not.
    for good in ["0.5 m", "0.600 m", "0.4 m", "1 m"] {
        assert_eq!(fault(&table(), &check(good)), None, "{good}");
    }
    for bad in [
        "0.61 m",
        "0.39 m",
        "NaN m",
        "0.5 km",
        "0.5 m or 0.5 m",
        "none",
        "",
    ] {
        assert!(fault(&table(), &check(bad)).is_some(), "{bad}");
    }
    let quoting = |thesis: &str| Check::claim("width", thesis, "0.5 m".to_owned(), true);
    assert!(fault(&table(), &quoting("0.6 m")).is_some());
    assert_eq!(fault(&table().computed(), &quoting("0.6 m")), None);
    assert!(fault(&table().computed(), &quoting("0.7 m")).is_some());
    assert!(std::panic::catch_unwind(|| compare(&[table()], &[])).is_err());
}
