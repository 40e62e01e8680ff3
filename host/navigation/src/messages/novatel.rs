//! NovAtel records of position, velocity, attitude and events.
//!
//! Fields and their order are those of the OEM7 Commands and Logs Reference Manual. Binary fields are little-endian and packed:
//!
//! | record | number | fields (d 8 bytes, f 4 bytes, u whole of 4 bytes, e enumeration of 4 bytes) | height above |
//! |---|---|---|---|
//! | `INSPVA`, `INSPVAS` | 507, 508 | u week, d seconds, d latitude, d longitude, d height, 3 d velocity (north, east, up), 3 d roll, pitch, azimuth, e status | the ellipsoid |
//! | `INSPVAX` | 1465 | e status, e type, 3 d latitude, longitude, height, f undulation, 3 d velocity, 3 d roll, pitch, azimuth, 9 f their standard deviations | mean sea level |
//! | `BESTPOS`, `MARKPOS` | 42, 181 | e status, e type, 3 d latitude, longitude, height, f undulation, e datum, 3 f standard deviations | mean sea level |
//! | `BESTVEL` | 99 | e status, e type, f latency, f age, d speed over ground, d direction over ground, d speed upwards | |
//! | `MARKTIME` | 231 | u week, d seconds, d offset, d its standard deviation, d UTC less GPS time, e status of the clock | |
//!
//! Later fields are ignored. Heights are converted to ellipsoidal ones (mean sea level plus undulation). `INSPVA` and `MARKTIME` state their own time; other
//! records have that of their header, in binary ones in whole milliseconds, 3 cm at 30 m/s. The time of a velocity is corrected by its latency. Records
//! without a solution status, or with an unknown time in their header, are counted as unsolved.

use glam::DVec3;

use subaperture_model::geometry::Geodetic;

use super::body::{Body, Bytes, Named, Text};
use super::frame::Message;
use crate::time::WEEK_S;
use crate::{Attitude, GpsTime, Kind, Place, Record};

/// States of an inertial solution in which position and attitude are good.
const INERTIAL: [Named; 4] = [
    (2, "INS_HIGH_VARIANCE"),
    (3, "INS_SOLUTION_GOOD"),
    (6, "INS_SOLUTION_FREE"),
    (7, "INS_ALIGNMENT_COMPLETE"),
];
const COMPUTED: [Named; 1] = [(0, "SOL_COMPUTED")];
const WGS84: [Named; 1] = [(61, "WGS84")];
const CLOCK_VALID: [Named; 1] = [(0, "VALID")];

/// Time status of a header with an unknown time.
const TIME_UNKNOWN: u8 = 20;

/// Record, and UTC minus GPS time in seconds if it states that; `None` without a solution.
pub(super) type Parsed = Option<(Record, Option<f64>)>;

/// Time in a header; `None` if it is unknown.
type Header = Option<GpsTime>;

/// Kind of a message by its name or number, and its name; the error is the name of another message.
fn known(message: &Message<'_>) -> Result<(Kind, &'static str), String> {
    const KINDS: [(u16, &str, Kind); 9] = [
        (507, "INSPVA", Kind::Inspva),
        (508, "INSPVAS", Kind::Inspva),
        (1465, "INSPVAX", Kind::Inspvax),
        (42, "BESTPOS", Kind::Bestpos),
        (99, "BESTVEL", Kind::Bestvel),
        (181, "MARKPOS", Kind::Markpos),
        (615, "MARK2POS", Kind::Markpos),
        (231, "MARKTIME", Kind::Marktime),
        (616, "MARK2TIME", Kind::Marktime),
    ];
    match *message {
        Message::Text { text, .. } | Message::Abbreviated { text, .. } => {
            let name = text.split([',', ';']).next().unwrap_or_default();
            // ASCII names end in A; names of records with short headers may have an S before it.
            let plain = name.strip_suffix('A').unwrap_or(name);
            let same = |name: &str| plain == name || plain.strip_suffix('S') == Some(name);
            let found = KINDS.iter().find(|(_, name, _)| same(name));
            let found = found.map(|&(_, name, kind)| (kind, name));
            found.ok_or_else(|| name.to_owned())
        }
        Message::Binary { header, .. } => {
            let id = u16::from_le_bytes([header[4], header[5]]);
            let found = KINDS.iter().find(|(number, ..)| *number == id);
            let found = found.map(|&(_, name, kind)| (kind, name));
            found.ok_or_else(|| format!("message {id}"))
        }
        Message::Nmea { .. } => Err("NMEA".to_owned()),
    }
}

/// Name of a message and its parsed record: `None` for a kind that is not read, an error for an impossible value.
pub(super) fn parse(message: &Message<'_>, byte: u64) -> (String, Option<Result<Parsed, String>>) {
    let (kind, name) = match known(message) {
        Ok(known) => known,
        Err(name) => return (name, None),
    };
    let parsed = match *message {
        Message::Text { long, text } | Message::Abbreviated { long, text } => {
            text_header(long, text)
                .and_then(|(header, body)| record(kind, byte, header, &mut Text(body.split(','))))
        }
        Message::Binary { long, header, body } => binary_header(long, header)
            .and_then(|header| record(kind, byte, header, &mut Bytes(body))),
        Message::Nmea { .. } => return (name.to_owned(), None),
    };
    let named = parsed.map_err(|error| format!("{name}: {error}"));
    (name.to_owned(), Some(named))
}

fn text_header(long: bool, text: &str) -> Result<(Header, &str), String> {
    let (header, body) = text
        .split_once(';')
        .ok_or("expected ; after the header, found none")?;
    let expected = if long { 10 } else { 3 };
    let count = header.split(',').count();
    if count != expected {
        return Err(format!(
            "the header has {count} fields, expected {expected}"
        ));
    }
    let mut fields = header.split(',');
    let status = fields.nth(if long { 4 } else { 0 });
    if status == Some("UNKNOWN") {
        return Ok((None, body));
    }
    let time = time(&mut Text(fields)).map_err(|error| format!("header: {error}"))?;
    Ok((Some(time), body))
}

fn binary_header(long: bool, header: &[u8]) -> Result<Header, String> {
    let at = if long { 14 } else { 6 };
    let week = u16::from_le_bytes([header[at], header[at + 1]]);
    let ms = [2, 3, 4, 5].map(|n| header[at + n]);
    let seconds = f64::from(u32::from_le_bytes(ms)) / 1e3;
    if long && header[13] == TIME_UNKNOWN {
        return Ok(None);
    }
    Ok(Some(GpsTime {
        week: week.into(),
        seconds: within("seconds of the header", seconds, 0.0, WEEK_S)?,
    }))
}

fn time(body: &mut impl Body) -> Result<GpsTime, String> {
    Ok(GpsTime {
        week: match body.whole("week")? {
            week @ 0..=99_999 => week,
            week => return Err(format!("week is {week}, expected up to 99999")),
        },
        seconds: within("seconds", body.double("seconds")?, 0.0, WEEK_S)?,
    })
}

fn within(quantity: &str, value: f64, from: f64, to: f64) -> Result<f64, String> {
    let sound = (from..=to).contains(&value).then_some(value);
    sound.ok_or_else(|| format!("{quantity} is {value}, expected {from} to {to}"))
}

/// Latitude, longitude and height.
fn place(body: &mut impl Body) -> Result<Geodetic, String> {
    Ok(Geodetic {
        latitude_deg: within("latitude", body.double("latitude")?, -90.0, 90.0)?,
        longitude_deg: within("longitude", body.double("longitude")?, -180.0, 180.0)?,
        height_m: within("height", body.double("height")?, -1e5, 1e8)?,
    })
}

/// Latitude, longitude, height above mean sea level and undulation.
fn place_above_sea(body: &mut impl Body) -> Result<Place, String> {
    let above_sea = place(body)?;
    let undulation_m = within("undulation", body.single("undulation")?, -200.0, 200.0)?;
    Ok(Place::Earth(Geodetic {
        height_m: above_sea.height_m + undulation_m,
        ..above_sea
    }))
}

/// Velocity along east, north and up, from north, east and up.
fn velocity(body: &mut impl Body) -> Result<DVec3, String> {
    let mut along = |axis| within(axis, body.double(axis)?, -1e5, 1e5);
    let (north, east) = (along("velocity north")?, along("velocity east")?);
    Ok(DVec3::new(east, north, along("velocity up")?))
}

/// Velocity along east, north and up, from speed, direction clockwise from north, and upward speed.
fn over_ground(body: &mut impl Body) -> Result<DVec3, String> {
    let speed = within("speed", body.double("speed")?, 0.0, 1e5)?;
    let direction = within("direction", body.double("direction")?, -360.0, 360.0)?;
    let up = within("speed upwards", body.double("speed upwards")?, -1e5, 1e5)?;
    let (sin, cos) = libm::sincos(direction.to_radians());
    Ok(DVec3::new(speed * sin, speed * cos, up))
}

/// Time `by_s` seconds earlier; weeks are not negative.
fn earlier(time: GpsTime, by_s: f64) -> GpsTime {
    let seconds = time.seconds - by_s;
    match (seconds < 0.0, time.week.checked_sub(1)) {
        (true, Some(week)) => GpsTime {
            week,
            seconds: seconds + WEEK_S,
        },
        _ => GpsTime { seconds, ..time },
    }
}

fn attitude(body: &mut impl Body) -> Result<Attitude, String> {
    let mut angle = |name| within(name, body.double(name)?, -360.0, 360.0);
    Ok(Attitude {
        roll_deg: Some(angle("roll")?),
        pitch_deg: Some(angle("pitch")?),
        azimuth_deg: angle("azimuth")?,
    })
}

/// Three standard deviations.
fn sigmas(body: &mut impl Body, quantity: &str) -> Result<[f64; 3], String> {
    let name = format!("standard deviation of {quantity}");
    let mut next = || within(&name, body.single(&name)?, 0.0, 1e6);
    Ok([next()?, next()?, next()?])
}

/// Reorder north, east, up (latitude, longitude, height) to east, north, up.
fn east_first([north, east, up]: [f64; 3]) -> DVec3 {
    DVec3::new(east, north, up)
}

fn record(kind: Kind, byte: u64, header: Header, body: &mut impl Body) -> Result<Parsed, String> {
    let Some(mut time) = header else {
        return Ok(None);
    };
    // Records that state their own time.
    if let Kind::Inspva | Kind::Marktime = kind {
        time = self::time(body)?;
    }
    let mut record = Record::at(byte, kind, time);
    let mut utc_s = None;
    match kind {
        Kind::Marktime => {
            for field in ["offset", "standard deviation of the offset"] {
                body.double(field)?;
            }
            let field = "offset of UTC";
            utc_s = Some(within(field, body.double(field)?, -1e3, 1e3)?);
            if body.state("status", &CLOCK_VALID)?.is_none() {
                return Ok(None);
            }
        }
        Kind::Bestvel => {
            if body.state("status", &COMPUTED)?.is_none() {
                return Ok(None);
            }
            body.state("type", &[])?;
            let late_s = within("latency", body.single("latency")?, 0.0, 10.0)?;
            body.single("age")?;
            record.velocity_m_s = Some(over_ground(body)?);
            record.time = earlier(record.time, late_s);
        }
        Kind::Inspva => {
            record.place = Some(Place::Earth(place(body)?));
            record.velocity_m_s = Some(velocity(body)?);
            record.attitude = Some(attitude(body)?);
            if body.state("status", &INERTIAL)?.is_none() {
                return Ok(None);
            }
        }
        Kind::Inspvax => {
            if body.state("status", &INERTIAL)?.is_none() {
                return Ok(None);
            }
            body.state("type", &[])?;
            record.place = Some(place_above_sea(body)?);
            record.velocity_m_s = Some(velocity(body)?);
            record.attitude = Some(attitude(body)?);
            record.place_sigma_m = Some(east_first(sigmas(body, "position")?));
            record.velocity_sigma_m_s = Some(east_first(sigmas(body, "velocity")?));
            record.attitude_sigma_deg = Some(sigmas(body, "attitude")?);
        }
        _ => {
            if body.state("status", &COMPUTED)?.is_none() {
                return Ok(None);
            }
            body.state("type", &[])?;
            record.place = Some(place_above_sea(body)?);
            if body.state("datum", &WGS84)?.is_none() {
                return Err("expected the datum WGS84, found another one".to_owned());
            }
            record.place_sigma_m = Some(east_first(sigmas(body, "position")?));
        }
    }
    Ok(Some((record, utc_s)))
}
