//! Fields of the tables of STANAG 4607: number, name, data type, unit and range.
//!
//! | type | count | resolution |
//! |---|---|---|
//! | E8, FL8, I8, I16, I32 | unsigned | unit of the field |
//! | S8, S16, S32 | two's complement | unit of the field |
//! | BA16, BA32 | unsigned | `360 / 2^n` degrees |
//! | SA32 | two's complement | `180 / 2^32` degrees |
//! | B16 | sign and magnitude, 7 fraction bits | `1 / 128` |
//!
//! A value is `count * resolution`. The only B16 field is not negative, so its count is an unsigned integer too.

use super::error::StanagError;

/// Number of a field, as in the tables of the standard.
#[derive(Clone, Copy, Debug)]
pub(super) enum Number {
    /// Field of the packet header, P1 to P10.
    P(u32),
    /// Field of the Mission Segment, M1 to M7.
    M(u32),
    /// Field of the Job Definition Segment, J1 to J28.
    J(u32),
    /// Field of the Dwell Segment, D2 to D31.
    D(u32),
    /// Field of a Target Report, D32.1 to D32.18.
    T(u32),
}

impl Number {
    /// Bit in the existence mask (D1), 0 for fields of other segments.
    pub(super) fn mask(self) -> u64 {
        match self {
            Self::D(number) => 1 << (65 - number),
            Self::T(number) => 1 << (34 - number),
            Self::P(_) | Self::M(_) | Self::J(_) => 0,
        }
    }
}

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::P(number) => write!(f, "P{number}"),
            Self::M(number) => write!(f, "M{number}"),
            Self::J(number) => write!(f, "J{number}"),
            Self::D(number) => write!(f, "D{number}"),
            Self::T(number) => write!(f, "D32.{number}"),
        }
    }
}

/// Field with a number as its value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field {
    pub(super) number: Number,
    name: &'static str,
    pub(super) bytes: usize,
    /// Value of one count.
    pub(super) resolution: f64,
    unit: &'static str,
    /// Smallest and largest count.
    pub(super) counts: [i64; 2],
}

impl Field {
    /// Integer of `bytes` bytes. One count is `resolution` units.
    pub(super) const fn scaled(
        number: Number,
        name: &'static str,
        bytes: usize,
        (resolution, unit): (f64, &'static str),
        counts: [i64; 2],
    ) -> Self {
        Self {
            number,
            name,
            bytes,
            resolution,
            unit,
            counts,
        }
    }

    /// Latitude: signed binary angle of 32 bits (SA32).
    pub(super) const fn latitude(number: Number, name: &'static str) -> Self {
        const RESOLUTION_DEG: f64 = 180.0 / (1u64 << 32) as f64;
        let counts = [i32::MIN as i64, i32::MAX as i64];
        Self::scaled(number, name, 4, (RESOLUTION_DEG, "degrees"), counts)
    }

    /// Longitude: binary angle of 32 bits (BA32).
    pub(super) const fn longitude(number: Number, name: &'static str) -> Self {
        const RESOLUTION_DEG: f64 = 360.0 / (1u64 << 32) as f64;
        let counts = [0, u32::MAX as i64];
        Self::scaled(number, name, 4, (RESOLUTION_DEG, "degrees"), counts)
    }

    /// Binary angle of 16 bits (BA16) from 0 to `most` counts.
    pub(super) const fn angle(number: Number, name: &'static str, most: i64) -> Self {
        const RESOLUTION_DEG: f64 = 360.0 / (1u64 << 16) as f64;
        Self::scaled(number, name, 2, (RESOLUTION_DEG, "degrees"), [0, most])
    }

    pub(super) fn label(&self) -> String {
        format!("{} ({})", self.number, self.name)
    }

    /// Error of a value outside of a range.
    pub(super) fn outside(&self, [least, most]: [f64; 2], found: f64) -> StanagError {
        let rounded = |value: f64| (value * 1e9).round() / 1e9;
        StanagError::Range {
            field: self.label(),
            least: rounded(least),
            most: rounded(most),
            unit: self.unit,
            found,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn existence_mask_has_the_bits_of_the_standard() {
        // Figure 3-1: D2 is bit 7 of byte 7, D31 bit 2 of byte 4, D32.1 bit 1 of byte 4, D32.18 bit 0 of byte 2.
        assert_eq!(Number::D(2).mask(), 1 << 63);
        assert_eq!(Number::D(31).mask(), 1 << 34);
        assert_eq!(Number::T(1).mask(), 1 << 33);
        assert_eq!(Number::T(18).mask(), 1 << 16);
    }
}
