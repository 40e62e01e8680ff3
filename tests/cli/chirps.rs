//! Captures of chirps by the simulated radio through the command, and calibration with several reflectors.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture_tests::subap::{Ran, listing, run, write_thesis_experiment};
use tempfile::TempDir;

/// A folder with the examples `chirp.toml`, `thesis.toml` and `scene.toml`.
fn examples() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_thesis_experiment(folder.path());
    let chirp = run(folder.path(), "capture --example chirp");
    fs::write(folder.path().join("chirp.toml"), chirp.succeeded()).unwrap();
    folder
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(ran.succeeded()).unwrap()
}

/// Write scenes with the radar of `scene.toml`: points on the x axis with range and cross section.
fn scene(folder: &Path, name: &str, points: &[(f64, f64)]) {
    let text = fs::read_to_string(folder.join("scene.toml")).unwrap();
    let (radar, _) = text.split_once("[[scene.point]]").unwrap();
    let point = |(range_m, square_m): &(f64, f64)| {
        format!(
            "[[scene.point]]\nposition = \"{range_m}, 0, 0 m\"\ncross_section = \"{square_m} m^2\"\n"
        )
    };
    let points: String = points.iter().map(point).collect();
    fs::write(folder.join(name), format!("{radar}{points}")).unwrap();
}

/// Half of the path from the transmitter to a point at `range_m` and back to the receiver, 0.1 m from it.
fn half_path_m(range_m: f64) -> f64 {
    0.5 * (range_m + range_m.hypot(0.1))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// Two reflectors 20 m apart, 1.7 resolutions of 0.8 of the bandwidth: ranges within four stated standard deviations, and the delay of the
/// antenna cables, 5 ns more than that of the loop.
#[test]
fn captured_chirps_are_profiled_and_converted() {
    let folder = examples();
    let at = folder.path();
    scene(at, "scene.toml", &[(40.0, 1e4), (60.0, 5e4)]);
    let forecast = json(&run(at, "capture chirp.toml -o chirp --dry-run --json"));
    assert!((number(&forecast["resolution_m"]) - 9.37).abs() < 0.005);
    assert!((number(&forecast["unambiguous_m"]) - 29_979.2).abs() < 0.1);
    let captured = json(&run(at, "capture chirp.toml -o chirp --json"));
    assert_eq!(captured["schema"], "subaperture-chirp-capture");
    assert_eq!(
        (number(&captured["bursts"]), number(&captured["pulses"])),
        (4.0, 60.0)
    );
    let bytes = fs::metadata(at.join("chirp.sigmf-data")).unwrap().len();
    assert_eq!(number(&forecast["disk"][0]["bytes"]), bytes as f64);
    run(at, "info chirp.sigmf-meta").succeeded();
    let info = json(&run(at, "info chirp.toml --json"));
    assert_eq!(info["stored"][0]["kind"], "chirp experiment");

    let profile = json(&run(at, "profile chirp --json --out pictures --sweep 1"));
    let found = profile["scatterers"].as_array().unwrap();
    println!("{found:?}");
    assert_eq!(found.len(), 2, "{found:?}");
    let cables_m = 0.5 * 5e-9 * 299_792_458.0;
    for (one, range_m) in found.iter().zip([40.0, 60.0]) {
        let off_m = number(&one["range_m"]) - half_path_m(range_m) - cables_m;
        assert!(
            off_m.abs() < 4.0 * number(&one["sigma_m"]),
            "{one}: {off_m}"
        );
        assert!(number(&one["sigma_m"]) < 0.05, "{one}");
    }
    let shown = profile["profile"]["levels_db"].as_array().unwrap().len() as f64;
    let shown_m = (shown - 1.0) * number(&profile["profile"]["spacing_m"]);
    assert!((100.0..101.0).contains(&shown_m), "{shown_m}");
    for name in ["profile.png", "waterfall.png"] {
        assert!(at.join("pictures").join(name).is_file());
    }
    // Each burst is a pulse.
    fs::write(
        at.join("track.csv"),
        "time_s,x_m,y_m,z_m\n0,-1,0,0\n40,1,0,0\n",
    )
    .unwrap();
    run(
        at,
        "radio convert chirp --track track.csv --reference 0,50,0 -o chirp.cphd",
    )
    .succeeded();
    let info = json(&run(at, "info chirp.cphd --json"));
    assert_eq!(number(&info["num_pulses"]), 4.0);
    assert_eq!(number(&info["num_samples"]), 2561.0);
}

/// The display changes no sample. Without a terminal it prints lines, and the page has an address.
#[test]
fn live_view_of_chirps_changes_no_sample() {
    let folder = examples();
    let at = folder.path();
    let captured = |name: &str, more: &str| {
        let ran = run(at, &format!("capture chirp.toml -o {name} {more}"));
        ran.succeeded();
        let data = fs::read(at.join(format!("{name}.sigmf-data"))).unwrap();
        (data, ran.stderr)
    };
    let (plain, printed) = captured("plain", "");
    assert!(!printed.contains("the page is at"), "{printed}");
    let (watched, printed) = captured("watched", "--live --page");
    assert!(plain == watched && !plain.is_empty());
    assert!(
        printed.contains("the page is at http://127.0.0.1:"),
        "{printed}"
    );
    // A calibration of another set-up is reported before the first burst.
    fs::write(at.join("other.json"), "{}").unwrap();
    let line = "capture chirp.toml -o none --live --set files.calibration=other.json";
    run(at, line).failed(1, &["other.json"]);
    assert!(!at.join("none.sigmf-meta").exists());
}

#[test]
fn options_of_stepped_captures_are_refused_for_chirps() {
    let folder = examples();
    let at = folder.path();
    let before = listing(at);
    run(
        at,
        "capture chirp.toml -o x --module emulate:float --profiles p",
    )
    .failed(2, &["--module does not apply to chirps"]);
    run(at, "capture chirp.toml").failed(2, &["--out NAME"]);
    run(at, "capture chirp.toml -o x --set chirp.pulses=1").failed(1, &["chirp.pulses", "2"]);
    run(at, "capture chirp.toml -o x --set plan.steps=5").failed(1, &["plan.steps"]);
    assert_eq!(listing(at), before);
}

/// Cables of 5 ns more than the loop, three reflectors, one of them surveyed 2 cm too near: the residuals show it.
#[test]
fn calibration_with_several_reflectors_has_residuals() {
    let folder = examples();
    let at = folder.path();
    scene(at, "sky.toml", &[]);
    scene(at, "three.toml", &[(5.0, 4.0), (8.0, 10.0), (13.0, 50.0)]);
    for name in ["sky", "three"] {
        let line = format!(
            "capture thesis.toml -o {name} --set device.scenario={name}.toml --set plan.sweeps=1"
        );
        run(at, &line).succeeded();
    }
    let ranges = [5.0, 8.0, 13.0].map(half_path_m);
    let calibrate = |ranges: [f64; 3], out: &str| {
        let ranges = ranges.map(|range_m| format!("--range {range_m}")).join(" ");
        let line = format!("radio calibrate --sky sky --reflector three {ranges} -o {out} --json");
        json(&run(at, &line))["receivers"][0].clone()
    };
    let delay_m = 0.5 * 5e-9 * 299_792_458.0;
    let right = calibrate(ranges, "right.json");
    let off_m = number(&right["delay_m"]) - delay_m;
    println!("{off_m:+.5} m: {right}");
    // Four standard deviations, and the clock's 2 ppm of 13 m.
    assert!(off_m.abs() < 4.0 * number(&right["delay_sigma_m"]) + 3e-5);
    assert!(number(&right["delay_sigma_m"]) < 0.005);
    let [a, b, c] = ranges;
    let wrong = calibrate([a, b - 0.02, c], "wrong.json");
    let residuals = wrong["reflectors"].as_array().unwrap();
    let residuals: Vec<f64> = residuals
        .iter()
        .map(|one| number(&one["residual_m"]))
        .collect();
    println!("{residuals:?}");
    // A third of the error is in the mean.
    for (residual_m, expected_m) in residuals.iter().zip([-0.0067, 0.0133, -0.0067]) {
        assert!((residual_m - expected_m).abs() < 0.005);
    }
    let line = "radio calibrate --sky sky --reflector three --range 5 --range 9.5 -o none.json";
    run(at, line).failed(1, &["no reflector", "9.5"]);
}
