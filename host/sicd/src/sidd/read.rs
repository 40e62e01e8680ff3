//! Reader of SIDD files, window by window: NITF 2.1 with uncompressed grey pixels, versions 1.0 to 3.0.
//!
//! | `PixelType` | grey |
//! |---|---|
//! | `MONO8I` | 8 bits |
//! | `MONO16I` | 16 bits |
//! | `MONO8LU` | entry of the look-up table in the image header, 8 or 16 bits |
//! | `RGB24I`, `RGB8LU` | refused: colours have no amplitude |
//!
//! A pixel's value is its grey, or the amplitude where the file states the levels of black and white (files written by [`Sidd`](crate::Sidd) do). Rows and columns are
//! those of the file. Positions are read from `PlaneProjection`. Of several products, the first is read; legends are skipped. **Memory** one window, and the XML.

use std::path::Path;

use num_complex::Complex32;

use subaperture_io::container::nitf::{Layout, NitfFile, PixelSegment, Pixels, Segment};
use subaperture_io::container::{Element, MetadataError, Source};
use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};

use crate::lookup::{self, text, version, with_root};
use crate::{Plane, ReadError};

/// An open SIDD file.
#[derive(Debug)]
pub struct SiddFile {
    pixels: Pixels,
    metadata: Metadata,
    /// Greys of `MONO8LU`, by stored pixel.
    table: Option<Vec<u16>>,
    /// Largest grey of the format.
    white: f64,
}

/// Metadata of the XML.
#[derive(Debug)]
struct Metadata {
    version: String,
    kind: PixelKind,
    remap: Option<String>,
    /// Levels of black and white, dB of magnitude.
    levels_db: Option<[f64; 2]>,
    plane: Option<Plane>,
}

/// Whether the first image segment of a NITF file is that of a SIDD; `false` if its headers cannot be read.
pub fn is_sidd(path: &Path) -> bool {
    let first = || {
        let file = NitfFile::read(Source::open(path).ok()?).ok()?;
        file.name(file.images.first()?).ok()
    };
    first().is_some_and(|name| name.starts_with("SIDD"))
}

impl SiddFile {
    /// Open a file; reads its headers and XML, which takes at most [`DEFAULT_MEMORY_BYTES`].
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SIDD.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::open_within(path, DEFAULT_MEMORY_BYTES)
    }

    /// Open a file whose XML takes at most `memory_bytes` once parsed.
    ///
    /// # Errors
    /// [`ReadError`] if the file cannot be read, is damaged, or is not a supported SIDD.
    pub fn open_within(path: &Path, memory_bytes: u64) -> Result<Self, ReadError> {
        let file = NitfFile::read(Source::open(path)?)?;
        let mut images: Vec<(Layout, Segment)> = Vec::new();
        for segment in &file.images {
            // Legends and other images of the file are skipped.
            if file.name(segment)?.starts_with("SIDD") && file.category(segment)? != "LEG" {
                images.push((file.layout(segment)?, *segment));
            }
        }
        images.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let fault = |what: String| file.source().malformed(what);
        let xml = file.xml("SIDD", memory_bytes)?;
        let product = images.first().map(|(layout, _)| layout.name.clone());
        let product =
            product.ok_or_else(|| fault("expected a SIDD image segment, found none".to_owned()))?;
        let product = product.get(..7).unwrap_or(&product).to_owned();
        images.retain(|(layout, _)| layout.name.starts_with(&product));
        let columns = images[0].0.columns;
        let rows = images
            .iter()
            .try_fold(0usize, |sum, (layout, _)| sum.checked_add(layout.rows));
        let rows = rows.ok_or_else(|| fault("the number of rows overflows".to_owned()))?;
        let metadata = with_root(&xml, memory_bytes, |root| {
            Metadata::parse(root, (rows, columns))
        })
        .map_err(|error| fault(error.to_string()))?;
        check(&images, metadata.kind).map_err(fault)?;
        let table = match metadata.kind {
            PixelKind::Mono8Table => Some(table(&images).map_err(fault)?),
            _ => None,
        };
        let wide =
            metadata.kind == PixelKind::Mono16 || table.is_some() && images[0].0.tables.len() == 2;
        for (_, segment) in &images {
            file.check(segment)?;
        }
        let mut segments = Vec::with_capacity(images.len());
        let mut first_row = 0usize;
        for (layout, segment) in images {
            let [block_columns, block_rows] = layout.block_size();
            segments.push(PixelSegment {
                first_row,
                block_columns,
                block_rows,
                blocks_per_row: layout.blocks[0],
                offset: segment.data.offset,
            });
            first_row += layout.rows;
        }
        let pixel_bytes = metadata.kind.bytes();
        Ok(Self {
            pixels: file.into_pixels((rows, columns), pixel_bytes, segments),
            metadata,
            table,
            white: if wide { 65_535.0 } else { 255.0 },
        })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        self.pixels.source().path()
    }

    /// Version of the standard, such as `3.0.0`.
    pub fn version(&self) -> &str {
        &self.metadata.version
    }

    /// Name of the remap from magnitude to grey (`LUTName`, in version 1 `RemapType`); `None` if not stated.
    pub fn remap(&self) -> Option<&str> {
        self.metadata.remap.as_deref()
    }

    /// Levels of black and white, dB of magnitude. If stated, pixels are amplitudes; otherwise greys.
    pub fn levels_db(&self) -> Option<[f64; 2]> {
        self.metadata.levels_db
    }

    /// Image plane; `None` if the metadata contain none.
    pub fn plane(&self) -> Option<&Plane> {
        self.metadata.plane.as_ref()
    }

    /// Pixel value of a grey.
    fn value(&self, bytes: &[u8]) -> f32 {
        let grey = match (bytes, &self.table) {
            (&[high, low], _) => u16::from_be_bytes([high, low]),
            (&[own], Some(table)) => table[usize::from(own)],
            (&[own], None) => own.into(),
            _ => 0,
        };
        let (grey, white) = (f64::from(grey), self.white);
        match self.metadata.levels_db {
            None => grey as f32,
            Some([black, above]) => {
                let level_db = black + (above - black) * grey / white;
                libm::pow(10.0, level_db / 20.0) as f32
            }
        }
    }

    fn read(&self, place: &PixelBlock) -> Result<Image, ReadError> {
        let decode = |bytes: &[u8]| Complex32::new(self.value(bytes), 0.0);
        self.pixels.read(place, decode)
    }
}

/// Grey format of a SIDD (`PixelType`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PixelKind {
    Mono8,
    Mono16,
    Mono8Table,
}

impl PixelKind {
    fn parse(name: &str) -> Option<Self> {
        match name {
            "MONO8I" => Some(Self::Mono8),
            "MONO16I" => Some(Self::Mono16),
            "MONO8LU" => Some(Self::Mono8Table),
            _ => None,
        }
    }

    /// Size of a stored pixel, bytes.
    fn bytes(self) -> usize {
        match self {
            Self::Mono8 | Self::Mono8Table => 1,
            Self::Mono16 => 2,
        }
    }
}

/// Greys of a look-up table: one table of bytes, or one of high and one of low bytes.
fn table(images: &[(Layout, Segment)]) -> Result<Vec<u16>, String> {
    let tables = &images[0].0.tables;
    if images.iter().any(|(layout, _)| layout.tables != *tables) {
        return Err("the look-up tables of the image's segments differ".to_owned());
    }
    match &tables[..] {
        [grey] if grey.len() == 256 => Ok(grey.iter().map(|&grey| grey.into()).collect()),
        [high, low] if high.len() == 256 && low.len() == 256 => {
            let pairs = high.iter().zip(low);
            Ok(pairs
                .map(|(&high, &low)| u16::from_be_bytes([high, low]))
                .collect())
        }
        other => Err(format!(
            "MONO8LU: expected one or two look-up tables of 256 entries in the image header, found {} of {:?}",
            other.len(),
            other.iter().map(Vec::len).collect::<Vec<_>>()
        )),
    }
}

/// Check segments against the pixel type, each other and their stated lengths.
fn check(images: &[(Layout, Segment)], kind: PixelKind) -> Result<(), String> {
    let (first, _) = &images[0];
    let bytes = kind.bytes();
    if first.kind != "INT" || first.bits != 8 * bytes as u64 || first.bands != 1 {
        return Err(format!(
            "expected one band of INT, {} bits, as the XML states; found {} bands of {}, {} bits",
            8 * bytes,
            first.bands,
            first.kind,
            first.bits
        ));
    }
    for (layout, segment) in images {
        let alike = layout.columns == first.columns
            && layout.bits == first.bits
            && layout.bands == first.bands
            && layout.kind == first.kind;
        if !alike || layout.rows == 0 || layout.columns == 0 {
            return Err(format!(
                "segment {} of {} x {} pixels differs in width or format from segment {} of the same image, or is empty",
                layout.name, layout.rows, layout.columns, first.name
            ));
        }
        let size = layout.block_size();
        let covers = [0, 1].map(|i| layout.blocks[i] as u64 * size[i] as u64);
        if covers[0] < layout.columns as u64 || covers[1] < layout.rows as u64 {
            return Err(format!(
                "segment {}: {} x {} blocks do not cover {} columns x {} rows",
                layout.name, layout.blocks[0], layout.blocks[1], layout.columns, layout.rows
            ));
        }
        // Four digits per factor: no overflow of 64 bits for one side; the product may need 128.
        let needed = u128::from(covers[0]) * u128::from(covers[1]) * bytes as u128;
        if needed != u128::from(segment.data.size) {
            return Err(format!(
                "segment {}: expected {needed} bytes at byte {}, found a stated length of {}; the file is damaged",
                layout.name, segment.data.offset, segment.data.size
            ));
        }
    }
    Ok(())
}

impl Metadata {
    fn parse(root: Element, size: (usize, usize)) -> Result<Self, MetadataError> {
        let version = version(root, "SIDD")?;
        let name = text(root, &["Display", "PixelType"]);
        let kind = PixelKind::parse(&name).ok_or_else(|| {
            let why = match name.as_str() {
                "RGB24I" | "RGB8LU" => ", an image of colours without amplitude",
                _ => "",
            };
            root.fault(format!(
                "expected Display/PixelType MONO8I, MONO16I or MONO8LU, found '{name}'{why}"
            ))
        })?;
        let remaps: [&[&str]; 2] = [
            &[
                "Display",
                "NonInteractiveProcessing",
                "ProductGenerationOptions",
                "DataRemapping",
                "LUTName",
            ],
            // Version 1.
            &[
                "Display",
                "RemapInformation",
                "MonochromeDisplayRemap",
                "RemapType",
            ],
        ];
        let remap = remaps.iter().find_map(|path| root.find(path));
        let parameter = |name: &str| {
            let own = |element: &Element| {
                element.name() == "ModuleParameter" && element.attribute("name") == Some(name)
            };
            root.descendants().find(own)?.number().ok()
        };
        let levels_db = parameter("black_db").zip(parameter("white_db"));
        Ok(Self {
            version,
            kind,
            remap: remap.map(|name| name.text().into_owned()),
            levels_db: levels_db
                .map(|(black, white)| [black, white])
                .filter(|[black, white]| white > black),
            plane: plane(root, size),
        })
    }
}

/// Image plane of a `PlaneProjection`.
fn plane(root: Element, (rows, columns): (usize, usize)) -> Option<Plane> {
    let projection = root.find(&["Measurement", "PlaneProjection"])?;
    let number = |path: &[&str]| lookup::number(projection, path);
    let axis = |name: &str, count: usize| {
        let step = number(&["SampleSpacing", name])?;
        Some(Axis {
            start: -number(&["ReferencePoint", "Point", name])? * step,
            step,
            count,
        })
    };
    let vector = |path: &[&str]| projection.find(path)?.xyz().ok();
    let grid = ImageGrid::horizontal(axis("Col", columns)?, axis("Row", rows)?, 0.0);
    let frame = SceneFrame::Earth {
        origin_ecf_m: vector(&["ReferencePoint", "ECEF"])?,
        x_axis_ecf: vector(&["ProductPlane", "ColUnitVector"])?,
        y_axis_ecf: vector(&["ProductPlane", "RowUnitVector"])?,
    };
    (grid.fault().is_none() && frame.is_sound()).then_some(Plane {
        grid,
        frame,
        column_band: None,
    })
}

impl ImageSource for SiddFile {
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
