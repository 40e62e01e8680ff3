//! One line of a log: its CRC, header and fields.

use super::track::Attitude;
use super::{GpsTime, Record, Source};
use subaperture_model::geometry::Geodetic;

/// Fields of a long header.
const HEADER_FIELDS: usize = 10;

/// States of an inertial solution in which position and attitude are good.
const INERTIAL_SOLUTIONS: [&str; 4] = [
    "INS_SOLUTION_GOOD",
    "INS_HIGH_VARIANCE",
    "INS_SOLUTION_FREE",
    "INS_ALIGNMENT_COMPLETE",
];

/// A line whose CRC is right.
pub(super) struct Checked<'a> {
    /// Whether the header is the long one.
    long: bool,
    /// The text between the first character and the `*`.
    text: &'a str,
}

/// What a line says.
pub(super) enum Parsed {
    Record(Record),
    Unsolved,
    Other(String),
}

/// The CRC of the text between `#` and `*`.
fn crc(text: &[u8]) -> u32 {
    // The usual CRC-32 complements its state at both ends; beginning with the complement of 0 and
    // complementing the result leaves neither.
    let mut hasher = crc32fast::Hasher::new_with_initial(!0);
    hasher.update(text);
    !hasher.finalize()
}

/// Finds the text of a line and checks its CRC.
pub(super) fn checked(line: &[u8]) -> Result<Checked<'_>, String> {
    let (long, rest) = match line {
        [b'#', rest @ ..] => (true, rest),
        [b'%', rest @ ..] => (false, rest),
        _ => return Err("not a record: it begins with neither # nor %".to_owned()),
    };
    let Some(star) = rest.iter().rposition(|&b| b == b'*') else {
        return Err("a record without its end: no * and CRC".to_owned());
    };
    let (text, given) = (&rest[..star], &rest[star + 1..]);
    let value = |given: &str| {
        let digits = given.len() == 8 && given.bytes().all(|b| b.is_ascii_hexdigit());
        digits.then(|| u32::from_str_radix(given, 16).ok())?
    };
    let Some(given) = std::str::from_utf8(given).ok().and_then(value) else {
        return Err("a record whose CRC is not eight hexadecimal digits".to_owned());
    };
    let computed = crc(text);
    if given != computed {
        return Err(format!(
            "damaged: its CRC is {given:08x}, that of its text {computed:08x}; read it with damaged lines \
             skipped, or transfer the log again"
        ));
    }
    match std::str::from_utf8(text) {
        Ok(text) if text.is_ascii() => Ok(Checked { long, text }),
        _ => Err("a record with characters other than ASCII".to_owned()),
    }
}

/// Parses a line; `number` is its own.
pub(super) fn parse(line: &Checked<'_>, number: u64) -> Result<Parsed, String> {
    let name = line.text.split([',', ';']).next().unwrap_or_default();
    let (source, expected) = match (line.long, name) {
        (true, "INSPVAA") => (Source::Inspva, 12),
        (true, "INSPVAXA") => (Source::Inspvax, 23),
        (true, "BESTPOSA") => (Source::Bestpos, 21),
        _ => return Ok(Parsed::Other(name.to_owned())),
    };
    let Some((header, body)) = line.text.split_once(';') else {
        return Err(format!("{name} without a ; after its header"));
    };
    let header: Vec<&str> = header.split(',').collect();
    let body: Vec<&str> = body.split(',').collect();
    if header.len() != HEADER_FIELDS || body.len() != expected {
        return Err(format!(
            "{name} with {} header fields and {} of its own; {HEADER_FIELDS} and {expected} are expected",
            header.len(),
            body.len()
        ));
    }
    let fields = Fields { name, body: &body };
    let solved = match source {
        Source::Inspva => INERTIAL_SOLUTIONS.contains(&body[11]),
        Source::Inspvax => INERTIAL_SOLUTIONS.contains(&body[0]),
        Source::Bestpos => body[0] == "SOL_COMPUTED",
    };
    if !solved || header[4] == "UNKNOWN" {
        return Ok(Parsed::Unsolved);
    }
    let inertial = |velocity: usize, angles: usize| -> Result<_, String> {
        Ok((
            Some(fields.three("velocity", velocity)?),
            Some(fields.attitude(angles)?),
        ))
    };
    let (time, place, (velocity_m_s, attitude)) = match source {
        Source::Inspva => (
            fields.time(body[0], body[1])?,
            fields.place(2, None)?,
            inertial(5, 8)?,
        ),
        Source::Inspvax => (
            fields.time(header[5], header[6])?,
            fields.place(2, Some(5))?,
            inertial(6, 9)?,
        ),
        Source::Bestpos => {
            if body[6] != "WGS84" {
                return Err(format!("{name} in datum {}; only WGS84 is read", body[6]));
            }
            (
                fields.time(header[5], header[6])?,
                fields.place(2, Some(5))?,
                (None, None),
            )
        }
    };
    Ok(Parsed::Record(Record {
        line: number,
        source,
        time,
        place,
        velocity_m_s,
        attitude,
    }))
}

/// The fields of a record's body.
struct Fields<'a> {
    name: &'a str,
    body: &'a [&'a str],
}

impl Fields<'_> {
    fn number(&self, what: &str, text: &str, from: f64, to: f64) -> Result<f64, String> {
        match text.parse::<f64>() {
            Ok(value) if (from..=to).contains(&value) => Ok(value),
            _ => Err(format!(
                "{} with {what} '{text}'; a number from {from} to {to} is expected",
                self.name
            )),
        }
    }

    fn time(&self, week: &str, seconds: &str) -> Result<GpsTime, String> {
        let Ok(week) = week.parse() else {
            return Err(format!("{} in GPS week '{week}'", self.name));
        };
        Ok(GpsTime {
            week,
            seconds: self.number("seconds", seconds, 0.0, 604_800.0)?,
        })
    }

    /// Latitude, longitude and height from field `n` on; the height is above mean sea level if there is
    /// an undulation.
    fn place(&self, n: usize, undulation: Option<usize>) -> Result<Geodetic, String> {
        let undulation_m = match undulation {
            Some(n) => self.number("undulation", self.body[n], -200.0, 200.0)?,
            None => 0.0,
        };
        Ok(Geodetic {
            latitude_deg: self.number("latitude", self.body[n], -90.0, 90.0)?,
            longitude_deg: self.number("longitude", self.body[n + 1], -180.0, 180.0)?,
            height_m: undulation_m + self.number("height", self.body[n + 2], -1e5, 1e8)?,
        })
    }

    fn three(&self, what: &str, n: usize) -> Result<[f64; 3], String> {
        let number = |n: usize| self.number(what, self.body[n], -1e5, 1e5);
        Ok([number(n)?, number(n + 1)?, number(n + 2)?])
    }

    fn attitude(&self, n: usize) -> Result<Attitude, String> {
        let number = |what, n: usize| self.number(what, self.body[n], -360.0, 360.0);
        Ok(Attitude {
            roll_deg: number("roll", n)?,
            pitch_deg: number("pitch", n + 1)?,
            azimuth_deg: number("azimuth", n + 2)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{Damage, Log, NovatelError, read_from};
    use super::*;

    /// The CRC bit by bit, as the manual defines it.
    fn plain_crc(text: &str) -> u32 {
        text.bytes().fold(0, |crc, byte| {
            (0..8).fold(crc ^ u32::from(byte), |c, _| {
                (c >> 1) ^ if c & 1 == 1 { 0xEDB8_8320 } else { 0 }
            })
        })
    }

    fn signed(text: &str) -> String {
        format!("#{text}*{:08x}\r\n", plain_crc(text))
    }

    const HEADER: &str = "COM1,0,58.5,FINESTEERING,2209,502061.000,02000020,18bc,16809";

    fn inspva() -> String {
        format!(
            "INSPVAA,{HEADER};2209,502061.125,51.15043711111,-114.03067932,1081.0036,1.5,-2.0,0.25,\
             3.0,-1.5,270.0,INS_SOLUTION_GOOD"
        )
    }

    fn bestpos() -> String {
        format!(
            "BESTPOSA,{HEADER};SOL_COMPUTED,PSRDIFF,51.15043699323,-114.03067932462,1097.6855,-17.0,\
             WGS84,0.4,0.4,0.8,\"AAAA\",6.0,0.0,47,35,35,33,00,06,39,33"
        )
    }

    fn log(text: &str, damage: Damage) -> Result<Log, NovatelError> {
        read_from(text.as_bytes(), Path::new("drive.asc"), damage)
    }

    #[test]
    fn records_are_read_with_ellipsoidal_heights() {
        let text = signed(&inspva()) + "\r\n" + &signed(&bestpos()) + &signed("TIMEA,x;y");
        let log = log(&text, Damage::Refuse).unwrap();
        let [ins, best] = log.records[..] else {
            panic!("{log:?}");
        };
        assert_eq!((ins.source, ins.line), (Source::Inspva, 1));
        // The record's own time, not its header's.
        assert_eq!(ins.time.seconds, 502_061.125);
        assert_eq!(ins.place.height_m, 1081.0036);
        assert_eq!(ins.velocity_m_s, Some([1.5, -2.0, 0.25]));
        assert_eq!(ins.attitude.unwrap().azimuth_deg, 270.0);
        assert_eq!((best.source, best.line), (Source::Bestpos, 3));
        assert!((best.place.height_m - 1080.6855).abs() < 1e-12);
        assert_eq!(best.place.longitude_deg, -114.030_679_324_62);
        assert_eq!(best.attitude, None);
        assert_eq!(best.time.since(ins.time), -0.125);
        assert_eq!(log.skipped["TIMEA"], 1);
    }

    #[test]
    fn damaged_lines_are_refused_or_counted() {
        let good = signed(&inspva());
        for (bad, what) in [
            (good.replace("51.15", "51.16"), "damaged: its CRC is"),
            (good.replace('#', ""), "begins with neither"),
            (good[..60].to_owned() + "\n", "without its end"),
            (format!("#{}*12\n", inspva()), "eight hexadecimal"),
            ("\u{fffd}\n".to_owned(), "begins with neither"),
        ] {
            let text = good.clone() + &bad + &good;
            let error = log(&text, Damage::Refuse).unwrap_err().to_string();
            assert!(error.starts_with("drive.asc, line 2: "), "{error}");
            assert!(error.contains(what), "{error}");
            let log = log(&text, Damage::Skip).unwrap();
            assert_eq!((log.records.len(), log.damaged), (2, 1));
        }
        // A line without an end is taken in pieces, none of them a record.
        let endless = "#".repeat(200_000);
        assert!(log(&endless, Damage::Refuse).is_err());
    }

    #[test]
    fn records_that_are_whole_but_wrong_are_refused_with_their_field() {
        for (from, to, what) in [
            ("51.15043711111", "91.0", "latitude '91.0'"),
            ("1081.0036", "NaN", "height 'NaN'"),
            ("2209,502061.125", "-1,502061.125", "week '-1'"),
            ("502061.125", "604801", "seconds '604801'"),
            ("270.0", "", "azimuth ''"),
            (",270.0", "", "11 of its own; 10 and 12"),
            (";", ",", "without a ;"),
        ] {
            let error = log(&signed(&inspva().replace(from, to)), Damage::Skip);
            let error = error.unwrap_err().to_string();
            assert!(error.contains("line 1") && error.contains(what), "{error}");
        }
        let datum = bestpos().replace("WGS84", "USER");
        assert!(log(&signed(&datum), Damage::Refuse).is_err());
    }

    #[test]
    fn records_without_a_solution_are_counted() {
        let text = signed(&inspva().replace("INS_SOLUTION_GOOD", "INS_ALIGNING"))
            + &signed(&bestpos().replace("SOL_COMPUTED", "INSUFFICIENT_OBS"))
            + &signed(&bestpos().replace("FINESTEERING", "UNKNOWN"));
        let log = log(&text, Damage::Refuse).unwrap();
        assert_eq!((log.records.len(), log.unsolved), (0, 3));
    }
}
