//! Codes of a look-up table.

use std::fs;

use num_complex::{Complex32, Complex64};
use subaperture::io::recording::RecordingFile;
use subaperture::phase_history::PhaseHistory;
use subaperture_tests::numpy;
use subaperture_tests::subap::run;

use super::*;

/// Values of 16 codes of four bits in two's complement: code c >= 0 is `0.1 + 0.2 c`, code -1 - c the opposite.
fn table() -> Vec<f64> {
    let positive = (0..8).map(|c| 0.1 + 0.2 * f64::from(c));
    let negative = (0..8).rev().map(|c| -0.1 - 0.2 * f64::from(c));
    positive.chain(negative).collect()
}

fn write_table(folder: &Path, values: &[f64]) {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(
        folder.join("table.npy"),
        numpy::array("<f8", &format!("({},)", values.len()), &bytes),
    )
    .unwrap();
}

/// Code of the nearest value.
fn code(value: f64) -> i8 {
    let steps = (value.abs() / 0.2) as i8;
    let steps = steps.min(7);
    if value < 0.0 { -1 - steps } else { steps }
}

/// Records of two codes, of signed or unsigned bytes.
fn coded(values: &[Complex64], encode: impl Fn(i8) -> u8) -> Vec<u8> {
    let parts = values.iter().flat_map(|z| [z.re, z.im]);
    parts.map(|value| encode(code(value))).collect()
}

fn write_codes(folder: &Path, kind: &str, bytes: &[u8]) {
    let members = format!("[('re', '{kind}'), ('im', '{kind}')]");
    let header = format!(
        "{{'descr': {members}, 'fortran_order': False, 'shape': ({}, {SAMPLES}), }}\n",
        bytes.len() / 2 / SAMPLES
    );
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(bytes);
    fs::write(folder.join("echoes.npy"), file).unwrap();
}

fn history(folder: &Path) -> Vec<Complex32> {
    let history = RecordingFile::read(&folder.join("rail.toml"))
        .unwrap()
        .history(u64::MAX)
        .unwrap();
    let collection = history.collection();
    let count = collection.pulses.len();
    let mut samples = vec![Complex32::ZERO; count * collection.num_samples];
    history.read(0..count, &mut samples).unwrap();
    samples
}

/// Signed, unsigned and 16-bit codes give the history of the values that the table has for them.
#[test]
fn codes_become_values_of_the_table() {
    let values = samples(|_, z| 0.6 * z);
    let entries = table();
    let quantised: Vec<Complex64> = values
        .iter()
        .map(|z| {
            let value = |part: f64| entries[code(part).rem_euclid(16) as usize];
            Complex64::new(value(z.re), value(z.im))
        })
        .collect();
    let folder = recorded(&quantised, "");
    let at = folder.path();
    let expected = history(at);
    let text = description(&format!(
        "{NPY}\ntimes = \"times.npy\"\ntable = \"table.npy\""
    ));
    fs::write(at.join("rail.toml"), text).unwrap();
    write_table(at, &entries);
    let nibble = |code: i8| code as u8 & 15;
    let wide = |bytes: Vec<u8>| {
        bytes
            .into_iter()
            .flat_map(|b| (b as i8 as i16).to_le_bytes())
            .collect::<Vec<u8>>()
    };
    write_codes(at, "|i1", &coded(&values, |code| code as u8));
    assert_eq!(history(at), expected);
    write_codes(at, "|u1", &coded(&values, nibble));
    assert_eq!(history(at), expected);
    let bytes = wide(coded(&values, |code| code as u8));
    fs::write(at.join("echoes.bin"), bytes).unwrap();
    let binary = "format = \"dca1000\"\norder = \"iqiq\"\nfile = \"echoes.bin\"\nsamples = 128\ntimes = \"times.npy\"\ntable = \"table.npy\"";
    fs::write(at.join("rail.toml"), description(binary)).unwrap();
    assert_eq!(history(at), expected);
    run(at, "info rail.toml").succeeded();
}

/// The value of code 9 is NaN: a sample with it in one part is 0 in both parts.
#[test]
fn invalid_code_becomes_zero() {
    let values = samples(|_, z| 0.6 * z);
    let zeroed: Vec<Complex64> = values
        .iter()
        .map(
            |z| match [z.re, z.im].map(|part| code(part).rem_euclid(16)) {
                [9, _] | [_, 9] => Complex64::ZERO,
                codes => {
                    let [re, im] = codes.map(|code| table()[code as usize]);
                    Complex64::new(re, im)
                }
            },
        )
        .collect();
    assert!(zeroed.iter().filter(|z| **z == Complex64::ZERO).count() > 100);
    let folder = recorded(&zeroed, "");
    let at = folder.path();
    let expected = history(at);
    let mut entries = table();
    entries[9] = f64::NAN;
    write_table(at, &entries);
    let text = description(&format!(
        "{NPY}\ntimes = \"times.npy\"\ntable = \"table.npy\""
    ));
    fs::write(at.join("rail.toml"), text).unwrap();
    write_codes(at, "|i1", &coded(&values, |code| code as u8));
    assert_eq!(history(at), expected);
}

#[test]
fn codes_outside_the_table_are_refused_with_their_place() {
    let values = samples(|_, z| 0.6 * z);
    let folder = recorded(&values, "table = \"table.npy\"");
    let at = folder.path();
    write_table(at, &table());
    run(at, "info rail.toml").failed(
        1,
        &[
            "expected codes of 8 or 16 bits",
            "file = \"echoes.npy\"",
            "^",
        ],
    );
    let mut codes = coded(&values, |code| code as u8);
    codes[2 * (5 * SAMPLES + 9)] = 16;
    write_codes(at, "|i1", &codes);
    run(at, "info rail.toml").failed(
        1,
        &[
            "the code 16 + j ",
            "at index [5, 9] has no entry in the table of 16 values",
            "^",
        ],
    );
    fs::write(
        at.join("table.npy"),
        numpy::array("<f8", "(2, 1)", &[0; 16]),
    )
    .unwrap();
    run(at, "info rail.toml").failed(
        1,
        &[
            "expected a row of real numbers, the values of codes",
            "table = \"table.npy\"",
            "^",
        ],
    );
}
