//! Output of `subap`: standard output and standard error, `-q`, exit statuses, progress without a terminal, signals.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use subaperture_tests::subap::{Ran, command, listing, run};

/// All pulses of Table 4.1 as one sub-CPI: paths are not linear over so long a time.
const LONG: &str =
    "focus scene.cphd -a rdbp --sub-cpi 1040 --grid x=-40:40:4,y=-40:40:4 --check 99";

/// A folder that contains `scene.cphd`.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    folder
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn missed_bound_has_its_own_exit_status() {
    let folder = scene();
    // The default former is refused unless `--allow-error` is given, and leaves no file.
    let before = listing(folder.path());
    let refused = "focus scene.cphd --grid x=700:730:2,y=-15:15:2 --error-db -100 --out strict";
    run(folder.path(), refused).failed(1, &["error: ", "--allow-error"]);
    assert_eq!(listing(folder.path()), before);
    // A former that the user names forms the image all the same.
    run(folder.path(), &format!("{LONG} --out named"))
        .failed(3, &["warning: the predicted error is ", "--error-db -"]);
    let ran = run(folder.path(), &format!("{LONG} --out long --allow-error"));
    ran.failed(
        3,
        &[
            "warning: the predicted error is ",
            "warning: error measured on 99 pixels is ",
            "--error-db -60",
        ],
    );
    // The image is formed, and its record contains the same warnings.
    let record = json(&folder.path().join("long/image.json"));
    let warnings = record["warnings"].as_array().unwrap();
    let printed = warnings
        .iter()
        .map(|warning| format!("warning: {}\n", warning.as_str().unwrap()));
    // The grid is coarse, which is a note and not a warning.
    let shown = (ran.stderr.lines()).filter(|line| !line.starts_with("note: "));
    let shown: String = shown.map(|line| format!("{line}\n")).collect();
    assert_eq!(printed.collect::<String>(), shown);
    // A former without an error of its own.
    let line = format!(
        "{} --out exact -a exact",
        LONG.replace("-a rdbp --sub-cpi 1040", "")
    );
    let ran = run(folder.path(), &line);
    ran.succeeded();
    assert!(ran.is_untroubled(), "{ran:?}");
}

#[test]
fn compare_with_a_bound_sets_the_exit_status() {
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
            "warning: relative RMS error is ",
            "above the bound --error-db -190",
        ],
    );
    assert!(
        compare("--error-db -190")
            .stdout
            .contains("relative RMS error")
    );
}

#[test]
fn quiet_keeps_results_and_warnings() {
    let folder = scene();
    let ran = run(
        folder.path(),
        &format!("{LONG} -q --allow-error --out long"),
    );
    assert_eq!(ran.code, Some(3), "{ran:?}");
    assert!(ran.stderr.contains("warning: error measured"), "{ran:?}");
    let lines: Vec<&str> = ran.stdout.lines().collect();
    assert!(
        lines.len() == 3 && lines[0].starts_with("long: "),
        "{ran:?}"
    );
    assert!(lines[2].starts_with("error against the exact sum on 99 pixels: "));
    let grid = "--grid x=-2:2:1,y=-2:2:1";
    let ran = run(folder.path(), &format!("demo -q --out demo {grid}"));
    assert!(ran.succeeded().contains("rdbp precise, 26 x 40"), "{ran:?}");
    assert_eq!(ran.stderr, "");
}

#[test]
fn every_failure_begins_with_error() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.mat"), "not a MAT file").unwrap();
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

/// Wrong input of every kind: the message names the place, the fault and a remedy.
#[test]
fn messages_state_fault_place_and_advice() {
    let folder = scene();
    let at = |name: &str| folder.path().join(name);
    run(
        folder.path(),
        "focus scene.cphd -q -a bp --grid x=-5:5:1,y=-5:5:1 --out image",
    )
    .succeeded();
    run(
        folder.path(),
        "focus scene.cphd -q -a bp --grid x=-4.5:4:1,y=-5:5:1 --out other",
    )
    .succeeded();
    run(
        folder.path(),
        "velocity scene.cphd -q --at 0,0 --vx -1:1:1 --vy -1:1:1 --out plane",
    )
    .succeeded();
    let scenario = run(folder.path(), "simulate --example spotlight");
    fs::write(at("spotlight.toml"), scenario.succeeded()).unwrap();
    fs::create_dir(at("empty")).unwrap();
    let before = listing(folder.path());
    let cases: &[(&str, i32, &[&str])] = &[
        // Inputs that are not recordings.
        ("info nothing", 1, &["cannot read nothing", "No such file"]),
        (
            "info s3://bucket/a.cphd",
            1,
            &[
                "cannot read s3://bucket/a.cphd",
                "found a URL",
                "pip install subaperture fsspec",
            ],
        ),
        (
            "focus empty --out o",
            1,
            &[
                "empty: expected a recording, found a directory",
                "name the files in it",
            ],
        ),
        (
            "info empty",
            1,
            &["empty: expected a recording", "without image.json"],
        ),
        (
            "info scene.cphd image",
            2,
            &["scene.cphd is a recording", "in separate commands"],
        ),
        (
            "crosscheck image/image.npy",
            1,
            &["image/image.npy: ", "NumPy", "subap recording"],
        ),
        (
            "focus --from-maps scene.cphd --out o",
            1,
            &["scene.cphd: not a maps file"],
        ),
        // Inputs that are not images.
        (
            "quality scene.cphd",
            1,
            &[
                "scene.cphd: expected an image: the folder of a product",
                ".npy",
            ],
        ),
        (
            "compare image scene.cphd",
            1,
            &["scene.cphd: expected an image: the folder of a product"],
        ),
        (
            "quality empty",
            1,
            &[
                "empty: expected an image: the folder of a product (with image.json",
                "without image.json, image.zarr and zarr.json",
            ],
        ),
        (
            "compare image other",
            1,
            &["image and other are on different grids", "finer grid"],
        ),
        (
            "compare image other/image.npy",
            1,
            &["differ in size", "one grid"],
        ),
        (
            "picture scene.cphd -o p.png",
            1,
            &["scene.cphd: expected an image: the folder of a product"],
        ),
        // Inputs that are not scenarios.
        (
            "simulate scene.cphd -o f",
            1,
            &["cannot read scene.cphd: not UTF-8 text", "TOML"],
        ),
        (
            "simulate empty -o f",
            1,
            &["cannot read empty: this is a folder", "TOML"],
        ),
        (
            "tune scene.cphd --vary radar.pri=1:2:1s --at 1,2",
            1,
            &["cannot read scene.cphd: not UTF-8 text"],
        ),
        (
            "simulate spotlight.toml -o f --set radar.pulses=10000000",
            1,
            &[
                "--set radar.pulses=10000000: in pulse 0 the reference's echo",
                "the radar travels 1250 km",
                "use fewer pulses",
            ],
        ),
        (
            "simulate spotlight.toml -o f --set radar.pulse=3",
            1,
            &["unknown key 'radar.pulse'", "did you mean 'radar.pulses'"],
        ),
        (
            "simulate spotlight.toml -o f --set radar.pri=3",
            1,
            &["--set radar.pri=3", "without a unit", "\"1 ms\""],
        ),
        // Quantities.
        (
            "plan radar --carrier 9.6km",
            2,
            &[
                "--carrier",
                "'9.6km': expected a frequency, found a length",
                "10 GHz",
            ],
        ),
        (
            "plan radar --carrier 9.6GHZ",
            2,
            &["--carrier", "did you mean 'GHz'"],
        ),
        (
            "plan radar --range 0m",
            2,
            &[
                "--range",
                "give a length above 0, for example 5km",
                "metres",
            ],
        ),
        (
            "focus scene.cphd --out o --velocity fast",
            2,
            &["--velocity", "3.5,-2"],
        ),
        (
            "velocity scene.cphd --out o --at 1 --vx -1:1:1 --vy -1:1:1",
            2,
            &["--at", "two or three numbers"],
        ),
        (
            "velocity scene.cphd --out o --at 1,2 --vx 1 --vy -1:1:1",
            2,
            &["--vx", "START:STOP:STEP"],
        ),
        // Lists, logs and JSON.
        (
            "reproduce --only s-2-2,nothing",
            2,
            &["--only nothing", "expected one of", "s-2-2"],
        ),
        (
            "reproduce --gotcha empty",
            1,
            &["--gotcha empty", "contains no .mat file", "or their folder"],
        ),
        (
            "reproduce --gotcha nothing",
            1,
            &["--gotcha nothing", "No such file"],
        ),
        (
            "info scene.cphd --log spotlight.toml",
            1,
            &[
                "--log spotlight.toml",
                "expected a log of subap",
                "give another name",
            ],
        ),
        (
            "info scene.cphd --log none/a.log",
            1,
            &["cannot write the log none/a.log", "No such file"],
        ),
        ("info scene.cphd --log-format json", 2, &["--log <FILE>"]),
        ("completions bash --json", 2, &["--json", "leave it out"]),
    ];
    for (line, code, parts) in cases {
        let ran = run(folder.path(), line);
        ran.failed(*code, parts);
        assert!(ran.stderr.starts_with("error: "), "{line}: {}", ran.stderr);
        // With --json the error is an object on standard output.
        match line.ends_with("--json") {
            true => assert!(ran.stdout.contains("subaperture-error"), "{line}"),
            false => assert_eq!(ran.stdout, "", "{line}"),
        }
        assert_eq!(listing(folder.path()), before, "{line} left something");
    }
}

#[test]
fn control_characters_in_names_are_not_printed() {
    let folder = tempfile::tempdir().unwrap();
    let output = command(folder.path(), ["info", "a\u{1b}[2Jb.cphd"]).output();
    let ran: Ran = output.unwrap().into();
    ran.failed(1, &["a\\u{1b}[2Jb.cphd"]);
    assert!(!ran.stderr.contains('\u{1b}'), "{ran:?}");
}

#[test]
fn units_and_plain_numbers_plan_the_same_pass() {
    let folder = tempfile::tempdir().unwrap();
    let plan = |options: &str| run(folder.path(), &format!("plan radar --json {options}"));
    let plain = plan(
        "--carrier 9.6e9 --bandwidth 150e6 --range 4000 --velocity 50 --prf 400 --grazing 30 --scene 60",
    );
    let united = plan(
        "--carrier 9.6GHz --bandwidth 150MHz --range 4km --velocity 180km/h --prf 0.4kHz --grazing 30deg --scene 6000cm",
    );
    assert_eq!(plain.succeeded(), united.succeeded());
}

#[test]
fn quantities_are_printed_with_significant_digits() {
    let folder = tempfile::tempdir().unwrap();
    let pass = "plan radar --carrier 77GHz --bandwidth 1GHz --range 30 --velocity 10 --prf 2kHz --pulses 400 --scene 10";
    let text = run(folder.path(), pass).succeeded().to_owned();
    // 10 m/s at 2 kHz: 5 mm; c / 2 GHz: 0.1499 m.
    for part in ["every 5 mm, 2 kHz", "resolution 0.1499 m in slant"] {
        assert!(text.contains(part), "no '{part}' in {text}");
    }
    for sign in ["-0 ", "-0.0", "0.00 m", "000 Hz"] {
        assert!(!text.contains(sign), "'{sign}' in {text}");
    }
}

#[test]
fn help_lists_the_exit_statuses() {
    let folder = tempfile::tempdir().unwrap();
    let ran = run(folder.path(), "--help");
    let help = ran.succeeded();
    for line in [
        "0    done",
        "1    failed",
        "2    wrong usage",
        "3    done, but an error bound",
        "130  interrupted",
    ] {
        assert!(help.contains(line), "no '{line}' in {help}");
    }
}

#[test]
fn unprintable_result_is_a_failure() {
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
fn progress_is_printed_without_a_terminal() {
    let folder = scene();
    let line = |step: f64, rest: &str| {
        format!("focus scene.cphd -a exact --grid x=-20:20:{step},y=-20:20:{step} --out {rest}")
    };
    // 1 000 000 pixels by 266 240 samples: half a minute or more on current machines, stopped at the first line of progress.
    let mut child = command(folder.path(), line(0.04, "slow").split(' '))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let mut printed = Vec::new();
    for line in lines.map_while(Result::ok) {
        let is_last =
            line.starts_with("focusing: ") && line.contains(" %, ") && line.ends_with(" left");
        printed.push(line);
        if is_last {
            child.kill().unwrap();
        }
    }
    assert!(!child.wait().unwrap().success(), "{printed:?}");
    let ran = run(folder.path(), &line(0.2, "quiet -q"));
    assert!(ran.succeeded().starts_with("quiet: "), "{ran:?}");
    assert_eq!(ran.stderr, "");
}

/// Start `line` with `-v` and send `signal` once the handler is in place; returns the result and the time until the end.
fn signalled(folder: &Path, line: &str, signal: &str) -> (Ran, Duration) {
    let mut child = command(folder, format!("{line} -v").split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let (mut printed, mut byte) = (Vec::new(), [0]);
    // This line is printed after the handler is installed.
    while !String::from_utf8_lossy(&printed).contains(" for images and samples\n") {
        assert_eq!(
            stderr.read(&mut byte).unwrap(),
            1,
            "ended early: {printed:?}"
        );
        printed.push(byte[0]);
    }
    // Time to begin the blocking read.
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
    stderr.read_to_end(&mut printed).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    ran.stderr = String::from_utf8_lossy(&printed).into_owned();
    (ran, start.elapsed())
}

#[test]
fn one_signal_ends_a_command_that_waits_for_a_pipe() {
    let folder = tempfile::tempdir().unwrap();
    let made = Command::new("mkfifo")
        .arg(folder.path().join("pipe.toml"))
        .status();
    if !made.is_ok_and(|status| status.success()) {
        println!("skipped: mkfifo not found");
        return;
    }
    let before = listing(folder.path());
    for line in ["simulate pipe.toml --out scene.cphd", "run pipe.toml"] {
        for signal in ["-INT", "-TERM"] {
            let (ran, took) = signalled(folder.path(), line, signal);
            ran.failed(130, &["error: interrupted"]);
            // The command waits 0.7 s; the rest allows for a machine busy with other tests. Without the signal the pipe would be awaited
            // forever.
            assert!(took < Duration::from_secs(20), "{line}: {took:?}");
            assert_eq!(listing(folder.path()), before, "{line}");
        }
    }
}
