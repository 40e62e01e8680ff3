//! UTC dates and times as text.

/// Calendar date and time of day.
struct DateTime {
    /// Year, month, day.
    date: [i64; 3],
    /// Hour, minute, second.
    time: [i64; 3],
    nanoseconds: i64,
}

/// Convert nanoseconds since 1970 to Gregorian date and time, by eras of 400 years that begin in March.
fn parts(ns: i64) -> DateTime {
    const DAY_S: i64 = 86_400;
    let seconds = ns.div_euclid(1_000_000_000);
    let (day, second) = (seconds.div_euclid(DAY_S), seconds.rem_euclid(DAY_S));
    // 1 March of year 0 is 719468 days before 1970.
    let days = day + 719_468;
    let era = days.div_euclid(146_097);
    let of_era = days.rem_euclid(146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let next_year = i64::from(month >= 10);
    DateTime {
        date: [
            era * 400 + year + next_year,
            if month < 10 { month + 3 } else { month - 9 },
            of_year - (153 * month + 2) / 5 + 1,
        ],
        time: [second / 3600, second / 60 % 60, second % 60],
        nanoseconds: ns.rem_euclid(1_000_000_000),
    }
}

/// Format as in XML: `YYYY-MM-DDThh:mm:ss.nnnnnnnnnZ`.
pub(crate) fn iso(ns: i64) -> String {
    let DateTime {
        date: [year, month, day],
        time: [hour, minute, second],
        nanoseconds,
    } = parts(ns);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{nanoseconds:09}Z")
}

/// Format as in NITF: `YYYYMMDDhhmmss`.
pub(crate) fn digits(ns: i64) -> String {
    let DateTime {
        date: [year, month, day],
        time: [hour, minute, second],
        ..
    } = parts(ns);
    format!("{year:04}{month:02}{day:02}{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_convert_to_gregorian_dates() {
        // 1 March 2000 is 30 years with 7 leap days, 31 and 29 days after the beginning of 1970.
        let march = (30 * 365 + 7 + 31 + 29) * 86_400_000_000_000;
        for (ns, text) in [
            (0, "1970-01-01T00:00:00.000000000Z"),
            (-1, "1969-12-31T23:59:59.999999999Z"),
            (march, "2000-03-01T00:00:00.000000000Z"),
            (march - 86_400_000_000_000, "2000-02-29T00:00:00.000000000Z"),
            (march + 3_661_500_000_000, "2000-03-01T01:01:01.500000000Z"),
            (i64::MAX, "2262-04-11T23:47:16.854775807Z"),
        ] {
            assert_eq!(iso(ns), text);
        }
        assert_eq!(digits(march + 3_661_500_000_000), "20000301010101");
    }
}
