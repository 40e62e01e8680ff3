//! Data sets of the root group of an HDF5 file, read as arrays.
//!
//! Read: integers; floats of 16, 32 and 64 bits in either byte order; complex numbers as compounds of two equal
//! numbers, real part first (h5py writes them as floats, satellite products as half-precision floats or integers).
//! Contiguous or chunked, compressed (gzip, shuffle, LZF) or not, by the crate `hdf5-pure`.

use std::path::Path;

use hdf5_pure::{DType, Dataset, Error, File};
use num_complex::Complex32;

use crate::hdf5_numbers::{Part, is_number, pair};
use crate::npy::{Array, Range, Values};
use crate::remote;

/// Bytes of a data set read at a time.
const PIECE_BYTES: u64 = 1 << 20;

/// Open HDF5 file.
pub(super) struct Hdf5(File);

impl Hdf5 {
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        remote::hdf5(path).map(Self)
    }

    /// Names of the data sets.
    pub(super) fn names(&self) -> Result<Vec<String>, String> {
        let names = self.0.root().datasets();
        names.map_err(|error| format!("HDF5 root group: {error}"))
    }

    /// Read a data set with at most `memory_bytes` of memory.
    pub(super) fn array(&self, name: &str, memory_bytes: u64) -> Result<Array, String> {
        let named = |error: Error| format!("data set {name}: {error}");
        let set = self.0.dataset(name).map_err(named)?;
        let shape = set.shape().map_err(named)?;
        let count = shape
            .iter()
            .try_fold(1u64, |product, &size| product.checked_mul(size.max(1)))
            .and_then(|product| usize::try_from(product).ok())
            .ok_or_else(|| {
                format!("data set {name}: shape {shape:?} has more values than can be addressed")
            })?;
        let count = if shape.contains(&0) { 0 } else { count };
        let needed = 8 * count as u128;
        if needed > u128::from(memory_bytes) {
            return Err(format!(
                "data set {name}: {count} values need {needed} bytes of memory, but {memory_bytes} are left: allow more memory"
            ));
        }
        let kind = set.dtype().map_err(named)?;
        let values = match &kind {
            DType::Compound(_) => match pair(&set.datatype().map_err(named)?) {
                Some(parts) => {
                    let mut range = Range::default();
                    let mut values = Vec::new();
                    rows(&set, &shape, |value| {
                        let [re, im] = [0, 1].map(|i| parts[i].number(value));
                        range.take(&[re, im]);
                        values.push(Complex32::new(re as f32, im as f32));
                    })
                    .map_err(named)?;
                    if let Some(what) = range.fault() {
                        return Err(format!("data set {name}: {what}"));
                    }
                    Values::Complex(values)
                }
                None => return Err(unsuited(name, &kind)),
            },
            DType::Other(_) => match Part::of(&set.datatype().map_err(named)?, 0) {
                Some(part) => {
                    let mut values = Vec::new();
                    rows(&set, &shape, |value| values.push(part.number(value))).map_err(named)?;
                    Values::Real(values)
                }
                None => return Err(unsuited(name, &kind)),
            },
            kind if is_number(kind) => Values::Real(set.read_f64().map_err(named)?),
            _ => return Err(unsuited(name, &kind)),
        };
        let held = match &values {
            Values::Real(values) => values.len(),
            Values::Complex(values) => values.len(),
        };
        if held != count {
            return Err(format!(
                "data set {name}: expected {count} values of shape {shape:?}, found {held}"
            ));
        }
        Ok(Array {
            shape: shape.iter().map(|&size| size as usize).collect(),
            values,
            integer_range: None,
        })
    }
}

fn unsuited(name: &str, kind: &DType) -> String {
    format!(
        "data set {name}: expected integers, floats, or compounds of two equal numbers (complex), found {kind}"
    )
}

/// Pass the bytes of every value to `take`, a few rows at a time.
fn rows(set: &Dataset, shape: &[u64], mut take: impl FnMut(&[u8])) -> Result<(), Error> {
    let size = set.datatype()?.type_size();
    let rows = shape.first().copied().unwrap_or(1);
    let row_bytes = shape
        .iter()
        .skip(1)
        .fold(u64::from(size), |bytes, &size| bytes.saturating_mul(size));
    let at_once = (PIECE_BYTES / row_bytes.max(1)).max(1);
    let mut row = 0;
    while row < rows {
        let now = at_once.min(rows - row);
        let bytes = set.read_raw_rows(row, now)?;
        bytes
            .chunks_exact((size as usize).max(1))
            .for_each(&mut take);
        row += now;
    }
    Ok(())
}
