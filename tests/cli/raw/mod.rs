//! Raw recordings written by the tests, with and without defects.

mod codes;
mod defects;
mod messages;
mod pulses;

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use num_complex::{Complex32, Complex64};
use subaperture_tests::numpy;

const C_M_S: f64 = 299_792_458.0;
const PULSES: usize = 400;
const SAMPLES: usize = 128;
const START_HZ: f64 = 24e9;
const SLOPE_HZ_S: f64 = 8e12;
const RATE_HZ: f64 = 1e6;
/// Targets in the plane of the rail, metres, with amplitudes.
const TARGETS: [([f64; 2], f64); 3] = [([0.1, 4.0], 1.0), ([-0.6, 3.2], 0.5), ([0.5, 5.0], 0.7)];

/// Position of pulse `n` on a rail along x, metres.
fn x_m(n: usize) -> f64 {
    -0.6 + 1.2 * n as f64 / (PULSES - 1) as f64
}

/// Beat of a rising sweep: `exp(+j 2 pi (start tau + slope tau t - slope tau^2 / 2))` of each target with the delay `tau`.
fn beat(n: usize, k: usize) -> Complex64 {
    let t = k as f64 / RATE_HZ;
    let of = |&([x, y], amplitude): &([f64; 2], f64)| {
        let tau = 2.0 * (x - x_m(n)).hypot(y) / C_M_S;
        let turns = START_HZ * tau + SLOPE_HZ_S * tau * t - 0.5 * SLOPE_HZ_S * tau * tau;
        Complex64::from_polar(amplitude, TAU * turns.rem_euclid(1.0))
    };
    TARGETS.iter().map(of).sum()
}

/// All samples, pulse by pulse, changed by `change` with the pulse's number.
fn samples(change: impl Fn(usize, Complex64) -> Complex64) -> Vec<Complex64> {
    let places = (0..PULSES).flat_map(|n| (0..SAMPLES).map(move |k| (n, k)));
    places.map(|(n, k)| change(n, beat(n, k))).collect()
}

fn complex64(values: &[Complex64]) -> Vec<u8> {
    let parts = values.iter().flat_map(|z| [z.re as f32, z.im as f32]);
    parts.flat_map(f32::to_le_bytes).collect()
}

/// Write the array `name` of complex64 values, `width` in a row.
fn write_array(folder: &Path, name: &str, values: &[Complex64], width: usize) {
    let shape = format!("({}, {width})", values.len() / width);
    let file = numpy::array("<c8", &shape, &complex64(values));
    fs::write(folder.join(name), file).unwrap();
}

/// Description of the recording, with lines added to `[recording]`.
fn description(recording: &str) -> String {
    format!(
        r#"name = "rail"

[recording]
phase = "plus"
{recording}

[scene]
x = "-1, 1 m"
y = "2.5, 5.5 m"
reference = "0, 4, 0 m"

[radar]
kind = "fmcw"
start = "24 GHz"
slope = "8 MHz/us"
sample_rate = "1 MHz"

[platform]
kind = "rail"
from = "-0.6, 0, 0 m"
to = "0.6, 0, 0 m"
speed = "1.2 m/s"
start = "0 s"
"#
    )
}

const NPY: &str = "format = \"npy\"\nfile = \"echoes.npy\"";

/// Interval of the pulses: the rail of 1.2 m in 1 s.
const PRI_S: f64 = 1.0 / (PULSES - 1) as f64;

/// Write the times of pulses, as `times.npy`.
fn write_times(folder: &Path, pulses: impl Iterator<Item = usize>) {
    let times: Vec<u8> = pulses
        .flat_map(|n| (n as f64 * PRI_S).to_le_bytes())
        .collect();
    let file = numpy::array("<f8", &format!("({},)", times.len() / 8), &times);
    fs::write(folder.join("times.npy"), file).unwrap();
}

/// A folder with `echoes.npy`, `times.npy` and `rail.toml`.
fn recorded(values: &[Complex64], recording: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_array(folder.path(), "echoes.npy", values, SAMPLES);
    write_times(folder.path(), 0..values.len() / SAMPLES);
    let text = description(&format!("{NPY}\ntimes = \"times.npy\"\n{recording}"));
    fs::write(folder.path().join("rail.toml"), text).unwrap();
    folder
}

/// Grid with the targets on pixels.
const GRID: &str = "--grid x=-1:1:0.02,y=2.6:5.4:0.02";

/// Value of the image at a target on [`GRID`].
fn at_target(folder: &Path, image: &str, [x, y]: [f64; 2]) -> Complex32 {
    let image = subaperture::io::npy::read(&folder.join(image).join("image.npy")).unwrap();
    let place = |value: f64, start: f64| ((value - start) / 0.02).round() as usize;
    image.pixels[place(y, 2.6) * image.columns + place(x, -1.0)]
}

/// Warnings of the image's record.
fn warnings(folder: &Path, image: &str) -> String {
    let record = fs::read(folder.join(image).join("image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    record["warnings"].to_string()
}
