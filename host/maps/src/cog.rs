//! Writer of cloud-optimised GeoTIFF (COG): tiles and overview levels, all directories before the data, so that HTTP range requests read any part.
//!
//! | layout | bands | outside the image |
//! |---|---|---|
//! | decibels | uint8: `dB = offset + scale * value`, in the band metadata | 0 |
//! | amplitude | float32: square root of the mean power; a unit scatterer reads 1 | NaN |
//! | complex | two float32: real and imaginary part, phase relative to the pixel's own path | NaN |
//!
//! Tiles of 512 x 512 pixels, Deflate with predictor 2 (bytes) or 3 (floats). Each overview level halves the resolution: power is averaged,
//! complex values are decimated. The smallest level is stored first, full resolution last, as GDAL's COG driver does. Files above 4 GiB are BigTIFF.
//!
//! Compressed tiles are kept in anonymous files on the same disk until all are complete. **Memory** does not grow with the map, except for 24 bytes per
//! tile.

use std::io::{BufWriter, Write};
use std::path::Path;

use serde_json::json;

use subaperture_io::atomic::AtomicFile;
use subaperture_io::ours::TEXT_MARK;
use subaperture_io::together::FileSet;
use subaperture_io::written::{FileKind, WrittenFile};
use subaperture_model::PROGRAM;
use subaperture_model::monitor::Monitor;

use crate::levels::Levels;
use crate::pyramid::{Pyramid, TILE, Tile, Values, tiles};
use crate::tiff::{Directory, File, Spool, Value, bytes_differenced, floats_differenced};
use crate::{MapError, Ortho, Projection, Raster};

/// Bands of a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    /// Levels in dB, 8 bits.
    Decibels(Levels),
    /// Amplitude, float32.
    Amplitude,
    /// Real and imaginary part, float32.
    Complex,
    /// Real part, float32: signed values of a measure.
    Real {
        /// Name of the measure.
        name: &'static str,
        /// Unit of its values.
        unit: &'static str,
    },
}

/// Size above which a file is BigTIFF, bytes.
const MAX_SMALL_BYTES: u64 = u32::MAX as u64 - (1 << 20);

impl Layout {
    pub(crate) fn values(&self) -> Values {
        match self {
            Self::Complex | Self::Real { .. } => Values::Complex,
            _ => Values::Powers,
        }
    }

    fn bands(&self) -> usize {
        match self {
            Self::Complex => 2,
            _ => 1,
        }
    }

    fn no_data(&self) -> &'static str {
        match self {
            Self::Decibels(_) => "0",
            _ => "nan",
        }
    }

    /// Bands in the STAC raster extension.
    pub(crate) fn to_json(self) -> serde_json::Value {
        match self {
            Self::Decibels(levels) => {
                let [scale, offset] = levels.decibels();
                json!([{ "data_type": "uint8", "nodata": 0, "unit": "dB", "scale": scale, "offset": offset }])
            }
            Self::Amplitude => json!([{ "data_type": "float32", "nodata": "nan" }]),
            Self::Real { name, unit } => json!([
                { "description": name, "data_type": "float32", "nodata": "nan", "unit": unit }
            ]),
            Self::Complex => ["real part", "imaginary part"]
                .map(|name| json!({ "description": name, "data_type": "float32", "nodata": "nan" }))
                .into_iter()
                .collect(),
        }
    }

    /// `GDAL_METADATA` of the bands, XML.
    fn metadata(&self) -> String {
        let item = |name: &str, sample: usize, role: &str, value: &str| {
            format!("<Item name=\"{name}\" sample=\"{sample}\" role=\"{role}\">{value}</Item>")
        };
        let items = match self {
            Self::Decibels(levels) => {
                let [scale, offset] = levels.decibels();
                [
                    item("DESCRIPTION", 0, "description", "level"),
                    item("UNITTYPE", 0, "unittype", "dB"),
                    item("OFFSET", 0, "offset", &offset.to_string()),
                    item("SCALE", 0, "scale", &scale.to_string()),
                ]
                .concat()
            }
            Self::Amplitude => item("DESCRIPTION", 0, "description", "amplitude"),
            Self::Real { name, unit } => {
                item("DESCRIPTION", 0, "description", name) + &item("UNITTYPE", 0, "unittype", unit)
            }
            Self::Complex => {
                item("DESCRIPTION", 0, "description", "real part")
                    + &item("DESCRIPTION", 1, "description", "imaginary part")
            }
        };
        format!("<GDALMetadata><Item name=\"AREA_OR_POINT\">Area</Item>{items}</GDALMetadata>")
    }

    /// Bytes of a tile before compression.
    fn encoded(&self, tile: &Tile) -> Vec<u8> {
        let values = tile.values.iter();
        match self {
            Self::Decibels(levels) => {
                let mut bytes: Vec<u8> = values.map(|z| levels.marked(z.re)).collect();
                bytes_differenced(&mut bytes, TILE);
                bytes
            }
            Self::Real { .. } => {
                let samples: Vec<f32> = values.map(|z| z.re).collect();
                floats_differenced(&samples, TILE, 1)
            }
            Self::Amplitude => {
                let samples: Vec<f32> = values.map(|z| z.re.sqrt()).collect();
                floats_differenced(&samples, TILE, 1)
            }
            Self::Complex => {
                let samples: Vec<f32> = values.flat_map(|z| [z.re, z.im]).collect();
                floats_differenced(&samples, TILE, 2)
            }
        }
    }
}

/// Write a map atomically. `title` becomes the TIFF image description.
///
/// # Errors
/// [`MapError`] if the image cannot be read or resampled, the file cannot be written, or the monitor cancels.
pub fn write(
    path: &Path,
    ortho: &Ortho,
    layout: Layout,
    title: &str,
    monitor: &dyn Monitor,
) -> Result<Vec<WrittenFile>, MapError> {
    let mut alone = FileSet::new();
    add_to(&mut alone, path, ortho, layout, title, monitor)?;
    Ok(alone.commit()?)
}

/// As [`write()`], put in place with the other files of a set.
///
/// # Errors
/// As [`write()`].
pub fn add_to(
    files: &mut FileSet,
    path: &Path,
    ortho: &Ortho,
    layout: Layout,
    title: &str,
    monitor: &dyn Monitor,
) -> Result<(), MapError> {
    add_as(files, path, ortho, layout, title, monitor, MAX_SMALL_BYTES)
}

/// As [`add_to`]; the file is BigTIFF above `most_small_bytes`.
fn add_as(
    files: &mut FileSet,
    path: &Path,
    ortho: &Ortho,
    layout: Layout,
    title: &str,
    monitor: &dyn Monitor,
    most_small_bytes: u64,
) -> Result<(), MapError> {
    let mut pending = AtomicFile::create(path, 0, ".part")?;
    let mut pyramid = Pyramid::new(ortho, layout.values(), monitor);
    let levels = pyramid.levels().to_vec();
    let absolute = std::path::absolute(path).map_err(|e| pending.failed(e))?;
    let folder = absolute.parent().unwrap_or(Path::new("."));
    let spools = levels.iter().map(|&level| {
        let [down, across] = tiles(level);
        Spool::new(folder, down * across)
    });
    let spools: Result<Vec<Spool>, _> = spools.collect();
    let mut spools = spools.map_err(|e| pending.failed(e))?;
    pyramid.make(&mut |level, [row, column], tile| {
        let index = row * tiles(levels[level])[1] + column;
        let put = spools[level].put(index, &layout.encoded(tile));
        put.map_err(|e| pending.failed(e).into())
    })?;

    let data: u64 = spools.iter().map(Spool::bytes).sum();
    let mut file = File {
        big: false,
        note: note(),
        directories: Vec::new(),
    };
    let fill = |file: &mut File, first: u64| {
        // Smallest level first.
        let mut at = first;
        let mut begins = vec![0; levels.len()];
        for (level, spool) in spools.iter().enumerate().rev() {
            begins[level] = at;
            at += spool.bytes();
        }
        file.directories = (0..levels.len())
            .map(|level| {
                directory(
                    ortho.raster(),
                    &layout,
                    title,
                    level,
                    &levels,
                    (&spools[level], begins[level]),
                )
            })
            .collect();
    };
    fill(&mut file, 0);
    let mut head = file.head().len() as u64;
    if head + data > most_small_bytes {
        file.big = true;
        head = file.head().len() as u64;
    }
    fill(&mut file, head);
    let bytes = file.head();
    let written = (|| {
        let mut out = BufWriter::new(pending.file());
        out.write_all(&bytes)?;
        for spool in spools.iter_mut().rev() {
            spool.copy_to(&mut out)?;
        }
        out.flush()
    })();
    written.map_err(|e| pending.failed(e))?;
    Ok(files.add(pending, WrittenFile::new(path, FileKind::Cog))?)
}

/// `GDAL_STRUCTURAL_METADATA` of a COG, by which GDAL recognises the layout.
fn note() -> Vec<u8> {
    let text = "LAYOUT=IFDS_BEFORE_DATA\nBLOCK_ORDER=ROW_MAJOR\nBLOCK_LEADER=SIZE_AS_UINT4\n\
                BLOCK_TRAILER=LAST_4_BYTES_REPEATED\nKNOWN_INCOMPATIBLE_EDITION=NO\n ";
    format!(
        "GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{text}",
        text.len()
    )
    .into_bytes()
}

fn directory(
    raster: &Raster,
    layout: &Layout,
    title: &str,
    level: usize,
    levels: &[[usize; 2]],
    (spool, begin): (&Spool, u64),
) -> Directory {
    let mut to = Directory::default();
    let [rows, columns] = levels[level];
    let bands = layout.bands();
    let (bits, format, predictor) = match layout {
        Layout::Decibels(_) => (8, 1, 2),
        _ => (32, 3, 3),
    };
    if level > 0 {
        to.set(254, Value::Long(vec![1])); // NewSubfileType: reduced resolution.
    } else {
        to.set(270, Value::Text(format!("{title} ({TEXT_MARK})")));
        to.set(305, Value::Text(PROGRAM.to_owned()));
        to.set(42112, Value::Text(layout.metadata()));
        geography(&mut to, raster);
    }
    to.set(256, Value::Long(vec![columns as u32]));
    to.set(257, Value::Long(vec![rows as u32]));
    to.set(258, Value::Short(vec![bits; bands]));
    to.set(259, Value::Short(vec![8])); // Deflate.
    to.set(262, Value::Short(vec![1])); // BlackIsZero.
    to.set(277, Value::Short(vec![bands as u16]));
    to.set(284, Value::Short(vec![1])); // Bands interleaved by pixel.
    to.set(317, Value::Short(vec![predictor]));
    to.set(322, Value::Short(vec![TILE as u16]));
    to.set(323, Value::Short(vec![TILE as u16]));
    to.set(324, Value::Offsets(spool.offsets(begin)));
    to.set(
        325,
        Value::Long(spool.tiles.iter().map(|[_, bytes]| *bytes as u32).collect()),
    );
    if bands > 1 {
        to.set(338, Value::Short(vec![0; bands - 1])); // Unspecified extra samples.
    }
    to.set(339, Value::Short(vec![format; bands]));
    to.set(42113, Value::Text(layout.no_data().to_owned()));
    to
}

/// Georeference by GeoTIFF 1.1.
fn geography(to: &mut Directory, raster: &Raster) {
    let [east, south] = raster.step;
    to.set(33550, Value::Double(vec![east, south, 0.0]));
    let corner = vec![0.0, 0.0, 0.0, raster.west, raster.north, 0.0];
    to.set(33922, Value::Double(corner));
    // Keys: model type, PixelIsArea, coordinate system and its unit.
    let keys: &[[u16; 2]] = match raster.projection {
        Projection::Utm(zone) => &[[1024, 1], [1025, 1], [3072, zone.epsg()], [3076, 9001]],
        Projection::Geographic { .. } => &[[1024, 2], [1025, 1], [2048, 4326], [2054, 9102]],
    };
    let mut words = vec![1, 1, 1, keys.len() as u16];
    words.extend(keys.iter().flat_map(|&[key, value]| [key, 0, 1, value]));
    to.set(34735, Value::Short(words));
}

#[cfg(test)]
mod tests;
