//! `subap plan radar`.

use std::fs;

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

/// Pass of the radar of Chim 2018, 5.6, on a platform of 0.1 m/s.
const L_BAND: &str =
    "--carrier 1.2GHz --bandwidth 200MHz --frequencies 50 --range 16 --scene 20 --velocity 0.1";

#[test]
fn chain_is_planned_with_warnings_of_compressing_stages() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = run(at, "plan radar --example");
    fs::write(at.join("chain.toml"), example.succeeded()).unwrap();
    let ran = run(at, &format!("plan radar --chain chain.toml {L_BAND}"));
    let text = ran.succeeded();
    // 5.3: noise figure of 1.604 dB and 36 dBm; Fig. A.5: compression at 29 dBm. A quarter of 231.3 mm (1.296 GHz) in 0.3 s, and
    // c / (20 1.198 GHz 0.3 s).
    for part in [
        "36.0 dBm",
        "above full scale",
        "noise figure dB",
        "dynamic range",
        "B210 saturates first",
        "50 carriers in 300 ms, every 300 ms",
        "0.1928 m/s in any direction, half a turn of phase from sweep to sweep: kept",
        "displaced by 0.1 cells at 41.71 mm/s without motion compensation: NOT kept",
        "0.3855 m/s from sweep to sweep",
    ] {
        assert!(text.contains(part), "no '{part}' in {text}");
    }
    let warning = "warning: PA: level of 36.0 dBm exceeds the output compression point of 29.0 dBm; insert 7.0 dB of attenuation before it";
    assert!(ran.stderr.contains(warning), "{}", ran.stderr);
    let ran = run(
        at,
        &format!("plan radar --chain chain.toml {L_BAND} --beamwidth 20 --json"),
    );
    let plan: Value = serde_json::from_str(ran.succeeded()).unwrap();
    let number = |place: &str| plan.pointer(place).unwrap().as_f64().unwrap();
    assert_eq!(plan["chain"]["receive"][1]["name"], "LNA");
    assert!((number("/chain/receive/2/noise_figure_db") - 1.604).abs() < 5e-4);
    // Both are 1 m^2 of the same energy; the converter adds its quantisation noise.
    let lost_db = number("/sensitivity/image_snr_db") - number("/chain/converter/image_snr_db");
    let noises_db = number("/chain/converter/quantisation_noise_dbm")
        - number("/chain/converter/thermal_noise_dbm");
    let expected_db = 10.0 * (1.0 + 10f64.powf(noises_db / 10.0)).log10();
    assert!(
        (lost_db - expected_db).abs() < 1e-6,
        "{lost_db} {expected_db}"
    );
    // Within 10 degrees of broadside the radial speed is 0.173648 of the platform's.
    let beam_m_s = number("/sweep/limits/followed_m_s");
    assert!(
        (beam_m_s * 0.173_648 / 0.192_768 - 1.0).abs() < 1e-4,
        "{beam_m_s}"
    );
    let keys = run(at, "plan radar --keys");
    for key in ["[[receive]]", "noise_figure", "carrier_time", "[converter]"] {
        assert!(keys.succeeded().contains(key), "{key}");
    }
    assert_eq!(listing(at).len(), 1);
}

#[test]
fn faults_of_a_chain_are_reported_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let example = run(at, "plan radar --example").succeeded().to_owned();
    fs::write(at.join("chain.toml"), &example).unwrap();
    let damaged = example.replace("noise_figure = \"1.6 dB\"", "noise_figure = \"1.6 dBm\"");
    let line = 1 + damaged
        .lines()
        .position(|line| line.contains("1.6 dBm"))
        .unwrap();
    fs::write(at.join("damaged.toml"), damaged).unwrap();
    let place = format!("damaged.toml:{line}:16");
    for (line, code, parts) in [
        (
            "plan radar --chain damaged.toml",
            1,
            vec![&*place, "found a power"],
        ),
        ("plan radar --chain missing.toml", 1, vec!["missing.toml"]),
        (
            "plan radar --chain chain.toml --frequencies 50 --prf 4 --velocity 0.1 --scene 20 --range 16",
            1,
            vec!["sweep of 50 carriers", "250 ms", "300 ms", "carrier_time"],
        ),
        (
            "plan radar --chain chain.toml --power 1",
            2,
            vec!["--power", "--chain"],
        ),
        (
            "plan radar --keys --example",
            2,
            vec!["--keys", "--example"],
        ),
    ] {
        run(at, line).failed(code, &parts);
    }
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
