//! `subap quality`, and image products read back.

use std::fs;

use glam::DVec3;
use num_complex::Complex64;
use serde_json::Value;
use subaperture::io::cphd::{self, Channel, WriteOptions};
use subaperture::io::product;
use subaperture::monitor::Silent;
use subaperture::phase_history::PhaseHistory;
use subaperture::simulate::{PointTargetHistory, Preset, Scatterer, Variation};
use subaperture_tests::subap::{listing, run, write_recording};

const GRID: &str = "--grid x=-8:8:0.28,y=-16:16:0.35";

#[test]
fn product_is_measured_and_plotted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scatterer = Scatterer {
        position_m: DVec3::ZERO,
        amplitude: Complex64::cis(0.5),
    };
    let table = Preset::Table41.simulate(&Variation::default());
    let history = PointTargetHistory::new(table.collection().clone(), vec![scatterer], None);
    let channels = [Channel::new("1", &history)];
    cphd::write(
        at.join("t.cphd"),
        &channels,
        &WriteOptions::default(),
        &Silent,
    )
    .unwrap();
    run(at, &format!("focus t.cphd -o fast {GRID}")).succeeded();
    run(
        at,
        &format!("focus t.cphd -o exact --algorithm exact {GRID}"),
    )
    .succeeded();
    let line = "quality fast --at 0,0 --against exact --line-of-sight 90 --json --plots pictures";
    let report: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let number = |pointer: &str| {
        report
            .pointer(pointer)
            .and_then(Value::as_f64)
            .unwrap_or_else(|| panic!("no {pointer}"))
    };
    // A unit scatterer in the middle of the scene: position to 1/128 of the cells of 0.58 m and 0.75 m. Its phase
    // is 0.5 less the effect of the range error, 4 pi / 0.03 m.
    assert!(number("/points/0/response/column_value").abs() < 0.58 / 128.0);
    let off_m = number("/points/0/response/row_value");
    assert!(off_m.abs() < 0.75 / 128.0);
    assert!(number("/points/0/response/level_db").abs() < 0.02);
    let phase_rad = number("/points/0/response/phase_rad") - 0.5 - 419.17 * off_m;
    assert!(phase_rad.abs() < 0.02, "{phase_rad}");
    assert_eq!(report["points"][0]["response"]["turn_is_known"], true);
    // Range is along y: 1.185 cells of 0.7495 m with Taylor's 35 dB window.
    let width_m = number("/points/0/response/cuts/1/width_3db");
    let wanted_m = number("/points/0/theory/1/width_3db");
    assert!(
        (wanted_m / (1.185 * 0.7495) - 1.0).abs() < 5e-3,
        "{wanted_m}"
    );
    assert!(
        (width_m / wanted_m - 1.0).abs() < 0.02,
        "{width_m} {wanted_m}"
    );
    let range_m = number("/points/0/response/cuts/2/width_3db");
    assert!((range_m / width_m - 1.0).abs() < 1e-6, "90 degrees are y");
    assert!(number("/against/comparison/error_db") < -60.0);
    assert!(number("/against/mean_coherence") > 0.99);
    assert!(number("/against/offset_pixels/rows").abs() < 0.01);
    assert!(number("/against/percent_difference/median") < 2.0);
    let pictures: Vec<String> = listing(&at.join("pictures"))
        .keys()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        pictures,
        [
            "coherence.png",
            "percent-difference.png",
            "point-1-chip.png",
            "point-1-cross-range.png",
            "point-1-range.png",
            "point-1-x.png",
            "point-1-y.png",
        ]
    );
    let table = run(at, "quality fast --at 0,0 --against exact");
    for part in [
        "theory",
        "PSLR",
        "point at x",
        "entropy",
        "shift",
        "mean coherence",
    ] {
        assert!(table.succeeded().contains(part), "{part}: {}", table.stdout);
    }
    assert!(
        !table.stdout.contains("less than pi per pixel"),
        "{}",
        table.stdout
    );
    // An array alone is measured in pixels: the same width, in steps of 0.35 m, and its phase with a proviso.
    let pixels = run(at, "quality fast/image.npy --at 29,46");
    assert!(pixels.succeeded().contains("less than pi per pixel"));
    let line = "quality fast/image.npy --at 29,46 --window taylor --json";
    let pixels: Value = serde_json::from_str(run(at, line).succeeded()).unwrap();
    let width = pixels["points"][0]["response"]["cuts"][1]["width_3db"]
        .as_f64()
        .unwrap();
    assert!((width * 0.35 / width_m - 1.0).abs() < 1e-6, "{width}");

    // Reading back, and files that do not belong together.
    let stored = product::read(&at.join("fast")).unwrap();
    assert_eq!(stored.grid, GRID["--grid ".len()..].parse().unwrap());
    assert_eq!((stored.image.rows, stored.image.columns), (92, 58));
    let path = at.join("fast/image.npy");
    let mut bytes = fs::read(&path).unwrap();
    bytes[500] ^= 1;
    fs::write(&path, &bytes).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "CRC-32", "form it again"]);
    bytes.pop();
    fs::write(&path, &bytes).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "bytes, found"]);
    fs::remove_file(&path).unwrap();
    run(at, "quality fast").failed(1, &["image.npy", "a product is a folder"]);
    fs::write(
        at.join("fast/image.json"),
        "{\"grid\": {\"kind\": \"round\"}}",
    )
    .unwrap();
    run(at, "quality fast").failed(1, &["image.json", "grid.origin_m"]);
    fs::write(at.join("fast/image.json"), "{").unwrap();
    run(at, "quality fast").failed(1, &["image.json", "not JSON"]);
}

#[test]
fn invalid_requests_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --preset table-4-1 -o t.cphd").succeeded();
    run(at, &format!("focus t.cphd -o a {GRID}")).succeeded();
    run(at, "focus t.cphd -o b --grid x=-3:3:0.3,y=-3:3:0.3").succeeded();
    let before = listing(at);
    for (line, code, parts) in [
        ("quality", 2, vec!["IMAGE"]),
        ("quality a --at 1", 2, vec!["--at", "10.5,-3"]),
        (
            "quality a --extent 3:1,0:1",
            2,
            vec!["--extent", "ascending"],
        ),
        ("quality a --coherence 4", 2, vec!["--coherence", "odd"]),
        ("quality nowhere", 1, vec!["nowhere"]),
        ("quality .", 1, vec!["image.json", "a product is a folder"]),
        ("quality a --at 100,0", 1, vec!["x 100 is not on the image"]),
        (
            "quality a --at 0,0 --extent 50:51,0:1",
            1,
            vec!["--extent", "no pixel lies within"],
        ),
        (
            "quality a --at 0,0 --against b/image.npy",
            1,
            vec!["differ in size"],
        ),
        ("quality a --at 7.5,0", 1, vec!["too close to the border"]),
        ("quality t.cphd", 1, vec!["t.cphd", "expected an image"]),
    ] {
        run(at, line).failed(code, &parts);
    }
    assert_eq!(listing(at), before);
}

/// A squinted spotlight of one point at x 3 m, y -2 m.
const SQUINTED: &str = r#"
name = "squinted"
[scene]
x = "-15, 15 m"
y = "-15, 15 m"
[[scene.point]]
position = "3, -2, 0 m"
[radar]
kind = "ideal"
pulses = 250
pri = "2 ms"
centre = "10 GHz"
bandwidth = "400 MHz"
samples = 128
[platform]
kind = "linear"
position = "-700, -1000, 400 m"
velocity = "120, 0, 0 m/s"
"#;

fn squinted(at: &std::path::Path) {
    write_recording(at, "s", SQUINTED);
}

/// Number at the JSON pointer `pointer` of a report.
fn number(report: &Value, pointer: &str) -> f64 {
    report
        .pointer(pointer)
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("no {pointer} in {report:#}"))
}

fn report(at: &std::path::Path, line: &str) -> Value {
    serde_json::from_str(run(at, line).succeeded()).unwrap()
}

/// Assert that every cut agrees with theory: width to 1 %, side lobes to 0.3 dB.
fn assert_theory(report: &Value, theory: &str, cuts: usize) {
    for i in 0..cuts {
        let of = |key: &str| {
            let found = number(report, &format!("/points/0/response/cuts/{i}/{key}"));
            let wanted = number(report, &format!("/points/0/{theory}/{i}/{key}"));
            println!("cut {i} {key}: {found:.4}, {theory} {wanted:.4}");
            (found, wanted)
        };
        let (width, wanted) = of("width_3db");
        assert!(
            (width / wanted - 1.0).abs() < 0.01,
            "cut {i}: {width} {wanted}"
        );
        for ratio in [
            "null_rule/pslr_db",
            "null_rule/islr_db",
            "fixed_rule/pslr_db",
        ] {
            let (found, wanted) = of(ratio);
            assert!(
                (found - wanted).abs() < 0.3,
                "cut {i} {ratio}: {found} {wanted}"
            );
        }
    }
}

#[test]
fn theory_holds_along_any_line_of_squinted_image() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    squinted(at);
    for window in ["none", "taylor"] {
        let windows = format!("--window {window} --slow-window {window}");
        run(
            at,
            &format!("focus s.cphd -o {window} --grid x=-13:17:0.1,y=-15:13:0.1 {windows}"),
        )
        .succeeded();
        let line = format!("quality {window} --at 3,-2 --line-of-sight 55 --json");
        assert_theory(&report(at, &line), "theory", 4);
    }
    // Half of the resolution's bounding box along x, 0.43 m with Taylor's window, differs much from the measurement.
    let measured = report(at, "quality taylor --at 3,-2 --json");
    let width_m = number(&measured, "/points/0/theory/0/width_3db");
    println!("along x: {width_m:.4} m");
    // Formed again, the response is the same; with even illumination, so is the theory.
    let again = report(
        at,
        "quality taylor --at 3,-2 --from s.cphd --line-of-sight 55 --json",
    );
    assert_theory(&again, "theory", 4);
    assert_theory(&again, "theory_with_gain", 4);
    assert_eq!(again["points"][0]["formed"]["former"], "exact");
    run(at, "simulate --preset table-4-1 -o other.cphd").succeeded();
    run(at, "quality taylor --from other.cphd").failed(1, &["1040 pulses", "formed from 250"]);
    run(at, "quality taylor/image.npy --from s.cphd").failed(2, &["--from", "folder"]);
}

#[test]
fn coarse_image_is_refused_and_measured_from_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    squinted(at);
    run(
        at,
        "focus s.cphd -o coarse --grid x=-13:17:0.5,y=-15:13:0.5",
    )
    .succeeded();
    run(at, "quality coarse --at 3,-2").failed(1, &["too coarse", "0.5000 apart", "--from"]);
    let measured = report(at, "quality coarse --at 3,-2 --from s.cphd --json");
    assert_theory(&measured, "theory", 2);
    for (i, wanted) in [3.0, -2.0, 0.0].into_iter().enumerate() {
        let found = number(&measured, &format!("/points/0/response/position_m/{i}"));
        assert!((found - wanted).abs() < 0.005, "{i}: {found}");
    }
    let text = run(at, "quality coarse --at 3,-2 --from s.cphd");
    for part in [
        "formed from the recording by exact",
        "theory, with gain",
        "x 3.00",
    ] {
        assert!(text.succeeded().contains(part), "{part}: {}", text.stdout);
    }
}

/// On a rotated and shifted grid and on a vertical one, positions are in scene coordinates, in options and output.
#[test]
fn positions_are_in_scene_coordinates_on_any_plane() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    squinted(at);
    for (name, grid, place) in [
        (
            "flat",
            "x=-13:13:0.1,y=-10:16:0.1,yaw=30,cx=10,cy=-5",
            "3,-2",
        ),
        (
            "vertical",
            "x=-13:13:0.1,y=-12:12:0.1,cx=3,cy=-2,yaw=90,roll=90",
            "3,-2,0",
        ),
        (
            "tilted",
            "x=-13:13:0.1,y=-12:12:0.1,cx=1,cy=-1,z=1,yaw=20,pitch=26.5651",
            "3,-2",
        ),
    ] {
        run(
            at,
            &format!("focus s.cphd -o {name} --grid {grid} --window none --slow-window none"),
        )
        .succeeded();
        let at_place = match name {
            "tilted" => String::new(),
            _ => format!("--at {place}"),
        };
        let measured = report(at, &format!("quality {name} {at_place} --json"));
        assert_theory(&measured, "theory", 2);
        if name == "tilted" {
            // The point is not on the plane, so the position of its echo there is not checked.
            continue;
        }
        for (i, wanted) in [3.0, -2.0, 0.0].into_iter().enumerate() {
            let found = number(&measured, &format!("/points/0/response/position_m/{i}"));
            assert!((found - wanted).abs() < 0.02, "{name} {i}: {found}");
        }
        let text = run(at, &format!("quality {name} {at_place}"));
        let said = text.succeeded();
        assert!(
            ["point at x 3.0", "point at x 2.9"]
                .iter()
                .any(|x| said.contains(x))
                && said.contains(" m, z "),
            "{said}"
        );
    }
    run(at, "quality vertical --at 3,-2").failed(2, &["vertical", "X,Y,Z"]);
}

/// A beam that illuminates part of the pass: the response agrees with the theory of weighted pulses, not with that of equal pulses.
#[test]
fn theory_uses_beam_of_recording() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    run(at, "simulate --example stripmap").succeeded();
    let text = subaperture::simulate::scenario::examples::text("stripmap").unwrap();
    write_recording(at, "strip", text);
    run(
        at,
        "focus strip.cphd -o strip --grid x=-20:20:0.1,y=-10:30:0.3",
    )
    .succeeded();
    let measured = report(at, "quality strip --at 0,10 --from strip.cphd --json");
    let width = |of: &str| number(&measured, &format!("/points/0/{of}/0/width_3db"));
    let (found, lit, alike) = (
        width("response/cuts"),
        width("theory_with_gain"),
        width("theory"),
    );
    println!("measured {found:.4} m, with gain {lit:.4} m, all pulses alike {alike:.4} m");
    assert!((lit / found - 1.0).abs() < 0.02, "{lit} {found}");
    assert!(
        alike < 0.9 * found,
        "the beam matters here: {alike} {found}"
    );
}
