//! Quantities as text: a number with a unit of the expected dimension.
//!
//! Examples: `"10 GHz"`, `"1 ms"`, `"-20 dB"`. Several quantities of one dimension are separated by commas, and a
//! number without a unit has the unit to its right: `"0, -5, 3 km"` is `"0 km, -5 km, 3 km"`. Values are returned in
//! SI units, angles in radians; powers in `dBm`, `dBW` and cross sections in `dBsm` become watts and square metres,
//! plain decibels remain decibels.

use crate::nearest::nearest;

/// Physical quantity of a unit, and the SI unit of its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Metres.
    Length,
    /// Seconds.
    Time,
    /// Hertz.
    Frequency,
    /// Metres per second.
    Speed,
    /// Hertz per second.
    SweepRate,
    /// Metres per second squared.
    Acceleration,
    /// Radians.
    Angle,
    /// Radians per second.
    AngularRate,
    /// Decibels.
    Level,
    /// Decibels relative to an isotropic antenna.
    Gain,
    /// Decibels relative to the carrier per hertz.
    PhaseNoise,
    /// Watts.
    Power,
    /// Kelvins.
    Temperature,
    /// Square metres.
    CrossSection,
    /// Plain number.
    Ratio,
}

/// Conversion from a number with a unit to SI.
#[derive(Clone, Copy, Debug)]
enum Scale {
    /// Multiplication by this factor.
    Linear(f64),
    /// `10^(x / 10)` times this factor.
    Decibel(f64),
}

use Scale::{Decibel, Linear};

/// Dimension with its name, an example, its largest sensible magnitude in SI, and its units.
type Row = (
    Dimension,
    &'static str,
    &'static str,
    f64,
    &'static [(&'static str, Scale)],
);

const DEGREE: f64 = std::f64::consts::PI / 180.0;

static DIMENSIONS: &[Row] = &[
    (
        Dimension::Length,
        "a length",
        "5 km",
        1e9,
        &[
            ("m", Linear(1.0)),
            ("km", Linear(1e3)),
            ("cm", Linear(1e-2)),
            ("mm", Linear(1e-3)),
            ("um", Linear(1e-6)),
        ],
    ),
    (
        Dimension::Time,
        "a time",
        "1 ms",
        1e9,
        &[
            ("s", Linear(1.0)),
            ("ms", Linear(1e-3)),
            ("us", Linear(1e-6)),
            ("ns", Linear(1e-9)),
            ("ps", Linear(1e-12)),
            ("min", Linear(60.0)),
            ("h", Linear(3600.0)),
        ],
    ),
    (
        Dimension::Frequency,
        "a frequency",
        "10 GHz",
        1e15,
        &[
            ("Hz", Linear(1.0)),
            ("kHz", Linear(1e3)),
            ("MHz", Linear(1e6)),
            ("GHz", Linear(1e9)),
            ("THz", Linear(1e12)),
        ],
    ),
    (
        Dimension::Speed,
        "a speed",
        "100 m/s",
        1e7,
        &[
            ("m/s", Linear(1.0)),
            ("km/s", Linear(1e3)),
            ("cm/s", Linear(1e-2)),
            ("mm/s", Linear(1e-3)),
            ("km/h", Linear(1.0 / 3.6)),
            ("kn", Linear(1852.0 / 3600.0)),
        ],
    ),
    (
        Dimension::SweepRate,
        "a sweep rate",
        "40 MHz/us",
        1e21,
        &[
            ("Hz/s", Linear(1.0)),
            ("MHz/us", Linear(1e12)),
            ("MHz/ms", Linear(1e9)),
            ("GHz/ms", Linear(1e12)),
            ("GHz/s", Linear(1e9)),
        ],
    ),
    (
        Dimension::Acceleration,
        "an acceleration",
        "0.5 m/s^2",
        1e6,
        &[("m/s^2", Linear(1.0)), ("mm/s^2", Linear(1e-3))],
    ),
    (
        Dimension::Angle,
        "an angle",
        "45 deg",
        1e6,
        &[
            ("deg", Linear(DEGREE)),
            ("rad", Linear(1.0)),
            ("mrad", Linear(1e-3)),
        ],
    ),
    (
        Dimension::AngularRate,
        "an angular rate",
        "3 deg/s",
        1e6,
        &[
            ("deg/s", Linear(DEGREE)),
            ("rad/s", Linear(1.0)),
            ("deg/h", Linear(DEGREE / 3600.0)),
        ],
    ),
    (
        Dimension::Level,
        "a level in decibels",
        "-20 dB",
        1e3,
        &[("dB", Linear(1.0))],
    ),
    (
        Dimension::Gain,
        "an antenna's gain",
        "12 dBi",
        1e3,
        &[("dBi", Linear(1.0))],
    ),
    (
        Dimension::PhaseNoise,
        "a level of phase noise",
        "-90 dBc/Hz",
        1e3,
        &[("dBc/Hz", Linear(1.0))],
    ),
    (
        Dimension::Power,
        "a power",
        "30 dBm",
        1e12,
        &[
            ("W", Linear(1.0)),
            ("kW", Linear(1e3)),
            ("mW", Linear(1e-3)),
            ("dBm", Decibel(1e-3)),
            ("dBW", Decibel(1.0)),
        ],
    ),
    (
        Dimension::Temperature,
        "a temperature",
        "290 K",
        1e6,
        &[("K", Linear(1.0))],
    ),
    (
        Dimension::CrossSection,
        "a radar cross section",
        "1 m^2",
        1e12,
        &[("m^2", Linear(1.0)), ("dBsm", Decibel(1.0))],
    ),
    (
        Dimension::Ratio,
        "a plain number",
        "0.5",
        1e15,
        &[
            ("", Linear(1.0)),
            ("%", Linear(1e-2)),
            ("ppm", Linear(1e-6)),
            ("ppb", Linear(1e-9)),
        ],
    ),
];

impl Dimension {
    fn row(self) -> &'static Row {
        let mut rows = DIMENSIONS.iter();
        rows.find(|row| row.0 == self)
            .expect("every dimension is in the table")
    }

    /// Name with its article: `a length`.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// Example of a quantity.
    pub fn example(self) -> &'static str {
        self.row().2
    }

    /// Units, such as `m, km, cm`.
    pub fn units(self) -> String {
        let units = self.row().4.iter().map(|&(unit, _)| unit);
        let named: Vec<&str> = units.filter(|unit| !unit.is_empty()).collect();
        named.join(", ")
    }

    /// Parse the quantity `text` into SI units.
    ///
    /// # Errors
    /// Description of the fault and of the expected form.
    pub fn parse(self, text: &str) -> Result<f64, String> {
        Ok(self.parse_list(text, 1)?[0])
    }

    /// Parse `count` quantities of one dimension, separated by commas, into SI units.
    ///
    /// # Errors
    /// Description of the fault and of the expected form.
    pub fn parse_list(self, text: &str, count: usize) -> Result<Vec<f64>, String> {
        parse_row(text, &vec![self; count])
    }
}

/// Parse quantities of the given dimensions, separated by commas, into SI units.
pub fn parse_row(text: &str, dimensions: &[Dimension]) -> Result<Vec<f64>, String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != dimensions.len() {
        return Err(format!(
            "'{text}': expected {1}, found {0}",
            match parts.len() {
                1 => "one quantity".to_owned(),
                n => format!("{n} quantities separated by commas"),
            },
            example_row(dimensions)
        ));
    }
    let mut values = vec![0.0; parts.len()];
    // Unit to the right, for numbers without a unit.
    let mut right: Option<(Dimension, String)> = None;
    for ((value, part), &dimension) in values.iter_mut().zip(&parts).zip(dimensions).rev() {
        let (number, unit) = split(part.trim(), dimension)?;
        let unit = match (&right, unit.is_empty()) {
            (Some((of, unit)), true) if *of == dimension => unit.clone(),
            _ => unit,
        };
        *value = to_si(number, &unit, dimension, part.trim())?;
        right = Some((dimension, unit));
    }
    Ok(values)
}

/// Example of a row of these dimensions.
pub fn example_row(dimensions: &[Dimension]) -> String {
    let examples: Vec<&str> = dimensions.iter().map(|d| d.example()).collect();
    format!("\"{}\"", examples.join(", "))
}

/// Split into a number and its unit, which may be empty.
fn split(text: &str, dimension: Dimension) -> Result<(f64, String), String> {
    let end = number_length(text);
    let number: f64 = text[..end].parse().map_err(|_| {
        format!(
            "'{text}': expected a number, then a unit: write {}, for example \"{}\"",
            dimension.name(),
            dimension.example()
        )
    })?;
    let unit = text[end..].trim();
    let plain = unit.replace(['\u{b5}', '\u{3bc}'], "u");
    Ok((
        number,
        plain.replace('\u{b2}', "^2").replace('\u{b0}', "deg"),
    ))
}

/// Length in bytes of the decimal number at the start of `text`. An `e` belongs to it only if digits follow.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |mut at: usize| {
        while bytes.get(at).is_some_and(u8::is_ascii_digit) {
            at += 1;
        }
        at
    };
    let sign = |at: usize| at + usize::from(matches!(bytes.get(at), Some(b'+' | b'-')));
    let mut end = digits(sign(0));
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let exponent = sign(end + 1);
        if digits(exponent) > exponent {
            end = digits(exponent);
        }
    }
    end
}

fn to_si(number: f64, unit: &str, dimension: Dimension, text: &str) -> Result<f64, String> {
    let &(_, name, example, largest, units) = dimension.row();
    let Some(&(_, scale)) = units.iter().find(|(known, _)| *known == unit) else {
        if unit.is_empty() {
            return Err(format!(
                "'{text}' has no unit: write {name} as \"{example}\"; units are {}",
                dimension.units()
            ));
        }
        let other = DIMENSIONS
            .iter()
            .find(|row| row.4.iter().any(|(known, _)| *known == unit));
        if let Some(&(_, measured, ..)) = other {
            return Err(format!(
                "'{text}': expected {name}, found {measured}: write it as \"{example}\""
            ));
        }
        let meant = nearest(unit, units.iter().map(|&(known, _)| known))
            .map(|known| format!(" (did you mean '{known}'?)"))
            .unwrap_or_default();
        return Err(format!(
            "unit '{unit}' is not known{meant}: units of {name} are {}",
            dimension.units()
        ));
    };
    let value = match scale {
        Linear(factor) => number * factor,
        Decibel(factor) => power_of_db(number) * factor,
    };
    if value.is_finite() && value.abs() <= largest {
        Ok(value)
    } else {
        Err(format!(
            "'{text}' is too large: write {name} such as \"{example}\""
        ))
    }
}

/// Power ratio of `db`.
pub fn power_of_db(db: f64) -> f64 {
    libm::pow(10.0, db / 10.0)
}

/// Amplitude ratio of `db`.
pub fn amplitude_of_db(db: f64) -> f64 {
    power_of_db(db / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_converted_to_si() {
        for (text, dimension, expected) in [
            ("10 GHz", Dimension::Frequency, 10e9),
            ("1 ms", Dimension::Time, 1e-3),
            ("1.5e-3s", Dimension::Time, 1.5e-3),
            ("3 \u{b5}s", Dimension::Time, 3e-6),
            ("-5 km", Dimension::Length, -5000.0),
            ("+.5 m", Dimension::Length, 0.5),
            ("90 km/h", Dimension::Speed, 25.0),
            ("180 deg", Dimension::Angle, std::f64::consts::PI),
            ("180\u{b0}", Dimension::Angle, std::f64::consts::PI),
            ("-20 dB", Dimension::Level, -20.0),
            ("30 dBm", Dimension::Power, 1.0),
            ("10 dBsm", Dimension::CrossSection, 10.0),
            ("2 m\u{b2}", Dimension::CrossSection, 2.0),
            ("5 ppm", Dimension::Ratio, 5e-6),
            ("25 %", Dimension::Ratio, 0.25),
            ("0.25", Dimension::Ratio, 0.25),
        ] {
            let got = dimension.parse(text).unwrap();
            // One rounding each of the factor, the power and the product.
            assert!(
                (got - expected).abs() <= 1e-15 * expected.abs(),
                "{text}: {got}"
            );
        }
    }

    #[test]
    fn number_without_unit_has_unit_to_its_right() {
        let km = Dimension::Length.parse_list("0, -5, 3 km", 3).unwrap();
        assert_eq!(km, [0.0, -5000.0, 3000.0]);
        let mixed = Dimension::Length.parse_list("1 m, 2, 3 km", 3).unwrap();
        assert_eq!(mixed, [1.0, 2000.0, 3000.0]);
        let row = parse_row(
            "1 kHz, -90 dBc/Hz",
            &[Dimension::Frequency, Dimension::PhaseNoise],
        );
        assert_eq!(row.unwrap(), [1000.0, -90.0]);
    }

    #[test]
    fn errors_state_the_expected_unit() {
        for (text, dimension, part) in [
            ("5", Dimension::Length, "has no unit"),
            (
                "five km",
                Dimension::Length,
                "expected a number, then a unit",
            ),
            ("", Dimension::Length, "expected a number, then a unit"),
            ("nan m", Dimension::Length, "expected a number, then a unit"),
            ("5 ms", Dimension::Length, "expected a length, found a time"),
            ("5 Ghz", Dimension::Frequency, "did you mean 'GHz'?"),
            (
                "5 parsec",
                Dimension::Length,
                "is not known: units of a length",
            ),
            ("1e300 m", Dimension::Length, "is too large"),
            ("1e999 m", Dimension::Length, "is too large"),
            ("9999 dBm", Dimension::Power, "is too large"),
            ("1 m, 2 m", Dimension::Length, "found 2 quantities"),
            ("1 kHz, 2", Dimension::Frequency, "found 2 quantities"),
        ] {
            let error = dimension.parse(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let unit_missing = parse_row("1, 2 dB", &[Dimension::Length, Dimension::Level]);
        assert!(unit_missing.unwrap_err().contains("has no unit"));
    }
}
