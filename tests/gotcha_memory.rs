//! Damaged GOTCHA files: cut at every byte, every byte flipped. Nothing panics, nothing hangs, and no
//! damage makes the reader ask for more memory than three times the file.
//!
//! One test in a binary of its own, for the allocator's count is the process's.

use std::path::Path;
use std::time::{Duration, Instant};

use peak_alloc::PeakAlloc;
use subaperture::io::gotcha;
use subaperture::phase_history::{PhaseHistory, ReadError};
use subaperture_tests::matlab::{self, Value};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Reads `bytes` and returns the outcome and the bytes allocated at the peak.
fn measured(path: &Path, bytes: &[u8]) -> (Result<usize, ReadError>, usize) {
    std::fs::write(path, bytes).unwrap();
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let begin = Instant::now();
    let result = gotcha::read(path, u64::MAX).map(|r| r.collection().pulses.len());
    // Microseconds for the small files; ten seconds on any machine mean a hang.
    assert!(begin.elapsed() < Duration::from_secs(10));
    (result, MEMORY.peak_usage().saturating_sub(before))
}

#[test]
fn cut_and_flipped_files_are_errors_of_bounded_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sample.mat");
    let data = matlab::matrix("data", &Value::Structure(1, 1, matlab::gotcha_fields()));
    for bytes in [
        matlab::file(std::slice::from_ref(&data)),
        matlab::file(&[matlab::compressed(&data)]),
    ] {
        // Messages, paths and, if packed, zlib's window of 32 KiB come on top of the data.
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

    // A large file: the samples' 8 bytes each, twice, and little else.
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
}
