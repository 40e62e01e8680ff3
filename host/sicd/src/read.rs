//! Anyone's SICD, read part by part: NITF 2.1 (or NSIF 1.0) with uncompressed samples of any of SICD's three kinds, versions 0.4 to 1.3.
//!
//! | `PixelType` | sample |
//! |---|---|
//! | `RE32F_IM32F` | two float32, as they are |
//! | `RE16I_IM16I` | two 16-bit integers, as numbers |
//! | `AMP8I_PHS8I` | amplitude, by `AmpTable` if there is one, and phase in 256ths of a turn |
//!
//! **Memory** that of the part that is read, its bytes besides, and the XML, which is [`MOST_XML_BYTES`] at the most. **Rows and columns** are the file's. What lies beyond the file's end, or
//! is not as the XML says, is an error that says where.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use num_complex::Complex32;
use roxmltree::Document;

use subaperture_io::xml::check_plain;
use subaperture_model::image::{Image, Parts, PartsError, Place, bands};

use crate::header::{FileHeader, ImageHeader, Samples};
use crate::lookup::Lookup;
use crate::{Band, Plane, Projection};

/// The longest XML that is read.
pub const MOST_XML_BYTES: u64 = 16 << 20;

/// Why a SICD was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The operating system refused.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// It is none, or it is damaged.
    #[error("{}: {what}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        what: String,
    },
}

/// A SICD, opened.
#[derive(Debug)]
pub struct SicdFile {
    path: PathBuf,
    // A place in it is read at a time.
    file: Mutex<File>,
    version: String,
    xml: String,
    size: (usize, usize),
    samples: Samples,
    /// Amplitudes of `AMP8I_PHS8I`.
    amplitudes: Option<Vec<f32>>,
    /// First row, number of rows and first byte of each segment.
    segments: Vec<(usize, usize, u64)>,
}

impl SicdFile {
    /// Opens a file and reads its headers and XML.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|source| ReadError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::of(file, path)
    }

    /// The same of a file that is open; `path` is for messages.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn of(mut file: File, path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io {
            path: path.to_owned(),
            source,
        };
        let wrong = |what: String| ReadError::Format {
            path: path.to_owned(),
            what,
        };
        let length = file.metadata().map_err(io)?.len();
        let mut read = |at: u64, count: u64, what: &str| -> Result<Vec<u8>, ReadError> {
            match at.checked_add(count) {
                Some(end) if end <= length => {}
                _ => {
                    return Err(wrong(format!(
                        "{what} is to be {count} bytes from byte {at} on, and the file has {length}: it is cut short or damaged"
                    )));
                }
            }
            let mut bytes = vec![0; count as usize];
            file.seek(SeekFrom::Start(at)).map_err(io)?;
            file.read_exact(&mut bytes).map_err(io)?;
            Ok(bytes)
        };
        let start = read(0, 363, "the file's header")?;
        let header_bytes = FileHeader::bytes(&start).map_err(wrong)?;
        let header = read(0, header_bytes, "the file's header")?;
        let header = FileHeader::parse(&header).map_err(wrong)?;
        let mut images: Vec<(ImageHeader, u64)> = Vec::new();
        for segment in &header.images {
            let bytes = read(segment.header, segment.header_bytes, "an image's header")?;
            let image = ImageHeader::parse(&bytes).map_err(|what| {
                wrong(format!(
                    "the image's header at byte {}: {what}",
                    segment.header
                ))
            })?;
            if image.name.starts_with("SICD") {
                image.check(segment.data_bytes).map_err(|what| {
                    wrong(format!("the image at byte {}: {what}", segment.header))
                })?;
                images.push((image, segment.data));
            }
        }
        images.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let mut xml = None;
        for segment in &header.extensions {
            let begins = read(segment.data, segment.data_bytes.min(1000), "an extension")?;
            if !String::from_utf8_lossy(&begins).contains("SICD") {
                continue;
            }
            if segment.data_bytes > MOST_XML_BYTES {
                return Err(wrong(format!(
                    "its XML is said to have {} bytes; {MOST_XML_BYTES} are read at the most",
                    segment.data_bytes
                )));
            }
            let bytes = read(segment.data, segment.data_bytes, "the XML")?;
            let text =
                String::from_utf8(bytes).map_err(|_| wrong("its XML is not UTF-8".to_owned()))?;
            xml = Some(text);
            break;
        }
        let xml = xml
            .ok_or_else(|| wrong("no XML of SICD is in it: it is another NITF file".to_owned()))?;
        // What the last segment promises has to be there before anything is read of it.
        for segment in header.images.iter().chain(&header.extensions) {
            if segment
                .data
                .checked_add(segment.data_bytes)
                .is_none_or(|end| end > length)
            {
                return Err(wrong(format!(
                    "a segment is to be {} bytes from byte {} on, and the file has {length}: it is cut short or damaged",
                    segment.data_bytes, segment.data
                )));
            }
        }
        let told = Told::parse(&xml).map_err(wrong)?;
        let Some(samples) = images.first().map(|(image, _)| image.samples) else {
            return Err(wrong("no image of SICD is in it".to_owned()));
        };
        let mut segments = Vec::with_capacity(images.len());
        let mut first = 0usize;
        for (image, data) in &images {
            if image.samples != samples || image.columns != told.columns {
                return Err(wrong(format!(
                    "segment {} has {} columns of {:?}, and the XML {} of {:?}",
                    image.name, image.columns, image.samples, told.columns, samples
                )));
            }
            segments.push((first, image.rows, *data));
            first = first
                .checked_add(image.rows)
                .ok_or_else(|| wrong("more rows than can be".to_owned()))?;
        }
        if first != told.rows || told.samples != samples {
            return Err(wrong(format!(
                "its images have {first} rows of {samples:?}, and the XML says {} of {:?}",
                told.rows, told.samples
            )));
        }
        Ok(Self {
            path: path.to_owned(),
            file: Mutex::new(file),
            version: told.version,
            amplitudes: told.amplitudes,
            size: (told.rows, told.columns),
            xml,
            samples,
            segments,
        })
    }

    /// Where it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The standard's version, such as `1.3.0`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// The metadata.
    pub fn xml(&self) -> &str {
        &self.xml
    }

    /// What its collector called it, `CoreName`.
    pub fn name(&self) -> Option<String> {
        self.told(&["CollectionInfo", "CoreName"])
    }

    /// When its collection began, as RFC 3339 has it; `None` where the metadata tell no such moment.
    pub fn start(&self) -> Option<String> {
        let text = self.told(&["Timeline", "CollectStart"])?;
        let (moment, fraction) = text.trim_end_matches('Z').split_at_checked(19)?;
        let like = |c: char, pattern: char| match pattern {
            '0' => c.is_ascii_digit(),
            other => c == other,
        };
        let sound = moment
            .chars()
            .zip("0000-00-00T00:00:00".chars())
            .all(|(c, pattern)| like(c, pattern));
        let digits = fraction.strip_prefix('.').unwrap_or(fraction);
        (sound && digits.bytes().all(|b| b.is_ascii_digit()))
            .then(|| format!("{moment}{fraction}Z"))
    }

    /// A text of the metadata that is there and not empty.
    fn told(&self, path: &[&str]) -> Option<String> {
        let document = Document::parse(&self.xml).ok()?;
        let text = Lookup::of(document.root_element()).text(path)?.to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// Where its pixels are; `None` where the metadata do not tell.
    pub fn plane(&self) -> Option<Plane> {
        Plane::of(&self.xml, self.size)
    }

    /// Where on the Earth its pixels are seen.
    ///
    /// # Errors
    /// [`ReadError::Format`]: what the metadata lack.
    pub fn projection(&self) -> Result<Projection, ReadError> {
        Projection::of(&self.xml).map_err(|error| ReadError::Format {
            path: self.path.clone(),
            what: error.to_string(),
        })
    }

    /// Where its spectrum is; `None` where the metadata do not tell.
    pub fn band(&self) -> Option<Band> {
        Band::of(&self.xml)
    }

    /// Samples of whole or parts of rows.
    fn read(&self, place: &Place) -> Result<Image, ReadError> {
        let [rows, columns] = place;
        let bytes = self.samples.bytes();
        let mut pixels = Vec::with_capacity(rows.len() * columns.len());
        let mut line = vec![0; columns.len() * bytes];
        let io = |source| ReadError::Io {
            path: self.path.clone(),
            source,
        };
        let mut file = self
            .file
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner);
        for row in rows.clone() {
            let n = self.segments.partition_point(|&(first, ..)| first <= row) - 1;
            let (first, _, data) = self.segments[n];
            let pixel = (row - first) as u64 * self.size.1 as u64 + columns.start as u64;
            file.seek(SeekFrom::Start(data + pixel * bytes as u64))
                .map_err(io)?;
            file.read_exact(&mut line).map_err(io)?;
            let sample = |bytes: &[u8]| self.samples.sample(bytes, self.amplitudes.as_deref());
            pixels.extend(line.chunks_exact(bytes).map(sample));
        }
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels,
        })
    }
}

impl Parts for SicdFile {
    fn size(&self) -> (usize, usize) {
        self.size
    }

    fn places(&self) -> Vec<Place> {
        bands(self.size.0, self.size.1)
    }

    fn window(&self, place: &Place) -> Result<Image, PartsError> {
        Ok(self.read(place)?)
    }
}

/// What the XML says of the samples.
struct Told {
    version: String,
    rows: usize,
    columns: usize,
    samples: Samples,
    amplitudes: Option<Vec<f32>>,
}

impl Told {
    fn parse(xml: &str) -> Result<Self, String> {
        check_plain(xml).map_err(|what| format!("XML: {what}"))?;
        let document = Document::parse(xml).map_err(|error| format!("XML: {error}"))?;
        let root = document.root_element();
        let namespace = root.tag_name().namespace().unwrap_or_default();
        let version = namespace.strip_prefix("urn:SICD:").unwrap_or_default();
        if root.tag_name().name() != "SICD" || version.is_empty() {
            return Err(format!(
                "its XML is '{}' of '{namespace}', and not SICD",
                root.tag_name().name()
            ));
        }
        let child = |node: roxmltree::Node<'_, '_>, name: &str| {
            node.children()
                .find(|n| n.tag_name().name() == name)
                .map(|n| n.id())
        };
        let data = child(root, "ImageData")
            .and_then(|id| document.get_node(id))
            .ok_or("XML: no ImageData")?;
        let text = |name: &str| {
            let node = child(data, name).and_then(|id| document.get_node(id));
            let text = node.and_then(|node| node.text()).map(str::trim);
            text.ok_or_else(|| format!("XML: no ImageData/{name}"))
        };
        let count = |name: &str| {
            let count = text(name)?
                .parse::<usize>()
                .ok()
                .filter(|n| (1..1 << 31).contains(n));
            count.ok_or_else(|| format!("XML: ImageData/{name} is no count"))
        };
        let amplitudes = match child(data, "AmpTable").and_then(|id| document.get_node(id)) {
            None => None,
            Some(table) => {
                let mut all = vec![f32::NAN; 256];
                for one in table.children().filter(roxmltree::Node::is_element) {
                    let index = one.attribute("index").and_then(|n| n.parse::<usize>().ok());
                    let value = one.text().and_then(|text| text.trim().parse().ok());
                    let place = index.and_then(|n| all.get_mut(n));
                    let (Some(place), Some(value)) = (place, value) else {
                        return Err("XML: an Amplitude of ImageData/AmpTable is none".to_owned());
                    };
                    *place = value;
                }
                if all.iter().any(|value| !value.is_finite()) {
                    return Err("XML: ImageData/AmpTable has not 256 amplitudes".to_owned());
                }
                Some(all)
            }
        };
        Ok(Self {
            version: version.to_owned(),
            rows: count("NumRows")?,
            columns: count("NumCols")?,
            samples: match text("PixelType")? {
                "RE32F_IM32F" => Samples::Float32,
                "RE16I_IM16I" => Samples::Int16,
                "AMP8I_PHS8I" => Samples::AmplitudePhase,
                other => return Err(format!("XML: ImageData/PixelType is '{other}'")),
            },
            amplitudes,
        })
    }
}

impl Samples {
    /// Bytes of one.
    fn bytes(self) -> usize {
        match self {
            Self::Float32 => 8,
            Self::Int16 => 4,
            Self::AmplitudePhase => 2,
        }
    }

    fn sample(self, bytes: &[u8], amplitudes: Option<&[f32]>) -> Complex32 {
        match *bytes {
            [a, b, c, d, e, f, g, h] => Complex32::new(
                f32::from_be_bytes([a, b, c, d]),
                f32::from_be_bytes([e, f, g, h]),
            ),
            [a, b, c, d] => Complex32::new(
                i16::from_be_bytes([a, b]).into(),
                i16::from_be_bytes([c, d]).into(),
            ),
            [amplitude, phase] => {
                let table = amplitudes.map(|table| table[usize::from(amplitude)]);
                let turn = std::f64::consts::TAU * f64::from(phase) / 256.0;
                let (sin, cos) = libm::sincos(turn);
                let amplitude = f64::from(table.unwrap_or(amplitude.into()));
                Complex32::new((amplitude * cos) as f32, (amplitude * sin) as f32)
            }
            _ => Complex32::default(),
        }
    }
}
