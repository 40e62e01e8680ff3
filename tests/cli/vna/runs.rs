//! Complete captures in every dialect and mode, and captures that are killed, interrupted and continued.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use subaperture_tests::simulated_vna::{Family, Options, SimulatedVna};
use subaperture_tests::subap::{Ran, command, run};
use tempfile::TempDir;

use super::{AT_ONCE, antennas_m, assert_echoes, captured, experiment, lines, scene, sweeps};

#[test]
fn every_dialect_captures_with_every_trigger_and_byte_order() {
    for (family, own) in [
        (Family::Pna, "CALC1:PAR:DEF:EXT 'subap','S21'"),
        (Family::Ena, "CALC1:PAR1:DEF S21"),
        (Family::Znb, "CALC1:PAR:SDEF 'subap','S21'"),
        (Family::Cmt, "CALC1:PAR1:DEF S21"),
    ] {
        for (trigger, order) in [
            ("immediate", "little"),
            ("external", "big"),
            ("bus", "little"),
        ] {
            let folder = TempDir::new().unwrap();
            let at = folder.path();
            let analyser = SimulatedVna::start(Options::new(family, scene(&at.join("scan"))));
            let device = format!("trigger = \"{trigger}\"\nbyte_order = \"{order}\"");
            let text = experiment(analyser.port, 4, &device, AT_ONCE);
            let ran = captured(at, &text, "-q");
            ran.succeeded();
            assert_eq!(ran.stderr, "", "{family:?} {trigger}");
            assert_echoes(&at.join("scan"), 4);
            let received = analyser.received();
            assert!(received.iter().any(|line| line == own), "{received:?}");
            run(at, "info scan/recording.toml").succeeded();
        }
    }
}

#[test]
fn reflection_is_a_one_port_file_and_other_parameters_keep_their_names() {
    for (parameter, name, place) in [("s11", "sweep00000.s1p", 1), ("s12", "sweep00000.s2p", 5)] {
        let folder = TempDir::new().unwrap();
        let at = folder.path();
        let analyser = SimulatedVna::start(Options::new(Family::Pna, scene(&at.join("scan"))));
        let device = format!("parameter = \"{parameter}\"");
        captured(at, &experiment(analyser.port, 2, &device, AT_ONCE), "").succeeded();
        let lines = lines(&at.join("scan").join(name));
        let expected = super::echo(&super::TARGETS, antennas_m(0), lines[7][0]);
        assert_eq!(lines[7][place..place + 2], expected);
        run(at, "info scan/recording.toml").succeeded();
    }
}

#[test]
fn unknown_positions_leave_a_template_and_edits_are_kept() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let analyser = SimulatedVna::start(Options::new(Family::Znb, scene(&at.join("scan"))));
    let text = |sweeps| experiment(analyser.port, sweeps, "", "mode = \"immediate\"");
    captured(at, &text(3), "").succeeded();
    run(at, "info scan/recording.toml").failed(1, &["platform"]);
    let path = at.join("scan/recording.toml");
    let description = fs::read_to_string(&path).unwrap();
    assert!(description.contains("# [platform]") && description.contains("{00000..00002}"));
    let (head, template) = description.split_once("# file, with").unwrap();
    let (rest, template) = template.split_once('\n').unwrap();
    let edited = format!("{head}# file, with{rest}\n{}", template.replace("# ", ""));
    fs::write(&path, edited).unwrap();
    run(at, "info scan/recording.toml").succeeded();
    // A capture that continues changes the files only.
    captured(at, &text(5), "").succeeded();
    let description = fs::read_to_string(&path).unwrap();
    assert!(description.contains("\n[platform]") && description.contains("{00000..00004}"));
    run(at, "info scan/recording.toml").succeeded();
    captured(at, &text(5), "").failed(1, &["all 5 sweeps are captured", "raise plan.sweeps"]);
}

#[test]
fn positions_file_becomes_part_of_the_recording() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let analyser = SimulatedVna::start(Options::new(Family::Cmt, scene(&at.join("scan"))));
    let scan = "mode = \"immediate\"\npositions = \"stops.csv\"";
    let text = experiment(analyser.port, 4, "", scan);
    captured(at, &text, "").failed(
        1,
        &["stops.csv: expected the positions", "remove scan.positions"],
    );
    let rows: String = (0..4)
        .map(|stop| format!("{stop},{},0,0\n", 0.03 * f64::from(stop)))
        .collect();
    fs::write(at.join("stops.csv"), format!("time_s,x_m,y_m,z_m\n{rows}")).unwrap();
    captured(at, &text, "").succeeded();
    fs::remove_file(at.join("stops.csv")).unwrap();
    let info = run(at, "info scan/recording.toml");
    assert!(info.succeeded().contains('4'), "{info:?}");
}

#[test]
fn each_line_of_standard_input_takes_a_stop() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let analyser = SimulatedVna::start(Options::new(Family::Pna, scene(&at.join("scan"))));
    let scan = "first = \"-0.6, 0, 0 m\"\nstep = \"30, 0, 0 mm\"";
    fs::write(at.join("vna.toml"), experiment(analyser.port, 5, "", scan)).unwrap();
    let entered = |lines: &[u8]| -> Ran {
        let mut child = command(at, ["capture", "vna.toml", "-o", "scan"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(lines).unwrap();
        child.wait_with_output().unwrap().into()
    };
    let ran = entered(b"\n\n");
    ran.failed(
        1,
        &[
            "stop 3 of 5: move the antennas",
            "standard input ended",
            "the 2 sweeps",
        ],
    );
    assert_echoes(&at.join("scan"), 2);
    let ran = entered(b"\n\n\n");
    ran.succeeded();
    ran.reports("stop 3 of 5");
    assert_echoes(&at.join("scan"), 5);
}

/// Start a capture, and wait for `count` sweeps.
fn begun(at: &Path, text: &str, count: usize) -> Child {
    fs::write(at.join("vna.toml"), text).unwrap();
    let child = command(at, ["capture", "vna.toml", "-o", "scan"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while sweeps(&at.join("scan")).len() < count {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "no sweep in time"
        );
        sleep(Duration::from_millis(5));
    }
    child
}

/// Analyser whose sweeps take 20 ms.
fn slow(family: Family, scan: &Path) -> SimulatedVna {
    let mut options = Options::new(family, scene(scan));
    options.sweep = Duration::from_millis(20);
    SimulatedVna::start(options)
}

#[test]
fn killed_capture_continues_with_the_same_settings_only() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let scan = at.join("scan");
    let analyser = slow(Family::Pna, &scan);
    let text = experiment(analyser.port, 100, "", AT_ONCE);
    // 2 s of sweeps: the capture is not at its end after the eighth.
    let mut child = begun(at, &text, 8);
    // SIGKILL on Unix: no code of the program runs afterwards.
    child.kill().unwrap();
    child.wait().unwrap();
    let kept = sweeps(&scan);
    assert!(kept.len() < 100, "{kept:?}");
    let contents = |names: &[String]| -> Vec<Vec<u8>> {
        names
            .iter()
            .map(|name| fs::read(scan.join(name)).unwrap())
            .collect()
    };
    let before = contents(&kept);
    for (old, new, parts) in [
        ("steps = 101", "steps = 51", ["plan.steps = 101", "has 51"]),
        (
            "\"10 kHz\"",
            "\"1 kHz\"",
            ["if_bandwidth = 10000 Hz", "has 1000 Hz"],
        ),
        ("30, 0, 0 mm", "20, 0, 0 mm", ["0.03", "0.02"]),
        (
            "\"2 GHz\"",
            "\"2.1 GHz\"",
            ["plan.start = 2000000000 Hz", "2100000000 Hz"],
        ),
    ] {
        captured(at, &text.replace(old, new), "").failed(1, &parts);
    }
    let another = slow(Family::Znb, &scan);
    let port = format!("port = {}", analyser.port);
    let moved = text.replace(&port, &format!("port = {}", another.port));
    captured(at, &moved, "").failed(1, &["N5222B", "ZNB20"]);
    assert_eq!(sweeps(&scan), kept);
    captured(at, &text, "").succeeded();
    assert_echoes(&scan, 100);
    assert!(contents(&kept) == before, "a sweep changed");
    let description = fs::read_to_string(scan.join("recording.toml")).unwrap();
    assert!(description.contains("{00000..00099}"), "{description}");
    // A missing sweep is no reason to overwrite the later ones.
    fs::remove_file(scan.join("sweep00011.s2p")).unwrap();
    let more = text.replace("sweeps = 100", "sweeps = 101");
    captured(at, &more, "").failed(1, &["sweep00011.s2p", "missing"]);
}

#[cfg(unix)]
#[test]
fn free_capture_has_times_and_ends_cleanly_by_ctrl_c() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let scan = at.join("scan");
    let analyser = slow(Family::Pna, &scan);
    let motion = "mode = \"free\"\nfirst = \"-0.6, 0, 0 m\"\nvelocity = \"0.5, 0, 0 m/s\"";
    let mut last_s = -1.0;
    // The second run continues the first.
    for (sweeps_asked, least, code) in [(0, 6, 0), (1000, 12, 130)] {
        let text = experiment(analyser.port, sweeps_asked, "", motion);
        let child = begun(at, &text, least);
        let killed = std::process::Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        let ran: Ran = child.wait_with_output().unwrap().into();
        assert_eq!(ran.code, Some(code), "{ran:?}");
        if code == 130 {
            ran.reports("sweeps captured so far are in scan, a complete recording");
        }
        let names = sweeps(&scan);
        assert!(names.len() >= least);
        assert_echoes(&scan, names.len());
        let info = run(at, "info scan/recording.toml --json");
        let info: serde_json::Value = serde_json::from_str(info.succeeded()).unwrap();
        assert_eq!(
            info["num_pulses"].as_u64(),
            Some(names.len() as u64),
            "{info}"
        );
        let times: Vec<String> = fs::read_dir(&scan)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.starts_with("times"))
            .collect();
        assert_eq!(times, [format!("times{:05}.npy", names.len())]);
        let bytes = fs::read(scan.join(&times[0])).unwrap();
        let (numbers, _) = bytes[bytes.len() - 8 * names.len()..].as_chunks::<8>();
        let times_s: Vec<f64> = numbers.iter().copied().map(f64::from_le_bytes).collect();
        // A sweep takes 20 ms.
        assert!(
            times_s.windows(2).all(|pair| pair[1] - pair[0] >= 0.019),
            "{times_s:?}"
        );
        assert!(times_s[0] > 0.0 && times_s[times_s.len() - 1] > last_s);
        last_s = times_s[times_s.len() - 1];
    }
}

#[test]
fn interval_separates_the_beginnings_of_sweeps() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let analyser = SimulatedVna::start(Options::new(Family::Znb, scene(&at.join("scan"))));
    let scan = "mode = \"interval\"\ninterval = \"150 ms\"\nstep = \"30, 0, 0 mm\"\nfirst = \"-0.6, 0, 0 m\"";
    captured(at, &experiment(analyser.port, 4, "", scan), "").succeeded();
    assert_echoes(&at.join("scan"), 4);
    let times_s: Vec<f64> = sweeps(&at.join("scan"))
        .iter()
        .map(|name| {
            let text = fs::read_to_string(at.join("scan").join(name)).unwrap();
            let line = text.lines().find_map(|line| line.strip_prefix("! time_s "));
            line.unwrap().parse().unwrap()
        })
        .collect();
    // The end of a sweep may be noticed late on a slow machine, and the next one early after that.
    assert!(times_s[3] - times_s[0] > 2.0 * 0.15, "{times_s:?}");
}
