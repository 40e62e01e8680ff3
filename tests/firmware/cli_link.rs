//! `subap link`: its errors and the files that it leaves, and a session over a serial device.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::emulated::{Begin, Emulated, Wire, application};
use subaperture_tests::link_recording::write_recording;
use subaperture_tests::subap::{Ran, command, listing, program, run, write_thesis_experiment};

const GRID: &str = "--grid x=-6:6:0.5,y=-6:6:0.5,z=0";

/// A folder with `a.cphd`. The program is built first, so that no time limit includes the build.
fn scene() -> tempfile::TempDir {
    program();
    let folder = tempfile::tempdir().unwrap();
    write_recording(&folder.path().join("a.cphd"));
    folder
}

#[test]
fn wrong_usage_is_refused_and_leaves_no_file() {
    let folder = scene();
    write_thesis_experiment(folder.path());
    let before = listing(folder.path());
    for (line, code, parts) in [
        ("link", 2, vec!["WHERE"]),
        ("link emulate", 2, vec!["INPUT"]),
        ("link emulate a.cphd", 2, vec!["--out"]),
        (
            "link /dev/ttyACM0 a.cphd -o a.maps",
            2,
            vec!["'/dev/ttyACM0' is not a module address", "tcp://HOST:PORT"],
        ),
        (
            "link tcp://host a.cphd -o a.maps",
            2,
            vec!["no port", "tcp://HOST:PORT"],
        ),
        (
            "link emulate:double a.cphd -o a.maps",
            2,
            vec!["no such firmware", "emulate:fixed"],
        ),
        ("link emulate a.cphd -o a.maps --rate -1", 2, vec!["--rate"]),
        (
            "link emulate a.cphd -o a.maps --rate 9 --retries 1",
            2,
            vec!["--rate", "--retries"],
        ),
        (
            "link emulate a.cphd -o a.maps --front-end --verify",
            2,
            vec!["--front-end", "--verify"],
        ),
        (
            "link emulate a.cphd -o a --send profiles --front-end",
            2,
            vec!["--front-end", "found --send profiles"],
        ),
        (
            "link tcp://host:1 a.cphd -o a.maps --firmware a.elf",
            2,
            vec!["--firmware", "tcp://host:1"],
        ),
        (
            "link emulate a.cphd -o image --send image --picture a.png --rate 9",
            2,
            vec!["--picture", "pulses that can wait", "--rate"],
        ),
        (
            "link emulate a.cphd -o image --send image --channels all",
            2,
            vec!["--send image takes the pulses of one channel"],
        ),
        (
            "link emulate a.cphd -o a.csv --send detections --picture a.png",
            2,
            vec!["--picture", "found --send detections"],
        ),
        (
            "link emulate a.cphd -o a.csv --send detections --verify",
            2,
            vec!["--verify", "maps or image", "found --send detections"],
        ),
        (
            "link emulate a.cphd -o a.maps --false-alarms 1e-6",
            2,
            vec!["--false-alarms", "detections, found --send maps"],
        ),
        (
            "link emulate a.cphd -o image --send image --false-alarms 1e-4",
            2,
            vec!["--false-alarms", "found --send image"],
        ),
        (
            "link emulate a.cphd -o a.csv --send detections --false-alarms 2",
            2,
            vec!["--false-alarms"],
        ),
        (
            "link emulate a.cphd -o a.maps --dpca",
            2,
            vec!["--dpca", "detections, found --send maps"],
        ),
        (
            "link emulate a.cphd -o a.csv --send detections --dpca",
            2,
            vec!["--dpca", "expected 2 channels, found 1", "--channels"],
        ),
        (
            "link emulate a.cphd -o a.csv --send detections --dpca --slow-window hamming",
            2,
            vec!["--slow-window", "--dpca"],
        ),
        (
            "link emulate a.cphd -o a.maps --range 1m:9m",
            2,
            vec!["--range", "expected --send increments, found --send maps"],
        ),
        (
            "link emulate a.cphd -o a.csv --send increments --grid x=0:1:1,y=0:1:1",
            2,
            vec![
                "--grid",
                "maps or image or detections",
                "found --send increments",
            ],
        ),
        (
            "link emulate a.cphd -o a.csv --send increments --channel 1",
            2,
            vec!["--channel", "found --send increments"],
        ),
        (
            "link emulate a.cphd -o profiles --send profiles --channels all",
            2,
            vec!["--channels", "or increments, found --send profiles"],
        ),
        (
            "link emulate a.cphd -o profiles --send profiles --slow-window none",
            2,
            vec!["--slow-window", "found --send profiles"],
        ),
        (
            "link emulate a.cphd a.cphd -o profiles --send profiles",
            2,
            vec!["--send profiles: expected one capture"],
        ),
        (
            "plan module a.cphd --ram 512K --send increments",
            2,
            vec!["expected maps, image or detections"],
        ),
        (
            "capture thesis.toml -o walk --module emulate --profiles live",
            1,
            vec!["target/module/float", "cargo xtask module"],
        ),
        (
            "capture thesis.toml -o walk --module emulate",
            2,
            vec!["--profiles"],
        ),
        (
            "link emulate a.cphd -o a.maps --error-db 3",
            2,
            vec!["--error-db"],
        ),
        (
            "link emulate a.cphd -o a.maps",
            1,
            vec!["target/module/float", "cargo xtask module", "--firmware"],
        ),
        (
            "link emulate:fixed a.cphd -o a.maps",
            1,
            vec!["target/module/fixed", "cargo xtask module"],
        ),
        (
            "link emulate a.cphd -o a.maps --firmware none.elf",
            1,
            vec!["none.elf is not a file"],
        ),
        (
            "link serial:/dev/none a.cphd -o a.maps",
            1,
            vec!["/dev/none", "921600", "is connected"],
        ),
    ] {
        run(folder.path(), line).failed(code, &parts);
    }
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn unreadable_input_is_reported() {
    let folder = scene();
    let whole = fs::read(folder.path().join("a.cphd")).unwrap();
    fs::write(folder.path().join("cut.cphd"), &whole[..whole.len() / 2]).unwrap();
    fs::write(folder.path().join("noise.cphd"), [7; 1000]).unwrap();
    let before = listing(folder.path());
    for name in ["none.cphd", "cut.cphd", "noise.cphd"] {
        // The error needs no module.
        let line = format!("link tcp://127.0.0.1:1 {name} -o a.maps");
        run(folder.path(), &line).failed(1, &[name]);
    }
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn missing_emulator_is_reported_with_advice() {
    let folder = scene();
    fs::write(folder.path().join("any.elf"), "any").unwrap();
    let before = listing(folder.path());
    let line = "link emulate a.cphd -o a.maps --firmware any.elf";
    let ran: Ran = command(folder.path(), line.split(' '))
        .env("PATH", "")
        .output()
        .unwrap()
        .into();
    ran.failed(1, &["qemu-system-arm", "install"]);
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn invalid_firmware_is_reported() {
    let folder = scene();
    fs::write(folder.path().join("any.elf"), "any").unwrap();
    let before = listing(folder.path());
    let start = Instant::now();
    let line = "link emulate a.cphd -o a.maps --firmware any.elf";
    run(folder.path(), line).failed(1, &["qemu-system-arm ended", "any.elf a firmware"]);
    assert!(start.elapsed() < Duration::from_secs(20));
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn absent_and_silent_modules_are_reported() {
    let folder = scene();
    let before = listing(folder.path());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let line = format!("link tcp://127.0.0.1:{port} a.cphd -o a.maps");
    // The command gives up after ten seconds of silence.
    let start = Instant::now();
    run(folder.path(), &line).failed(1, &["does not answer", &format!("127.0.0.1:{port}")]);
    assert!(start.elapsed() < Duration::from_secs(15));
    drop(listener);
    run(folder.path(), &line).failed(
        1,
        &["cannot reach", &format!("127.0.0.1:{port}"), "served there"],
    );
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn unwritable_output_is_reported() {
    let folder = scene();
    fs::write(folder.path().join("file"), "").unwrap();
    let before = listing(folder.path());
    let elf = application()[0].display();
    for out in ["file/a.maps", "/proc/a.maps", "."] {
        let line = format!("link emulate a.cphd -o {out} {GRID} --firmware {elf}");
        run(folder.path(), &line).failed(1, &[out]);
    }
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn events_of_the_module_are_printed_on_request() {
    let folder = scene();
    let elf = application()[0].display();
    let line = format!("link emulate a.cphd -o a.maps {GRID} --firmware {elf} --force");
    let quiet = run(folder.path(), &line);
    quiet.succeeded();
    assert!(!quiet.stderr.contains("module:"), "{}", quiet.stderr);
    let ran = run(folder.path(), &format!("{line} --events info"));
    ran.succeeded();
    let events: Vec<&str> = ran
        .stderr
        .lines()
        .filter(|l| l.contains("module:"))
        .collect();
    let [started, begun, cost, ended] = events[..] else {
        panic!("{}", ran.stderr);
    };
    assert_eq!(
        started,
        "note: module: info: program started, 0 resets after faults"
    );
    assert!(begun.ends_with(" started"), "{begun}");
    assert!(
        cost.contains(" bytes of stack used, ") && cost.ends_with(" Hz"),
        "{cost}"
    );
    assert!(
        ended.contains(" ended: ") && ended.contains(" pulses accepted, "),
        "{ended}"
    );
}

/// Start `subap link` with `-v` and wait until the module begins to work.
fn linking(folder: &Path, place: &str, more: &str) -> (Child, BufReader<impl Read + use<>>) {
    let line = format!("link {place} a.cphd -o a.maps -v {GRID} {more}");
    let mut child = command(folder, line.split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("predicted error") {
        assert!(stderr.read_line(&mut said).unwrap() > 0, "{said}");
    }
    (child, stderr)
}

fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args([name, &id]).status().unwrap();
    assert!(sent.success());
}

#[test]
fn ctrl_c_keeps_the_maps_so_far() {
    let folder = scene();
    let before = listing(folder.path());
    let more = format!("--firmware {}", application()[0].display());
    // At this rate 104 pulses take twenty seconds, a sub-CPI four to eight.
    let (child, mut stderr) = linking(folder.path(), "emulate", &format!("{more} --rate 5"));
    std::thread::sleep(Duration::from_secs(12));
    signal(&child, "-INT");
    let start = Instant::now();
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    // Well before the session would end, even on a busy machine.
    assert!(start.elapsed() < Duration::from_secs(6));
    ran.stderr = said;
    ran.failed(130, &["interrupted", "maps are in a.maps"]);
    let mut after = listing(folder.path());
    assert!(after.remove(&folder.path().join("a.maps")).is_some());
    assert_eq!(after, before);
    let line = format!("focus --from-maps a.maps --out image {GRID}");
    let ran = run(folder.path(), &line);
    ran.succeeded();
    assert!(ran.stderr.contains("maps are missing"), "{ran:?}");
}

#[test]
fn ctrl_c_keeps_the_image_so_far() {
    let folder = scene();
    let more = format!("--firmware {}", application()[0].display());
    // At this rate 104 pulses take twenty seconds, a sub-CPI four to eight.
    let more = format!("{more} --rate 5 --send image --verify");
    let (child, mut stderr) = linking(folder.path(), "emulate", &more);
    std::thread::sleep(Duration::from_secs(12));
    signal(&child, "-INT");
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    ran.stderr = said;
    ran.failed(130, &["interrupted", "sub-CPIs are in a.maps"]);
    let record = fs::read(folder.path().join("a.maps/image.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let resolved = &record["settings"]["resolved"];
    let missing = resolved["sub_cpis_missing"].as_array().unwrap().len() as u64;
    let all = resolved["sub_cpis"].as_u64().unwrap();
    assert!((1..all).contains(&missing), "{resolved}");
}

#[test]
fn ctrl_c_before_any_map_leaves_no_file() {
    let folder = scene();
    let before = listing(folder.path());
    let more = format!("--firmware {} --rate 0.1", application()[0].display());
    let (child, mut stderr) = linking(folder.path(), "emulate", &more);
    signal(&child, "-INT");
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    ran.stderr = said;
    ran.failed(130, &["interrupted"]);
    assert_eq!(listing(folder.path()), before);
}

/// A killed command cannot end the session: the module is still in its run when the next command connects.
#[test]
fn command_takes_over_module_of_killed_command() {
    let folder = scene();
    let module = Emulated::start(&application()[0], Wire::Tcp, Begin::Reset);
    let place = module.place().to_string();
    let (mut child, _stderr) = linking(folder.path(), &place, "--rate 20");
    std::thread::sleep(Duration::from_secs(1));
    child.kill().unwrap();
    child.wait().unwrap();
    let line = format!("link {place} a.cphd -o b.maps {GRID} --verify");
    let ran = run(folder.path(), &line);
    println!("{}", ran.succeeded());
    assert!(ran.stdout.contains("on this computer, 0 not"), "{ran:?}");
    assert!(ran.is_untroubled(), "{ran:?}");
}

/// Over a pseudo-terminal, which the program opens like any serial device.
#[test]
fn link_works_over_serial_device() {
    let folder = scene();
    let module = Emulated::start(&application()[1], Wire::Terminal, Begin::Reset);
    let place = module.place();
    let line = format!("link {place} a.cphd -o a.maps {GRID} --verify");
    let ran = run(folder.path(), &line);
    println!("{}", ran.succeeded());
    assert!(ran.stdout.contains("on this computer, 0 not"), "{ran:?}");
    assert!(ran.is_untroubled(), "{ran:?}");
}

/// Firmware that is found rather than named is run only if no other user can have written it.
#[cfg(unix)]
#[test]
fn firmware_writable_by_others_is_not_run() {
    use std::os::unix::fs::PermissionsExt;
    let folder = scene();
    let module = folder.path().join("target/module");
    fs::create_dir_all(&module).unwrap();
    fs::copy(&application()[0], module.join("float")).unwrap();
    let within = folder.path().join("target");
    fs::set_permissions(&within, fs::Permissions::from_mode(0o777)).unwrap();
    let before = listing(folder.path());
    let line = format!("link emulate a.cphd -o a.maps {GRID}");
    run(folder.path(), &line).failed(1, &["target can be written by every user", "--firmware"]);
    assert_eq!(listing(folder.path()), before);
    // Named by the user it is run; with correct permissions it is found.
    let named = format!("{line} --firmware target/module/float");
    run(folder.path(), &named).succeeded();
    fs::set_permissions(&within, fs::Permissions::from_mode(0o755)).unwrap();
    fs::remove_file(folder.path().join("a.maps")).unwrap();
    run(folder.path(), &line).succeeded();
}
