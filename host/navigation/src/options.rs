//! What is said of a log beside it.

/// What a file does not say of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// The GPS week in which an SBET begins; else its times are seconds of an unknown one.
    pub week: Option<u32>,
    /// Year, month and day of UTC on which an NMEA log without dates begins.
    pub date: Option<(i64, i64, i64)>,
    /// Seconds by which GPS time is ahead of UTC, instead of those of the table.
    pub leap_seconds: Option<i32>,
}
