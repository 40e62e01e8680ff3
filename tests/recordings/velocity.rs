//! Effective velocity of a strip without a known track: one component of the velocity's vector by the sharpness of the image.

use std::f64::consts::TAU;
use std::path::Path;

use glam::DVec3;
use subaperture::SPEED_OF_LIGHT_M_S;
use subaperture::autofocus::{Measure, Order, Sight};
use subaperture::geometry::ImageGrid;
use subaperture::io::recording::RecordingFile;
use subaperture_tests::numpy::array;

use crate::described::{axis, tune};

const PULSES: usize = 400;
const PRI_S: f64 = 5e-3;
const VELOCITY_M_S: DVec3 = DVec3::new(95.3, -2.0, 0.4);
const START_M: DVec3 = DVec3::new(0.0, -3000.0, 800.0);
const FREQUENCIES: usize = 32;
const POINTS_M: [DVec3; 3] = [
    DVec3::new(0.0, 0.0, 0.0),
    DVec3::new(6.0, 9.0, 0.0),
    DVec3::new(-9.0, -7.0, 0.0),
];

const TEXT: &str = r#"[recording]
format = "npy"
file = "strip.npy"
phase = "minus"

[scene]
reference = "0, 0, 0 m"

[radar]
kind = "stepped"
pri = "5 ms"
start = "9.98 GHz"
step = "1.25 MHz"

[platform]
kind = "linear"
position = "0, -3, 0.8 km"
velocity = "100, -2, 0.4 m/s"  # of the flight plan
"#;

fn record(folder: &Path) -> RecordingFile {
    let mut data = Vec::new();
    for n in 0..PULSES {
        let after_s = (n as f64 - 0.5 * (PULSES - 1) as f64) * PRI_S;
        let radar = START_M + VELOCITY_M_S * after_s;
        for k in 0..FREQUENCIES {
            let frequency_hz = 9.98e9 + 1.25e6 * k as f64;
            let mut sum = [0.0; 2];
            for point in POINTS_M {
                let turns = frequency_hz * 2.0 * radar.distance(point) / SPEED_OF_LIGHT_M_S;
                let (sin, cos) = (-TAU * turns.rem_euclid(1.0)).sin_cos();
                sum[0] += cos;
                sum[1] += sin;
            }
            sum.iter()
                .for_each(|part| data.extend((*part as f32).to_le_bytes()));
        }
    }
    let file = array("<c8", &format!("({PULSES}, {FREQUENCIES})"), &data);
    std::fs::write(folder.join("strip.npy"), file).unwrap();
    RecordingFile::new("strip.toml", TEXT, folder)
}

#[test]
fn component_of_velocity_is_tuned_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let file = record(folder.path());
    let grid: ImageGrid = "x=-16:16:0.25,y=-16:16:2".parse().unwrap();
    let sight = Sight::Grid(grid, Measure::Entropy);
    let keys = [("platform.velocity[0]", "m/s", axis(90.0, 101.0, 0.5))];
    let found = tune(&file, &keys, &sight, Order::Product);
    println!(
        "velocity {:?}, width {:?}",
        found.best, found.scans[0].width
    );
    // The path of a point changes by x^2 / R over the aperture, x = 95 m at its ends and R = 3105 m: 97 wavelengths. An error of the velocity
    // changes it by twice the relative error: a quarter of a cycle at 0.12 m/s.
    assert!((found.best[0] - VELOCITY_M_S.x).abs() < 0.12, "{found:?}");
    assert!(!found.scans[0].at_end);
    // The other components and the comment stay.
    let text = file
        .text_with([("platform.velocity[0]", "95.25 m/s")])
        .unwrap();
    let line = "velocity = \"95.25 m/s, -2 m/s, 0.4 m/s\"  # of the flight plan";
    assert!(text.contains(line), "{text}");
}

#[test]
fn components_that_a_key_lacks_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = record(folder.path());
    for (key, part) in [
        (
            "platform.velocity[3]",
            "'velocity' has 3 components: write an index from 0 to 2",
        ),
        ("radar.start[0]", "'start' has no components"),
        ("platform[0].velocity", "occurs once: remove the index"),
        (
            "scene.x[0]",
            "component 0 of 'x' is set, but the key has no value",
        ),
    ] {
        let message = match file.set(key, "3 m/s") {
            Err(error) => error.to_string(),
            Ok(()) => file.history(u64::MAX).unwrap_err().to_string(),
        };
        assert!(message.contains(part), "{key}: {message}");
        file = record(folder.path());
    }
}
