//! Two runs with the same output, files left by a killed run, and inputs that change during reading.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use subaperture_tests::subap::{command, listing, run};

fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    folder
}

/// A run that takes minutes.
const LONG: &str = "focus scene.cphd --out deep/out -v -a exact --grid x=-40:40:0.05,y=-40:40:0.05";

/// A run that has begun its computation; killed when dropped.
struct Running(Child);

impl Running {
    fn start(at: &Path, line: &str) -> Self {
        let mut child = command(at, line.split_whitespace())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut printed = Vec::new();
        let mut byte = [0];
        while !String::from_utf8_lossy(&printed).contains(" onto ") {
            let stderr = child.stderr.as_mut().unwrap();
            assert_eq!(
                stderr.read(&mut byte).unwrap(),
                1,
                "ended early: {printed:?}"
            );
            printed.push(byte[0]);
        }
        Self(child)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn second_run_is_refused_until_first_is_killed() {
    let folder = scene();
    let at = folder.path();
    let first = Running::start(at, LONG);
    let locked = "cannot write deep/out: another run (subap, process ";
    let short = "focus scene.cphd --out deep/out -a bp --grid x=-2:2:1,y=-2:2:1";
    run(at, short).failed(1, &[locked, &first.0.id().to_string()]);
    // The same output by another name.
    std::os::unix::fs::symlink("deep/out", at.join("link")).unwrap();
    run(at, &short.replace("deep/out", "link")).failed(1, &["link: another run"]);
    // Another output in the same folder is independent.
    run(at, &short.replace("deep/out", "deep/other")).succeeded();
    // SIGKILL: temporary files remain.
    drop(first);
    let left = |name: &str| {
        let all = listing(&at.join("deep"));
        all.keys()
            .filter(|path| path.to_string_lossy().contains(name))
            .count()
    };
    assert_eq!(left(".subap-"), 1, "the lock's file: {:?}", listing(at));
    run(at, short).succeeded();
    assert_eq!(left(".subap-"), 0, "{:?}", listing(at));
    assert!(at.join("deep/out/image.npy").is_file());
}

#[test]
fn file_is_locked_while_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("deep")).unwrap();
    // Takes many seconds, pulse by pulse.
    let scenario = subaperture::simulate::scenario::examples::text("stripmap").unwrap();
    fs::write(at.join("long.toml"), scenario).unwrap();
    let long = "simulate long.toml -o deep/a.cphd --set radar.pri=10us --set radar.pulses=300000";
    let line = "simulate --preset table-4-1 -o deep/a.cphd";
    let mut first = command(at, long.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    let hidden = || {
        let all = listing(&at.join("deep"));
        let mut names = all.keys().map(|path| path.to_string_lossy().into_owned());
        names.find(|name| name.ends_with(".part"))
    };
    while hidden().is_none() {
        assert!(begun.elapsed() < Duration::from_secs(60), "never begun");
        assert!(first.try_wait().unwrap().is_none(), "ended early");
    }
    let second = run(at, line);
    first.kill().unwrap();
    first.wait().unwrap();
    second.failed(1, &["deep/a.cphd: another run"]);
    // The killed run leaves its file and its lock, which the next run removes.
    assert!(hidden().is_some(), "{:?}", listing(at));
    run(at, line).succeeded();
    let names: Vec<_> = listing(&at.join("deep")).into_keys().collect();
    assert_eq!(names, [at.join("deep/a.cphd")]);
}

#[test]
fn locks_of_dead_runs_are_removed_and_others_kept() {
    let folder = scene();
    let at = folder.path();
    // The key of a name is its CRC-32.
    let key = |name: &str| format!("{:08x}", crc32fast::hash(name.as_bytes()));
    let dead = key("dead.cphd");
    fs::write(at.join(format!(".subap-{dead}.lock")), "subap, process 1\n").unwrap();
    fs::write(at.join(format!(".subap-{dead}-1-0.part")), "half").unwrap();
    fs::create_dir(at.join(format!(".subap-{dead}-1-1"))).unwrap();
    fs::write(at.join(format!(".subap-{dead}-1-1/image.npy")), "half").unwrap();
    // A run that was killed after it created a store of tiles leaves a lock within the product.
    let product = at.join("other");
    fs::create_dir(&product).unwrap();
    let store = key("image.zarr");
    fs::write(product.join(format!(".subap-{store}.lock")), "").unwrap();
    // Unfinished maps are kept, because they can be read up to their end.
    let maps = at.join(format!(".subap-{dead}-1-2.maps.part"));
    fs::write(&maps, "SUBAPMAP").unwrap();
    // Names similar to those of temporary files.
    let kept = [
        ".subap-notes",
        ".subap-12345678-1-0.part",
        ".subap-xyz.lock",
    ];
    for name in kept {
        fs::write(at.join(name), "mine").unwrap();
    }
    let living = Running::start(at, &LONG.replace("deep/out", "out"));
    run(
        at,
        "focus scene.cphd --out other -a bp --grid x=-2:2:1,y=-2:2:1",
    )
    .succeeded();
    let hidden = |folder: &Path| -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .filter(|name| name.starts_with(".subap-"))
            .collect()
    };
    assert_eq!(hidden(&product), [""; 0]);
    let hidden = hidden(at);
    let mut expected: Vec<String> = kept.map(str::to_owned).to_vec();
    expected.push(maps.file_name().unwrap().to_str().unwrap().to_owned());
    expected.push(format!(".subap-{}.lock", key("out")));
    for name in &hidden {
        assert!(expected.contains(name), "{name} is left");
    }
    assert_eq!(hidden.len(), expected.len(), "{hidden:?}");
    drop(living);
}

/// Apply `change` to the input during reading, and assert that the run fails and leaves no file.
fn changed(change: impl Fn(&Path)) {
    let folder = scene();
    let at = folder.path();
    let line = "focus scene.cphd --out out -v -a exact --grid x=-10:10:0.25,y=-10:10:0.25";
    let running = Running::start(at, line);
    change(&at.join("scene.cphd"));
    let mut running = std::mem::ManuallyDrop::new(running);
    let mut printed = String::new();
    let stderr = running.0.stderr.as_mut().unwrap();
    stderr.read_to_string(&mut printed).unwrap();
    assert_eq!(running.0.wait().unwrap().code(), Some(1), "{printed}");
    assert!(
        printed.contains("scene.cphd was changed while it was read"),
        "{printed}"
    );
    assert_eq!(listing(at).len(), 1, "{:?}", listing(at));
}

#[test]
fn input_that_grows_during_reading_is_detected() {
    changed(|path| {
        let mut file = fs::OpenOptions::new().append(true).open(path).unwrap();
        file.write_all(b"more").unwrap();
    });
}

#[test]
fn input_modified_during_reading_is_detected() {
    use std::os::unix::fs::FileExt;
    changed(|path| {
        let file = fs::OpenOptions::new()
            .write(true)
            .read(true)
            .open(path)
            .unwrap();
        let end = file.metadata().unwrap().len();
        let mut last = [0];
        file.read_exact_at(&mut last, end - 1).unwrap();
        file.write_all_at(&[last[0] ^ 1], end - 1).unwrap();
    });
}
