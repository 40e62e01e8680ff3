//! Packet header and Mission Segment.

use super::encoded::Encoded;
use super::error::StanagError;
use super::field::{Field, Number};

/// Nanoseconds of a day.
pub(super) const DAY_NS: i64 = 86_400_000_000_000;

const PLATFORM_TYPE: Field =
    Field::scaled(Number::M(3), "platform type", 1, (1.0, "type"), [0, 255]);
const YEAR: Field = Field::scaled(
    Number::M(5),
    "reference year",
    2,
    (1.0, "year"),
    [0, 65_535],
);
const MONTH: Field = Field::scaled(Number::M(6), "reference month", 1, (1.0, "month"), [1, 12]);
const DAY: Field = Field::scaled(Number::M(7), "reference day", 1, (1.0, "day"), [1, 31]);

/// Origin of a packet's data (P7, exercise indicator).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exercise {
    /// Operation with real data, code 0.
    OperationReal = 0,
    /// Operation with simulated data, code 1.
    OperationSimulated = 1,
    /// Operation with synthesized data, a mixture of real and simulated data, code 2.
    OperationSynthesized = 2,
    /// Exercise with real data, code 128.
    ExerciseReal = 128,
    /// Exercise with simulated data, code 129.
    ExerciseSimulated = 129,
    /// Exercise with synthesized data, a mixture of real and simulated data, code 130.
    ExerciseSynthesized = 130,
}

/// Platform and mission: packet header and Mission Segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// Nationality of the platform (P3): two letters, `XN` for platforms of NATO.
    pub nationality: String,
    /// Origin of the data (P7).
    pub exercise: Exercise,
    /// Identifier of the platform (P8): tail number or satellite name, at most 10 characters.
    pub platform_id: String,
    /// Identifier of the mission (P9), unique for the platform. Default: 0.
    pub mission_id: u32,
    /// Mission plan (M1), at most 12 characters. Default: empty.
    pub mission_plan: String,
    /// Flight plan (M2), at most 12 characters. Default: empty.
    pub flight_plan: String,
    /// Type of the platform (M3), of the table of the standard. Default: 255, other.
    pub platform_type: u8,
    /// Variant of the platform, for example a software version (M4), at most 10 characters. Default: empty.
    pub platform_configuration: String,
    /// Start of the mission, nanoseconds since 1970 (UTC). Its day is the reference time (M5, M6, M7).
    pub start_utc_ns: i64,
}

impl Mission {
    /// Mission with the defaults of all other fields.
    pub fn new(
        nationality: &str,
        platform_id: &str,
        exercise: Exercise,
        start_utc_ns: i64,
    ) -> Self {
        Self {
            nationality: nationality.to_owned(),
            exercise,
            platform_id: platform_id.to_owned(),
            mission_id: 0,
            mission_plan: String::new(),
            flight_plan: String::new(),
            platform_type: 255,
            platform_configuration: String::new(),
            start_utc_ns,
        }
    }

    /// Packet header (P1 to P10) of a packet of `size` bytes.
    pub(super) fn header(&self, size: u32, job_id: u32) -> Result<Vec<u8>, StanagError> {
        const UNCLASSIFIED: u8 = 5;
        const NO_CODE: [u8; 2] = [0, 0];
        let mut out = Encoded::default();
        out.text((Number::P(1), "version"), "30", 2, 2)?;
        out.bytes.extend(size.to_be_bytes());
        out.text((Number::P(3), "nationality"), &self.nationality, 2, 2)?;
        out.bytes.push(UNCLASSIFIED);
        out.text((Number::P(5), "classification system"), "", 0, 2)?;
        out.bytes.extend(NO_CODE);
        out.bytes.push(self.exercise as u8);
        out.text((Number::P(8), "platform ID"), &self.platform_id, 0, 10)?;
        out.bytes.extend(self.mission_id.to_be_bytes());
        out.bytes.extend(job_id.to_be_bytes());
        Ok(out.bytes)
    }

    /// Mission Segment without its header (M1 to M7).
    pub(super) fn segment(&self) -> Result<Vec<u8>, StanagError> {
        let [year, month, day] = date(self.start_utc_ns.div_euclid(DAY_NS));
        let mut out = Encoded::default();
        out.text((Number::M(1), "mission plan"), &self.mission_plan, 0, 12)?;
        out.text((Number::M(2), "flight plan"), &self.flight_plan, 0, 12)?;
        out.raw(&PLATFORM_TYPE, self.platform_type.into());
        let configuration = (Number::M(4), "platform configuration");
        out.text(configuration, &self.platform_configuration, 0, 10)?;
        out.nearest(&YEAR, year as f64)?;
        out.nearest(&MONTH, month as f64)?;
        out.nearest(&DAY, day as f64)?;
        Ok(out.bytes)
    }
}

/// Gregorian year, month and day of a day after 1 January 1970.
fn date(day: i64) -> [i64; 3] {
    let leap = |year: i64| year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    // 400 years repeat after 146097 days.
    let mut year = 1970 + 400 * day.div_euclid(146_097);
    let mut left = day.rem_euclid(146_097);
    while left >= 365 + i64::from(leap(year)) {
        left -= 365 + i64::from(leap(year));
        year += 1;
    }
    let february = 28 + i64::from(leap(year));
    let mut month = 1;
    for days in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if left < days {
            break;
        }
        left -= days;
        month += 1;
    }
    [year, month, left + 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_gregorian() {
        // Days by `date -u -d DATE +%s`, over 86400.
        for (day, expected) in [
            (0, [1970, 1, 1]),
            (-1, [1969, 12, 31]),
            (11_016, [2000, 2, 29]),
            (19_722, [2023, 12, 31]),
            (19_782, [2024, 2, 29]),
            (19_783, [2024, 3, 1]),
            (20_786, [2026, 11, 29]),
            (47_541, [2100, 3, 1]),
        ] {
            assert_eq!(date(day), expected);
        }
    }

    #[test]
    fn header_has_the_bytes_of_the_table() {
        let mut mission = Mission::new("XN", "TAIL1", Exercise::ExerciseSimulated, 0);
        mission.mission_id = 0x0102_0304;
        let expected =
            b"30\x00\x00\x01\x02XN\x05  \x00\x00\x81TAIL1     \x01\x02\x03\x04\x00\x00\x00\x07";
        assert_eq!(mission.header(258, 7).unwrap(), expected);
        assert_eq!(expected.len(), 32);
        mission.nationality = "NATO".into();
        assert!(matches!(
            mission.header(258, 7),
            Err(StanagError::Text { .. })
        ));
    }

    #[test]
    fn mission_segment_has_the_bytes_of_the_table() {
        // 1 March 2024, 00:00:00.000000001 UTC.
        let mut mission = Mission::new("XN", "", Exercise::OperationReal, 19_783 * DAY_NS + 1);
        mission.mission_plan = "PLAN".into();
        mission.flight_plan = "FLIGHT".into();
        mission.platform_type = 15;
        mission.platform_configuration = "1.0".into();
        let expected = b"PLAN        FLIGHT      \x0f1.0       \x07\xe8\x03\x01";
        assert_eq!(mission.segment().unwrap(), expected);
        assert_eq!(expected.len(), 39);
        mission.flight_plan = "thirteen char".into();
        assert!(mission.segment().is_err());
    }
}
