//! Quantities as text, for people: significant digits, and the prefix of the unit that suits.
//!
//! Digits that say nothing are left out: zeros behind the point, a minus before zero, and what is below any
//! measure of this trade (a length of 1e-13 m is rounding).

/// A unit as text, its size in SI, and the magnitude from which it is used, SI.
type Unit = (&'static str, f64, f64);

/// Largest first; the last serves everything below.
const LENGTHS: &[Unit] = &[
    ("km", 1e3, 1e4),
    ("m", 1.0, 0.1),
    ("mm", 1e-3, 1e-4),
    ("um", 1e-6, 1e-7),
    ("nm", 1e-9, 0.0),
];

const FREQUENCIES: &[Unit] = &[
    ("THz", 1e12, 1e12),
    ("GHz", 1e9, 1e9),
    ("MHz", 1e6, 1e6),
    ("kHz", 1e3, 1e3),
    ("Hz", 1.0, 0.0),
];

const TIMES: &[Unit] = &[
    ("s", 1.0, 1.0),
    ("ms", 1e-3, 1e-3),
    ("us", 1e-6, 1e-6),
    ("ns", 1e-9, 1e-9),
    ("ps", 1e-12, 0.0),
];

const SPEEDS: &[Unit] = &[("km/s", 1e3, 1e4), ("m/s", 1.0, 0.1), ("mm/s", 1e-3, 0.0)];

const SIZES: &[Unit] = &[
    ("TiB", 1_099_511_627_776.0, 1_099_511_627_776.0),
    ("GiB", 1_073_741_824.0, 1_073_741_824.0),
    ("MiB", 1_048_576.0, 1_048_576.0),
    ("KiB", 1024.0, 1024.0),
    ("bytes", 1.0, 0.0),
];

/// A length: `0.2408 m`, `3.893 mm`, `12.5 km`. Metres up to ten thousand, in which places are told.
pub fn metres(value_m: f64) -> String {
    quantity(value_m, 4, 1e-10, LENGTHS)
}

/// A frequency to six digits: `9.6 GHz`, `622.36 MHz`.
pub fn hertz(value_hz: f64) -> String {
    quantity(value_hz, 6, 1e-6, FREQUENCIES)
}

/// A time: `1 ms`, `2.531 s`.
pub fn seconds(value_s: f64) -> String {
    quantity(value_s, 4, 1e-14, TIMES)
}

/// A speed: `125 m/s`, `20 mm/s`.
pub fn metres_per_second(value_m_s: f64) -> String {
    quantity(value_m_s, 4, 1e-7, SPEEDS)
}

/// An angle to four digits, and to a ten-thousandth at most: `-12.35 deg`, `0.0312 deg`.
pub fn degrees(value_deg: f64) -> String {
    let rounded = (value_deg * 1e4).round() / 1e4;
    format!("{} deg", significant(rounded, 4))
}

/// An amount of memory, powers of 1024: `512 bytes`, `1.2 GiB`.
pub fn bytes(count: u128) -> String {
    let value = count as f64;
    let &(unit, size, _) = unit_of(value, SIZES);
    match size {
        1.0 => format!("{count} {unit}"),
        _ => format!("{:.1} {unit}", value / size),
    }
}

/// A plain number of so many significant digits, without zeros behind the point that say nothing; far from 1 with
/// an exponent.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let digits = digits.max(1);
    // Rounded first: 9.9999 to three digits is 10.0 and has its digits there.
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i64 = exponent.parse().unwrap_or(0);
    if !(-5..=9).contains(&exponent) {
        return format!("{}e{exponent}", without_zeros(mantissa));
    }
    let decimals = (digits as i64 - 1 - exponent).max(0) as usize;
    let plain = format!("{value:.decimals$}");
    match without_zeros(&plain) {
        "-0" => "0".to_owned(),
        short => short.to_owned(),
    }
}

/// The value in the unit that suits; zero if it is below `least`.
fn quantity(value: f64, digits: usize, least: f64, units: &[Unit]) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    if value.abs() < least {
        // Without a prefix, whatever the largest unit is.
        let plain = units.iter().find(|unit| unit.1 == 1.0).unwrap_or(&units[0]);
        return format!("0 {}", plain.0);
    }
    let &(unit, size, _) = unit_of(value, units);
    format!("{} {unit}", significant(value / size, digits))
}

fn unit_of(value: f64, units: &[Unit]) -> &Unit {
    // By a hair more than the value, so that 0.99999999 GHz, which rounds to 1, is not 1000 MHz.
    let magnitude = value.abs() * (1.0 + 5e-7);
    let last = &units[units.len() - 1];
    units
        .iter()
        .find(|unit| magnitude >= unit.2)
        .unwrap_or(last)
}

fn without_zeros(number: &str) -> &str {
    match number.contains('.') {
        true => number.trim_end_matches('0').trim_end_matches('.'),
        false => number,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_those_that_matter() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (-1e-17, "-1e-17"),
            (9.9996, "10"),
            (0.001_234_56, "0.001235"),
            (123_456.0, "123456"),
            (-2.5, "-2.5"),
            (1e12, "1e12"),
            (f64::NAN, "not finite"),
        ] {
            assert_eq!(significant(value, 4), text);
        }
    }

    #[test]
    fn lengths_have_the_prefix_that_suits() {
        for (value, text) in [
            (0.003_893_4, "3.893 mm"),
            (-1e-17, "0 m"),
            (0.240_84, "0.2408 m"),
            (0.0999, "99.9 mm"),
            (101.9, "101.9 m"),
            (7071.068, "7071 m"),
            (12_500.0, "12.5 km"),
            (2.5e-5, "25 um"),
            (3e-9, "3 nm"),
        ] {
            assert_eq!(metres(value), text);
        }
    }

    #[test]
    fn other_quantities_too() {
        assert_eq!(hertz(6_000_000.0), "6 MHz");
        assert_eq!(hertz(9.6e9), "9.6 GHz");
        assert_eq!(hertz(622.36e6), "622.36 MHz");
        assert_eq!(hertz(999_999_999.9), "1 GHz");
        assert_eq!(hertz(0.0), "0 Hz");
        assert_eq!(seconds(0.001), "1 ms");
        assert_eq!(seconds(2.5312), "2.531 s");
        assert_eq!(metres_per_second(125.0), "125 m/s");
        assert_eq!(degrees(-0.000_01), "0 deg");
        assert_eq!(degrees(-12.3456), "-12.35 deg");
        assert_eq!(bytes(512), "512 bytes");
        assert_eq!(bytes(1 << 30), "1.0 GiB");
    }
}
