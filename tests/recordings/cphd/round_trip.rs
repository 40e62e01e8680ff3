//! CPHD files by the writer, read back.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use num_complex::Complex32;
use subaperture::geometry::SceneFrame;
use subaperture::io::cphd::{
    Channel, Cphd, Domain, Polarization, Sgn, WriteError, WriteOptions, write,
};
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, ReadError};

use super::scene::{Scene, TRACK, bits, read_all, relative_rms};

fn options(domain: Domain, sgn: Sgn) -> WriteOptions {
    WriteOptions {
        domain,
        sgn,
        ..WriteOptions::default()
    }
}

fn assert_same_geometry(read: &Collection, written: &Collection, relative_hz: f64) {
    assert_eq!(read.pulses.len(), written.pulses.len());
    assert!(read.frame.agrees_with(&written.frame));
    for (a, b) in read.pulses.iter().zip(&written.pulses) {
        assert_eq!(a.time_s, b.time_s);
        // ECF coordinates of 6.4e6 m have rounding errors of up to 4.7e-10 m each, twice (the origin is exact in both directions): 2
        // sqrt(3) 4.7e-10 = 1.6e-9 m.
        for (p, q) in [
            (a.transmitter_m, b.transmitter_m),
            (a.receiver_m, b.receiver_m),
        ] {
            assert!(p.distance(q) < 2e-9, "{p} {q}");
        }
        // The SRP may be moved to match the path to 2e-8 m; two paths of four rounded positions.
        assert!(a.reference_m.distance(b.reference_m) < 2e-3);
        assert!((a.reference_path_m - b.reference_path_m).abs() < 3e-8);
        assert!((a.start_hz - b.start_hz).abs() <= relative_hz * b.start_hz);
        assert!((a.step_hz - b.step_hz).abs() <= relative_hz * b.step_hz);
    }
}

#[test]
fn fx_samples_are_bit_identical() {
    let folder = tempfile::tempdir().unwrap();
    for sgn in [Sgn::Minus, Sgn::Plus] {
        let recorded = Scene::default().recorded();
        let path = folder.path().join("fx.cphd");
        let channel = Channel {
            tx_polarization: Polarization::V,
            rcv_polarization: Polarization::H,
            ..Channel::new("one", &recorded)
        };
        write(&path, &[channel], &options(Domain::Fx, sgn), &Silent).unwrap();
        let cphd = Cphd::open(&path, None, u64::MAX).unwrap();
        let (read, written) = (read_all(&cphd).unwrap(), read_all(&recorded).unwrap());
        assert_eq!(bits(&read), bits(&written));
        assert_same_geometry(cphd.collection(), recorded.collection(), 0.0);
        assert_eq!(cphd.collection().name, "synthetic <&> scene");
        assert_eq!(cphd.collection().extent, recorded.collection().extent);

        // A block of pulses from the middle equals that part of the whole.
        let mut some = vec![Complex32::ZERO; 3 * 24];
        cphd.read(7..10, &mut some).unwrap();
        assert_eq!(bits(&some), bits(&written[7 * 24..10 * 24]));
        cphd.read(5..5, &mut []).unwrap();

        let info = cphd.info();
        assert_eq!((info.domain, info.sgn), (Domain::Fx, sgn));
        assert_eq!(info.version, "1.1.0");
        assert_eq!(info.collect_type.as_deref(), Some("MONOSTATIC"));
        assert_eq!(info.mode_type.as_deref(), Some("SPOTLIGHT"));
        assert_eq!(info.classification.as_deref(), Some("UNCLASSIFIED"));
        assert_eq!(cphd.channel().tx_polarization.as_deref(), Some("V"));
        assert_eq!(cphd.channel().rcv_polarization.as_deref(), Some("H"));
        assert!((info.iarp.latitude_deg - 52.1).abs() < 1e-9);
        assert!((info.iarp.height_m - 60.0).abs() < 1e-3);
    }
}

#[test]
fn toa_samples_agree_to_float32_rounding() {
    let folder = tempfile::tempdir().unwrap();
    // Even and odd counts, and a single frequency.
    for num_samples in [24, 25, 1] {
        for sgn in [Sgn::Minus, Sgn::Plus] {
            let recorded = Scene {
                num_samples,
                ..Scene::default()
            }
            .recorded();
            let path = folder.path().join("toa.cphd");
            let channel = Channel::new("one", &recorded);
            write(&path, &[channel], &options(Domain::Toa, sgn), &Silent).unwrap();
            let cphd = Cphd::open(&path, None, u64::MAX).unwrap();
            assert_eq!(cphd.collection().num_samples, num_samples);
            assert!(cphd.channel().num_samples as usize > num_samples);
            // Frequencies are computed from (FX1 + FX2) / 2 and 1 / (N SCSS): a few roundings of 1.1e-16.
            assert_same_geometry(cphd.collection(), recorded.collection(), 1e-15);
            // K frequencies of RMS S give N >= K delays of RMS S / sqrt(K) (Parseval, with the factor 1/K), each rounded by at most 2^-24
            // of itself. K/N times their sum gives sqrt(K/N) 2^-24 <= 2^-24 of S. Rounding S adds as much: 2 2^-24 = 1.2e-7.
            let error = relative_rms(&read_all(&cphd).unwrap(), &read_all(&recorded).unwrap());
            assert!(error < 1.2e-7, "{num_samples} samples: {error:e}");
        }
    }
}

#[test]
fn channels_of_different_sizes_are_selected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.cphd");
    let first = Scene::default().recorded();
    let second = Scene {
        num_pulses: 17,
        num_samples: 40,
        start_hz: 1.2e9,
        receiver: |t| TRACK(t) + DVec3::new(0.2, 0.0, 0.1),
        ..Scene::default()
    }
    .recorded();
    let channels = [Channel::new("A", &first), Channel::new("B & b", &second)];
    write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
    let open = |id| Cphd::open(&path, id, u64::MAX).unwrap();
    for (id, history) in [
        (None, &first),
        (Some("A"), &first),
        (Some("B & b"), &second),
    ] {
        let cphd = open(id);
        assert_eq!(
            bits(&read_all(&cphd).unwrap()),
            bits(&read_all(history).unwrap())
        );
        assert_same_geometry(cphd.collection(), history.collection(), 0.0);
        let sizes: Vec<_> = cphd
            .channels()
            .iter()
            .map(|c| (c.id.as_str(), c.num_vectors, c.num_samples))
            .collect();
        assert_eq!(sizes, [("A", 32, 24), ("B & b", 17, 40)]);
    }
    let error = Cphd::open(&path, Some("C"), u64::MAX)
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("unknown channel 'C'") && error.contains("A, B & b"),
        "{error}"
    );
}

#[test]
fn reference_path_other_than_geometry_round_trips() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bias.cphd");
    // As in GOTCHA, where reference paths differ by up to 0.8 mm from the geometry.
    for receiver in [TRACK, |t| TRACK(t) + DVec3::new(900.0, -400.0, 50.0)] {
        let recorded = Scene {
            path_bias_m: 0.8e-3,
            receiver,
            ..Scene::default()
        }
        .recorded();
        let channel = Channel::new("1", &recorded);
        write(&path, &[channel], &WriteOptions::default(), &Silent).unwrap();
        let cphd = Cphd::open(&path, None, u64::MAX).unwrap();
        assert_same_geometry(cphd.collection(), recorded.collection(), 0.0);
        assert_eq!(cphd.channel().srp_fixed, Some(false));
        assert_eq!(cphd.info().mode_type.as_deref(), Some("SPOTLIGHT"));
    }
}

/// CRC-32, bit by bit from its polynomial.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

#[test]
fn inputs_state_checksum_of_whole_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cphd");
    let recorded = Scene::default().recorded();
    let channel = Channel::new("1", &recorded);
    write(&path, &[channel], &WriteOptions::default(), &Silent).unwrap();
    let inputs = Cphd::open(&path, None, u64::MAX).unwrap().inputs().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(inputs.len(), 1);
    assert_eq!(inputs[0].path, path);
    assert_eq!(inputs[0].bytes, bytes.len() as u64);
    assert_eq!(inputs[0].identity.text(), format!("{:08x}", crc32(&bytes)));
}

/// A history that fails or cancels when half of it has been read.
struct Interrupting {
    inner: InMemory,
    reads: AtomicUsize,
    fails: bool,
}

impl PhaseHistory for Interrupting {
    fn collection(&self) -> &Collection {
        self.inner.collection()
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        if self.reads.fetch_add(1, Ordering::Relaxed) > 0 && self.fails {
            return Err(ReadError::Mismatch("the cable fell out".to_owned()));
        }
        self.inner.read(pulses, samples)
    }
}

impl Monitor for Interrupting {
    fn progress(&self, fraction: f64) {
        assert!((0.0..=1.0).contains(&fraction));
    }

    fn cancelled(&self) -> bool {
        !self.fails && self.reads.load(Ordering::Relaxed) > 0
    }
}

fn num_entries(folder: &Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}

#[test]
fn failed_write_leaves_no_file_and_keeps_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cphd");
    std::fs::write(&path, "old").unwrap();
    // Pulses of 2 MiB, so that the writer reads several times.
    let scene = Scene {
        num_pulses: 5,
        num_samples: 1 << 18,
        step_hz: 1e3,
        ..Scene::default()
    };
    let samples = vec![Complex32::new(1.0, -1.0); 5 << 18];
    for fails in [true, false] {
        let history = Interrupting {
            inner: InMemory::new(scene.collection(), samples.clone()).unwrap(),
            reads: AtomicUsize::new(0),
            fails,
        };
        let channels = [Channel::new("1", &history)];
        let error = write(&path, &channels, &WriteOptions::default(), &history).unwrap_err();
        if fails {
            assert!(matches!(error, WriteError::Read(_)), "{error}");
        } else {
            assert!(matches!(error, WriteError::Cancelled), "{error}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(num_entries(folder.path()), 1);
    }
    let recorded = Scene::default().recorded();
    let channels = [Channel::new("1", &recorded)];
    // A file in place of a folder.
    let nowhere = path.join("a.cphd");
    let error = write(&nowhere, &channels, &WriteOptions::default(), &Silent).unwrap_err();
    assert!(error.to_string().contains("a.cphd"), "{error}");
    // A folder at the target of the rename.
    let taken = folder.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("x"), "").unwrap();
    let error = write(&taken, &channels, &WriteOptions::default(), &Silent).unwrap_err();
    assert!(error.to_string().contains("taken"), "{error}");
    assert_eq!(num_entries(folder.path()), 2);
    write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
    assert!(Cphd::open(&path, None, u64::MAX).is_ok());
    assert_eq!(num_entries(folder.path()), 2);
}

#[test]
fn inexpressible_recordings_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.cphd");
    let scene = Scene::default();
    let refused = |change: &dyn Fn(&mut Collection), part: &str| {
        let mut collection = scene.collection();
        change(&mut collection);
        let recorded = InMemory::new(collection, scene.samples()).unwrap();
        let channel = Channel::new("1", &recorded);
        let error = write(&path, &[channel], &WriteOptions::default(), &Silent)
            .unwrap_err()
            .to_string();
        assert!(error.contains(part), "{error}");
        assert_eq!(num_entries(folder.path()), 0);
    };
    refused(&|c| c.frame = SceneFrame::Local, "scene frame is local");
    refused(&|c| c.pulses[3].time_s = 0.0, "pulse 3: its time");
    refused(&|c| c.pulses[0].time_s = -1.0, "pulse 0: its time is -1.0");
    refused(&|c| c.pulses[4].time_s = f64::NAN, "pulse 4: time_s");
    refused(&|c| c.pulses[4].step_hz = 0.0, "pulse 4: step_hz");
    refused(
        &|c| c.pulses[5].transmitter_m.y = f64::INFINITY,
        "pulse 5: transmitter_m",
    );
    refused(
        &|c| c.pulses[6].reference_path_m = 0.0,
        "pulse 6 is compensated to a path of 0.0 m",
    );
    refused(
        &|c| c.pulses[6].reference_m = c.pulses[6].transmitter_m,
        "pulse 6 is compensated",
    );
    refused(&|c| c.extent.as_mut().unwrap().x_m = (1.0, 1.0), "extent");
    refused(&|c| c.name = "a\nb".to_owned(), "collection name");

    let recorded = scene.recorded();
    let with = |ids: &[&str], change: &dyn Fn(&mut WriteOptions), part: &str| {
        let channels: Vec<_> = ids.iter().map(|id| Channel::new(*id, &recorded)).collect();
        let mut options = WriteOptions::default();
        change(&mut options);
        let error = write(&path, &channels, &options, &Silent)
            .unwrap_err()
            .to_string();
        assert!(error.contains(part), "{error}");
    };
    with(&[], &|_| (), "no channel");
    with(&["1", "1"], &|_| (), "used twice");
    with(&[""], &|_| (), "empty");
    with(
        &["1"],
        &|o| o.release_info = "A\n\u{c}\n".to_owned(),
        "release_info",
    );
    with(&["1"], &|o| o.collection_start = "today".to_owned(), "YYYY");
}
