//! Reader of SICD files, window by window: NITF 2.1 or NSIF 1.0, uncompressed samples of all three pixel types, versions 0.4 to 1.5.
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

use subaperture_io::container::nitf::{NitfFile, PixelSegment, Pixels};
use subaperture_io::container::{Element, MetadataError, Source};
use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};

use crate::header::{ImageHeader, Samples};
use crate::lookup::{text, version, with_root};
use crate::{Band, Plane, Projection, ReadError};

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
        Self::read_from(Source::open(path)?, memory_bytes)
    }

    /// As [`Self::open_within`], from an open file; `path` is for messages.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SICD.
    pub fn of(file: File, path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        Self::read_from(Source::of(file, path)?, memory_bytes)
    }

    fn read_from(source: Source, memory_bytes: u64) -> Result<Self, ReadError> {
        let file = NitfFile::read(source)?;
        let mut images: Vec<(ImageHeader, u64)> = Vec::new();
        for segment in &file.images {
            let image = ImageHeader::of(file.layout(segment)?)
                .map_err(|what| file.fault(segment, &what))?;
            if image.name.starts_with("SICD") {
                image
                    .check(segment.data.size)
                    .map_err(|what| file.fault(segment, &what))?;
                images.push((image, segment.data.offset));
            }
        }
        images.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let xml = file.xml("SICD", memory_bytes)?;
        // All segments must lie in the file before any pixel is read.
        for segment in file.images.iter().chain(&file.extensions) {
            file.check(segment)?;
        }
        let fault = |what: String| file.source().malformed(what);
        let image_data = with_root(&xml, memory_bytes, ImageData::parse)
            .map_err(|error| fault(error.to_string()))?;
        let samples = images.first().map(|(image, _)| image.samples);
        let samples =
            samples.ok_or_else(|| fault("expected a SICD image segment, found none".to_owned()))?;
        let mut segments = Vec::with_capacity(images.len());
        let mut first_row = 0usize;
        for (image, data) in &images {
            if image.samples != samples || image.columns != image_data.columns {
                return Err(fault(format!(
                    "segment {}: expected {} columns of {samples:?} as in XML and first segment, found {} of {:?}",
                    image.name, image_data.columns, image.columns, image.samples
                )));
            }
            segments.push(PixelSegment {
                first_row,
                block_columns: image_data.columns,
                block_rows: image.rows.max(1),
                blocks_per_row: 1,
                offset: *data,
            });
            first_row = first_row
                .checked_add(image.rows)
                .ok_or_else(|| fault("the number of rows overflows".to_owned()))?;
        }
        if first_row != image_data.rows || image_data.samples != samples {
            return Err(fault(format!(
                "expected {} rows of {:?} as in the XML, found {first_row} of {samples:?}",
                image_data.rows, image_data.samples
            )));
        }
        let size = (image_data.rows, image_data.columns);
        Ok(Self {
            version: image_data.version,
            amplitudes: image_data.amplitudes,
            pixels: file.into_pixels(size, samples.bytes(), segments),
            xml,
            samples,
        })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        self.pixels.source().path()
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
        let text = with_root(&self.xml, DEFAULT_MEMORY_BYTES, |root| Ok(text(root, path)));
        text.ok().filter(|text| !text.is_empty())
    }

    /// Image plane; `None` if the metadata do not define one.
    pub fn plane(&self) -> Option<Plane> {
        Plane::of(&self.xml, self.pixels.size())
    }

    /// Projection model.
    ///
    /// # Errors
    /// [`ReadError::Malformed`] if the metadata are incomplete or not supported.
    pub fn projection(&self) -> Result<Projection, ReadError> {
        Projection::of(&self.xml).map_err(|error| self.pixels.source().malformed(error.to_string()))
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
    fn parse(root: Element) -> Result<Self, MetadataError> {
        let version = version(root, "SICD")?;
        let data = root.child("ImageData")?;
        let count = |name: &str| {
            let element = data.child(name)?;
            match element.count()? {
                count @ 1..0x8000_0000 => Ok(count as usize),
                other => {
                    Err(element.fault(format!("expected a number from 1 to 2^31, found {other}")))
                }
            }
        };
        let amplitudes = data.optional("AmpTable").map(amplitudes).transpose()?;
        let pixel_type = data.child("PixelType")?;
        Ok(Self {
            version,
            rows: count("NumRows")?,
            columns: count("NumCols")?,
            samples: match &*pixel_type.text() {
                "RE32F_IM32F" => Samples::Float32,
                "RE16I_IM16I" => Samples::Int16,
                "AMP8I_PHS8I" => Samples::AmplitudePhase,
                other => {
                    return Err(pixel_type.fault(format!(
                        "expected RE32F_IM32F, RE16I_IM16I or AMP8I_PHS8I, found '{other}'"
                    )));
                }
            },
            amplitudes,
        })
    }
}

/// The 256 amplitudes of an `AmpTable`.
fn amplitudes(table: Element) -> Result<Vec<f32>, MetadataError> {
    let mut all = vec![f32::NAN; 256];
    for one in table.elements() {
        let index = one.attribute("index").and_then(|n| n.parse::<usize>().ok());
        let value = one.text().parse().ok();
        let place = index.and_then(|n| all.get_mut(n));
        let (Some(place), Some(value)) = (place, value) else {
            return Err(one.fault("expected a number and an index from 0 to 255"));
        };
        *place = value;
    }
    match all.iter().all(|value| value.is_finite()) {
        true => Ok(all),
        false => Err(table.fault("expected 256 finite amplitudes")),
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
