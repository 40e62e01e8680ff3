//! Quantities as text with significant digits and a suitable unit prefix.
//!
//! Insignificant digits are omitted: trailing zeros after the decimal point, the sign of zero, and values below any
//! resolution of radar (a length of 1e-13 m is rounding).

/// Unit as text, its size in SI, and the SI magnitude from which it is used.
type Unit = (&'static str, f64, f64);

/// Largest first; the last is used for everything smaller.
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

/// Length, such as `0.2408 m`, `3.893 mm`, `12.5 km`. Up to ten thousand metres in metres, as positions are given.
pub fn metres(value_m: f64) -> String {
    quantity(value_m, 4, 1e-10, LENGTHS)
}

/// Frequency with six digits, such as `9.6 GHz`, `622.36 MHz`.
pub fn hertz(value_hz: f64) -> String {
    quantity(value_hz, 6, 1e-6, FREQUENCIES)
}

/// Time, such as `1 ms`, `2.531 s`.
pub fn seconds(value_s: f64) -> String {
    quantity(value_s, 4, 1e-14, TIMES)
}

/// Speed, such as `125 m/s`, `20 mm/s`.
pub fn metres_per_second(value_m_s: f64) -> String {
    quantity(value_m_s, 4, 1e-7, SPEEDS)
}

/// Angle with four digits, at most to a ten-thousandth: `-12.35 deg`, `0.0312 deg`.
pub fn degrees(value_deg: f64) -> String {
    let rounded = (value_deg * 1e4).round() / 1e4;
    format!("{} deg", significant(rounded, 4))
}

/// Amount of memory in powers of 1024: `512 bytes`, `1.2 GiB`.
pub fn bytes(count: u128) -> String {
    let value = count as f64;
    let &(unit, size, _) = unit_of(value, SIZES);
    match size {
        1.0 => format!("{count} {unit}"),
        _ => format!("{:.1} {unit}", value / size),
    }
}

/// Plain number with the given number of significant digits, without trailing zeros; with an exponent if far from 1.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let digits = digits.max(1);
    // Round first: 9.9999 with three digits is 10.0, which changes the number of decimals.
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

/// Value in a suitable unit; zero if below `least`.
fn quantity(value: f64, digits: usize, least: f64, units: &[Unit]) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    if value.abs() < least {
        // Plain unit, whatever the largest unit is.
        let plain = units.iter().find(|unit| unit.1 == 1.0).unwrap_or(&units[0]);
        return format!("0 {}", plain.0);
    }
    let &(unit, size, _) = unit_of(value, units);
    format!("{} {unit}", significant(value / size, digits))
}

fn unit_of(value: f64, units: &[Unit]) -> &Unit {
    // Slightly larger than the value, so that 0.99999999 GHz is shown as 1 GHz and not as 1000 MHz.
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
    fn significant_digits_are_kept_and_trailing_zeros_omitted() {
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
    fn lengths_have_suitable_prefix() {
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
    fn other_quantities_have_suitable_prefix() {
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
