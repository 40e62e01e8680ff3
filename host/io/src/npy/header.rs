//! Header of a NumPy array: a Python dictionary with exactly the keys `descr`, `fortran_order` and `shape`, in any
//! order.

use std::io::{self, Read};

/// First bytes of an NPY file.
pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Header with values as written.
pub(super) struct Header {
    /// Size of the header in bytes.
    pub(super) bytes: u64,
    /// Type, such as `'<c8'`.
    pub(super) kind: String,
    /// Memory order: `False` or `True`.
    pub(super) order: String,
    /// Shape, such as `(2,3)`.
    pub(super) shape: String,
    /// Sizes of the shape, if it is valid.
    pub(super) sizes: Option<Vec<u64>>,
}

/// Reason why a header was not read.
pub(super) enum HeaderError {
    Io(io::Error),
    Unsuited(String),
}

impl Header {
    pub(super) fn read(reader: &mut impl Read) -> Result<Self, HeaderError> {
        let unsuited = |what: &str| HeaderError::Unsuited(what.to_owned());
        let mut start = Vec::new();
        take(reader, 10, &mut start)?;
        let header_bytes = match start.strip_prefix(MAGIC) {
            Some(&[1, 0, low, high]) => u16::from_le_bytes([low, high]),
            Some([1, 0, ..]) => return Err(unsuited("truncated within its header")),
            Some([major, minor, ..]) => {
                return Err(HeaderError::Unsuited(format!(
                    "expected NumPy format 1.0, as numpy.save writes a plain array, found {major}.{minor}"
                )));
            }
            _ => return Err(unsuited("not a NumPy array file (.npy)")),
        };
        let mut header = Vec::new();
        take(reader, u64::from(header_bytes), &mut header)?;
        if header.len() < usize::from(header_bytes) {
            return Err(unsuited("truncated within its header"));
        }
        let bytes = 10 + u64::from(header_bytes);
        Self::parse(bytes, &String::from_utf8_lossy(&header)).ok_or_else(|| {
            unsuited(
                "its NumPy header is damaged, or not that of a plain array: keys descr, \
                 fortran_order and shape are expected",
            )
        })
    }

    fn parse(bytes: u64, text: &str) -> Option<Self> {
        let compact: String = text
            .chars()
            .filter(|c| !c.is_whitespace())
            .map(|c| if c == '"' { '\'' } else { c })
            .collect();
        let value = |key: &str| {
            let (_, rest) = compact.split_once(&format!("'{key}':"))?;
            let end = match rest.strip_prefix('(') {
                Some(inside) => inside.find(')')? + 2,
                None if rest.starts_with('[') => rest.find(']')? + 1,
                None => rest.find([',', '}'])?,
            };
            Some(rest[..end].to_owned())
        };
        let shape = value("shape")?;
        Some(Self {
            bytes,
            kind: value("descr")?,
            order: value("fortran_order")?,
            sizes: sizes(&shape),
            shape,
        })
    }
}

fn take(reader: &mut impl Read, count: u64, bytes: &mut Vec<u8>) -> Result<(), HeaderError> {
    let read = reader.by_ref().take(count).read_to_end(bytes);
    read.map(|_| ()).map_err(HeaderError::Io)
}

fn sizes(shape: &str) -> Option<Vec<u64>> {
    let inside = shape.strip_prefix('(')?.strip_suffix(')')?;
    let sizes = inside.strip_suffix(',').unwrap_or(inside);
    if sizes.is_empty() {
        return Some(Vec::new());
    }
    sizes.split(',').map(|size| size.parse().ok()).collect()
}
