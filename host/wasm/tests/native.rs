//! The package without a browser: the same bits as by the library from files.

use std::fs;
use std::path::PathBuf;

use subaperture::monitor::Silent;
use subaperture_wasm::memory::MEMORY_BYTES;
use subaperture_wasm::recording::{Files, Recording};

use crate::input::{by_library, gotcha, request, write_cphd, write_npz};

fn open(paths: &[PathBuf]) -> Recording {
    let mut files = Files::new();
    for path in paths {
        let name = path.file_name().unwrap().to_str().unwrap();
        files.add(name, fs::read(path).unwrap()).unwrap();
    }
    files.open().unwrap()
}

#[test]
fn images_of_bytes_have_the_bits_of_images_of_files() {
    let folder = tempfile::tempdir().unwrap();
    let [cphd, npz] = ["points.cphd", "points.npz"].map(|name| folder.path().join(name));
    write_cphd(&cphd);
    write_npz(&npz);
    for path in [cphd, npz] {
        let recording = open(std::slice::from_ref(&path));
        let by_file = subaperture::open(&path).unwrap();
        for former in ["auto", "bp", "ffbp", "rdbp"] {
            for portable in [false, true] {
                let request = request(former, portable);
                let focused = recording.focus(&request, &Silent).unwrap();
                let expected = by_library(&by_file, &request);
                assert!(focused.npy().unwrap() == expected, "{former}, {portable}");
                let facts = focused.facts();
                assert!(
                    facts.predicted_error_db <= -50.0 && !facts.bound_missed,
                    "{facts:?}"
                );
            }
        }
    }
}

#[test]
fn gotcha_files_are_joined_as_by_the_library() {
    let Some(mut paths) = gotcha() else { return };
    let by_file = subaperture::open_all(&paths).unwrap();
    // The order of files does not count.
    paths.reverse();
    let recording = open(&paths);
    let summary = recording.summary().unwrap();
    assert_eq!([summary.pulses, summary.samples], [234, 424]);
    assert!((summary.carrier_hz - 9.6e9).abs() < 10e6, "{summary:?}");
    let request = request("rdbp", true);
    let focused = recording.focus(&request, &Silent).unwrap();
    assert!(focused.npy().unwrap() == by_library(&by_file, &request));
}

#[test]
fn summary_has_a_grid_that_can_be_focused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.cphd");
    write_cphd(&path);
    let recording = open(&[path]);
    let summary = recording.summary().unwrap();
    assert_eq!(summary.pulses, 1040);
    assert!((summary.bandwidth_hz - 200e6).abs() < 1.0, "{summary:?}");
    let grid = summary.grid.unwrap();
    assert!(
        grid.pixels.iter().all(|&count| (1..=500).contains(&count)),
        "{grid:?}"
    );
    let mut request = request("auto", false);
    request.grid = grid;
    let focused = recording.focus(&request, &Silent).unwrap();
    let levels = focused.levels(50.0);
    assert_eq!(levels.len(), grid.pixels[0] * grid.pixels[1]);
    // The brightest pixels are white. The picture has y upwards, the image rows of ascending y.
    let image = &focused.image.image;
    let brightest = (0..image.pixels.len())
        .max_by(|&a, &b| {
            image.pixels[a]
                .norm_sqr()
                .total_cmp(&image.pixels[b].norm_sqr())
        })
        .unwrap();
    let (row, column) = (brightest / image.columns, brightest % image.columns);
    assert_eq!(levels[(image.rows - 1 - row) * image.columns + column], 255);
    assert!(levels.iter().filter(|&&level| level < 128).count() > levels.len() / 2);
}

#[test]
fn faults_are_refused_with_a_reason() {
    let mut files = Files::new();
    let error = files
        .add("notes.txt", b"not a recording".to_vec())
        .unwrap_err();
    assert!(
        error.contains("notes.txt") && error.contains("CPHD"),
        "{error}"
    );
    let error = files.add("cut.cphd", b"CPHD/1.1.0\n".to_vec()).unwrap_err();
    assert!(error.contains("cut.cphd"), "{error}");
    let error = files.add("empty.npz", b"PK\x03\x04".to_vec()).unwrap_err();
    assert!(error.contains("empty.npz"), "{error}");
    let error = files
        .add("deep.h5", b"\x89HDF\r\n\x1a\n".to_vec())
        .unwrap_err();
    assert!(error.contains("read from files only"), "{error}");
    assert!(files.open().is_err());

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.cphd");
    write_cphd(&path);
    let mut files = Files::new();
    let bytes = fs::read(&path).unwrap();
    let held = bytes.len() as u64;
    files.add("points.cphd", bytes).unwrap();
    assert!(
        files.left_bytes() <= MEMORY_BYTES - held,
        "the file is held"
    );
    let recording = files.open().unwrap();
    let mut request = request("bp", false);
    // 8 bytes a pixel: more than the memory, and refused before it is allocated.
    request.grid.pixels = [20_000, 20_000];
    let error = recording.focus(&request, &Silent).err().unwrap();
    assert!(
        error.contains("memory") || error.contains("bytes"),
        "{error}"
    );
    request.grid.pixels = [0, 5];
    let error = recording.focus(&request, &Silent).err().unwrap();
    assert!(error.contains("grid along x"), "{error}");
}
