//! Sub-aperture tiles.

use subaperture_model::image::{ImageSource, ImageSourceError, PixelBlock};
use subaperture_quality::aperture::{Aperture, parts_of};

use super::pixels::Pixels;
use super::tile::{average, cells};
use subaperture_model::geometry::ImageGrid;

/// Coarsest level of a sub-aperture tile: 1024 x 1024 pixels, 8 MB, computed from patches of 768 x 768 pixels, 5 MB each in two copies.
pub(super) const COARSEST: u32 = 2;

/// Maximum memory of a sub-aperture tile, bytes.
pub(super) const MAX_BYTES: u64 = 24 << 20;

/// Cells of a tile and their mean powers, for the part of the aperture between two fractions of it. `None` if the tile
/// does not exist or the aperture is unknown there.
pub(super) fn powers(
    pixels: &Pixels,
    grid: &ImageGrid,
    aperture: &Aperture,
    part: [f64; 2],
    (level, at): (u32, [usize; 2]),
) -> Result<Option<(PixelBlock, Vec<f64>)>, ImageSourceError> {
    let (rows, columns) = pixels.size();
    let size = [rows, columns];
    let Some(tile) = cells(size, level, at).filter(|_| level <= COARSEST) else {
        return Ok(None);
    };
    let place: PixelBlock =
        [0, 1].map(|i| (tile[i].start << level)..(tile[i].end << level).min(size[i]));
    let found = parts_of(pixels, grid, aperture, &place, &[part])?;
    let one = found.and_then(|mut found| found.pop());
    Ok(one.map(|seen| (tile, average(&seen, level))))
}
