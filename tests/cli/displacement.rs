//! `subap displacement` on simulated repeat passes of a rail and an arc radar. No recorded passes are at hand.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{run, write_recording};

const WAVELENGTH_M: f64 = 299_792_458.0 / 17.2e9;
const GRID: &str = "x=-42:42:0.3,y=52:142:0.5";
const STABLE: &str = "--stable -45:45,50:85";

/// Height of the radar over the points, metres.
const HEIGHT_M: f64 = 2.0;

const RAIL: &str = r#"kind = "rail"
from = "-1, 0, 2 m"
to = "1, 0, 2 m"
speed = "1 m/s""#;

/// Arc of 1 rad, two metres wide, about a pivot 1.9 m behind the rail.
const ARC: &str = r#"kind = "arc"
pivot = "0, -2, 2 m"
radius = "2 m"
from_angle = "61 deg"
to_angle = "119 deg"
rate = "29 deg/s""#;

/// Positions of the points, metres: about 10 m apart.
fn points() -> Vec<[f64; 2]> {
    let place = |n: i32| {
        let (i, j) = (n / 8 - 3, n % 8);
        let x = 10 * i + 2 * ((i * i + j) % 3);
        let y = 60 + 10 * j + (i + 3) % 2 * 3;
        [f64::from(x), f64::from(y)]
    };
    (0..56).map(place).collect()
}

/// Displacement away from the radar in a pass, metres: a slide of 25 m radius about x = 5, y = 115 m, 3 mm a pass at its centre.
fn motion([x, y]: [f64; 2], pass: usize) -> f64 {
    let off = (x - 5.0).hypot(y - 115.0) / 25.0;
    3e-3 * pass as f64 * (0.5 * PI * off.min(1.0)).cos().powi(2)
}

/// Change of the refractive index in a pass. A wave in air of the index `1 + e` sees a point at the range `r (1 + e)`.
fn index(pass: usize) -> f64 {
    1e-5 * (2.0 * pass as f64).sin()
}

/// Image of a pass, 4 hours after the one before: points moved along the line of sight from the middle of the rail, at some 30 dB over the noise.
fn pass(at: &Path, name: &str, number: usize, platform: &str) {
    let mut scene = String::new();
    for [x, y] in points() {
        let range_m = x.hypot(y).hypot(HEIGHT_M);
        let moved = motion([x, y], number) + index(number) * range_m;
        let [x, y, z] = [x, y, -HEIGHT_M].map(|v| v * (1.0 + moved / range_m));
        let z = z + HEIGHT_M;
        let _ = write!(
            scene,
            "[[scene.point]]\nposition = \"{x:.7}, {y:.7}, {z:.7} m\"\ncross_section = \"10 dBsm\"\n"
        );
    }
    write_recording(
        at,
        name,
        format!(
            r#"name = "{name}"
seed = {seed}
collection_start = "2026-05-04T{hour:02}:00:00Z"
[scene]
reference = "0, 95, 0 m"
x = "-45, 45 m"
y = "50, 145 m"
{scene}
[radar]
kind = "ideal"
pulses = 400
pri = "5 ms"
centre = "17.2 GHz"
bandwidth = "150 MHz"
samples = 256
[radar.noise]
power = "27 dB"
[platform]
{platform}
"#,
            seed = number + 1,
            hour = 4 * number
        ),
    );
    run(at, &format!("focus {name}.cphd --grid {GRID} --out {name}")).succeeded();
}

/// Table of points by the names of its columns.
fn table(at: &Path) -> Vec<HashMap<String, f64>> {
    let text = fs::read_to_string(at).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let values = line.split(',').map(|text| text.parse().unwrap_or(f64::NAN));
        let pairs = names.iter().map(|name| (*name).to_owned()).zip(values);
        pairs.collect()
    };
    lines.map(row).collect()
}

/// Errors of all displacements and their deviations, mm, and the largest displacement.
fn errors(table: &[HashMap<String, f64>], passes: usize) -> Vec<[f64; 2]> {
    let mut errors = Vec::new();
    for point in table {
        let off = |p: &[f64; 2]| (p[0] - point["x_m"]).hypot(p[1] - point["y_m"]);
        let true_point = points()
            .into_iter()
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap();
        // A pixel and a half: noise and the neighbouring side lobes pull the maximum.
        assert!(off(&true_point) < 0.8, "{point:?}");
        for k in 1..passes {
            let truth_mm = 1e3 * motion(true_point, k);
            errors.push([
                point[&format!("displacement_{k}_mm")] - truth_mm,
                point[&format!("deviation_{k}_mm")],
            ]);
        }
    }
    errors
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn slide_seen_from_a_rail_is_measured_within_a_tenth_of_a_millimetre() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for number in 0..5 {
        pass(at, &format!("pass{number}"), number, RAIL);
    }
    // The order of the command line does not matter where times are recorded.
    let line = format!(
        "displacement pass3 pass0 pass2 pass4 pass1 {STABLE} --format cog,zarr -o out --json"
    );
    let ran = run(at, &line);
    let of: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert!(!ran.stderr.contains("warning"), "{}", ran.stderr);
    let number = |key: &str| of.pointer(key).and_then(Value::as_f64).unwrap();
    assert_eq!(number("/counts/points"), 56.0, "{of}");
    assert_eq!(number("/counts/doubtful"), 0.0);
    assert_eq!(of["velocity_unit"], "mm/day");
    assert_eq!(number("/passes/4/time_s"), 16.0 * 3600.0);
    assert!(
        of["passes"][1]["image"]
            .as_str()
            .unwrap()
            .ends_with("pass1")
    );
    // Slope of the screen of each pass: 4 pi / lambda times the index, negative as for a recession.
    for pass in 1..5 {
        let expected = -4.0 * PI / WAVELENGTH_M * (index(pass) - index(0));
        let slope = number(&format!("/passes/{pass}/screen/slope_rad_per_m"));
        let deviation = number(&format!("/passes/{pass}/screen/slope_deviation_rad_per_m"));
        assert!(
            (slope - expected).abs() < 5.0 * deviation,
            "{pass}: {slope} {expected} {deviation}"
        );
    }

    let points = table(&at.join("out/points.csv"));
    assert_eq!(points.len(), 56);
    let errors = errors(&points, 5);
    let largest = errors.iter().map(|e| e[0].abs()).fold(0.0, f64::max);
    let of_all = rms(errors.iter().map(|e| e[0]));
    let within = errors.iter().filter(|[e, s]| e.abs() <= 1.96 * s).count();
    let covered = within as f64 / errors.len() as f64;
    println!("rms {of_all:.4} mm, largest {largest:.4} mm, bars cover {covered:.4}");
    // A point with 30 dB has 0.044 mm, the extrapolated screen up to as much; a slip is 8.7 mm.
    assert!(of_all < 0.1 && largest < 0.5, "{of_all} {largest}");
    // 224 errors, some 100 independent: a standard deviation of 2 %.
    assert!((0.89..=0.99).contains(&covered), "{covered}");
    // 3 mm in 4 hours at the centre.
    let fastest = points
        .iter()
        .map(|p| p["velocity_mm_per_day"])
        .fold(0.0, f64::max);
    let expected = 18.0
        * self::points()
            .into_iter()
            .map(|p| motion(p, 1) / 3e-3)
            .fold(0.0, f64::max);
    assert!((fastest - expected).abs() < 0.4, "{fastest} {expected}");

    // Zarr: displacement over pass, y and x has the values of the table.
    let about = fs::read(at.join("out/displacement.zarr/displacement/zarr.json")).unwrap();
    let about: Value = serde_json::from_slice(&about).unwrap();
    let shape = about["shape"].as_array().unwrap();
    let [rows, columns] = [1, 2].map(|i| shape[i].as_u64().unwrap() as usize);
    assert_eq!(shape[0], 5);
    assert_eq!(
        about["dimension_names"],
        serde_json::json!(["stack", "y", "x"])
    );
    let chunk = fs::read(at.join("out/displacement.zarr/displacement/c/4/0/0")).unwrap();
    let values: Vec<f32> = chunk
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    assert_eq!(values.len(), rows * columns);
    assert_eq!(values.iter().filter(|v| v.is_finite()).count(), 56);
    for point in &points {
        let value = values[point["row"] as usize * columns + point["column"] as usize];
        assert!((f64::from(value) - point["displacement_4_mm"]).abs() < 2e-5);
    }
    // The simulated scene lies at 0 degrees north and east.
    assert!(points[0]["latitude_deg"].abs() < 0.01 && points[0]["height_m"].abs() < 1.0);
    for name in ["displacement.tif", "velocity.tif"] {
        let info = run(at, &format!("info out/{name} --json"));
        let info: Value = serde_json::from_str(info.succeeded()).unwrap();
        assert!(info["stored"][0]["raster"]["epsg"].is_u64(), "{info}");
    }
    for name in [
        "displacement.png",
        "velocity.png",
        "series.png",
        "displacement.json",
    ] {
        assert!(at.join("out").join(name).is_file(), "{name}");
    }
    // Layers of the written stack are passes again, and give the same table.
    let layers: Vec<String> = (0..5)
        .map(|n| format!("out/displacement.zarr:{n}"))
        .collect();
    run(
        at,
        &format!("displacement {} {STABLE} -o again", layers.join(" ")),
    )
    .succeeded();
    let again = table(&at.join("again/points.csv"));
    for (point, again) in points.iter().zip(&again) {
        assert!((point["displacement_4_mm"] - again["displacement_4_mm"]).abs() < 1e-4);
    }
}

#[test]
fn slide_seen_from_an_arc_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pass(at, "first", 0, ARC);
    pass(at, "second", 1, ARC);
    // Times of the command line are in its order.
    let ran = run(
        at,
        &format!("displacement first second {STABLE} --times 0,30min -o out --json"),
    );
    let of: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(of["velocity_unit"], "mm/hour");
    let points = table(&at.join("out/points.csv"));
    assert!(points.len() >= 50, "{}", points.len());
    let errors = errors(&points, 2);
    let of_all = rms(errors.iter().map(|e| e[0]));
    println!("{} points, rms {of_all:.4} mm", points.len());
    assert!(of_all < 0.1, "{of_all}");
    for point in &points {
        // Two passes: the velocity is the displacement over half an hour.
        let rate = point["velocity_mm_per_hour"];
        assert!(
            (rate - 2.0 * point["displacement_1_mm"]).abs() < 1e-4,
            "{point:?}"
        );
    }
}

#[test]
fn unsuited_passes_and_options_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    pass(at, "first", 0, RAIL);
    pass(at, "second", 1, RAIL);
    run(
        at,
        "focus second.cphd --grid x=-40:40:0.3,y=52:142:0.5 --out other",
    )
    .succeeded();
    run(
        at,
        "focus first.cphd --grid x=-5:5:0.1,y=90:100:0.1 --out small",
    )
    .succeeded();
    run(at, "export small --layout amplitude -o first.tif").succeeded();
    for (passes, parts) in [
        ("first other", ["different grids", "--grid"]),
        ("first first", ["same time", "--times"]),
        (
            "first.tif second",
            ["first.tif", "expected a complex image"],
        ),
        ("first/image.npy second", ["image.npy", "antenna positions"]),
        (
            "first second --stable 100:110,20:30",
            ["stable area", "x 100 to 110 m"],
        ),
        (
            "first second --stable 0,63,1",
            ["at least 3 points", "found 1"],
        ),
        (
            "first second --floor 80",
            ["expected at least 3", "found 0"],
        ),
        ("first second --dispersion 2", ["dispersion", "found 2"]),
        ("first second --times 5,5", ["same time", "second"]),
    ] {
        run(at, &format!("displacement {passes} -o out")).failed(1, &parts);
    }
    for (passes, parts) in [
        ("first", ["IMAGE", "2 values"]),
        ("first second --times 5", ["--times", "2 passes, found 1"]),
        ("first second --times now,later", ["--times", "0,6h,12h"]),
        ("first second --stable 5", ["--stable", "centre and radius"]),
        (
            "first second --stable 0,0,-1",
            ["--stable", "centre and radius"],
        ),
        ("first second --format sicd", ["--format", "cog"]),
    ] {
        run(at, &format!("displacement {passes} -o out")).failed(2, &parts);
    }
    assert!(!at.join("out").exists());
    // Recordings without dates need times.
    let text = fs::read_to_string(at.join("first.toml")).unwrap();
    let undated: Vec<&str> = text
        .lines()
        .filter(|l| !l.starts_with("collection_start"))
        .collect();
    write_recording(at, "undated", undated.join("\n"));
    run(
        at,
        &format!("focus undated.cphd --grid {GRID} --out undated"),
    )
    .succeeded();
    run(at, "displacement undated second -o out").failed(1, &["undated", "--times"]);
}
