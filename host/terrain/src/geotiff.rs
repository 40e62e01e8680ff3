//! Elevation models as GeoTIFF: one band of numbers, in strips or tiles, plain or packed by Deflate or LZW, as the crate `tiff` reads them.
//!
//! Where pixels are: [`crate::geokeys`]. Voids are pixels of the value that GDAL's tag 42113 names, NaN, and of 16-bit integers -32768. Only the
//! strips and tiles that a scene needs are read. Not supported: scaled heights (GDAL's `scale` and `offset`), BigTIFF beyond what `tiff` reads, JPEG, and
//! several bands.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::Path;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use crate::geokeys::GeoTags;
use crate::raster::{Extent, Raster, check_memory};
use crate::{Region, TerrainError, directory};

/// GDAL's own metadata, XML.
const GDAL_METADATA: Tag = Tag::Unknown(42112);

/// Voids of 16-bit integers.
const VOID: i16 = -32768;

/// A strip or tile is no larger than this, unpacked, bytes.
const LARGEST_CHUNK: u64 = 256 << 20;

/// The part of a file that a region needs; none if it has nothing of it.
pub(crate) fn read(
    path: &Path,
    region: &Region,
    allowed_bytes: u64,
) -> Result<Option<Raster>, TerrainError> {
    let file = File::open(path).map_err(|source| TerrainError::Io {
        path: path.to_owned(),
        source,
    })?;
    let format = |what: String| TerrainError::Format {
        path: path.to_owned(),
        what,
    };
    let mut tiff = Open::new(file, allowed_bytes).map_err(format)?;
    let Some(window) = tiff.extent.window(region) else {
        return Ok(None);
    };
    let chunk_bytes = tiff.chunk_bytes().map_err(format)?;
    check_memory(path, &window, chunk_bytes, allowed_bytes)?;
    let heights = tiff.heights(&window).map_err(format)?;
    Ok(Some(Raster::new(tiff.extent.lattice, &window, heights)))
}

struct Open {
    decoder: Decoder<BufReader<File>>,
    extent: Extent,
    void: Option<f64>,
}

impl Open {
    fn new(mut file: File, allowed_bytes: u64) -> Result<Self, String> {
        directory::check(&mut file, allowed_bytes)?;
        let failed = |error: tiff::TiffError| format!("it is no TIFF that can be read: {error}");
        let mut limits = Limits::default();
        // Of the bytes allowed, what is packed and what is unpacked beside the heights.
        let most = usize::try_from((allowed_bytes / 4).min(LARGEST_CHUNK)).unwrap_or(usize::MAX);
        limits.decoding_buffer_size = most;
        limits.intermediate_buffer_size = most;
        limits.ifd_value_size = most / 4;
        let mut decoder = Decoder::new(BufReader::new(file))
            .map_err(failed)?
            .with_limits(limits);
        let (columns, rows) = decoder.dimensions().map_err(failed)?;
        match decoder.colortype().map_err(failed)? {
            ColorType::Gray(_) => {}
            other => {
                return Err(format!(
                    "its pixels are {other:?}, and one number a pixel is read: a model of heights has one band"
                ));
            }
        }
        let metadata = text(&mut decoder, GDAL_METADATA);
        if ["role=\"scale\"", "role=\"offset\""]
            .iter()
            .any(|role| metadata.contains(role))
        {
            return Err(
                "its heights are scaled (GDAL's scale or offset): write them in metres, as gdal_translate -unscale does"
                    .to_owned(),
            );
        }
        let void = text(&mut decoder, Tag::GdalNodata);
        let void = void.trim_matches(['\0', ' ']).parse().ok();
        let mut doubles = |tag: Tag| match decoder.find_tag(tag) {
            Ok(Some(value)) => value.into_f64_vec().unwrap_or_default(),
            _ => Vec::new(),
        };
        let tags = GeoTags {
            scale: doubles(Tag::ModelPixelScaleTag),
            tie: doubles(Tag::ModelTiepointTag),
            matrix: doubles(Tag::ModelTransformationTag),
            keys: match decoder.find_tag(Tag::GeoKeyDirectoryTag) {
                Ok(Some(value)) => value.into_u16_vec().unwrap_or_default(),
                _ => Vec::new(),
            },
        };
        Ok(Self {
            extent: Extent {
                lattice: tags.lattice(columns as usize)?,
                rows: rows as usize,
                columns: columns as usize,
            },
            decoder,
            void,
        })
    }

    /// Bytes that a strip or tile takes as numbers and as heights, at most.
    fn chunk_bytes(&self) -> Result<u64, String> {
        let (columns, rows) = self.decoder.chunk_dimensions();
        let rows = u64::from(rows).min(self.extent.rows as u64);
        let columns = u64::from(columns).min(self.extent.columns as u64);
        match rows > 0 && columns > 0 {
            true => Ok(12 * rows * columns),
            false => Err("its strips or tiles have no pixels".to_owned()),
        }
    }

    /// Heights of a window, row by row.
    fn heights(&mut self, [rows, columns]: &[Range<usize>; 2]) -> Result<Vec<f32>, String> {
        let (wide, high) = self.decoder.chunk_dimensions();
        let (wide, high) = (wide as usize, high as usize);
        let across = self.extent.columns.div_ceil(wide);
        let mut heights = vec![f32::NAN; rows.len() * columns.len()];
        for down in rows.start / high..rows.end.div_ceil(high) {
            for along in columns.start / wide..columns.end.div_ceil(wide) {
                let index = u32::try_from(down * across + along)
                    .map_err(|_| "it has more strips or tiles than can be read".to_owned())?;
                let chunk = self
                    .decoder
                    .read_chunk(index)
                    .map_err(|error| format!("strip or tile {index} cannot be read: {error}"))?;
                let (own_wide, own_high) = self.decoder.chunk_data_dimensions(index);
                let (own_wide, own_high) = (own_wide as usize, own_high as usize);
                let values = values(chunk, self.void)?;
                if values.len() < own_wide * own_high {
                    return Err(format!(
                        "strip or tile {index} has {} pixels and not {own_wide} x {own_high}",
                        values.len()
                    ));
                }
                let (top, left) = (down * high, along * wide);
                for row in rows.start.max(top)..rows.end.min(top + own_high) {
                    let own = columns.start.max(left)..columns.end.min(left + own_wide);
                    let from = (row - top) * own_wide + own.start - left;
                    let to = (row - rows.start) * columns.len() + own.start - columns.start;
                    heights[to..to + own.len()].copy_from_slice(&values[from..from + own.len()]);
                }
            }
        }
        Ok(heights)
    }
}

/// A tag of text, or none.
fn text(decoder: &mut Decoder<BufReader<File>>, tag: Tag) -> String {
    match decoder.find_tag(tag) {
        Ok(Some(value)) => value.into_string().unwrap_or_default(),
        _ => String::new(),
    }
}

/// Numbers as heights, NaN where there is none.
fn values(chunk: DecodingResult, void: Option<f64>) -> Result<Vec<f32>, String> {
    fn heights<T: Copy + Into<f64>>(values: Vec<T>, void: Option<f64>) -> Vec<f32> {
        let height = |value: T| {
            let value: f64 = value.into();
            match Some(value) == void || !value.is_finite() {
                true => f32::NAN,
                false => value as f32,
            }
        };
        values.into_iter().map(height).collect()
    }
    Ok(match chunk {
        DecodingResult::I16(values) => {
            let void = void.unwrap_or(f64::from(VOID));
            let mut heights = heights(values, Some(void));
            for height in &mut heights {
                if *height == f32::from(VOID) {
                    *height = f32::NAN;
                }
            }
            heights
        }
        DecodingResult::U8(values) => heights(values, void),
        DecodingResult::U16(values) => heights(values, void),
        DecodingResult::U32(values) => heights(values, void),
        DecodingResult::I8(values) => heights(values, void),
        DecodingResult::I32(values) => heights(values, void),
        // The void of float32 is named as the decimal of a float64, which is another number.
        DecodingResult::F32(values) => heights(values, void.map(|void| f64::from(void as f32))),
        DecodingResult::F64(values) => heights(values, void),
        _ => {
            return Err(
                "its numbers are none of 8, 16 or 32 bits or floating point: convert it, as gdal_translate -ot Float32 does"
                    .to_owned(),
            );
        }
    })
}
