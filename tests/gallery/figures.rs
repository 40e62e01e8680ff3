//! A figure that an item has to find, and how it is read from what the item says.

use subaperture_gallery::Check;

/// One figure of an item, or several that it gives in a sentence.
pub(crate) struct Figure {
    /// What the item calls it.
    name: &'static str,
    /// The thesis's figure, as the item has to quote it; `None` if it has to compute it, to the same numbers.
    quoted: Option<&'static str>,
    /// What the item says, `{}` in place of numbers: their units and order.
    shape: &'static str,
    /// The numbers.
    numbers: Vec<Expected>,
    /// Where they come from, and their tolerance.
    from: &'static str,
}

/// A number, apart from the rounding with which it is printed.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Expected {
    /// A value and its tolerance.
    About(f64, f64),
    /// From one to the other.
    Within(f64, f64),
}

pub(crate) use Expected::{About, Within};

pub(crate) fn at_most(value: f64) -> Expected {
    Within(f64::NEG_INFINITY, value)
}

pub(crate) fn at_least(value: f64) -> Expected {
    Within(value, f64::INFINITY)
}

/// A line of the table.
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
    }
}

impl Figure {
    /// What is quoted is a formula's value, which the item works out where it finds the figure.
    pub(crate) fn computed(self) -> Self {
        Self {
            quoted: None,
            ..self
        }
    }

    /// What is wrong with a text that should hold the numbers.
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
        // On top, the binary fraction's own rounding.
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
    /// Half of its last digit.
    rounding: f64,
}

/// The numbers among the words of a text, and the text without them.
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

/// Asserts that `found` is what `expected` says, figure by figure; tells of all that are not.
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

/// What is wrong with a figure.
fn fault(figure: &Figure, check: &Check) -> Option<String> {
    let quoted = match figure.quoted {
        None => figure.fault(&check.thesis),
        Some(quoted) => (check.thesis != quoted).then(|| format!("not '{quoted}'")),
    };
    let quoted = quoted.map(|what| format!("quoted as '{}': {what}", check.thesis));
    let fault = quoted.or_else(|| figure.fault(&check.ours))?;
    Some(format!("{}: {fault}", figure.name))
}

#[test]
fn numbers_are_read_as_printed() {
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
fn what_is_not_in_the_table_is_told() {
    let check = |ours: &str| Check::claim("width", "0.5 m", ours.to_owned(), true);
    let table = || figure("width", "0.5 m", "{} m", [About(0.5, 0.1)], "a test");
    // 0.6 rounds to all of these, to 0.61 it does not.
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
