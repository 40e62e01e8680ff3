//! Numbers inside the stored values of HDF5 data sets: integers and floats of any size and byte order, and compounds of two.

use hdf5_pure::{CompoundMember, DType, Datatype, DatatypeByteOrder, FloatingPointLayout};

use crate::npy::half;

/// Real number inside a stored value.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    at: usize,
    pub(crate) bytes: usize,
    little: bool,
    pub(crate) kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    Float,
    Signed,
    Unsigned,
}

/// Whether values of a type are numbers that the library converts to float64 without help.
pub(crate) fn is_number(kind: &DType) -> bool {
    matches!(
        kind,
        DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64
    )
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
    pub(crate) fn of(datatype: &Datatype, at: usize) -> Option<Self> {
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
    pub(crate) fn number(&self, value: &[u8]) -> f64 {
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
pub(crate) fn pair(datatype: &Datatype) -> Option<[Part; 2]> {
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
