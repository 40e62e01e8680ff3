//! NITF 2.1 and NSIF 1.0 (MIL-STD-2500C): headers, segments, XML and windows of uncompressed pixels.

use num_complex::Complex32;

use super::{Block, Source};
use subaperture_model::image::{Image, PixelBlock};
use subaperture_model::phase_history::ReadError;

/// Largest XML that is read, bytes.
pub const MAX_XML_BYTES: u64 = 16 << 20;

/// Bytes of a file header up to its list of image segments.
const START_BYTES: u64 = 363;
/// Offset of `ICAT` in an image header, bytes.
const CATEGORY_OFFSET: u64 = 360;
/// Bytes of an extension in which the standard's name is searched.
const SEARCHED_BYTES: u64 = 1000;

/// An open NITF file.
#[derive(Debug)]
pub struct NitfFile {
    source: Source,
    /// Image segments of the file, in order.
    pub images: Vec<Segment>,
    /// Data extension segments of the file, in order.
    pub extensions: Vec<Segment>,
}

impl NitfFile {
    /// Read the file header.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if it is not NITF 2.1 or NSIF 1.0, or truncated; [`ReadError::Io`].
    pub fn read(source: Source) -> Result<Self, ReadError> {
        let start = source.bytes(0, START_BYTES, "the file header")?;
        let header_bytes = FileHeader::bytes(&start).map_err(|what| source.malformed(what))?;
        let header = source.bytes(0, header_bytes, "the file header")?;
        let FileHeader { images, extensions } =
            FileHeader::parse(&header).map_err(|what| source.malformed(what))?;
        Ok(Self {
            source,
            images,
            extensions,
        })
    }

    /// File that holds the segments.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Identifier of an image segment (`IID1`), with trailing spaces.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the header is truncated; [`ReadError::Io`].
    pub fn name(&self, image: &Segment) -> Result<String, ReadError> {
        let size = image.header.size.min(12);
        let start = (self.source).bytes(image.header.offset, size, "an image header")?;
        let name = start.get(2..).unwrap_or_default();
        Ok(String::from_utf8_lossy(name).into_owned())
    }

    /// Category of an image segment (`ICAT`), such as `SAR`, or `LEG` for a legend.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the header is truncated; [`ReadError::Io`].
    pub fn category(&self, image: &Segment) -> Result<String, ReadError> {
        let offset = image.header.offset + CATEGORY_OFFSET;
        let field = self.source.bytes(offset, 8, "an image header")?;
        Ok(String::from_utf8_lossy(&field).trim().to_owned())
    }

    /// Layout of an image segment, from its header.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the header is truncated or invalid, or the samples are compressed; [`ReadError::Io`].
    pub fn layout(&self, image: &Segment) -> Result<Layout, ReadError> {
        let Block { offset, size } = image.header;
        let header = self.source.bytes(offset, size, "an image header")?;
        Layout::parse(&header).map_err(|what| self.fault(image, &what))
    }

    /// Error about the header of an image segment.
    pub fn fault(&self, image: &Segment, what: &str) -> ReadError {
        self.source.malformed(format!(
            "image header at byte {}: {what}",
            image.header.offset
        ))
    }

    /// Check that the data of a segment lie within the file.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if they do not.
    pub fn check(&self, segment: &Segment) -> Result<(), ReadError> {
        let Block { offset, size } = segment.data;
        self.source.check_range(offset, size, "a segment")
    }

    /// Read the XML of the first extension whose beginning contains `standard`. It takes at most `memory_bytes` once parsed.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file has no such segment, or it is truncated, longer than [`MAX_XML_BYTES`] or not UTF-8; [`ReadError::Memory`]; [`ReadError::Io`].
    pub fn xml(&self, standard: &str, memory_bytes: u64) -> Result<String, ReadError> {
        for Segment { data, .. } in &self.extensions {
            let searched = data.size.min(SEARCHED_BYTES);
            let begins = self.source.bytes(data.offset, searched, "an extension")?;
            if !String::from_utf8_lossy(&begins).contains(standard) {
                continue;
            }
            if data.size > MAX_XML_BYTES {
                return Err(self.source.malformed(format!(
                    "expected XML of at most {MAX_XML_BYTES} bytes, found {}: the file is damaged",
                    data.size
                )));
            }
            return self.source.xml(*data, memory_bytes);
        }
        Err(self
            .source
            .malformed(format!("expected {standard} XML, found another NITF file")))
    }

    /// Reader of the pixels of an image of `size` rows and columns in segments.
    pub fn into_pixels(
        self,
        size: (usize, usize),
        pixel_bytes: usize,
        segments: Vec<PixelSegment>,
    ) -> Pixels {
        Pixels {
            source: self.source,
            size,
            pixel_bytes,
            segments,
        }
    }
}

/// Image segment in uncompressed blocks, row by row of blocks.
#[derive(Clone, Copy, Debug)]
pub struct PixelSegment {
    /// First row of the segment in the image.
    pub first_row: usize,
    /// Columns of a block.
    pub block_columns: usize,
    /// Rows of a block.
    pub block_rows: usize,
    /// Blocks per row of blocks.
    pub blocks_per_row: usize,
    /// File offset of the first block, bytes.
    pub offset: u64,
}

/// Pixels of an image, read by windows.
#[derive(Debug)]
pub struct Pixels {
    source: Source,
    /// Rows and columns of the image.
    size: (usize, usize),
    pixel_bytes: usize,
    segments: Vec<PixelSegment>,
}

impl Pixels {
    /// File that holds the image.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Rows and columns of the image.
    pub fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Read a window; `decode` converts the bytes of one pixel.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the file was shortened; [`ReadError::Io`].
    pub fn read(
        &self,
        [rows, columns]: &PixelBlock,
        decode: impl Fn(&[u8]) -> Complex32,
    ) -> Result<Image, ReadError> {
        let mut pixels = Vec::with_capacity(rows.len() * columns.len());
        let mut line = Vec::new();
        for row in rows.clone() {
            let n = self.segments.partition_point(|s| s.first_row <= row) - 1;
            let PixelSegment {
                first_row,
                block_columns: wide,
                block_rows: high,
                blocks_per_row,
                offset,
            } = self.segments[n];
            let (block_row, own_row) = ((row - first_row) / high, (row - first_row) % high);
            for block in columns.start / wide..columns.end.div_ceil(wide) {
                let from = columns.start.max(block * wide);
                let to = columns.end.min((block + 1) * wide);
                let index = (block_row * blocks_per_row + block) as u64;
                let pixel =
                    index * (wide * high) as u64 + (own_row * wide + from - block * wide) as u64;
                line.resize((to - from) * self.pixel_bytes, 0);
                self.source
                    .read_at(offset + pixel * self.pixel_bytes as u64, &mut line)?;
                pixels.extend(line.chunks_exact(self.pixel_bytes).map(&decode));
            }
        }
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels,
        })
    }
}

/// Header and data of a segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Header of the segment.
    pub header: Block,
    /// Data of the segment.
    pub data: Block,
}

/// Segments listed in a file header.
#[derive(Clone, Debug)]
struct FileHeader {
    images: Vec<Segment>,
    extensions: Vec<Segment>,
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
    fn bytes(start: &[u8]) -> Result<u64, String> {
        if !(start.starts_with(b"NITF02.10") || start.starts_with(b"NSIF01.00")) {
            return Err("expected NITF 2.1 or NSIF 1.0, found another file format".to_owned());
        }
        let mut fields = Fields {
            bytes: start,
            at: BEFORE_LENGTH,
        };
        fields.number(6)
    }

    fn parse(header: &[u8]) -> Result<Self, String> {
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
                    header: Block {
                        offset: at,
                        size: header_bytes,
                    },
                    data: Block {
                        offset: at + header_bytes,
                        size: data_bytes,
                    },
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
pub struct Layout {
    /// Identifier (`IID1`).
    pub name: String,
    /// Number of rows of the segment.
    pub rows: usize,
    /// Number of columns of the segment.
    pub columns: usize,
    /// Pixel value type (`PVTYPE`).
    pub kind: String,
    /// Number of bands of the segment.
    pub bands: usize,
    /// Look-up tables of the first band (`LUTD`), one byte per entry.
    pub tables: Vec<Vec<u8>>,
    /// Order of bands and pixels (`IMODE`).
    pub mode: String,
    /// Number of blocks per row and per column.
    pub blocks: [usize; 2],
    /// Columns and rows of a block; 0: those of the image.
    pub block: [usize; 2],
    /// Bits per pixel and band (`NBPP`).
    pub bits: u64,
}

impl Layout {
    /// Columns and rows of a block, pixels.
    pub fn block_size(&self) -> [usize; 2] {
        let side = |block: usize, whole: usize| if block == 0 { whole } else { block };
        [
            side(self.block[0], self.columns),
            side(self.block[1], self.rows),
        ]
    }

    fn parse(header: &[u8]) -> Result<Self, String> {
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
        let mut tables = Vec::new();
        for band in 0..bands {
            fields.skip(2 + 6 + 1 + 3)?;
            let count = fields.count(1)?;
            let entries = if count > 0 { fields.count(5)? } else { 0 };
            for _ in 0..count {
                let from = fields.at;
                fields.skip(entries)?;
                if band == 0 {
                    tables.push(header[from..fields.at].to_vec());
                }
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
            tables,
            mode,
            blocks,
            block,
            bits: fields.number(2)?,
        })
    }
}
