//! Output complete or absent: too large, not writable, a full disk, Ctrl-C.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use num_complex::Complex32;
use subaperture::image::Image;
use subaperture::io::npy;
use subaperture_tests::subap::{Ran, command, listing, program, run};

/// A folder that contains `scene.cphd`.
fn scene() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), "simulate --preset table-4-1 -o scene.cphd").succeeded();
    folder
}

/// An image larger than memory is formed in parts (`tiles`); one larger than the disk is refused.
#[test]
fn grid_beyond_disk_is_refused_first() {
    let folder = tempfile::tempdir().unwrap();
    // 1e7 x 1e7 pixels; the input need not exist.
    let grid = "--grid x=-500000:500000:0.1,y=-500000:500000:0.1,z=0";
    for algorithm in ["exact", "bp", "rdbp", "rda", "omega-k"] {
        let line = format!("focus none.cphd --out out --memory 1G -a {algorithm} {grid}");
        run(folder.path(), &line).failed(
            1,
            &["--grid", "10000000 x 10000000", "727.6 TiB", "free there"],
        );
    }
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn work_beyond_memory_is_refused_cleanly() {
    let folder = scene();
    let before = listing(folder.path());
    // 28 MiB leave 4 for the work: the image of 1.2 MB fits, but not the buffers of the exact sum.
    let line = "focus scene.cphd --out out --threads 2 --memory 28M -a exact --grid x=-40:40:0.2,y=-40:40:0.2";
    run(folder.path(), line).failed(1, &["allowed", "--memory"]);
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn check_beyond_memory_is_refused_before_work() {
    let folder = scene();
    let before = listing(folder.path());
    // 160 000 pixels: an image of 1.28 MB, and 16 MB to compare all of them; 9 MiB are for the work.
    let line = "focus scene.cphd --out out -a bp --threads 2 --memory 32M --grid x=-40:40:0.2,y=-40:40:0.2";
    run(folder.path(), &format!("{line} --check 1000000"))
        .failed(1, &["--check", "check fewer pixels", "--memory"]);
    assert_eq!(listing(folder.path()), before);
    run(folder.path(), &format!("{line} --check 10")).succeeded();
}

/// Two images of 5.8 MB together, with 4 MiB for the work.
#[test]
fn images_beyond_memory_are_compared_part_by_part() {
    let folder = tempfile::tempdir().unwrap();
    let mut image = Image {
        rows: 600,
        columns: 600,
        pixels: vec![Complex32::ONE; 360_000],
    };
    npy::write(&folder.path().join("a.npy"), &image).unwrap();
    // One wrong pixel in the last part: -10 log10(360 000) dB.
    image.pixels[359_999] = Complex32::ZERO;
    npy::write(&folder.path().join("b.npy"), &image).unwrap();
    let ran = run(
        folder.path(),
        "compare b.npy a.npy --threads 2 --memory 28M",
    );
    assert!(ran.succeeded().contains("-55.56 dB"), "{ran:?}");
}

#[test]
fn demonstration_beyond_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    // One image of 200 x 200 pixels needs 320 kB, all of them 6.4 MB; 4 MiB are for the work.
    let line = "demo --out demo --threads 2 --memory 28M --grid x=-20:20:0.2,y=-20:20:0.2";
    run(folder.path(), line).failed(1, &["20 images", "200 x 200", "--memory"]);
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn unwritable_output_is_reported() {
    let folder = scene();
    fs::write(folder.path().join("file"), "in the way").unwrap();
    let before = listing(folder.path());
    // Root may write where modes forbid it, hence a path below a file, and a file system of the kernel
    // that allows no folders.
    for out in ["file", "file/out", "/proc/out", "/proc/self/out/deeper"] {
        let line = format!("focus scene.cphd --out {out} --grid x=-1:1:0.5,y=-1:1:0.5");
        run(folder.path(), &line).failed(1, &["cannot write", out]);
        assert_eq!(listing(folder.path()), before, "{out}");
    }
    for out in ["file/a.cphd", "/proc/a.cphd"] {
        run(
            folder.path(),
            &format!("simulate --preset table-4-1 -o {out}"),
        )
        .failed(1, &["cannot write"]);
    }
    run(folder.path(), "demo --out file").failed(1, &["cannot write"]);
    assert_eq!(listing(folder.path()), before);
}

/// A mounted file system of `kilobytes`, unmounted when dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    fn mount(at: &Path, kilobytes: u32) -> Result<Self, String> {
        fs::create_dir_all(at).unwrap();
        let size = format!("size={kilobytes}k");
        let output = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &size, "tmpfs"])
            .arg(at)
            .output();
        match output {
            Ok(output) if output.status.success() => Ok(Self(at.to_owned())),
            Ok(output) => Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
            Err(error) => Err(error.to_string()),
        }
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Run `line` in `folder`, where `folder/disk` is a file system of `kilobytes`, as root or in a user namespace. Returns its output and the
/// names left on the disk; `None` if this machine allows neither.
fn on_small_disk(folder: &Path, kilobytes: u32, line: &str) -> Option<(Ran, Vec<String>)> {
    let disk = folder.join("disk");
    let why = match SmallDisk::mount(&disk, kilobytes) {
        Ok(mounted) => {
            let ran = run(folder, line);
            let left = listing(&mounted.0)
                .into_keys()
                .map(|path| path.display().to_string());
            return Some((ran, left.collect()));
        }
        Err(why) => why,
    };
    let script = format!(
        "mount -t tmpfs -o size={kilobytes}k tmpfs disk || exit 99\n\
         \"$0\" {line}\ncode=$?\nfind disk -mindepth 1 >left\nexit $code"
    );
    let output = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", &script])
        .arg(program())
        .current_dir(folder)
        .output();
    match output {
        Ok(output) if output.status.success() || folder.join("left").exists() => {
            let left = fs::read_to_string(folder.join("left")).unwrap();
            fs::remove_file(folder.join("left")).unwrap();
            Some((output.into(), left.lines().map(str::to_owned).collect()))
        }
        other => {
            println!("skipped: no small file system could be mounted: {why}; {other:?}");
            None
        }
    }
}

#[test]
fn full_disk_leaves_no_file() {
    let folder = scene();
    // An image of 400 x 400 pixels needs 1.28 MB, a simulated collection 2.1 MB.
    for line in [
        "focus scene.cphd --out disk/out -a bp --grid x=-40:40:0.2,y=-40:40:0.2",
        "simulate --preset table-4-1 -o disk/a.cphd",
    ] {
        let Some((ran, left)) = on_small_disk(folder.path(), 512, line) else {
            return;
        };
        ran.failed(1, &["cannot write"]);
        assert!(
            ran.stderr.contains("free") || ran.stderr.contains("No space left"),
            "{}",
            ran.stderr
        );
        assert!(left.is_empty(), "{line} left {left:?}");
    }
}

#[test]
fn disk_that_is_just_large_enough_suffices() {
    let folder = scene();
    let line = "focus scene.cphd --out disk/out -a bp --grid x=-20:20:0.2,y=-20:20:0.2";
    let Some((ran, left)) = on_small_disk(folder.path(), 8192, line) else {
        return;
    };
    ran.succeeded();
    // The folder and its three files.
    assert_eq!(left.len(), 4, "{left:?}");
}

#[test]
fn older_image_survives_failure() {
    let folder = scene();
    let line = "focus scene.cphd --out out -a bp --grid x=-5:5:0.5,y=-5:5:0.5";
    run(folder.path(), line).succeeded();
    let before = listing(folder.path());
    let image = fs::read(folder.path().join("out/image.npy")).unwrap();
    fs::write(folder.path().join("bad.cphd"), "CPHD/1.1.0\n").unwrap();
    run(folder.path(), &line.replace("scene.cphd", "bad.cphd")).failed(1, &["bad.cphd"]);
    fs::remove_file(folder.path().join("bad.cphd")).unwrap();
    assert_eq!(listing(folder.path()), before);
    assert_eq!(
        fs::read(folder.path().join("out/image.npy")).unwrap(),
        image
    );
}

/// Start work of minutes and send `presses` interrupts; returns the result and the time until the end.
fn interrupted(folder: &Path, line: &str, presses: u32) -> (Ran, Duration) {
    let mut child = command(folder, line.split_whitespace())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // `-v` prints a line when the work begins; an earlier signal could arrive before the handler is installed.
    let mut stderr = child.stderr.take().unwrap();
    let mut printed = Vec::new();
    let mut byte = [0];
    while !String::from_utf8_lossy(&printed).contains(" onto ") {
        assert_eq!(
            stderr.read(&mut byte).unwrap(),
            1,
            "ended early: {printed:?}"
        );
        printed.push(byte[0]);
    }
    std::thread::sleep(Duration::from_millis(300));
    let start = Instant::now();
    for _ in 0..presses {
        let id = child.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-INT", &id])
                .status()
                .unwrap()
                .success()
        );
        std::thread::sleep(Duration::from_millis(50));
    }
    stderr.read_to_end(&mut printed).unwrap();
    let mut ran: Ran = child.wait_with_output().unwrap().into();
    ran.stderr = String::from_utf8_lossy(&printed).into_owned();
    (ran, start.elapsed())
}

#[test]
fn ctrl_c_ends_cleanly() {
    let folder = scene();
    let before = listing(folder.path());
    for algorithm in ["exact", "bp", "rdbp"] {
        // 64 million pixels: minutes with any former.
        let line = format!(
            "focus scene.cphd --out out -v -a {algorithm} --memory 16G --grid x=-40:40:0.01,y=-40:40:0.01"
        );
        let (ran, took) = interrupted(folder.path(), &line, 1);
        ran.failed(130, &["interrupted"]);
        assert!(took < Duration::from_secs(20), "{algorithm}: {took:?}");
        assert_eq!(listing(folder.path()), before, "{algorithm}");
    }
}

#[test]
fn second_ctrl_c_ends_at_once() {
    let folder = scene();
    let before = listing(folder.path());
    let line =
        "focus scene.cphd --out out -v -a exact --memory 16G --grid x=-40:40:0.01,y=-40:40:0.01";
    let (ran, took) = interrupted(folder.path(), line, 2);
    assert_eq!(ran.code, Some(130), "{ran:?}");
    assert!(took < Duration::from_secs(20), "{took:?}");
    assert_eq!(listing(folder.path()), before);
}
