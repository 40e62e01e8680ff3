//! Reader of SIDD files, window by window: NITF 2.1 with uncompressed 8-bit or 16-bit grey, versions 1.0 to 3.0.
//!
//! A pixel's value is its grey, or the amplitude where the file states the levels of black and white (files written by [`Sidd`](crate::Sidd) do). Rows and columns are
//! those of the file. Of several products, the first is read. **Memory** one window, and the XML.

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
}

/// Metadata of the XML.
#[derive(Debug)]
struct Metadata {
    version: String,
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
            if file.name(segment)?.starts_with("SIDD") {
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
        let pixel_bytes = check(&images).map_err(fault)?;
        for (_, segment) in &images {
            file.check(segment)?;
        }
        let columns = images[0].0.columns;
        let mut segments = Vec::with_capacity(images.len());
        let mut rows = 0usize;
        for (layout, segment) in images {
            let [block_columns, block_rows] = layout.block_size();
            segments.push(PixelSegment {
                first_row: rows,
                block_columns,
                block_rows,
                blocks_per_row: layout.blocks[0],
                offset: segment.data.offset,
            });
            rows += layout.rows;
        }
        let size = (rows, columns);
        let metadata = with_root(&xml, memory_bytes, |root| Metadata::parse(root, size))
            .map_err(|error| fault(error.to_string()))?;
        Ok(Self {
            pixels: file.into_pixels(size, pixel_bytes, segments),
            metadata,
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

    /// Name of the remap from magnitude to grey (`LUTName`); `None` if not stated.
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
        let (grey, white) = match *bytes {
            [high, low] => (f64::from(u16::from_be_bytes([high, low])), 65_535.0),
            [grey] => (f64::from(grey), 255.0),
            _ => (0.0, 255.0),
        };
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

/// Check segments against each other and their stated lengths; returns the size of a pixel in bytes.
fn check(images: &[(Layout, Segment)]) -> Result<usize, String> {
    let (first, _) = &images[0];
    let bytes = match (first.kind.as_str(), first.bits, first.bands) {
        ("INT", 8, 1) => 1usize,
        ("INT", 16, 1) => 2,
        (kind, bits, bands) => {
            return Err(format!(
                "expected one band of INT, 8 or 16 bits; found {bands} bands of {kind}, {bits} bits"
            ));
        }
    };
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
    Ok(bytes)
}

impl Metadata {
    fn parse(root: Element, size: (usize, usize)) -> Result<Self, MetadataError> {
        let version = version(root, "SIDD")?;
        let kind = text(root, &["Display", "PixelType"]);
        if !["MONO8I", "MONO16I"].contains(&kind.as_str()) {
            return Err(root.fault(format!(
                "expected Display/PixelType MONO8I or MONO16I, found '{kind}'"
            )));
        }
        let remap = root.find(&[
            "Display",
            "NonInteractiveProcessing",
            "ProductGenerationOptions",
            "DataRemapping",
            "LUTName",
        ]);
        let parameter = |name: &str| {
            let own = |element: &Element| {
                element.name() == "ModuleParameter" && element.attribute("name") == Some(name)
            };
            root.descendants().find(own)?.number().ok()
        };
        let levels_db = parameter("black_db").zip(parameter("white_db"));
        Ok(Self {
            version,
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
