//! Every kind of bad input through the command: a clear message, exit status 1, no file left.

use std::fs;
use std::path::Path;

use subaperture_tests::matlab::{self, Value};
use subaperture_tests::subap::{listing, run};

const GRID: &str = "--grid x=-1:1:0.5,y=-1:1:0.5,z=0";

/// Focus `input` (bytes of a file) and assert that it fails with `parts` in the message, and that the folder then contains only the input.
#[track_caller]
fn refuse(name: &str, input: &[u8], parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), input).unwrap();
    let before = listing(folder.path());
    for line in [
        format!("focus {name} --out out {GRID}"),
        format!("crosscheck {name}"),
    ] {
        let ran = run(folder.path(), &line);
        ran.failed(1, parts);
        // One line that names the file, or the collection, which has the same name.
        assert_eq!(ran.stderr.lines().count(), 1, "{line}: {}", ran.stderr);
        let stem = name.split('.').next().unwrap();
        assert!(ran.stderr.contains(stem), "{line}: {}", ran.stderr);
        assert_eq!(listing(folder.path()), before, "{line} left something");
    }
}

fn with(name: &str, value: Option<Value>) -> Vec<u8> {
    let mut fields = matlab::gotcha_fields();
    match (fields.iter().position(|field| field.0 == name), value) {
        (Some(at), Some(value)) => fields[at].1 = value,
        (Some(at), None) => drop(fields.remove(at)),
        (None, _) => panic!("no field {name}"),
    }
    matlab::gotcha(fields)
}

#[test]
fn undamaged_file_is_accepted() {
    // The file that the other tests damage is valid.
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("a.mat"),
        matlab::gotcha(matlab::gotcha_fields()),
    )
    .unwrap();
    assert!(
        run(folder.path(), "info a.mat")
            .succeeded()
            .contains("3 pulses of 4 frequencies")
    );
}

#[test]
fn missing_file() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &format!("focus none.mat --out out {GRID}"))
        .failed(1, &["none.mat", "No such file"]);
    assert!(listing(folder.path()).is_empty());
}

#[test]
fn empty_file() {
    refuse("empty.mat", b"", &["empty"]);
}

#[test]
fn truncated_mat() {
    let whole = matlab::gotcha(matlab::gotcha_fields());
    for length in [
        1,
        64,
        127,
        128,
        129,
        140,
        whole.len() / 3,
        whole.len() / 2,
        whole.len() - 1,
    ] {
        refuse("cut.mat", &whole[..length], &["cut.mat: "]);
    }
}

#[test]
fn mat_without_sar_data() {
    let numbers = Value::Double(2, 2, vec![1.0, 2.0, 3.0, 4.0]);
    refuse(
        "plain.mat",
        &matlab::file(&[matlab::matrix("numbers", &numbers)]),
        &["data"],
    );
    refuse("nofreq.mat", &with("freq", None), &["freq"]);
}

#[test]
fn samples_that_are_not_numbers() {
    let mut real: Vec<f32> = (0..12).map(|i| i as f32).collect();
    real[7] = f32::NAN;
    let value = Value::Complex(4, 3, real, vec![0.0; 12]);
    // Stored by frequency within a pulse: element 7 is sample 3 of pulse 1.
    refuse(
        "nan.mat",
        &with("fp", Some(value)),
        &["sample 3 of pulse 1", "not a finite number"],
    );
}

#[test]
fn no_pulses() {
    let mut fields = matlab::gotcha_fields();
    for (name, value) in &mut fields {
        match *name {
            "fp" => *value = Value::Complex(4, 0, vec![], vec![]),
            "x" | "y" | "z" | "r0" => *value = Value::Double(1, 0, vec![]),
            _ => {}
        }
    }
    refuse("none.mat", &matlab::gotcha(fields), &["puls"]);
}

#[test]
fn other_formats() {
    refuse(
        "a.png",
        b"\x89PNG\r\n\x1a\n0000000000000000",
        &["CPHD", "GOTCHA"],
    );
    refuse("a.npy", b"\x93NUMPY\x01\x00", &["NumPy"]);
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &format!("focus . --out out {GRID}")).failed(1, &["directory"]);
    assert!(listing(folder.path()).is_empty());
}

/// A small complete CPHD file by our own writer.
fn simulated(folder: &Path) -> Vec<u8> {
    run(folder, "simulate --preset table-4-1 -o whole.cphd").succeeded();
    fs::read(folder.join("whole.cphd")).unwrap()
}

#[test]
fn cphd_cut_anywhere() {
    let folder = tempfile::tempdir().unwrap();
    let whole = simulated(folder.path());
    let cut = folder.path().join("cut.cphd");
    // All positions near the boundary of header and XML, and 40 over the whole length.
    let header_end = whole.windows(2).position(|w| w == b"\x0c\n").unwrap() + 2;
    let near = |at: usize| (at - 2)..(at + 3);
    let seams = near(header_end).chain(near(whole.len() - 2));
    let spread = (0..40).map(|i| i * whole.len() / 40);
    for length in seams.chain(spread).filter(|&length| length < whole.len()) {
        fs::write(&cut, &whole[..length]).unwrap();
        let before = listing(folder.path());
        let ran = run(folder.path(), &format!("focus cut.cphd --out out {GRID}"));
        ran.failed(1, &["cut.cphd"]);
        assert_eq!(ran.stderr.lines().count(), 1, "{length}: {}", ran.stderr);
        assert_eq!(listing(folder.path()), before, "cut at {length}");
    }
}

#[test]
fn cphd_with_samples_that_are_not_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = simulated(folder.path());
    // The last sample of the last pulse: big-endian float32 NaN in its imaginary part.
    let end = bytes.len();
    bytes[end - 4..].copy_from_slice(&f32::NAN.to_be_bytes());
    fs::write(folder.path().join("nan.cphd"), bytes).unwrap();
    let before = listing(folder.path());
    run(folder.path(), &format!("focus nan.cphd --out out {GRID}"))
        .failed(1, &["sample 255 of pulse 1039", "not a finite number"]);
    assert_eq!(listing(folder.path()), before);
}

#[test]
fn inputs_that_do_not_belong_together() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("a.mat"),
        matlab::gotcha(matlab::gotcha_fields()),
    )
    .unwrap();
    simulated(folder.path());
    run(
        folder.path(),
        &format!("focus a.mat whole.cphd --out out {GRID}"),
    )
    .failed(1, &["samples per pulse"]);
    run(
        folder.path(),
        &format!("focus a.mat --channel 1 --out out {GRID}"),
    )
    .failed(1, &["channel"]);
    run(
        folder.path(),
        &format!("focus whole.cphd --channel nowhere --out out {GRID}"),
    )
    .failed(1, &["nowhere"]);
}

#[test]
fn images_that_cannot_be_compared() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.npy"), b"not an array").unwrap();
    run(folder.path(), "compare a.npy a.npy").failed(1, &["a.npy"]);
    run(folder.path(), "compare a.npy b.npy").failed(1, &["npy"]);
}
