//! Data sets of the root group of an HDF5 file, read as arrays.
//!
//! Read: integers; floats of 16, 32 and 64 bits in either byte order; complex numbers as compounds of two equal
//! numbers, real part first (h5py writes them as floats, satellite products as half-precision floats or integers).
//! Contiguous or chunked, compressed (gzip, shuffle, LZF) or not, by the crate `hdf5-pure`.

use std::path::Path;

use hdf5_pure::{
    CompoundMember, DType, Dataset, Datatype, DatatypeByteOrder, Error, File, FloatingPointLayout,
};
use num_complex::Complex32;

use crate::npy::{Array, Range, Values, half};

/// Bytes of a data set read at a time.
const PIECE_BYTES: u64 = 1 << 20;

/// Open HDF5 file.
pub(super) struct Hdf5(File);

impl Hdf5 {
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let file = File::open_streaming(path);
        file.map(Self)
            .map_err(|error| format!("unreadable HDF5 file: {error}"))
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
            DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64 => Values::Real(set.read_f64().map_err(named)?),
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
        })
    }
}

fn unsuited(name: &str, kind: &DType) -> String {
    format!(
        "data set {name}: expected integers, floats, or compounds of two equal numbers (complex), found {kind}"
    )
}

/// Real number inside a stored value.
#[derive(Clone, Copy)]
struct Part {
    at: usize,
    bytes: usize,
    little: bool,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
}

/// IEEE 754 half precision.
const HALF: FloatingPointLayout = FloatingPointLayout {
    bit_offset: 0,
    bit_precision: 16,
    exponent_location: 10,
    exponent_size: 5,
    mantissa_location: 0,
    mantissa_size: 10,
    exponent_bias: 15,
};

impl Part {
    /// Number of type `datatype` at byte `at`. `None` if it is not a supported number.
    fn of(datatype: &Datatype, at: usize) -> Option<Self> {
        let (size, order, kind) = match datatype {
            Datatype::FloatingPoint {
                size,
                byte_order,
                layout,
            } => {
                let known = match size {
                    2 => *layout == HALF,
                    4 => *layout == FloatingPointLayout::IEEE754_BINARY32,
                    8 => *layout == FloatingPointLayout::IEEE754_BINARY64,
                    _ => false,
                };
                (known.then_some(*size)?, byte_order, Kind::Float)
            }
            Datatype::FixedPoint {
                size,
                byte_order,
                layout,
            } => {
                let whole = u32::from(layout.bit_precision) == 8 * size && layout.bit_offset == 0;
                let kind = if layout.signed {
                    Kind::Signed
                } else {
                    Kind::Unsigned
                };
                (
                    (whole && matches!(size, 1 | 2 | 4 | 8)).then_some(*size)?,
                    byte_order,
                    kind,
                )
            }
            _ => return None,
        };
        Some(Self {
            at,
            bytes: size as usize,
            little: match order {
                DatatypeByteOrder::LittleEndian => true,
                DatatypeByteOrder::BigEndian => false,
                _ => return None,
            },
            kind,
        })
    }

    /// Decode the number from a stored value. NaN if the value is truncated.
    fn number(&self, value: &[u8]) -> f64 {
        let mut own = [0; 8];
        let Some(bytes) = value.get(self.at..self.at + self.bytes) else {
            return f64::NAN;
        };
        own[..self.bytes].copy_from_slice(bytes);
        if !self.little {
            own[..self.bytes].reverse();
        }
        let whole = u64::from_le_bytes(own);
        match (self.kind, self.bytes) {
            (Kind::Float, 2) => half(whole as u16),
            (Kind::Float, 4) => f64::from(f32::from_bits(whole as u32)),
            (Kind::Float, _) => f64::from_bits(whole),
            (Kind::Unsigned, _) => whole as f64,
            (Kind::Signed, bytes) => {
                let unused = 64 - 8 * bytes;
                ((whole << unused) as i64 >> unused) as f64
            }
        }
    }
}

/// Real and imaginary part of a compound of two equal numbers.
fn pair(datatype: &Datatype) -> Option<[Part; 2]> {
    let Datatype::Compound { size, members } = datatype else {
        return None;
    };
    let [first, second] = members.as_slice() else {
        return None;
    };
    let part = |member: &CompoundMember| {
        let at = usize::try_from(member.byte_offset).ok()?;
        Part::of(&member.datatype, at)
            .filter(|part| at.saturating_add(part.bytes) <= *size as usize)
    };
    let (first, second) = (part(first)?, part(second)?);
    let alike = first.kind == second.kind && first.bytes == second.bytes;
    alike.then_some([first, second])
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
