//! A grid cut into rectangular patches, each with its own pixels of the image to write to.

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::geometry::ImageGrid;

/// How many rows and columns of pixels a patch has at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PatchSize {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
}

impl PatchSize {
    /// The size nearest to a square of side `side_m`, at least 4 pixels a side (fewer cost more to keep
    /// account of than they hold) and at most the grid. A polar grid's angle counts as the arc at its
    /// middle range.
    pub fn from_metres(grid: &ImageGrid, side_m: f64) -> Self {
        let [row_m, column_m] = pixel_spacing_m(grid);
        let pixels = |spacing_m: f64, count: usize| {
            ((side_m / spacing_m).round() as usize).clamp(count.min(4), count)
        };
        Self {
            rows: pixels(row_m, grid.rows.count),
            columns: pixels(column_m, grid.columns.count),
        }
    }

    /// Length of the longer side, metres.
    pub fn side_m(&self, grid: &ImageGrid) -> f64 {
        let [row_m, column_m] = pixel_spacing_m(grid);
        (self.rows as f64 * row_m).max(self.columns as f64 * column_m)
    }
}

fn pixel_spacing_m(grid: &ImageGrid) -> [f64; 2] {
    let column_m = if grid.polar {
        let middle_m = grid.rows.at(grid.rows.count / 2).abs();
        grid.columns.step * middle_m.max(grid.rows.step)
    } else {
        grid.columns.step
    };
    [grid.rows.step, column_m]
}

/// A patch's place in the grid: first row and column, and how many of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// First row.
    pub row: usize,
    /// First column.
    pub column: usize,
    /// Pixels in it.
    pub size: PatchSize,
}

impl Rectangle {
    /// The scene point at fractions of the patch, 0 at its first pixel and 1 at its last.
    pub fn point_m(&self, grid: &ImageGrid, row_fraction: f64, column_fraction: f64) -> DVec3 {
        let along = |first: usize, count: usize, fraction: f64| {
            first as f64 + fraction * (count as f64 - 1.0)
        };
        let row = along(self.row, self.size.rows, row_fraction);
        let column = along(self.column, self.size.columns, column_fraction);
        grid.point_m(
            grid.rows.start + row * grid.rows.step,
            grid.columns.start + column * grid.columns.step,
        )
    }

    /// The scene point in its middle.
    pub fn centre_m(&self, grid: &ImageGrid) -> DVec3 {
        self.point_m(grid, 0.5, 0.5)
    }
}

/// The rectangles that cover the grid, row by row of patches. Their sizes differ by at most one pixel.
pub fn rectangles(grid: &ImageGrid, at_most: PatchSize) -> Vec<Rectangle> {
    let cuts = |count: usize, at_most: usize| -> Vec<(usize, usize)> {
        let parts = count.div_ceil(at_most.max(1));
        (0..parts)
            .map(|i| {
                (
                    i * count / parts,
                    (i + 1) * count / parts - i * count / parts,
                )
            })
            .collect()
    };
    let columns = cuts(grid.columns.count, at_most.columns);
    cuts(grid.rows.count, at_most.rows)
        .into_iter()
        .flat_map(|(row, rows)| {
            columns.iter().map(move |&(column, columns)| Rectangle {
                row,
                column,
                size: PatchSize { rows, columns },
            })
        })
        .collect()
}

/// Bytes that `rectangles` and what [`split`] makes of them take.
pub(crate) fn account_bytes(rectangles: &[Rectangle]) -> u64 {
    let own = size_of::<Rectangle>() + size_of::<Vec<&mut [Complex32]>>();
    let rows: usize = rectangles.iter().map(|r| r.size.rows).sum();
    // Vectors grow by doubling.
    (rectangles.len() * own + 2 * rows * size_of::<&mut [Complex32]>()) as u64
}

/// The pixels of every rectangle, as disjoint row segments of one image. `rectangles` must be those
/// that [`rectangles`] returns for a grid with this many columns.
pub(crate) fn split<'a>(
    pixels: &'a mut [Complex32],
    num_columns: usize,
    rectangles: &[Rectangle],
) -> Vec<Vec<&'a mut [Complex32]>> {
    let per_row = rectangles.iter().take_while(|r| r.row == 0).count().max(1);
    let mut patches: Vec<Vec<&mut [Complex32]>> = rectangles.iter().map(|_| Vec::new()).collect();
    let mut rows = pixels.chunks_exact_mut(num_columns.max(1));
    for (band, patches) in rectangles.chunks(per_row).zip(patches.chunks_mut(per_row)) {
        for mut rest in rows.by_ref().take(band[0].size.rows) {
            for (rectangle, patch) in band.iter().zip(patches.iter_mut()) {
                let (segment, tail) = rest.split_at_mut(rectangle.size.columns);
                patch.push(segment);
                rest = tail;
            }
        }
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_tile_the_image() {
        let grid: ImageGrid = "x=0:11:1,y=0:7:1".parse().unwrap();
        let rectangles = rectangles(
            &grid,
            PatchSize {
                rows: 3,
                columns: 4,
            },
        );
        assert_eq!(rectangles.len(), 9);
        let mut pixels = vec![Complex32::ZERO; 77];
        for (i, patch) in split(&mut pixels, 11, &rectangles).into_iter().enumerate() {
            assert_eq!(patch.len(), rectangles[i].size.rows);
            for row in patch {
                assert_eq!(row.len(), rectangles[i].size.columns);
                row.iter_mut()
                    .for_each(|z| *z += Complex32::new(i as f32 + 1.0, 0.0));
            }
        }
        for (i, z) in pixels.iter().enumerate() {
            let (row, column) = (i / 11, i % 11);
            let owner = &rectangles[z.re as usize - 1];
            assert!((owner.row..owner.row + owner.size.rows).contains(&row));
            assert!((owner.column..owner.column + owner.size.columns).contains(&column));
        }
    }
}
