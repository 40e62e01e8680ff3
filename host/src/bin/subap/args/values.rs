//! Values as they are typed: each function turns a word into one, or says what to give.

use std::path::PathBuf;

use clap::builder::{PathBufValueParser, TypedValueParser};
use glam::DVec3;
use subaperture::geometry::{Axis, Extent};

pub(super) fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("give a whole number from 1".to_owned()),
        Ok(value) => Ok(value),
    }
}

/// Far more threads than any machine runs at once; so many more that starting them takes minutes are
/// a slip.
pub(super) fn threads(text: &str) -> Result<usize, String> {
    positive(text)
        .ok()
        .filter(|&count| count <= 1024)
        .ok_or_else(|| "give a whole number from 1 to 1024".to_owned())
}

pub(super) fn finite(text: &str) -> Result<f64, String> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|v| v.is_finite())
        .ok_or_else(|| "give a number".to_owned())
}

/// The path of an output; `-` is none, for nothing is written to standard output but text.
pub(super) fn output() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.as_os_str() == "-" {
        true => Err("nothing is written to standard output: give a name (./- for a file called -)"),
        false => Ok(path),
    })
}

/// `3,-4` or `3,-4,0.5`.
pub(super) fn vector(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, String> =
        text.split(',').map(|part| finite(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[x, y]) => Ok(DVec3::new(x, y, 0.0)),
        Ok(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err("give two or three numbers, for example 3.5,-2".to_owned()),
    }
}

/// `-5:5:0.1`.
pub(super) fn axis(text: &str) -> Result<Axis, String> {
    let numbers: Result<Vec<f64>, String> =
        text.split(':').map(|part| finite(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[start, stop, step]) => {
            Axis::from_range(start, stop, step).map_err(|error| error.to_string())
        }
        _ => Err("give START:STOP:STEP, for example -5:5:0.1".to_owned()),
    }
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&v| v >= 0.0)
        .ok_or_else(|| "give a number from 0".to_owned())
}

pub(super) fn length(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&v| v > 0.0)
        .ok_or_else(|| "give a number above 0".to_owned())
}

fn pair(text: &str, separator: char) -> Option<(f64, f64)> {
    let (first, second) = text.split_once(separator)?;
    Some((finite(first.trim()).ok()?, finite(second.trim()).ok()?))
}

/// A place as typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct At {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// `None` if it was not given.
    pub(crate) z: Option<f64>,
}

/// `10.5,-3` or `10.5,-3,2`.
pub(super) fn place(text: &str) -> Result<At, String> {
    let numbers: Result<Vec<f64>, String> =
        text.split(',').map(|part| finite(part.trim())).collect();
    match numbers.as_deref() {
        Ok(&[x, y]) => Ok(At { x, y, z: None }),
        Ok(&[x, y, z]) => Ok(At { x, y, z: Some(z) }),
        _ => Err("give two or three numbers, for example 10.5,-3".to_owned()),
    }
}

pub(super) fn rectangle(text: &str) -> Result<Extent, String> {
    let parsed = text.split_once(',').and_then(|(x, y)| {
        let ascending = |text| pair(text, ':').filter(|(low, high)| low < high);
        Some(Extent {
            x_m: ascending(x)?,
            y_m: ascending(y)?,
        })
    });
    parsed.ok_or_else(|| "give two ascending ranges, for example -5:5,20:30".to_owned())
}

pub(super) fn odd(text: &str) -> Result<usize, String> {
    positive(text)
        .ok()
        .filter(|n| *n >= 3 && n % 2 == 1)
        .ok_or_else(|| "give an odd number from 3".to_owned())
}

pub(super) fn error_bound(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|v| (-120.0..=-20.0).contains(v))
        .ok_or_else(|| "give decibels from -120 to -20, for example -60".to_owned())
}

pub(super) fn setting(text: &str) -> Result<(String, String), String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| "give KEY=VALUE, for example radar.pri=1ms".to_owned())?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

pub(super) fn sign(text: &str) -> Result<i8, String> {
    match text {
        "-1" => Ok(-1),
        "+1" | "1" => Ok(1),
        _ => Err("give -1 or +1".to_owned()),
    }
}

/// `1048576`, `512M`, `2G`, `1.5GiB`: powers of 1024, at least a mebibyte.
pub(super) fn size(text: &str) -> Result<u64, String> {
    size_from(text, 1 << 20).ok_or_else(|| "give a size such as 512M or 2G, at least 1M".to_owned())
}

/// As [`size`], for a small machine.
pub(super) fn ram_size(text: &str) -> Result<u64, String> {
    size_from(text, 1 << 10).ok_or_else(|| "give a size such as 512K or 1M, at least 1K".to_owned())
}

/// A size of at least `least` bytes.
fn size_from(text: &str, least: u32) -> Option<u64> {
    let split = text
        .find(|c: char| c.is_ascii_alphabetic())
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let number = length(number.trim()).ok()?;
    let exponent = match unit
        .to_ascii_uppercase()
        .trim_end_matches("IB")
        .trim_end_matches('B')
    {
        "" => 0,
        "K" => 1,
        "M" => 2,
        "G" => 3,
        "T" => 4,
        _ => return None,
    };
    let bytes = number * 1024f64.powi(exponent);
    (f64::from(least)..=1e18)
        .contains(&bytes)
        .then_some(bytes as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        for (text, bytes) in [
            ("1048576", 1 << 20),
            ("512M", 512 << 20),
            ("2g", 2 << 30),
            ("1.5GiB", 3 << 29),
            ("1TB", 1 << 40),
        ] {
            assert_eq!(size(text), Ok(bytes), "{text}");
        }
        assert_eq!(ram_size("512K"), Ok(512 << 10));
        for text in ["", "G", "0", "-1G", "1X", "10", "nan", "1e30G", "2 G G"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
