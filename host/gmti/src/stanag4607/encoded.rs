//! Encoding of numbers, angles and text, most significant byte first.

use super::error::StanagError;
use super::field::{Field, Number};

/// Encoded fields of a segment, and the existence mask of those present.
#[derive(Debug, Default)]
pub(super) struct Encoded {
    pub(super) mask: u64,
    pub(super) bytes: Vec<u8>,
}

impl Encoded {
    /// Append a value, rounded to the nearest count.
    pub(super) fn nearest(&mut self, field: &Field, value: f64) -> Result<(), StanagError> {
        self.count(field, (value / field.resolution).round(), value)
    }

    /// Append a standard deviation or a smallest value, rounded up to a count. An excess over a count by rounding errors is ignored.
    pub(super) fn up(&mut self, field: &Field, value: f64) -> Result<(), StanagError> {
        const ROUNDING: f64 = 1e-12;
        let count = value / field.resolution * (1.0 - ROUNDING);
        let away = match count < 0.0 {
            true => count.floor(),
            false => count.ceil(),
        };
        self.count(field, away, value)
    }

    /// Append a value rounded up to a count, or the largest value of the field's bytes for "no statement".
    pub(super) fn up_or_none(
        &mut self,
        field: &Field,
        value: Option<f64>,
    ) -> Result<(), StanagError> {
        match value {
            Some(value) => self.up(field, value),
            None => {
                self.raw(field, -1);
                Ok(())
            }
        }
    }

    /// Append an angle of a full circle: -180 to 360 degrees, written as 0 to 360.
    pub(super) fn circle(&mut self, field: &Field, degrees: f64) -> Result<(), StanagError> {
        if !(-180.0..=360.0).contains(&degrees) {
            return Err(field.outside([-180.0, 360.0], degrees));
        }
        let count = (degrees / field.resolution).round() as i64;
        self.raw(field, count.rem_euclid(field.counts[1] + 1));
        Ok(())
    }

    fn count(&mut self, field: &Field, count: f64, value: f64) -> Result<(), StanagError> {
        let [least, most] = field.counts.map(|count| count as f64);
        if !(least..=most).contains(&count) {
            let range = [least, most].map(|count| count * field.resolution);
            return Err(field.outside(range, value));
        }
        self.raw(field, count as i64);
        Ok(())
    }

    /// Append the low bytes of a count, without a check.
    pub(super) fn raw(&mut self, field: &Field, count: i64) {
        self.mask |= field.number.mask();
        self.bytes
            .extend_from_slice(&count.to_be_bytes()[8 - field.bytes..]);
    }

    /// Append text, left-justified and filled with spaces to `length` characters of at least `least`.
    pub(super) fn text(
        &mut self,
        (number, name): (Number, &str),
        text: &str,
        least: usize,
        length: usize,
    ) -> Result<(), StanagError> {
        let printable = text.bytes().all(|byte| (0x20..=0x7e).contains(&byte));
        if !printable || !(least..=length).contains(&text.len()) {
            return Err(StanagError::Text {
                field: format!("{number} ({name})"),
                expected: match least == length {
                    true => length.to_string(),
                    false => format!("at most {length}"),
                },
                found: text.escape_debug().to_string(),
            });
        }
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes
            .resize(self.bytes.len() + length - text.len(), b' ');
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATITUDE: Field = Field::latitude(Number::D(7), "sensor latitude");
    const LONGITUDE: Field = Field::longitude(Number::D(8), "sensor longitude");
    const TRACK: Field = Field::angle(Number::D(15), "sensor track", 0xffff);
    const DEVIATION: Field = Field::scaled(
        Number::T(12),
        "slant range uncertainty",
        2,
        (0.01, "m"),
        [0, 0xffff],
    );

    fn bytes(
        put: impl Fn(&mut Encoded, &Field, f64) -> Result<(), StanagError>,
        field: &Field,
        value: f64,
    ) -> Vec<u8> {
        let mut encoded = Encoded::default();
        put(&mut encoded, field, value).unwrap();
        encoded.bytes
    }

    #[test]
    fn binary_angles_match_the_examples_of_the_standard() {
        // Annex C-4.6: BA16 0101100100011100 is 125.31006 degrees. A 1 in the most significant bit is 180 degrees; in SA32 the second bit is 45.
        for (degrees, expected) in [
            (125.31006, 0b0101_1001_0001_1100u16),
            (180.0, 0x8000),
            (-90.0, 0xc000),
            (359.999, 0),
            (360.0, 0),
        ] {
            let found = bytes(Encoded::circle, &TRACK, degrees);
            assert_eq!(found, expected.to_be_bytes(), "{degrees}");
        }
        for (degrees, expected) in [
            (45.0, 0x4000_0000u32),
            (-90.0, 0x8000_0000),
            (-45.0, 0xc000_0000),
            (22.5, 0x2000_0000),
            (-180.0 / 4_294_967_296.0, 0xffff_ffff),
        ] {
            let found = bytes(Encoded::nearest, &LATITUDE, degrees);
            assert_eq!(found, expected.to_be_bytes(), "{degrees}");
        }
        for (degrees, expected) in [
            (90.0, 0x4000_0000u32),
            (-90.0, 0xc000_0000),
            (-1e-9, 0),
            (359.999_999_916, 0xffff_ffff),
        ] {
            let found = bytes(Encoded::circle, &LONGITUDE, degrees);
            assert_eq!(found, expected.to_be_bytes(), "{degrees}");
        }
    }

    #[test]
    fn values_outside_of_a_range_are_refused() {
        let error = |field: &Field, value| Encoded::default().nearest(field, value).unwrap_err();
        assert_eq!(
            error(&LATITUDE, 90.0).to_string(),
            "D7 (sensor latitude): expected -90 to 89.999999958 degrees, found 90: correct the value"
        );
        for value in [-0.006, 655.356, f64::NAN, f64::INFINITY] {
            let text = error(&DEVIATION, value).to_string();
            let start = "D32.12 (slant range uncertainty): expected 0 to 655.35 m, found";
            assert!(text.starts_with(start), "{text}");
        }
        for value in [-180.1, 360.1, f64::NAN] {
            let refused = Encoded::default().circle(&LONGITUDE, value);
            let error = refused.unwrap_err().to_string();
            assert!(error.contains("-180 to 360 degrees"), "{error}");
        }
    }

    #[test]
    fn standard_deviations_are_rounded_up() {
        for (value, expected) in [
            (0.0, 0u16),
            (0.001, 1),
            (0.07, 7),
            (0.0701, 8),
            (655.35, 0xffff),
        ] {
            let found = bytes(Encoded::up, &DEVIATION, value);
            assert_eq!(found, expected.to_be_bytes(), "{value}");
        }
        for value in [-0.001, 655.351, f64::NAN] {
            assert!(Encoded::default().up(&DEVIATION, value).is_err());
        }
    }

    #[test]
    fn text_is_filled_with_spaces() {
        let mut encoded = Encoded::default();
        let name = (Number::M(1), "mission plan");
        encoded.text(name, "AB", 0, 4).unwrap();
        assert_eq!(encoded.bytes, b"AB  ");
        for (text, least) in [("ABCDE", 0), ("\u{e4}", 0), ("\n", 0), ("A", 4)] {
            let error = encoded.text(name, text, least, 4).unwrap_err();
            let error = error.to_string();
            assert!(error.starts_with("M1 (mission plan): expected"), "{error}");
        }
    }
}
