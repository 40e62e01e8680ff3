//! How `subap` talks: what goes where, what `-q` hides, exit statuses, progress off a terminal, signals.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use subaperture_tests::subap::{Ran, command, listing, run};

/// Table 4.1's radar over three pixels of dark ground between its scatterers, of which an error is large relative
/// to the image: there is next to nothing to which it could be small.
const DARK: &str = "focus scene.cphd -a bp --grid x=11:14:1,y=11:14:1 --check 9";

/// A folder with `scene.cphd` in it.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    folder
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_bound_missed_is_an_exit_status_of_its_own() {
    let folder = scene();
    let ran = run(folder.path(), &format!("{DARK} --out dark"));
    ran.failed(
        3,
        &[
            "warning: the error measured on 9 pixels is ",
            "--error-db -60",
        ],
    );
    // Done all the same, and the record says it too.
    let record = json(&folder.path().join("dark/image.json"));
    let warnings = record["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1, "{record}");
    let told = format!("warning: {}\n", warnings[0].as_str().unwrap());
    assert_eq!(ran.stderr, told);
    // A bound that is kept, and formers that have none.
    for (options, out) in [
        ("--error-db -20", "coarse"),
        ("-a exact", "exact"),
        ("-a rdbp --mode thesis --sub-cpi 40", "thesis"),
    ] {
        let line = format!("{} --out {out} {options}", DARK.replace("-a bp", ""));
        let ran = run(folder.path(), &line);
        let record = json(&folder.path().join(out).join("image.json"));
        let measured = record["check"]["relative_to_image_db"].as_f64().unwrap();
        assert_eq!(
            ran.code,
            Some(if out == "coarse" && measured > -20.0 {
                3
            } else {
                0
            }),
            "{ran:?}"
        );
    }
}

#[test]
fn comparing_with_a_bound_tells_by_its_status() {
    let folder = scene();
    for (out, former) in [("a", "-a exact"), ("b", "-a bp")] {
        let line = format!("focus scene.cphd {former} --grid x=-5:5:0.5,y=-5:5:0.5 --out {out}");
        run(folder.path(), &line).succeeded();
    }
    let compare = |bound: &str| {
        run(
            folder.path(),
            &format!("compare b/image.npy a/image.npy {bound}"),
        )
    };
    compare("").succeeded();
    compare("--error-db -20").succeeded();
    compare("--error-db -190").failed(
        3,
        &[
            "warning: the relative RMS error is ",
            "above the --error-db -190",
        ],
    );
    assert!(
        compare("--error-db -190")
            .stdout
            .contains("relative RMS error")
    );
}

#[test]
fn quiet_hides_no_result_and_no_warning() {
    let folder = scene();
    let ran = run(folder.path(), &format!("{DARK} -q --out dark"));
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(
        ran.stderr.starts_with("warning: the error measured"),
        "{ran:?}"
    );
    assert_eq!(ran.stdout.lines().count(), 1, "{ran:?}");
    assert!(
        ran.stdout
            .starts_with("error against the exact sum on 9 pixels: ")
    );
    let grid = "--grid x=-2:2:1,y=-2:2:1";
    let ran = run(folder.path(), &format!("demo -q --out demo {grid}"));
    assert!(ran.succeeded().contains("rdbp precise, 26 x 40"), "{ran:?}");
    assert_eq!(ran.stderr, "");
}

#[test]
fn every_failure_begins_with_error() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.mat"), "nothing of the kind").unwrap();
    for (line, code) in [
        ("info none.mat", 1),
        ("info a.mat", 1),
        ("focus none.mat --out d", 1),
        ("compare a.mat a.mat", 1),
        ("quality a.mat", 1),
        ("simulate none.toml -o f", 1),
        ("tune none.toml --vary radar.pri=1:2:1s --at 1,2", 1),
        ("focus a.mat --out d -a exact --error-db -60", 2),
        ("fokus", 2),
        ("focus", 2),
        ("reproduce --only nothing", 2),
    ] {
        let ran = run(folder.path(), line);
        ran.failed(code, &[]);
        assert!(ran.stderr.starts_with("error: "), "{line}: {ran:?}");
        assert_eq!(ran.stdout, "", "{line}");
    }
    assert_eq!(listing(folder.path()).len(), 1);
}

#[test]
fn help_tells_the_exit_statuses() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run(folder.path(), "--help");
    let help = ran.succeeded();
    for line in [
        "0    done",
        "1    failed",
        "2    wrong usage",
        "3    done, but a bound",
        "130  interrupted",
    ] {
        assert!(help.contains(line), "no '{line}' in {help}");
    }
}

#[test]
fn a_result_that_cannot_be_printed_is_a_failure() {
    let folder = scene();
    let Ok(full) = fs::OpenOptions::new().write(true).open("/dev/full") else {
        println!("skipped: /dev/full not found");
        return;
    };
    let output = command(folder.path(), ["info", "scene.cphd"])
        .stdout(full)
        .output();
    let ran: Ran = output.unwrap().into();
    ran.failed(
        1,
        &["error: cannot write to standard output: ", "No space left"],
    );
}

#[test]
fn progress_is_told_off_a_terminal_too() {
    let folder = scene();
    // 160 000 pixels by 266 240 samples: some seconds on any machine of today.
    let line = "focus scene.cphd -a exact --grid x=-20:20:0.1,y=-20:20:0.1 --out";
    let ran = run(folder.path(), &format!("{line} told"));
    ran.succeeded();
    let lines: Vec<&str> = ran
        .stderr
        .lines()
        .filter(|line| line.starts_with("focusing: "))
        .collect();
    assert!(!lines.is_empty(), "{ran:?}");
    assert!(
        lines
            .iter()
            .any(|line| line.contains(" %, ") && line.ends_with(" left")),
        "{lines:?}"
    );
    let ran = run(folder.path(), &format!("{line} quiet -q"));
    assert_eq!((ran.succeeded(), ran.stderr.as_str()), ("", ""));
}

/// Starts `line` with `-v`, sends `signal` when somebody listens to it, and returns how it ended and when.
fn signalled(folder: &Path, line: &str, signal: &str) -> (Ran, Duration) {
    let mut child = command(folder, format!("{line} -v").split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let (mut told, mut byte) = (Vec::new(), [0]);
    // Said after the signals' handler is in place.
    while !String::from_utf8_lossy(&told).contains(" of memory\n") {
        assert_eq!(stderr.read(&mut byte).unwrap(), 1, "ended early: {told:?}");
        told.push(byte[0]);
    }
    // So that it is at work on what it cannot finish.
    std::thread::sleep(Duration::from_millis(300));
    let start = Instant::now();
    let id = child.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &id])
            .status()
            .unwrap()
            .success()
    );
    stderr.read_to_end(&mut told).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    ran.stderr = String::from_utf8_lossy(&told).into_owned();
    (ran, start.elapsed())
}

#[test]
fn one_signal_ends_what_waits_for_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let made = Command::new("mkfifo")
        .arg(folder.path().join("pipe.cphd"))
        .status();
    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: mkfifo not found");
        return;
    }
    let before = listing(folder.path());
    for line in [
        "info pipe.cphd",
        "focus pipe.cphd --out out",
        "crosscheck pipe.cphd",
    ] {
        for signal in ["-INT", "-TERM"] {
            let (ran, took) = signalled(folder.path(), line, signal);
            ran.failed(130, &["error: interrupted"]);
            // 0.7 s of patience; the rest is for a machine that is busy with other tests.
            assert!(took < Duration::from_secs(3), "{line}: {took:?}");
            assert_eq!(listing(folder.path()), before, "{line}");
        }
    }
}
