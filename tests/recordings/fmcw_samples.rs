//! Dechirped sweeps as radar modules and capture programs write them: interleaved I and Q, and real samples of a radar with one mixer.

use std::f64::consts::TAU;

use num_complex::Complex32;
use subaperture::convention::INFERENCE;
use subaperture::focus::exact::Exact;
use subaperture::geometry::ImageGrid;
use subaperture::io::open::{Options, open};
use subaperture::prelude::*;
use subaperture_tests::numpy::array;

const C: f64 = 299_792_458.0;
const PULSES: usize = 120;
const SAMPLES: usize = 128;
const RATE_HZ: f64 = 2.5e6;
const AMPLITUDE: f64 = 3000.0;
const TARGET_M: [f64; 2] = [0.05, 1.2];

/// The complex beat of a rising sweep, `exp(+j 2 pi (start tau + slope tau t - slope tau^2 / 2))`; a falling sweep has a negative slope.
fn beat(start_hz: f64, slope_hz_s: f64, n: usize, k: usize) -> [f64; 2] {
    let x = -0.12 + 0.24 * n as f64 / (PULSES - 1) as f64;
    let tau = 2.0 * (TARGET_M[0] - x).hypot(TARGET_M[1]) / C;
    let t = k as f64 / RATE_HZ;
    let turns = start_hz * tau + slope_hz_s * tau * t - 0.5 * slope_hz_s * tau * tau;
    let (sin, cos) = (TAU * turns.rem_euclid(1.0)).sin_cos();
    [AMPLITUDE * cos, AMPLITUDE * sin]
}

/// Amplitude of the target in the image of `bytes`, read by a description with these lines in `[recording]`.
fn read(recording: &str, start: &str, slope: &str, file: &str, bytes: &[u8]) -> Complex32 {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        r#"
[recording]
file = "{file}"
{recording}
[scene]
reference = "0, 1.2, 0 m"
x = "-0.2, 0.2 m"
y = "1.0, 1.4 m"
[radar]
kind = "fmcw"
pri = "10 ms"
start = "{start}"
slope = "{slope}"
sample_rate = "2.5 MHz"
[platform]
kind = "rail"
from = "-0.12, 0, 0 m"
to = "0.12, 0, 0 m"
spacing = "2.0168067226890756 mm"
"#
    );
    let path = folder.path().join("radar.toml");
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join(file), bytes).unwrap();
    let options = Options {
        inference: Some(INFERENCE),
        ..Options::default()
    };
    let history = open(&path, &options).unwrap();
    assert_eq!(history.collection().pulses.len(), PULSES);
    let grid: ImageGrid = "x=0.05:0.5:1,y=1.2:1.7:1".parse().unwrap();
    Exact.focus(&*history, &grid).unwrap().image.pixels[0]
}

#[test]
fn samples_in_every_order_show_target_at_its_position() {
    for (start, slope, start_hz, slope_hz_s) in [
        ("77 GHz", "60 MHz/us", 77e9, 60e12),
        ("80 GHz", "-60 MHz/us", 80e9, -60e12),
    ] {
        let all = || {
            (0..PULSES).flat_map(|n| (0..SAMPLES).map(move |k| beat(start_hz, slope_hz_s, n, k)))
        };
        let int16 = |value: f64| (value.round() as i16).to_le_bytes();
        let turns: Vec<u8> = all()
            .flat_map(|[re, im]| [int16(re), int16(im)].concat())
            .collect();
        let real: Vec<u8> = all().flat_map(|[re, _]| int16(re)).collect();
        let pairs: Vec<[f64; 2]> = all().collect();
        let pairs: Vec<u8> = pairs
            .chunks(2)
            .flat_map(|pair| {
                [pair[0][0], pair[1][0], pair[0][1], pair[1][1]]
                    .map(int16)
                    .concat()
            })
            .collect();
        let doubles: Vec<u8> = all().flat_map(|[re, _]| re.to_le_bytes()).collect();
        let npy = array("<f8", &format!("({PULSES}, {SAMPLES})"), &doubles);
        let binary = "format = \"dca1000\"\nsamples = 128\n";
        let whole = read(
            &format!("{binary}phase = \"plus\""),
            start,
            slope,
            "pairs.bin",
            &pairs,
        );
        // Two int16 are rounded by 0.3 of 3000; the ends of the sweep are tapered.
        assert!((whole.norm() - 3000.0).abs() < 30.0, "{whole}");
        let found = read(
            &format!("{binary}order = \"iqiq\"\nphase = \"plus\""),
            start,
            slope,
            "turns.bin",
            &turns,
        );
        assert!((found - whole).norm() < 1.0, "{slope}: {found} {whole}");
        // An order that is not stated is that of the sharper image; likewise the sign. The beat of the falling sweep rotates by -69 degrees
        // per sample, so the other order, with I of two different samples, is close to I and Q and as sharp.
        let decided = slope_hz_s > 0.0;
        for phase in ["phase = \"plus\"", ""].iter().filter(|_| decided) {
            for (file, bytes) in [("pairs.bin", &pairs), ("turns.bin", &turns)] {
                let found = read(&format!("{binary}{phase}"), start, slope, file, bytes);
                assert!(
                    (found - whole).norm() < 1.0,
                    "{file} {phase}: {found} {whole}"
                );
            }
        }
        // The mirrored half of a real beat's spectrum is 49 bins away, at most 1 / (49 pi) between them.
        for phase in ["plus", "minus"] {
            for found in [
                read(
                    &format!("{binary}order = \"real\"\nphase = \"{phase}\""),
                    start,
                    slope,
                    "real.bin",
                    &real,
                ),
                read(
                    &format!("format = \"npy\"\nphase = \"{phase}\""),
                    start,
                    slope,
                    "real.npy",
                    &npy,
                ),
            ] {
                assert!(
                    (found - whole * 0.5).norm() < 0.007 * 1500.0,
                    "{slope}: {found} {whole}"
                );
            }
        }
    }
}

#[test]
fn samples_beyond_float32_are_refused() {
    for (scale, part) in [
        (1e-300, "the largest value is"),
        (1e300, "beyond the float32 maximum"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let data: Vec<u8> = (0..8)
            .flat_map(|n| (scale * f64::from(n + 1)).to_le_bytes())
            .collect();
        for (kind, shape) in [("<c16", "(2, 2)"), ("<f8", "(2, 4)")] {
            std::fs::write(folder.path().join("a.npy"), array(kind, shape, &data)).unwrap();
            let text = "[recording]\nformat = \"npy\"\nfile = \"a.npy\"\n[radar]\nkind = \"fmcw\"\nstart = \"77 GHz\"\nslope = \"60 MHz/us\"\n\
                        sample_rate = \"2.5 MHz\"\npri = \"1 ms\"\n[platform]\nkind = \"rail\"\nfrom = \"0, 0, 0 m\"\nto = \"1, 0, 0 m\"\n";
            let path = folder.path().join("a.toml");
            std::fs::write(&path, text).unwrap();
            let error = match open(&path, &Options::default()) {
                Ok(_) => panic!("read"),
                Err(error) => error.to_string(),
            };
            assert!(error.contains(part), "{kind}: {error}");
        }
    }
}
