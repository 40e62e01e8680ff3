//! Writer of KMZ ground overlays, for Google Earth and similar viewers.
//!
//! The map is in longitude and latitude, so that an overlay's box is the outer edge of its pixels. A map of up to 1024 pixels per side is one
//! overlay. A larger one is a super-overlay: tiles of 512 x 512 pixels, each a document with its region and links to the
//! four tiles of the next finer level, so that a viewer loads only what it displays. Pixels outside the image are transparent.
//!
//! The archive begins with `doc.kml`; pictures are PNG, grey and alpha.

use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::Path;

use png::{BitDepth, ColorType};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use subaperture_io::atomic::AtomicFile;
use subaperture_io::ours::TEXT_MARK;
use subaperture_io::written::{FileKind, WrittenFile};
use subaperture_model::monitor::Monitor;

use crate::first_error::{FirstError, KeptError};
use crate::levels::Levels;
use crate::pyramid::{Pyramid, TILE, Tile, Values, tiles};
use crate::{MapError, Ortho, Raster};

/// Largest side of a map in one overlay, pixels.
const ONE_PICTURE: usize = 1024;

/// Size on screen from which a tile is displayed (`minLodPixels`), pixels.
const SHOWN_FROM: usize = TILE / 2;

/// Write a map in longitude and latitude atomically.
///
/// # Errors
/// [`MapError`] if the image cannot be read or resampled, the file cannot be written, or the monitor cancels.
///
/// # Panics
/// If the map is not in longitude and latitude (EPSG 4326).
pub fn write(
    path: &Path,
    ortho: &Ortho,
    levels: Levels,
    title: &str,
    monitor: &dyn Monitor,
) -> Result<Vec<WrittenFile>, MapError> {
    let raster = ortho.raster();
    assert_eq!(
        raster.projection.epsg(),
        4326,
        "overlays are in longitude and latitude"
    );
    let mut pending = AtomicFile::create(path, 0, ".part")?;
    let mut archive = Archive::new(BufWriter::new(
        pending.file().try_clone().map_err(|e| pending.failed(e))?,
    ));
    let written = match raster.rows.max(raster.columns) > ONE_PICTURE {
        true => archive.tiles(ortho, levels, title, monitor),
        false => archive.one(ortho, levels, title, monitor),
    };
    written
        .and_then(|()| archive.finish())
        .map_err(|e| match e {
            Failure::Map(error) => error,
            Failure::Io(source) => pending.failed(source).into(),
        })?;
    pending.commit()?;
    Ok(vec![WrittenFile::new(path, FileKind::Kmz)])
}

enum Failure {
    Map(MapError),
    Io(std::io::Error),
}

impl From<MapError> for Failure {
    fn from(error: MapError) -> Self {
        Self::Map(error)
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<zip::result::ZipError> for Failure {
    fn from(error: zip::result::ZipError) -> Self {
        Self::Io(error.into())
    }
}

struct Archive {
    zip: ZipWriter<FirstError<BufWriter<std::fs::File>>>,
    /// The archive's writer panics after an error below it, and keeps no cause.
    error: KeptError,
}

impl Archive {
    fn new(out: BufWriter<std::fs::File>) -> Self {
        let out = FirstError::new(out);
        Self {
            error: out.error(),
            zip: ZipWriter::new(out),
        }
    }

    /// Add a file uncompressed: PNG is compressed already, and the text mark of a document stays readable in its first bytes.
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        let how = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        self.zip.start_file(name, how)?;
        self.zip.write_all(bytes)?;
        Ok(self.error.check()?)
    }

    fn finish(self) -> Result<(), Failure> {
        self.zip.finish()?.flush()?;
        Ok(self.error.check()?)
    }

    fn one(
        &mut self,
        ortho: &Ortho,
        levels: Levels,
        title: &str,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let raster = ortho.raster();
        let bounds = Bounds::of(raster, [0, 0], [raster.rows, raster.columns], 1);
        let overlay = bounds.overlay("map.png", 0);
        self.add("doc.kml", document(title, &overlay).as_bytes())?;
        let mut greys = Vec::with_capacity(2 * raster.rows * raster.columns);
        for first in (0..raster.rows).step_by(TILE) {
            if monitor.cancelled() {
                return Err(MapError::Cancelled.into());
            }
            let rows = first..(first + TILE).min(raster.rows);
            let powers = ortho.powers(&[rows.clone(), 0..raster.columns])?;
            greys.extend(
                powers
                    .into_iter()
                    .flat_map(|power| levels.grey_alpha(power)),
            );
            monitor.progress(rows.end as f64 / raster.rows as f64);
        }
        let picture = picture([raster.rows, raster.columns], &greys)?;
        self.add("map.png", &picture)
    }

    fn tiles(
        &mut self,
        ortho: &Ortho,
        levels: Levels,
        title: &str,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let raster = ortho.raster();
        let mut pyramid = Pyramid::new(ortho, Values::Powers, monitor);
        let sizes = pyramid.levels().to_vec();
        let name = |level: usize, [row, column]: [usize; 2]| format!("{level}-{row}-{column}");
        let bounds = |level: usize, at: [usize; 2]| {
            let size = [0, 1].map(|i| (sizes[level][i] - at[i] * TILE).min(TILE));
            Bounds::of(raster, at.map(|i| i * TILE), size, 1 << level)
        };
        let link = |level: usize, at: [usize; 2]| {
            let name = name(level, at);
            format!(
                "<NetworkLink><name>{name}</name>{}<Link><href>{name}.kml</href><viewRefreshMode>onRegion</viewRefreshMode></Link></NetworkLink>",
                bounds(level, at).region(level == sizes.len() - 1)
            )
        };
        let top = sizes.len() - 1;
        self.add("doc.kml", document(title, &link(top, [0, 0])).as_bytes())?;
        let mut failure = None;
        let made = pyramid.make(&mut |level, at, tile: &Tile| {
            let bounds = bounds(level, at);
            let name = name(level, at);
            let mut body = bounds.region(level == top);
            body += &bounds.overlay(&format!("{name}.png"), top - level);
            if level > 0 {
                let below = tiles(sizes[level - 1]);
                for [down, right] in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                    let of = [2 * at[0] + down, 2 * at[1] + right];
                    if of[0] < below[0] && of[1] < below[1] {
                        body += &link(level - 1, of);
                    }
                }
            }
            let [rows, columns] = tile.size;
            let lines = tile.values.chunks(TILE).take(rows);
            let greys = lines.flat_map(|line| &line[..columns]);
            let greys: Vec<u8> = greys.flat_map(|z| levels.grey_alpha(z.re)).collect();
            let added = picture(tile.size, &greys)
                .map_err(Failure::Io)
                .and_then(|picture| self.add(&format!("{name}.png"), &picture))
                .and_then(|()| self.add(&format!("{name}.kml"), document(&name, &body).as_bytes()));
            added.map_err(|e| match e {
                Failure::Map(error) => error,
                Failure::Io(source) => {
                    failure = Some(source);
                    MapError::Cancelled
                }
            })
        });
        match (failure, made) {
            (Some(source), _) => Err(Failure::Io(source)),
            (None, made) => Ok(made?),
        }
    }
}

/// Bounding box in longitude and latitude, degrees.
struct Bounds {
    north: f64,
    south: f64,
    east: f64,
    west: f64,
}

impl Bounds {
    /// Outer edges of `size` pixels from row and column `first` on, in an overview decimated by `coarser`.
    fn of(raster: &Raster, first: [usize; 2], size: [usize; 2], coarser: usize) -> Self {
        let corner = |at: [usize; 2]| raster.coordinates(at.map(|i| (i * coarser) as f64));
        let [west, north] = corner(first);
        let [east, south] = corner([first[0] + size[0], first[1] + size[1]]);
        Self {
            north,
            south,
            east,
            west,
        }
    }

    fn edges(&self) -> String {
        let Self {
            north,
            south,
            east,
            west,
        } = self;
        format!(
            "<north>{north}</north><south>{south}</south><east>{east}</east><west>{west}</west>"
        )
    }

    fn overlay(&self, picture: &str, order: usize) -> String {
        format!(
            "<GroundOverlay><name>{picture}</name><drawOrder>{order}</drawOrder><Icon><href>{picture}</href></Icon><LatLonBox>{}</LatLonBox></GroundOverlay>",
            self.edges()
        )
    }

    /// `Region` element; the coarsest tile (`first`) is displayed at any size.
    fn region(&self, first: bool) -> String {
        let least = if first { 0 } else { SHOWN_FROM };
        format!(
            "<Region><LatLonAltBox>{}</LatLonAltBox><Lod><minLodPixels>{least}</minLodPixels><maxLodPixels>-1</maxLodPixels></Lod></Region>",
            self.edges()
        )
    }
}

fn document(title: &str, body: &str) -> String {
    let mut escaped = String::new();
    for c in title.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            c if c.is_control() => {}
            c => escaped.push(c),
        }
    }
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>");
    let _ = write!(
        text,
        "<!-- {TEXT_MARK} --><kml xmlns=\"http://www.opengis.net/kml/2.2\"><Document><name>{escaped}</name>{body}</Document></kml>"
    );
    text
}

/// Encode interleaved grey and alpha as PNG.
pub(crate) fn picture([rows, columns]: [usize; 2], greys: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, columns as u32, rows as u32);
    encoder.set_color(ColorType::GrayscaleAlpha);
    encoder.set_depth(BitDepth::Eight);
    let encoded = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(greys)?;
        writer.finish()
    });
    encoded.map_err(std::io::Error::other)?;
    Ok(out)
}
