//! Results on the pixels of an image as GeoTIFF and Zarr.

use std::path::Path;

use anyhow::bail;
use subaperture::geometry::{ImageGrid, SceneFrame};
use subaperture::image::Image;
use subaperture::images::OpenImage;
use subaperture::io::stack::{Stack, StackError};
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::maps::{Ortho, Projection, Raster, cog};
use subaperture::num_complex::Complex32;

use crate::config::Session;
use crate::interrupt;

/// Map of an image's pixels.
pub(super) struct Map<'a> {
    /// Name of the file in the folder.
    pub(super) name: &'a str,
    pub(super) title: &'a str,
    pub(super) image: &'a Image,
    pub(super) layout: cog::Layout,
}

/// Fail if an image has no position on the Earth.
pub(super) fn check_place(image: &OpenImage) -> anyhow::Result<()> {
    let name = image.path.display();
    match image.grid() {
        None => bail!(
            "--format cog: {name} has no metadata that state its position: give products of subap focus, or --format zarr"
        ),
        Some((_, None | Some(SceneFrame::Local))) => bail!(
            "--format cog: {name} does not state its position on the Earth: give the scene's origin with --place LAT,LON[,HEIGHT]"
        ),
        _ => Ok(()),
    }
}

/// Real values as an image.
pub(super) fn real(rows: usize, columns: usize, values: &[f32]) -> Image {
    Image {
        rows,
        columns,
        // A missing value has both parts missing.
        pixels: values.iter().map(|&v| Complex32::new(v, v * 0.0)).collect(),
    }
}

/// Add maps in UTM by the nearest pixel to a set of files.
pub(super) fn add_maps(
    session: &Session,
    folder: &Path,
    (grid, frame): (&ImageGrid, &SceneFrame),
    maps: &[Map],
    files: &mut FileSet,
) -> anyhow::Result<()> {
    let raster = Raster::covering(grid, frame, Projection::utm, None)?;
    let progress = session.progress("writing maps");
    for map in maps {
        let ortho = Ortho::nearest(map.image, grid, frame, raster)?;
        let path = folder.join(map.name);
        cog::add_to(files, &path, &ortho, map.layout, map.title, &progress)?;
        interrupt::check()?;
    }
    progress.finish();
    Ok(())
}

/// Write a Zarr group.
pub(super) fn write_stack(
    session: &Session,
    stack: &Stack,
    path: &Path,
) -> anyhow::Result<WrittenFile> {
    let progress = session.progress("writing");
    match stack.write(path, &progress) {
        Err(StackError::Cancelled) => {
            interrupt::check()?;
            bail!("interrupted");
        }
        wrote => wrote?,
    }
    progress.finish();
    Ok(WrittenFile::new(path, FileKind::Zarr))
}
