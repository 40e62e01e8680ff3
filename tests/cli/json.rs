//! JSON results of every command that prints any, and the log.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use subaperture_tests::subap::{listing, run};

/// A folder with `scene.cphd` in it.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    folder
}

/// Output of a command: one JSON object of the expected schema.
#[track_caller]
fn object(folder: &Path, line: &str, schema: &str) -> Value {
    let ran = run(folder, &format!("{line} --json"));
    let value: Value = serde_json::from_str(ran.succeeded()).unwrap();
    assert_eq!(value["schema"], schema, "{line}");
    assert!(
        value["schema_version"]
            .as_u64()
            .is_some_and(|version| version >= 1),
        "{line}"
    );
    assert_eq!(value["warnings"], serde_json::json!([]), "{line}");
    value
}

/// The summary states the same as the record, and nothing else.
#[track_caller]
fn assert_focus_summary(summary: &Value, record: &Value) {
    let keys: Vec<&String> = summary.as_object().unwrap().keys().collect();
    assert_eq!(
        keys,
        [
            "files",
            "former",
            "grid",
            "measured_error_db",
            "predicted_error_db",
            "run_time_s",
            "schema",
            "schema_version",
            "warnings"
        ]
    );
    let (settings, check) = (&record["settings"], &record["check"]);
    let resolved = &settings["resolved"];
    let former = match &resolved["former"] {
        Value::Null => &settings["algorithm"],
        former => former,
    };
    assert_eq!(&summary["former"], former);
    let measured = match check {
        Value::Null => &resolved["sampled_error_db"],
        check => &check["relative_to_image_db"],
    };
    assert!(measured.is_number(), "{record}");
    assert_eq!(&summary["measured_error_db"], measured);
    let predicted = &resolved["predicted_error_db"];
    assert!(predicted.is_number(), "{record}");
    assert_eq!(&summary["predicted_error_db"], predicted);
    let grid = &summary["grid"];
    assert_eq!(grid["kind"], record["grid"]["kind"]);
    for axis in ["columns", "rows"] {
        assert_eq!(grid[axis], record["grid"][axis]["count"]);
    }
    // The record is made before the files are written.
    let [all_s, recorded_s] =
        [summary, &record["run"]].map(|of| of["run_time_s"].as_f64().unwrap());
    assert!(all_s >= recorded_s && recorded_s > 0.0);
}

/// Images formed at once by the default algorithm, in tiles, and a part of the tiles.
#[test]
fn focus_summary_matches_the_record() {
    let folder = scene();
    let folder = folder.path();
    let record = |image: &str| -> Value {
        let text = fs::read(folder.join(image).join("image.json")).unwrap();
        serde_json::from_slice(&text).unwrap()
    };
    let line = format!("focus scene.cphd {GRID} --error-db -50 --out whole --product png");
    let got = object(folder, &line, "subaperture-focus");
    assert_focus_summary(&got, &record("whole"));
    assert_eq!(got["former"], "ffbp");
    let files = got["files"].as_array().unwrap();
    assert_eq!(files[3], json!({ "path": "whole/map.png", "kind": "png" }));
    assert!(files[4..].iter().all(|file| file["kind"] == "sidecar"));
    let line = format!("focus scene.cphd -a bp {GRID} --tiled --out tiles");
    let got = object(folder, &line, "subaperture-focus");
    assert_focus_summary(&got, &record("tiles"));
    let store = json!({ "path": "tiles/image.zarr", "kind": "image" });
    assert_eq!(got["files"][0], store);
    // A part of the tiles has neither record nor picture yet.
    let grid = "--grid x=-30:30:0.2,y=-30:30:0.2";
    let line = format!("plan focus scene.cphd -a bp {grid} -o plan.json");
    object(folder, &line, "subaperture-plan");
    let mut parts = Vec::new();
    for part in ["1/2", "2/2"] {
        let line = format!("focus scene.cphd --plan plan.json --tiles {part} --out parts");
        parts.push(object(folder, &line, "subaperture-focus"));
    }
    let tiles = &parts[0]["tiles"];
    assert_eq!(parts[0]["complete"], false);
    assert!(tiles["formed"].as_u64().unwrap() < tiles["count"].as_u64().unwrap());
    let store = json!({ "path": "parts/image.zarr", "kind": "image" });
    assert_eq!(parts[0]["files"], json!([store]));
    assert_eq!(parts[1]["files"][0], store);
    assert_focus_summary(&parts[1], &record("parts"));
}

const GRID: &str = "--grid x=-5:5:0.5,y=-5:5:0.5";

/// Fine enough for the point in the middle to be measured.
const FINE: &str = "--grid x=-5:5:0.25,y=-5:5:0.25";

#[test]
fn every_command_prints_one_object() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let got = object(
        folder,
        "simulate --preset table-4-1 -o scene.cphd",
        "subaperture-simulate",
    );
    assert_eq!(
        got["files"],
        json!([{
            "path": "scene.cphd",
            "kind": "phase history",
            "channels": [{ "channel": "1", "pulses": 1040, "samples": 256 }],
        }])
    );
    assert_eq!(
        object(folder, "info scene.cphd", "subaperture-info")["num_pulses"],
        1040
    );
    let line = format!("focus scene.cphd -a bp {FINE} --check 20 --out image");
    let got = object(folder, &line, "subaperture-focus");
    // The record has the rest.
    let record = fs::read(folder.join("image/image.json")).unwrap();
    let record: Value = serde_json::from_slice(&record).unwrap();
    assert_focus_summary(&got, &record);
    assert_eq!(
        got["files"],
        json!([
            { "path": "image/image.npy", "kind": "image" },
            { "path": "image/image.json", "kind": "record" },
            { "path": "image/image.png", "kind": "picture" },
        ])
    );
    assert_eq!(record["check"]["num_pixels"], 20);
    // Settings that were given are listed as given, and the others with their defaults.
    let given = record["settings"]["given"].as_object().unwrap();
    for key in [
        "grid",
        "mode",
        "error_db",
        "allow_error",
        "sub_cpi",
        "patch_m",
        "velocity_m_s",
        "check",
        "no_src",
        "no_keystone",
    ] {
        assert!(given.contains_key(key), "{key}");
    }
    run(
        folder,
        &format!("focus scene.cphd -a exact {FINE} --out exact"),
    )
    .succeeded();
    let got = object(folder, "compare image exact", "subaperture-comparison");
    assert!(got["error_db"].as_f64().unwrap() < -60.0);
    let got = object(
        folder,
        "quality image --against exact/image.json",
        "subaperture-quality",
    );
    assert!(got["points"][0]["response"].is_object());
    let line = "velocity scene.cphd --at 0,0 --vx -1:1:1 --vy -1:1:1 --out plane";
    let got = object(folder, line, "subaperture-velocity-plane");
    assert!(got["brightest"]["level_db"].is_number());
    let got = object(folder, "crosscheck scene.cphd", "subaperture-crosscheck");
    assert_eq!(
        (
            &got["within_bound"],
            &got["float"]["bound_db"],
            &got["fixed"]["bound_db"]
        ),
        (&true.into(), &(-100.0).into(), &(-60.0).into())
    );
    assert_eq!(got["schema_version"], 2);
    assert!(got["rdbp"]["worst_db"].as_f64() <= got["rdbp"]["bound_db"].as_f64());
    let got = object(
        folder,
        "plan radar --carrier 9.6GHz",
        "subaperture-radar-plan",
    );
    assert!(got["costs"].is_array());
    let got = object(
        folder,
        &format!("plan module --ram 512K scene.cphd {FINE}"),
        "subaperture-module-plan",
    );
    assert!(got["ram"].is_object());
    object(folder, "picture image -o again.png", "subaperture-picture");
    let got = object(folder, "reproduce --list", "subaperture-reproduce-list");
    assert!(got["items"].as_array().unwrap().len() > 10);
    let got = object(
        folder,
        "demo --out demo --grid x=-2:2:1,y=-2:2:1",
        "subaperture-demo",
    );
    assert!(got["formers"].is_array());
}

#[test]
fn info_reads_outputs_of_other_commands() {
    let folder = scene();
    run(
        folder.path(),
        &format!("focus scene.cphd -a bp {GRID} --check 20 --out image"),
    )
    .succeeded();
    run(
        folder.path(),
        "velocity scene.cphd --at 0,0 --vx -1:1:1 --vy -1:1:1 --out plane",
    )
    .succeeded();
    let ran = run(folder.path(), "info image plane image/image.npy");
    let text = ran.succeeded();
    for part in [
        "image            image",
        "20: x in metres from -5 to 4.5 by 0.5",
        "former           bp",
        "dB measured",
        "formed of        scene.cphd, 2.3 MiB",
        "v_x in m/s from -1 to 0 by 1",
        "20 rows x 20 columns, complex64",
    ] {
        assert!(text.contains(part), "no '{part}' in {text}");
    }
    let of = |path: &str| {
        object(
            folder.path(),
            &format!("info {path}"),
            "subaperture-info-stored",
        )
    };
    assert_eq!(
        of("image")["stored"][0]["record"],
        of("image/image.json")["stored"][0]["record"]
    );
    assert_eq!(of("image/image.npy")["stored"][0]["rows"], 20);
    // A record's folder and any name of its image compare alike.
    let compare = |names: &str| {
        run(folder.path(), &format!("compare {names}"))
            .succeeded()
            .to_owned()
    };
    let whole = compare("image image/image.npy");
    // An array has no metadata; the output states this after the same numbers.
    let figures = compare("image/image.json image");
    let note = whole.strip_prefix(figures.trim_end()).unwrap();
    assert!(note.contains("image/image.npy has no metadata"), "{whole}");
    assert!(whole.contains("relative RMS error   none"), "{whole}");
}

/// Every line, in order, of a log of either format as kind and text.
fn kinds(text: &str, json: bool) -> Vec<String> {
    let kind = |line: &str| match json {
        true => serde_json::from_str::<Value>(line).unwrap()["kind"]
            .as_str()
            .unwrap()
            .to_owned(),
        false => {
            let (time, rest) = line.split_once(' ').unwrap();
            assert!(time.len() == 24 && time.ends_with('Z'), "{line}");
            rest.split_once(':').unwrap().0.to_owned()
        }
    };
    text.lines()
        .filter(|line| !line.starts_with(' '))
        .map(kind)
        .collect()
}

#[test]
fn log_contains_whole_run_for_any_verbosity() {
    let folder = scene();
    for (name, options, json) in [
        ("run.log", "", false),
        ("run.jsonl", "", true),
        ("other.log", "--log-format json", true),
    ] {
        let line = format!(
            "focus scene.cphd -q -a bp {GRID} --check 20 --out {name}.d --log {name} {options}"
        );
        let ran = run(folder.path(), &line);
        ran.succeeded();
        assert_eq!(ran.stderr, "", "-q is quiet");
        let text = fs::read_to_string(folder.path().join(name)).unwrap();
        let found = kinds(&text, json);
        assert_eq!(
            (found[0].as_str(), found[found.len() - 1].as_str()),
            ("begin", "end")
        );
        for kind in ["note", "setting", "timing", "result"] {
            assert!(
                found.iter().any(|found| found == kind),
                "{name}: no {kind} in {text}"
            );
        }
        for part in [
            "focus scene.cphd -q",
            "focusing took ",
            "checking took ",
            "exit status 0 after ",
            "oversampling = ",
        ] {
            assert!(text.contains(part), "no '{part}' in {text}");
        }
        // A second run, which fails, is appended with its error.
        let ran = run(
            folder.path(),
            &format!("info missing --log {name} {options}"),
        );
        ran.failed(1, &["error: cannot read missing"]);
        let both = fs::read_to_string(folder.path().join(name)).unwrap();
        assert!(both.starts_with(&text));
        let found = kinds(&both[text.len()..], json);
        assert_eq!(
            (found[0].as_str(), found[found.len() - 1].as_str()),
            ("begin", "end")
        );
        assert!(found.iter().any(|found| found == "error"), "{both}");
        assert!(both.contains("exit status 1 after "), "{both}");
    }
}

#[test]
fn log_contains_missed_bounds_and_full_disk_is_an_error() {
    let folder = scene();
    run(
        folder.path(),
        &format!("focus scene.cphd -a bp {GRID} --out a"),
    )
    .succeeded();
    run(
        folder.path(),
        &format!("focus scene.cphd -a exact {GRID} --out b"),
    )
    .succeeded();
    let line = "compare a b --error-db -190 --log run.jsonl --json";
    let ran = run(folder.path(), line);
    ran.failed(3, &["warning: "]);
    let printed: Value = serde_json::from_str(&ran.stdout).unwrap();
    let warning = printed["warnings"][0].as_str().unwrap();
    let log = fs::read_to_string(folder.path().join("run.jsonl")).unwrap();
    let lines = log
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap());
    let lines: Vec<Value> = lines.collect();
    assert!(
        lines
            .iter()
            .any(|line| line["kind"] == "warning" && line["message"] == warning),
        "{log}"
    );
    assert_eq!(lines[lines.len() - 1]["exit_status"], 3);
    // The command continues without its log.
    if Path::new("/dev/full").exists() {
        let before = listing(folder.path());
        let ran = run(folder.path(), "compare a b --log /dev/full");
        assert!(ran.succeeded().contains("correlation"), "{ran:?}");
        assert!(ran.stderr.contains("warning: the log ends here"), "{ran:?}");
        assert_eq!(listing(folder.path()), before);
    }
}
