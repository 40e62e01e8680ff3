//! Damaged GOTCHA files, truncated at every byte and with every byte flipped: no panic, no endless loop, and no more memory than three
//! times the file.

use std::path::Path;
use std::time::{Duration, Instant};

use subaperture::io::gotcha;
use subaperture::phase_history::{PhaseHistory, ReadError};
use subaperture_tests::matlab::{self, Value};

use crate::{MEMORY, alone};

/// Read `bytes`; returns the outcome and the peak of allocated bytes.
fn measured(path: &Path, bytes: &[u8]) -> (Result<usize, ReadError>, usize) {
    measured_within(path, bytes, u64::MAX)
}

fn measured_within(path: &Path, bytes: &[u8], memory: u64) -> (Result<usize, ReadError>, usize) {
    std::fs::write(path, bytes).unwrap();
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let begin = Instant::now();
    let result = gotcha::read(path, memory).map(|r| r.collection().pulses.len());
    // Microseconds for the small files; ten seconds mean an endless loop on any machine.
    assert!(begin.elapsed() < Duration::from_secs(10));
    (result, MEMORY.peak_usage().saturating_sub(before))
}

/// `data` of `rows` frequencies and `columns` pulses whose `fp` is a matrix of doubles, each stored in one byte as MATLAB stores integers.
fn one_byte_numbers(rows: i32, columns: i32) -> Vec<u8> {
    let count = rows as usize * columns as usize;
    let words =
        |values: &[i32]| -> Vec<u8> { values.iter().flat_map(|v| v.to_le_bytes()).collect() };
    // Flags (class double, complex), dimensions, no name.
    let mut fp = words(&[6, 8, 0x0806, 0, 5, 8, rows, columns, 1, 0]);
    let mut state = 1u32;
    for _ in 0..2 {
        fp.extend(words(&[1, count as i32]));
        fp.extend((0..count).map(|_| {
            // Marsaglia's xorshift, which does not compress.
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            state as u8
        }));
        fp.resize(fp.len().next_multiple_of(8), 0);
    }
    let mut fields = matlab::gotcha_fields();
    fields[1].1 = Value::Double(
        rows,
        1,
        (0..rows).map(|k| 1e9 + 1e6 * f64::from(k)).collect(),
    );
    for field in &mut fields[2..6] {
        field.1 = Value::Double(1, columns, vec![1000.0; columns as usize]);
    }
    // `fp` goes last, in place of an empty element of 8 bytes.
    fields.remove(0);
    fields.push(("fp", Value::Empty));
    let mut data = matlab::matrix("data", &Value::Structure(1, 1, fields));
    data.truncate(data.len() - 8);
    data.extend(words(&[14, fp.len() as i32]));
    data.extend(fp);
    let size = data.len() as u32 - 8;
    data[4..8].copy_from_slice(&size.to_le_bytes());
    data
}

fn numbers_of_one_byte_are_counted_as_samples(path: &Path) {
    let (rows, columns) = (1000, 500);
    let data = one_byte_numbers(rows, columns);
    for (bytes, unpacked) in [
        (matlab::file(std::slice::from_ref(&data)), 0),
        // Uncompressed, without its own tag of 8 bytes.
        (matlab::file(&[matlab::compressed(&data)]), data.len() - 8),
    ] {
        // A sample needs 8 bytes, a frequency 8, a pulse 264 and four numbers of 8 each.
        let (k, n) = (rows as usize, columns as usize);
        let needed = bytes.len() + unpacked + 8 * k * n + 8 * k + (264 + 32) * n;
        let (result, peak) = measured_within(path, &bytes, needed as u64 - 1);
        match result {
            Err(ReadError::Memory { needed_bytes, .. }) => assert_eq!(needed_bytes, needed as u64),
            other => panic!("{other:?}"),
        }
        // Messages, names and zlib's window of 32 KiB are not counted.
        assert!(peak < bytes.len() + unpacked + 100_000, "{peak} bytes");
        let (result, peak) = measured_within(path, &bytes, needed as u64);
        assert_eq!(result.unwrap(), 500);
        assert!(peak < needed + 100_000, "{peak} bytes, {needed} promised");
    }
}

#[test]
fn truncated_and_flipped_files_are_errors_within_bounded_memory() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.mat");
    let data = matlab::matrix("data", &Value::Structure(1, 1, matlab::gotcha_fields()));
    for bytes in [
        matlab::file(std::slice::from_ref(&data)),
        matlab::file(&[matlab::compressed(&data)]),
    ] {
        // Messages, paths and, for compressed files, zlib's window of 32 KiB are added to the data.
        let bound = 3 * bytes.len() + 100_000;
        for cut in 0..bytes.len() {
            let (result, peak) = measured(&path, &bytes[..cut]);
            assert!(result.is_err(), "cut at {cut} of {} passed", bytes.len());
            assert!(peak < bound, "cut at {cut}: {peak} bytes");
        }
        for at in 0..bytes.len() {
            for flip in [0x01, 0x10, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                bytes[at] ^= flip;
                let (_, peak) = measured(&path, &bytes);
                assert!(peak < bound, "byte {at} ^ {flip:#x}: {peak} bytes");
            }
        }
    }

    // A large file: the samples' 8 bytes each, twice, and little more.
    let mut fields = matlab::gotcha_fields();
    let count = 1000 * 500;
    fields[0].1 = Value::Complex(1000, 500, vec![1.0; count], vec![0.5; count]);
    fields[1].1 = Value::Double(
        1000,
        1,
        (0..1000).map(|k| 1e9 + 1e6 * f64::from(k)).collect(),
    );
    for field in &mut fields[2..6] {
        field.1 = Value::Double(1, 500, vec![1000.0; 500]);
    }
    let bytes = matlab::gotcha(fields);
    let (result, peak) = measured(&path, &bytes);
    assert_eq!(result.unwrap(), 500);
    let promised = gotcha::needed_bytes(bytes.len() as u64) as usize;
    assert!(peak <= promised, "{peak} bytes, {promised} promised");

    numbers_of_one_byte_are_counted_as_samples(&path);
}
