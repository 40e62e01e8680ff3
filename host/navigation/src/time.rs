//! GPS time, and its conversion from UTC dates.

/// Seconds of a week and of a day.
pub(crate) const WEEK_S: f64 = 604_800.0;
pub(crate) const DAY_S: f64 = 86_400.0;

/// First day of GPS weeks, 6 January 1980, in days since 1 January 1970.
const FIRST_DAY: i64 = 3657;

/// Dates (year, month, day) of leap seconds since 1980: from each on, GPS time is ahead of UTC by one more second. The last is of 2017; none has been announced since.
const LEAPS: [(i64, i64, i64); 18] = [
    (1981, 7, 1),
    (1982, 7, 1),
    (1983, 7, 1),
    (1985, 7, 1),
    (1988, 1, 1),
    (1990, 1, 1),
    (1991, 1, 1),
    (1992, 7, 1),
    (1993, 7, 1),
    (1994, 7, 1),
    (1996, 1, 1),
    (1997, 7, 1),
    (1999, 1, 1),
    (2006, 1, 1),
    (2009, 1, 1),
    (2012, 7, 1),
    (2015, 7, 1),
    (2017, 1, 1),
];

/// GPS time as week and seconds.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct GpsTime {
    /// Weeks since 6 January 1980.
    pub week: u32,
    /// Seconds of the week, 0 to 604800. With a clock of the log's own ([`crate::Clock`]) any number.
    pub seconds: f64,
}

impl GpsTime {
    /// Seconds from `earlier` to this time.
    pub fn since(&self, earlier: GpsTime) -> f64 {
        let weeks = f64::from(self.week) - f64::from(earlier.week);
        weeks * WEEK_S + (self.seconds - earlier.seconds)
    }

    /// From nanoseconds of UTC since 1 January 1970, as in recordings; `None` before 1980. A leap second counts as the first second of the next day.
    pub fn of_unix_ns(ns: i64) -> Option<Self> {
        const DAY_NS: i64 = 86_400_000_000_000;
        let day = ns.div_euclid(DAY_NS);
        let seconds = ns.rem_euclid(DAY_NS) as f64 * 1e-9;
        Self::of_utc(day, seconds, leap_seconds(day))
    }

    /// Time `seconds` later, rounded to milliseconds.
    pub fn later(self, seconds: f64) -> Self {
        let in_week = self.seconds + seconds;
        let weeks = (in_week / WEEK_S).floor();
        let rounded = ((in_week - weeks * WEEK_S) * 1e3).round() / 1e3;
        let over = rounded >= WEEK_S;
        Self {
            week: self
                .week
                .saturating_add_signed(weeks as i32 + i32::from(over)),
            seconds: if over { 0.0 } else { rounded },
        }
    }

    /// UTC date (year, month, day) and milliseconds of the day. A leap second counts as the first second of the next day.
    pub(crate) fn utc_date_ms(self) -> ([i64; 3], i64) {
        const DAY_MS: i64 = 86_400_000;
        let ms = i64::from(self.week) * 7 * DAY_MS + (self.seconds * 1e3).round() as i64;
        let of = |leap_s: i32| ms - i64::from(leap_s) * 1000;
        let day = |ms: i64| FIRST_DAY + ms.div_euclid(DAY_MS);
        // Leap seconds of the UTC day, which may be the day before that of GPS time.
        let utc_ms = of(leap_seconds(day(of(leap_seconds(day(ms))))));
        (date(day(utc_ms)), utc_ms.rem_euclid(DAY_MS))
    }

    /// From a UTC day, seconds of that day, and the leap seconds (GPS time minus UTC); `None` before 1980 or after some millions of weeks.
    pub(crate) fn of_utc(day: i64, seconds: f64, leap_s: i32) -> Option<Self> {
        let days = day - FIRST_DAY;
        let in_week = (days.rem_euclid(7) as f64) * DAY_S + seconds + f64::from(leap_s);
        let more = (in_week / WEEK_S).floor();
        let week = u32::try_from(days.div_euclid(7) + more as i64).ok()?;
        Some(Self {
            week,
            seconds: in_week - more * WEEK_S,
        })
    }
}

impl std::fmt::Display for GpsTime {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.week {
            0 => write!(f, "{:.3} s", self.seconds),
            week => write!(f, "week {week}, {:.3} s", self.seconds),
        }
    }
}

/// Days since 1 January 1970 of a Gregorian date; `None` for an invalid date.
pub(crate) fn day_number(year: i64, month: i64, day: i64) -> Option<i64> {
    let leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    let longest = match month {
        2 => 28 + i64::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => return None,
    };
    if !(1..=longest).contains(&day) {
        return None;
    }
    // Years begin in March, so that a leap day is the last of its year; five months from March on have 153 days.
    let (y, m) = match month {
        1 | 2 => (year - 1, month + 9),
        _ => (year, month - 3),
    };
    let of_year = (153 * m + 2) / 5 + day - 1;
    let leaps = y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400);
    // 719468 days from 1 March of year 0 to 1 January 1970.
    Some(y * 365 + leaps + of_year - 719_468)
}

/// Gregorian date (year, month, day) of a number of days since 1 January 1970; inverse of [`day_number`].
fn date(day: i64) -> [i64; 3] {
    let days = day + 719_468;
    let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 {
        (month + 3, 0)
    } else {
        (month - 9, 1)
    };
    [era * 400 + year + next, month, day]
}

/// GPS time minus UTC, seconds, on a day (days since 1 January 1970).
pub(crate) fn leap_seconds(day: i64) -> i32 {
    let since = LEAPS
        .iter()
        .filter(|&&(y, m, d)| day_number(y, m, d).is_some_and(|leap| day >= leap));
    since.count() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utc_dates_convert_to_gps_weeks() {
        // 24 November 2014, 20:29:50 UTC, was week 1820, 160206 s, with 16 leap seconds: a receiver's own TIME record.
        let day = day_number(2014, 11, 24).unwrap();
        assert_eq!(leap_seconds(day), 16);
        let seconds = 20.0 * 3600.0 + 29.0 * 60.0 + 50.0;
        let time = GpsTime::of_utc(day, seconds, 16).unwrap();
        assert_eq!((time.week, time.seconds), (1820, 160_206.0));
        // The last second of a Saturday is in the next week with leap seconds.
        let saturday = day_number(2014, 11, 29).unwrap();
        let time = GpsTime::of_utc(saturday, 86_399.5, 16).unwrap();
        assert_eq!((time.week, time.seconds), (1821, 15.5));
        assert_eq!(GpsTime::of_utc(FIRST_DAY - 7, 0.0, 0), None);
        // The same time as Unix time, 1416860990 s since 1970, plus half a second.
        let time = GpsTime::of_unix_ns(1_416_860_990_500_000_000).unwrap();
        assert_eq!((time.week, time.seconds), (1820, 160_206.5));
        assert_eq!(GpsTime::of_unix_ns(0), None);
    }

    #[test]
    fn day_numbers_and_leap_seconds_agree_with_calendar() {
        assert_eq!(day_number(1970, 1, 1), Some(0));
        assert_eq!(day_number(1980, 1, 6), Some(FIRST_DAY));
        assert_eq!(
            day_number(2000, 3, 1).unwrap() - day_number(2000, 2, 28).unwrap(),
            2
        );
        for wrong in [(2023, 2, 29), (2023, 13, 1), (2023, 4, 31), (2023, 1, 0)] {
            assert_eq!(day_number(wrong.0, wrong.1, wrong.2), None);
        }
        let at = |y, m, d| leap_seconds(day_number(y, m, d).unwrap());
        assert_eq!(at(1980, 1, 6), 0);
        assert_eq!((at(2016, 12, 31), at(2017, 1, 1)), (17, 18));
        assert_eq!((at(1999, 1, 1), at(2026, 1, 1)), (13, 18));
    }

    #[test]
    fn gps_times_convert_to_utc_dates() {
        // The inverse of the receiver's record above, and dates around leap days and leap seconds.
        let at = |week, seconds| GpsTime { week, seconds }.utc_date_ms();
        assert_eq!(at(1820, 160_206.0), ([2014, 11, 24], 73_790_000));
        assert_eq!(at(1821, 15.5), ([2014, 11, 29], 86_399_500));
        for (y, m, d) in [
            (1980, 1, 6),
            (2000, 2, 29),
            (2016, 12, 31),
            (2017, 1, 1),
            (2100, 3, 1),
            (2024, 12, 31),
        ] {
            for seconds in [0.0, 0.001, 86_399.999] {
                let day = day_number(y, m, d).unwrap();
                let time = GpsTime::of_utc(day, seconds, leap_seconds(day)).unwrap();
                let ms = (seconds * 1e3).round() as i64;
                assert_eq!(time.utc_date_ms(), ([y, m, d], ms), "{y}-{m}-{d}");
            }
        }
    }

    #[test]
    fn later_times_continue_in_the_next_week() {
        let at = |week, seconds| GpsTime { week, seconds };
        assert_eq!(at(100, 604_799.5).later(0.75), at(101, 0.25));
        assert_eq!(at(100, 604_799.5).later(0.4999), at(101, 0.0));
        assert_eq!(at(101, 0.25).later(-0.5), at(100, 604_799.75));
        assert_eq!(at(100, 1.0).later(0.0004), at(100, 1.0));
    }

    #[test]
    fn time_differences_span_weeks() {
        let at = |week, seconds| GpsTime { week, seconds };
        assert_eq!(at(101, 1.0).since(at(100, 604_799.5)), 1.5);
    }
}
