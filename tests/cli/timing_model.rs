//! `--portable`, `--model` and `subap plan calibrate`, and the stages that `-v` prints.

use std::fs;

use serde_json::Value;
use subaperture_tests::subap::run;

/// The whole scene: on a part of it a stored plan may miss its bound by scatterers outside. Pixels half a metre apart contain the scene's
/// energy, so neither image is planned again.
const GRID: &str = "--grid x=-40:40:0.5,y=-40:40:0.5";

fn record(path: &std::path::Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn timing_model_and_transforms_are_in_plans_and_records() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let ran = |line: &str| run(folder.path(), line);
    ran("simulate --preset table-4-1 -o t.cphd").succeeded();

    let output = ran("plan calibrate -o here.json --name bench");
    assert!(
        output.succeeded().contains("--model here.json"),
        "{output:?}"
    );
    let model = record(&at("here.json"));
    assert_eq!(model["schema"], "subaperture-time-model-3");
    assert_eq!(model["name"], "bench");
    // The program's own file, so it can be replaced by another measurement.
    ran("plan calibrate -o here.json --name bench").succeeded();
    let model = record(&at("here.json"));

    for former in ["bp", "ffbp"] {
        let line =
            format!("focus t.cphd -a {former} {GRID} --portable --model here.json -o {former}");
        ran(&line).succeeded();
        let resolved = &record(&at(former).join("image.json"))["settings"]["resolved"];
        assert_eq!(resolved["transforms"], "portable");
        assert_eq!(resolved["time_model"]["name"], "bench");
        assert_eq!(
            resolved["time_model"]["leaf_group_ns"],
            model["leaf_group_ns"]
        );

        // A stored plan determines transforms and timing model, and gives the same bits.
        let line = format!(
            "plan focus t.cphd -a {former} {GRID} --portable --model here.json -o {former}.json"
        );
        ran(&line).succeeded();
        let plan = record(&at(&format!("{former}.json")));
        assert_eq!(plan["transforms"], "portable");
        assert_eq!(plan["time_model"]["name"], "bench");
        fs::rename(at("here.json"), at("elsewhere.json")).unwrap();
        ran(&format!(
            "focus t.cphd --plan {former}.json -o tiles-{former}"
        ))
        .succeeded();
        fs::rename(at("elsewhere.json"), at("here.json")).unwrap();
        ran(&format!("compare tiles-{former} {former} --error-db -200")).succeeded();
    }

    ran(&format!("focus t.cphd {GRID} -o plain")).succeeded();
    let plain = record(&at("plain/image.json"));
    assert_eq!(plain["settings"]["resolved"]["transforms"], "fastest");
    assert_eq!(plain["settings"]["resolved"]["time_model"], "default");
    let line = "velocity t.cphd --at 1,2 --vx -1:1:0.5 --vy -1:1:0.5 --portable -o velocity";
    ran(line).succeeded();
    ran("focus t.cphd --plan bp.json --portable -o x").failed(2, &["--portable"]);
    ran("focus t.cphd --plan bp.json --model here.json -o x").failed(2, &["--model"]);
}

#[test]
fn invalid_timing_models_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let ran = |line: &str| run(folder.path(), line);
    ran("simulate --preset table-4-1 -o t.cphd").succeeded();
    ran("plan calibrate -o m.json").succeeded();
    let text = fs::read_to_string(folder.path().join("m.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    let refused = |text: &str, parts: &[&str]| {
        fs::write(folder.path().join("wrong.json"), text).unwrap();
        ran("focus t.cphd --model wrong.json -o x").failed(1, parts);
        ran("plan focus t.cphd --model wrong.json -o x.json").failed(1, parts);
    };
    for wrong in [Value::Null, 0.0.into(), (-3.0).into(), "fast".into()] {
        let mut other = json.clone();
        other["point_ns"] = wrong;
        refused(&other.to_string(), &["wrong.json"]);
    }
    let mut other = json.clone();
    other["point_ns"] = (-3.0).into();
    refused(
        &other.to_string(),
        &["point_ns of the time model 'measured' is not a valid time"],
    );
    refused("here", &["wrong.json", "expected a timing model"]);
    refused(&text.replace("model-3", "model-1"), &["measure it again"]);
    ran("focus t.cphd --model nowhere.json -o x").failed(1, &["nowhere.json"]);
    // A file by another program is not replaced.
    fs::write(folder.path().join("mine.json"), "{}").unwrap();
    ran("plan calibrate -o mine.json").failed(1, &["mine.json"]);
}

#[test]
fn verbose_lists_stages_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    let ran = |line: &str| run(folder.path(), line);
    ran("simulate --preset table-4-1 -o t.cphd").succeeded();
    for (former, stages) in [
        ("bp", ["profiles", "pixels"]),
        ("ffbp", ["histories of patches", "leaves"]),
        ("rdbp", ["histories of patches", "maps"]),
        ("rdbp --patch 10", ["maps", "pixels"]),
    ] {
        let name = former.replace(' ', "");
        for tiled in ["", "--tiled"] {
            let line = format!("focus t.cphd -a {former} {GRID} -v {tiled} -o {name}{tiled}");
            let output = ran(&line);
            output.succeeded();
            let notes: Vec<&str> = output.stderr.lines().collect();
            for stage in stages {
                let of_stage = |text: &str| {
                    let begins = format!("note: stage {stage} ");
                    let is = |line: &&str| line.starts_with(&begins) && line.contains(text);
                    notes
                        .iter()
                        .position(is)
                        .unwrap_or_else(|| panic!("{stage} {text}: {output:?}"))
                };
                assert!(
                    of_stage("operations, about") < of_stage("took"),
                    "{output:?}"
                );
            }
            assert!(output.stderr.contains("stage reading "), "{output:?}");
        }
        let output = ran(&format!("focus t.cphd -a {former} {GRID} -o quiet-{name}"));
        output.succeeded();
        assert!(!output.stderr.contains("stage "), "{output:?}");
    }
}
