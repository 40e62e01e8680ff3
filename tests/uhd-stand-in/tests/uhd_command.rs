//! The command `subap` built with UHD: a capture through the library's interface equals that of the simulated radio byte for byte, and
//! faults are reported with advice.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use subaperture_radio::sigmf::Recording;
use tempfile::TempDir;

use crate::loading::with_stand_in_loaded;
use crate::scene;

/// The program, built on first use with all tested packages: another selection would enable other features of dependencies, and build all
/// of them again.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .args(["build", "--quiet", "--workspace", "--locked"])
            .args(["--exclude", "subaperture-firmware", "--bin", "subap"])
            .args([
                "--features",
                "subaperture-uhd-stand-in/uhd,subap/uhd,subap/gpu",
            ])
            .args(["--message-format", "json-render-diagnostics"])
            .stderr(Stdio::inherit())
            .output()
            .unwrap();
        assert!(output.status.success(), "subap does not build with UHD");
        let text = String::from_utf8(output.stdout).unwrap();
        let messages = text
            .lines()
            .filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let mut executables =
            messages.filter_map(|message| message["executable"].as_str().map(PathBuf::from));
        executables.next().expect("cargo names the executable")
    })
}

const PLAN: &str = r#"
    [plan]
    start = "1.1 GHz"
    stop = "1.3 GHz"
    steps = 50
    order = "shuffled"
"#;

/// Scene of the stand-in's radio.
const SIMULATED: &str = r#"
    [device]
    kind = "simulated"
    scenario = "scene.toml"
    loop_delay = "1.5e-8 s"
    cable_delay = "2e-8 s"
    leakage = 3
    leakage_delay = "5e-10 s"
"#;

/// A folder with experiments for both devices.
fn experiments(wire: &str, faults: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("scene.toml", scene::SCENE.to_owned());
    write("simulated.toml", format!("{PLAN}{SIMULATED}{faults}"));
    write(
        "uhd.toml",
        format!("{PLAN}[device]\nkind = \"uhd\"\nserial = \"SIM00001\"\nwire = \"{wire}\"\n"),
    );
    folder
}

struct Ran {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

/// Run `subap` in the folder, through UHD's interface with the stand-in's faults.
fn ran(folder: &TempDir, faults: &str, line: &str) -> Ran {
    let libraries = folder.path().join("libraries");
    of(
        with_stand_in_loaded(program(), &libraries, faults),
        folder,
        line,
    )
}

fn of(mut command: Command, folder: &TempDir, line: &str) -> Ran {
    let output = command
        .args(line.split_whitespace())
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let ran = Ran {
        code: output.status.code(),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    };
    println!("{line}: {:?}\n{}{}", ran.code, ran.stdout, ran.stderr);
    ran
}

/// Counts of a capture, without values that depend on the disk and on names.
fn counts(ran: &Ran) -> Value {
    let mut result: Value = serde_json::from_str(&ran.stdout).unwrap();
    let object = result.as_object_mut().unwrap();
    for key in ["files", "waits", "longest_queue"] {
        object.remove(key).unwrap();
    }
    result
}

/// Capture with both devices and compare; returns the counts.
fn compare(wire: &str, simulated_faults: &str, faults: &str) -> Value {
    let folder = experiments(wire, simulated_faults);
    let by_uhd = ran(&folder, faults, "capture uhd.toml -o by-uhd --json");
    let directly = ran(&folder, faults, "capture simulated.toml -o directly --json");
    assert_eq!(by_uhd.code, directly.code);
    assert_eq!(counts(&by_uhd), counts(&directly));
    let samples = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let directly = samples("directly.sigmf-data");
    assert!(!directly.is_empty());
    assert!(
        samples("by-uhd.sigmf-data") == directly,
        "samples are not the same"
    );
    let steps = Recording::open(&folder.path().join("by-uhd")).unwrap();
    assert_eq!(
        Some(steps.steps().len() as u64),
        counts(&by_uhd)["steps"].as_u64()
    );
    counts(&by_uhd)
}

#[test]
fn capture_through_uhd_equals_that_of_simulated_radio() {
    let counts = compare("sc16", "", "");
    assert_eq!(
        (&counts["ended"], counts["steps"].as_u64()),
        (&"done".into(), Some(50))
    );
    assert_eq!(counts["warnings"], Value::Array(vec![]));
}

#[test]
fn faults_through_uhd_are_marked_as_by_simulated_radio() {
    let faults = "[faults]\noverflow = 0.12\nlost_packet = 0.1\nlate = 0.08\nunderflow = 0.06\npacket = 120\nseed = 5\n";
    let counts = compare("sc12", faults, "faults");
    assert!(counts["flagged"]["late"].as_u64() > Some(0), "{counts}");
    assert!(counts["events"]["overflows"].as_u64() > Some(0), "{counts}");
}

#[test]
fn unplugged_radio_exits_1_and_keeps_the_samples() {
    let folder = experiments("sc16", "");
    let ran = ran(&folder, "unplug", "capture uhd.toml -o walk");
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.contains("radio disconnected") && ran.stderr.contains("walk.sigmf-meta"));
    let recording = Recording::open(&folder.path().join("walk")).unwrap();
    assert!(!recording.interrupted() && !recording.steps().is_empty());
}

#[test]
fn radios_are_listed_and_probed() {
    let folder = experiments("sc16", "");
    let listed = ran(&folder, "", "radio list");
    assert_eq!(listed.code, Some(0));
    assert!(listed.stdout.contains("B210") && listed.stdout.contains("SIM00001"));
    let probed = ran(&folder, "", "radio probe uhd.toml --json");
    let state: Value = serde_json::from_str(&probed.stdout).unwrap();
    assert_eq!(state["set"]["sample_rate_hz"], 1e6);
    assert_eq!(state["set"]["temperature_c"], 31.5);
    assert_eq!(state["set"]["gps_locked"], Value::Null);
    // With a GPS-disciplined oscillator, which the other device refuses as clock source.
    let clock = "radio probe uhd.toml --set radio.clock=gpsdo --set radio.pps=gpsdo";
    let with = ran(&folder, "gpsdo", clock);
    assert_eq!(with.code, Some(0));
    for line in ["GPS              locked", "reference        locked"] {
        assert!(with.stdout.contains(line), "{}", with.stdout);
    }
    let without = ran(&folder, "", clock);
    assert!(without.stderr.contains("no GPSDO"), "{}", without.stderr);
}

/// All measured values are those of the simulated radio; a temperature is that of the stand-in.
#[test]
fn selftest_through_uhd_measures_the_same_as_on_simulated_radio() {
    let folder = experiments("sc16", "");
    let tested = |line: &str, faults: &str, code: i32| {
        let ran = ran(
            &folder,
            faults,
            &format!("radio selftest {line} --stream 0.2 --json"),
        );
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
        serde_json::from_str::<Value>(&ran.stdout).unwrap()
    };
    let by_uhd = tested("uhd.toml -o report.json", "", 0);
    let directly = tested("simulated.toml", "", 0);
    assert_eq!(by_uhd["checks"], directly["checks"]);
    assert_eq!(by_uhd["retunes"], directly["retunes"]);
    assert_eq!(by_uhd["simulated"], true);
    assert_eq!(by_uhd["driver"], "UHD 4.3.0.0-stand-in");
    assert_eq!(by_uhd["temperature_c"], 31.5);
    assert!(folder.path().join("report.json").exists());
    let faulty = tested("uhd.toml", "faults", 1);
    for name in [
        "overruns",
        "underruns",
        "late commands",
        "lost packets",
        "lost samples",
    ] {
        let mut checks = faulty["checks"].as_array().unwrap().iter();
        let check = checks.find(|check| check["name"] == name).unwrap();
        assert_eq!(check["verdict"], "failed", "{name}");
    }
    let external = tested("uhd.toml --set radio.clock=external", "", 0);
    let mut checks = external["checks"].as_array().unwrap().iter();
    let clock = checks.find(|check| check["name"] == "reference clock: lock");
    assert_eq!(clock.unwrap()["verdict"], "passed");
    let gone = tested("uhd.toml", "unplug", 1);
    assert_eq!(gone["checks"][0]["verdict"], "failed");
}

/// UHD's own error for a device without firmware, returned by the stand-in.
#[test]
fn missing_images_are_reported_with_advice() {
    let folder = experiments("sc16", "");
    let ran = ran(&folder, "images", "capture uhd.toml -o walk");
    assert_eq!(ran.code, Some(1));
    let stderr = &ran.stderr;
    assert!(stderr.contains("uhd_images_downloader"), "{stderr}");
    assert!(!folder.path().join("walk.sigmf-meta").exists());
}

/// UHD itself does not find a device with this serial number.
#[test]
fn missing_device_is_reported_with_advice() {
    let folder = experiments("sc16", "");
    for line in [
        "radio list --serial NONE0000",
        "capture uhd.toml -o walk --set device.serial=NONE0000",
        "radio probe uhd.toml --set device.serial=NONE0000",
    ] {
        let ran = of(Command::new(program()), &folder, line);
        assert_eq!(ran.code, Some(1));
        for word in ["error: ", "NONE0000", "cable", "udev"] {
            assert!(ran.stderr.contains(word), "no {word}: {}", ran.stderr);
        }
        assert_eq!(ran.stdout, "");
    }
}
