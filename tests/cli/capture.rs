//! Captures by the simulated radio through the command: profiles, faults, a full disk, Ctrl-C, `kill -9`.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use serde_json::Value;
use subaperture::radio::sigmf::{Recording, Step};
use subaperture_tests::subap::{Ran, command, listing, run, write_thesis_experiment};
use subaperture_tests::tiny_disk::TinyDisk;
use tempfile::TempDir;

/// Without noise and settling, so that captures are fast; the recorded format is the same.
const QUIET: &str = "--set device.impairments=false";

/// A folder with the examples `thesis.toml` and `scene.toml`.
fn examples() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_thesis_experiment(folder.path());
    folder
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(ran.succeeded()).unwrap()
}

/// Capture the empty scene and one with a reflector of 4 m^2 at 5 m, and calibrate from both.
fn calibrate(folder: &Path) {
    let scene = fs::read_to_string(folder.join("scene.toml")).unwrap();
    let (sky, _) = scene.split_once("[[scene.point]]").unwrap();
    let point = "[[scene.point]]\nposition = \"5, 0, 0 m\"\ncross_section = \"4 m^2\"\n";
    for (name, text) in [
        ("sky", sky.to_owned()),
        ("reflector", format!("{sky}{point}")),
    ] {
        fs::write(folder.join(format!("{name}.toml")), text).unwrap();
        let line = format!(
            "capture thesis.toml -o {name} --set device.scenario={name}.toml --set plan.sweeps=1"
        );
        run(folder, &line).succeeded();
    }
    // Half of the path from the transmitter to 5 m and back to the receiver, 0.1 m from it.
    let line = "radio calibrate --sky sky --reflector reflector.sigmf-data --range 5.0005 -o calibration.json";
    run(folder, line).succeeded();
}

/// Assert that the three objects of C 5.6 are within 2 cm of their ranges, and that there are no other peaks. (The antennas are 0.1 m
/// apart, so half of the path is up to 5 mm longer; the derivation is in the radio's own tests.)
fn assert_thesis(folder: &Path, recording: &str, sweep: u64) {
    let line = format!(
        "profile {recording} --sweep {sweep} --calibration calibration.json --window kaiser:7 --reach 25 --json"
    );
    let result = json(&run(folder, &line));
    let peaks = result["scatterers"].as_array().unwrap();
    assert_eq!(peaks.len(), 3, "{peaks:?}");
    for (peak, range_m) in peaks.iter().zip([1.0, 6.3, 16.0f64]) {
        let half_path_m = 0.5 * (range_m + range_m.hypot(0.1));
        let off_m = peak["range_m"].as_f64().unwrap() - half_path_m;
        assert!(off_m.abs() < 0.02, "{range_m} m: {off_m}");
    }
}

#[test]
fn experiment_is_captured_calibrated_profiled_and_replayed() {
    let folder = examples();
    let at = folder.path();
    calibrate(at);
    let result = json(&run(
        at,
        "capture thesis.toml -o walk --set plan.sweeps=3 --json",
    ));
    assert_eq!(
        (&result["ended"], result["steps"].as_u64()),
        (&"done".into(), Some(150))
    );
    let recording = Recording::open(&at.join("walk")).unwrap();
    assert_eq!(
        (recording.steps().len(), recording.interrupted()),
        (150, false)
    );
    assert_thesis(at, "walk.sigmf-meta", 2);
    run(
        at,
        "profile walk.sigmf-meta --out pictures --calibration calibration.json",
    )
    .succeeded();
    for name in ["profile.png", "waterfall.png"] {
        let bytes = fs::read(at.join("pictures").join(name)).unwrap();
        assert!(
            bytes.starts_with(b"\x89PNG") && bytes.len() > 5000,
            "{name}"
        );
    }
    // At least 13 dB lower and without a consistent position: phases are random.
    let strongest = |more: &str| {
        let result = json(&run(at, &format!("profile walk.sigmf-meta {more} --json")));
        let levels = result["scatterers"].as_array().unwrap();
        levels
            .iter()
            .map(|peak| peak["level_db"].as_f64().unwrap())
            .fold(-300.0, f64::max)
    };
    assert!(strongest("--no-reference") < strongest("") - 10.0);
    run(
        at,
        "capture thesis.toml -o again --replay walk.sigmf-meta --set plan.sweeps=3",
    )
    .succeeded();
    let data = |name: &str| fs::read(at.join(name)).unwrap();
    assert!(data("again.sigmf-data") == data("walk.sigmf-data"));
    // A calibration for other gains is refused, as is overwriting a recording.
    run(
        at,
        "capture thesis.toml -o louder --set radio.receive_gain=43 --set plan.sweeps=1",
    )
    .failed(1, &["radio.receive_gain", "dB"]);
    let louder = [
        "capture",
        "thesis.toml",
        "-o",
        "louder",
        "--set",
        "plan.sweeps=1",
        "--set",
        "radio.receive_gain=43 dB",
    ];
    assert!(command(at, louder).output().unwrap().status.success());
    run(at, "profile louder --calibration calibration.json")
        .failed(1, &["40 dB", "43", "calibrate again"]);
    let before = listing(at);
    run(at, "capture thesis.toml -o walk").failed(1, &["never overwritten"]);
    assert_eq!(listing(at), before);
}

/// Six adjacent carriers are not sent: 24 MHz of 200. Their interpolated values are accurate to more than the 25 dB of the reported range.
#[test]
fn avoided_band_is_not_sent_and_interpolated() {
    let folder = examples();
    let at = folder.path();
    calibrate(at);
    let words = [
        "capture",
        "thesis.toml",
        "-o",
        "avoiding",
        "--set",
        "plan.sweeps=1",
        "--set",
        "plan.avoid=[\"1.164 GHz, 1.188 GHz\"]",
    ];
    assert!(command(at, words).output().unwrap().status.success());
    let recording = Recording::open(&at.join("avoiding")).unwrap();
    assert_eq!(recording.steps().len(), 44);
    let sent = |step: &Step| (1.164e9..1.188e9).contains(&(step.carrier_hz + 125e3));
    assert!(!recording.steps().iter().any(sent));
    assert_thesis(at, "avoiding.sigmf-meta", 0);
}

#[test]
fn faults_are_reported_marked_and_left_out_of_profiles() {
    let folder = examples();
    let at = folder.path();
    calibrate(at);
    let faults = "\n[faults]\noverflow = 0.08\nlost_packet = 0.1\nlate = 0.08\nunderflow = 0.05\npacket = 120\nseed = 3\n";
    let text = fs::read_to_string(at.join("thesis.toml")).unwrap();
    fs::write(at.join("faults.toml"), format!("{text}{faults}")).unwrap();
    let ran = run(
        at,
        "capture faults.toml -o faults --set plan.sweeps=2 --json",
    );
    let result = json(&ran);
    ran.reports("warning: of 100 steps ");
    let recording = Recording::open(&at.join("faults")).unwrap();
    let marked = recording
        .steps()
        .iter()
        .filter(|step| !step.lost.is_empty())
        .count() as u64;
    let flagged = |name: &str| result["flagged"][name].as_u64().unwrap();
    assert!(
        flagged("late") > 0 && flagged("with_lost_samples") > 0,
        "{result}"
    );
    assert_eq!(flagged("late") + flagged("with_lost_samples"), marked);
    for kind in ["overflows", "underflows", "late_commands", "lost_packets"] {
        assert!(
            result["events"][kind].as_u64() > Some(0),
            "{kind}: {result}"
        );
    }
    for sweep in 0..2 {
        assert_thesis(at, "faults.sigmf-meta", sweep);
    }
    // A fault in the third sweep; the two before are complete.
    fs::write(
        at.join("gone.toml"),
        format!("{text}\n[faults]\nunplug_at = 130\n"),
    )
    .unwrap();
    run(at, "capture gone.toml -o gone").failed(
        1,
        &["radio disconnected", "gone.sigmf-meta", "check its cable"],
    );
    let recording = Recording::open(&at.join("gone")).unwrap();
    assert!(!recording.interrupted() && recording.steps().len() > 100);
    assert_thesis(at, "gone.sigmf-meta", 1);
}

/// 256 KiB: half of a sweep of 400 kB.
#[test]
fn full_disk_keeps_the_earlier_samples() {
    let Some(disk) = TinyDisk::mount() else {
        return;
    };
    let folder = examples();
    let at = folder.path();
    let out = disk.path().join("full");
    let words = ["capture", "thesis.toml", "-o", out.to_str().unwrap()];
    let ran: Ran = command(at, words).output().unwrap().into();
    ran.failed(1, &["full.sigmf-", "No space left", "free disk space"]);
    let recording = Recording::open(&out).unwrap();
    let steps = recording.steps().len();
    // A step of 1000 samples of two channels has 8000 bytes, and its line some 300.
    assert!(
        recording.interrupted() && (20..33).contains(&steps),
        "{steps}"
    );
    let ran = run(at, &format!("profile {}", out.display()));
    ran.failed(1, &["killed", "of 50 steps are usable"]);
}

/// Start an endless capture and return when it has recorded at least `steps` steps.
fn begun(at: &Path, name: &str, more: &str, steps: usize) -> std::process::Child {
    let line = format!("capture thesis.toml -o {name} {QUIET} {more}");
    let child = command(at, line.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let journal = at.join(format!("{name}.sigmf-journal"));
    while fs::read(&journal).map_or(0, |text| text.split(|&b| b == b'\n').count()) <= steps {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "no step recorded in time"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    child
}

#[test]
fn killed_capture_opens_with_all_complete_steps() {
    let folder = examples();
    let at = folder.path();
    let mut child = begun(at, "killed", "--set plan.sweeps=0", 120);
    // SIGKILL on Unix: no code of the program runs afterwards.
    child.kill().unwrap();
    child.wait().unwrap();
    let lines = fs::read_to_string(at.join("killed.sigmf-journal"))
        .unwrap()
        .matches('\n')
        .count();
    let recording = Recording::open(&at.join("killed")).unwrap();
    assert!(recording.interrupted());
    assert_eq!(recording.steps().len(), lines);
    let ran = run(at, "profile killed --sweep 1 --json");
    assert!(ran.stderr.contains("warning: the capture was killed"));
    // Uncalibrated: the three objects, and the leakage, which the longer loopback cable shifts below zero and so to the far end.
    let peaks = json(&ran)["scatterers"].as_array().unwrap().len();
    assert_eq!(peaks, 4);
}

#[cfg(unix)]
#[test]
fn interrupted_capture_is_complete() {
    let folder = examples();
    let at = folder.path();
    for (name, sweeps, code) in [("endless", 0, 0), ("some", 1_000_000, 130)] {
        let child = begun(at, name, &format!("--set plan.sweeps={sweeps}"), 60);
        let killed = std::process::Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        let output: Ran = child.wait_with_output().unwrap().into();
        assert_eq!(output.code, Some(code), "{output:?}");
        if code == 130 {
            output.failed(130, &["interrupted", "some.sigmf-meta"]);
        }
        let recording = Recording::open(&at.join(name)).unwrap();
        assert!(!recording.interrupted() && recording.steps().len() >= 60);
    }
}

#[test]
fn wrong_options_and_keys_are_reported_with_advice() {
    let folder = examples();
    let at = folder.path();
    let before = listing(at);
    for (line, code, parts) in [
        ("capture", 2, vec!["EXPERIMENT"]),
        ("capture thesis.toml", 2, vec!["--out", "files.recording"]),
        ("capture thesis.toml -o a --keys", 2, vec!["--keys"]),
        ("capture --example unknown", 2, vec!["--example", "thesis"]),
        ("capture none.toml -o a", 1, vec!["none.toml"]),
        (
            "capture thesis.toml -o a --replay none",
            1,
            vec!["none.sigmf-meta"],
        ),
        (
            "capture thesis.toml -o a --set plan.stepz=4",
            1,
            vec!["stepz"],
        ),
        (
            "capture thesis.toml -o a --set plan.pri=0.1s",
            1,
            vec!["lengthen the pri"],
        ),
        (
            "capture thesis.toml -o a --set device.scenario=none.toml",
            1,
            vec!["none.toml"],
        ),
        ("profile none", 1, vec!["none.sigmf-meta"]),
        ("profile none --fineness 1000", 2, vec!["64"]),
        (
            "profile none --no-reference --calibration c",
            2,
            vec!["--no-reference"],
        ),
        ("radio", 2, vec!["probe"]),
        ("radio probe none.toml", 1, vec!["none.toml"]),
        (
            "radio calibrate --sky a --reflector b -o c",
            2,
            vec!["--range"],
        ),
        (
            "radio convert a -o b.cphd --reference 0,5,0 --origin 91,0",
            2,
            vec!["--origin", "latitudes"],
        ),
    ] {
        run(at, line).failed(code, &parts);
    }
    // A build without UHD lists the simulated radio and states how to enable others.
    let listed = run(at, "radio list");
    assert!(listed.succeeded().contains("simulated"), "{listed:?}");
    for word in ["libuhd-dev", "feature uhd", "GPL"] {
        assert!(listed.stderr.contains(word), "{listed:?}");
    }
    let listed = run(at, "radio list --json");
    let listed: serde_json::Value = serde_json::from_str(listed.succeeded()).unwrap();
    assert_eq!(listed["radios"].as_array().unwrap().len(), 1, "{listed}");
    run(at, "radio list --serial 31F0A2B").failed(1, &["libuhd-dev", "feature uhd", "GPL"]);
    let keys = run(at, "capture --keys");
    for key in [
        "[plan]",
        "[device]",
        "[faults]",
        "leakage_delay",
        "receive_subdevices",
    ] {
        assert!(keys.succeeded().contains(key), "{key}");
    }
    let result = json(&run(at, "capture thesis.toml -o a --dry-run --json"));
    // 50 carriers of twice 2 ms to retune, 1 ms of lead and 1 ms of dwell; 8000 bytes each.
    assert!((result["sweep_s"].as_f64().unwrap() - 0.3).abs() < 1e-9);
    assert_eq!(result["disk"][0]["bytes"].as_f64().unwrap().round(), 8e6);
    // A quarter wavelength of the highest carrier, 1.296 GHz, in a sweep of 0.3 s.
    let followed_m_s = result["speed"]["limits"]["followed_m_s"].as_f64().unwrap();
    assert!((followed_m_s / (299_792_458.0 / (4.0 * 1.296e9 * 0.3)) - 1.0).abs() < 1e-9);
    let probed = run(at, "radio probe thesis.toml");
    assert!(probed.succeeded().contains("simulated B210") && probed.stdout.contains("locked"));
    let probed = run(at, "radio probe thesis.toml --set plan.pri=0.1s");
    probed.succeeded();
    assert!(
        probed
            .stderr
            .contains("warning: the plan is not possible on this radio")
    );
    assert_eq!(listing(at), before);
}

/// Ten minutes of radio time with the plan of C 5.6 and all impairments, as fast as this machine allows: no sample is lost, and the last
/// sweep is as accurate as the first. About three minutes on one processor, and 800 MB of disk.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn ten_minutes_are_captured_without_loss() {
    let folder = examples();
    let at = folder.path();
    calibrate(at);
    let result = json(&run(
        at,
        "capture thesis.toml -o soak --set plan.sweeps=2000 --json",
    ));
    println!("{result}");
    assert_eq!(
        (&result["ended"], result["steps"].as_u64()),
        (&"done".into(), Some(100_000))
    );
    assert_eq!(result["lost_samples"].as_u64(), Some(0));
    for counts in [&result["flagged"], &result["events"]] {
        let counts = counts.as_object().unwrap();
        assert!(
            counts.values().all(|count| count.as_u64() == Some(0)),
            "{counts:?}"
        );
    }
    let recording = Recording::open(&at.join("soak")).unwrap();
    let steps = recording.steps();
    assert_eq!(steps.len(), 100_000);
    assert!(steps.windows(2).all(|pair| pair[0].time_s < pair[1].time_s));
    assert!(steps.last().unwrap().time_s > 600.0);
    for sweep in [0, 1000, 1999] {
        assert_thesis(at, "soak", sweep);
    }
}
