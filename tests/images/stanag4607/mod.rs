//! STANAG 4607 packets as the PyPI package `stanag4607` decodes them. Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

mod given;
mod values;

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use serde_json::Value;
use subaperture_gmti::stanag4607::encode;

use given::{dwells, job, mission};
use values::{check_dwell, check_job, check_mission, equal};

fn decoded(packets: &[Vec<u8>]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("targets.4607");
    fs::write(&file, packets.concat()).unwrap();
    let python = std::env::var_os("SUBAPERTURE_PYTHON").unwrap_or_else(|| "python3".into());
    let script = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("python/stanag4607_check.py");
    let output = Command::new(&python)
        .arg(script)
        .arg(&file)
        .output()
        .unwrap_or_else(|e| panic!("cannot run {python:?} ({e}) with stanag4607"));
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn stanag_4607_package_decodes_written_values() {
    let (mission, job, dwells) = (mission(), job(), dwells());
    let packets = [
        encode(&mission, &job, &[]).unwrap(),
        encode(&mission, &job, &dwells).unwrap(),
    ];
    let decoded = decoded(&packets);
    assert_eq!(decoded.as_array().unwrap().len(), 2);
    for ((found, packet), job_id) in decoded
        .as_array()
        .unwrap()
        .iter()
        .zip(&packets)
        .zip([0, job.id])
    {
        assert_eq!(found["issues"], serde_json::json!([]));
        let header = [
            ("version_id", "30".into()),
            ("packet_size", packet.len().into()),
            ("nationality", "XN".into()),
            ("security_classification", 5.into()),
            ("classification_system", "  ".into()),
            ("security_codes", 0.into()),
            ("exercise_indicator", 2.into()),
            ("platform_id", "UAV 7     ".into()),
            ("mission_id", 3_000_000_001u32.into()),
            ("job_id", job_id.into()),
        ];
        equal(&found["header"], &header);
        check_mission(&found["segments"][0]);
        check_job(&found["segments"][1], &job);
    }
    let segments = decoded[1]["segments"].as_array().unwrap();
    assert_eq!(segments.len(), 4);
    for (found, dwell) in segments[2..].iter().zip(&dwells) {
        check_dwell(found, dwell);
    }
    assert_eq!(segments[2]["utc"], "2024-02-29T23:59:58.765+00:00");
    assert_eq!(segments[3]["utc"], "2024-03-01T00:00:03.766+00:00");
}
