//! Phase history as arrays, in NumPy archives and in HDF5.

use hdf5_pure::FileBuilder;
use subaperture::io::open::{Options, open};

use super::MEMORY_BYTES;
use super::recordings::{agree_in_memory, examine};
use super::scratch::with_files;
use crate::numpy::{array, stored};

pub(super) const WORDS: &[&str] = &[
    "samples",
    "frequency_hz",
    "start_hz",
    "step_hz",
    "antenna_m",
    "transmitter_m",
    "receiver_m",
    "sign",
    "reference_m",
    "reference_path_m",
    "time_s",
    "origin_deg_m",
    "extent_m",
    ".npy",
    "HDF",
    "OHDR",
    "TREE",
    "SNOD",
    "HEAP",
    "GCOL",
];

const PULSES: usize = 4;
const FREQUENCIES: usize = 6;

/// Geometry of an aircraft 5 km away: arrays with names and shapes.
fn numbers() -> Vec<(&'static str, Vec<usize>, Vec<f64>)> {
    let antenna = (0..PULSES).flat_map(|n| [12.0 * n as f64 - 30.0, -4000.0, 3000.0]);
    let times = (0..PULSES).map(|n| 0.1 * n as f64);
    vec![
        ("start_hz", vec![1], vec![9.6e9]),
        ("step_hz", vec![PULSES], vec![2e6; PULSES]),
        ("antenna_m", vec![PULSES, 3], antenna.collect()),
        ("time_s", vec![PULSES], times.collect()),
        ("sign", vec![1], vec![1.0]),
        ("reference_m", vec![3], vec![0.0; 3]),
        ("extent_m", vec![4], vec![-20.0, 20.0, -15.0, 15.0]),
        ("origin_deg_m", vec![3], vec![47.0, 8.5, 400.0]),
    ]
}

fn samples() -> Vec<(f32, f32)> {
    let phases = (0..PULSES * FREQUENCIES).map(|i| i as f32);
    phases.map(|phase| (phase.cos(), phase.sin())).collect()
}

fn archive() -> Vec<u8> {
    let echoes: Vec<u8> = samples()
        .iter()
        .flat_map(|(re, im)| [re.to_le_bytes(), im.to_le_bytes()].concat())
        .collect();
    let shape = format!("({PULSES}, {FREQUENCIES})");
    let mut members = vec![("samples.npy".to_owned(), array("<c8", &shape, &echoes))];
    for (name, shape, values) in numbers() {
        let sizes: Vec<String> = shape.iter().map(|size| format!("{size},")).collect();
        let data: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        members.push((
            format!("{name}.npy"),
            array("<f8", &format!("({})", sizes.concat()), &data),
        ));
    }
    let named: Vec<(&str, &[u8])> = members
        .iter()
        .map(|(name, data)| (name.as_str(), data.as_slice()))
        .collect();
    stored(&named)
}

fn hdf5(packed: bool) -> Vec<u8> {
    let mut file = FileBuilder::new();
    let set = file.create_dataset("samples");
    set.with_compound_values(&samples())
        .expect("a compound")
        .with_shape(&[PULSES as u64, FREQUENCIES as u64]);
    if packed {
        set.with_chunks(&[2, 3]).with_shuffle().with_deflate(4);
    }
    for (name, shape, values) in numbers() {
        let sizes: Vec<u64> = shape.iter().map(|&size| size as u64).collect();
        file.create_dataset(name)
            .with_f64_data(&values)
            .with_shape(&sizes);
    }
    file.finish().expect("a file in memory")
}

pub(super) fn seeds() -> Vec<Vec<u8>> {
    vec![archive(), hdf5(false), hdf5(true)]
}

pub(super) fn read(bytes: &[u8]) -> String {
    with_files(&[("input", bytes)], |folder| {
        let options = Options {
            memory_bytes: MEMORY_BYTES,
            ..Options::default()
        };
        let path = folder.join("input");
        match open(&path, &options) {
            Ok(history) => {
                // HDF5 is read from files only.
                if bytes.starts_with(b"PK") {
                    agree_in_memory(&path, bytes, &*history);
                }
                examine(&*history, bytes)
            }
            Err(error) => error.to_string(),
        }
    })
}
