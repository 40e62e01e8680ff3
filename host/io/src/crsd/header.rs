//! Header of a CRSD file: kind, version and blocks.

use crate::container::{Block, Blocks, Lines, Source, lines};
use subaperture_model::phase_history::ReadError;

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Transmitted pulses and their echoes.
    Sar,
    /// Transmitted pulses alone.
    Transmit,
    /// Received signal without the transmitted pulses.
    Receive,
}

impl Kind {
    /// Kind of this root element or header line.
    pub(super) fn of(name: &str) -> Option<Self> {
        match name {
            "CRSDsar" => Some(Self::Sar),
            "CRSDtx" => Some(Self::Transmit),
            "CRSDrcv" => Some(Self::Receive),
            _ => None,
        }
    }

    /// Refuse a file that cannot be imaged.
    pub(super) fn check(self) -> Result<(), String> {
        match self {
            Self::Sar => Ok(()),
            Self::Transmit => Err(
                "CRSDtx contains no echoes: use the CRSDsar of the same collection"
                    .to_owned(),
            ),
            Self::Receive => Err(
                "CRSDrcv does not contain the transmitted pulses: use the CRSDsar of the same collection"
                    .to_owned(),
            ),
        }
    }
}

/// Header values of a `CRSDsar` that a reader needs.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) version: String,
    pub(super) ppp: Block,
    pub(super) blocks: Blocks,
}

impl Header {
    /// Read the header and check that every block it names lies within the file.
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        lines::read(source, Self::parse)
    }

    /// Parse the first `bytes` of a file of `file_len`.
    fn parse(bytes: &[u8], file_len: u64) -> Result<Self, String> {
        let lines = Lines::of(bytes, file_len, "CRSD", "CRSDsar/1.0")?;
        let (name, version) = lines.first.split_once('/').unwrap_or((lines.first, ""));
        let version = version.trim();
        let kind = Kind::of(name).ok_or_else(|| {
            format!("byte 0: expected CRSDsar, CRSDtx or CRSDrcv, found '{name}': CRSD versions before 1 are not supported")
        })?;
        if !(version == "1.0" || version.starts_with("1.0.")) {
            return Err(format!("byte 0: expected version 1.0, found '{version}'"));
        }
        kind.check()?;
        // The support block is not read, but must lie within the file.
        lines.block("SUPPORT")?;
        Ok(Self {
            version: version.to_owned(),
            ppp: lines.block("PPP")?,
            blocks: lines.blocks()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REST: &str = "/1.0\nXML_BLOCK_SIZE := 4\nXML_BLOCK_BYTE_OFFSET := 400\nSUPPORT_BLOCK_SIZE := 8\nSUPPORT_BLOCK_BYTE_OFFSET := 406\n\
        PPP_BLOCK_SIZE := 8\nPPP_BLOCK_BYTE_OFFSET := 414\nPVP_BLOCK_SIZE := 8\nPVP_BLOCK_BYTE_OFFSET := 422\nSIGNAL_BLOCK_SIZE := 8\n\
        SIGNAL_BLOCK_BYTE_OFFSET := 430\nCLASSIFICATION := U\nRELEASE_INFO := U\n\x0c\n";

    #[test]
    fn crsdtx_and_crsdrcv_are_refused() {
        let parse = |name: &str, len| Header::parse(format!("{name}{REST}").as_bytes(), len);
        let header = parse("CRSDsar", 438).unwrap();
        assert_eq!(
            (header.version.as_str(), header.blocks.signal.offset),
            ("1.0", 430)
        );
        assert!(parse("CRSDsar", 437).unwrap_err().contains("cut short"));
        for (name, word) in [
            ("CRSDtx", "no echoes"),
            ("CRSDrcv", "the transmitted pulses"),
            ("CRSD", "before 1"),
            ("CPHD", "start of a CRSD file"),
        ] {
            let told = parse(name, 438).unwrap_err();
            assert!(told.contains(word), "{name}: {told}");
        }
    }
}
