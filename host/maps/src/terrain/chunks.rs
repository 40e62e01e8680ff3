//! Strips and tiles of a TIFF, decoded window by window by the crate `tiff`.
//!
//! Shared by elevation models (`geotiff`) and georeferenced images (`bands`), which check what they need of the header.
//!
//! **Memory** the window, and one strip or tile.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use crate::terrain::directory;
use crate::terrain::geokeys::Tags;

/// `GDAL_METADATA`, XML.
const GDAL_METADATA: Tag = Tag::Unknown(42112);
/// Largest strip or tile after decompression, bytes.
const LARGEST_CHUNK: u64 = 256 << 20;

/// An open TIFF: pixels as float32, NaN where there is no data.
#[derive(Debug)]
pub(crate) struct Chunks {
    decoder: Decoder<BufReader<File>>,
    /// Rows and columns, pixels.
    pub(crate) size: (usize, usize),
    pub(crate) colour: ColorType,
    /// Samples per pixel.
    pub(crate) bands: usize,
    /// Georeference.
    pub(crate) tags: Tags,
    /// `GDAL_METADATA`, empty if absent.
    pub(crate) metadata: String,
    /// `GDAL_NODATA`.
    no_data: Option<f64>,
    /// No-data value of 16-bit signed integers, in addition to `GDAL_NODATA`. Default: none.
    pub(crate) int16_no_data: Option<i16>,
}

impl Chunks {
    /// Open a TIFF. Directory and one strip or tile may take `allowed_bytes`.
    ///
    /// # Errors
    /// Description of the fault.
    pub(crate) fn open(mut file: File, allowed_bytes: u64) -> Result<Self, String> {
        directory::check(&mut file, allowed_bytes)?;
        let failed = |error: tiff::TiffError| format!("cannot decode the TIFF: {error}");
        let mut limits = Limits::default();
        // A compressed and a decompressed chunk are held in addition to the window.
        let most = usize::try_from((allowed_bytes / 4).min(LARGEST_CHUNK)).unwrap_or(usize::MAX);
        limits.decoding_buffer_size = most;
        limits.intermediate_buffer_size = most;
        limits.ifd_value_size = most / 4;
        let mut decoder = Decoder::new(BufReader::new(file))
            .map_err(failed)?
            .with_limits(limits);
        let (columns, rows) = decoder.dimensions().map_err(failed)?;
        let colour = decoder.colortype().map_err(failed)?;
        let mut doubles = |tag: Tag| match decoder.find_tag(tag) {
            Ok(Some(value)) => value.into_f64_vec().unwrap_or_default(),
            _ => Vec::new(),
        };
        let tags = Tags {
            scale: doubles(Tag::ModelPixelScaleTag),
            tie: doubles(Tag::ModelTiepointTag),
            matrix: doubles(Tag::ModelTransformationTag),
            keys: match decoder.find_tag(Tag::GeoKeyDirectoryTag) {
                Ok(Some(value)) => value.into_u16_vec().unwrap_or_default(),
                _ => Vec::new(),
            },
        };
        let mut text = |tag: Tag| match decoder.find_tag(tag) {
            Ok(Some(value)) => value.into_string().unwrap_or_default(),
            _ => String::new(),
        };
        let metadata = text(GDAL_METADATA);
        let no_data = text(Tag::GdalNodata);
        Ok(Self {
            size: (rows as usize, columns as usize),
            bands: match colour {
                ColorType::Multiband { num_samples, .. } => usize::from(num_samples),
                _ => 1,
            },
            colour,
            tags,
            metadata,
            no_data: no_data.trim_matches(['\0', ' ']).parse().ok(),
            int16_no_data: None,
            decoder,
        })
    }

    /// A tag whose value is one 16-bit number.
    pub(crate) fn number(&mut self, tag: Tag) -> Option<u16> {
        let value = self.decoder.find_tag(tag).ok().flatten();
        value.and_then(|value| value.into_u16().ok())
    }

    /// Rows and columns of a strip or tile, pixels.
    ///
    /// # Errors
    /// A size of 0.
    pub(crate) fn chunk_size(&self) -> Result<(usize, usize), String> {
        match self.decoder.chunk_dimensions() {
            (0, _) | (_, 0) => Err("strips or tiles have no pixels".to_owned()),
            (columns, rows) => Ok((rows as usize, columns as usize)),
        }
    }

    /// Decode a window: row by row, the bands of a pixel adjacent.
    ///
    /// # Errors
    /// A strip or tile that cannot be decoded or is too short.
    pub(crate) fn window(
        &mut self,
        [rows, columns]: &[Range<usize>; 2],
    ) -> Result<Vec<f32>, String> {
        let (high, wide) = self.chunk_size()?;
        let across = self.size.1.div_ceil(wide);
        let bands = self.bands;
        let mut out = vec![f32::NAN; rows.len() * columns.len() * bands];
        for down in rows.start / high..rows.end.div_ceil(high) {
            for along in columns.start / wide..columns.end.div_ceil(wide) {
                let index = u32::try_from(down * across + along)
                    .map_err(|_| "more than 2^32 strips or tiles".to_owned())?;
                let chunk = self
                    .decoder
                    .read_chunk(index)
                    .map_err(|error| format!("cannot decode strip or tile {index}: {error}"))?;
                let (own_wide, own_high) = self.decoder.chunk_data_dimensions(index);
                let (own_wide, own_high) = (own_wide as usize, own_high as usize);
                let values = floats(chunk, self.no_data, self.int16_no_data)?;
                if values.len() < own_wide * own_high * bands {
                    return Err(format!(
                        "strip or tile {index}: expected {own_wide} x {own_high} pixels of {bands} bands, found {} numbers",
                        values.len()
                    ));
                }
                let (top, left) = (down * high, along * wide);
                for row in rows.start.max(top)..rows.end.min(top + own_high) {
                    let own = columns.start.max(left)..columns.end.min(left + own_wide);
                    let from = bands * ((row - top) * own_wide + own.start - left);
                    let to =
                        bands * ((row - rows.start) * columns.len() + own.start - columns.start);
                    let count = bands * own.len();
                    out[to..to + count].copy_from_slice(&values[from..from + count]);
                }
            }
        }
        Ok(out)
    }
}

/// Samples as float32, NaN where there is no data.
fn floats(
    chunk: DecodingResult,
    no_data: Option<f64>,
    int16_no_data: Option<i16>,
) -> Result<Vec<f32>, String> {
    fn all<T: Copy + Into<f64>>(values: Vec<T>, no_data: Option<f64>) -> Vec<f32> {
        let number = |value: T| {
            let value: f64 = value.into();
            match Some(value) == no_data || !value.is_finite() {
                true => f32::NAN,
                false => value as f32,
            }
        };
        values.into_iter().map(number).collect()
    }
    Ok(match chunk {
        DecodingResult::U8(values) => all(values, no_data),
        DecodingResult::U16(values) => all(values, no_data),
        DecodingResult::U32(values) => all(values, no_data),
        DecodingResult::I8(values) => all(values, no_data),
        DecodingResult::I16(values) => {
            let mut numbers = all(values, no_data);
            if let Some(other) = int16_no_data.map(f32::from) {
                for number in numbers.iter_mut().filter(|number| **number == other) {
                    *number = f32::NAN;
                }
            }
            numbers
        }
        DecodingResult::I32(values) => all(values, no_data),
        // GDAL_NODATA is the decimal of a float64; rounding to float32 gives the number that is stored.
        DecodingResult::F32(values) => all(values, no_data.map(|value| f64::from(value as f32))),
        DecodingResult::F64(values) => all(values, no_data),
        _ => {
            return Err(
                "expected integers of 8, 16 or 32 bits or floating point; convert it, for example with gdal_translate -ot Float32"
                    .to_owned(),
            );
        }
    })
}
