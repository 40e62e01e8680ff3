//! Tiles of a part of the aperture.

use subaperture_model::image::{Parts, PartsError, Place};
use subaperture_quality::aperture::{Aperture, parts_of};

use super::pixels::Pixels;
use super::tile::{average, cells};
use subaperture_model::geometry::ImageGrid;

/// The coarsest level of such a tile: with their margin 1152 x 1152 pixels are transformed for it, 11 MB, of which 8 MB are kept.
pub(super) const COARSEST: u32 = 2;

/// Mean powers of a tile's cells with the part of the aperture between two fractions of it, and the cells; `None` if there is no such tile, or the aperture is not known there.
pub(super) fn powers(
    pixels: &Pixels,
    grid: &ImageGrid,
    aperture: &Aperture,
    part: [f64; 2],
    (level, at): (u32, [usize; 2]),
) -> Result<Option<(Place, Vec<f64>)>, PartsError> {
    let (rows, columns) = pixels.size();
    let size = [rows, columns];
    let Some(tile) = cells(size, level, at).filter(|_| level <= COARSEST) else {
        return Ok(None);
    };
    let place: Place =
        [0, 1].map(|i| (tile[i].start << level)..(tile[i].end << level).min(size[i]));
    let found = parts_of(pixels, grid, aperture, &place, &[part])?;
    let one = found.and_then(|mut found| found.pop());
    Ok(one.map(|seen| (tile, average(&seen, level))))
}
