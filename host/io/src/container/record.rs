//! Binary records of CPHD and CRSD parameters: positions and formats of parameters in records of 8-byte big-endian words.

use glam::DVec3;

use super::{Element, MetadataError};

/// Some thousand times the size of a record of all the standards' parameters.
const MAX_RECORD_BYTES: u64 = 1 << 20;

/// A float64.
pub(crate) const SCALAR: &str = "F8";

/// Three float64.
pub(crate) const POSITION: &str = "X=F8;Y=F8;Z=F8;";

/// Two direction cosines, along the X and the Y axis of an antenna.
pub(crate) const COSINES: &str = "DCX=F8;DCY=F8;";

/// A signed integer.
pub(crate) const INTEGER: &str = "I8";

/// Integer and fraction.
pub(crate) const WHOLE_AND_FRACTION: &str = "Int=I8;Frac=F8;";

/// A parameter's place in the record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Field {
    name: &'static str,
    byte: usize,
}

impl Field {
    /// Name of the parameter.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }
}

/// The length of a record, bytes.
pub(crate) fn record_width(num_bytes: &Element) -> Result<u64, MetadataError> {
    let bytes = num_bytes.count()?;
    if bytes == 0 || bytes % 8 != 0 || bytes > MAX_RECORD_BYTES {
        return Err(num_bytes.fault(format!(
            "{bytes} is not a positive multiple of 8 up to {MAX_RECORD_BYTES}"
        )));
    }
    Ok(bytes)
}

impl Field {
    /// Position stated by the element `node`, which must have this format and lie within a record of `record_bytes`; `stated_at` is the path of the record's
    /// size.
    pub(crate) fn parse(
        node: &Element,
        name: &'static str,
        format: &str,
        record_bytes: u64,
        stated_at: &str,
    ) -> Result<Self, MetadataError> {
        let words = match format {
            POSITION => 3,
            WHOLE_AND_FRACTION | COSINES => 2,
            _ => 1,
        };
        let found = node.child("Format")?;
        if found.text().trim_end_matches(';') != format.trim_end_matches(';') {
            return Err(found.fault(format!("expected {format}, found '{}'", found.text())));
        }
        let offset = node.child("Offset")?;
        let word = offset.count()?;
        let end = word.checked_add(words).and_then(|end| end.checked_mul(8));
        match end.and_then(|end| usize::try_from(end).ok()) {
            Some(end) if end as u64 <= record_bytes => Ok(Self {
                name,
                byte: end - words as usize * 8,
            }),
            _ => Err(offset.fault(format!(
                "word {word} lies outside the record of {record_bytes} bytes ({stated_at})"
            ))),
        }
    }
}

/// Bytes of one record.
#[derive(Clone, Copy)]
pub(crate) struct Words<'b> {
    /// Owner of the record: a vector or a pulse.
    pub(crate) kind: &'static str,
    /// Index of the record.
    pub(crate) index: u64,
    pub(crate) bytes: &'b [u8],
}

impl Words<'_> {
    /// Error about a parameter.
    pub(crate) fn fault(&self, field: Field, what: impl std::fmt::Display) -> String {
        let Self { kind, index, .. } = self;
        format!("{kind} {index}: {}: {what}; repair or drop it", field.name)
    }

    fn word(&self, byte: usize) -> [u8; 8] {
        let mut word = [0; 8];
        word.copy_from_slice(&self.bytes[byte..byte + 8]);
        word
    }

    /// Number that may be NaN or infinite.
    pub(crate) fn number(&self, field: Field) -> f64 {
        f64::from_be_bytes(self.word(field.byte))
    }

    /// All numbers of a parameter, of any kind.
    pub(crate) fn numbers<const N: usize>(&self, field: Field) -> [f64; N] {
        std::array::from_fn(|word| f64::from_be_bytes(self.word(field.byte + 8 * word)))
    }

    /// Integer.
    pub(crate) fn integer(&self, field: Field) -> i64 {
        i64::from_be_bytes(self.word(field.byte))
    }

    /// Number `word` of a parameter of several, finite.
    pub(crate) fn finite(&self, field: Field, word: usize) -> Result<f64, String> {
        let value = f64::from_be_bytes(self.word(field.byte + 8 * word));
        match value.is_finite() {
            true => Ok(value),
            false => Err(self.fault(field, format!("expected a finite number, found {value}"))),
        }
    }

    /// Three numbers.
    pub(crate) fn position(&self, field: Field) -> Result<DVec3, String> {
        Ok(DVec3::new(
            self.finite(field, 0)?,
            self.finite(field, 1)?,
            self.finite(field, 2)?,
        ))
    }

    /// A whole number and its fraction.
    pub(crate) fn whole_and_fraction(&self, field: Field) -> Result<(i64, f64), String> {
        Ok((self.integer(field), self.finite(field, 1)?))
    }
}
