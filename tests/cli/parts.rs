//! Pipes, devices and folders in place of the files of a description, an image or a capture are refused at once.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use subaperture_tests::subap::run;

use crate::{live, memory};

/// Part of an input, and a command that reads it.
const PARTS: [(&str, &str); 14] = [
    ("raw/echoes.npy", "focus raw/recording.toml -o o"),
    ("raw/times.npy", "focus raw/recording.toml -o o"),
    ("raw/track-times.npy", "info raw/recording.toml"),
    (
        "raw/transmitter.npy",
        "plan focus raw/recording.toml -o o.json",
    ),
    ("image/image.json", "info image"),
    ("image/image.npy", "picture image -o o.png"),
    ("tiled/image.json", "quality tiled"),
    ("tiled/image.zarr/zarr.json", "compare tiled tiled"),
    ("tiled/image.zarr/c/0/0", "picture tiled -o o.png"),
    ("stack.zarr/zarr.json", "info stack.zarr"),
    ("stack.zarr/image/c/0/0/0", "picture stack.zarr:0 -o o.png"),
    ("rail.sigmf-meta", "info rail.sigmf-meta"),
    ("rail.sigmf-data", "profile rail"),
    ("scene.toml", "radio probe rail.toml"),
];

fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("few.toml"), memory::SCENARIO).unwrap();
    fs::write(at.join("scene.toml"), live::SCENE).unwrap();
    fs::write(at.join("rail.toml"), live::RAIL).unwrap();
    let grid = "--grid x=-2:2:0.5,y=-2:2:0.5";
    for line in [
        "simulate few.toml -o few.cphd --echoes raw".to_owned(),
        format!("focus few.cphd {grid} -o image"),
        format!("focus few.cphd -a bp {grid} --tiled -o tiled"),
        "export image image -o stack.zarr".to_owned(),
        "capture rail.toml --out rail".to_owned(),
    ] {
        run(at, &line).succeeded();
    }
    folder
}

/// Replace `path` by something that is not a regular file.
fn replace(path: &Path, by: &str) {
    fs::remove_file(path).unwrap();
    match by {
        "folder" => fs::create_dir(path).unwrap(),
        "pipe" => assert!(Command::new("mkfifo").arg(path).status().unwrap().success()),
        device => symlink(device, path).unwrap(),
    }
}

#[test]
fn inputs_other_than_regular_files_are_refused_at_once() {
    let folder = workplace();
    let at = folder.path();
    for (part, line) in PARTS {
        let path = at.join(part);
        let kept = fs::read(&path).unwrap();
        for by in ["pipe", "/dev/zero", "/dev/full", "folder"] {
            // A text may come through a pipe, which ends with Ctrl-C: `inputs_that_never_end_are_refused_or_interrupted`.
            if (part, by) == ("scene.toml", "pipe") {
                continue;
            }
            replace(&path, by);
            let begun = Instant::now();
            // Without a signal, so that a command that waits ends with status 124.
            let words = format!("5 {} {line} --memory 64M -q", program(at));
            let output = Command::new("timeout")
                .args(words.split_whitespace())
                .current_dir(at)
                .output();
            let output = output.unwrap();
            let stderr = String::from_utf8_lossy(&output.stderr);
            println!(
                "{part} {by}: {:.2} s: {stderr}",
                begun.elapsed().as_secs_f64()
            );
            assert_eq!(output.status.code(), Some(1), "{part} {by}: {stderr}");
            assert!(!stderr.contains("panicked"), "{part} {by}: {stderr}");
            match by {
                "folder" => fs::remove_dir(&path).unwrap(),
                _ => fs::remove_file(&path).unwrap(),
            }
            fs::write(&path, &kept).unwrap();
        }
    }
}

fn program(at: &Path) -> String {
    let program = subaperture_tests::subap::command(at, [""; 0]);
    program.get_program().to_str().unwrap().to_owned()
}
