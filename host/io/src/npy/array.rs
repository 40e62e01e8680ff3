//! Arrays of numbers of any type and shape, in a `.npy` file or a `.npz` archive.

use std::io::{BufReader, Read};
use std::path::Path;

use num_complex::Complex32;

use super::archive;
use super::half::half;
use super::header::{Header, HeaderError};
use super::range::Range;
use crate::input::open_file;
use subaperture_model::phase_history::ReadError;

/// Array in C order, last index fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Size of each dimension; empty for a single number.
    pub shape: Vec<usize>,
    /// Values, as many as the product of the sizes.
    pub values: Values,
    /// Smallest and largest value of an integer type; `None` for floats.
    pub integer_range: Option<[f64; 2]>,
}

/// Values of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Integers of up to 32 bits, floats of 16 to 64 bits, and wider integers that float64 represents exactly.
    Real(Vec<f64>),
    /// Complex numbers, complex128 rounded to complex64. Records of two equal numbers, real part first, also count:
    /// complex integers and half-precision complex numbers are saved in this form.
    Complex(Vec<Complex32>),
}

impl Array {
    /// Read an array from a file. `name` selects one from an archive, with or without its suffix `.npy`. At most
    /// `memory_bytes` of memory are used. Values may be NaN.
    ///
    /// # Errors
    /// [`ReadError`] if it is not an array file, has no array of that name or no numeric type, or needs more than
    /// `memory_bytes`.
    pub fn read(path: &Path, name: Option<&str>, memory_bytes: u64) -> Result<Self, ReadError> {
        let io = ReadError::io(path);
        let unsuited = |what: String| ReadError::malformed(path, what);
        let file = open_file(path).map_err(&io)?;
        let read = |stream: &mut dyn Read| {
            Self::read_from(&mut BufReader::new(stream), memory_bytes).map_err(
                |error| match error {
                    HeaderError::Io(source) => io(source),
                    HeaderError::Unsuited(what) => match name {
                        Some(name) => unsuited(format!("array {name}: {what}")),
                        None => unsuited(what),
                    },
                },
            )
        };
        let Some(name) = name else {
            return read(&mut &file);
        };
        archive::read(&file, name, read).unwrap_or_else(|what| Err(unsuited(what)))
    }

    /// As [`Self::read`], of the array `name` of an archive in memory.
    #[cfg(feature = "npz")]
    pub(crate) fn of_archive(bytes: &[u8], name: &str, memory_bytes: u64) -> Result<Self, String> {
        let read = |stream: &mut dyn Read| {
            let mut stream = BufReader::new(stream);
            Self::read_from(&mut stream, memory_bytes).map_err(|error| match error {
                HeaderError::Io(source) => source.to_string(),
                HeaderError::Unsuited(what) => format!("array {name}: {what}"),
            })
        };
        archive::read(std::io::Cursor::new(bytes), name, read)?
    }

    /// Values of a real array.
    pub fn real(&self) -> Option<&[f64]> {
        match &self.values {
            Values::Real(values) => Some(values),
            Values::Complex(_) => None,
        }
    }

    fn read_from(reader: &mut impl Read, memory_bytes: u64) -> Result<Self, HeaderError> {
        let unsuited = |what: String| HeaderError::Unsuited(what);
        let header = Header::read(reader)?;
        let kind = header.kind.trim_matches('\'').to_owned();
        let Some(element) = Element::of(&kind) else {
            return Err(unsuited(format!(
                "expected integers, floats, complex numbers, or records of two equal numbers, found type '{kind}' \
                 (real part, imaginary part), little-endian"
            )));
        };
        let (Some(sizes), "False" | "True") = (&header.sizes, header.order.as_str()) else {
            return Err(unsuited(format!(
                "expected fortran_order False or True and a shape of integers, found fortran_order {} and shape {}",
                header.order, header.shape
            )));
        };
        // Both orders are the same for an array with one axis that is longer than 1.
        let is_fortran =
            header.order == "True" && sizes.iter().filter(|&&size| size > 1).count() > 1;
        // Zero sizes are skipped, so that no partial product overflows for readers of the shape.
        let product = sizes.iter().fold(1u128, |product, &size| {
            product.saturating_mul(u128::from(size.max(1)))
        });
        if product > usize::MAX as u128 {
            return Err(unsuited(format!(
                "shape {} has more values than can be addressed",
                header.shape
            )));
        }
        let count = if sizes.contains(&0) { 0 } else { product };
        let needed = count.saturating_mul(if is_fortran { 16 } else { 8 });
        if needed > u128::from(memory_bytes) {
            let order = match is_fortran {
                true => {
                    " in Fortran order, which is converted in memory (numpy.ascontiguousarray(a) saves C order),"
                }
                false => "",
            };
            return Err(unsuited(format!(
                "{count} values{order} need {needed} bytes of memory, but {memory_bytes} are left: \
                 allow more memory"
            )));
        }
        let mut values = element.no_values();
        // Read in pieces, since the header may state more than the file contains.
        let mut bytes = vec![0; element.bytes * 4096];
        let mut left = count as usize;
        let mut range = Range::default();
        while left > 0 {
            let now = left.min(4096);
            let piece = &mut bytes[..now * element.bytes];
            reader.read_exact(piece).map_err(HeaderError::Io)?;
            for value in piece.chunks_exact(element.bytes) {
                element.push(value, &mut values, &mut range);
            }
            left -= now;
        }
        if let (Some(what), Values::Complex(_)) = (range.fault(), &values) {
            return Err(unsuited(what));
        }
        let shape: Vec<usize> = sizes.iter().map(|&size| size as usize).collect();
        if is_fortran {
            values = match values {
                Values::Real(values) => Values::Real(in_c_order(&shape, &values)),
                Values::Complex(values) => Values::Complex(in_c_order(&shape, &values)),
            };
        }
        Ok(Self {
            shape,
            values,
            integer_range: element.range(),
        })
    }
}

/// Values in C order (last index fastest) of values in Fortran order (first index fastest).
fn in_c_order<T: Copy>(shape: &[usize], values: &[T]) -> Vec<T> {
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let place = (index.iter().zip(shape))
            .rev()
            .fold(0, |place, (i, size)| place * size + i);
        ordered.push(values[place]);
        for (i, size) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < *size {
                break;
            }
            *i = 0;
        }
    }
    ordered
}

/// Type of a number.
#[derive(Clone, Copy)]
struct Element {
    kind: u8,
    bytes: usize,
    /// Record of two.
    pair: bool,
}

impl Element {
    fn of(kind: &str) -> Option<Self> {
        let Some(members) = kind
            .strip_prefix('[')
            .and_then(|rest| rest.strip_suffix(']'))
        else {
            return Self::plain(kind);
        };
        // [('re','<i2'),('im','<i2')]: names and types are between quotation marks.
        let words: Vec<&str> = members.split('\'').collect();
        let &[_, _, _, first, _, _, _, second, _] = words.as_slice() else {
            return None;
        };
        let part = Self::plain(first).filter(|part| part.kind != b'c' && first == second)?;
        Some(Self {
            bytes: 2 * part.bytes,
            pair: true,
            ..part
        })
    }

    fn plain(kind: &str) -> Option<Self> {
        let (&order, rest) = kind.as_bytes().split_first()?;
        let (&letter, size) = rest.split_first()?;
        let bytes = match size {
            b"1" => 1,
            b"2" => 2,
            b"4" => 4,
            b"8" => 8,
            b"16" => 16,
            _ => return None,
        };
        let little = order == b'<' || (order == b'|' && bytes == 1);
        let known = match letter {
            b'i' | b'u' => bytes <= 8,
            b'f' => (2..=8).contains(&bytes),
            b'c' => bytes == 8 || bytes == 16,
            _ => false,
        };
        (little && known).then_some(Self {
            kind: letter,
            bytes,
            pair: false,
        })
    }

    /// Smallest and largest integer of the type.
    fn range(self) -> Option<[f64; 2]> {
        let bytes = if self.pair {
            self.bytes / 2
        } else {
            self.bytes
        };
        let size = libm::exp2(8.0 * bytes as f64);
        match self.kind {
            b'i' => Some([-0.5 * size, 0.5 * size - 1.0]),
            b'u' => Some([0.0, size - 1.0]),
            _ => None,
        }
    }

    fn no_values(self) -> Values {
        match self.kind {
            _ if self.pair => Values::Complex(Vec::new()),
            b'c' => Values::Complex(Vec::new()),
            _ => Values::Real(Vec::new()),
        }
    }

    fn push(self, bytes: &[u8], values: &mut Values, range: &mut Range) {
        match values {
            Values::Complex(values) => {
                let (re, im) = bytes.split_at(bytes.len() / 2);
                let (re, im) = (self.real(re), self.real(im));
                range.take(&[re, im]);
                values.push(Complex32::new(re as f32, im as f32));
            }
            Values::Real(values) => values.push(self.real(bytes)),
        }
    }

    fn real(self, bytes: &[u8]) -> f64 {
        match self.kind {
            b'f' | b'c' => float(bytes),
            kind => integer(bytes, kind == b'i'),
        }
    }
}

fn float(bytes: &[u8]) -> f64 {
    match *bytes {
        [a, b] => half(u16::from_le_bytes([a, b])),
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    }
}

fn integer(bytes: &[u8], signed: bool) -> f64 {
    let fill = match bytes.last() {
        Some(&high) if signed && high >= 0x80 => 0xff,
        _ => 0,
    };
    let mut wide = [fill; 8];
    wide[..bytes.len()].copy_from_slice(bytes);
    match signed {
        true => i64::from_le_bytes(wide) as f64,
        false => u64::from_le_bytes(wide) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(data);
        file
    }

    fn read(file: &[u8]) -> Result<Array, String> {
        Array::read_from(&mut &file[..], 1000).map_err(|error| match error {
            HeaderError::Io(error) => error.to_string(),
            HeaderError::Unsuited(what) => what,
        })
    }

    #[test]
    fn all_number_types_are_read() {
        let real = |file: Vec<u8>| read(&file).unwrap().real().unwrap().to_vec();
        assert_eq!(
            real(file("<i2", "(2,)", &[0xff, 0xff, 1, 2])),
            [-1.0, 513.0]
        );
        assert_eq!(
            real(file("<u4", "(1,)", &[0xff, 0xff, 0xff, 0xff])),
            [4_294_967_295.0]
        );
        assert_eq!(real(file("|i1", "(1, 2)", &[0x80, 0x7f])), [-128.0, 127.0]);
        assert_eq!(real(file("<f4", "(1,)", &1.5f32.to_le_bytes())), [1.5]);
        assert_eq!(real(file("<f8", "()", &(-2.25f64).to_le_bytes())), [-2.25]);
        let bytes = [3f64.to_le_bytes(), (-4f64).to_le_bytes()].concat();
        let complex = read(&file("<c16", "(1,)", &bytes)).unwrap();
        assert_eq!(
            complex.values,
            Values::Complex(vec![Complex32::new(3.0, -4.0)])
        );
        assert_eq!(complex.shape, [1]);
        // Half precision; records of two integers or halves, as complex numbers of these are saved.
        assert_eq!(
            real(file("<f2", "(2,)", &[0x00, 0x3c, 0x00, 0xc0])),
            [1.0, -2.0]
        );
        for (kind, data) in [
            ("<i2", vec![3, 0, 0xfc, 0xff]),
            ("|i1", vec![3, 0xfc]),
            ("<f2", vec![0x00, 0x42, 0x00, 0xc4]),
            ("<f4", [3f32.to_le_bytes(), (-4f32).to_le_bytes()].concat()),
        ] {
            let header = format!(
                "{{'descr': [('re', '{kind}'), ('im', '{kind}')], 'fortran_order': False, 'shape': (1,), }}\n"
            );
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.as_bytes());
            bytes.extend(data);
            let read = read(&bytes).unwrap();
            assert_eq!(
                read.values,
                Values::Complex(vec![Complex32::new(3.0, -4.0)]),
                "{kind}"
            );
        }
    }

    /// `numpy.save` of `numpy.arange(6).reshape(2, 3)` and of `numpy.arange(8).reshape(2, 2, 2)` in Fortran order.
    #[test]
    fn fortran_order_becomes_c_order() {
        let fortran = |shape: &str, values: &[u8]| {
            let file = file("|u1", shape, values);
            let at = file.windows(5).position(|word| word == b"False").unwrap();
            [
                &file[..at],
                b"True",
                &file[at + 5..file.len() - values.len() - 1],
                b" \n",
                values,
            ]
            .concat()
        };
        let two = read(&fortran("(2, 3)", &[0, 3, 1, 4, 2, 5])).unwrap();
        assert_eq!(two.shape, [2, 3]);
        assert_eq!(two.real().unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let three = read(&fortran("(2, 2, 2)", &[0, 4, 2, 6, 1, 5, 3, 7])).unwrap();
        let expected: Vec<f64> = (0..8u8).map(f64::from).collect();
        assert_eq!(three.real().unwrap(), expected);
        // Twice the memory: 1000 bytes suffice for 125 values of one order, and for 62 that are converted.
        assert!(read(&fortran("(1, 125)", &[7; 125])).is_ok());
        assert!(read(&fortran("(2, 31)", &[7; 62])).is_ok());
        let error = read(&fortran("(9, 7)", &[7; 63])).unwrap_err();
        assert!(
            error.contains("Fortran order") && error.contains("1008 bytes"),
            "{error}"
        );
    }

    #[test]
    fn complex_values_outside_float32_range_are_refused() {
        for (value, part) in [
            (1e300f64, "beyond the float32 maximum"),
            (1e-300, "the largest value is 1e-300"),
        ] {
            let bytes = [0f64, 0.0, value, 0.0].map(f64::to_le_bytes).concat();
            let error = read(&file("<c16", "(2,)", &bytes)).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn unreadable_arrays_are_refused_with_a_reason() {
        for (file, part) in [
            (file(">i2", "(1,)", &[0, 0]), "type '>i2'"),
            (file("<U8", "(1,)", &[0; 32]), "expected integers"),
            (
                file("<f8", "(1000000,1000000000000)", &[]),
                "allow more memory",
            ),
            (file("<f8", "(126,)", &[]), "allow more memory"),
            (
                file("<f8", "(65536,65,6553655553655,6536,0)", &[]),
                "more values than can be addressed",
            ),
            (file("<f8", "(2,)", &[0; 15]), "failed to fill whole buffer"),
            (file("<f8", "(x,)", &[]), "shape (x,)"),
        ] {
            let error = read(&file).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
