//! NISAR L0B files by a script with its own formulas: points appear at their positions with their amplitudes and phases.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::focus::exact::Exact;
use subaperture::io::l0b::{L0bInfo, LookSide};
use subaperture::io::open::{Options, open, open_channels};
use subaperture::phase_history::{Collection, PhaseHistory, ReadError};
use subaperture::prelude::*;

use crate::arrays::python;
use crate::crsd::points;

fn written() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    python("l0b_write.py", folder.path());
    folder
}

/// Distance between pixels, metres.
const STEP_M: f64 = 2.0;
/// Pixels to each side of a point.
const SIDE: usize = 2;

/// Mean of all samples with the phases of a point removed, each frequency at its own time.
fn mean(collection: &Collection, samples: &[Complex32], place: DVec3) -> Complex64 {
    let mut sum = Complex64::ZERO;
    for (pulse, row) in (collection.pulses.iter()).zip(samples.chunks(collection.num_samples)) {
        for (k, z) in row.iter().enumerate() {
            let s = (k as f64 - (collection.num_samples / 2) as f64) * pulse.sweep.sample_s;
            let transmitter = pulse.transmitter_m + pulse.sweep.transmitter_m_s * s;
            let receiver = pulse.receiver_m + pulse.sweep.receiver_m_s * s;
            let path = |p: DVec3| (p - transmitter).length() + (p - receiver).length();
            let f = pulse.start_hz + k as f64 * pulse.step_hz;
            let turns = f * (path(place) - path(pulse.reference_m)) / SPEED_OF_LIGHT_M_S;
            sum += Complex64::new(z.re.into(), z.im.into()) * Complex64::cis(TAU * turns);
        }
    }
    sum / samples.len() as f64
}

/// Offset of the brightest place from the middle of a patch about `place`, metres, by parabolas through the brightest pixel and its
/// neighbours.
fn peak(history: &dyn PhaseHistory, place: DVec3) -> [f64; 2] {
    let reach_m = SIDE as f64 * STEP_M;
    let axis = |at: f64| format!("{}:{}:{STEP_M}", at - reach_m, at + reach_m + STEP_M / 2.0);
    let grid = format!("x={},y={},z={}", axis(place.x), axis(place.y), place.z);
    let grid: ImageGrid = grid.parse().unwrap();
    let image = Exact.focus(history, &grid).unwrap().image;
    let count = 2 * SIDE + 1;
    assert_eq!((image.rows, image.columns), (count, count));
    let level = |row: usize, column: usize| f64::from(image.pixels[row * count + column].norm());
    let inner = 1..count - 1;
    let (row, column) = inner
        .clone()
        .flat_map(|row| inner.clone().map(move |column| (row, column)))
        .max_by(|a, b| level(a.0, a.1).total_cmp(&level(b.0, b.1)))
        .unwrap();
    let vertex =
        |before: f64, at: f64, after: f64| 0.5 * (before - after) / (before - 2.0 * at + after);
    let along_x = vertex(
        level(row, column - 1),
        level(row, column),
        level(row, column + 1),
    );
    let along_y = vertex(
        level(row - 1, column),
        level(row, column),
        level(row + 1, column),
    );
    let offset_m = |at: usize, part: f64| (at as f64 - SIDE as f64 + part) * STEP_M;
    [offset_m(column, along_x), offset_m(row, along_y)]
}

/// Tenth of the resolution of 12 m along the ground and 9 m along the track.
const MOST_OFF_M: [f64; 2] = [1.2, 0.9];

#[test]
fn points_of_script_have_positions_amplitudes_and_phases() {
    let folder = written();
    // A gap of 50 samples takes as much of the band of each point, whose echoes have 480.
    let gap = 1.0 - 50.0 / 480.0;
    for (name, channel, pulses, gain) in [
        ("float", None, 150, 1.0),
        ("half", None, 150, 1.0),
        ("half", Some("A-VV"), 150, 2.0),
        ("coded", Some("1"), 148, gap),
    ] {
        let path = folder.path().join(format!("{name}.h5"));
        let options = Options {
            channel,
            ..Options::default()
        };
        let history = open(&path, &options).unwrap();
        let collection = history.collection();
        // Calibration pulses are left out.
        assert_eq!(collection.pulses.len(), pulses, "{name}");
        assert_eq!(history.warnings().len(), usize::from(pulses < 150));
        assert_eq!(history.defects(), [], "{name}");
        let width = collection.num_samples;
        // Reading other blocks of pulses gives the same bits.
        let mut samples = vec![Complex32::ZERO; pulses * width];
        history.read(0..pulses, &mut samples).unwrap();
        let mut some = vec![Complex32::ZERO; 9 * width];
        history.read(66..75, &mut some).unwrap();
        assert_eq!(some, samples[66 * width..75 * width]);

        for (ecf, amplitude) in points(&path.with_extension("txt")) {
            let place = collection.frame.from_ecf_m(ecf);
            let [x_m, y_m] = peak(&*history, place);
            let value = mean(collection, &samples, place) / gain;
            println!(
                "{name} {place:.1}: {x_m:.3} m, {y_m:.3} m off, {value:.4} and not {amplitude}"
            );
            assert!(
                x_m.abs() < MOST_OFF_M[0] && y_m.abs() < MOST_OFF_M[1],
                "{name} {place}: {x_m} m, {y_m} m"
            );
            // Side lobes of the others at 60 and more cells, 0.005 in range times 0.005 along the track; the ends of a sweep and of a gap.
            assert!(
                (value - amplitude).norm() < 0.005,
                "{name} {place}: {value} and not {amplitude}"
            );
        }
    }
}

#[test]
fn metadata_state_channels_and_scene() {
    let folder = written();
    let info = L0bInfo::read(folder.path().join("half.h5"), u64::MAX).unwrap();
    let names: Vec<&str> = info.channels.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["A-HH", "A-VV"]);
    assert_eq!(
        (info.instrument.as_str(), info.mission.as_deref(), info.look),
        ("LSAR", Some("TEST"), LookSide::Left)
    );
    // The first point of the script is the middle of the scene.
    let [(first, _), ..] = points(&folder.path().join("half.txt"))[..] else {
        panic!("no points");
    };
    assert!(info.frame.from_ecf_m(first).length() < 1e-3);
    let all = open_channels::<&str>(&folder.path().join("half.h5"), None, &Options::default());
    assert_eq!(all.unwrap().len(), 2);
    let history = open(&folder.path().join("half.h5"), &Options::default()).unwrap();
    // 2026-01-01 01:00:39.255 UTC, and at most a millisecond around it.
    let start_ns = history.start_ns().unwrap();
    assert!(
        (start_ns - 1_767_229_239_255_000_000).abs() <= 1_000_000,
        "{start_ns}"
    );
}

#[test]
fn unsupported_l0b_is_refused_with_a_reason() {
    let folder = written();
    python("l0b_change.py", folder.path());
    for (name, word) in [
        ("diagnostic", "expected 0 (science mode), found 2"),
        (
            "slc",
            "expected the product RRSD (raw echoes, L0B), found RSLC",
        ),
        ("legacy", "expected a group lowRateTelemetry"),
        (
            "legendre",
            "expected interpMethod Hermite, found 'Legendre'",
        ),
        ("cube", "expected samples of shape [pulses, samples]"),
        (
            "untabled",
            "expected pairs of 16-bit codes with a table BFPQLUT",
        ),
        ("short_table", "expected 65536 values"),
        ("late", "within the orbit's state vectors"),
        (
            "backwards",
            "found pulse 7 not later than the pulse before it",
        ),
        ("uneven", "expected positive ranges"),
        ("timeless", "expected the attribute units"),
        ("near", "expected ranges from the orbit to the ground"),
        (
            "long_pulse",
            "expected a pulse shorter than the receive window",
        ),
        ("calibration", "found only calibration pulses"),
        ("sideways", "expected left or right, found 'up'"),
    ] {
        let path = folder.path().join(format!("{name}.h5"));
        let error = open(&path, &Options::default()).err();
        let message = error
            .unwrap_or_else(|| panic!("{name} was read"))
            .to_string();
        assert!(
            message.contains(word) && message.contains(&format!("{name}.h5")),
            "{name}: {message}"
        );
    }
    // Samples that are not finite are reported when they are read, and those of unused codes are 0.
    let history = open(&folder.path().join("infinite.h5"), &Options::default()).unwrap();
    let mut row = vec![Complex32::ZERO; history.collection().num_samples];
    let warnings = history.warnings();
    assert!(
        matches!(&warnings[..], [text] if text.contains("the samples were not examined for defects") && text.contains("pulse 5")),
        "{warnings:?}"
    );
    assert_eq!(history.defects(), []);
    let error = history.read(5..6, &mut row).unwrap_err();
    assert!(
        matches!(error, ReadError::NotFinite { pulse: 5, .. }),
        "{error}"
    );
    let path = folder.path().join("coded.h5");
    let error = L0bInfo::read(&path, 1000).unwrap_err();
    assert!(matches!(error, ReadError::Memory { .. }), "{error}");
    let options = Options {
        memory_bytes: 200_000,
        ..Options::default()
    };
    let error = open(&path, &options).err().unwrap();
    assert!(matches!(error, ReadError::Memory { .. }), "{error}");
    let options = Options {
        channel: Some("B-HH"),
        ..Options::default()
    };
    let message = open(&path, &options).err().unwrap().to_string();
    assert!(message.contains("expected one of: A-HH"), "{message}");
}
