//! NMEA 0183: the sentences of one moment as one record.
//!
//! | sentence | says |
//! |---|---|
//! | `GGA` | time of day, place, height above mean sea level and the geoid's above the ellipsoid |
//! | `RMC` | time of day, date, place, speed and course |
//! | `ZDA` | time of day, date |
//! | `GST` | time of day, standard deviations of the place |
//! | `VTG` | speed and course |
//! | `HDT` | heading from true north |
//!
//! of any talker. What says no time is of the moment that was stated last. Times are of UTC: where the time of day falls by more than half a
//! day, the next day has begun. Records before the first date are dated backwards from it ([`MOST_UNDATED`] of them; with more, or without a date, times
//! are seconds of the first day: [`Clock::SecondsOfDay`]). A year of two digits is of 1980 to 2079.
//!
//! GPS time is UTC and the leap seconds of that day, from a table that ends with those of 2017.

use glam::DVec3;

use subaperture_model::geometry::Geodetic;

use crate::account::{Account, Clock, count};
use crate::time::{DAY_S, day_number, leap_seconds};
use crate::{Attitude, GpsTime, Kind, Options, Place, Record};

/// Records that wait for a date, at most.
const MOST_UNDATED: usize = 10_000;

/// A knot in metres a second.
const KNOT_M_S: f64 = 1852.0 / 3600.0;

const NO_UNDULATION: &str =
    "heights of GGA are above mean sea level: the geoid's height is not given, and 0 m is taken";
const NO_HEIGHT: &str = "RMC alone gives no height: the last that was given is taken, or 0 m";

/// Sentences as they come, and the records that they make.
#[derive(Default)]
pub(super) struct Sentences {
    /// The moment that is stated now.
    open: Option<Moment>,
    /// Days since the first.
    day: i64,
    /// Which day the first was, since 1 January 1970.
    first_day: Option<i64>,
    /// Those that wait for a date.
    undated: Vec<(i64, f64, Record)>,
    /// There are too many of them.
    given_up: bool,
    height_m: f64,
}

/// What is said of a moment.
struct Moment {
    seconds: f64,
    record: Record,
    has_height: bool,
}

/// What a sentence says.
struct Sentence {
    seconds: Option<f64>,
    date: Option<i64>,
    place: Option<(f64, f64)>,
    /// Above the ellipsoid, and whether the geoid's height was given.
    height_m: Option<(f64, bool)>,
    sigma_m: Option<DVec3>,
    velocity_m_s: Option<DVec3>,
    azimuth_deg: Option<f64>,
    solved: bool,
}

/// Takes records.
type Take<'a> = dyn FnMut(Record) + 'a;

impl Sentences {
    pub(super) fn new(options: &Options) -> Self {
        let date = options.date.and_then(|(y, m, d)| day_number(y, m, d));
        Self {
            first_day: date,
            ..Self::default()
        }
    }

    /// Takes a sentence between `$` and `*`; what is wrong with it in words.
    pub(super) fn push(
        &mut self,
        text: &str,
        byte: u64,
        options: &Options,
        account: &mut Account,
        take: &mut Take<'_>,
    ) -> Result<(), String> {
        let (name, fields) = text.split_once(',').unwrap_or((text, ""));
        let kind = name.get(2..).unwrap_or_default();
        let known = ["GGA", "RMC", "ZDA", "GST", "VTG", "HDT"].contains(&kind);
        if !known || name.len() != 5 || name.starts_with('P') {
            count(&mut account.others, name);
            return Ok(());
        }
        let fields: Vec<&str> = fields.split(',').collect();
        let sentence = parse(kind, &fields).map_err(|what| format!("{name}: {what}"))?;
        if !sentence.solved {
            count(&mut account.unsolved, kind);
            return Ok(());
        }
        if let Some(seconds) = sentence.seconds
            && self
                .open
                .as_ref()
                .is_none_or(|open| open.seconds != seconds)
        {
            let before = self.open.as_ref().map(|open| open.seconds);
            self.close(options, account, take);
            self.day += i64::from(before.is_some_and(|before| seconds < before - DAY_S / 2.0));
            let time = GpsTime { week: 0, seconds };
            self.open = Some(Moment {
                seconds,
                record: Record::at(byte, Kind::Nmea, time),
                has_height: false,
            });
        }
        let Some(open) = &mut self.open else {
            return Err(format!("{name} before any time was stated"));
        };
        count(&mut account.read, kind);
        let record = &mut open.record;
        if let Some((latitude_deg, longitude_deg)) = sentence.place {
            if let Some((height_m, whole)) = sentence.height_m {
                self.height_m = height_m;
                open.has_height = true;
                if !whole {
                    account.note(NO_UNDULATION);
                }
            }
            // GGA's, which has a height, is not replaced by RMC's.
            if sentence.height_m.is_some() || record.place.is_none() {
                record.place = Some(Place::Earth(Geodetic {
                    latitude_deg,
                    longitude_deg,
                    height_m: self.height_m,
                }));
            }
        }
        record.place_sigma_m = sentence.sigma_m.or(record.place_sigma_m);
        record.velocity_m_s = sentence.velocity_m_s.or(record.velocity_m_s);
        if let Some(azimuth_deg) = sentence.azimuth_deg {
            record.attitude = Some(Attitude {
                roll_deg: None,
                pitch_deg: None,
                azimuth_deg,
            });
        }
        match (sentence.date, self.given_up) {
            (Some(date), false) => {
                self.first_day = Some(date - self.day);
                self.release(options, account, take);
            }
            (Some(_), true) => account.note("a date comes too late to date the records before it"),
            (None, _) => {}
        }
        Ok(())
    }

    /// No more sentences come.
    pub(super) fn finish(&mut self, options: &Options, account: &mut Account, take: &mut Take<'_>) {
        self.close(options, account, take);
        self.give_up(account, take);
    }

    /// What was said of the moment so far is all.
    fn close(&mut self, options: &Options, account: &mut Account, take: &mut Take<'_>) {
        let Some(moment) = self.open.take() else {
            return;
        };
        if moment.record.place.is_some() && !moment.has_height {
            account.note(NO_HEIGHT);
        }
        self.undated.push((self.day, moment.seconds, moment.record));
        match self.first_day.is_some() && !self.given_up {
            true => self.release(options, account, take),
            false if self.given_up || self.undated.len() >= MOST_UNDATED => {
                self.give_up(account, take);
            }
            false => {}
        }
    }

    /// Hands on what was waiting, with dates.
    fn release(&mut self, options: &Options, account: &mut Account, take: &mut Take<'_>) {
        for (days, seconds, mut record) in self.undated.drain(..) {
            let day = self.first_day.unwrap_or_default() + days;
            let leap = options.leap_seconds.unwrap_or_else(|| leap_seconds(day));
            let Some(time) = GpsTime::of_utc(day, seconds, leap) else {
                account.note("dates before GPS time began, 6 January 1980, are passed over");
                continue;
            };
            account.leap_seconds_s = Some(leap);
            record.time = time;
            take(record);
        }
    }

    /// Hands on what was waiting, without dates.
    fn give_up(&mut self, account: &mut Account, take: &mut Take<'_>) {
        if self.undated.is_empty() {
            return;
        }
        self.given_up = true;
        account.clock = Clock::SecondsOfDay;
        for (days, seconds, mut record) in self.undated.drain(..) {
            record.time.seconds = days as f64 * DAY_S + seconds;
            take(record);
        }
    }
}

fn parse(kind: &str, fields: &[&str]) -> Result<Sentence, String> {
    let field = |n: usize| fields.get(n).copied().unwrap_or_default();
    let number = |n: usize, what: &str, from: f64, to: f64| -> Result<f64, String> {
        let value = field(n).parse::<f64>().ok();
        let sound = value.filter(|value| (from..=to).contains(value));
        sound.ok_or_else(|| format!("{what} is '{}'; {from} to {to} can be", field(n)))
    };
    let optional = |n: usize, what: &str, from: f64, to: f64| match field(n) {
        "" => Ok(None),
        _ => number(n, what, from, to).map(Some),
    };
    let mut said = Sentence {
        seconds: None,
        date: None,
        place: None,
        height_m: None,
        sigma_m: None,
        velocity_m_s: None,
        azimuth_deg: None,
        solved: true,
    };
    if !matches!(kind, "VTG" | "HDT") {
        match field(0) {
            // Without a time there is no solution yet.
            "" => said.solved = false,
            text => said.seconds = Some(time_of_day(text)?),
        }
    }
    let course = |speed: usize, course: usize| -> Result<Option<DVec3>, String> {
        let speed = optional(speed, "speed", 0.0, 2e5)?.map(|knots| knots * KNOT_M_S);
        let course = optional(course, "course", -360.0, 360.0)?;
        Ok(match (speed, course) {
            // A course is not stated of what stands.
            (Some(speed), Some(course)) => {
                let (sin, cos) = libm::sincos(course.to_radians());
                Some(DVec3::new(speed * sin, speed * cos, 0.0))
            }
            (Some(0.0), None) => Some(DVec3::ZERO),
            _ => None,
        })
    };
    match kind {
        "GGA" => {
            said.solved &= !matches!(field(5), "" | "0");
            if said.solved {
                said.place = Some(place(field(1), field(2), field(3), field(4))?);
                let above_sea_m = number(8, "height", -1e5, 1e8)?;
                let undulation_m = optional(10, "height of the geoid", -200.0, 200.0)?;
                said.height_m = Some((
                    above_sea_m + undulation_m.unwrap_or(0.0),
                    undulation_m.is_some(),
                ));
            }
        }
        "RMC" => {
            said.solved &= field(1) == "A";
            if said.solved {
                said.place = Some(place(field(2), field(3), field(4), field(5))?);
                said.velocity_m_s = course(6, 7)?;
                said.date = Some(date(field(8))?);
            }
        }
        "ZDA" if said.solved => {
            let whole = |n: usize, what, to| number(n, what, 0.0, to).map(|value| value as i64);
            let [day, month, year] = [
                whole(1, "day", 31.0)?,
                whole(2, "month", 12.0)?,
                whole(3, "year", 9999.0)?,
            ];
            let known = day_number(year, month, day);
            said.date = Some(known.ok_or_else(|| format!("there is no day {year}-{month}-{day}"))?);
        }
        "GST" => {
            if let (Some(north), Some(east), Some(up)) = (
                optional(5, "standard deviation of latitude", 0.0, 1e6)?,
                optional(6, "standard deviation of longitude", 0.0, 1e6)?,
                optional(7, "standard deviation of height", 0.0, 1e6)?,
            ) {
                said.sigma_m = Some(DVec3::new(east, north, up));
            }
        }
        "VTG" => {
            said.velocity_m_s = course(4, 0)?;
            said.solved = said.velocity_m_s.is_some();
        }
        "HDT" => {
            said.azimuth_deg = optional(0, "heading", -360.0, 360.0)?;
            said.solved = said.azimuth_deg.is_some();
        }
        _ => {}
    }
    Ok(said)
}

/// `hhmmss.sss`; a leap second is the 60th.
fn time_of_day(text: &str) -> Result<f64, String> {
    let of = |range: std::ops::Range<usize>| text.get(range)?.parse::<u32>().ok();
    let digits = text.bytes().take(6).all(|b| b.is_ascii_digit());
    let seconds = text.get(4..).and_then(|text| text.parse::<f64>().ok());
    match (digits, of(0..2), of(2..4), seconds) {
        (true, Some(hours @ 0..=23), Some(minutes @ 0..=59), Some(seconds))
            if (0.0..61.0).contains(&seconds) =>
        {
            Ok(f64::from(hours * 3600 + minutes * 60) + seconds)
        }
        _ => Err(format!("time is '{text}', not hhmmss")),
    }
}

/// `ddmmyy`.
fn date(text: &str) -> Result<i64, String> {
    let of = |range: std::ops::Range<usize>| text.get(range)?.parse::<u8>().ok().map(i64::from);
    let known = || {
        let (day, month, year) = (of(0..2)?, of(2..4)?, of(4..6)?);
        let century = if year < 80 { 2000 } else { 1900 };
        day_number(century + year, month, day).filter(|_| text.len() == 6)
    };
    known().ok_or_else(|| format!("date is '{text}', not ddmmyy"))
}

/// Degrees from `ddmm.mmm` and a letter.
fn place(latitude: &str, north: &str, longitude: &str, east: &str) -> Result<(f64, f64), String> {
    let angle = |what: &str, text: &str, letter: &str, letters: [&str; 2], most: f64| {
        let value = text.parse::<f64>().ok().filter(|value| *value >= 0.0);
        let degrees = value.map(|value| {
            let whole = (value / 100.0).floor();
            (whole, value - whole * 100.0)
        });
        let sign = match letter {
            _ if letter == letters[0] => Some(1.0),
            _ if letter == letters[1] => Some(-1.0),
            _ => None,
        };
        let sound = degrees.zip(sign).and_then(|((whole, minutes), sign)| {
            let angle = whole + minutes / 60.0;
            (minutes < 60.0 && angle <= most).then_some(angle * sign)
        });
        sound.ok_or_else(|| format!("{what} is '{text}' '{letter}'"))
    };
    Ok((
        angle("latitude", latitude, north, ["N", "S"], 90.0)?,
        angle("longitude", longitude, east, ["E", "W"], 180.0)?,
    ))
}
