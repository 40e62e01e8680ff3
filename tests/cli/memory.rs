//! `--memory` holds: the peak memory of the process, as counted by the system, stays below it, or the work is refused with the required
//! amount.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use subaperture_tests::subap::{command, listing, run};

/// Few pulses, so that large images are fast.
pub(super) const SCENARIO: &str = r#"
name = "a few pulses"

[scene]
x = "-30, 30 m"
y = "-30, 30 m"

[[scene.point]]
position = "1, 2, 0 m"

[radar]
kind = "ideal"
pulses = 16
pri = "10 ms"
centre = "10 GHz"
bandwidth = "150 MHz"
samples = 64

[platform]
kind = "linear"
position = "0, -900, 400 m"
velocity = "20, 0, 0 m/s"
"#;

const MIB: f64 = 1024.0 * 1024.0;

fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENARIO).unwrap();
    run(folder.path(), "simulate scene.toml -o scene.cphd").succeeded();
    folder
}

/// Run `line` within `mib` and return its peak memory, MiB; `None` if it was refused for its memory.
#[track_caller]
fn peak_mib(at: &Path, line: &str, mib: u32) -> Option<f64> {
    let words = format!("{line} --threads 2 --memory {mib}M -v");
    let ran = run(at, &words);
    // Status 3: completed with an error above the bound.
    if !matches!(ran.code, Some(0 | 3)) {
        ran.failed(1, &["memory"]);
        println!("{mib:4} MiB: refused: {line}");
        return None;
    }
    let marker = "note: peak memory ";
    let peak = ran
        .stderr
        .lines()
        .find_map(|line| line.strip_prefix(marker));
    let peak = peak.unwrap_or_else(|| panic!("no peak in {ran:?}"));
    let (number, unit) = peak.split_once(' ').unwrap();
    let peak = number.parse::<f64>().unwrap()
        * match unit {
            "KiB" => 1024.0 / MIB,
            "MiB" => 1.0,
            "GiB" => 1024.0,
            _ => panic!("{unit}"),
        };
    println!("{mib:4} MiB: {peak:6.1} MiB taken: {line}");
    assert!(peak <= f64::from(mib), "{line}: {peak} MiB of {mib}");
    Some(peak)
}

/// Result of a run measured from outside.
#[derive(Debug)]
pub(super) struct Watched {
    /// Exit status; `None` if a signal ended it.
    pub(super) code: Option<i32>,
    pub(super) stderr: String,
    /// Peak memory counted by the system (`VmHWM`), MiB.
    pub(super) peak_mib: f64,
}

/// Peak memory of a running `subap` so far, MiB; `None` before it has begun and after it has ended. Until a new process executes its
/// program it shares the memory of its parent, whose peak must not be counted: 37 of 60 000 readings on a busy machine saw it.
pub(super) fn peak_of(process: u32) -> Option<f64> {
    let name = fs::read_to_string(format!("/proc/{process}/comm")).ok()?;
    if name.trim_end() != "subap" {
        return None;
    }
    let text = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let printed = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = printed.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Run `line` with `--memory` and 2 threads, and measure it. The last 2 ms may be missed.
pub(super) fn measured(at: &Path, line: &str, mib: u32) -> Watched {
    let words = format!("{line} --threads 2 --memory {mib}M -q");
    let begun = Instant::now();
    let mut child = command(at, words.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut peak_mib = 0.0f64;
    let ended = loop {
        peak_mib = peak_mib.max(peak_of(child.id()).unwrap_or(0.0));
        match child.try_wait().unwrap() {
            Some(ended) => break ended,
            None => sleep(Duration::from_millis(2)),
        }
    };
    let mut stderr = String::new();
    let mut printed = child.stderr.take().unwrap();
    printed.read_to_string(&mut stderr).unwrap();
    println!(
        "{mib:5} MiB: {peak_mib:6.1} MiB, {ended}, {:.1} s: {line}",
        begun.elapsed().as_secs_f64()
    );
    Watched {
        code: ended.code(),
        stderr,
        peak_mib,
    }
}

#[test]
fn process_other_than_subap_has_no_peak() {
    assert_eq!(peak_of(std::process::id()), None);
}

/// Run `line` within `mib`; returns the peak memory counted by the system (`VmHWM`), MiB, and whether it completed rather than was refused
/// for its memory.
#[track_caller]
fn watched(at: &Path, line: &str, mib: u32) -> (f64, bool) {
    let ran = measured(at, line, mib);
    let done = match ran.code {
        // Status 3: completed with an error above the bound.
        Some(0 | 3) => true,
        Some(1) if ran.stderr.contains("--memory") => false,
        _ => panic!("{line}: {ran:?}"),
    };
    let peak_mib = ran.peak_mib;
    assert!(
        peak_mib > 1.0 && peak_mib <= f64::from(mib),
        "{line}: {peak_mib} MiB of {mib}"
    );
    (peak_mib, done)
}

/// Recording, image, or both larger than the budget, for every former. Formers that need the whole spectrum in memory refuse.
fn larger_than(mib: u32, both: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A power of two of samples, and pixels of 8 bytes, above the budget.
    let samples = (mib as usize).next_power_of_two() << 17;
    let pulses = 1 << (samples.ilog2() / 2 - 2);
    let scene = |pulses: usize, samples: usize| {
        SCENARIO
            .replace("pulses = 16", &format!("pulses = {pulses}"))
            .replace("10 ms", "100 us")
            .replace("samples = 64", &format!("samples = {samples}"))
    };
    fs::write(at.join("large.toml"), scene(pulses, samples / pulses)).unwrap();
    fs::write(at.join("few.toml"), scene(4, 32)).unwrap();
    for name in ["large", "few"] {
        run(
            at,
            &format!("simulate {name}.toml -o {name}.cphd --memory {mib}M"),
        )
        .succeeded();
    }
    let bytes = fs::metadata(at.join("large.cphd")).unwrap().len();
    assert!(bytes as f64 > f64::from(mib) * MIB);
    let side = (f64::from(mib) * 1.03 * MIB / 8.0).sqrt();
    let wide = format!("--grid x=-30:30:{:.6},y=-30:30:{0:.6}", 60.0 / side);
    let small = "--grid x=-3:3:0.5,y=-3:3:0.5";
    for former in ["exact", "bp", "rdbp", "ffbp", "pfa", "rda", "omega-k"] {
        let line = format!("-a {former} --allow-error --force --out out");
        let needs_all = ["pfa", "rda", "omega-k"].contains(&former);
        let (_, done) = watched(at, &format!("focus large.cphd {line} {small}"), mib);
        assert!(done || needs_all, "{former}");
        let (_, done) = watched(at, &format!("focus few.cphd {line} {wide}"), mib);
        assert!(done, "{former}");
        let image = fs::metadata(at.join("out/image.npy")).unwrap().len();
        assert!(image as f64 > f64::from(mib) * MIB);
        if both.contains(&former) {
            let (_, done) = watched(at, &format!("focus large.cphd {line} {wide}"), mib);
            assert!(done || needs_all, "{former}");
        }
    }
    for line in ["picture out -o p.png --force", "compare out out"] {
        assert!(watched(at, line, mib).1, "{line}");
    }
}

#[test]
fn recordings_and_images_larger_than_budget_are_processed() {
    larger_than(128, &["pfa"]);
}

/// More than half an hour, and 5 GB of disk.
#[test]
#[ignore = "minutes: cargo xtask long"]
fn recordings_and_images_larger_than_a_gigabyte_are_processed() {
    larger_than(1024, &["rdbp", "pfa", "rda", "omega-k"]);
}

/// Assert that `line` stays within each of `budgets`, and completes with the last.
#[track_caller]
fn holds(at: &Path, line: &str, budgets: &[u32]) {
    let peaks: Vec<_> = budgets.iter().map(|&mib| peak_mib(at, line, mib)).collect();
    assert!(peaks[peaks.len() - 1].is_some(), "{line}: always refused");
}

#[test]
fn every_former_stays_within_its_budget() {
    let folder = workplace();
    // 11.5 MB of pixels.
    let grid = "--grid x=-30:30:0.05,y=-30:30:0.05 --allow-error --force";
    for former in [
        "bp",
        "rdbp",
        "rdbp --mode thesis --sub-cpi 8",
        "ffbp",
        "pfa",
        "rda",
        "omega-k",
    ] {
        let grid = match former.contains("thesis") {
            true => grid.replace(" --allow-error", ""),
            false => grid.to_owned(),
        };
        let line = format!("focus scene.cphd --out out -a {former} {grid}");
        holds(folder.path(), &line, &[32, 44, 96, 512]);
    }
    // Another 40 bytes per pixel.
    let line = "focus scene.cphd --out out -a exact --grid x=-30:30:0.1,y=-30:30:0.1";
    holds(folder.path(), line, &[32, 44, 96]);
}

#[test]
fn velocity_quality_and_compare_stay_within_budget() {
    let folder = workplace();
    let at = folder.path();
    let line = "velocity scene.cphd --at 1,2 --vx=-30:30:0.1 --vy=-30:30:0.1 --out v";
    holds(at, line, &[32, 64]);
    run(
        at,
        "focus scene.cphd --out image --grid x=-30:30:0.1,y=-30:30:0.1",
    )
    .succeeded();
    holds(
        at,
        "quality image --against image --plots q",
        &[32, 64, 128],
    );
    holds(at, "compare image/image.npy image/image.npy", &[28, 44]);
    holds(at, "picture image -o p.png", &[28, 44, 128]);
    holds(at, "info scene.cphd", &[28]);
}

#[test]
fn simulation_stays_within_budget() {
    let folder = workplace();
    let at = folder.path();
    let clutter = "\n[[scene.clutter]]\nkind = \"rectangle\"\nx = \"-30, 30 m\"\ny = \"-30, 30 m\"\nsigma0 = \"-20 dB\"\n";
    for (name, count) in [("some", 20_000), ("many", 300_000), ("most", 20_000_000)] {
        let text = format!("{SCENARIO}{clutter}count = {count}\n");
        fs::write(at.join(format!("{name}.toml")), text).unwrap();
    }
    holds(at, "simulate some.toml -o a.cphd --echoes a", &[32, 64]);
    holds(at, "simulate many.toml -o b.cphd", &[32, 64, 128]);
    // 67 million points are allowed but need 2.7 GB: refused before they are allocated.
    assert_eq!(peak_mib(at, "simulate most.toml -o c.cphd", 64), None);
    let long = "simulate scene.toml -o d.cphd --set radar.pri=1us --set radar.pulses";
    holds(at, &format!("{long}=20000"), &[32, 64, 128]);
    assert_eq!(peak_mib(at, &format!("{long}=10000000"), 64), None);
    assert_eq!(
        peak_mib(
            at,
            "simulate scene.toml -o e.cphd --set radar.samples=16777216",
            64
        ),
        None
    );
    assert!(!at.join("c.cphd").exists() && !at.join("e.cphd").exists());
}

#[test]
fn budget_below_program_is_refused_and_above_machine_is_reduced() {
    let folder = workplace();
    let at = folder.path();
    let line = "focus scene.cphd --out out --grid x=-3:3:0.5,y=-3:3:0.5 --threads 2";
    for size in ["1M", "16M", "25M"] {
        run(at, &format!("{line} --memory {size}")).failed(2, &["--memory", "28.0 MiB"]);
    }
    let before = listing(at);
    let ran = run(at, &format!("{line} --memory 4000T"));
    assert!(
        ran.stderr.contains("exceeds the memory of this machine"),
        "{ran:?}"
    );
    ran.succeeded();
    assert!(listing(at).len() > before.len());
}

#[test]
fn address_space_limit_never_aborts_the_program() {
    let folder = workplace();
    let at = folder.path();
    let program = command(at, [""; 0]).get_program().to_owned();
    let mut ended = [0; 2];
    for limit_mib in [20, 40, 60, 80, 100, 140, 200, 300, 400, 500, 600, 800, 1000] {
        let line =
            "focus scene.cphd --out out --force --grid x=-30:30:0.1,y=-30:30:0.1 --threads 2";
        let within = |line: &str| {
            let script = format!("ulimit -v {}; exec \"$0\" {line}", limit_mib * 1024);
            let mut command = std::process::Command::new("sh");
            let command = command.args(["-c", &script]).arg(&program).current_dir(at);
            command.output().unwrap()
        };
        let output = within(line);
        let printed = String::from_utf8_lossy(&output.stderr).into_owned();
        println!("{limit_mib} MiB: {:?} {printed}", output.status.code());
        // Below the needs of the loader the system reports the failure, by status 127 or a signal; a little above, the program starts but
        // has no room for any work.
        if !within("--version").status.success() {
            continue;
        }
        match output.status.code() {
            Some(0) => ended[0] += 1,
            Some(1) => ended[1] += 1,
            other => panic!("{limit_mib} MiB: {other:?}: {printed}"),
        }
    }
    assert!(ended[0] > 0 && ended[1] > 0, "{ended:?}");
}
