//! MATLAB level 5 files (`.mat` of MATLAB 5 to 7.2): variables, numeric arrays, structures.
//!
//! Layout after MathWorks, "MAT-File Format", chapter 1: a header of 128 bytes, then data elements,
//! each a tag (type, size) and its bytes, padded to 8. A variable is a `miMATRIX` element, or one
//! packed by zlib in a `miCOMPRESSED` element; a structure's fields are `miMATRIX` elements in turn.
//!
//! Arrays are views of the file's bytes. A packed variable is unpacked into memory of its stated size, at most the
//! memory allowed and [`MAX_UNPACKING`] times the file size. Nested structures are parsed on demand, so depth takes
//! no stack. Only little-endian files are read.
//!
//! (Other crates: `matrw` 0.1.4 requests 4 GiB and aborts if one byte of a structure's header is flipped; `matfile`
//! skips structures silently; `mat5` refuses them.)

use std::borrow::Cow;
use std::io::Read;

use flate2::read::ZlibDecoder;

use super::input::MATLAB_MAGIC;

/// Maximum ratio of unpacked to packed size. Radar samples compress to a tenth at best; zlib's maximum of 1000 occurs
/// only in hostile files.
const MAX_UNPACKING: u64 = 32;

const HEADER_BYTES: usize = 128;
const MI_INT8: u32 = 1;
const MI_INT32: u32 = 5;
const MI_UINT32: u32 = 6;
const MI_MATRIX: u32 = 14;
const MI_COMPRESSED: u32 = 15;
const MI_UTF8: u32 = 16;

/// Reason why a file is not read.
#[derive(Debug, PartialEq)]
pub(super) enum MatError {
    /// Description of the fault and its position.
    Malformed(String),
    /// Memory needed in bytes, more than allowed.
    Memory(u64),
}

type Result<T> = std::result::Result<T, MatError>;

fn fail<T>(what: impl Into<String>) -> Result<T> {
    Err(MatError::Malformed(what.into()))
}

/// Tagged range of bytes.
#[derive(Clone, Copy)]
struct Element<'a> {
    kind: u32,
    data: &'a [u8],
}

/// Iterator over the elements of `bytes` from `at`.
struct Elements<'a, 'o> {
    bytes: &'a [u8],
    at: usize,
    /// Owner of the elements, for messages.
    owner: &'o str,
}

impl<'a> Elements<'a, '_> {
    fn next(&mut self) -> Result<Option<Element<'a>>> {
        let (start, left) = (self.at, &self.bytes[self.at..]);
        if left.is_empty() {
            return Ok(None);
        }
        let Some((tag, rest)) = left.split_first_chunk::<8>() else {
            return self.truncated(start, 8, left.len());
        };
        let word = u32_le(tag, 0);
        // A small element stores up to four bytes within its tag, with the size in the upper half.
        let (kind, data, length) = if word >> 16 != 0 {
            let size = (word >> 16) as usize;
            if size > 4 {
                return fail(format!(
                    "{}: small element at byte {start}: expected at most 4 bytes, found {size}",
                    self.owner
                ));
            }
            (word & 0xffff, &left[4..4 + size], 8)
        } else {
            let size = u32_le(tag, 4) as usize;
            let Some(data) = rest.get(..size) else {
                return self.truncated(start, size, rest.len());
            };
            let padded = if word == MI_COMPRESSED {
                size
            } else {
                size.next_multiple_of(8)
            };
            (word, data, 8 + padded.min(rest.len()))
        };
        self.at += length;
        Ok(Some(Element { kind, data }))
    }

    /// Next element, which must exist and have one of the types `kinds`.
    fn expect(&mut self, kinds: &[u32], what: &str) -> Result<Element<'a>> {
        let at = self.at;
        match self.next()? {
            Some(element) if kinds.contains(&element.kind) => Ok(element),
            Some(element) => fail(format!(
                "{}: expected {what} at byte {at}, found an element of type {}",
                self.owner, element.kind
            )),
            None => fail(format!("{}: ends before its {what}", self.owner)),
        }
    }

    fn truncated<T>(&self, at: usize, needed: usize, left: usize) -> Result<T> {
        fail(format!(
            "{}: truncated: the element at byte {at} needs {needed} bytes and {left} are left; \
             copy or download the file again",
            self.owner
        ))
    }
}

fn u32_le(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Numbers as stored. MATLAB may store an array in a smaller type than its class.
#[derive(Clone, Copy)]
pub(super) struct Numbers<'a> {
    kind: u32,
    width: usize,
    bytes: &'a [u8],
}

impl<'a> Numbers<'a> {
    fn new(element: Element<'a>, owner: &str) -> Result<Self> {
        let width = match element.kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            9 | 12 | 13 => 8,
            kind => return fail(format!("{owner}: elements of type {kind} are not numbers")),
        };
        let Element { kind, data: bytes } = element;
        if bytes.len() % width != 0 {
            return fail(format!(
                "{owner}: expected a multiple of {width} bytes, found {}",
                bytes.len()
            ));
        }
        Ok(Self { kind, width, bytes })
    }

    pub(super) fn len(&self) -> usize {
        self.bytes.len() / self.width
    }

    /// Values in MATLAB's order, first index fastest.
    pub(super) fn iter(self) -> impl Iterator<Item = f64> + 'a {
        self.bytes.chunks_exact(self.width).map(move |b| {
            let four = || [b[0], b[1], b[2], b[3]];
            let eight = || [b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]];
            match self.kind {
                1 => f64::from(b[0] as i8),
                2 => f64::from(b[0]),
                3 => f64::from(i16::from_le_bytes([b[0], b[1]])),
                4 => f64::from(u16::from_le_bytes([b[0], b[1]])),
                5 => f64::from(i32::from_le_bytes(four())),
                6 => f64::from(u32::from_le_bytes(four())),
                7 => f64::from(f32::from_le_bytes(four())),
                9 => f64::from_le_bytes(eight()),
                12 => i64::from_le_bytes(eight()) as f64,
                _ => u64::from_le_bytes(eight()) as f64,
            }
        })
    }
}

/// Content of an array.
pub(super) enum Content<'a> {
    /// `rows * columns * ...` values, and as many imaginary parts if complex.
    Numeric {
        /// Real parts.
        real: Numbers<'a>,
        /// Imaginary parts.
        imaginary: Option<Numbers<'a>>,
    },
    /// 1 x 1 structure: names and packed arrays.
    Structure(Vec<(String, &'a [u8])>),
    /// Text, cells, objects, sparse and structure arrays, which are not read.
    Other,
}

/// MATLAB array with its header.
pub(super) struct Array<'a> {
    /// Name of the array; empty for fields of a structure.
    pub(super) name: String,
    /// Dimensions, at least two.
    pub(super) dimensions: Vec<usize>,
    class: u8,
    /// Content of the array.
    pub(super) content: Content<'a>,
}

impl<'a> Array<'a> {
    /// Parse the content of a `miMATRIX` element; `owner` names it in messages. An empty element is an empty numeric
    /// array, as in MATLAB.
    pub(super) fn parse(bytes: &'a [u8], owner: &str) -> Result<Self> {
        let mut elements = Elements {
            bytes,
            at: 0,
            owner,
        };
        if bytes.is_empty() {
            let nothing = Numbers {
                kind: 9,
                width: 8,
                bytes,
            };
            return Ok(Self {
                name: String::new(),
                dimensions: vec![0, 0],
                class: 6,
                content: Content::Numeric {
                    real: nothing,
                    imaginary: None,
                },
            });
        }
        let (mut array, complex) = Self::header(&mut elements)?;
        array.content = match array.class {
            2 => array.structure(&mut elements)?,
            6..=15 => array.numbers(&mut elements, complex)?,
            _ => Content::Other,
        };
        Ok(array)
    }

    /// Parse flags, dimensions and name. The content remains `Other`. The flag is true for complex arrays.
    fn header(elements: &mut Elements<'a, '_>) -> Result<(Self, bool)> {
        let owner = elements.owner;
        let flags = elements.expect(&[MI_UINT32], "array flags")?;
        if flags.data.len() != 8 {
            return fail(format!("{owner}: its array flags are not 8 bytes"));
        }
        let (class, complex) = (flags.data[0], flags.data[1] & 0x08 != 0);
        let sizes = elements.expect(&[MI_INT32], "dimensions")?;
        if sizes.data.len() < 8 || sizes.data.len() > 32 * 4 || sizes.data.len() % 4 != 0 {
            return fail(format!("{owner}: needs 2 to 32 dimensions of 4 bytes each"));
        }
        let mut dimensions = Vec::new();
        for size in sizes.data.chunks_exact(4) {
            let size = i32::from_le_bytes([size[0], size[1], size[2], size[3]]);
            dimensions.push(usize::try_from(size).map_err(|_| {
                MatError::Malformed(format!("{owner}: dimension {size} is negative"))
            })?);
        }
        let name = elements.expect(&[MI_INT8, MI_UTF8], "name")?;
        if name.data.len() > 255 {
            return fail(format!("{owner}: a name of more than 255 characters"));
        }
        let array = Self {
            name: printable(name.data),
            dimensions,
            class,
            content: Content::Other,
        };
        Ok((array, complex))
    }

    /// Number of values. `None` on overflow.
    fn count(&self) -> Option<usize> {
        self.dimensions
            .iter()
            .try_fold(1usize, |n, &d| n.checked_mul(d))
    }

    fn numbers(&self, elements: &mut Elements<'a, '_>, complex: bool) -> Result<Content<'a>> {
        let owner = elements.owner;
        let any: Vec<u32> = (1..=13).collect();
        let mut part = |what: &str| {
            let numbers = Numbers::new(elements.expect(&any, what)?, owner)?;
            if Some(numbers.len()) != self.count() {
                return fail(format!(
                    "{owner}: expected {} values, but its {what} has {}",
                    self.describe_shape(),
                    numbers.len()
                ));
            }
            Ok(numbers)
        };
        let real = part("real part")?;
        let imaginary = complex.then(|| part("imaginary part")).transpose()?;
        Ok(Content::Numeric { real, imaginary })
    }

    fn structure(&self, elements: &mut Elements<'a, '_>) -> Result<Content<'a>> {
        let owner = elements.owner;
        let length = elements.expect(&[MI_INT32], "field name length")?;
        let names = elements.expect(&[MI_INT8], "field names")?;
        let length = match length.data {
            &[a, b, c, d] => u32::from_le_bytes([a, b, c, d]) as usize,
            _ => 0,
        };
        if !(1..=256).contains(&length) || names.data.len() % length != 0 {
            return fail(format!(
                "{owner}: {} bytes of field names do not divide by a name's length {length}",
                names.data.len()
            ));
        }
        if self.count() != Some(1) {
            return Ok(Content::Other);
        }
        let mut fields = Vec::new();
        for name in names.data.chunks_exact(length) {
            let name = printable(name);
            let value = elements.expect(&[MI_MATRIX], &format!("field '{name}'"))?;
            fields.push((name, value.data));
        }
        Ok(Content::Structure(fields))
    }

    /// Text such as `424 x 117`.
    pub(super) fn describe_shape(&self) -> String {
        let sizes: Vec<String> = self.dimensions.iter().map(usize::to_string).collect();
        sizes.join(" x ")
    }

    /// Text such as `424 x 117 single`.
    pub(super) fn describe(&self) -> String {
        let class = match self.class {
            1 => "cell array",
            2 => "structure",
            3 => "object",
            4 => "text",
            5 => "sparse",
            6 => "double",
            7 => "single",
            8..=15 => "integer",
            _ => "of unknown class",
        };
        format!("{} {class}", self.describe_shape())
    }
}

/// Bytes up to the first zero as text, with unprintable characters replaced.
fn printable(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end])
        .chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}

/// Bytes of the variable `name`, for [`Array::parse`], or a description of every variable of the file if it is
/// missing. The file, a packed variable and a copy of it may take `memory_bytes` together.
pub(super) fn find_variable<'a>(
    file: &'a [u8],
    name: &str,
    memory_bytes: u64,
) -> Result<std::result::Result<Cow<'a, [u8]>, Vec<String>>> {
    if file.len() < HEADER_BYTES || !file.starts_with(MATLAB_MAGIC) {
        return fail(format!(
            "not a MATLAB 5 file: {} bytes without its header of {HEADER_BYTES}",
            file.len()
        ));
    }
    match &file[126..128] {
        b"IM" => {}
        b"MI" => {
            return fail(
                "written by a big-endian machine; load it in MATLAB and save it again with -v7",
            );
        }
        _ => return fail("header: expected the byte order mark IM or MI"),
    }
    let mut elements = Elements {
        bytes: file,
        at: HEADER_BYTES,
        owner: "file",
    };
    let mut others = Vec::new();
    loop {
        let at = elements.at;
        let Some(element) = elements.next()? else {
            return Ok(Err(others));
        };
        let bytes = match element.kind {
            MI_MATRIX => Cow::Borrowed(element.data),
            MI_COMPRESSED => Cow::Owned(unpack(element.data, file.len(), memory_bytes, at)?),
            // Subsystem data and the like.
            _ => continue,
        };
        let owner = format!("variable at byte {at}");
        let array = {
            let mut inside = Elements {
                bytes: &bytes,
                at: 0,
                owner: &owner,
            };
            Array::header(&mut inside)?.0
        };
        if array.name == name {
            return Ok(Ok(bytes));
        }
        // Limited for readability.
        if others.len() < 20 {
            others.push(format!("'{}' ({})", array.name, array.describe()));
        }
    }
}

/// Unpack a `miCOMPRESSED` element and return the content of its `miMATRIX` element.
fn unpack(packed: &[u8], file_bytes: usize, memory_bytes: u64, at: usize) -> Result<Vec<u8>> {
    let broken = |what: &str| MatError::Malformed(format!("packed variable at byte {at}: {what}"));
    let mut decoder = ZlibDecoder::new(packed);
    let mut tag = [0; 8];
    decoder
        .read_exact(&mut tag)
        .map_err(|_| broken("does not unpack; the file is damaged"))?;
    let (kind, size) = (u32_le(&tag, 0), u64::from(u32_le(&tag, 4)));
    if kind != MI_MATRIX {
        return Err(broken("holds no array"));
    }
    if size > file_bytes as u64 * MAX_UNPACKING {
        return Err(broken(&format!(
            "claims {size} bytes in a file of {file_bytes}; more than {MAX_UNPACKING} times is \
             refused, so save it again without compression (-v6) if that is right"
        )));
    }
    // Includes a copy, since the numbers are converted while it is in memory.
    let needed = file_bytes as u64 + 2 * size;
    if needed > memory_bytes {
        return Err(MatError::Memory(needed));
    }
    // One byte more than stated, so that the end of the stream is reached and its checksum verified.
    let mut bytes = Vec::new();
    bytes
        .try_reserve_exact(size as usize + 1)
        .map_err(|_| MatError::Memory(needed))?;
    decoder
        .take(size + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| broken(&format!("does not unpack ({e}); the file is damaged")))?;
    if bytes.len() as u64 != size {
        return Err(broken(&format!(
            "does not unpack to the stated {size} bytes; the file is damaged"
        )));
    }
    Ok(bytes)
}
