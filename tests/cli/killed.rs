//! `subap` killed (`kill -9`) at random times: its output is complete or absent, and a previous output is unchanged or completely replaced.

use std::fs;
use std::path::Path;
use std::time::Instant;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use subaperture::io::product;
use subaperture_tests::link_recording::write_recording;
use subaperture_tests::subap::{command, program, run};

/// Number of kills for each command.
const KILLS: u32 = 15;

const SCENARIO: &str = r#"
    [scene]
    x = "-20, 20 m"
    y = "-20, 20 m"
    [[scene.clutter]]
    x = "-20, 20 m"
    y = "-20, 20 m"
    count = 2000
    sigma0 = "-10 dB"
    [radar]
    kind = "ideal"
    pulses = 200
    pri = "5 ms"
    centre = "10 GHz"
    bandwidth = "200 MHz"
    samples = 256
    [platform]
    kind = "linear"
    position = "0, -5, 3 km"
    velocity = "100, 0, 0 m/s"
"#;

/// Run a command `KILLS` times and kill it after a part of its time, mostly near the end, when files are written.
/// `judge` checks the files each time. Returns how many runs ended before they were killed.
fn killed(folder: &Path, line: &str, mut judge: impl FnMut()) -> u32 {
    program();
    let words: Vec<&str> = line.split_whitespace().collect();
    let start = Instant::now();
    let whole = command(folder, &words).output().unwrap();
    assert!(whole.status.success(), "{whole:?}");
    let takes = start.elapsed();
    judge();
    let mut random = ChaCha8Rng::seed_from_u64(words.len() as u64);
    let mut ended = 0;
    for n in 0..KILLS {
        let part = f64::from(random.next_u32()) / 2f64.powi(32);
        let after = takes.mul_f64(if n % 3 == 0 { part } else { 0.6 + 0.45 * part });
        let mut child = command(folder, &words)
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(after);
        ended += u32::from(child.try_wait().unwrap().is_some());
        // SIGKILL on Unix: no code of the program runs afterwards.
        child.kill().unwrap();
        child.wait().unwrap();
        judge();
    }
    println!("{line}: takes {takes:?}, {ended} of {KILLS} ended before they were killed");
    ended
}

/// Assert that the file is complete or absent.
fn whole_or_absent(path: &Path, whole: &mut Option<Vec<u8>>) {
    match (fs::read(path), &whole) {
        (Err(_), _) => {}
        (Ok(bytes), None) => *whole = Some(bytes),
        (Ok(bytes), Some(whole)) => assert!(bytes == *whole, "{} is torn", path.display()),
    }
}

#[test]
fn killed_simulation_leaves_complete_file_or_none() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.toml"), SCENARIO).unwrap();
    let path = folder.path().join("a.cphd");
    let mut whole = None;
    killed(folder.path(), "simulate a.toml -o a.cphd", || {
        whole_or_absent(&path, &mut whole);
        let _ = fs::remove_file(&path);
    });
}

#[test]
fn killed_focusing_leaves_complete_product_or_none() {
    let folder = tempfile::tempdir().unwrap();
    write_recording(&folder.path().join("a.cphd"));
    let out = folder.path().join("image");
    let mut whole = None;
    let line = "focus a.cphd --out image --grid x=-12:12:0.05,y=-12:12:0.05,z=0";
    killed(folder.path(), line, || {
        if out.exists() {
            product::read(&out).unwrap();
            whole_or_absent(&out.join("image.npy"), &mut whole);
            assert!(out.join("image.png").exists());
        }
        let _ = fs::remove_dir_all(&out);
    });
}

/// In a folder with an older product, `image.json` marks a complete one.
#[test]
fn replaced_product_is_the_old_or_the_new_one() {
    let folder = tempfile::tempdir().unwrap();
    write_recording(&folder.path().join("a.cphd"));
    let grid = "--grid x=-12:12:0.05,y=-12:12:0.05,z=0";
    run(
        folder.path(),
        &format!("focus a.cphd --out image {grid} --window none"),
    )
    .succeeded();
    let old = fs::read(folder.path().join("image/image.npy")).unwrap();
    let mut new = None;
    let line = format!("focus a.cphd --out image {grid} --window hamming");
    killed(folder.path(), &line, || {
        let image = folder.path().join("image");
        if image.join("image.json").exists() {
            product::read(&image).unwrap();
            let bytes = fs::read(image.join("image.npy")).unwrap();
            if bytes != old {
                whole_or_absent(&image.join("image.npy"), &mut new);
            }
        }
    });
    assert!(new.is_some(), "the first run was not killed");
}
