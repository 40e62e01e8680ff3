//! Images that are read part by part, because they need not fit in memory.

use std::fmt::Debug;
use std::ops::Range;

use super::{Image, Peak, power};

/// Rows and columns of an image.
pub type Place = [Range<usize>; 2];

/// Why a part was not read.
pub type PartsError = Box<dyn std::error::Error + Send + Sync>;

/// Pixels of a part that is no tile, about.
const PART_PIXELS: usize = 1 << 16;

/// An image that is read part by part.
pub trait Parts: Debug {
    /// Rows and columns.
    fn size(&self) -> (usize, usize);

    /// Places that cover the image once and are read at the least cost.
    fn places(&self) -> Vec<Place>;

    /// Reads a place that lies within the image.
    ///
    /// # Errors
    /// If it cannot be read.
    fn window(&self, place: &Place) -> Result<Image, PartsError>;
}

impl Parts for Image {
    fn size(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    fn places(&self) -> Vec<Place> {
        bands(self.rows, self.columns)
    }

    fn window(&self, [rows, columns]: &Place) -> Result<Image, PartsError> {
        let row = |row: usize| &self.pixels[row * self.columns..][columns.clone()];
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: rows.clone().flat_map(row).copied().collect(),
        })
    }
}

/// The brightest pixel of an image that is read part by part, as [`Image::peak`].
///
/// # Errors
/// [`PartsError`] if a part cannot be read.
pub fn peak_of(image: &dyn Parts) -> Result<Option<Peak>, PartsError> {
    let columns = image.size().1;
    let mut best: Option<Peak> = None;
    for place in image.places() {
        let Some(peak) = image.window(&place)?.peak() else {
            continue;
        };
        let peak = Peak {
            row: place[0].start + peak.row,
            column: place[1].start + peak.column,
            ..peak
        };
        let index = |peak: &Peak| peak.row * columns + peak.column;
        let better = |best: &Peak| {
            let (new, old) = (power(peak.value), power(best.value));
            new > old || (new == old && index(&peak) < index(best))
        };
        if best.as_ref().is_none_or(better) {
            best = Some(peak);
        }
    }
    Ok(best)
}

/// Runs of whole rows, each of some ten thousand pixels.
pub fn bands(rows: usize, columns: usize) -> Vec<Place> {
    let height = (PART_PIXELS / columns.max(1)).max(1);
    (0..rows)
        .step_by(height)
        .map(|first| [first..(first + height).min(rows), 0..columns])
        .collect()
}
