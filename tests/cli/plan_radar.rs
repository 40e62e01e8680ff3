//! `subap plan radar`.

use serde_json::Value;
use subaperture_tests::subap::{listing, run};

#[test]
fn pass_is_planned_as_text_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run(folder.path(), "plan radar --scene 80 --sub-cpi 52");
    let text = ran.succeeded();
    for part in [
        "0.7495 m",
        "0.5766",
        "149.9 km",
        "lobe 1 at 52 pulses",
        "11.53 m",
        "-21.",
        "rdbp, thesis",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    let ran = run(
        folder.path(),
        "plan radar --range 10000 --beamwidth 2 --power 100 --pulse-length 1e-5 --gain 20 --json",
    );
    let plan: Value = serde_json::from_str(ran.succeeded()).unwrap();
    // 2 10 km tan 1 deg = 349.10 m of track at 0.125 m: 2793 pulses.
    assert_eq!(plan["work"]["pulses"], 2793);
    // lambda / (4 sin 1 deg) = 0.42945 m.
    let beam_m = plan["aperture"]["beam_resolution_m"].as_f64().unwrap();
    assert!((beam_m / 0.42945 - 1.0).abs() < 1e-3, "{beam_m}");
    // 20 dBW + 40 dB - 30.463 dB m² - 32.976 - 160 = -163.439 dBW against -203.975 + 1.604 dBW/Hz over 200 MHz.
    let sample_db = plan["sensitivity"]["sample_snr_db"].as_f64().unwrap();
    assert!((sample_db + 44.078).abs() < 0.01, "{sample_db}");
    // 10 us of 200 MHz: 33.01 dB; 2793 pulses: 34.46 dB.
    let image_db = plan["sensitivity"]["image_snr_db"].as_f64().unwrap();
    assert!((image_db - 23.393).abs() < 0.02, "{image_db}");
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn recording_is_planned_like_its_pass() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o a.cphd").succeeded();
    let plan = |line: &str| -> Value {
        serde_json::from_str(run(folder.path(), line).succeeded()).unwrap()
    };
    let grid = "--grid x=-40:40:0.5,y=-40:40:0.5,z=0 --json";
    let recorded = plan(&format!("plan radar a.cphd --plots pictures {grid}"));
    let typed = plan(&format!("plan radar --carrier 10e9 {grid}"));
    for (group, name) in [
        ("aperture", "cross_range_resolution_m"),
        ("survey", "range_resolution_m"),
        ("sub_cpis", "predicted_db"),
    ] {
        let of = |plan: &Value| plan[group][name].as_f64().unwrap();
        // A CPHD converts positions to Earth-centred ones: 6,400 km in float64.
        assert!((of(&recorded) / of(&typed) - 1.0).abs() < 1e-3, "{name}");
    }
    let costs = |plan: &Value| plan["costs"].as_array().unwrap().clone();
    assert_eq!(costs(&recorded).len(), costs(&typed).len());
    for (recorded, typed) in costs(&recorded).iter().zip(&costs(&typed)) {
        assert_eq!(recorded["algorithm"], typed["algorithm"]);
        assert_eq!(recorded["total_bytes"], typed["total_bytes"], "{typed}");
        assert_eq!(recorded["operations"], typed["operations"], "{typed}");
    }
    let picture = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    for name in ["pictures/response.png", "pictures/ambiguity.png"] {
        assert_eq!(&picture(name)[1..4], b"PNG");
    }
    plan(&format!(
        "plan radar --carrier 10e9 --plots code --pulse barker13:1e-6 {grid}"
    ));
    assert_ne!(
        picture("pictures/ambiguity.png"),
        picture("code/ambiguity.png")
    );
}

#[test]
fn wrong_usage_is_explained() {
    let folder = tempfile::tempdir().unwrap();
    for (line, code, parts) in [
        ("plan radar", 2, vec!["--carrier", "INPUT"]),
        ("plan radar a.cphd --carrier 1e9", 2, vec!["--carrier"]),
        ("plan radar --carrier 0", 2, vec!["--carrier", "above 0"]),
        (
            "plan radar --pulses 100 --aperture 10",
            2,
            vec!["--pulses", "--aperture"],
        ),
        (
            "plan radar --carrier 1e9 --power 10",
            2,
            vec!["--pulse-length"],
        ),
        (
            "plan radar --beamwidth 180",
            2,
            vec!["--beamwidth", "below 180"],
        ),
        ("plan radar --bandwidth 50e9", 1, vec!["below 0 Hz"]),
        ("plan radar --pulses 100000000", 1, vec!["pulses"]),
        (
            "plan radar --carrier 1e9 --pulse lfm:1e6:1e-6",
            2,
            vec!["--plots"],
        ),
        (
            "plan radar --carrier 1e9 --plots p --pulse barker13",
            2,
            vec!["--pulse", "barker13:SECONDS"],
        ),
        ("plan radar --grazing 90", 1, vec!["grazing"]),
        ("plan radar --scene 0.5", 1, vec!["--grid"]),
        ("plan radar none.cphd", 1, vec!["none.cphd"]),
    ] {
        run(folder.path(), line).failed(code, &parts);
    }
    assert!(listing(folder.path()).is_empty());
}
