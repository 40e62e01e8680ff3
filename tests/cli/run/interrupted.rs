//! `subap run` killed, interrupted or on a full disk: it resumes with the same bits, and leaves no partial file.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::Value;
use subaperture_tests::subap::{command, listing, run};
use subaperture_tests::tiny_disk::TinyDisk;

use super::{JOB, Place, done, record, stages};

/// Run a pipeline until `stage` begins, wait `after`, and kill it. Returns whether it was still running.
fn killed_at(at: &Path, stage: &str, after: Duration) -> bool {
    let mut child = command(at, ["run", "job.toml"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let begins = format!("note: {stage}: ");
    let mut lines = lines.map_while(Result::ok);
    let met = lines.any(|line| line.starts_with(&begins));
    sleep(after);
    let alive = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    met && alive
}

/// All files that are not hidden, by name.
fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let within = |path: &Path| path.strip_prefix(root).unwrap().display().to_string();
    listing(root)
        .into_keys()
        .filter(|path| path.is_file())
        .map(|path| (within(&path), path))
        .filter(|(name, _)| !name.split('/').any(|part| part.starts_with('.')))
        .map(|(name, path)| (name, fs::read(path).unwrap()))
        .collect()
}

/// A record without times and other values that belong to the run rather than its result.
fn timeless(bytes: &[u8]) -> Value {
    let mut record: Value = serde_json::from_slice(bytes).unwrap();
    for key in ["run", "command_line"] {
        record.as_object_mut().unwrap().remove(key);
    }
    record
}

/// Assert that two folders contain the same results except for times.
fn same_job(a: &Path, b: &Path) {
    let [ours, theirs] = [files(a), files(b)];
    assert_eq!(
        ours.keys().collect::<Vec<_>>(),
        theirs.keys().collect::<Vec<_>>()
    );
    for (name, bytes) in &ours {
        let other = &theirs[name];
        match &name[..] {
            // Files that contain times.
            "job.json" | "report.html" => {}
            "image.json" | "autofocus.json" => {
                assert_eq!(timeless(bytes), timeless(other), "{name}")
            }
            // Files that contain their time of creation in digits.
            "sicd.nitf" | "sidd.nitf" | "map.json" => {
                assert_eq!(bytes.len(), other.len(), "{name}");
                let differing = bytes.iter().zip(other).filter(|(a, b)| a != b);
                let differing: Vec<_> = differing.collect();
                assert!(differing.len() < 200, "{name}: {}", differing.len());
                let digits = |(a, b): &(&u8, &u8)| a.is_ascii_digit() && b.is_ascii_digit();
                assert!(differing.iter().all(digits), "{name}");
            }
            _ => assert!(bytes == other, "{name}"),
        }
    }
}

/// Kill a pipeline in every long stage, twice in the longest, and at random times; the final result equals that of an undisturbed run.
#[test]
fn killed_pipeline_resumes_with_same_bits() {
    let place = Place::new();
    // Tiles of some tenths of a second are long enough.
    let text = JOB.replace("0.2,y=-30:30:0.2\"", "0.1,y=-30:30:0.1\"");
    let whole = place.job("whole", &text);
    let ran = run(&whole, "run job.toml --json");
    let printed: Value = serde_json::from_str(ran.succeeded()).unwrap();
    let takes: BTreeMap<String, f64> = printed["stages"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stage| {
            (
                stage["stage"].as_str().unwrap().to_owned(),
                stage["seconds"].as_f64().unwrap(),
            )
        })
        .collect();
    let at = place.job("killed", &text);
    let mut random = ChaCha8Rng::seed_from_u64(14);
    let mut part = || f64::from(random.next_u32()) / 2f64.powi(32);
    let mut killed = 0;
    // The long stages, the longest more than once; a kill that comes too late does not count.
    let stages = [
        "autofocus",
        "focus",
        "focus",
        "focus",
        "quality",
        "products",
        "products",
    ];
    for n in 0..40 {
        let stage = stages[n % stages.len()];
        let after = Duration::from_secs_f64(0.7 * takes[stage] * part());
        if killed_at(&at, stage, after) {
            killed += 1;
            println!("killed in {stage} after {after:?}");
        } else if at.join("job/report.html").exists() {
            // The run had ended, so that there was nothing to kill.
            fs::remove_dir_all(at.join("job")).unwrap();
        }
        if killed == 8 {
            break;
        }
    }
    assert_eq!(killed, 8);
    run(&at, "run job.toml").succeeded();
    same_job(&whole.join("job"), &at.join("job"));
    assert_eq!(done(&run(&at, "run job.toml --json")), [""; 0]);
}

#[test]
fn ctrl_c_keeps_finished_stages_and_the_same_command_resumes() {
    let place = Place::new();
    let at = place.job(
        "stopped",
        &JOB.replace("algorithm = \"bp\"", "algorithm = \"exact\"")
            .replace("error = \"-50 dB\"\n", ""),
    );
    // Minutes of the exact sum.
    let long = "run job.toml --set grid.pixels=x=-30:30:0.02,y=-30:30:0.02 --set autofocus.grid=x=-4:20:1,y=-4:20:1 --set autofocus.rounds=1";
    let mut child = command(&at, long.split_whitespace())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut printed = String::new();
    while !printed.contains("note: focus: ") {
        assert!(stderr.read_line(&mut printed).unwrap() > 0, "{printed}");
    }
    sleep(Duration::from_millis(300));
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    stderr.read_to_string(&mut printed).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{printed}");
    assert!(printed.contains("interrupted"), "{printed}");
    let state = record(&at.join("job/job.json"));
    assert_eq!(state["begun"]["stage"], "focus");
    assert!(state["stages"]["autofocus"].is_object() && state["stages"]["focus"].is_null());
    // Finished stages remain; another grid is another image.
    let rest = "run job.toml --json --set grid.pixels=x=-6:12:0.3,y=-6:12:0.3 --set autofocus.grid=x=-4:20:1,y=-4:20:1 --set autofocus.rounds=1 \
                --set products.formats=kmz --set quality.points=0";
    let ran = run(&at, rest);
    assert_eq!(stages(&ran)[0], ("autofocus".to_owned(), false));
    assert_eq!(done(&ran)[0], "focus");
}

#[test]
fn full_disk_is_reported_and_leaves_no_partial_file() {
    let Some(disk) = TinyDisk::mount() else {
        return;
    };
    let place = Place::new();
    let at = place.job("full", JOB);
    let line = format!(
        "run job.toml --set out={}",
        disk.path().join("job").display()
    );
    // 90 000 pixels need 720 kB.
    run(&at, &line).failed(1, &["image.zarr", "bytes are needed"]);
    let left = files(&disk.path().join("job"));
    assert!(
        !left.keys().any(|name| name.contains("image")),
        "{:?}",
        left.keys()
    );
    // An image that fits is made, but its report does not fit.
    let small = format!(
        "{line} --set grid.pixels=x=-8:8:0.4,y=-8:8:0.4 --set autofocus.grid=x=-8:8:0.4,y=-8:8:0.4"
    );
    let ran = run(&at, &small);
    assert_eq!(ran.code, Some(1), "{ran:?}");
    ran.reports("free some");
    let left = files(&disk.path().join("job"));
    assert!(
        left.contains_key("image.json") && !left.contains_key("report.html"),
        "{:?}",
        left.keys()
    );
}
