//! Impossible positions, attitudes from swapped markers, and vectors without an echo: they are left out with a warning, and the rest is as
//! if they had never been recorded.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use num_complex::Complex32;
use subaperture::focus::exact::Exact;
use subaperture::geometry::ImageGrid;
use subaperture::io::cphd::{Channel, Cphd, WriteOptions, write};
use subaperture::io::open::{Options, open, open_channels};
use subaperture::io::recording::RecordingFile;
use subaperture::monitor::Silent;
use subaperture::phase_history::{InMemory, PhaseHistory};
use subaperture::prelude::*;
use subaperture_tests::numpy::{array, stored};

use crate::cphd::scene::{Scene, read_all};

/// The scene's recording with changed antenna positions in pulses `at`.
fn spoiled(at: &[usize], spoil: impl Fn(DVec3) -> DVec3) -> InMemory {
    let scene = Scene::default();
    let mut collection = scene.collection();
    for &n in at {
        let pulse = &mut collection.pulses[n];
        pulse.transmitter_m = spoil(pulse.transmitter_m);
        pulse.receiver_m = spoil(pulse.receiver_m);
        pulse.reference_path_m = pulse.path_m(pulse.reference_m);
    }
    InMemory::new(collection, scene.samples()).unwrap()
}

/// Change of a position.
type Spoil<'a> = &'a dyn Fn(DVec3) -> DVec3;

#[test]
fn cphd_vectors_at_impossible_positions_are_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let sound = Scene::default().recorded();
    let whole = read_all(&sound).unwrap();
    let frame = sound.collection().frame;
    let centre = |_: DVec3| frame.from_ecf_m(DVec3::ZERO);
    let away = |place: DVec3| place + DVec3::new(0.0, 0.0, 5000.0);
    let spoils: [(&str, &[usize], Spoil); 5] = [
        ("vector 7 (1 of 32) is left out", &[7], &centre),
        ("vector 7 (1 of 32) is left out", &[7], &away),
        ("vector 0 (1 of 32) is left out", &[0], &away),
        ("vector 31 (1 of 32) is left out", &[31], &centre),
        (
            "vectors 4, 12 to 13 (3 of 32) are left out",
            &[4, 12, 13],
            &centre,
        ),
    ];
    for (said, at, spoil) in spoils {
        let spoiled = spoiled(at, spoil);
        let path = folder.path().join("spoiled.cphd");
        let channels = [Channel::new("one", &spoiled), Channel::new("two", &sound)];
        write(&path, &channels, &WriteOptions::default(), &Silent).unwrap();
        let cphd = Cphd::open(&path, Some("one"), u64::MAX).unwrap();
        let warnings = cphd.warnings();
        assert!(
            warnings.len() == 1 && warnings[0].contains(said),
            "{warnings:?}"
        );
        let kept: Vec<usize> = (0..32).filter(|n| !at.contains(n)).collect();
        assert_eq!(cphd.collection().pulses.len(), kept.len());
        let expected: Vec<Complex32> = kept
            .iter()
            .flat_map(|n| &whole[24 * n..24 * (n + 1)])
            .copied()
            .collect();
        assert_eq!(read_all(&cphd).unwrap(), expected);
        for (pulse, &n) in cphd.collection().pulses.iter().zip(&kept) {
            assert_eq!(pulse.time_s, sound.collection().pulses[n].time_s);
        }
        // With parallel channels, both omit the pulse.
        let both = open_channels::<&str>(&path, None, &Options::default()).unwrap();
        assert_eq!((both.len(), both.num_pulses()), (2, kept.len()));
        assert_eq!(read_all(both.channel(1)).unwrap(), expected);
    }
}

#[test]
fn array_pulses_at_zero_positions_are_left_out_and_counted() {
    let (pulses, samples) = (40, 3);
    let place = |n: usize| match n {
        9 => [0.0; 3],
        21 => [f64::from(21), 9000.0, 300.0],
        n => [n as f64, -500.0, 300.0],
    };
    let doubles =
        |values: Vec<f64>| -> Vec<u8> { values.into_iter().flat_map(f64::to_le_bytes).collect() };
    let echoes: Vec<f64> = (0..pulses * samples)
        .flat_map(|n| [n as f64, 1.0])
        .collect();
    let members = [
        ("samples.npy", array("<c16", "(40, 3)", &doubles(echoes))),
        (
            "frequency_hz.npy",
            array("<f8", "(3,)", &doubles(vec![1e9, 1.01e9, 1.02e9])),
        ),
        (
            "antenna_m.npy",
            array(
                "<f8",
                "(40, 3)",
                &doubles((0..pulses).flat_map(place).collect()),
            ),
        ),
        (
            "reference_m.npy",
            array("<f8", "(40, 3)", &doubles(vec![0.0; 3 * pulses])),
        ),
        ("sign.npy", array("<f8", "(1,)", &doubles(vec![-1.0]))),
    ];
    let members: Vec<(&str, &[u8])> = members
        .iter()
        .map(|(name, data)| (*name, &data[..]))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.npz");
    std::fs::write(&path, stored(&members)).unwrap();
    for history in [
        open(&path, &Options::default()).unwrap(),
        open_channels::<&str>(&path, None, &Options::default())
            .unwrap()
            .into_inner()
            .remove(0)
            .1,
    ] {
        assert_eq!(history.collection().pulses.len(), 38);
        let warnings = history.warnings();
        assert!(
            warnings
                .iter()
                .any(|said| said.contains("pulses 9, 21 of 40 left out")),
            "{warnings:?}"
        );
        let read = read_all(&*history).unwrap();
        let firsts: Vec<f32> = read.chunks(samples).map(|row| row[0].re).collect();
        let expected: Vec<f32> = (0..pulses)
            .filter(|n| ![9, 21].contains(n))
            .map(|n| (samples * n) as f32)
            .collect();
        assert_eq!(firsts, expected);
    }
}

// ---- a radar with its antenna 0.5 m below a rolled body, and its motion capture

const C: f64 = 299_792_458.0;
const TARGET_M: DVec3 = DVec3::new(0.25, 4.0, 0.0);
const ROLL_DEG: f64 = 40.0;
const SWEEPS: usize = 121;
const STEPS: usize = 64;
const FRAMES: usize = 720;

/// Position of the body's origin at time `t`.
fn body_m(t: f64) -> DVec3 {
    DVec3::new(-1.2 + 0.4 * t, 0.02 * (0.5 * t).sin(), 1.5 + 0.01 * t)
}

/// Antenna position: rolled about x (forward), right-handed.
fn antenna_m(t: f64) -> DVec3 {
    let (sin, cos) = ROLL_DEG.to_radians().sin_cos();
    body_m(t) + DVec3::new(0.0, 0.5 * sin, -0.5 * cos)
}

fn sweeps() -> Vec<u8> {
    let mut data = Vec::new();
    for n in 0..SWEEPS {
        let antenna = antenna_m(n as f64 * 0.048);
        for k in 0..STEPS {
            let f = 3.1e9 + 20e6 * k as f64;
            let (sin, cos) = (-TAU * f * 2.0 * antenna.distance(TARGET_M) / C).sin_cos();
            data.extend(cos.to_le_bytes());
            data.extend(sin.to_le_bytes());
        }
    }
    array("<c16", &format!("({SWEEPS}, {STEPS})"), &data)
}

/// The motion capture with y up: x, y and z of the scene are its x, -z and y.
fn take(kind: &str, rotation: impl Fn(usize) -> String) -> String {
    let columns = if kind == "Quaternion" { 4 } else { 3 };
    let every = |cell: &str| vec![cell; columns + 3].join(",");
    let letters = if columns == 4 { "X,Y,Z,W" } else { "X,Y,Z" };
    let mut text = format!(
        "Format Version,1.23,Take Name,bench,Rotation Type,{kind},Length Units,Meters,Coordinate Space,Global\n\n,Type,{}\n,Name,{}\n,ID,{}\n,,{},{}\n\
         Frame,Time (Seconds),{letters},X,Y,Z\n",
        every("Rigid Body"),
        every("radar"),
        every("1"),
        vec!["Rotation"; columns].join(","),
        ["Position"; 3].join(","),
    );
    for n in 0..FRAMES {
        let t = n as f64 / 120.0;
        let body = body_m(t);
        text += &format!(
            "{n},{t:.6},{},{:.6},{:.6},{:.6}\n",
            rotation(n),
            body.x,
            body.z,
            -body.y
        );
    }
    text
}

const TEXT: &str = r#"
[recording]
format = "npy"
file = "sweeps.npy"
[scene]
reference = "0, 4, 0 m"
[radar]
kind = "stepped"
start = "3.1 GHz"
step = "20 MHz"
pri = "48 ms"
first_pulse = "0 s"
[[radar.transmitter]]
offset = "0, 0, -0.5 m"
[[radar.receiver]]
offset = "0, 0, -0.5 m"
[platform]
kind = "motive"
file = "take.csv"
"#;

/// Amplitude of the target divided by the number of samples, and the warnings.
fn target(take: &str) -> (f32, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sweeps.npy"), sweeps()).unwrap();
    std::fs::write(folder.path().join("take.csv"), take).unwrap();
    let file = RecordingFile::new("take.toml", TEXT, Path::new(folder.path()));
    let history = file.history(u64::MAX).unwrap();
    let grid: ImageGrid = format!(
        "x={}:{}:1,y={}:{}:1",
        TARGET_M.x,
        TARGET_M.x + 0.5,
        TARGET_M.y,
        TARGET_M.y + 0.5
    )
    .parse()
    .unwrap();
    let image = Exact.focus(&history, &grid).unwrap().image;
    (image.pixels[0].norm(), history.warnings())
}

#[test]
fn euler_angles_and_quaternion_give_same_antenna_position() {
    let half = (0.5 * ROLL_DEG).to_radians();
    let quaternion = format!("{:.9},0,0,{:.9}", half.sin(), half.cos());
    let (read, warnings) = target(&take("Quaternion", |_| quaternion.clone()));
    // Micrometre rounding of the capture at a wavelength of 9 cm: 1 to a thousandth.
    assert!(
        (read - 1.0).abs() < 1e-3 && warnings.is_empty(),
        "{read} {warnings:?}"
    );
    for order in ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"] {
        let (read, warnings) = target(&take(order, |_| format!("{ROLL_DEG:.6},0,0")));
        assert!(
            (read - 1.0).abs() < 1e-3 && warnings.is_empty(),
            "{order}: {read}"
        );
    }
}

#[test]
fn frames_with_swapped_markers_are_left_out_and_counted() {
    // Frames 100 to 104 and 400 are upside down.
    let swapped = |n: usize| (100..105).contains(&n) || n == 400;
    let (read, warnings) = target(&take("XYZ", |n| match swapped(n) {
        true => format!("{:.6},0,0", ROLL_DEG - 180.0),
        false => format!("{ROLL_DEG:.6},0,0"),
    }));
    assert!((read - 1.0).abs() < 1e-3, "{read}");
    assert!(
        warnings.len() == 1
            && warnings[0].contains("6 of 720 frames are left out, the first at 0.833 s"),
        "{warnings:?}"
    );
}
