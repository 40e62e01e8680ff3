//! Sweeps of a vector network analyser in Touchstone files, one file for each pulse.

use std::io::Read;
use std::path::Path;

use num_complex::Complex32;

use crate::input::open_file;
use crate::npy::{Array, Values};
use crate::touchstone::{self, Parameter};
use subaperture_describe::error::ALLOW_MORE_MEMORY;

/// Memory of a file relative to its size: its bytes, text of up to three times these, and growing vectors of 24 bytes for each line of at least 6.
const MEMORY_TIMES: u64 = 16;

/// Read a scattering parameter of a file within `memory_bytes`.
fn parameter(
    path: &Path,
    ports: Option<[usize; 2]>,
    memory_bytes: u64,
) -> Result<Parameter, String> {
    let named = |error: &dyn std::fmt::Display| format!("cannot read {}: {error}", path.display());
    let file = open_file(path).map_err(|error| named(&error))?;
    let length = file.metadata().map_err(|error| named(&error))?.len();
    let needed = length.saturating_mul(MEMORY_TIMES);
    if needed > memory_bytes {
        return Err(format!(
            "{}: {needed} bytes of memory are needed, but {memory_bytes} are left: {ALLOW_MORE_MEMORY}",
            path.display()
        ));
    }
    let mut bytes = Vec::new();
    file.take(length)
        .read_to_end(&mut bytes)
        .map_err(|error| named(&error))?;
    // Comments may have any encoding.
    let text = String::from_utf8_lossy(&bytes);
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    touchstone::read(&text, touchstone::ports_of_name(&name), ports)
        .map_err(|error| format!("{}, {error}", path.display()))
}

/// Frequencies of a file, hertz, which are evenly spaced.
pub(super) fn frequencies(
    path: &Path,
    ports: Option<[usize; 2]>,
    memory_bytes: u64,
) -> Result<Array, String> {
    let found = parameter(path, ports, memory_bytes)?;
    found
        .band()
        .map_err(|message| format!("{}: {message}", path.display()))?;
    Ok(Array {
        shape: vec![found.frequencies_hz.len()],
        values: Values::Real(found.frequencies_hz),
        integer_range: None,
    })
}

/// Values of a file at the frequencies of the first file, hertz.
pub(super) fn values(
    path: &Path,
    ports: Option<[usize; 2]>,
    frequencies_hz: &[f64],
    memory_bytes: u64,
) -> Result<Array, String> {
    let found = parameter(path, ports, memory_bytes)?;
    let count = frequencies_hz.len();
    if found.values.len() != count {
        return Err(format!(
            "{}: expected {count} frequencies as in the first file, found {}",
            path.display(),
            found.values.len()
        ));
    }
    let step_hz = (frequencies_hz[count - 1] - frequencies_hz[0]) / (count - 1) as f64;
    let pairs = found.frequencies_hz.iter().zip(frequencies_hz);
    let mut others = pairs.filter(|(own, first)| (*own - *first).abs() > 0.01 * step_hz);
    if let Some((own, first)) = others.next() {
        return Err(format!(
            "{}: expected the frequencies of the first file, {first} Hz, found {own} Hz",
            path.display()
        ));
    }
    let values = found.values.iter();
    Ok(Array {
        shape: vec![count],
        values: Values::Complex(
            values
                .map(|z| Complex32::new(z.re as f32, z.im as f32))
                .collect(),
        ),
        integer_range: None,
    })
}
