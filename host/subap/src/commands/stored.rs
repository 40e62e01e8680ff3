//! Opening of images for commands, in any format that [`subaperture::images`] recognises.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{anyhow, bail};
use serde::Deserialize;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::{Image, ImageSource};
use subaperture::images::{OpenImage, Reading, Values};
use subaperture::quality::aperture::Aperture;
use subaperture::quality::response::Geometry;
use subaperture::signal::window::Window;

use crate::config::Session;

pub(super) use subaperture::images::product_folder;

/// Number of samples of the weights along an aperture.
const WEIGHTS: usize = 256;

/// Open an image; the array of a product is read once to verify its CRC-32.
pub(super) fn open(session: &Session, path: &Path) -> anyhow::Result<OpenImage> {
    open_how(session, path, true)
}

/// Open an image without reading its pixels.
pub(super) fn open_unread(session: &Session, path: &Path) -> anyhow::Result<OpenImage> {
    open_how(session, path, false)
}

fn open_how(session: &Session, path: &Path, verified: bool) -> anyhow::Result<OpenImage> {
    let reading = Reading {
        memory_bytes: session.memory_bytes,
        verified,
    };
    Ok(OpenImage::open(path, &reading)?)
}

/// Aperture of an image: from a product's record, or from a SICD's metadata and the mean frequency of its pixels.
pub(super) fn aperture(image: &OpenImage) -> anyhow::Result<Option<Aperture>> {
    match image.column_band() {
        Some(column_band) => Aperture::columns(column_band, &image.pixels)
            .map_err(|error| anyhow!(error).context(image.path.display().to_string())),
        None => Ok(recorded_aperture(image)),
    }
}

fn recorded_aperture(image: &OpenImage) -> Option<Aperture> {
    let record = image.record.as_ref()?;
    let (grid, _) = image.grid()?;
    let seen = Geometry::deserialize(&record["collection"]).ok()?;
    let window = record["settings"]["slow_window"].as_str();
    let window: Option<Window> = window.and_then(|text| text.parse().ok());
    let weights = window.map_or_else(Vec::new, |window| window.weights(WEIGHTS));
    Aperture::seen(&seen, grid).map(|aperture| aperture.weighted(weights))
}

/// Fail if two images do not have the same pixel positions.
pub(super) fn check_same_pixels(image: &OpenImage, other: &OpenImage) -> anyhow::Result<()> {
    if !image.has_pixels_of(other) {
        bail!(
            "{} and {} are on different grids: form both with one --grid",
            image.path.display(),
            other.path.display()
        );
    }
    let [size, others] = [image, other].map(|image| image.pixels.size());
    if size != others {
        bail!(
            "{} has {} rows x {} columns, {} has {} x {}: expected the same pixels in both",
            image.path.display(),
            size.0,
            size.1,
            other.path.display(),
            others.0,
            others.1
        );
    }
    Ok(())
}

/// Fail if an image is detected.
pub(super) fn check_complex(image: &OpenImage) -> anyhow::Result<()> {
    match image.values {
        Values::Complex => Ok(()),
        values => bail!(
            "{}: expected a complex image, found {values}: interferometry needs the phase, so give the complex image from which it was made",
            image.path.display()
        ),
    }
}

/// All pixels of an image.
pub(super) fn whole(source: &dyn ImageSource) -> anyhow::Result<Image> {
    let (rows, columns) = source.size();
    let read = source.window(&[0..rows, 0..columns]);
    read.map_err(|error| anyhow!(error))
}

/// Grid and scene frame of an image, or its rows and columns.
pub(super) fn grid(image: &OpenImage) -> (ImageGrid, SceneFrame) {
    match image.grid() {
        Some((grid, frame)) => (grid.clone(), frame.unwrap_or(SceneFrame::Local)),
        None => (image.pixel_grid(), SceneFrame::Local),
    }
}

/// Whether a readable file begins with these bytes.
pub(super) fn begins_with<const N: usize>(path: &Path, bytes: &[u8; N]) -> bool {
    let mut start = [0; N];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && &start == bytes
}
