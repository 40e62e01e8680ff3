//! Damaged files of the Gotcha GMTI challenge, parameters truncated at every byte and with every byte flipped, samples truncated: no panic, no endless loop, and bounded memory.

use std::path::Path;
use std::time::{Duration, Instant};

use subaperture::io::gotcha_gmti::{GotchaGmti, Settings};
use subaperture::phase_history::{PhaseHistory, ReadError};
use subaperture_tests::gotcha_gmti::{Content, PULSES};

use crate::{MEMORY, alone};

/// Write a file and open the collection; returns the outcome and the peak of allocated bytes.
fn measured(path: &Path, name: &str, bytes: &[u8]) -> (Result<usize, ReadError>, usize) {
    std::fs::write(path.with_file_name(name), bytes).unwrap();
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let begin = Instant::now();
    let opened = GotchaGmti::open(path, None, &Settings::default(), u64::MAX);
    let result = opened.map(|history| history.collection().pulses.len());
    // Microseconds; ten seconds mean an endless loop on any machine.
    assert!(begin.elapsed() < Duration::from_secs(10));
    (result, MEMORY.peak_usage().saturating_sub(before))
}

#[test]
fn damaged_collections_are_errors_within_bounded_memory() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let content = Content::default();
    let path = content.write(folder.path());
    let (auxiliary, positions) = (content.auxiliary_file(), content.positions_file());
    // Messages, paths, a pulse of samples and the parameters of three pulses are added to a file.
    let bound = 3 * auxiliary.len().max(positions.len()) + 100_000;
    for (name, whole) in [
        ("a_chan1_b_PH_auxSaveData.mat", &auxiliary),
        ("a_b_PAUX.mat", &positions),
    ] {
        for cut in 0..whole.len() {
            let (result, peak) = measured(&path, name, &whole[..cut]);
            assert!(result.is_err(), "{name}: cut at {cut} of {}", whole.len());
            assert!(peak < bound, "{name}: cut at {cut}: {peak} bytes");
        }
        for at in 0..whole.len() {
            for flip in [0x01, 0x80] {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                let (_, peak) = measured(&path, name, &bytes);
                assert!(peak < bound, "{name}: byte {at} ^ {flip:#x}: {peak} bytes");
            }
        }
        assert_eq!(measured(&path, name, whole).0.unwrap(), PULSES);
    }
    for cut in (0..content.samples.len()).step_by(61) {
        let (result, peak) = measured(&path, "a_chan1_b_PH", &content.samples[..cut]);
        assert!(result.is_err(), "samples cut at {cut}");
        assert!(peak < bound, "samples cut at {cut}: {peak} bytes");
    }
}

/// A file of many pulses: memory during opening is at most that refused one byte below.
#[test]
fn memory_of_opening_is_bounded_by_the_limit() {
    let _alone = alone();
    let folder = tempfile::tempdir().unwrap();
    let path = Content::repeated(2000).write(folder.path());
    let opened = |memory_bytes: u64| {
        let before = MEMORY.current_usage();
        MEMORY.reset_peak_usage();
        let result = GotchaGmti::open(&path, None, &Settings::default(), memory_bytes);
        (result, MEMORY.peak_usage().saturating_sub(before))
    };
    let (mut low, mut high) = (0, 16 << 20);
    assert!(opened(high).0.is_ok());
    while high - low > 1 {
        let middle = (low + high) / 2;
        match opened(middle).0 {
            Ok(_) => high = middle,
            Err(ReadError::Memory { .. }) => low = middle,
            Err(other) => panic!("{other}"),
        }
    }
    let (result, peak) = opened(high);
    let history = result.unwrap();
    println!(
        "{high} bytes needed, {peak} allocated, {} held",
        history.held_bytes()
    );
    // A pulse of samples, names and paths are not counted.
    assert!(peak as u64 <= high + 50_000, "{peak} bytes of {high}");
    assert!(history.held_bytes() <= high);
}
