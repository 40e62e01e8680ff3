//! Reader of SIDD files, window by window: NITF 2.1 with uncompressed 8-bit or 16-bit grey, versions 1.0 to 3.0.
//!
//! A pixel's value is its grey, or the amplitude where the file states the levels of black and white (files written by [`Sidd`](crate::Sidd) do). Rows and columns are
//! those of the file. Of several products, the first is read. **Memory** one window, and the XML.

use std::fs::File;
use std::path::Path;

use num_complex::Complex32;

use subaperture_io::xml::DEFAULT_MEMORY_BYTES;
use subaperture_model::geometry::{Axis, ImageGrid, SceneFrame};
use subaperture_model::image::{
    Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks, bands,
};

use crate::Plane;
use crate::container::{Blocks, Container, Pixels, ReadError};
use crate::header::Layout;
use crate::lookup::{Lookup, document};

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
    let first = || -> Option<Vec<u8>> {
        let mut container = Container::open(File::open(path).ok()?, path).ok()?;
        let at = container.header.images.first()?.header;
        container.bytes(at, 12, "an image header").ok()
    };
    first().is_some_and(|name| name[2..].starts_with(b"SIDD"))
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
        let file = File::open(path).map_err(|source| ReadError::Io {
            path: path.to_owned(),
            source,
        })?;
        let mut container = Container::open(file, path)?;
        let mut images: Vec<(Layout, u64, u64)> = Vec::new();
        for segment in container.header.images.clone() {
            let bytes = container.image_header(&segment)?;
            // Legends and other images of the file are skipped.
            if !String::from_utf8_lossy(bytes.get(2..12).unwrap_or_default()).starts_with("SIDD") {
                continue;
            }
            let layout =
                Layout::parse(&bytes).map_err(|what| container.image_fault(&segment, &what))?;
            images.push((layout, segment.data, segment.data_bytes));
        }
        images.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        let wrong = |container: &Container, what: &str| container.fault(what.to_owned());
        let xml = container
            .xml("SIDD", memory_bytes)?
            .ok_or_else(|| wrong(&container, "expected SIDD XML, found another NITF file"))?;
        let Some(product) = images.first().map(|(layout, ..)| layout.name.clone()) else {
            return Err(wrong(
                &container,
                "expected a SIDD image segment, found none",
            ));
        };
        let product = product.get(..7).unwrap_or(&product).to_owned();
        images.retain(|(layout, ..)| layout.name.starts_with(&product));
        let pixel_bytes = check(&images, container.length).map_err(|what| container.fault(what))?;
        let columns = images[0].0.columns;
        let mut segments = Vec::with_capacity(images.len());
        let mut rows = 0usize;
        for (layout, data, _) in images {
            let [wide, high] = layout.block_size();
            segments.push(Blocks {
                first_row: rows,
                wide,
                high,
                across: layout.blocks[0],
                data,
            });
            rows += layout.rows;
        }
        let size = (rows, columns);
        let metadata =
            Metadata::parse(&xml, size, memory_bytes).map_err(|what| container.fault(what))?;
        Ok(Self {
            pixels: container.into_pixels(size, pixel_bytes, segments),
            metadata,
        })
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        self.pixels.path()
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

impl Layout {
    /// Columns and rows of a block, pixels.
    fn block_size(&self) -> [usize; 2] {
        let side = |block: usize, whole: usize| if block == 0 { whole } else { block };
        [
            side(self.block[0], self.columns),
            side(self.block[1], self.rows),
        ]
    }
}

/// Check segments against each other and against the file size; returns the size of a pixel in bytes.
fn check(images: &[(Layout, u64, u64)], length: u64) -> Result<usize, String> {
    let (first, ..) = &images[0];
    let bytes = match (first.kind.as_str(), first.bits, first.bands) {
        ("INT", 8, 1) => 1usize,
        ("INT", 16, 1) => 2,
        (kind, bits, bands) => {
            return Err(format!(
                "expected one band of INT, 8 or 16 bits; found {bands} bands of {kind}, {bits} bits"
            ));
        }
    };
    for (layout, data, data_bytes) in images {
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
        let end = data.checked_add(*data_bytes);
        if needed != u128::from(*data_bytes) || end.is_none_or(|end| end > length) {
            return Err(format!(
                "segment {}: expected {needed} bytes at byte {data}, found a stated length of {data_bytes} in a file of {length} bytes; it is truncated or damaged",
                layout.name
            ));
        }
    }
    Ok(bytes)
}

impl Metadata {
    fn parse(xml: &str, size: (usize, usize), memory_bytes: u64) -> Result<Self, String> {
        let document = document(xml, memory_bytes)?;
        let node = document.root_element();
        let namespace = node.tag_name().namespace().unwrap_or_default();
        let version = namespace.strip_prefix("urn:SIDD:").unwrap_or_default();
        if node.tag_name().name() != "SIDD" || version.is_empty() {
            return Err(format!(
                "expected SIDD XML, found element '{}' in namespace '{namespace}'",
                node.tag_name().name()
            ));
        }
        let root = Lookup::of(node);
        let kind = root.text(&["Display", "PixelType"]).unwrap_or_default();
        if !["MONO8I", "MONO16I"].contains(&kind) {
            return Err(format!(
                "expected Display/PixelType MONO8I or MONO16I, found '{kind}'"
            ));
        }
        let remap = root.text(&[
            "Display",
            "NonInteractiveProcessing",
            "ProductGenerationOptions",
            "DataRemapping",
            "LUTName",
        ]);
        let parameter = |name: &str| {
            let own = |node: &roxmltree::Node<'_, '_>| {
                node.tag_name().name() == "ModuleParameter" && node.attribute("name") == Some(name)
            };
            let value: f64 = node.descendants().find(own)?.text()?.trim().parse().ok()?;
            value.is_finite().then_some(value)
        };
        let levels_db = parameter("black_db").zip(parameter("white_db"));
        Ok(Self {
            version: version.to_owned(),
            remap: remap.map(str::to_owned),
            levels_db: levels_db
                .map(|(black, white)| [black, white])
                .filter(|[black, white]| white > black),
            plane: plane(root, size),
        })
    }
}

/// Image plane of a `PlaneProjection`.
fn plane(root: Lookup, (rows, columns): (usize, usize)) -> Option<Plane> {
    let number = |path: &[&str]| {
        root.number(&[&["Measurement", "PlaneProjection"], path].concat())
            .filter(|value| value.is_finite())
    };
    let axis = |name: &str, count: usize| {
        let step = number(&["SampleSpacing", name])?;
        Some(Axis {
            start: -number(&["ReferencePoint", "Point", name])? * step,
            step,
            count,
        })
    };
    let vector = |path: &[&str]| root.vector(&[&["Measurement", "PlaneProjection"], path].concat());
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
