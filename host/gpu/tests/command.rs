//! The command `subap` built with the feature `gpu`: images of `--device`, and its notes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

/// The program, built on first use as for the tests with UHD, if that is installed: one build serves both.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let features = match Path::new("/usr/include/uhd.h").exists() {
            true => "subaperture-uhd-stand-in/uhd,subap/uhd,subap/gpu",
            false => "subap/gpu",
        };
        let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
            .args(["build", "--quiet", "--workspace", "--locked"])
            .args(["--exclude", "subaperture-firmware", "--bin", "subap"])
            .args(["--features", features])
            .args(["--message-format", "json-render-diagnostics"])
            .stderr(Stdio::inherit())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "subap does not build with {features}"
        );
        let text = String::from_utf8(output.stdout).unwrap();
        let messages = text
            .lines()
            .filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let mut executables =
            messages.filter_map(|message| message["executable"].as_str().map(PathBuf::from));
        executables.next().expect("cargo names the executable")
    })
}

/// A recording in a folder of its own.
fn recording() -> TempDir {
    let folder = TempDir::new().unwrap();
    let simulated = Command::new(program())
        .args(["simulate", "--preset", "table-4-1", "--out", "points.cphd"])
        .current_dir(&folder)
        .output()
        .unwrap();
    assert!(simulated.status.success(), "{simulated:?}");
    folder
}

fn focus(folder: &TempDir, arguments: &[&str]) -> Output {
    let mut command = Command::new(program());
    command.args(["focus", "points.cphd"]);
    if !arguments.contains(&"--grid") {
        command.args(["--grid", "x=-10:10:0.25,y=-10:10:0.25"]);
    }
    command.args(arguments).current_dir(folder);
    command.output().unwrap()
}

fn record(folder: &TempDir, out: &str) -> Value {
    let text = std::fs::read(folder.path().join(out).join("image.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

/// Form an image by a former on the GPU with more options; its record, which names the device.
fn formed_by_gpu(former: &str, options: &[&str]) -> Value {
    let folder = recording();
    let by_gpu = ["--algorithm", former, "--device", "gpu", "--out", "gpu"];
    let ran = focus(&folder, &[&by_gpu, options].concat());
    let stderr = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{stderr}");
    assert!(!stderr.contains("--device"), "{stderr}");
    let record = record(&folder, "gpu");
    let device = record["settings"]["resolved"]["device"].as_str();
    println!("{device:?}: {}", record["check"]);
    assert!(device.is_some_and(|name| !name.is_empty()), "{record}");
    record
}

#[test]
fn image_is_formed_by_gpu_and_recorded() {
    for (former, options) in [
        ("bp", &[][..]),
        ("rdbp", &["--grid", "x=-32:32:0.25,y=-32:32:0.25"]),
    ] {
        let record = formed_by_gpu(former, &[&["--check", "200"], options].concat());
        let error_db = record["check"]["relative_rms_db"].as_f64().unwrap();
        assert!(error_db < -60.0, "{former}: {error_db}");
    }
}

#[test]
fn tiles_are_formed_by_gpu() {
    formed_by_gpu("bp", &["--tiled"]);
}

#[test]
fn device_is_refused_where_bits_are_fixed() {
    let folder = recording();
    for fixed in [&["--portable"][..], &["--plan", "plan.json"]] {
        let ran = Command::new(program())
            .args([
                "focus",
                "points.cphd",
                "--device",
                "gpu",
                "--out",
                "refused",
            ])
            .args(fixed)
            .current_dir(&folder)
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&ran.stderr);
        assert_eq!(ran.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains("cannot be used with"), "{stderr}");
    }
}

#[test]
fn former_without_gpu_support_is_noted() {
    let folder = recording();
    let ran = focus(
        &folder,
        &["--algorithm", "ffbp", "--device", "gpu", "--out", "ffbp"],
    );
    let stderr = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{stderr}");
    assert!(
        stderr.contains("note: --device: ffbp forms this image on the processor"),
        "{stderr}"
    );
    assert_eq!(
        record(&folder, "ffbp")["settings"]["resolved"]["device"],
        Value::Null
    );
}

#[test]
fn missing_driver_is_noted() {
    let folder = recording();
    // Drivers of an empty folder only.
    let ran = Command::new(program())
        .args([
            "focus",
            "points.cphd",
            "--grid",
            "x=-5:5:0.5,y=-5:5:0.5",
            "--algorithm",
            "bp",
        ])
        .args(["--device", "auto", "--out", "cpu"])
        .env("VK_DRIVER_FILES", "/nonexistent.json")
        .env("VK_ICD_FILENAMES", "/nonexistent.json")
        .current_dir(&folder)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{stderr}");
    assert!(stderr.contains("formed on the processor"), "{stderr}");
    assert_eq!(
        record(&folder, "cpu")["settings"]["resolved"]["device"],
        Value::Null
    );
}
