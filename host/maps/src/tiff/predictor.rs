//! TIFF predictors: differencing of samples before compression.

/// Horizontal differencing of 8-bit samples (predictor 2, TIFF 6.0 section 14), one band.
pub(crate) fn bytes_differenced(samples: &mut [u8], columns: usize) {
    for row in samples.chunks_mut(columns) {
        for i in (1..row.len()).rev() {
            row[i] = row[i].wrapping_sub(row[i - 1]);
        }
    }
}

/// Floating-point differencing (predictor 3, TIFF technical note 3): the bytes of a row ordered by significance, most significant first, then differences of
/// bytes `bands` apart (bands interleaved by pixel).
pub(crate) fn floats_differenced(samples: &[f32], columns: usize, bands: usize) -> Vec<u8> {
    let line = columns * bands;
    let mut bytes = vec![0; samples.len() * 4];
    for (row, out) in samples.chunks(line).zip(bytes.chunks_mut(line * 4)) {
        for (i, sample) in row.iter().enumerate() {
            for (k, byte) in sample.to_be_bytes().into_iter().enumerate() {
                out[k * row.len() + i] = byte;
            }
        }
        for i in (bands..out.len()).rev() {
            out[i] = out[i].wrapping_sub(out[i - bands]);
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictors_agree_with_hand_computed_differences() {
        let mut bytes = [10, 12, 11, 5, 5, 255];
        bytes_differenced(&mut bytes, 3);
        assert_eq!(bytes, [10, 2, 255, 5, 0, 250]);
        // 1.0 is 3f 80 00 00, -2.5 is c0 20 00 00: 3f c0 80 20 0 0 0 0, and its differences.
        let one = floats_differenced(&[1.0, -2.5], 2, 1);
        assert_eq!(one, [0x3f, 0x81, 0xc0, 0xa0, 0xe0, 0, 0, 0]);
        // Two bands: each byte minus the byte two before.
        let two = floats_differenced(&[1.0, -2.5], 1, 2);
        assert_eq!(two, [0x3f, 0xc0, 0x41, 0x60, 0x80, 0xe0, 0, 0]);
    }
}
