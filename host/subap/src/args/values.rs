//! Value parsers of options. The error of each states the expected text.

use std::ffi::OsStr;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PathBufValueParser, PossibleValuesParser, TypedValueParser};
use glam::DVec3;
use serde::Deserialize;
use subaperture::geometry::{Axis, Extent, Geodetic};
use subaperture::units::Dimension;

/// Channels of a coherent sum.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum SeveralChannels {
    /// All channels of the recording.
    All,
    /// Channels of these names.
    These(Vec<String>),
}

impl SeveralChannels {
    /// Names of the channels; `None` for all.
    pub(crate) fn named(&self) -> Option<&[String]> {
        match self {
            Self::All => None,
            Self::These(names) => Some(names),
        }
    }
}

impl fmt::Display for SeveralChannels {
    /// Text of the option.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            &self
                .named()
                .map_or("all".to_owned(), |names| names.join(",")),
        )
    }
}

/// Channels to be summed, as `all` or `A,B`.
pub(crate) fn several_channels(text: &str) -> Result<SeveralChannels, String> {
    if text == "all" {
        return Ok(SeveralChannels::All);
    }
    let names: Vec<String> = text.split(',').map(str::to_owned).collect();
    match names.iter().any(String::is_empty) {
        true => Err("give all, or names of channels with commas between them".to_owned()),
        false => Ok(SeveralChannels::These(names)),
    }
}

/// One of these words, which help and completions list.
pub(super) fn one_of<T>(words: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: std::error::Error + Send + Sync + 'static> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|word| word.parse())
}

pub(super) fn positive(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) | Err(_) => Err("give a whole number from 1".to_owned()),
        Ok(value) => Ok(value),
    }
}

/// Number of threads: at most 1024, far more than any machine runs at once; starting more takes minutes.
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

/// Path of an output. `-` is refused, since standard output is for text only, and so are names of JPEG files.
pub(super) fn output() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if path.as_os_str() == "-" {
            return Err(
                "nothing is written to standard output: give a name (./- for a file called -)",
            );
        }
        let is_jpeg = |ending: &OsStr| {
            ["jpg", "jpeg"].iter().any(|jpeg| ending.eq_ignore_ascii_case(jpeg))
        };
        match path.extension().is_some_and(is_jpeg) {
            true => Err(
                "JPEG files are not written: pictures are PNG (.png); subap export also writes SICD (.nitf), GeoTIFF (.tif), KMZ (.kmz) and Zarr (.zarr)",
            ),
            false => Ok(path),
        }
    })
}

/// A quantity with its unit, as `9.6GHz`, or a plain number of SI units, of angles degrees.
pub(super) fn quantity(text: &str, dimension: Dimension) -> Result<f64, String> {
    if let Ok(value) = finite(text.trim()) {
        return Ok(value);
    }
    // The caller states the expected text if this is not even a number.
    if !begins_with_a_number(text) {
        return Err(String::new());
    }
    let value = dimension.parse(text)?;
    Ok(match dimension {
        Dimension::Angle => value.to_degrees(),
        _ => value,
    })
}

fn begins_with_a_number(text: &str) -> bool {
    let digits = text.trim_start_matches(['+', '-', ' ']);
    digits.starts_with(|c: char| c.is_ascii_digit() || c == '.')
}

/// Parser of quantities of one dimension that satisfy `holds`.
fn checked(
    dimension: Dimension,
    wanted: &'static str,
    holds: fn(f64) -> bool,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let example = dimension.example().replace(' ', "");
        let plain = match dimension {
            Dimension::Length => ", or a plain number of metres",
            Dimension::Time => ", or a plain number of seconds",
            Dimension::Frequency => ", or a plain number of hertz",
            Dimension::Speed => ", or a plain number of metres a second",
            Dimension::Angle => ", or a plain number of degrees",
            Dimension::Power => ", or a plain number of watts",
            Dimension::Temperature => ", or a plain number of kelvins",
            _ => ", or a plain number",
        };
        let advice = format!(
            "give {}{wanted}, for example {example}{plain}",
            dimension.name()
        );
        match quantity(text, dimension) {
            Ok(value) if holds(value) => Ok(value),
            Err(why) if !why.is_empty() => Err(why),
            _ => Err(advice),
        }
    }
}

/// Quantity of either sign.
pub(super) fn any(dimension: Dimension) -> impl Fn(&str) -> Result<f64, String> + Clone {
    checked(dimension, "", |_| true)
}

/// Quantity of zero or more.
pub(super) fn from_zero(dimension: Dimension) -> impl Fn(&str) -> Result<f64, String> + Clone {
    checked(dimension, " from 0", |value| value >= 0.0)
}

/// Quantity above zero.
pub(super) fn above_zero(dimension: Dimension) -> impl Fn(&str) -> Result<f64, String> + Clone {
    checked(dimension, " above 0", |value| value > 0.0)
}

/// Probability between 0 and 1, both excluded.
pub(super) fn probability(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&value| value > 0.0 && value < 1.0)
        .ok_or_else(|| "give a number between 0 and 1, both excluded".to_owned())
}

/// Numbers or quantities between separators. A number without a unit takes the unit to its right.
fn several(text: &str, separator: char, dimension: Dimension) -> Result<Vec<f64>, String> {
    let parts: Vec<&str> = text.split(separator).collect();
    let numbers: Result<Vec<f64>, String> = parts.iter().map(|part| finite(part.trim())).collect();
    if parts.iter().all(|part| begins_with_a_number(part)) {
        return numbers.or_else(|_| dimension.parse_list(&parts.join(","), parts.len()));
    }
    numbers
}

/// `3,-4` or `3,-4,0.5`, metres or metres a second; with units `3,-4,0.5km`.
pub(super) fn vector(dimension: Dimension) -> impl Fn(&str) -> Result<DVec3, String> + Clone {
    move |text| {
        let wanted = "give two or three numbers, for example 3.5,-2";
        let numbers = several(text, ',', dimension);
        match numbers.as_deref() {
            Ok(&[x, y]) => Ok(DVec3::new(x, y, 0.0)),
            Ok(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
            Err(why) if begins_with_a_number(text) => Err(format!("{why}; {wanted}")),
            _ => Err(wanted.to_owned()),
        }
    }
}

/// Position on the Earth: `52.1,4.3` or `52.1,4.3,43`.
pub(super) fn geodetic(text: &str) -> Result<Geodetic, String> {
    let numbers: Result<Vec<f64>, String> =
        text.split(',').map(|part| finite(part.trim())).collect();
    let (latitude_deg, longitude_deg, height_m) = match numbers.as_deref() {
        Ok(&[latitude, longitude]) => (latitude, longitude, 0.0),
        Ok(&[latitude, longitude, height]) => (latitude, longitude, height),
        _ => return Err("give latitude and longitude in degrees, and a height in metres if it is not 0: 52.1,4.3,43".to_owned()),
    };
    if latitude_deg.abs() > 90.0 || longitude_deg.abs() > 360.0 || height_m.abs() > 1e6 {
        return Err("latitudes are from -90 to 90 degrees, longitudes from -180 to 180, heights up to 1e6 m".to_owned());
    }
    Ok(Geodetic {
        latitude_deg,
        longitude_deg,
        height_m,
    })
}

/// `-5:5:0.1` or `-20:20:1km/h`.
pub(super) fn axis(dimension: Dimension) -> impl Fn(&str) -> Result<Axis, String> + Clone {
    move |text| match several(text, ':', dimension)?[..] {
        [start, stop, step] => {
            Axis::from_range(start, stop, step).map_err(|error| error.to_string())
        }
        _ => Err("give START:STOP:STEP, for example -5:5:0.1".to_owned()),
    }
}

/// A plain number above 0.
fn length(text: &str) -> Result<f64, String> {
    finite(text)
        .ok()
        .filter(|&v| v > 0.0)
        .ok_or_else(|| "give a number above 0".to_owned())
}

fn pair(text: &str, separator: char) -> Option<(f64, f64)> {
    let (first, second) = text.split_once(separator)?;
    Some((finite(first.trim()).ok()?, finite(second.trim()).ok()?))
}

/// Position in the scene as given.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "[f64; 2]")]
pub(crate) struct At {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// `None` if not given.
    pub(crate) z: Option<f64>,
}

impl From<[f64; 2]> for At {
    fn from([x, y]: [f64; 2]) -> Self {
        Self { x, y, z: None }
    }
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

/// Two ascending lengths.
pub(super) fn ranges(text: &str) -> Result<(f64, f64), String> {
    let parsed = text.split_once(':').and_then(|(near, far)| {
        let metres = |text| quantity(text, Dimension::Length).ok();
        Some((metres(near)?, metres(far)?)).filter(|(near, far)| 0.0 <= *near && near < far)
    });
    parsed.ok_or_else(|| "give two ascending ranges from 0, for example 2m:30m".to_owned())
}

pub(super) fn odd(text: &str) -> Result<usize, String> {
    positive(text)
        .ok()
        .filter(|n| *n >= 3 && n % 2 == 1)
        .ok_or_else(|| "give an odd number from 3".to_owned())
}

pub(super) fn error_bound(text: &str) -> Result<f64, String> {
    quantity(text, Dimension::Level)
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

/// As [`size`], for an embedded module.
pub(super) fn ram_size(text: &str) -> Result<u64, String> {
    size_from(text, 1 << 10).ok_or_else(|| "give a size such as 512K or 1M, at least 1K".to_owned())
}

/// A size of scratch.
pub(super) fn scratch_size(text: &str) -> Result<u64, String> {
    size_from(text, 1 << 16)
        .ok_or_else(|| "give a size such as 512K or 48M, at least 64K".to_owned())
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
    fn quantities_have_units_or_are_plain() {
        let frequency = above_zero(Dimension::Frequency);
        assert_eq!(frequency("9.6GHz"), Ok(9.6e9));
        assert_eq!(frequency("9.6 GHz"), Ok(9.6e9));
        assert_eq!(frequency("9.6e9"), Ok(9.6e9));
        assert_eq!(from_zero(Dimension::Angle)("30"), Ok(30.0));
        assert!(
            (from_zero(Dimension::Angle)("0.5rad").unwrap() - 28.647_889_756_541_16).abs() < 1e-12
        );
        assert_eq!(error_bound("-60dB"), Ok(-60.0));
        for (text, part) in [
            ("9.6km", "expected a frequency, found a length"),
            ("9.6GHZ", "did you mean 'GHz'"),
            (
                "0Hz",
                "above 0, for example 10GHz, or a plain number of hertz",
            ),
            ("-1", "above 0, for example 10GHz"),
            ("fast", "for example 10GHz"),
            ("", "for example 10GHz"),
            ("nan", "for example 10GHz"),
        ] {
            let error = frequency(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
        let velocity = vector(Dimension::Speed);
        assert_eq!(velocity("3,-4"), Ok(DVec3::new(3.0, -4.0, 0.0)));
        assert_eq!(velocity("36,0,72km/h"), Ok(DVec3::new(10.0, 0.0, 20.0)));
        let axis = axis(Dimension::Speed)("-1:1:0.5 m/s").unwrap();
        assert_eq!((axis.start, axis.count), (-1.0, 4));
    }

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
