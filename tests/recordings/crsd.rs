//! CRSD files by a script with its own formulas, each accepted by sarkit's `crsdcheck`: points appear at their positions with their
//! amplitudes and phases.
//!
//! Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::io::crsd::{Crsd, CrsdInfo};
use subaperture::io::open::{Options, open, open_channels};
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, ReadError};
use subaperture::prelude::*;

fn written() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("python/crsd_write.py");
    let output = Command::new(&python)
        .arg(script)
        .arg(folder.path())
        .output()
        .unwrap_or_else(|e| panic!("cannot run {python:?} ({e}) with sarkit"));
    println!("{}", String::from_utf8_lossy(&output.stdout));
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    folder
}

/// Positions and amplitudes as stated by the script.
pub(crate) fn points(path: &Path) -> Vec<(DVec3, Complex64)> {
    let text = fs::read_to_string(path).unwrap();
    let numbers = |line: &str| -> Vec<f64> {
        line.split_whitespace()
            .map(|n| n.parse().unwrap())
            .collect()
    };
    text.lines()
        .map(|line| match numbers(line)[..] {
            [x, y, z, re, im] => (DVec3::new(x, y, z), Complex64::new(re, im)),
            _ => panic!("{line}"),
        })
        .collect()
}

/// Expected samples: each frequency at its own time, referred to the reference point at that time.
fn defined(collection: &Collection, points: &[(DVec3, Complex64)]) -> Vec<Complex32> {
    let mut samples = Vec::new();
    for pulse in &collection.pulses {
        for k in 0..collection.num_samples {
            let s = (k as f64 - (collection.num_samples / 2) as f64) * pulse.sweep.sample_s;
            let transmitter = pulse.transmitter_m + pulse.sweep.transmitter_m_s * s;
            let receiver = pulse.receiver_m + pulse.sweep.receiver_m_s * s;
            let path = |p: DVec3| (p - transmitter).length() + (p - receiver).length();
            let reference = path(pulse.reference_m);
            let f = pulse.start_hz + k as f64 * pulse.step_hz;
            let sum: Complex64 = points
                .iter()
                .map(|&(p, a)| {
                    a * Complex64::cis(-TAU * f * (path(p) - reference) / SPEED_OF_LIGHT_M_S)
                })
                .sum();
            samples.push(Complex32::new(sum.re as f32, sum.im as f32));
        }
    }
    samples
}

/// Relative RMS difference, dB.
fn difference_db(a: &[Complex32], b: &[Complex32]) -> f64 {
    let power = |z: Complex32| f64::from(z.norm_sqr());
    let error: f64 = a.iter().zip(b).map(|(&a, &b)| power(a - b)).sum();
    10.0 * (error / b.iter().map(|&z| power(z)).sum::<f64>()).log10()
}

/// Sampling error of a sweep with sharp edges. Echoes are divided by the spectrum of a pulse sampled from its first edge on. The edges of
/// an echo lie anywhere between samples, so each end may have a sample more or less, of amplitude up to 1. A sample has the spectrum `1`,
/// the sweep `|P| = fs sqrt(T / B)`: two samples in power are relatively `sqrt(2 B / T) / fs`, for 125 MHz, 100 MHz and 20 us -31.9 dB.
/// (8-bit samples with a maximum of 2.2 and 127 steps add -45 dB.)
const HISTORY_DB: f64 = -31.9;

/// These errors are smaller in the image: the filter spreads a sample over the pulse's 20 us, 3 km in range, of which the grid's 72 m, 58 m
/// in slant range, contain a fiftieth.
const IMAGE_DB: f64 = HISTORY_DB - 17.0;

/// From orbit two neglects of the model are larger. The echo of a point whose path is 30 m longer than the reference arrives 0.1 us later,
/// when the receiver, approaching at 750 m/s, has moved by 75 um: 0.0151 rad at 31.2 mm (part of `model::phase_history::Sweep`). All phases
/// rotate by `(centre v / c)^2 / (2 chirp)` with `v` the path rate of 1.5 km/s and 2.5 THz/s: 0.0029 rad (`Compressed::moving`). Both at
/// their maxima: -34.9 dB.
const SPACE_IMAGE_DB: f64 = -34.9;

#[test]
fn points_of_script_have_exact_positions_amplitudes_and_phases() {
    let folder = written();
    for (name, vectors, image_db) in [
        ("plain", 64, IMAGE_DB),
        ("falling", 65, IMAGE_DB),
        ("spaceborne", 64, SPACE_IMAGE_DB),
    ] {
        let path = folder.path().join(format!("{name}.crsd"));
        let points = points(&path.with_extension("txt"));
        let history = open(&path, &Options::default()).unwrap();
        // Integers that are scaled to the full range, vector by vector, are not clipped.
        assert_eq!(history.defects(), [], "{name}");
        let collection = history.collection();
        // The vector of noise is left out.
        assert_eq!(collection.pulses.len(), vectors, "{name}");
        assert_eq!(history.start_ns(), Some(1_767_323_045_000_000_000));
        let mut samples = vec![Complex32::ZERO; vectors * collection.num_samples];
        history.read(0..vectors, &mut samples).unwrap();
        // Reading other blocks of pulses gives the same bits.
        let width = collection.num_samples;
        let mut some = vec![Complex32::ZERO; 5 * width];
        history.read(18..23, &mut some).unwrap();
        assert_eq!(some, samples[18 * width..23 * width]);

        let expected = defined(collection, &points);
        let apart_db = difference_db(&samples, &expected);
        println!(
            "{name}: {} frequencies, {apart_db:.1} dB",
            collection.num_samples
        );
        assert!(apart_db < HISTORY_DB, "{name}: {apart_db} dB");

        let grid: ImageGrid = "x=-36:36:0.5,y=-36:36:0.5,z=0".parse().unwrap();
        let ideal = InMemory::new(collection.clone(), expected).unwrap();
        let image = |history: &dyn PhaseHistory| {
            let focusing = Focusing::new(history, &grid);
            focusing
                .by(&Backprojection::default().error_db(-70.0))
                .unwrap()
                .image
        };
        let (seen, wanted) = (image(&*history), image(&ideal));
        let apart_db = difference_db(&seen.pixels, &wanted.pixels);
        println!("{name}: image {apart_db:.1} dB");
        assert!(apart_db < image_db, "{name}: {apart_db} dB");
        for (place, amplitude) in &points {
            let [column, row] = [place.x, place.y].map(|at| ((at + 36.0) / 0.5).round() as usize);
            // The brightest pixel within 5 m is that of the point.
            let around = |at: usize| at - 10..at + 11;
            let power =
                |row: usize, column: usize| seen.pixels[row * seen.columns + column].norm_sqr();
            let brightest = around(row)
                .flat_map(|r| around(column).map(move |c| (r, c)))
                .max_by(|a, b| power(a.0, a.1).total_cmp(&power(b.0, b.1)));
            assert_eq!(brightest, Some((row, column)), "{name}, {place}");
            let value = seen.pixels[row * seen.columns + column];
            let value = Complex64::new(value.re.into(), value.im.into());
            // Taylor side lobes at -35 dB of the two other points, 0.8 and 0.6 at most, and the errors above.
            assert!(
                (value - amplitude).norm() < 0.04,
                "{name}, {place}: {value} and not {amplitude}"
            );
        }
    }
}

#[test]
fn unsupported_crsd_is_refused_with_a_reason() {
    let folder = written();
    let path = folder.path().join("plain.crsd");
    let whole = fs::read(&path).unwrap();
    let changed = folder.path().join("changed.crsd");
    let message = |bytes: &[u8]| {
        fs::write(&changed, bytes).unwrap();
        let error = open(&changed, &Options::default()).err();
        error.expect("it was read").to_string()
    };
    let replaced = |from: &str, to: &str| {
        let at = whole.windows(from.len()).position(|w| w == from.as_bytes());
        let at = at.unwrap_or_else(|| panic!("no {from}"));
        let mut bytes = whole.clone();
        bytes.splice(at..at + from.len(), to.bytes());
        bytes
    };
    for (from, to, word) in [
        ("CRSDsar/1.0", "CRSDtx/1.0 ", "no echoes"),
        ("CRSDsar/1.0", "CRSDrcv/1.0", "the transmitted pulses"),
        (
            "CRSDsar/1.0",
            "CRSDsar/2.0",
            "expected version 1.0, found '2.0'",
        ),
        (">LFM<", ">XM <", "expected TxSequence/TxWFType LFM"),
        ("<NumSamples>3072<", "<NumSamples>3073<", "does not fit"),
        ("<NumPulses>64<", "<NumPulses>65<", "does not fit"),
        ("<Fs>125000000.0<", "<Fs>12500000.00<", "Hz"),
    ] {
        let message = message(&replaced(from, to));
        assert!(
            message.contains(word) && message.contains("changed.crsd"),
            "{from}: {message}"
        );
    }
    // Truncated anywhere.
    for part in 1..40 {
        let cut = whole.len() * part / 40;
        let message = message(&whole[..cut]);
        assert!(message.contains("cut short"), "{cut}: {message}");
    }
    let error = Crsd::open(&path, None, 4096).err().unwrap();
    assert!(matches!(error, ReadError::Memory { .. }), "{error}");
    let error = Crsd::open(&path, Some("X"), u64::MAX).err().unwrap();
    assert!(error.to_string().contains('R'), "{error}");
    let info = CrsdInfo::read(&path).unwrap();
    assert_eq!(info.channels[0].about().name, "R");
    assert_eq!(info.collect_type.as_deref(), Some("MONOSTATIC"));
    assert_eq!(info.num_antenna_patterns, 1);
    let channels = open_channels::<&str>(&path, None, &Options::default()).unwrap();
    assert_eq!(channels.into_inner().len(), 1);
}
