//! `subap autofocus`: its estimates, its outputs, and `focus` on them.

use std::fs;
use std::path::Path;

use serde_json::Value;
use subaperture::io::{phase_csv, track_csv};
use subaperture::track::SampledTrack;
use subaperture_tests::subap::{command, listing, run};

const GRID: &str = "--grid x=-40:40:0.4,y=-40:40:0.4";

/// A folder with `shaken.cphd`: the spotlight example with recorded positions that have errors of 1.5 cm RMS along each axis, a wavelength
/// of path.
fn shaken() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let example = run(folder.path(), "simulate --example spotlight");
    fs::write(folder.path().join("spotlight.toml"), example.succeeded()).unwrap();
    let line = "simulate spotlight.toml -o shaken.cphd";
    let settings = [
        "navigation.noise=1.5, 1.5, 1.5 cm",
        "navigation.fix_rate=20 Hz",
        "radar.prf=500 Hz",
        "radar.pulses=512",
    ];
    let set = settings.iter().flat_map(|setting| ["--set", setting]);
    let output = command(folder.path(), line.split(' ').chain(set)).output();
    assert!(output.unwrap().status.success());
    folder
}

fn brightest_db(folder: &Path, name: &str) -> f64 {
    let record = fs::read(folder.join(name).join("image.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    record["brightest"]["level_db"].as_f64().unwrap()
}

#[test]
fn phases_are_estimated_written_and_corrected() {
    let folder = shaken();
    let at = folder.path();
    let found = run(
        at,
        &format!("autofocus shaken.cphd {GRID} -o phase.csv --picture both.png --json"),
    );
    let found: Value = serde_json::from_str(found.succeeded()).unwrap();
    assert_eq!(found["schema"], "subaperture-autofocus");
    assert_eq!(found["gained"], true);
    let entropy = |when: &str| found[when]["entropy"].as_f64().unwrap();
    assert!(entropy("after") < entropy("before") - 0.5, "{found}");
    assert_eq!(phase_csv::read(&at.join("phase.csv")).unwrap().len(), 512);

    run(at, &format!("focus shaken.cphd {GRID} --out before")).succeeded();
    run(
        at,
        &format!("focus shaken.cphd {GRID} --phase phase.csv --out after"),
    )
    .succeeded();
    let gained_db = brightest_db(at, "after") - brightest_db(at, "before");
    let reported_db =
        found["after"]["peak_db"].as_f64().unwrap() - found["before"]["peak_db"].as_f64().unwrap();
    // Both images are within -60 dB of the exact ones.
    assert!(
        gained_db > 2.0 && (gained_db - reported_db).abs() < 0.05,
        "{gained_db} {reported_db}"
    );
    let record: Value =
        serde_json::from_slice(&fs::read(at.join("after/image.json")).unwrap()).unwrap();
    assert!(
        record["inputs"].to_string().contains("phase.csv"),
        "{}",
        record["inputs"]
    );

    // The command replaces its own files, but not those of other programs.
    let part = "--grid x=-10:10:0.4,y=-10:10:0.4";
    run(
        at,
        &format!("autofocus shaken.cphd {part} --rounds 1 -o phase.csv"),
    )
    .succeeded();
    fs::write(at.join("mine.csv"), "pulse,phase_rad\n0,0\n").unwrap();
    run(at, &format!("autofocus shaken.cphd {GRID} -o mine.csv"))
        .failed(1, &["mine.csv", "--force"]);
    run(
        at,
        &format!("focus shaken.cphd {GRID} --phase mine.csv --out d"),
    )
    .failed(1, &["mine.csv", "1 entries", "one entry per pulse (512)"]);
    run(
        at,
        &format!("focus shaken.cphd {GRID} --phase none.csv --out d"),
    )
    .failed(1, &["none.csv"]);
    run(
        at,
        &format!("focus shaken.cphd {GRID} --phase phase.csv --tiled --out d"),
    )
    .failed(2, &["--phase", "--tiled"]);
}

#[test]
fn corrected_track_is_read_by_other_commands() {
    let folder = shaken();
    let at = folder.path();
    let line = format!(
        "autofocus shaken.cphd {GRID} -m sharpness --unknown track --rounds 3 -o track.csv"
    );
    let ran = run(at, &line);
    let printed = ran.succeeded();
    assert!(
        printed.contains("track corrected by") && printed.contains("entropy"),
        "{printed}"
    );
    let fixes = track_csv::read(&at.join("track.csv")).unwrap();
    assert_eq!(fixes.len(), 512);
    SampledTrack::new(&fixes).unwrap();
}

#[test]
fn autofocus_without_output_reports_the_gain() {
    let folder = shaken();
    let before = listing(folder.path());
    for (options, parts) in [
        ("-m map-drift --rounds 2", ["before", "after"]),
        ("--dry-run", ["at most 51 images", "200 x 200 pixels"]),
    ] {
        let ran = run(
            folder.path(),
            &format!("autofocus shaken.cphd {GRID} {options}"),
        );
        let printed = ran.succeeded();
        assert!(parts.iter().all(|part| printed.contains(part)), "{printed}");
    }
    assert_eq!(listing(folder.path()), before);
    for (line, part) in [
        ("autofocus shaken.cphd -m best", "map-drift"),
        ("autofocus shaken.cphd --looks 1", "--looks"),
        ("autofocus shaken.cphd --estimator mean", "eigenvector"),
        ("autofocus", "INPUT"),
    ] {
        run(folder.path(), line).failed(2, &[part]);
    }
}
