//! Recordings in several files from radars with several alternating transmitters and several receivers, by the test's own formulas;
//! parallel channels of any recording.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::autofocus::{Axis, Model, Order, Problem, Search, Sight, Verdict, determine};
use subaperture::focus::FormError;
use subaperture::geometry::SceneFrame;
use subaperture::io::cphd::{self, Polarization, WriteOptions};
use subaperture::io::open::{Options, open, open_channels, open_sum};
use subaperture::io::recording::{RecordingFile, Take};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Collection, InMemory, PhaseHistory, Pulse, ReadError, Sweep};
use subaperture::signal::window::Window;

const TURNS: usize = 4;
const STOPS: usize = 12;
const STOPS_A_FILE: usize = 4;
const SAMPLES: usize = 128;
const START_HZ: f64 = 77e9;
const SLOPE_HZ_S: f64 = 30e12;
const RATE_HZ: f64 = 2e6;
const SPACING_M: f64 = 0.004;
const TRANSMITTERS_M: [f64; 2] = [0.0, 0.0078];
const RECEIVERS_M: [f64; 3] = [0.0, 0.00195, 0.0039];
/// Phase offsets of the second transmitter and the third receiver.
const PHASES_RAD: [[f64; 3]; 2] = [[0.0, 0.0, -0.7], [1.1, 0.0, 0.0]];
const LEVELS: [[f64; 3]; 2] = [[1.0, 1.0, 1.0], [0.5, 1.0, 1.0]];
const POINTS_M: [DVec3; 2] = [DVec3::new(0.1, 1.6, 0.05), DVec3::new(-0.3, 2.2, -0.1)];

/// A scanner that moves upwards, with antennas side by side.
fn antennas_m(stop: usize, transmitter: usize, receiver: usize) -> [DVec3; 2] {
    let up = DVec3::new(0.0, 0.0, -0.022 + stop as f64 * SPACING_M);
    [
        up + DVec3::X * TRANSMITTERS_M[transmitter],
        up + DVec3::X * RECEIVERS_M[receiver],
    ]
}

/// Phase offset (radians) and amplitude factor of an antenna pair.
fn gain(transmitter: usize, receiver: usize) -> (f64, f64) {
    let second = if transmitter == 1 {
        PHASES_RAD[1][0]
    } else {
        0.0
    };
    let level = if transmitter == 1 { LEVELS[1][0] } else { 1.0 };
    (
        second + if receiver == 2 { PHASES_RAD[0][2] } else { 0.0 },
        level,
    )
}

/// A sample of a sweep with a rising beat: `exp(+j 2 pi (start tau + slope tau t - slope tau^2 / 2))`, recorded with the conjugate sign of
/// a phase history.
fn sample(stop: usize, transmitter: usize, receiver: usize, k: usize) -> [f64; 2] {
    let t = k as f64 / RATE_HZ;
    let [from, to] = antennas_m(stop, transmitter, receiver);
    let (phase, level) = gain(transmitter, receiver);
    let mut sum = [0.0; 2];
    for point in POINTS_M {
        let tau = (from.distance(point) + to.distance(point)) / SPEED_OF_LIGHT_M_S;
        let turns = START_HZ * tau + SLOPE_HZ_S * tau * t - 0.5 * SLOPE_HZ_S * tau * tau;
        // The sign of the recording includes the phase offset.
        let (sin, cos) = (TAU * turns.rem_euclid(1.0) - phase).sin_cos();
        sum[0] += level * cos;
        sum[1] += level * sin;
    }
    sum
}

/// Write `scan1.bin`, `scan2.bin`, ...: consecutive stops with `TURNS` cycles of the transmitters each. The four cycles are off by +3, -3,
/// +1 and -1 counts; their mean is exact.
fn write(folder: &Path) {
    for file in 0..STOPS / STOPS_A_FILE {
        let mut bytes = Vec::new();
        for stop in file * STOPS_A_FILE..(file + 1) * STOPS_A_FILE {
            for turn in 0..TURNS {
                let off = [3.0, -3.0, 1.0, -1.0][turn];
                for transmitter in 0..2 {
                    for receiver in 0..3 {
                        for k in (0..SAMPLES).step_by(2) {
                            let pair = [k, k + 1].map(|k| sample(stop, transmitter, receiver, k));
                            for part in 0..2 {
                                for sample in pair {
                                    let count = (sample[part] * 8000.0).round() + off;
                                    bytes.extend((count as i16).to_le_bytes());
                                }
                            }
                        }
                    }
                }
            }
        }
        std::fs::write(folder.join(format!("scan{}.bin", file + 1)), bytes).unwrap();
    }
}

const TEXT: &str = r#"
[recording]
format = "dca1000"
file = "scan{1..3}.bin"
samples = 128
receivers = 3
transmitters = 2
average = 4
phase = "plus"

[radar]
kind = "fmcw"
start = "77 GHz"
slope = "30 MHz/us"
sample_rate = "2 MHz"

[[radar.transmitter]]
[[radar.transmitter]]
offset = "7.8, 0, 0 mm"
phase = "1.1 rad"
level = "-6.0206 dB"

[[radar.receiver]]
[[radar.receiver]]
offset = "1.95, 0, 0 mm"
[[radar.receiver]]
offset = "3.9, 0, 0 mm"
phase = "-0.7 rad"

[platform]
kind = "rail"
from = "0, 0, -22 mm"
to = "0, 0, 1 m"
spacing = "4 mm"
attitude = "0, 0, 0 deg"
"#;

fn described() -> (tempfile::TempDir, RecordingFile) {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let file = RecordingFile::new("scan.toml", TEXT, folder.path());
    (folder, file)
}

/// Relative RMS error of a history against its definition, dB.
fn error_db(history: &dyn PhaseHistory, of: impl Fn(usize) -> (usize, usize, usize)) -> f64 {
    let collection = history.collection();
    let width = collection.num_samples;
    let mut samples = vec![Complex32::ZERO; collection.pulses.len() * width];
    history
        .read(0..collection.pulses.len(), &mut samples)
        .unwrap();
    let (mut error, mut power) = (0.0, 0.0);
    for (n, row) in samples.chunks_exact(width).enumerate() {
        let pulse = &collection.pulses[n];
        let (stop, transmitter, receiver) = of(n);
        let [from, to] = antennas_m(stop, transmitter, receiver);
        assert!(
            pulse.transmitter_m.distance(from) < 1e-12,
            "{n}: {} {from}",
            pulse.transmitter_m
        );
        assert!(
            pulse.receiver_m.distance(to) < 1e-12,
            "{n}: {} {to}",
            pulse.receiver_m
        );
        for (k, z) in row.iter().enumerate() {
            let frequency_hz = pulse.start_hz + k as f64 * pulse.step_hz;
            let (mut re, mut im) = (0.0, 0.0);
            for point in POINTS_M {
                let path_m = from.distance(point) + to.distance(point) - pulse.reference_path_m;
                let phase = -TAU * (frequency_hz * path_m / SPEED_OF_LIGHT_M_S).rem_euclid(1.0);
                re += 8000.0 * phase.cos();
                im += 8000.0 * phase.sin();
            }
            error += (f64::from(z.re) - re).powi(2) + (f64::from(z.im) - im).powi(2);
            power += re * re + im * im;
        }
    }
    10.0 * (error / power).log10()
}

#[test]
fn every_antenna_pair_is_a_pulse_with_its_own_calibration() {
    let (_folder, mut file) = described();
    let history = file.history(u64::MAX).unwrap();
    assert_eq!(history.collection().pulses.len(), STOPS * 6);
    let error = error_db(&history, |n| (n / 6, n % 6 / 3, n % 3));
    println!("all pairs: {error:.1} dB");
    // The sweep is 350 / sqrt(slope) long; Fresnel ripple at its ends is some -43 dB, as in `described.rs`. An uncorrected phase of 1.1
    // rad, or 6 dB in half of the pairs, would give -5 dB.
    assert!(error < -40.0, "{error}");
    // One pair alone.
    file.set("recording.receiver", "3").unwrap();
    file.set("recording.transmitter", "2").unwrap();
    let one = file.history(u64::MAX).unwrap();
    assert_eq!(one.collection().pulses.len(), STOPS);
    assert!(error_db(&one, |n| (n, 1, 2)) < -40.0);
    // A list of files gives the same bits as the pattern that matches them.
    let list = TEXT.replace(
        "\"scan{1..3}.bin\"",
        "[\"scan1.bin\", \"scan2.bin\", \"scan3.bin\"]",
    );
    let (folder, file) = described();
    let read = |history: &dyn PhaseHistory| {
        let collection = history.collection();
        let mut samples = vec![Complex32::ZERO; collection.pulses.len() * collection.num_samples];
        history
            .read(0..collection.pulses.len(), &mut samples)
            .unwrap();
        samples
    };
    let listed = RecordingFile::new("list.toml", list, folder.path())
        .history(u64::MAX)
        .unwrap();
    assert_eq!(read(&listed), read(&file.history(u64::MAX).unwrap()));
    assert_eq!(file.inputs().unwrap().len(), 3);
}

#[test]
fn mismatched_files_and_sections_are_reported() {
    let (folder, _) = described();
    let refuse = |from: &str, to: &str| {
        assert!(TEXT.contains(from), "{from}");
        let file = RecordingFile::new("scan.toml", TEXT.replace(from, to), folder.path());
        file.history(u64::MAX).expect_err("refused").to_string()
    };
    for (from, to, line, part) in [
        (
            "receivers = 3",
            "receivers = 2",
            24,
            "describe one, or as many",
        ),
        (
            "transmitters = 2",
            "transmitters = 4",
            18,
            "describe one, or as many",
        ),
        (
            "average = 4",
            "average = 5",
            8,
            "scan1.bin has 32 sweeps of each receiver, not a multiple of 10 per pulse",
        ),
        (
            "samples = 128",
            "samples = 127",
            5,
            "scan1.bin has 12288 samples",
        ),
        ("scan{1..3}.bin", "scan{1..4}.bin", 4, "scan4.bin"),
        (
            "scan{1..3}.bin",
            "scan{1..9999999}.bin",
            4,
            "at most 100000",
        ),
        (
            "phase = \"plus\"",
            "receiver = 4",
            9,
            "there are 3 receivers",
        ),
        (
            "phase = \"plus\"",
            "transmitter = 3",
            9,
            "there are 2 transmitters",
        ),
        (
            "spacing = \"4 mm\"",
            "spacing = \"4 mm\"\nspeed = \"1 m/s\"",
            34,
            "not both",
        ),
    ] {
        let error = refuse(from, to);
        assert!(
            error.contains(&format!("scan.toml:{line}:")) && error.contains(part),
            "{to}: {error}"
        );
    }
    // A truncated file would shift all later samples.
    let path = folder.path().join("scan2.bin");
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - SAMPLES * 4 * 3]).unwrap();
    let error = RecordingFile::new("scan.toml", TEXT, folder.path()).history(u64::MAX);
    let error = error.expect_err("refused").to_string();
    assert!(
        error.contains("scan2.bin has 31 sweeps") && error.contains("7 are over"),
        "{error}"
    );
}

struct Phase<'a>(&'a RecordingFile);

impl Model for Phase<'_> {
    fn take(&self, values: &[f64], pulses: Option<&[usize]>) -> Result<Take, FormError> {
        let text = format!("{} deg", values[0]);
        let varied = self
            .0
            .with([("radar.transmitter[1].phase", text.as_str())])
            .unwrap();
        Ok(varied.take(u64::MAX, pulses)?)
    }
}

#[test]
fn phase_of_transmitter_is_estimated() {
    let (_folder, file) = described();
    let found = determine(&Problem {
        model: &Phase(&file),
        intervals: &[Axis {
            start: -180.0,
            step: 15.0,
            count: 24,
        }],
        search: Search {
            order: Order::Product,
            refinements: 4,
        },
        sight: &Sight::Points(POINTS_M.to_vec()),
        windows: [Window::None; 2],
        memory_bytes: u64::MAX,
        monitor: &Silent,
    })
    .unwrap();
    let scan = &found.scans[0];
    println!(
        "phase {:?}, error {:?}, {:?}",
        found.best, scan.error, scan.verdict
    );
    // 1.1 rad; two noiseless points at given positions, each in the other's side lobes: 2 degrees.
    assert!(
        (found.best[0] - 1.1f64.to_degrees()).abs() < 2.0,
        "{found:?}"
    );
    assert_eq!(scan.verdict, Verdict::Determined);
}

/// Pulse `n` of each channel belongs to cycle `n`; the channels together have the samples of the whole recording.
#[test]
fn antenna_pairs_are_parallel_channels() {
    let (_folder, file) = described();
    let whole = file.history(u64::MAX).unwrap();
    let width = whole.collection().num_samples;
    let mut all = vec![Complex32::ZERO; STOPS * 6 * width];
    whole.read(0..STOPS * 6, &mut all).unwrap();
    let channels = file.channels(u64::MAX).unwrap();
    assert_eq!((channels.len(), channels.num_pulses()), (6, STOPS));
    for (c, (about, history)) in channels.iter().enumerate() {
        let (transmitter, receiver) = (c / 3, c % 3);
        assert_eq!(about.name, format!("T{}R{}", transmitter + 1, receiver + 1));
        assert_eq!(about.transmitter, Some(format!("T{}", transmitter + 1)));
        assert!(error_db(history, |n| (n, transmitter, receiver)) < -40.0);
        let mut own = vec![Complex32::ZERO; STOPS * width];
        history.read(0..STOPS, &mut own).unwrap();
        for (n, row) in own.chunks_exact(width).enumerate() {
            let at = (n * 6 + c) * width;
            assert_eq!(row, &all[at..at + width], "{c}, {n}");
        }
    }
    // The sum has the pulses of all channels, channel by channel.
    let sum = channels.coherent_sum().unwrap();
    assert!(error_db(&sum, |n| (n % STOPS, n / STOPS / 3, n / STOPS % 3)) < -40.0);
    // A receiver that is not used has no channel.
    let (_folder, mut file) = described();
    file.set("recording.receiver", "3").unwrap();
    let channels = file.channels(u64::MAX).unwrap();
    let names: Vec<&str> = channels.about().map(|about| about.name.as_str()).collect();
    assert_eq!(names, ["T1R3", "T2R3"]);
}

#[test]
fn described_channel_is_opened_by_name_and_number() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path());
    let path = folder.path().join("scan.toml");
    std::fs::write(&path, TEXT).unwrap();
    for wanted in ["T2R3", "6"] {
        let options = Options {
            channel: Some(wanted),
            ..Options::default()
        };
        let one = open(&path, &options).unwrap();
        assert_eq!(one.collection().pulses.len(), STOPS);
        assert!(error_db(&*one, |n| (n, 1, 2)) < -40.0);
        // The description and three files of samples.
        assert_eq!(one.inputs().unwrap().len(), 4);
    }
    let chosen = open_channels(&path, Some(&["T2R1", "1"]), &Options::default()).unwrap();
    let names: Vec<&str> = chosen.about().map(|about| about.name.as_str()).collect();
    assert_eq!(names, ["T2R1", "T1R1"]);
    let error = open_channels(&path, Some(&["T3R1"]), &Options::default())
        .err()
        .unwrap();
    let expected = "unknown channel 'T3R1': expected one of: T1R1, T1R2, T1R3, T2R1, T2R2, T2R3";
    assert_eq!(error.to_string(), expected);
}

/// A history of pulses `first..first + count` with a receiver `apart_m` from the transmitter.
fn pass(first: usize, count: usize, width: usize, apart_m: f64) -> InMemory {
    let pulse = |n: usize| {
        let transmitter_m = DVec3::new(n as f64, -5e3, 1e3);
        let receiver_m = transmitter_m + DVec3::X * apart_m;
        Pulse {
            time_s: n as f64 * 1e-3,
            transmitter_m,
            receiver_m,
            reference_m: DVec3::ZERO,
            reference_path_m: transmitter_m.length() + receiver_m.length(),
            start_hz: 9e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        }
    };
    let collection = Collection {
        name: "pass".to_owned(),
        num_samples: width,
        pulses: (first..first + count).map(pulse).collect(),
        frame: SceneFrame::Earth {
            origin_ecf_m: DVec3::new(6_378_137.0, 0.0, 0.0),
            x_axis_ecf: DVec3::Y,
            y_axis_ecf: DVec3::Z,
        },
        extent: None,
        timed: true,
    };
    let sample = |i: usize| Complex32::new((first * width + i) as f32, apart_m as f32);
    InMemory::new(collection, (0..count * width).map(sample).collect()).unwrap()
}

/// Write histories as channels of a CPHD file with these polarisations.
fn write_cphd(path: &Path, channels: &[(&str, &InMemory, [Polarization; 2])]) {
    let channels: Vec<cphd::Channel> = (channels.iter())
        .map(
            |&(id, history, [tx_polarization, rcv_polarization])| cphd::Channel {
                tx_polarization,
                rcv_polarization,
                ..cphd::Channel::new(id, history)
            },
        )
        .collect();
    cphd::write(path, &channels, &WriteOptions::default(), &Silent).unwrap();
}

const H: Polarization = Polarization::H;
const V: Polarization = Polarization::V;

#[test]
fn cphd_channels_are_read_in_parallel() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.cphd");
    let histories = [pass(0, 9, 4, 0.0), pass(0, 9, 4, 1.5)];
    let [fore, aft] = &histories;
    write_cphd(&path, &[("fore", fore, [V, V]), ("aft", aft, [V, V])]);
    let channels = open_channels::<&str>(&path, None, &Options::default()).unwrap();
    assert_eq!((channels.len(), channels.num_pulses()), (2, 9));
    for ((about, read), (name, written)) in
        channels.iter().zip(["fore", "aft"].iter().zip(&histories))
    {
        assert_eq!(&about.name, name);
        assert_eq!(about.tx_polarization.as_deref(), Some("V"));
        // The samples are the written bits, in a channel opened alone and among the others.
        let mut got = [vec![Complex32::ZERO; 20], vec![Complex32::ZERO; 20]];
        let options = Options {
            channel: Some(name),
            ..Options::default()
        };
        let alone = open(&path, &options).unwrap();
        read.read(3..8, &mut got[0]).unwrap();
        alone.read(3..8, &mut got[1]).unwrap();
        assert_eq!(got[0], got[1]);
        written.read(3..8, &mut got[1]).unwrap();
        assert_eq!(got[0], got[1]);
        for (a, b) in read
            .collection()
            .pulses
            .iter()
            .zip(&written.collection().pulses)
        {
            assert!(a.receiver_m.distance(b.receiver_m) < 1e-8 && a.time_s == b.time_s);
        }
        assert_eq!(read.channels(), vec![about.clone()]);
    }
    let sum = channels.coherent_sum().unwrap();
    assert_eq!(sum.inputs().unwrap().len(), 1);
    let names: Vec<String> = sum.channels().into_iter().map(|about| about.name).collect();
    assert_eq!(names, ["fore", "aft"]);
    assert_eq!(sum.collection().name, "pass channels fore, aft");
    // All channels together hold no more memory than allowed.
    let each = sum.side_by_side().channel(0).held_bytes();
    let xml_bytes = 1 << 20;
    let options = |memory_bytes| Options {
        memory_bytes,
        ..Options::default()
    };
    assert!(open_channels::<&str>(&path, None, &options(xml_bytes)).is_ok());
    let error = open_channels::<&str>(&path, None, &options(each))
        .err()
        .unwrap();
    assert!(matches!(error, ReadError::Memory { .. }), "{error}");
}

#[test]
fn recordings_of_several_channels_are_joined_by_channel() {
    let folder = tempfile::tempdir().unwrap();
    let [early, late] = ["early.cphd", "late.cphd"].map(|name| folder.path().join(name));
    let none = [Polarization::Unspecified; 2];
    let write = |path: &Path, first: usize, count: usize| {
        let [fore, aft] = [pass(first, count, 4, 0.0), pass(first, count, 4, 1.5)];
        write_cphd(path, &[("fore", &fore, none), ("aft", &aft, none)]);
    };
    write(&early, 0, 5);
    write(&late, 5, 3);
    // Named in either order.
    let sum = open_sum::<_, &str>(&[&late, &early], None, &Options::default()).unwrap();
    let collection = sum.collection();
    assert_eq!((collection.pulses.len(), collection.num_turns()), (16, 8));
    let mut samples = vec![Complex32::ZERO; 16 * 4];
    sum.read(0..16, &mut samples).unwrap();
    for (i, z) in samples.iter().enumerate() {
        let apart = if i < 32 { 0.0 } else { 1.5 };
        assert_eq!(*z, Complex32::new((i % 32) as f32, apart));
    }
    // A recording that lacks a channel, and one with another polarisation, are refused.
    let other = pass(8, 3, 4, 0.0);
    write_cphd(&late, &[("fore", &other, none)]);
    let error = open_sum::<_, &str>(&[&early, &late], None, &Options::default())
        .err()
        .unwrap();
    assert_eq!(
        error.to_string(),
        format!(
            "{} has channel 'aft', but {} does not",
            early.display(),
            late.display()
        )
    );
    let one = open_sum(&[&early, &late], Some(&["fore"]), &Options::default()).unwrap();
    assert_eq!(one.collection().pulses.len(), 8);
    write_cphd(&early, &[("fore", &pass(0, 5, 4, 0.0), [H, H])]);
    write_cphd(&late, &[("fore", &other, [H, V])]);
    let error = open_sum(&[&early, &late], Some(&["fore"]), &Options::default())
        .err()
        .unwrap();
    assert!(error.to_string().contains("polarisation HH"), "{error}");
}

#[test]
fn incompatible_channels_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.cphd");
    let first = pass(0, 6, 4, 0.0);
    let open_both = |second: &InMemory, polarization: [Polarization; 2]| {
        write_cphd(&path, &[("A", &first, [H, H]), ("B", second, polarization)]);
        let sum = open_sum::<_, &str>(&[&path], None, &Options::default());
        let error = sum.err().map(|error| error.to_string());
        (
            open_channels::<&str>(&path, None, &Options::default()).is_ok(),
            error.unwrap_or_default(),
        )
    };
    // Channels of different polarisations are opened in parallel but not summed.
    let (parallel, message) = open_both(&pass(0, 6, 4, 0.0), [H, V]);
    assert!(
        parallel && message.contains("'A' is of polarisation HH and channel 'B' of HV"),
        "{message}"
    );
    let (parallel, message) = open_both(&pass(0, 6, 5, 1.5), [H, H]);
    assert!(
        parallel && message.contains("'A' has 4 samples per pulse, but channel 'B' has 5"),
        "{message}"
    );
    let (parallel, message) = open_both(&pass(0, 6, 4, 0.0), [Polarization::Unspecified; 2]);
    assert!(
        parallel && message.contains("the same antennas"),
        "{message}"
    );
    // Channels with different pulses are not opened in parallel either.
    let (parallel, message) = open_both(&pass(0, 7, 4, 1.5), [H, H]);
    assert!(
        !parallel && message.contains("'A' has 6 pulses, but channel 'B' has 7"),
        "{message}"
    );
    let (parallel, message) = open_both(&pass(6, 6, 4, 1.5), [H, H]);
    assert!(
        !parallel && message.contains("expected channels with the same pulses"),
        "{message}"
    );
}
