//! Reader options.

/// Facts about a log that its file does not state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// GPS week of an SBET's first record; without it, times are seconds of an unknown week.
    pub week: Option<u32>,
    /// UTC date (year, month, day) of the first record of an NMEA log without dates.
    pub date: Option<(i64, i64, i64)>,
    /// GPS time minus UTC, seconds, instead of the leap seconds of the table.
    pub leap_seconds: Option<i32>,
}
