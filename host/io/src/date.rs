//! UTC dates, `YYYY-MM-DDThh:mm:ss.ssssssZ`, as in CPHD and CRSD.

/// Nanoseconds since the beginning of 1970, without leap seconds; `None` for other text. Digits after the ninth of a second are
/// ignored.
pub fn nanoseconds(text: &str) -> Option<i64> {
    let (date, time) = text.trim().strip_suffix('Z')?.split_once('T')?;
    let [year, month, day] = numbers(date, '-')?;
    let (time, fraction) = time.split_once('.').unwrap_or((time, ""));
    let [hour, minute, second] = numbers(time, ':')?;
    let in_range = (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0..24).contains(&hour)
        && (0..60).contains(&minute)
        // A leap second is the sixtieth.
        && (0..=60).contains(&second);
    if !in_range || !fraction.bytes().all(|digit| digit.is_ascii_digit()) {
        return None;
    }
    let digits = fraction.bytes().chain(std::iter::repeat(b'0')).take(9);
    let nanoseconds = digits.fold(0, |sum, digit| 10 * sum + i64::from(digit - b'0'));
    // Years from March on, so that a leap day is the last of its year.
    let years = if month < 3 { year - 1 } else { year };
    let days_of_months = (153 * ((month + 9) % 12) + 2) / 5;
    let days = 365 * years + years / 4 - years / 100 + years / 400 + days_of_months + day - 1;
    // 1 March of year 0 to 1 January 1970.
    let days = days - 719_468;
    let seconds = ((days * 24 + hour) * 60 + minute) * 60 + second;
    seconds.checked_mul(1_000_000_000)?.checked_add(nanoseconds)
}

/// Three numbers of at most four digits between `mark`s.
fn numbers(text: &str, mark: char) -> Option<[i64; 3]> {
    let mut parts = text.split(mark).map(|part| {
        let digits = (1..=4).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        digits.then(|| part.parse().ok()).flatten()
    });
    let three = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some(three)
}

#[cfg(test)]
mod tests {
    use super::nanoseconds;

    #[test]
    fn dates_convert_to_nanoseconds() {
        // By hand: 1970 has 365 days; 2000 began 10957 days after it (30 years, 7 leap days); 1 March
        // 2000 lies 31 + 29 days on; 2024 began 24 years and 6 leap days after 2000.
        let day = 86_400_000_000_000;
        for (text, expected) in [
            ("1970-01-01T00:00:00.000000Z", 0),
            ("1970-01-01T00:00:01Z", 1_000_000_000),
            ("1970-01-02T00:00:00.5Z", day + 500_000_000),
            ("1969-12-31T23:59:59.999999999Z", -1),
            ("2000-03-01T00:00:00Z", (10_957 + 60) * day),
            ("2024-01-01T12:00:00Z", (10_957 + 8766) * day + day / 2),
        ] {
            assert_eq!(nanoseconds(text), Some(expected), "{text}");
        }
        for text in [
            "",
            "2024-01-01",
            "2024-13-01T00:00:00Z",
            "2024-01-01T00:00:00",
            "2024-01-01T00:00:00.1x Z",
            "99999-01-01T00:00:00Z",
            "2024-01-01-01T00:00:00Z",
            "9999-01-01T00:00:00Z",
        ] {
            assert_eq!(nanoseconds(text), None, "{text}");
        }
    }
}
