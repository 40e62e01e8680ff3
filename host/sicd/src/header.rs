//! Headers of NITF 2.1, read: as far as it takes to find a SICD's samples and its XML.

/// How a sample is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Samples {
    Float32,
    Int16,
    AmplitudePhase,
}

/// Where a segment is, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    pub(crate) header: u64,
    pub(crate) header_bytes: u64,
    pub(crate) data: u64,
    pub(crate) data_bytes: u64,
}

/// What a file's header lists.
#[derive(Clone, Debug)]
pub(crate) struct FileHeader {
    pub(crate) images: Vec<Segment>,
    pub(crate) extensions: Vec<Segment>,
}

/// Fields of fixed widths, one after another.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Fields<'a> {
    fn take(&mut self, width: usize) -> Result<&'a str, String> {
        let end = self.at + width;
        let field = self.bytes.get(self.at..end);
        let field =
            field.ok_or_else(|| format!("it ends at byte {} within a field", self.bytes.len()))?;
        let at = std::mem::replace(&mut self.at, end);
        std::str::from_utf8(field).map_err(|_| format!("the field at byte {at} is no text"))
    }

    fn skip(&mut self, width: usize) -> Result<(), String> {
        self.at += width;
        match self.at <= self.bytes.len() {
            true => Ok(()),
            false => Err(format!(
                "it ends at byte {} within a field",
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
            .ok_or_else(|| format!("the field at byte {at} is '{text}', and no number"))
    }

    fn count(&mut self, width: usize) -> Result<usize, String> {
        Ok(usize::try_from(self.number(width)?).expect("less than 2^32"))
    }
}

/// Bytes before the length of the header.
const BEFORE_LENGTH: usize = 354;

impl FileHeader {
    /// How long the header is that begins so.
    pub(crate) fn bytes(start: &[u8]) -> Result<u64, String> {
        if !(start.starts_with(b"NITF02.10") || start.starts_with(b"NSIF01.00")) {
            return Err("it is no NITF 2.1".to_owned());
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
        // Images, graphics, texts, extensions: widths of the lengths of their headers and data. Between graphics and texts is a reserved count.
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
                // At most 999 of ten digits: far below 2^64.
                at += header_bytes + data_bytes;
            }
        }
        let [images, _, _, extensions] = lists;
        Ok(Self { images, extensions })
    }
}

/// What an image's header says of its samples.
#[derive(Clone, Debug)]
pub(crate) struct ImageHeader {
    pub(crate) name: String,
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) samples: Samples,
}

impl ImageHeader {
    pub(crate) fn parse(header: &[u8]) -> Result<Self, String> {
        let mut fields = Fields {
            bytes: header,
            at: 0,
        };
        if fields.take(2)? != "IM" {
            return Err("it does not begin with IM".to_owned());
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
                "its samples are compressed or masked ({compression}); only NC is read"
            ));
        }
        let bands = fields.count(1)?;
        if bands != 2 {
            return Err(format!("it has {bands} bands, and a complex image two"));
        }
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
        if mode != "P" || blocks != [1, 1] {
            return Err(format!(
                "its samples are in mode {mode} and {} x {} blocks; only one block pixel by pixel is read",
                blocks[0], blocks[1]
            ));
        }
        fields.skip(8)?;
        let bits = fields.number(2)?;
        let samples = match (kind.as_str(), bits) {
            ("R", 32) => Samples::Float32,
            ("SI", 16) => Samples::Int16,
            ("INT", 8) => Samples::AmplitudePhase,
            _ => {
                return Err(format!(
                    "its samples are {kind} of {bits} bits, which no SICD has"
                ));
            }
        };
        Ok(Self {
            name,
            rows,
            columns,
            samples,
        })
    }

    /// Whether so many bytes are what it says.
    pub(crate) fn check(&self, data_bytes: u64) -> Result<(), String> {
        let each = match self.samples {
            Samples::Float32 => 8,
            Samples::Int16 => 4,
            Samples::AmplitudePhase => 2u64,
        };
        // Eight digits each: far below 2^64.
        let expected = self.rows as u64 * self.columns as u64 * each;
        match expected == data_bytes {
            true => Ok(()),
            false => Err(format!(
                "{} rows of {} columns are {expected} bytes, and {data_bytes} are said to be there",
                self.rows, self.columns
            )),
        }
    }
}
