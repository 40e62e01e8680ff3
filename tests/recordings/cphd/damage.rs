//! Damaged CPHD files, truncated at any byte or with changed bytes, give errors and never panic.

use std::path::Path;

use proptest::prelude::*;
use subaperture::io::cphd::{Channel, Cphd, Domain, Sgn, WriteOptions, write};
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;

use super::by_hand::ByHand;
use super::scene::{Scene, read_all};

/// Bytes of a file with two channels by the library's writer.
fn written(folder: &Path, domain: Domain) -> Vec<u8> {
    let path = folder.join("whole.cphd");
    let scene = |num_pulses, num_samples| Scene {
        num_pulses,
        num_samples,
        ..Scene::default()
    };
    let (first, second) = (scene(3, 5).recorded(), scene(2, 7).recorded());
    let options = WriteOptions {
        domain,
        sgn: Sgn::Plus,
        ..WriteOptions::default()
    };
    let channels = [Channel::new("A", &first), Channel::new("B", &second)];
    write(&path, &channels, &options, &Silent).unwrap();
    std::fs::read(&path).unwrap()
}

#[test]
fn file_truncated_at_any_byte_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.cphd");
    let whole = written(folder.path(), Domain::Fx);
    std::fs::write(&path, &whole).unwrap();
    assert!(Cphd::open(&path, None, u64::MAX).is_ok());
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    for len in (0..whole.len()).rev() {
        file.set_len(len as u64).unwrap();
        let Err(error) = Cphd::open(&path, None, u64::MAX) else {
            panic!("a file of {len} bytes of {} was opened", whole.len());
        };
        let error = error.to_string();
        assert!(
            error.contains("cut") || error.contains("empty") || error.contains("at the start of"),
            "{len}: {error}"
        );
    }
}

#[test]
fn long_signal_truncated_anywhere_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.cphd");
    let recorded = Scene {
        num_pulses: 300,
        num_samples: 500,
        ..Scene::default()
    }
    .recorded();
    let channel = Channel::new("1", &recorded);
    write(&path, &[channel], &WriteOptions::default(), &Silent).unwrap();
    let whole = std::fs::metadata(&path).unwrap().len();
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    for len in (0..whole).rev().step_by(3371) {
        file.set_len(len).unwrap();
        assert!(Cphd::open(&path, None, u64::MAX).is_err());
    }
}

/// Open every channel and read all of it; errors are accepted, panics are not.
fn exercise(bytes: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flipped.cphd");
    std::fs::write(&path, bytes).unwrap();
    for channel in [None, Some("A"), Some("B")] {
        if let Ok(cphd) = Cphd::open(&path, channel, u64::MAX) {
            let size = cphd.collection().pulses.len() * cphd.collection().num_samples;
            assert!(size <= 4 * bytes.len(), "{size} samples from nowhere");
            let _ = read_all(&cphd);
            cphd.inputs().unwrap();
        }
    }
}

fn flip(mut bytes: Vec<u8>, flips: &[(usize, u8)]) {
    for &(at, with) in flips {
        let at = at % bytes.len();
        bytes[at] ^= with;
    }
    exercise(&bytes);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn flipped_bytes_never_panic(
        which in 0..4usize,
        flips in prop::collection::vec((any::<usize>(), 1u8..), 1..6),
    ) {
        use std::sync::LazyLock;
        static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            let by_hand = ByHand {
                amp_sf: Some([1.0, 2.0, 3.0]),
                signal_pvp: Some([1, 0, 1]),
                ..ByHand::new("CI2", vec![7; 24])
            };
            vec![
                written(folder.path(), Domain::Fx),
                written(folder.path(), Domain::Toa),
                by_hand.bytes(),
                ByHand { domain: "TOA", axis: [-1e-8, 5e-9, 9e9, 9.1e9], ..by_hand }.bytes(),
            ]
        });
        flip(FILES[which].clone(), &flips);
    }

    /// Digits of header and XML replaced by others: wrong sizes, offsets and counts.
    #[test]
    fn changed_digits_never_panic(
        toa in any::<bool>(),
        changes in prop::collection::vec((any::<usize>(), b'0'..=b'9'), 1..4),
    ) {
        let by_hand = ByHand {
            domain: if toa { "TOA" } else { "FX" },
            axis: if toa { [-1e-8, 5e-9, 9e9, 9.1e9] } else { [9e9, 1e6, 9e9, 9.003e9] },
            ..ByHand::new("CI2", vec![7; 24])
        };
        let mut bytes = by_hand.bytes();
        let text = 512 + by_hand.xml().len();
        let digits: Vec<usize> =
            (0..text).filter(|&i| bytes[i].is_ascii_digit()).collect();
        for (which, digit) in changes {
            bytes[digits[which % digits.len()]] = digit;
        }
        exercise(&bytes);
    }
}
