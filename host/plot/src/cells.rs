//! Cells of a picture, gathered window by window.

use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::image::{Image, PixelBlock, power};

use super::layout::{BYTES_A_CELL, distinct, longest, plot_size};
use super::raster::{Reduced, resample};

/// Mean powers on the cells of the picture that [`super::quicklook_within`] draws of an image, gathered from windows of the image
/// in any order. [`super::automatic_levels_db`] of them are the levels of that picture.
///
/// Memory: 16 bytes per cell, and 8 more in [`Self::finish`] where the picture is larger than the image; within the memory of drawing.
#[derive(Debug)]
pub struct PictureCells {
    reduced: Reduced,
    /// Rows and columns gathered, and those of the picture.
    gathered: (usize, usize),
    size: (usize, usize),
}

impl PictureCells {
    /// Cells of the picture of an image on `grid`, drawn with `memory_bytes`.
    pub fn new(grid: &ImageGrid, memory_bytes: u64) -> Self {
        let count = (grid.rows.count, grid.columns.count);
        let longest = longest(memory_bytes, BYTES_A_CELL);
        let (width, height) = plot_size(count, proportions(grid), longest);
        let size = distinct(count, (height, width));
        let gathered = (size.0.min(count.0), size.1.min(count.1));
        Self {
            reduced: Reduced::new(count, gathered.0, gathered.1),
            gathered,
            size,
        }
    }

    /// Add a window of the image. Each pixel may be added only once.
    pub fn add(&mut self, place: &PixelBlock, window: &Image) {
        add_window(&mut self.reduced, place, window);
    }

    /// Powers of the cells, row 0 first; NaN without finite pixels.
    pub fn finish(self) -> Vec<f64> {
        enlarged(self.reduced.finish(), self.gathered, self.size)
    }
}

/// Add a window of an image; pixels beyond the size of `reduced` are left out.
pub(super) fn add_window(reduced: &mut Reduced, [down, across]: &PixelBlock, window: &Image) {
    let lines = window.pixels.chunks_exact(across.len().max(1));
    for (row, values) in down.clone().zip(lines) {
        let powers = values.iter().map(|&z| power(z));
        reduced.add(row, across.start, powers);
    }
}

/// Repeat cells for a larger picture.
pub(super) fn enlarged(cells: Vec<f64>, from: (usize, usize), to: (usize, usize)) -> Vec<f64> {
    if from == to {
        return cells;
    }
    let line = |row: usize| &cells[row * from.1..];
    resample(from, line, |&x| x, to.0, to.1)
}

/// Width and height of a picture in a common unit: metres, or pixels of a polar grid.
pub(super) fn proportions(grid: &ImageGrid) -> (f64, f64) {
    let length = |axis: &Axis| axis.count as f64 * axis.step.abs();
    match grid.polar {
        true => (grid.columns.count as f64, grid.rows.count as f64),
        false => (length(&grid.columns), length(&grid.rows)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Panel, Source};
    use num_complex::Complex32;
    use subaperture_model::image::ImageSource;

    /// Windows in any order give the cells that the picture is drawn from, for images larger and smaller than the picture.
    #[test]
    fn gathered_cells_are_those_of_the_picture() {
        for text in [
            "x=0:37:1,y=0:11:2",
            "x=0:2000:1,y=0:900:1",
            "x=0:50:0.5,y=0:80:1",
        ] {
            let grid: ImageGrid = text.parse().unwrap();
            let (rows, columns) = (grid.rows.count, grid.columns.count);
            let value = |i: usize| Complex32::new((i * 7919 % 1013) as f32, (i % 31) as f32);
            let image = Image {
                rows,
                columns,
                pixels: (0..rows * columns).map(value).collect(),
            };
            let mut cells = PictureCells::new(&grid, u64::MAX);
            let (height, width) = cells.size;
            for place in [
                [rows / 2..rows, 0..columns],
                [0..rows / 2, columns / 3..columns],
                [0..rows / 2, 0..columns / 3],
            ] {
                cells.add(&place, &image.window(&place).unwrap());
            }
            let panel = Panel::new(Source::Whole(&image), &grid, "");
            let drawn = panel.powers(&panel.image, height, width).unwrap();
            for (a, b) in cells.finish().iter().zip(&drawn) {
                assert!((a - b).abs() <= 1e-9 * b, "{text}: {a} {b}");
            }
            assert_eq!(drawn.len(), height * width);
        }
    }
}
