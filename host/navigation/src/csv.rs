//! Comma-separated values whose header names units.
//!
//! The first line that is not a comment (`#`) names the columns, in any order, with their units: `time_s`, `time [s]` or `time (s)`.
//!
//! | column | quantity | unit, for example |
//! |---|---|---|
//! | `time` | time of the log's own clock; required | `s`, `ms`, `us` |
//! | `latitude`, `longitude` (or `lat`, `lon`) | position on the Earth (WGS 84) | `deg`, `rad` |
//! | `height` (or `altitude`) | height above the ellipsoid | `m`, `km` |
//! | `x`, `y`, `z` (or `east`, `north`, `up`) | position in local axes, instead | `m`, `cm`, `mm` |
//! | `velocity_x`, `velocity_y`, `velocity_z` (or `_east`, `_north`, `_up`) | velocity | `m_s`, `km_h`, `m/s` in brackets |
//! | `roll`, `pitch`, `yaw` | right-handed rotations about x forward, y left, z up, as for all tracks: positive pitch is nose down, yaw from x (east) to y (north) | `deg`, `rad` |
//! | `roll`, `pitch`, `heading` (or `azimuth`) | navigation angles: positive pitch is nose up, heading clockwise from north | `deg`, `rad` |
//! | `sigma_` before any of these | standard deviation | as the quantity |
//!
//! Any unit of the dimension is read (`units`). Other columns are ignored and reported. Rows with a missing or invalid value are counted and left out. If seconds of the day or of the GPS week start again, times continue in the
//! next day or week ([`ReadReport::doubts`]).

use std::io::{self, BufRead, Read};

use glam::DVec3;

use subaperture_model::geometry::Geodetic;
use subaperture_model::units::Dimension;

use crate::account::{Clock, Fault, ReadReport, Wrong, count};
use crate::time::{DAY_S, WEEK_S};
use crate::{Attitude, GpsTime, Kind, Place, Record};

/// Largest length of a line, bytes.
const LONGEST_LINE: u64 = 4096;

/// Largest absolute value of a number in SI units.
const LARGEST: f64 = 1e9;

/// Quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Time,
    Latitude,
    Longitude,
    Height,
    X,
    Y,
    Z,
    VelocityX,
    VelocityY,
    VelocityZ,
    Roll,
    Pitch,
    Yaw,
    Heading,
}

use Quantity::{
    Heading, Height, Latitude, Longitude, Pitch, Roll, Time, VelocityX, VelocityY, VelocityZ, X, Y,
    Yaw, Z,
};

/// Names of columns. A name comes before its own prefixes, as the first match counts.
const NAMES: [(&str, Quantity, Dimension); 27] = [
    ("time", Time, Dimension::Time),
    ("latitude", Latitude, Dimension::Angle),
    ("longitude", Longitude, Dimension::Angle),
    ("lat", Latitude, Dimension::Angle),
    ("lon", Longitude, Dimension::Angle),
    ("height", Height, Dimension::Length),
    ("altitude", Height, Dimension::Length),
    ("velocity_x", VelocityX, Dimension::Speed),
    ("velocity_y", VelocityY, Dimension::Speed),
    ("velocity_z", VelocityZ, Dimension::Speed),
    ("velocity_east", VelocityX, Dimension::Speed),
    ("velocity_north", VelocityY, Dimension::Speed),
    ("velocity_up", VelocityZ, Dimension::Speed),
    ("vx", VelocityX, Dimension::Speed),
    ("vy", VelocityY, Dimension::Speed),
    ("vz", VelocityZ, Dimension::Speed),
    ("x", X, Dimension::Length),
    ("y", Y, Dimension::Length),
    ("z", Z, Dimension::Length),
    ("east", X, Dimension::Length),
    ("north", Y, Dimension::Length),
    ("up", Z, Dimension::Length),
    ("roll", Roll, Dimension::Angle),
    ("pitch", Pitch, Dimension::Angle),
    ("yaw", Yaw, Dimension::Angle),
    ("heading", Heading, Dimension::Angle),
    ("azimuth", Heading, Dimension::Angle),
];

/// Column that is read.
struct Column {
    /// Index in a row.
    at: usize,
    quantity: Quantity,
    /// Whether it is the standard deviation of the quantity.
    sigma: bool,
    /// Unit of the values, in SI units.
    unit: f64,
}

/// Columns that are read, the number of all columns, and the names of the others.
pub(crate) struct Header {
    columns: Vec<Column>,
    count: usize,
    others: Vec<String>,
}

/// Split a column's title into its name and its unit, which may be empty.
fn parts(cell: &str) -> (String, String) {
    let lower = cell.to_ascii_lowercase();
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, unit)) = cell.split_once(open) {
            let unit = unit.trim_end().trim_end_matches(close).trim();
            let name = name.trim().to_ascii_lowercase().replace(' ', "_");
            return (name, unit.to_owned());
        }
    }
    let plain = lower.strip_prefix("sigma_").unwrap_or(&lower);
    let found = NAMES.iter().find_map(|(name, ..)| {
        let unit = plain.strip_prefix(name)?;
        let whole = unit.is_empty() || unit.starts_with('_');
        whole.then(|| unit.trim_start_matches('_').replace('_', "/"))
    });
    match found {
        Some(unit) => {
            let length = lower.len() - unit.len() - usize::from(!unit.is_empty());
            // Units are case-sensitive; lowering ASCII letters keeps byte positions.
            let written = cell[cell.len() - unit.len()..].replace('_', "/");
            (lower[..length].to_owned(), written)
        }
        None => (lower.clone(), String::new()),
    }
}

impl Header {
    /// Parse the header line. The error names the missing or wrong column.
    pub(crate) fn parse(line: &str) -> Result<Self, String> {
        let cells: Vec<&str> = line
            .trim_start_matches('\u{feff}')
            .split(',')
            .map(str::trim)
            .collect();
        let mut header = Self {
            columns: Vec::new(),
            count: cells.len(),
            others: Vec::new(),
        };
        for (at, cell) in cells.iter().enumerate() {
            let (name, unit) = parts(cell);
            let (plain, sigma) = match name.strip_prefix("sigma_") {
                Some(plain) => (plain, true),
                None => (&*name, false),
            };
            let Some(&(_, quantity, dimension)) = NAMES.iter().find(|(known, ..)| *known == plain)
            else {
                header.others.push((*cell).to_owned());
                continue;
            };
            let unit = dimension
                .parse(&format!("1 {unit}"))
                .map_err(|error| format!("column '{cell}': {error}"))?;
            if header.find(quantity, sigma).is_some() {
                return Err(format!(
                    "column '{cell}': expected one column of this quantity, found two"
                ));
            }
            header.columns.push(Column {
                at,
                quantity,
                sigma,
                unit,
            });
        }
        let has = |quantity| header.find(quantity, false).is_some();
        let all = |quantities: &[Quantity], names: &str| match quantities
            .iter()
            .filter(|&&w| has(w))
            .count()
        {
            0 => Ok(false),
            n if n == quantities.len() => Ok(true),
            _ => Err(format!(
                "expected columns of all of {names}, found only some"
            )),
        };
        if !has(Time) {
            return Err("expected a column of time, such as time_s, found none".to_owned());
        }
        let earth = all(
            &[Latitude, Longitude, Height],
            "latitude, longitude and height",
        )?;
        let local = all(&[X, Y, Z], "x, y and z")?;
        if earth == local {
            return Err(match earth {
                true => "expected positions on the Earth or as x, y and z, found both",
                false => "no position: expected columns of latitude, longitude and height, or x, y and z, each with its unit",
            }
            .to_owned());
        }
        all(
            &[VelocityX, VelocityY, VelocityZ],
            "the three components of the velocity",
        )?;
        if has(Yaw) && has(Heading) {
            return Err("expected a column of yaw or heading, not both".to_owned());
        }
        if all(&[Roll, Pitch], "roll and pitch")? && !has(Yaw) && !has(Heading) {
            return Err(
                "expected a column of yaw or heading with roll and pitch, found neither".to_owned(),
            );
        }
        Ok(header)
    }

    fn find(&self, quantity: Quantity, sigma: bool) -> Option<&Column> {
        let mut columns = self.columns.iter();
        columns.find(|column| column.quantity == quantity && column.sigma == sigma)
    }

    fn record(&self, row: &str, byte: u64) -> Result<Record, String> {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != self.count {
            return Err(format!(
                "{} values, expected {} as in the header",
                cells.len(),
                self.count
            ));
        }
        // An empty cell is a missing value.
        let value = |quantity, sigma| -> Result<Option<f64>, String> {
            let Some(column) = self.find(quantity, sigma) else {
                return Ok(None);
            };
            let cell = cells[column.at];
            if cell.is_empty() {
                return Ok(None);
            }
            let number = cell.parse::<f64>().map(|number| number * column.unit).ok();
            let least = if sigma { 0.0 } else { -LARGEST };
            match number.filter(|number| (least..=LARGEST).contains(number)) {
                Some(number) => Ok(Some(number)),
                None => Err(format!(
                    "value {} is '{cell}', expected a finite number within +-1e9 in SI units, a standard deviation of at least 0",
                    column.at + 1
                )),
            }
        };
        let three = |axes: [Quantity; 3], sigma| -> Result<Option<DVec3>, String> {
            let [a, b, c] = [
                value(axes[0], sigma)?,
                value(axes[1], sigma)?,
                value(axes[2], sigma)?,
            ];
            Ok(a.zip(b).zip(c).map(|((a, b), c)| DVec3::new(a, b, c)))
        };
        let time = value(Time, false)?.ok_or("expected a time, found an empty value")?;
        let mut record = Record::at(
            byte,
            Kind::Csv,
            GpsTime {
                week: 0,
                seconds: time,
            },
        );
        let earth = three([Longitude, Latitude, Height], false)?;
        record.place = match earth {
            Some(place) => Some(Place::Earth(geodetic(place)?)),
            None => three([X, Y, Z], false)?.map(Place::Local),
        };
        record.place_sigma_m = three([X, Y, Z], true)?;
        record.velocity_m_s = three([VelocityX, VelocityY, VelocityZ], false)?;
        record.velocity_sigma_m_s = three([VelocityX, VelocityY, VelocityZ], true)?;
        let degrees = |quantity, sigma| value(quantity, sigma).map(|v| v.map(f64::to_degrees));
        let (yaw, heading) = (degrees(Yaw, false)?, degrees(Heading, false)?);
        let (roll_deg, pitch_deg) = (degrees(Roll, false)?, degrees(Pitch, false)?);
        record.attitude = match (yaw, heading) {
            (Some(yaw), _) => Some(Attitude {
                roll_deg,
                pitch_deg: pitch_deg.map(|pitch| -pitch),
                azimuth_deg: (90.0 - yaw).rem_euclid(360.0),
            }),
            (None, Some(azimuth_deg)) => Some(Attitude {
                roll_deg,
                pitch_deg,
                azimuth_deg,
            }),
            (None, None) => None,
        };
        let turned = degrees(Yaw, true)?.or(degrees(Heading, true)?);
        if let (Some(roll), Some(pitch), Some(heading)) =
            (degrees(Roll, true)?, degrees(Pitch, true)?, turned)
        {
            record.attitude_sigma_deg = Some([roll, pitch, heading]);
        }
        Ok(record)
    }
}

/// Position from longitude and latitude in radians and height in metres.
fn geodetic(place: DVec3) -> Result<Geodetic, String> {
    let (longitude_deg, latitude_deg) = (place.x.to_degrees(), place.y.to_degrees());
    // The eighth decimal may have been rounded up at a pole or the date line.
    let (longest, highest) = (180.0 + 1e-8, 90.0 + 1e-8);
    match longitude_deg.abs() <= longest && latitude_deg.abs() <= highest {
        true => Ok(Geodetic {
            latitude_deg: latitude_deg.clamp(-90.0, 90.0),
            longitude_deg: longitude_deg.clamp(-180.0, 180.0),
            height_m: place.z,
        }),
        false => Err(format!(
            "latitude {latitude_deg} deg, longitude {longitude_deg} deg: expected -90 to 90 deg and -180 to 180 deg"
        )),
    }
}

/// Unwrapping of seconds of the day or of the GPS week.
#[derive(Default)]
struct Wrapping {
    last_s: Option<f64>,
    added_s: f64,
}

impl Wrapping {
    /// Largest distance of a restart from the end and the start of a day or week, seconds.
    const NEAR_S: f64 = 600.0;

    /// Add the days or weeks passed to a time. Returns a remark where seconds start again.
    fn follow(&mut self, seconds: &mut f64) -> Option<&'static str> {
        let last_s = self.last_s.replace(*seconds);
        let began = (0.0..Self::NEAR_S).contains(seconds);
        let ended = |length_s: f64| {
            let near = length_s - Self::NEAR_S..length_s + 1.0;
            began && last_s.is_some_and(|last_s| near.contains(&last_s))
        };
        let (length_s, remark) = match (ended(WEEK_S), ended(DAY_S)) {
            (true, _) => (
                WEEK_S,
                "times restart at 604800 s: read as seconds of the GPS week, continued in the next week",
            ),
            (_, true) => (
                DAY_S,
                "times restart at 86400 s: read as seconds of the day, continued in the next day",
            ),
            _ => {
                *seconds += self.added_s;
                return None;
            }
        };
        self.added_s += length_s;
        *seconds += self.added_s;
        Some(remark)
    }
}

/// Whether a line is a comment or empty.
pub(crate) fn is_idle(line: &str) -> bool {
    let text = line.trim_start_matches('\u{feff}').trim();
    text.is_empty() || text.starts_with('#')
}

/// Reason why a CSV file is refused.
pub(crate) enum Refused {
    Io(io::Error),
    Header(String),
}

/// Pass every record of a stream to `take`.
pub(crate) fn each(
    mut stream: impl BufRead,
    take: &mut dyn FnMut(Record),
) -> Result<ReadReport, Refused> {
    let mut account = ReadReport {
        clock: Clock::Own,
        ..ReadReport::default()
    };
    let mut header: Option<Header> = None;
    let mut clock = Wrapping::default();
    let mut bytes = Vec::new();
    for line in 1.. {
        bytes.clear();
        let mut limited = stream.by_ref().take(LONGEST_LINE);
        let count_bytes = limited.read_until(b'\n', &mut bytes).map_err(Refused::Io)? as u64;
        if count_bytes == 0 {
            break;
        }
        let byte = account.bytes;
        account.bytes += count_bytes;
        let text = std::str::from_utf8(&bytes);
        let record = match (text, &header) {
            _ if count_bytes == LONGEST_LINE && bytes.last() != Some(&b'\n') => {
                Err(format!("expected a line of less than {LONGEST_LINE} bytes"))
            }
            (Err(_), _) => Err("expected UTF-8 text".to_owned()),
            (Ok(text), _) if is_idle(text) => continue,
            (Ok(text), None) => {
                let parsed = Header::parse(text).map_err(Refused::Header)?;
                if !parsed.others.is_empty() {
                    account.note(&format!("columns ignored: {}", parsed.others.join(", ")));
                }
                header = Some(parsed);
                continue;
            }
            (Ok(text), Some(header)) => header.record(text, byte),
        };
        match record {
            Ok(mut record) => {
                count(&mut account.read, Kind::Csv.name());
                if let Some(remark) = clock.follow(&mut record.time.seconds) {
                    account.doubt(remark);
                }
                take(record);
            }
            Err(description) => {
                account.lost_bytes += count_bytes;
                account.fault(Fault {
                    byte,
                    line: Some(line),
                    wrong: Wrong::Value,
                    description,
                });
            }
        }
    }
    match header {
        Some(_) => Ok(account),
        None => Err(Refused::Header(
            "expected a line with the names of columns, found none".to_owned(),
        )),
    }
}
