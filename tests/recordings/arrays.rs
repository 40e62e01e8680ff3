//! Phase history as arrays: files by NumPy and h5py, and every invalid one. Python is that of `SUBAPERTURE_PYTHON`, or `python3`.

use std::ffi::OsStr;
use std::path::Path;

use num_complex::Complex32;
use subaperture::focus::exact::Exact;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::io::open::{self, Options};
use subaperture::phase_history::PhaseHistory;
use subaperture::prelude::*;
use subaperture_tests::numpy::{array, stored};

pub(crate) fn python(script: &str, folder: &Path) {
    python_with(script, folder, &[]);
}

/// Run a script with the folder and further arguments.
pub(crate) fn python_with(script: &str, folder: &Path, arguments: &[&str]) {
    let arguments = arguments.iter().map(OsStr::new);
    subaperture_tests::python::script(script, std::iter::once(folder.as_os_str()).chain(arguments));
}

/// Pixels at the three points of the script.
fn at_points(history: &dyn PhaseHistory) -> [Complex32; 3] {
    [(0.0, 0.0), (6.0, -3.5), (-4.0, 5.0)].map(|(x, y)| {
        let grid: ImageGrid = format!("x={x}:{}:1,y={y}:{}:1", x + 0.5, y + 0.5)
            .parse()
            .unwrap();
        Exact.focus(history, &grid).unwrap().image.pixels[0]
    })
}

#[test]
fn files_of_numpy_and_h5py_are_read_by_the_schema() {
    let folder = tempfile::tempdir().unwrap();
    python("arrays_write.py", folder.path());
    let read = |name: &str| open::open(&folder.path().join(name), &Options::default()).unwrap();
    for name in [
        "plain.npz",
        "packed.npz",
        "double.npz",
        "plain.h5",
        "packed.h5",
        "lzf.h5",
        "big.h5",
        "half.npz",
        "half.h5",
        "integer.npz",
        "integer.h5",
        "integer_big.h5",
    ] {
        let history = read(name);
        let unit = if name.starts_with("integer") {
            1e4
        } else {
            1.0
        };
        let collection = history.collection();
        assert_eq!(
            (collection.pulses.len(), collection.num_samples),
            (96, 80),
            "{name}"
        );
        // Side lobes of the other points at 320 MHz and 3.4 degrees: below 0.1 each at some 10 m.
        let wanted = [
            Complex32::new(1.0, 0.0),
            Complex32::new(0.0, 0.7),
            Complex32::new(-0.4, 0.0),
        ];
        for (found, wanted) in at_points(&*history).into_iter().zip(wanted) {
            assert!(
                (found / unit - wanted).norm() < 0.1,
                "{name}: {found} and not {wanted}"
            );
        }
        assert_eq!(collection.timed, name == "double.npz");
        assert_eq!(history.inputs().unwrap().len(), 1);
    }
    let double = read("double.npz");
    assert!(matches!(
        double.collection().frame,
        SceneFrame::Earth { .. }
    ));
    assert_eq!(double.collection().extent.unwrap().y_m, (-7.0, 7.0));

    let path = folder.path().join("channels.npz");
    let channels = open::open_channels::<&str>(&path, None, &Options::default()).unwrap();
    assert_eq!(channels.len(), 2);
    let second = Options {
        channel: Some("2"),
        ..Options::default()
    };
    let second = open::open(&path, &second).unwrap();
    let pulse = second.collection().pulses[5];
    assert_eq!(
        (pulse.receiver_m - pulse.transmitter_m).to_array(),
        [0.0, 0.0, 40.0]
    );
    let found = at_points(&*second)[0];
    assert!((found - Complex32::new(1.0, 0.0)).norm() < 0.1, "{found}");
    let sum = open::open_sum::<_, &str>(&[&path], None, &Options::default()).unwrap();
    assert_eq!(sum.collection().pulses.len(), 2 * 96);
}

/// Arrays by name: kind, shape, values.
type Arrays = Vec<(&'static str, &'static str, &'static str, Vec<f64>)>;

fn sound() -> Arrays {
    let antenna = (0..3).flat_map(|n| [f64::from(n), -500.0, 300.0]).collect();
    vec![
        (
            "samples",
            "<c16",
            "(3, 2)",
            (0..12).map(f64::from).collect(),
        ),
        ("frequency_hz", "<f8", "(2,)", vec![1e9, 1.01e9]),
        ("antenna_m", "<f8", "(3, 3)", antenna),
        ("sign", "<f8", "()", vec![-1.0]),
        ("reference_path_m", "<f8", "()", vec![0.0]),
    ]
}

fn message(arrays: &Arrays) -> String {
    let files: Vec<(String, Vec<u8>)> = arrays
        .iter()
        .map(|(name, kind, shape, values)| {
            let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (format!("{name}.npy"), array(kind, shape, &data))
        })
        .collect();
    let members: Vec<(&str, &[u8])> = files
        .iter()
        .map(|(name, data)| (name.as_str(), data.as_slice()))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mine.npz");
    std::fs::write(&path, stored(&members)).unwrap();
    match open::open(&path, &Options::default()) {
        Ok(_) => "read".to_owned(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn invalid_arrays_are_named() {
    assert_eq!(message(&sound()), "read");
    let with = |name: &'static str, kind: &'static str, shape: &'static str, values: Vec<f64>| {
        let mut arrays = sound();
        arrays.retain(|array| array.0 != name);
        arrays.push((name, kind, shape, values));
        message(&arrays)
    };
    let without = |name: &str| {
        let mut arrays = sound();
        arrays.retain(|array| array.0 != name);
        message(&arrays)
    };
    for (found, parts) in [
        (without("samples"), ["not a phase history", "'samples'"]),
        (
            without("antenna_m"),
            [
                "antenna positions are missing",
                "'transmitter_m' and 'receiver_m'",
            ],
        ),
        (without("frequency_hz"), ["'start_hz'", "missing"]),
        (
            with("antena_m", "<f8", "(3, 3)", vec![0.0; 9]),
            ["found 'antena_m': correct its name", "antenna_m"],
        ),
        (
            with("samples", "<f8", "(3, 2)", vec![0.0; 6]),
            ["array 'samples': expected complex", "found real"],
        ),
        (
            with("samples", "<c16", "(6,)", vec![0.0; 12]),
            [
                "array 'samples': expected shape pulses x frequencies",
                "found (6)",
            ],
        ),
        (
            with("samples", "<c16", "(3, 2)", vec![f64::NAN; 12]),
            ["sample 0 of pulse 0", "not a finite number"],
        ),
        (
            with("antenna_m", "<f8", "(4, 3)", vec![0.0; 12]),
            ["array 'antenna_m': expected shape", "found (4, 3)"],
        ),
        (
            with("antenna_m", "<f8", "(3, 3)", vec![f64::INFINITY; 9]),
            ["array 'antenna_m': expected finite", "index 0"],
        ),
        (
            with("receiver_m", "<f8", "(3, 3)", vec![0.0; 9]),
            ["both 'antenna_m' and", "remove one"],
        ),
        (
            with("frequency_hz", "<f8", "(2,)", vec![1.0, 1.1]),
            ["array 'frequency_hz': expected hertz", "GHz"],
        ),
        (
            with("step_hz", "<f8", "(1,)", vec![1e6]),
            ["both 'frequency_hz' and", "remove one"],
        ),
        (
            with("sign", "<f8", "(1,)", vec![2.0]),
            ["array 'sign'", "-1 or 1"],
        ),
        (
            with("time_s", "<f8", "(3,)", vec![0.0, 2.0, 1.0]),
            [
                "array 'time_s': pulse 2 is earlier",
                "sort the pulses by time",
            ],
        ),
        (
            without("sign"),
            ["the phase convention is not stated", "give 'sign', -1 or 1"],
        ),
        (
            without("reference_path_m"),
            [
                "the phase convention is not stated",
                "give 'reference_path_m' (0 for raw echoes)",
            ],
        ),
        (
            with("extent_m", "<f8", "(4,)", vec![1.0, 0.0, 0.0, 1.0]),
            ["array 'extent_m'", "minimum and maximum x"],
        ),
        (
            with("origin_deg_m", "<f8", "(3,)", vec![147.0, 0.0, 0.0]),
            ["array 'origin_deg_m'", "latitude"],
        ),
    ] {
        assert!(
            parts.iter().all(|part| found.contains(part)),
            "{found}: not {parts:?}"
        );
    }
    assert_eq!(with("_mine", "<f8", "(1,)", vec![2.0]), "read");
}

#[test]
fn claimed_size_beyond_memory_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.npz");
    // A header that claims 32 GB.
    std::fs::write(
        &path,
        stored(&[("samples.npy", &array("<c8", "(65536, 65536)", &[]))]),
    )
    .unwrap();
    let options = Options {
        memory_bytes: 1 << 20,
        ..Options::default()
    };
    let error = open::open(&path, &options).err().unwrap().to_string();
    assert!(error.contains("allow more memory"), "{error}");
}
