//! Reader of SICD files, window by window: NITF 2.1 or NSIF 1.0, uncompressed samples of all three pixel types, versions 0.4 to 1.3.
//!
//! | `PixelType` | conversion |
//! |---|---|
//! | `RE32F_IM32F` | float32 pair, unchanged |
//! | `RE16I_IM16I` | int16 pair, as numbers |
//! | `AMP8I_PHS8I` | amplitude through `AmpTable` if present; phase in units of 1/256 turn |
//!
//! **Memory** one window and its encoded rows, and the XML ([`MAX_XML_BYTES`](crate::MAX_XML_BYTES)). **Rows and columns** are those of the file. A truncated file, or one that
//! disagrees with its XML, is an error that states the position.

use std::fs::File;
use std::path::Path;

use num_complex::Complex32;

use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};

use crate::container::{Blocks, Container, Pixels, ReadError};
use crate::header::{ImageHeader, Samples};
use crate::lookup::{Lookup, document};
use crate::{Band, Plane, Projection};

/// An open SICD file.
#[derive(Debug)]
pub struct SicdFile {
    pixels: Pixels,
    version: String,
    xml: String,
    samples: Samples,
    /// Amplitudes of `AMP8I_PHS8I` (`AmpTable`).
    amplitudes: Option<Vec<f32>>,
}

impl SicdFile {
    /// Open a file; reads its headers and XML, which takes at most [`DEFAULT_MEMORY_BYTES`].
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SICD.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::open_within(path, DEFAULT_MEMORY_BYTES)
    }

    /// Open a file whose XML takes at most `memory_bytes` once parsed.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SICD.
    pub fn open_within(path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let file = File::open(path).map_err(|source| ReadError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::of(file, path, memory_bytes)
    }

    /// As [`Self::open_within`], from an open file; `path` is for messages.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SICD.
    pub fn of(file: File, path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let mut container = Container::open(file, path)?;
        let mut images: Vec<(ImageHeader, u64)> = Vec::new();
        for segment in container.header.images.clone() {
            let bytes = container.image_header(&segment)?;
            let image = ImageHeader::parse(&bytes)
                .map_err(|what| container.image_fault(&segment, &what))?;
            if image.name.starts_with("SICD") {
                image
                    .check(segment.data_bytes)
                    .map_err(|what| container.image_fault(&segment, &what))?;
                images.push((image, segment.data));
            }
        }
        images.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let wrong = |container: &Container, what: &str| container.fault(what.to_owned());
        let xml = container
            .xml("SICD", memory_bytes)?
            .ok_or_else(|| wrong(&container, "expected SICD XML, found another NITF file"))?;
        // All segments must lie in the file before any pixel is read.
        let segments = container.header.images.iter();
        for segment in segments.chain(&container.header.extensions) {
            let end = segment.data.checked_add(segment.data_bytes);
            if end.is_none_or(|end| end > container.length) {
                return Err(container.fault(format!(
                    "expected a segment of {} bytes at byte {}, found a file of {} bytes; it is truncated or damaged",
                    segment.data_bytes, segment.data, container.length
                )));
            }
        }
        let image_data =
            ImageData::parse(&xml, memory_bytes).map_err(|what| container.fault(what))?;
        let Some(samples) = images.first().map(|(image, _)| image.samples) else {
            return Err(wrong(
                &container,
                "expected a SICD image segment, found none",
            ));
        };
        let mut segments = Vec::with_capacity(images.len());
        let mut first_row = 0usize;
        for (image, data) in &images {
            if image.samples != samples || image.columns != image_data.columns {
                return Err(container.fault(format!(
                    "segment {}: expected {} columns of {samples:?} as in XML and first segment, found {} of {:?}",
                    image.name, image_data.columns, image.columns, image.samples
                )));
            }
            segments.push(Blocks {
                first_row,
                wide: image_data.columns,
                high: image.rows.max(1),
                across: 1,
                data: *data,
            });
            first_row = first_row
                .checked_add(image.rows)
                .ok_or_else(|| wrong(&container, "the number of rows overflows"))?;
        }
        if first_row != image_data.rows || image_data.samples != samples {
            return Err(container.fault(format!(
                "expected {} rows of {:?} as in the XML, found {first_row} of {samples:?}",
                image_data.rows, image_data.samples
            )));
        }
        let size = (image_data.rows, image_data.columns);
        Ok(Self {
            version: image_data.version,
            amplitudes: image_data.amplitudes,
            pixels: container.into_pixels(size, samples.bytes(), segments),
            xml,
            samples,
        })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        self.pixels.path()
    }

    /// Version of the standard, such as `1.3.0`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// XML metadata.
    pub fn xml(&self) -> &str {
        &self.xml
    }

    /// Name of the collection (`CoreName`).
    pub fn name(&self) -> Option<String> {
        self.text(&["CollectionInfo", "CoreName"])
    }

    /// Start of the collection (`CollectStart`), RFC 3339; `None` if missing or malformed.
    pub fn start(&self) -> Option<String> {
        let text = self.text(&["Timeline", "CollectStart"])?;
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

    /// Non-empty text of a metadata element.
    fn text(&self, path: &[&str]) -> Option<String> {
        let document = document(&self.xml, DEFAULT_MEMORY_BYTES).ok()?;
        let text = Lookup::of(document.root_element()).text(path)?.to_owned();
        (!text.is_empty()).then_some(text)
    }

    /// Image plane; `None` if the metadata do not define one.
    pub fn plane(&self) -> Option<Plane> {
        Plane::of(&self.xml, self.pixels.size())
    }

    /// Projection model.
    ///
    /// # Errors
    /// [`ReadError::Format`] if the metadata are incomplete or not supported.
    pub fn projection(&self) -> Result<Projection, ReadError> {
        Projection::of(&self.xml).map_err(|error| ReadError::Format {
            path: self.path().to_owned(),
            what: error.to_string(),
        })
    }

    /// Spectrum; `None` if the metadata do not define it.
    pub fn band(&self) -> Option<Band> {
        Band::of(&self.xml)
    }

    fn read(&self, place: &PixelBlock) -> Result<Image, ReadError> {
        let amplitudes = self.amplitudes.as_deref();
        let decode = |bytes: &[u8]| self.samples.sample(bytes, amplitudes);
        self.pixels.read(place, decode)
    }
}

impl ImageSource for SicdFile {
    fn size(&self) -> (usize, usize) {
        self.pixels.size()
    }

    fn places(&self) -> PixelBlocks {
        let (rows, columns) = self.size();
        bands(rows, columns)
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        Ok(self.read(place)?)
    }
}

/// `ImageData` of the XML.
struct ImageData {
    version: String,
    rows: usize,
    columns: usize,
    samples: Samples,
    amplitudes: Option<Vec<f32>>,
}

impl ImageData {
    fn parse(xml: &str, memory_bytes: u64) -> Result<Self, String> {
        let document = document(xml, memory_bytes)?;
        let root = document.root_element();
        let namespace = root.tag_name().namespace().unwrap_or_default();
        let version = namespace.strip_prefix("urn:SICD:").unwrap_or_default();
        if root.tag_name().name() != "SICD" || version.is_empty() {
            return Err(format!(
                "expected SICD XML, found element '{}' in namespace '{namespace}'",
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
            .ok_or("XML: expected ImageData")?;
        let text = |name: &str| {
            let node = child(data, name).and_then(|id| document.get_node(id));
            let text = node.and_then(|node| node.text()).map(str::trim);
            text.ok_or_else(|| format!("XML: expected ImageData/{name}"))
        };
        let count = |name: &str| {
            let count = text(name)?
                .parse::<usize>()
                .ok()
                .filter(|n| (1..1 << 31).contains(n));
            count
                .ok_or_else(|| format!("XML: expected a number from 1 to 2^31 in ImageData/{name}"))
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
                        return Err("XML: invalid Amplitude in ImageData/AmpTable".to_owned());
                    };
                    *place = value;
                }
                if all.iter().any(|value| !value.is_finite()) {
                    return Err("XML: expected 256 amplitudes in ImageData/AmpTable".to_owned());
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
                other => {
                    return Err(format!(
                        "XML: expected ImageData/PixelType RE32F_IM32F, RE16I_IM16I or AMP8I_PHS8I, found '{other}'"
                    ));
                }
            },
            amplitudes,
        })
    }
}

impl Samples {
    /// Size of a sample, bytes.
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
