//! Recorded delays of a pulsed radar: a receive window of 75 us from 9.5 km slant range, pulses of 27 us. Echoes of slant
//! ranges up to 16.69 km are complete; samples repeat after 11.24 km.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::numpy;
use subaperture_tests::subap::run;

const C_M_S: f64 = 299_792_458.0;
const PULSES: usize = 64;
const SAMPLES: usize = 1200;
const RATE_HZ: f64 = 16e6;
const CENTRE_HZ: f64 = 1.27e9;
const BANDWIDTH_HZ: f64 = 14e6;
const DURATION_S: f64 = 27e-6;
const START_S: f64 = 2.0 * 9500.0 / C_M_S;
/// Slant ranges of points at x = 0.
const POINTS_M: [f64; 2] = [10_000.0, 16_650.0];

/// Position of the antenna along x in a pulse, metres.
fn antenna_x_m(pulse: usize) -> f64 {
    2.0 * (pulse as f64 - 32.0)
}

/// Echo of all points in sample `i` of a pulse.
fn echo(pulse: usize, i: usize) -> [f32; 2] {
    let after_s = START_S + i as f64 / RATE_HZ;
    let (mut re, mut im) = (0.0, 0.0);
    for range_m in POINTS_M {
        let delay_s = 2.0 * range_m.hypot(antenna_x_m(pulse)) / C_M_S;
        let t = after_s - delay_s;
        if (0.0..DURATION_S).contains(&t) {
            let sweep = 0.5 * BANDWIDTH_HZ / DURATION_S * t * (t - DURATION_S);
            let phase = TAU * (sweep - (CENTRE_HZ * delay_s).fract());
            re += phase.cos();
            im += phase.sin();
        }
    }
    [re as f32, im as f32]
}

fn record(folder: &Path) {
    let mut samples = Vec::new();
    for n in 0..PULSES {
        for i in 0..SAMPLES {
            for part in echo(n, i) {
                samples.extend(part.to_le_bytes());
            }
        }
    }
    let file = numpy::array("<c8", &format!("({PULSES}, {SAMPLES})"), &samples);
    fs::write(folder.join("raw.npy"), file).unwrap();
    let text = format!(
        r#"
[recording]
format = "npy"
file = "raw.npy"
phase = "minus"
[scene]
reference = "0, 12000, 0 m"
[radar]
kind = "pulsed"
pri = "10 ms"
centre = "{CENTRE_HZ} Hz"
sample_rate = "{RATE_HZ} Hz"
window_start = "{START_S} s"
[radar.pulse]
kind = "lfm"
bandwidth = "{BANDWIDTH_HZ} Hz"
duration = "{DURATION_S} s"
[platform]
kind = "linear"
position = "{} m, 0 m, 0 m"
velocity = "200, 0, 0 m/s"
at = "start"
"#,
        antenna_x_m(0)
    );
    fs::write(folder.join("raw.toml"), text).unwrap();
}

/// Magnitudes of the pixels of an image.
fn pixels(folder: &Path) -> Vec<f32> {
    let bytes = fs::read(folder.join("image.npy")).unwrap();
    let data = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let value = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
    let pixel = |b: &[u8]| value(&b[..4]).hypot(value(&b[4..]));
    bytes[data..].chunks_exact(8).map(pixel).collect()
}

#[test]
fn pixels_beyond_the_receive_window_are_refused_or_zero_alike_in_all_formers() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    record(at);
    // The point at 10 km repeats at 21.24 km.
    for beyond in ["y=20800:21600:10", "y=4000:9400:50"] {
        let line = format!("focus raw.toml --grid x=-100:100:10,{beyond} -o no");
        let refused = [
            "no pixel lies within the recorded delays",
            "9500 m to 16.7 km",
        ];
        run(at, &line).failed(1, &refused);
        assert!(!at.join("no").exists());
    }
    let last_m = 0.5 * C_M_S * (START_S + SAMPLES as f64 / RATE_HZ - DURATION_S);
    let covered = |x: f64, y: f64| {
        let ranges = (0..PULSES).map(|n| y.hypot(x - antenna_x_m(n)));
        ranges.into_iter().all(|range_m| range_m <= last_m)
    };
    let expected: BTreeSet<usize> = (0..40 * 40)
        .filter(|i| {
            covered(
                -200.0 + 10.0 * (i % 40) as f64,
                16_500.0 + 10.0 * (i / 40) as f64,
            )
        })
        .collect();
    assert!((700..900).contains(&expected.len()), "{}", expected.len());
    for former in ["exact", "bp", "ffbp", "rdbp", "rda", "omega-k"] {
        let line =
            format!("focus raw.toml -a {former} --grid x=-200:200:10,y=16500:16900:10 -o {former}");
        let ran = run(at, &line);
        let named = format!(
            "{} of 1600 pixels lie outside the recorded delays",
            1600 - expected.len()
        );
        assert!(matches!(ran.code, Some(0 | 3)), "{ran:?}");
        assert!(ran.stderr.contains(&named), "{ran:?}");
        let record = fs::read(at.join(former).join("image.json")).unwrap();
        let record: Value = serde_json::from_slice(&record).unwrap();
        let count = record["settings"]["resolved"]["uncovered_pixels"]
            .as_u64()
            .unwrap();
        assert_eq!(count as usize, 1600 - expected.len());
        let pixels = pixels(&at.join(former));
        let formed = (0..pixels.len()).filter(|&i| pixels[i] != 0.0).collect();
        assert_eq!(expected, formed, "{former}");
        // The point on a pixel at 16.65 km.
        assert!(
            (pixels[15 * 40 + 20] - 1.0).abs() < 0.05,
            "{former}: {}",
            pixels[15 * 40 + 20]
        );
    }
}

/// Velocities of a target at 10 km at the first pulse. Towards the radar at 1000 m/s it leaves the receive window 0.5 s later; the pulses last 0.63 s.
#[test]
fn velocities_of_targets_that_leave_the_receive_window_are_zero() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    record(at);
    let line = "velocity raw.toml --at 0,10000 --vx -20:25:10 --vy -1000:1050:100 -o plane";
    let ran = run(at, line);
    ran.succeeded();
    let last_m = 0.5 * C_M_S * (START_S + SAMPLES as f64 / RATE_HZ - DURATION_S);
    let covered = |vx: f64, vy: f64| {
        (0..PULSES).all(|n| {
            let time_s = 0.01 * n as f64;
            let range_m = (10_000.0 + vy * time_s).hypot(vx * time_s - antenna_x_m(n));
            (9500.0..=last_m).contains(&range_m)
        })
    };
    let pixels = pixels(&at.join("plane"));
    assert_eq!(pixels.len(), 21 * 5);
    let mut uncovered = 0;
    for (i, &pixel) in pixels.iter().enumerate() {
        let [row, column] = [i / 5, i % 5].map(|n| n as f64);
        let is_covered = covered(10.0 * column - 20.0, 100.0 * row - 1000.0);
        assert_eq!(pixel != 0.0, is_covered, "{i}: {pixel}");
        uncovered += usize::from(!is_covered);
    }
    assert_eq!(uncovered, 3 * 5);
    let named = format!("{uncovered} of 105 pixels lie outside the recorded delays");
    assert!(ran.stderr.contains(&named), "{ran:?}");
    // The point at rest.
    assert!(
        (pixels[10 * 5 + 2] - 1.0).abs() < 0.05,
        "{}",
        pixels[10 * 5 + 2]
    );
}
