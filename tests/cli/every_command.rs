//! Every command: its memory against `--memory`, and inputs that never end.

use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use subaperture_tests::subap::{Ran, command, run, write_recording};

use crate::memory::{self, measured, peak_of};

/// Budgets with 2 threads, MiB: the smallest accepted, and a larger one.
const BUDGETS: [u32; 2] = [28, 64];

/// Commands with quick runs of each. `%` is the budget, which makes the names of outputs unique.
pub(crate) const COMMANDS: [(&str, &[&str]); 36] = [
    (
        "focus",
        &["focus few.cphd --grid x=-20:20:0.1,y=-20:20:0.1 --allow-error -o out --force"],
    ),
    (
        "velocity",
        &["velocity few.cphd --at 1,2 --vx=-30:30:0.5 --vy=-30:30:0.5 --out v --force"],
    ),
    (
        "gmti",
        &["gmti walk.cphd -o targets.geojson --grid x=-6:6:0.1,y=4:12:0.1 --force"],
    ),
    // A link without a listener is refused after the recording was read and planned; sessions are measured with the module's firmware.
    (
        "link",
        &["link tcp://127.0.0.1:1 few.cphd -o m.maps --force"],
    ),
    (
        "module selftest",
        &["module selftest tcp://127.0.0.1:1 -o m.json --force"],
    ),
    (
        "simulate",
        &[
            "simulate few.toml -o s.cphd --force",
            "simulate few.toml --echoes r --force",
        ],
    ),
    ("crosscheck", &["crosscheck few.cphd"]),
    (
        "info",
        &["info few.cphd", "info image", "info image/image.npy"],
    ),
    ("recording", &["recording --keys"]),
    (
        "tune",
        &[
            "tune raw/recording.toml --vary recording.range_bias=0:1:0.5m --refine 0 --at 1,2 --out tuned --force",
        ],
    ),
    ("track", &["track walk.cphd -o t.csv --force"]),
    (
        "autofocus",
        &["autofocus few.cphd --grid x=-20:20:0.2,y=-20:20:0.2 -o phase.csv --force"],
    ),
    ("navigation", &["navigation track.csv"]),
    ("compare", &["compare image image"]),
    ("pair", &["pair image image --format zarr -o pair --force"]),
    (
        "displacement",
        &["displacement image image --times 0,60 --floor=-60 --format zarr -o moved --force"],
    ),
    (
        "quality",
        &[
            "quality fine --plots q --force",
            "quality fine --against fine",
        ],
    ),
    ("picture", &["picture image -o p.png --force"]),
    ("capture", &["capture rail.toml --out rail%"]),
    ("live", &["live rail.toml --out live% --image li --force"]),
    ("radio list", &["radio list"]),
    ("radio probe", &["radio probe rail.toml"]),
    (
        "radio selftest",
        &[
            "radio selftest rail.toml --set device.real_time=false --stream 0.1 -o selftest.json --force",
        ],
    ),
    (
        "radio calibrate",
        &["radio calibrate --sky rail --reflector rail --range 4 -o c.json --force"],
    ),
    (
        "radio convert",
        &["radio convert rail --track rail.csv --reference 0,4 -o conv.cphd --force"],
    ),
    ("profile", &["profile rail --out pr --force"]),
    (
        "export",
        &[
            "export image -o e.tif --force",
            "export image -o e.kmz --force",
            "export image -o e.nitf --force",
            "export image image -o e.zarr --force",
        ],
    ),
    ("run", &["run job%/job.toml"]),
    (
        "plan focus",
        &[
            "plan focus few.cphd --grid x=-20:20:0.1,y=-20:20:0.1 -o plan.json --force --allow-error",
        ],
    ),
    ("plan module", &["plan module few.cphd --ram 1M"]),
    ("plan calibrate", &["plan calibrate -o model.json --force"]),
    ("plan radar", &["plan radar raw/recording.toml"]),
    (
        "demo",
        &["demo --out demo --grid x=-20:20:0.5,y=-20:20:0.5 --force"],
    ),
    ("reproduce", &["reproduce --only s-table-2-1 -o gallery%"]),
    ("completions", &["completions bash"]),
    ("man", &["man", "man plan focus"]),
];

/// `view` ends only on a signal: `view::memory_holds_under_fifty_clients` measures it.
const ELSEWHERE: [&str; 1] = ["view"];

const JOB: &str = r#"
name = "job"
[input]
files = "../few.cphd"
[grid]
pixels = "x=-20:20:0.2,y=-20:20:0.2"
[former]
algorithm = "bp"
error = "-50 dB"
[products]
formats = ["png"]
"#;

/// Commands listed by the help, those of a group by both names.
fn listed(before: &[&str]) -> Vec<String> {
    let line = [before, &["--help"]].concat().join(" ");
    let help = run(Path::new("."), &line).succeeded().to_owned();
    let Some((_, list)) = help.split_once("\nCommands:\n") else {
        return vec![before.join(" ")];
    };
    let lines = list.lines().take_while(|line| !line.is_empty());
    // Continuation lines of a description are indented further.
    let names = lines.filter_map(|line| {
        line.strip_prefix("  ")?
            .split_whitespace()
            .next()
            .filter(|_| !line.starts_with("   "))
    });
    let names = names.filter(|name| *name != "help");
    names
        .flat_map(|name| listed(&[before, &[name]].concat()))
        .collect()
}

#[test]
fn every_command_is_in_the_table() {
    let mut listed = listed(&[]);
    let known = COMMANDS.iter().map(|(name, _)| *name).chain(ELSEWHERE);
    let mut known: Vec<String> = known.map(str::to_owned).collect();
    listed.sort();
    known.sort();
    assert_eq!(listed, known);
}

/// A folder with the inputs of all runs in the table.
pub(crate) fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("few.toml"), memory::SCENARIO).unwrap();
    fs::write(at.join("walk.toml"), crate::track::WALK).unwrap();
    fs::write(at.join("scene.toml"), crate::live::SCENE).unwrap();
    fs::write(at.join("rail.toml"), crate::live::RAIL).unwrap();
    for mib in BUDGETS {
        let job = at.join(format!("job{mib}"));
        fs::create_dir(&job).unwrap();
        fs::write(job.join("job.toml"), JOB).unwrap();
    }
    let fixes = (0..200).map(|i| {
        format!(
            "{:.2},{:.4},0,0\n",
            f64::from(i) * 0.05,
            f64::from(i) * 0.0125 - 1.0
        )
    });
    let fixes: String = fixes.collect();
    fs::write(at.join("rail.csv"), format!("time_s,x_m,y_m,z_m\n{fixes}")).unwrap();
    for line in [
        "simulate few.toml -o few.cphd",
        "simulate few.toml --echoes raw",
        "simulate walk.toml -o walk.cphd",
        "focus few.cphd --grid x=-20:20:0.1,y=-20:20:0.1 --allow-error -o image",
        "focus few.cphd --grid x=-29:31:0.3,y=-28:32:0.3 -o fine",
        "track walk.cphd -o track.csv",
        "capture rail.toml --out rail",
    ] {
        let ran = run(at, line);
        assert!(matches!(ran.code, Some(0 | 3)), "{line}: {ran:?}");
    }
    folder
}

#[test]
fn every_command_stays_within_its_memory() {
    let folder = workplace();
    let at = folder.path();
    let mut done = Vec::new();
    for (name, lines) in COMMANDS {
        for (line, mib) in lines.iter().flat_map(|line| BUDGETS.map(|mib| (line, mib))) {
            let line = line.replace('%', &mib.to_string());
            let ran = measured(at, &line, mib);
            assert!(matches!(ran.code, Some(0 | 1 | 3)), "{line}: {ran:?}");
            assert!(ran.peak_mib <= f64::from(mib), "{line}: {ran:?}");
            if ran.code != Some(1) {
                done.push(name);
            }
        }
    }
    // Only these runs are refused: no listener, no USRP, too little memory, a radio with faults, or a target that cannot be measured.
    done.dedup();
    let refused = COMMANDS
        .iter()
        .map(|(name, _)| *name)
        .filter(|name| !done.contains(name));
    let refused: Vec<&str> = refused.collect();
    println!("refused: {refused:?}");
    let may_be = [
        "link",
        "module selftest",
        "radio selftest",
        "radio list",
        "radio calibrate",
        "plan radar",
        "demo",
    ];
    assert!(
        refused.iter().all(|name| may_be.contains(name)),
        "{refused:?}"
    );
}

/// Commands that read `X`.
const READERS: [&str; 35] = [
    "info X",
    "focus X -o o",
    "focus few.cphd --plan X -o o",
    "focus few.cphd --model X -o o",
    "focus few.cphd --phase X -o o",
    "focus few.cphd --track X -o o",
    "focus --from-maps X -o o",
    "velocity X --at 1,2 --vx=-1:1:1 --vy=-1:1:1 --out o",
    "gmti X -o o.geojson",
    "simulate X -o o.cphd",
    "crosscheck X",
    "tune X --vary recording.range_bias=0:1:0.5m --at 1,2",
    "track X -o o.csv",
    "autofocus X -o o.csv",
    "navigation X",
    "compare X few.cphd",
    "pair X few.cphd -o o",
    "displacement X X --times 0,60 -o o",
    "quality X",
    "picture X -o o.png",
    "view X",
    "view few.cphd --layer X",
    "capture X --out o",
    "live X --out o",
    "radio probe X",
    "radio selftest X",
    "radio calibrate --sky X --reflector X --range 3 -o o.json",
    "radio convert X --track few.toml --reference 0,4 -o o.cphd",
    "profile X",
    "export X -o o.tif",
    "run X",
    "plan focus X -o o.json",
    "plan module X --ram 1M",
    "plan radar X",
    "plan radar --chain X",
];

/// Run `line` for a second, then send a signal; returns the result, the peak memory and the time until the end.
fn interrupted(at: &Path, line: &str) -> (Ran, f64, Duration) {
    let words = format!("{line} --threads 2 --memory 64M");
    let mut child = command(at, words.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (begun, mut sent, mut peak) = (Instant::now(), None, 0.0f64);
    loop {
        peak = peak.max(peak_of(child.id()).unwrap_or(0.0));
        if child.try_wait().unwrap().is_some() {
            break;
        }
        if sent.is_none() && begun.elapsed() > Duration::from_secs(1) {
            let id = child.id().to_string();
            let kill = std::process::Command::new("kill")
                .args(["-INT", &id])
                .status();
            assert!(kill.unwrap().success());
            sent = Some(Instant::now());
        }
        if begun.elapsed() > Duration::from_secs(30) {
            child.kill().unwrap();
        }
        sleep(Duration::from_millis(3));
    }
    let took = sent.map_or(Duration::ZERO, |sent| sent.elapsed());
    (child.wait_with_output().unwrap().into(), peak, took)
}

/// Pipes without a writer, devices, sockets: an error, or an end on the first signal, within the memory.
#[test]
fn inputs_that_never_end_are_refused_or_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    write_recording(at, "few", memory::SCENARIO);
    let mut inputs = Vec::new();
    for ending in ["", ".toml"] {
        let pipe = format!("pipe{ending}");
        let made = std::process::Command::new("mkfifo")
            .arg(at.join(&pipe))
            .status();
        if made.is_ok_and(|status| status.success()) {
            inputs.push(pipe);
        }
        #[cfg(unix)]
        for device in ["zero", "full"] {
            let name = format!("{device}{ending}");
            std::os::unix::fs::symlink(format!("/dev/{device}"), at.join(&name)).unwrap();
            inputs.push(name);
        }
    }
    std::thread::scope(|scope| {
        for input in &inputs {
            scope.spawn(move || {
                for line in READERS {
                    let line = line.replace('X', input);
                    let (ran, peak, took) = interrupted(at, &line);
                    assert!(matches!(ran.code, Some(1 | 2 | 130)), "{line}: {ran:?}");
                    assert!(!ran.stderr.contains("panicked"), "{line}: {ran:?}");
                    assert!(peak <= 64.0, "{line}: {peak} MiB");
                    // The command waits 0.7 s; the rest allows for a machine busy with other tests.
                    assert!(took < Duration::from_secs(20), "{line}: {took:?}");
                }
            });
        }
    });
    assert!(!at.join("o").exists() && !at.join("o.cphd").exists());
}
