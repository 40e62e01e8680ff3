//! Comma-separated values whose header names units.
//!
//! The first line that is no comment (`#`) names the columns, in any order; a name and its unit are written `time_s`, `time [s]` or `time (s)`:
//!
//! | column | is | unit, for example |
//! |---|---|---|
//! | `time` | seconds of a clock of the log's own; needed | `s`, `ms`, `us` |
//! | `latitude`, `longitude` (or `lat`, `lon`) | place on the Earth (WGS 84) | `deg`, `rad` |
//! | `height` (or `altitude`) | above the ellipsoid | `m`, `km` |
//! | `x`, `y`, `z` (or `east`, `north`, `up`) | place in axes of its own, instead | `m`, `cm`, `mm` |
//! | `velocity_x`, `velocity_y`, `velocity_z` (or `_east`, `_north`, `_up`) | velocity | `m_s`, `km_h`, `m/s` in brackets |
//! | `roll`, `pitch`, `yaw` | turns about x forward, y left, z up, right-handed, as of all tracks here: pitch lowers the nose, yaw goes from x (east) to y (north) | `deg`, `rad` |
//! | `roll`, `pitch`, `heading` (or `azimuth`) | as navigators have it: pitch raises the nose, heading is clockwise from north | `deg`, `rad` |
//! | `sigma_` and any of these | its standard deviation | as of that |
//!
//! Units are all those of their dimension (`units`). Columns of other names are passed over, and told. Rows that lack a value or have one that is no
//! number are counted, never fatal. Seconds of the day or of the GPS week that begin again go on in the next one ([`ReadReport::doubts`]).

use std::io::{self, BufRead, Read};

use glam::DVec3;

use subaperture_model::geometry::Geodetic;
use subaperture_model::units::Dimension;

use crate::account::{Clock, Fault, ReadReport, Wrong, count};
use crate::time::{DAY_S, WEEK_S};
use crate::{Attitude, GpsTime, Kind, Place, Record};

/// Bytes a line may have.
const LONGEST_LINE: u64 = 4096;

/// Farthest that a place may lie from the origin, metres, and longest a time, seconds.
const FARTHEST: f64 = 1e9;

/// What a column is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
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

use What::{
    Heading, Height, Latitude, Longitude, Pitch, Roll, Time, VelocityX, VelocityY, VelocityZ, X, Y,
    Yaw, Z,
};

/// Names of columns; those that begin as others do come first.
const NAMES: [(&str, What, Dimension); 27] = [
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

/// A column that is read.
struct Column {
    at: usize,
    what: What,
    sigma: bool,
    /// Its unit in SI units.
    unit: f64,
}

/// Columns that are read, and how many there are.
pub(crate) struct Header {
    columns: Vec<Column>,
    count: usize,
    others: Vec<String>,
}

/// A name and its unit, which may be empty.
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
            // Letters of units are as they were written: the case of ASCII keeps their places.
            let written = cell[cell.len() - unit.len()..].replace('_', "/");
            (lower[..length].to_owned(), written)
        }
        None => (lower.clone(), String::new()),
    }
}

impl Header {
    /// Of a line; an error says what is missing.
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
            let Some(&(_, what, dimension)) = NAMES.iter().find(|(known, ..)| *known == plain)
            else {
                header.others.push((*cell).to_owned());
                continue;
            };
            let unit = dimension
                .parse(&format!("1 {unit}"))
                .map_err(|why| format!("column '{cell}': {why}"))?;
            if header.find(what, sigma).is_some() {
                return Err(format!("column '{cell}': this is said twice"));
            }
            header.columns.push(Column {
                at,
                what,
                sigma,
                unit,
            });
        }
        let has = |what| header.find(what, false).is_some();
        let all = |whats: &[What], names: &str| match whats.iter().filter(|&&w| has(w)).count() {
            0 => Ok(false),
            n if n == whats.len() => Ok(true),
            _ => Err(format!("give all of {names}, or none")),
        };
        if !has(Time) {
            return Err("no column of time, such as time_s".to_owned());
        }
        let earth = all(
            &[Latitude, Longitude, Height],
            "latitude, longitude and height",
        )?;
        let local = all(&[X, Y, Z], "x, y and z")?;
        if earth == local {
            return Err(match earth {
                true => "places are given twice: on the Earth, and as x, y and z",
                false => "no place: give latitude, longitude and height, or x, y and z, each with its unit",
            }
            .to_owned());
        }
        all(
            &[VelocityX, VelocityY, VelocityZ],
            "three parts of the velocity",
        )?;
        if has(Yaw) && has(Heading) {
            return Err("give yaw or heading, not both".to_owned());
        }
        if all(&[Roll, Pitch], "roll and pitch")? && !has(Yaw) && !has(Heading) {
            return Err("roll and pitch without yaw or heading".to_owned());
        }
        Ok(header)
    }

    fn find(&self, what: What, sigma: bool) -> Option<&Column> {
        let mut columns = self.columns.iter();
        columns.find(|column| column.what == what && column.sigma == sigma)
    }

    fn record(&self, row: &str, byte: u64) -> Result<Record, String> {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != self.count {
            return Err(format!(
                "{} values; the header names {} columns",
                cells.len(),
                self.count
            ));
        }
        // A value that is empty is not known.
        let value = |what, sigma| -> Result<Option<f64>, String> {
            let Some(column) = self.find(what, sigma) else {
                return Ok(None);
            };
            let cell = cells[column.at];
            if cell.is_empty() {
                return Ok(None);
            }
            let number = cell.parse::<f64>().map(|number| number * column.unit).ok();
            let least = if sigma { 0.0 } else { -FARTHEST };
            match number.filter(|number| (least..=FARTHEST).contains(number)) {
                Some(number) => Ok(Some(number)),
                None => Err(format!("value {} is '{cell}'", column.at + 1)),
            }
        };
        let three = |whats: [What; 3], sigma| -> Result<Option<DVec3>, String> {
            let [a, b, c] = [
                value(whats[0], sigma)?,
                value(whats[1], sigma)?,
                value(whats[2], sigma)?,
            ];
            Ok(a.zip(b).zip(c).map(|((a, b), c)| DVec3::new(a, b, c)))
        };
        let time = value(Time, false)?.ok_or("no time")?;
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
        let degrees = |what, sigma| value(what, sigma).map(|v| v.map(f64::to_degrees));
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

/// From longitude and latitude, radians, and height.
fn geodetic(place: DVec3) -> Result<Geodetic, String> {
    let (longitude_deg, latitude_deg) = (place.x.to_degrees(), place.y.to_degrees());
    // Of a place at a pole or the date line an eighth digit may be rounded up.
    let (longest, highest) = (180.0 + 1e-8, 90.0 + 1e-8);
    match longitude_deg.abs() <= longest && latitude_deg.abs() <= highest {
        true => Ok(Geodetic {
            latitude_deg: latitude_deg.clamp(-90.0, 90.0),
            longitude_deg: longitude_deg.clamp(-180.0, 180.0),
            height_m: place.z,
        }),
        false => Err(format!(
            "latitude {latitude_deg} deg, longitude {longitude_deg} deg"
        )),
    }
}

/// A clock whose seconds may be of the day or of the GPS week.
#[derive(Default)]
struct Wrapping {
    last_s: Option<f64>,
    added_s: f64,
}

impl Wrapping {
    /// Seconds near the end of a day or week, and near the beginning of one.
    const NEAR_S: f64 = 600.0;

    /// Makes a time go on where seconds begin again; says so then.
    fn follow(&mut self, seconds: &mut f64) -> Option<&'static str> {
        let last_s = self.last_s.replace(*seconds);
        let began = (0.0..Self::NEAR_S).contains(seconds);
        let ended = |length_s: f64| {
            let near = length_s - Self::NEAR_S..length_s + 1.0;
            began && last_s.is_some_and(|last_s| near.contains(&last_s))
        };
        let (length_s, what) = match (ended(WEEK_S), ended(DAY_S)) {
            (true, _) => (
                WEEK_S,
                "times fall at 604800 s: they are taken for seconds of the GPS week, and go on in the next one",
            ),
            (_, true) => (
                DAY_S,
                "times fall at 86400 s: they are taken for seconds of the day, and go on in the next one",
            ),
            _ => {
                *seconds += self.added_s;
                return None;
            }
        };
        self.added_s += length_s;
        *seconds += self.added_s;
        Some(what)
    }
}

/// Whether a line is a comment or empty.
pub(crate) fn is_idle(line: &str) -> bool {
    let text = line.trim_start_matches('\u{feff}').trim();
    text.is_empty() || text.starts_with('#')
}

/// Why a file of values was not read.
pub(crate) enum Refused {
    Io(io::Error),
    Header(String),
}

/// Hands every record of a stream to `take`.
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
        let said = match (text, &header) {
            _ if count_bytes == LONGEST_LINE && bytes.last() != Some(&b'\n') => {
                Err(format!("{LONGEST_LINE} bytes or more"))
            }
            (Err(_), _) => Err("not text".to_owned()),
            (Ok(text), _) if is_idle(text) => continue,
            (Ok(text), None) => {
                let parsed = Header::parse(text).map_err(Refused::Header)?;
                if !parsed.others.is_empty() {
                    account.note(&format!(
                        "columns passed over: {}",
                        parsed.others.join(", ")
                    ));
                }
                header = Some(parsed);
                continue;
            }
            (Ok(text), Some(header)) => header.record(text, byte),
        };
        match said {
            Ok(mut record) => {
                count(&mut account.read, Kind::Csv.name());
                if let Some(what) = clock.follow(&mut record.time.seconds) {
                    account.doubt(what);
                }
                take(record);
            }
            Err(what) => {
                account.lost_bytes += count_bytes;
                account.fault(Fault {
                    byte,
                    line: Some(line),
                    wrong: Wrong::Value,
                    what,
                });
            }
        }
    }
    match header {
        Some(_) => Ok(account),
        None => Err(Refused::Header("no line that names columns".to_owned())),
    }
}
