//! Image file directories (IFD), all before the image data.

/// Value of a field.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// ASCII; a terminating zero is appended.
    Text(String),
    /// `SHORT`.
    Short(Vec<u16>),
    /// `LONG`.
    Long(Vec<u32>),
    /// File offsets: 32 bits, or 64 bits in BigTIFF.
    Offsets(Vec<u64>),
    /// `DOUBLE`.
    Double(Vec<f64>),
}

/// Image file directory: fields in ascending order of tags.
#[derive(Clone, Debug, Default)]
pub(crate) struct Directory {
    fields: std::collections::BTreeMap<u16, Value>,
}

impl Directory {
    pub(crate) fn set(&mut self, tag: u16, value: Value) {
        self.fields.insert(tag, value);
    }
}

/// Head of a file: header and all directories.
#[derive(Clone, Debug)]
pub(crate) struct File {
    /// Whether the file is BigTIFF (64-bit offsets).
    pub(crate) big: bool,
    /// Bytes between header and first directory.
    pub(crate) note: Vec<u8>,
    pub(crate) directories: Vec<Directory>,
}

impl File {
    /// Encode. The length depends on the lengths of the fields alone, not on the offsets.
    pub(crate) fn head(&self) -> Vec<u8> {
        let mut out = b"II".to_vec();
        match self.big {
            true => out.extend([43, 0, 8, 0, 0, 0]),
            false => out.extend([42, 0]),
        }
        let mut link = out.len();
        self.place(&mut out, 0);
        out.extend(&self.note);
        for directory in &self.directories {
            align(&mut out);
            let here = out.len() as u64;
            self.overwrite(&mut out, link, here);
            match self.big {
                true => out.extend((directory.fields.len() as u64).to_le_bytes()),
                false => out.extend((directory.fields.len() as u16).to_le_bytes()),
            }
            let mut long = Vec::new();
            for (&tag, value) in &directory.fields {
                let (kind, count, bytes) = self.encoded(value);
                out.extend(tag.to_le_bytes());
                out.extend(kind.to_le_bytes());
                self.place(&mut out, count);
                let room = if self.big { 8 } else { 4 };
                if bytes.len() <= room {
                    let at = out.len();
                    out.extend(bytes);
                    out.resize(at + room, 0);
                } else {
                    long.push((out.len(), bytes));
                    self.place(&mut out, 0);
                }
            }
            link = out.len();
            self.place(&mut out, 0);
            for (at, bytes) in long {
                align(&mut out);
                let here = out.len() as u64;
                self.overwrite(&mut out, at, here);
                out.extend(bytes);
            }
        }
        align(&mut out);
        out
    }

    fn place(&self, out: &mut Vec<u8>, value: u64) {
        match self.big {
            true => out.extend(value.to_le_bytes()),
            false => out.extend((value as u32).to_le_bytes()),
        }
    }

    fn overwrite(&self, out: &mut [u8], at: usize, value: u64) {
        match self.big {
            true => out[at..at + 8].copy_from_slice(&value.to_le_bytes()),
            false => out[at..at + 4].copy_from_slice(&(value as u32).to_le_bytes()),
        }
    }

    /// A field's type, count and bytes.
    fn encoded(&self, value: &Value) -> (u16, u64, Vec<u8>) {
        match value {
            Value::Text(text) => {
                let mut bytes = text.clone().into_bytes();
                bytes.push(0);
                (2, bytes.len() as u64, bytes)
            }
            Value::Short(of) => (
                3,
                of.len() as u64,
                of.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ),
            Value::Long(of) => (
                4,
                of.len() as u64,
                of.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ),
            Value::Double(of) => (
                12,
                of.len() as u64,
                of.iter().flat_map(|x| x.to_le_bytes()).collect(),
            ),
            Value::Offsets(of) => {
                let mut bytes = Vec::with_capacity(of.len() * 8);
                of.iter().for_each(|&x| self.place(&mut bytes, x));
                (if self.big { 16 } else { 4 }, of.len() as u64, bytes)
            }
        }
    }
}

/// Pad to a multiple of 8: directories and field values are aligned.
fn align(out: &mut Vec<u8>) {
    out.resize(out.len().next_multiple_of(8), 0);
}
