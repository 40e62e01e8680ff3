//! NMEA 0183: the sentences of one time as one record.
//!
//! | sentence | content |
//! |---|---|
//! | `GGA` | time of day, position, height above mean sea level, and geoid undulation |
//! | `RMC` | time of day, date, position, speed and course |
//! | `ZDA` | time of day, date |
//! | `GST` | time of day, standard deviations of the position |
//! | `VTG` | speed and course |
//! | `HDT` | heading from true north |
//!
//! of any talker. A sentence without a time belongs to the last time stated. Times are UTC: where the time of day decreases by more than half a day, the next
//! day starts. Records before the first date are dated backwards from it ([`MAX_UNDATED`] at most; with more, or without a date, times are seconds of the first
//! day: [`Clock::SecondsOfDay`]). Years of two digits are 1980 to 2079.
//!
//! Some receivers omit the geoid undulation in some sentences. It varies by some centimetres per kilometre, so a missing value is replaced by that of the
//! previous sentence. Records before the first undulation wait for it, [`MAX_UNDATED`] at most; without any, 0 m is used and reported in
//! [`ReadReport::doubts`].
//!
//! GPS time is UTC plus the leap seconds of that day, from a table that ends with those of 2017.

use std::collections::VecDeque;

use glam::DVec3;

use subaperture_model::geometry::Geodetic;

use crate::account::{Clock, ReadReport, count};
use crate::time::{DAY_S, day_number, leap_seconds};
use crate::{Attitude, GpsTime, Kind, Options, Place, Record};

/// Largest number of records that wait for a date or a height.
const MAX_UNDATED: usize = 10_000;

/// One knot, m/s.
const KNOT_M_S: f64 = 1852.0 / 3600.0;

const NO_UNDULATION: &str = "GGA heights are above mean sea level and the log states no geoid undulation: heights assume 0 m, an error of up to 107 m";
const LATE_UNDULATION: &str = "the log states the geoid undulation only after many records, whose heights assume 0 m: heights jump there";
const KEPT_UNDULATION: &str =
    "some GGA sentences state no geoid undulation: that of the nearest sentence is used";
const KEPT_HEIGHT: &str = "RMC without GGA has no height: that of the nearest GGA is used";
const NO_HEIGHT: &str = "RMC without GGA has no height: records assume 0 m above the ellipsoid";

/// Collects sentences into records.
#[derive(Default)]
pub(super) struct Sentences {
    /// Record of the present time, still open for sentences.
    open: Option<Moment>,
    /// Days since the first record.
    day: i64,
    /// Date of the first record, days since 1 January 1970.
    first_day: Option<i64>,
    /// Records that wait for a date or for the geoid undulation.
    waiting: VecDeque<Waiting>,
    /// Whether too many records waited for a date.
    undated: bool,
    /// Whether too many records waited for the geoid undulation.
    level: bool,
    /// Last stated height of the geoid above the ellipsoid, metres.
    undulation_m: Option<f64>,
    /// Last stated height, metres, and its datum.
    height: Option<(f64, Above)>,
}

/// Datum of a height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Above {
    Ellipsoid,
    /// Mean sea level, with unknown geoid undulation.
    Sea,
    /// No height is stated.
    Unknown,
}

/// Record that may wait for a date or a height.
struct Waiting {
    day: i64,
    seconds: f64,
    above: Above,
    record: Record,
}

/// Record of one time of day in progress.
struct Moment {
    seconds: f64,
    record: Record,
    above: Above,
    /// Whether a GGA stated the height.
    has_height: bool,
}

/// Content of a sentence.
struct Sentence {
    seconds: Option<f64>,
    date: Option<i64>,
    place: Option<(f64, f64)>,
    /// Height above mean sea level and the stated geoid undulation, metres.
    height_m: Option<(f64, Option<f64>)>,
    sigma_m: Option<DVec3>,
    velocity_m_s: Option<DVec3>,
    azimuth_deg: Option<f64>,
    solved: bool,
}

/// Receiver of the finished records.
type Take<'a> = dyn FnMut(Record) + 'a;

impl Sentences {
    pub(super) fn new(options: &Options) -> Self {
        let date = options.date.and_then(|(y, m, d)| day_number(y, m, d));
        Self {
            first_day: date,
            ..Self::default()
        }
    }

    /// Add a sentence, the text between `$` and `*`. The error describes its fault.
    pub(super) fn push(
        &mut self,
        text: &str,
        byte: u64,
        options: &Options,
        account: &mut ReadReport,
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
        let sentence = parse(kind, &fields).map_err(|error| format!("{name}: {error}"))?;
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
                above: Above::Unknown,
                has_height: false,
            });
        }
        let Some(open) = &mut self.open else {
            return Err(format!("{name}: expected a sentence with a time before it"));
        };
        count(&mut account.read, kind);
        let record = &mut open.record;
        if let Some((latitude_deg, longitude_deg)) = sentence.place {
            if let Some((above_sea_m, stated)) = sentence.height_m {
                if stated.is_none() && self.undulation_m.is_some() {
                    account.note(KEPT_UNDULATION);
                }
                self.undulation_m = stated.or(self.undulation_m);
                self.height = Some(match self.undulation_m {
                    Some(undulation_m) => (above_sea_m + undulation_m, Above::Ellipsoid),
                    None => (above_sea_m, Above::Sea),
                });
                open.has_height = true;
            }
            // A position of GGA, with a height, takes precedence over that of RMC.
            if sentence.height_m.is_some() || record.place.is_none() {
                let (height_m, above) = self.height.unwrap_or((0.0, Above::Unknown));
                open.above = above;
                record.place = Some(Place::Earth(Geodetic {
                    latitude_deg,
                    longitude_deg,
                    height_m,
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
        match (sentence.date, self.undated) {
            (Some(date), false) => {
                self.first_day = Some(date - self.day);
                self.release(false, options, account, take);
            }
            (Some(_), true) => account.note(
                "the first date comes after more than 10000 records: these have times of day only",
            ),
            (None, _) => {}
        }
        Ok(())
    }

    /// End the log: pass on all remaining records.
    pub(super) fn finish(
        &mut self,
        options: &Options,
        account: &mut ReadReport,
        take: &mut Take<'_>,
    ) {
        self.close(options, account, take);
        self.release(true, options, account, take);
    }

    /// Finish the open record.
    fn close(&mut self, options: &Options, account: &mut ReadReport, take: &mut Take<'_>) {
        let Some(moment) = self.open.take() else {
            return;
        };
        if moment.record.place.is_some() && !moment.has_height {
            account.note(KEPT_HEIGHT);
        }
        self.waiting.push_back(Waiting {
            day: self.day,
            seconds: moment.seconds,
            above: match moment.record.place {
                Some(_) => moment.above,
                None => Above::Ellipsoid,
            },
            record: moment.record,
        });
        self.complete_heights(account);
        let full = self.waiting.len() >= MAX_UNDATED;
        self.release(full, options, account, take);
    }

    /// Complete the heights of waiting records from the present undulation and height.
    fn complete_heights(&mut self, account: &mut ReadReport) {
        let height_m = match self.height {
            Some((height_m, Above::Ellipsoid)) => Some(height_m),
            _ => None,
        };
        for waiting in &mut self.waiting {
            let Some(Place::Earth(place)) = &mut waiting.record.place else {
                continue;
            };
            match (waiting.above, self.undulation_m, height_m) {
                (Above::Sea, Some(undulation_m), _) => {
                    place.height_m += undulation_m;
                    account.note(KEPT_UNDULATION);
                }
                (Above::Unknown, _, Some(height_m)) => place.height_m = height_m,
                _ => continue,
            }
            waiting.above = Above::Ellipsoid;
        }
        if self.level && self.undulation_m.is_some() {
            account.doubt(LATE_UNDULATION);
        }
    }

    /// Pass on the records that are complete, or all.
    fn release(
        &mut self,
        all: bool,
        options: &Options,
        account: &mut ReadReport,
        take: &mut Take<'_>,
    ) {
        while let Some(first) = self.waiting.front() {
            let dated = self.first_day.is_some() || self.undated;
            let raised = first.above == Above::Ellipsoid || self.level;
            if !(dated && raised || all) {
                return;
            }
            let Some(mut waiting) = self.waiting.pop_front() else {
                return;
            };
            match waiting.above {
                Above::Ellipsoid => {}
                Above::Sea => account.doubt(NO_UNDULATION),
                Above::Unknown => account.doubt(NO_HEIGHT),
            }
            self.level |= !raised;
            self.undated |= !dated;
            match self.first_day.filter(|_| !self.undated) {
                None => {
                    account.clock = Clock::SecondsOfDay;
                    waiting.record.time.seconds = waiting.day as f64 * DAY_S + waiting.seconds;
                }
                Some(first_day) => {
                    let day = first_day + waiting.day;
                    let leap = options.leap_seconds.unwrap_or_else(|| leap_seconds(day));
                    let Some(time) = GpsTime::of_utc(day, waiting.seconds, leap) else {
                        account
                            .note("records dated before the start of GPS time, 6 January 1980, are left out");
                        continue;
                    };
                    account.leap_seconds_s = Some(leap);
                    waiting.record.time = time;
                }
            }
            take(waiting.record);
        }
    }
}

fn parse(kind: &str, fields: &[&str]) -> Result<Sentence, String> {
    let field = |n: usize| fields.get(n).copied().unwrap_or_default();
    let number = |n: usize, quantity: &str, from: f64, to: f64| -> Result<f64, String> {
        let value = field(n).parse::<f64>().ok();
        let sound = value.filter(|value| (from..=to).contains(value));
        sound.ok_or_else(|| format!("{quantity} is '{}', expected {from} to {to}", field(n)))
    };
    let optional = |n: usize, quantity: &str, from: f64, to: f64| match field(n) {
        "" => Ok(None),
        _ => number(n, quantity, from, to).map(Some),
    };
    let mut sentence = Sentence {
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
            "" => sentence.solved = false,
            text => sentence.seconds = Some(time_of_day(text)?),
        }
    }
    let course = |speed: usize, course: usize| -> Result<Option<DVec3>, String> {
        let speed = optional(speed, "speed", 0.0, 2e5)?.map(|knots| knots * KNOT_M_S);
        let course = optional(course, "course", -360.0, 360.0)?;
        Ok(match (speed, course) {
            // A stationary receiver states no course.
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
            sentence.solved &= !matches!(field(5), "" | "0");
            if sentence.solved {
                sentence.place = Some(place(field(1), field(2), field(3), field(4))?);
                let above_sea_m = number(8, "height", -1e5, 1e8)?;
                let undulation_m = optional(10, "height of the geoid", -200.0, 200.0)?;
                sentence.height_m = Some((above_sea_m, undulation_m));
            }
        }
        "RMC" => {
            sentence.solved &= field(1) == "A";
            if sentence.solved {
                sentence.place = Some(place(field(2), field(3), field(4), field(5))?);
                sentence.velocity_m_s = course(6, 7)?;
                sentence.date = Some(date(field(8))?);
            }
        }
        "ZDA" if sentence.solved => {
            let whole =
                |n: usize, quantity, to| number(n, quantity, 0.0, to).map(|value| value as i64);
            let [day, month, year] = [
                whole(1, "day", 31.0)?,
                whole(2, "month", 12.0)?,
                whole(3, "year", 9999.0)?,
            ];
            let known = day_number(year, month, day);
            sentence.date = Some(known.ok_or_else(|| {
                format!("date is {year}-{month}-{day}, expected a day of the calendar")
            })?);
        }
        "GST" => {
            if let (Some(north), Some(east), Some(up)) = (
                optional(5, "standard deviation of latitude", 0.0, 1e6)?,
                optional(6, "standard deviation of longitude", 0.0, 1e6)?,
                optional(7, "standard deviation of height", 0.0, 1e6)?,
            ) {
                sentence.sigma_m = Some(DVec3::new(east, north, up));
            }
        }
        "VTG" => {
            sentence.velocity_m_s = course(4, 0)?;
            sentence.solved = sentence.velocity_m_s.is_some();
        }
        "HDT" => {
            sentence.azimuth_deg = optional(0, "heading", -360.0, 360.0)?;
            sentence.solved = sentence.azimuth_deg.is_some();
        }
        _ => {}
    }
    Ok(sentence)
}

/// Seconds of the day from `hhmmss.sss`; a leap second has the number 60.
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
        _ => Err(format!("time is '{text}', expected hhmmss")),
    }
}

/// Days since 1 January 1970 from `ddmmyy`.
fn date(text: &str) -> Result<i64, String> {
    let of = |range: std::ops::Range<usize>| text.get(range)?.parse::<u8>().ok().map(i64::from);
    let known = || {
        let (day, month, year) = (of(0..2)?, of(2..4)?, of(4..6)?);
        let century = if year < 80 { 2000 } else { 1900 };
        day_number(century + year, month, day).filter(|_| text.len() == 6)
    };
    known().ok_or_else(|| format!("date is '{text}', expected ddmmyy"))
}

/// Latitude and longitude in degrees from `ddmm.mmm` and a letter each.
fn place(latitude: &str, north: &str, longitude: &str, east: &str) -> Result<(f64, f64), String> {
    let angle = |quantity: &str, text: &str, letter: &str, letters: [&str; 2], most: f64| {
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
        sound.ok_or_else(|| {
            format!(
                "{quantity} is '{text}' '{letter}', expected degrees and minutes up to {most} degrees and {} or {}",
                letters[0], letters[1]
            )
        })
    };
    Ok((
        angle("latitude", latitude, north, ["N", "S"], 90.0)?,
        angle("longitude", longitude, east, ["E", "W"], 180.0)?,
    ))
}
