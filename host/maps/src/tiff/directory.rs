//! Image file directories, all of them before the data that they speak of.

/// What a field holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    /// Text, to which a zero is added.
    Text(String),
    /// 16-bit numbers.
    Short(Vec<u16>),
    /// 32-bit numbers.
    Long(Vec<u32>),
    /// Places in the file: of 32 or 64 bits, as the file has them.
    Offsets(Vec<u64>),
    /// Float64.
    Double(Vec<f64>),
}

/// A directory: fields by tag, ascending.
#[derive(Clone, Debug, Default)]
pub(crate) struct Directory {
    fields: std::collections::BTreeMap<u16, Value>,
}

impl Directory {
    pub(crate) fn set(&mut self, tag: u16, value: Value) {
        self.fields.insert(tag, value);
    }
}

/// A file's head: its directories, one after another.
#[derive(Clone, Debug)]
pub(crate) struct File {
    /// Whether offsets are of 64 bits.
    pub(crate) big: bool,
    /// What stands between the header and the first directory.
    pub(crate) note: Vec<u8>,
    pub(crate) directories: Vec<Directory>,
}

impl File {
    /// All of it, as bytes. Its length depends on the fields' lengths alone, not on what offsets there are.
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

/// Directories and what they point at begin at even places.
fn align(out: &mut Vec<u8>) {
    out.resize(out.len().next_multiple_of(8), 0);
}
