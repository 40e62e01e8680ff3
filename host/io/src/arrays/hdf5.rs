//! Data sets of the root group of an HDF5 file, as arrays.
//!
//! Integers, float32 and float64 of either byte order, and complex numbers as h5py writes them: a compound of two floats. Chunked and compressed
//! (gzip, shuffle, LZF) or not, by the crate `hdf5-pure`.

use std::path::Path;

use hdf5_pure::{CompoundField, CompoundMember, DType, Dataset, Datatype, Error, File};
use num_complex::Complex32;

use crate::npy::{Array, Values};

/// Bytes of a data set that are read at a time.
const PIECE_BYTES: u64 = 1 << 20;

/// An open file.
pub(super) struct Hdf5(File);

impl Hdf5 {
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let file = File::open_streaming(path);
        file.map(Self)
            .map_err(|error| format!("not an HDF5 file that can be read: {error}"))
    }

    /// The data sets there are.
    pub(super) fn names(&self) -> Result<Vec<String>, String> {
        let names = self.0.root().datasets();
        names.map_err(|error| format!("its root group cannot be read: {error}"))
    }

    /// A data set, of which no more than `memory_bytes` is held.
    pub(super) fn array(&self, name: &str, memory_bytes: u64) -> Result<Array, String> {
        let told = |error: Error| format!("data set {name}: {error}");
        let set = self.0.dataset(name).map_err(told)?;
        let shape = set.shape().map_err(told)?;
        let count = shape
            .iter()
            .try_fold(1u64, |product, &size| product.checked_mul(size.max(1)))
            .and_then(|product| usize::try_from(product).ok())
            .ok_or_else(|| {
                format!("data set {name} has shape {shape:?}: no machine holds so many values")
            })?;
        let count = if shape.contains(&0) { 0 } else { count };
        let needed = 8 * count as u128;
        if needed > u128::from(memory_bytes) {
            return Err(format!(
                "data set {name}: its {count} values need {needed} bytes of memory and {memory_bytes} are left: allow more memory"
            ));
        }
        let kind = set.dtype().map_err(told)?;
        let values = match &kind {
            DType::Compound(parts) => match parts.as_slice() {
                [(_, DType::F32), (_, DType::F32)] => {
                    Values::Complex(complex::<f32>(&set, &shape).map_err(told)?)
                }
                [(_, DType::F64), (_, DType::F64)] => {
                    Values::Complex(complex::<f64>(&set, &shape).map_err(told)?)
                }
                _ => return Err(unsuited(name, &kind)),
            },
            DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64 => Values::Real(set.read_f64().map_err(told)?),
            _ => return Err(unsuited(name, &kind)),
        };
        let held = match &values {
            Values::Real(values) => values.len(),
            Values::Complex(values) => values.len(),
        };
        if held != count {
            return Err(format!(
                "data set {name} has {held} values and shape {shape:?}"
            ));
        }
        Ok(Array {
            shape: shape.iter().map(|&size| size as usize).collect(),
            values,
        })
    }
}

fn unsuited(name: &str, kind: &DType) -> String {
    format!(
        "data set {name} holds {kind}; numbers are expected: integers, floats, or complex numbers as compounds of two floats"
    )
}

/// Complex numbers, real part first, some rows at a time.
fn complex<T: CompoundField + Into<f64>>(
    set: &Dataset,
    shape: &[u64],
) -> Result<Vec<Complex32>, Error> {
    let Datatype::Compound { size, members } = set.datatype()? else {
        return Ok(Vec::new());
    };
    let rows = shape.first().copied().unwrap_or(1);
    let row_bytes = shape
        .iter()
        .skip(1)
        .fold(u64::from(size), |bytes, &size| bytes.saturating_mul(size));
    let at_once = (PIECE_BYTES / row_bytes.max(1)).max(1);
    let mut values = Vec::new();
    let mut row = 0;
    while row < rows {
        let now = at_once.min(rows - row);
        let bytes = set.read_raw_rows(row, now)?;
        for value in bytes.chunks_exact((size as usize).max(1)) {
            let part = |i: usize| {
                let member: &CompoundMember = &members[i];
                // What lies outside is refused by whoever decodes it: it is not of its type's length.
                let at = usize::try_from(member.byte_offset).unwrap_or(usize::MAX);
                let own = value.get(at..).unwrap_or_default();
                let own = &own[..own.len().min(member.datatype.type_size() as usize)];
                T::decode_field(&member.datatype, own).map(|part| part.into() as f32)
            };
            values.push(Complex32::new(part(0)?, part(1)?));
        }
        row += now;
    }
    Ok(values)
}
