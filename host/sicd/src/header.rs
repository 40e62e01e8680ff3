//! Parser of NITF 2.1 headers: the fields needed to find image segments and XML.

/// Sample format of a SICD (`PixelType`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Samples {
    Float32,
    Int16,
    AmplitudePhase,
}

/// File offsets and lengths of a segment, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    pub(crate) header: u64,
    pub(crate) header_bytes: u64,
    pub(crate) data: u64,
    pub(crate) data_bytes: u64,
}

/// Segments listed in a file header.
#[derive(Clone, Debug, Default)]
pub(crate) struct FileHeader {
    pub(crate) images: Vec<Segment>,
    pub(crate) extensions: Vec<Segment>,
}

/// Reader of consecutive fixed-width fields.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Fields<'a> {
    fn take(&mut self, width: usize) -> Result<&'a str, String> {
        let end = self.at + width;
        let field = self.bytes.get(self.at..end);
        let field = field.ok_or_else(|| {
            format!(
                "the header ends at byte {} within a field",
                self.bytes.len()
            )
        })?;
        let at = std::mem::replace(&mut self.at, end);
        std::str::from_utf8(field).map_err(|_| format!("header field at byte {at}: expected text"))
    }

    fn skip(&mut self, width: usize) -> Result<(), String> {
        self.at += width;
        match self.at <= self.bytes.len() {
            true => Ok(()),
            false => Err(format!(
                "the header ends at byte {} within a field",
                self.bytes.len()
            )),
        }
    }

    fn number(&mut self, width: usize) -> Result<u64, String> {
        let at = self.at;
        let text = self.take(width)?;
        let number = text
            .bytes()
            .all(|b| b.is_ascii_digit())
            .then(|| text.parse().ok());
        number
            .flatten()
            .ok_or_else(|| format!("header field at byte {at}: expected a number, found '{text}'"))
    }

    fn count(&mut self, width: usize) -> Result<usize, String> {
        Ok(usize::try_from(self.number(width)?).expect("less than 2^32"))
    }
}

/// Offset of the header length field, bytes.
const BEFORE_LENGTH: usize = 354;

impl FileHeader {
    /// Header length, bytes, from the beginning of a header.
    pub(crate) fn bytes(start: &[u8]) -> Result<u64, String> {
        if !(start.starts_with(b"NITF02.10") || start.starts_with(b"NSIF01.00")) {
            return Err("expected NITF 2.1 or NSIF 1.0, found another file format".to_owned());
        }
        let mut fields = Fields {
            bytes: start,
            at: BEFORE_LENGTH,
        };
        fields.number(6)
    }

    pub(crate) fn parse(header: &[u8]) -> Result<Self, String> {
        let mut fields = Fields {
            bytes: header,
            at: BEFORE_LENGTH + 6,
        };
        let mut at = header.len() as u64;
        // Widths of header and data length fields of images, graphics, texts, extensions. A reserved count stands between graphics and texts.
        let mut lists = [const { Vec::new() }; 4];
        for (list, [head, data]) in lists.iter_mut().zip([[6, 10], [4, 6], [4, 5], [4, 9]]) {
            if head == 4 && data == 5 {
                fields.skip(3)?;
            }
            for _ in 0..fields.count(3)? {
                let (header_bytes, data_bytes) = (fields.number(head)?, fields.number(data)?);
                list.push(Segment {
                    header: at,
                    header_bytes,
                    data: at + header_bytes,
                    data_bytes,
                });
                // At most 999 lengths of ten digits: no overflow of 64 bits.
                at += header_bytes + data_bytes;
            }
        }
        let [images, _, _, extensions] = lists;
        Ok(Self { images, extensions })
    }
}

/// Size, sample format and blocking of an image segment.
#[derive(Clone, Debug)]
pub(crate) struct Layout {
    pub(crate) name: String,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    /// `PVTYPE`.
    pub(crate) kind: String,
    pub(crate) bands: usize,
    /// `IMODE`.
    pub(crate) mode: String,
    /// Number of blocks per row and per column.
    pub(crate) blocks: [usize; 2],
    /// Columns and rows of a block; 0: those of the image.
    pub(crate) block: [usize; 2],
    pub(crate) bits: u64,
}

impl Layout {
    pub(crate) fn parse(header: &[u8]) -> Result<Self, String> {
        let mut fields = Fields {
            bytes: header,
            at: 0,
        };
        if fields.take(2)? != "IM" {
            return Err("expected an image header (IM)".to_owned());
        }
        let name = fields.take(10)?.trim().to_owned();
        // Date, target, title, security, encryption, source.
        fields.skip(14 + 17 + 80 + 167 + 1 + 42)?;
        let (rows, columns) = (fields.count(8)?, fields.count(8)?);
        let kind = fields.take(3)?.trim().to_owned();
        fields.skip(8 + 8 + 2 + 1)?;
        if fields.take(1)? != " " {
            fields.skip(60)?;
        }
        let comments = fields.count(1)?;
        fields.skip(80 * comments)?;
        let compression = fields.take(2)?.to_owned();
        if compression != "NC" {
            return Err(format!(
                "expected uncompressed samples (IC NC), found IC {compression}"
            ));
        }
        let bands = fields.count(1)?;
        for _ in 0..bands {
            fields.skip(2 + 6 + 1 + 3)?;
            let tables = fields.count(1)?;
            if tables > 0 {
                let entries = fields.count(5)?;
                fields.skip(tables * entries)?;
            }
        }
        fields.skip(1)?;
        let mode = fields.take(1)?.to_owned();
        let blocks = [fields.count(4)?, fields.count(4)?];
        let block = [fields.count(4)?, fields.count(4)?];
        Ok(Self {
            name,
            rows,
            columns,
            kind,
            bands,
            mode,
            blocks,
            block,
            bits: fields.number(2)?,
        })
    }
}

/// Size and sample format of a SICD image segment.
#[derive(Clone, Debug)]
pub(crate) struct ImageHeader {
    pub(crate) name: String,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) samples: Samples,
}

impl ImageHeader {
    pub(crate) fn parse(header: &[u8]) -> Result<Self, String> {
        let layout = Layout::parse(header)?;
        if layout.bands != 2 {
            return Err(format!(
                "expected 2 bands of a complex image, found {}",
                layout.bands
            ));
        }
        if layout.mode != "P" || layout.blocks != [1, 1] {
            return Err(format!(
                "expected one block interleaved by pixel (IMODE P), found IMODE {} with {} x {} blocks",
                layout.mode, layout.blocks[0], layout.blocks[1]
            ));
        }
        let samples = match (layout.kind.as_str(), layout.bits) {
            ("R", 32) => Samples::Float32,
            ("SI", 16) => Samples::Int16,
            ("INT", 8) => Samples::AmplitudePhase,
            (kind, bits) => {
                return Err(format!(
                    "expected SICD samples (R 32, SI 16 or INT 8), found {kind} of {bits} bits"
                ));
            }
        };
        Ok(Self {
            name: layout.name,
            rows: layout.rows,
            columns: layout.columns,
            samples,
        })
    }

    /// Check the segment's data length.
    pub(crate) fn check(&self, data_bytes: u64) -> Result<(), String> {
        let each = match self.samples {
            Samples::Float32 => 8,
            Samples::Int16 => 4,
            Samples::AmplitudePhase => 2u64,
        };
        // Eight digits each: no overflow of 64 bits.
        let expected = self.rows as u64 * self.columns as u64 * each;
        match expected == data_bytes {
            true => Ok(()),
            false => Err(format!(
                "{} rows of {} columns: expected {expected} bytes, found {data_bytes}",
                self.rows, self.columns
            )),
        }
    }
}
