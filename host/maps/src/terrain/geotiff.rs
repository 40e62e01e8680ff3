//! Elevation models in GeoTIFF: one band, strips or tiles, uncompressed or Deflate, LZW or PackBits (crate `tiff`).
//!
//! Pixel positions: [`crate::terrain::geokeys`]. No-data values are that of `GDAL_NODATA` (tag 42113), NaN and, for 16-bit integers, -32768. Only the
//! strips and tiles that a scene needs are read. Not supported: scaled heights (GDAL's `scale` and `offset`), BigTIFF beyond what `tiff` reads, JPEG, and
//! several bands.

use std::fs::File;
use std::path::Path;

use tiff::ColorType;
use tiff::tags::Tag;

use crate::terrain::chunks::Chunks;
use crate::terrain::raster::{Extent, Model, Raster, check_memory};
use crate::terrain::vertical::{Datum, Vertical};
use crate::terrain::{Region, TerrainError};

/// No-data value of 16-bit integers.
const INT16_NO_DATA: i16 = -32768;

/// Read the part of a file that a region needs; `None` if they do not overlap.
pub(crate) fn read(
    path: &Path,
    region: &Region,
    allowed_bytes: u64,
) -> Result<Option<Model>, TerrainError> {
    let file = File::open(path).map_err(|source| TerrainError::Io {
        path: path.to_owned(),
        source,
    })?;
    let format = |what: String| TerrainError::Format {
        path: path.to_owned(),
        what,
    };
    let mut tiff = Elevations::open(file, allowed_bytes).map_err(format)?;
    let Some(window) = tiff.extent.window(region) else {
        return Ok(None);
    };
    let chunk_bytes = tiff.chunk_bytes().map_err(format)?;
    check_memory(path, &window, chunk_bytes, allowed_bytes)?;
    let mut heights = tiff.chunks.window(&window).map_err(format)?;
    if tiff.vertical.unit_m != 1.0 {
        for height in &mut heights {
            *height = (f64::from(*height) * tiff.vertical.unit_m) as f32;
        }
    }
    let raster = Raster::new(tiff.extent.lattice, &window, heights);
    Ok(Some(Model {
        raster,
        warnings: tiff.warnings(path),
        above_sea: match tiff.vertical.datum {
            Datum::Sea(name) => Some(name),
            Datum::Ellipsoid | Datum::Unknown => None,
        },
    }))
}

struct Elevations {
    chunks: Chunks,
    extent: Extent,
    vertical: Vertical,
    nad83: bool,
}

impl Elevations {
    fn open(file: File, allowed_bytes: u64) -> Result<Self, String> {
        let mut chunks = Chunks::open(file, allowed_bytes)?;
        chunks.int16_no_data = Some(INT16_NO_DATA);
        if !matches!(chunks.colour, ColorType::Gray(_)) {
            return Err(format!(
                "expected one band of heights, found colour type {:?}",
                chunks.colour
            ));
        }
        check_compression(chunks.number(Tag::Compression).unwrap_or(1))?;
        if ["role=\"scale\"", "role=\"offset\""]
            .iter()
            .any(|role| chunks.metadata.contains(role))
        {
            return Err(
                "heights are scaled (GDAL scale or offset); write them in metres, for example with gdal_translate -unscale"
                    .to_owned(),
            );
        }
        let (rows, columns) = chunks.size;
        Ok(Self {
            extent: Extent {
                lattice: chunks.tags.lattice(columns)?,
                rows,
                columns,
            },
            vertical: chunks.tags.vertical(band_unit(&chunks.metadata))?,
            nad83: chunks.tags.is_nad83(),
            chunks,
        })
    }

    fn warnings(&self, path: &Path) -> Vec<String> {
        let name = path.display();
        let nad83 = self.nad83.then(|| {
            format!(
                "{name}: NAD83 coordinates are used as WGS 84; positions may be off by up to 2 m"
            )
        });
        nad83.into_iter().collect()
    }

    /// Memory of a strip or tile, decoded and as heights; upper bound, bytes.
    fn chunk_bytes(&self) -> Result<u64, String> {
        let (rows, columns) = self.chunks.chunk_size()?;
        Ok(12 * rows.min(self.extent.rows) as u64 * columns.min(self.extent.columns) as u64)
    }
}

/// Refuse compression methods that the crate `tiff` does not decode here.
fn check_compression(method: u16) -> Result<(), String> {
    let name = match method {
        1 | 5 | 8 | 32773 | 32946 => return Ok(()),
        7 => "JPEG",
        34887 => "LERC",
        34925 => "LZMA",
        50000 => "ZSTD",
        50001 => "WebP",
        50002 => "JPEG XL",
        _ => "an unknown method",
    };
    Err(format!(
        "expected no compression, Deflate, LZW or PackBits, found {name} (tag 259 is {method}); recompress it, for example with gdal_translate -co \
         COMPRESS=DEFLATE"
    ))
}

/// Unit of the first band in `GDAL_METADATA`, empty if absent: `<Item name="UNITTYPE" sample="0" role="unittype">ft</Item>`.
fn band_unit(metadata: &str) -> &str {
    let after = metadata
        .split_once("role=\"unittype\"")
        .map(|(_, after)| after);
    let value = after
        .and_then(|after| after.split_once('>'))
        .map(|(_, value)| value);
    value
        .and_then(|value| value.split('<').next())
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn band_unit_reads_gdal_unittype() {
        let metadata = "<GDALMetadata>\n  <Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">US survey foot</Item>\n</GDALMetadata>\0";
        assert_eq!(band_unit(metadata), "US survey foot");
        assert_eq!(band_unit("<GDALMetadata></GDALMetadata>"), "");
        assert_eq!(band_unit(""), "");
    }
}
