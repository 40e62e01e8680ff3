//! `subap pair` on simulated repeat passes. No recorded pair is at hand.

use std::fs;
use std::ops::Range;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{run, write_recording};

/// Half of the scene's side, and the changed rectangle, metres.
const HALF_M: f64 = 36.0;
const CHANGED_M: [[f64; 2]; 2] = [[4.0, 20.0], [-16.0, 0.0]];
/// Pixel spacing and number of pixels per side.
const STEP_M: f64 = 0.4;
const SIDE: usize = 160;
const GRID: &str = "x=-32:32:0.4,y=-32:32:0.4";
const WAVELENGTH_M: f64 = 299_792_458.0 / 10e9;

/// Clutter of a rectangle in x and y; `shift` moves it.
fn clutter([x, y]: [[f64; 2]; 2], shift: [f64; 2], sigma0_db: f64) -> String {
    format!(
        "[[scene.clutter]]\nx = \"{}, {} m\"\ny = \"{}, {} m\"\ndensity = 10\nsigma0 = \"{sigma0_db} dB\"\n",
        x[0] + shift[0],
        x[1] + shift[0],
        y[0] + shift[1],
        y[1] + shift[1]
    )
}

/// Clutter of no power, which only takes a number, so that the next patch has other points.
const SPACER: &str =
    "[[scene.clutter]]\nx = \"0, 1 m\"\ny = \"0, 1 m\"\ncount = 1\nsigma0 = \"-300 dB\"\n";

/// Recording of one pass: clutter that is the same in both, a changed rectangle, and a layer 10 dB weaker that differs everywhere (coherence 1 / 1.1).
fn pass(at: &Path, name: &str, later: bool, shift: [f64; 2], platform: [f64; 2]) {
    let [[x0, x1], [y0, y1]] = CHANGED_M;
    let all = [-HALF_M, HALF_M];
    let mut scene = String::new();
    for unchanged in [
        [all, [-HALF_M, y0]],
        [all, [y1, HALF_M]],
        [[-HALF_M, x0], [y0, y1]],
        [[x1, HALF_M], [y0, y1]],
    ] {
        scene += &clutter(unchanged, shift, 0.0);
    }
    for (area, sigma0_db) in [(CHANGED_M, 0.0), ([all, all], -10.0)] {
        let own = clutter(area, shift, sigma0_db);
        scene += &match later {
            true => format!("{SPACER}{own}"),
            false => format!("{own}{SPACER}"),
        };
    }
    record(at, name, &scene, platform);
}

fn record(at: &Path, name: &str, scene: &str, [y, z]: [f64; 2]) {
    write_recording(
        at,
        name,
        format!(
            r#"name = "{name}"
seed = 3

[scene]
reference = "0, 0, 0 m"
x = "-40, 40 m"
y = "-40, 40 m"

{scene}
[radar]
kind = "ideal"
pulses = 200
pri = "5 ms"
centre = "10 GHz"
bandwidth = "300 MHz"
samples = 256

[platform]
kind = "linear"
position = "0, {y}, {z} m"
velocity = "125, 0, 0 m/s"
"#
        ),
    );
    let line = format!("focus {name}.cphd --grid {GRID} --error-db -50 --out {name}");
    run(at, &line).succeeded();
}

fn pair(at: &Path, line: &str) -> Value {
    let ran = run(at, &format!("pair {line} --json"));
    serde_json::from_str(ran.succeeded()).unwrap()
}

/// Array of a Zarr group, one chunk.
fn array(at: &Path, name: &str) -> Vec<f32> {
    let bytes = fs::read(at.join(format!("{name}/c/0/0"))).unwrap();
    assert_eq!(bytes.len(), 4 * SIDE * SIDE);
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect()
}

/// Pixels of a coordinate range, metres, at least `margin` pixels within it.
fn pixels([from, to]: [f64; 2], margin: f64) -> Range<usize> {
    let at = |m: f64| (m + 32.0) / STEP_M;
    (at(from) + margin).ceil() as usize..(at(to) - margin).floor() as usize
}

/// The scene of the later pass lies 0.2 m further in x and 0.3 m nearer in y than its track says: half a pixel and three quarters.
#[test]
fn changed_rectangle_is_detected_in_a_shifted_repeat_pass() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pass(at, "earlier", false, [0.0; 2], [-5000.0, 1000.0]);
    pass(at, "later", true, [0.2, -0.3], [-5001.5, 1002.0]);
    let of = pair(
        at,
        "later earlier --looks 5 --pfa 1e-2 --format zarr,cog --out out",
    );
    let number = |key: &str| of.pointer(key).and_then(Value::as_f64).unwrap();
    // Speckle of 1.3e4 cells: a standard deviation of 0.01 pixel, and the bias of aliasing that remains.
    assert!(
        (number("/offset_pixels/columns") - 0.5).abs() < 0.04,
        "{of}"
    );
    assert!((number("/offset_pixels/rows") + 0.75).abs() < 0.04, "{of}");
    assert_eq!(of["offset_removed"], true);
    // 1 / 1.1, less 1e-2 for baseline and registration.
    let coherence = number("/scene_coherence");
    assert!((coherence - 0.909).abs() < 0.02, "{coherence}");

    let change = array(&at.join("out/pair.zarr"), "change");
    let [x, y] = CHANGED_M;
    let (inside, outside) = (pixels(x, 4.0), pixels(x, -4.0));
    let (inside_y, outside_y) = (pixels(y, 4.0), pixels(y, -4.0));
    let (mut detected, mut of_inside, mut alarms, mut of_outside) = (0, 0, 0, 0);
    for (i, value) in change.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let (row, column) = (i / SIDE, i % SIDE);
        if inside.contains(&column) && inside_y.contains(&row) {
            of_inside += 1;
            detected += usize::from(*value == 1.0);
        } else if !(outside.contains(&column) && outside_y.contains(&row)) {
            of_outside += 1;
            alarms += usize::from(*value == 1.0);
        }
    }
    let detection = f64::from(detected as u32) / f64::from(of_inside);
    let ratio = f64::from(alarms as u32) / f64::from(of_outside) / 1e-2;
    println!(
        "{of}\ndetected {detection:.4} of {of_inside}, false alarms over requested {ratio:.3} of {of_outside}"
    );
    // A coherence of 0 over 10 looks lies below the threshold near 0.75 with a probability above 0.99.
    assert!(detection > 0.97, "{detection}");
    // About 12 expected clusters of alarms: a standard deviation of 30 to 40 %.
    assert!((0.2..2.5).contains(&ratio), "{ratio}");

    // Every file is complete: pictures, record, maps by GDAL's rules elsewhere.
    for name in [
        "coherence.png",
        "phase.png",
        "change.png",
        "pair.json",
        "coherence.tif",
        "interferogram.tif",
        "change.tif",
    ] {
        assert!(at.join("out").join(name).is_file(), "{name}");
    }
    // The simulated scene lies at 0 degrees north and east: UTM zone 30 or 31, south or north.
    let info = run(at, "info out/interferogram.tif --json");
    let info: Value = serde_json::from_str(info.succeeded()).unwrap();
    let map = &info["stored"][0];
    assert_eq!(map["values"], "complex", "{info}");
    let epsg = map["raster"]["epsg"].as_u64().unwrap();
    assert!([32630, 32631, 32730, 32731].contains(&epsg), "{info}");
    assert!(map["peak_db"].as_f64().unwrap() <= 0.0, "{info}");
    // Half and three quarters of a pixel of 0.4 m are a third and more of a cell of 0.6 m: sinc(1 / 3) of the coherence is left in x alone, 17 % less.
    let unregistered = pair(at, "later earlier --looks 5 --registered --out out");
    assert!(unregistered["offset_pixels"].is_null());
    let lost = unregistered["mean_coherence"].as_f64().unwrap();
    assert!(lost < number("/mean_coherence") - 0.12, "{lost}");
    // The same images as arrays without metadata, registered by the phase ramp.
    let of = pair(
        at,
        "earlier/image.npy earlier/image.npy --looks 5 --out arrays",
    );
    assert_eq!(of["offset_removed"], false);
    assert_eq!(of["fraction_changed"], 0.0);
}

/// Phase of a reflector against its exact ranges from both tracks: `-4 pi / wavelength` times the change of its range relative to that of the pixel, averaged along
/// the track.
#[test]
fn phase_of_raised_and_displaced_reflectors_agrees_with_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Position in the earlier and later pass: on the ground, raised by 3 m, displaced away from the radar by 3 mm.
    let reflectors = [
        [[-20.0, -20.0, 0.0]; 2],
        [[20.0, -18.0, 3.0]; 2],
        [[0.0, 20.0, 0.0], [0.0, 20.003, 0.0]],
    ];
    let tracks = [[-5000.0, 1000.0], [-4998.0, 1008.0]];
    for (k, name) in ["earlier", "later"].into_iter().enumerate() {
        let points = reflectors.map(|places| {
            let [x, y, z] = places[k];
            format!(
                "[[scene.point]]\nposition = \"{x}, {y}, {z} m\"\ncross_section = \"20 dBsm\"\n"
            )
        });
        record(at, name, &points.concat(), tracks[k]);
    }
    pair(
        at,
        "later earlier --looks 3 --registered --format zarr --out out",
    );
    let phase = array(&at.join("out/pair.zarr"), "phase");
    let image = fs::read(at.join("earlier/image.npy")).unwrap();
    let samples: Vec<f32> = image[image.len() - 8 * SIDE * SIDE..]
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    let power = |i: usize| samples[2 * i].powi(2) + samples[2 * i + 1].powi(2);
    let distance = |a: [f64; 3], b: [f64; 3]| -> f64 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
    };
    for places in reflectors {
        // Brightest pixel within 16 m of the reflector's ground position: height displaces by layover, z / tan of the depression angle.
        let near = |i: usize| {
            let m = |n: usize| n as f64 * STEP_M - 32.0;
            let [x, y] = [m(i % SIDE), m(i / SIDE)];
            (x - places[0][0]).abs() < 8.0 && (y - places[0][1]).abs() < 16.0
        };
        let all = (0..SIDE * SIDE).filter(|&i| near(i));
        let i = all.max_by(|&a, &b| power(a).total_cmp(&power(b))).unwrap();
        let pixel = [
            (i % SIDE) as f64 * STEP_M - 32.0,
            (i / SIDE) as f64 * STEP_M - 32.0,
            0.0,
        ];
        let mut expected = 0.0;
        let steps = 64;
        for n in 0..steps {
            let x = 125.0 * (f64::from(n) + 0.5 - f64::from(steps) / 2.0) / f64::from(steps);
            let beyond = [0, 1].map(|k| {
                let radar = [x, tracks[k][0], tracks[k][1]];
                distance(places[k], radar) - distance(pixel, radar)
            });
            expected -= 4.0 * std::f64::consts::PI / WAVELENGTH_M * (beyond[1] - beyond[0])
                / f64::from(steps);
        }
        let found = f64::from(phase[i]);
        let turns = (found - expected) / std::f64::consts::TAU;
        let error = (turns - turns.round()) * std::f64::consts::TAU;
        println!("{places:?}: expected {expected:.3}, found {found:.3} rad");
        // The window of 3 x 3 pixels spans 0.2 rad of the baseline's phase.
        assert!(error.abs() < 0.1, "{places:?}: {found} {expected}");
    }
}

#[test]
fn unsuited_pairs_and_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let point = "[[scene.point]]\nposition = \"0, 0, 0 m\"\n";
    record(at, "image", point, [-5000.0, 1000.0]);
    run(at, "export image --layout amplitude -o image.tif").succeeded();
    run(at, "pair image.tif image -o out").failed(1, &["image.tif", "expected a complex image"]);
    run(
        at,
        "focus image.cphd --grid x=34:46:0.4,y=34:46:0.4 --error-db -40 --out far",
    )
    .succeeded();
    run(at, "pair far image -o out").failed(1, &["far", "no pixel in common"]);
    run(
        at,
        "pair image/image.npy image/image.npy --format cog -o out",
    )
    .failed(1, &["--format cog", "position"]);
    run(at, "pair image image --looks 301 -o out").failed(1, &["window", "301"]);
    run(at, "pair image image --coherence 1.5 -o out").failed(1, &["coherence", "1.5"]);
    for (option, parts) in [
        ("--looks 4", ["--looks", "odd"]),
        ("--looks 3x4", ["--looks", "odd"]),
        ("--pfa 1", ["--pfa", "between 0 and 1"]),
        ("--format sicd", ["--format", "cog"]),
    ] {
        run(at, &format!("pair image image {option} -o out")).failed(2, &parts);
    }
    assert!(!at.join("out").exists());
}
