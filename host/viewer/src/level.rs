//! Encoding of levels for the page: tenths of a decibel in 16 bits.

/// Value for a missing level.
pub(crate) const NONE: i16 = i16::MIN;

/// Convert dB to tenths of dB, saturating at the limits of 16 bits. NaN becomes [`NONE`].
pub(crate) fn tenths(db: f32) -> i16 {
    match db.is_nan() {
        true => NONE,
        // `as` saturates.
        false => ((10.0 * db).round() as i16).max(-i16::MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_encoded_in_tenths_of_db_and_nan_as_none() {
        assert_eq!(tenths(-12.34), -123);
        assert_eq!(tenths(f32::NEG_INFINITY), -32767);
        assert_eq!(tenths(1e9), i16::MAX);
        assert_eq!(tenths(f32::NAN), i16::MIN);
    }
}
