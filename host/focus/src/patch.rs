//! Division of a grid into rectangular patches with separate pixels.

use std::collections::BTreeMap;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::Complex32;

use super::Tile;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{PixelBlock, Tiling};

/// Largest number of rows and columns of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PatchSize {
    /// Number of pixel rows.
    pub rows: usize,
    /// Number of pixel columns.
    pub columns: usize,
}

impl PatchSize {
    /// Patch of one pixel.
    pub const PIXEL: Self = Self {
        rows: 1,
        columns: 1,
    };

    /// Patch with as many rows as columns.
    pub(crate) const fn square(side: usize) -> Self {
        Self {
            rows: side,
            columns: side,
        }
    }

    /// Patch size nearest to a square of side `side_m`, at least 4 pixels per side (smaller ones cost more than they
    /// save) and at most the grid. The angle of a polar grid counts as the arc at its
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

/// Position and size of a patch in the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    /// First row of pixels.
    pub row: usize,
    /// First column of pixels.
    pub column: usize,
    /// Number of rows and columns.
    pub size: PatchSize,
}

impl Rectangle {
    /// Make the rectangle of the given rows and columns.
    pub fn of([rows, columns]: &PixelBlock) -> Self {
        Self {
            row: rows.start,
            column: columns.start,
            size: PatchSize {
                rows: rows.len(),
                columns: columns.len(),
            },
        }
    }

    /// Whether any pixel lies in the given rows and columns.
    pub(crate) fn meets(&self, other: &PixelBlock) -> bool {
        let mut axes = self.place().into_iter().zip(other);
        axes.all(|(own, other)| own.start < other.end && other.start < own.end)
    }

    /// Ranges of rows and columns.
    pub fn place(&self) -> PixelBlock {
        [
            self.row..self.row + self.size.rows,
            self.column..self.column + self.size.columns,
        ]
    }

    /// Scene point at fractions of the patch, 0 at its first pixel and 1 at its last.
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

    /// Whether the rectangle contains a row and column of the grid.
    pub fn contains(&self, row: usize, column: usize) -> bool {
        let [rows, columns] = self.place();
        rows.contains(&row) && columns.contains(&column)
    }

    /// Scene point at the centre of the patch.
    pub fn centre_m(&self, grid: &ImageGrid) -> DVec3 {
        self.point_m(grid, 0.5, 0.5)
    }
}

/// Divide the grid into rectangles of one size, at most `at_most`, in row-major order; those at the ends may
/// be smaller.
pub fn rectangles(grid: &ImageGrid, at_most: PatchSize) -> Vec<Rectangle> {
    Patches::new(grid, at_most).all().collect()
}

/// Division of a grid into patches of one size, smaller at the ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Patches(Tiling);

/// Contiguous pixels of one row.
pub(crate) struct Segment<'a> {
    pub(crate) row: usize,
    /// Column of the first pixel.
    pub(crate) column: usize,
    pub(crate) pixels: &'a mut [Complex32],
}

impl Segment<'_> {
    /// Add the pixels of the patch at `place`, row-major, that are in the segment.
    pub(crate) fn add(&mut self, place: &Rectangle, values: &[Complex32]) {
        let row = (self.row - place.row) * place.size.columns;
        let values = &values[row + self.column - place.column..];
        for (pixel, value) in self.pixels.iter_mut().zip(values) {
            *pixel += value;
        }
    }
}

impl Patches {
    pub(crate) fn new(grid: &ImageGrid, at_most: PatchSize) -> Self {
        // Patch sizes are as even as possible.
        let even = |count: usize, at_most: usize| {
            count.div_ceil(count.div_ceil(at_most.max(1)).max(1)).max(1)
        };
        let image = [grid.rows.count, grid.columns.count];
        Self(Tiling {
            image,
            tile: [
                even(image[0], at_most.rows),
                even(image[1], at_most.columns),
            ],
        })
    }

    /// Divide the grid into patches of exactly this size.
    pub(crate) fn of_size(grid: &ImageGrid, size: PatchSize) -> Self {
        Self(Tiling {
            image: [grid.rows.count, grid.columns.count],
            tile: [size.rows.max(1), size.columns.max(1)],
        })
    }

    /// Size of all patches except those at the ends.
    pub(crate) fn size(&self) -> PatchSize {
        let [rows, columns] = self.0.tile;
        PatchSize { rows, columns }
    }

    /// Number of patches.
    pub(crate) fn count(&self) -> usize {
        self.0.count()
    }

    /// Patches sampled evenly from corner to corner, at most `most` per side.
    pub(crate) fn spread(&self, most: usize) -> impl Iterator<Item = Rectangle> {
        let [down, across] = self.0.tiles();
        let (rows, columns) = (spread(down, most), move || spread(across, most));
        let places = rows.flat_map(move |row| columns().map(move |column| row * across + column));
        places.map(|index| self.rectangle(index))
    }

    fn all(self) -> impl Iterator<Item = Rectangle> {
        (0..self.0.count()).map(move |index| self.rectangle(index))
    }

    fn rectangle(&self, index: usize) -> Rectangle {
        Rectangle::of(&self.0.place(index))
    }

    /// Patch that contains a pixel.
    pub(crate) fn at(&self, row: usize, column: usize) -> Rectangle {
        let [height, width] = self.0.tile;
        self.rectangle(row / height * self.0.tiles()[1] + column / width)
    }

    /// Pixels of the tiles by patch, in row-major order of patches. Patches partly outside the tiles
    /// contain only the pixels inside.
    pub(crate) fn split<'a>(&self, tiles: &'a mut [Tile]) -> Vec<(Rectangle, Vec<Segment<'a>>)> {
        let mut patches: BTreeMap<usize, Vec<Segment>> = BTreeMap::new();
        let ([height, width], across) = (self.0.tile, self.0.tiles()[1]);
        for tile in tiles {
            let Rectangle { row, column, size } = tile.place;
            for (row, mut rest) in (row..).zip(tile.pixels.chunks_exact_mut(size.columns)) {
                let mut column = column;
                while !rest.is_empty() {
                    let patch = column / width;
                    let end = (patch + 1) * width;
                    let (pixels, tail) = rest.split_at_mut(rest.len().min(end - column));
                    let index = row / height * across + patch;
                    let segment = Segment {
                        row,
                        column,
                        pixels,
                    };
                    patches.entry(index).or_default().push(segment);
                    (column, rest) = (end, tail);
                }
            }
        }
        let place = |(index, segments)| (self.rectangle(index), segments);
        patches.into_iter().map(place).collect()
    }

    /// Pixels of the tiles by row and column of patches, for random access.
    pub(crate) fn split_by_place<'a>(
        &self,
        tiles: &'a mut [Tile],
    ) -> BTreeMap<[usize; 2], Mutex<Vec<Segment<'a>>>> {
        let [height, width] = self.0.tile;
        let split = self.split(tiles).into_iter();
        split
            .map(|(Rectangle { row, column, .. }, segments)| {
                ([row / height, column / width], Mutex::new(segments))
            })
            .collect()
    }

    /// Upper bound on the memory of [`Self::split`], bytes.
    pub(crate) fn account_bytes(&self, places: impl IntoIterator<Item = Rectangle>) -> u64 {
        let [height, width] = self.0.tile;
        let bytes = places.into_iter().map(|Rectangle { size: pixels, .. }| {
            let across = pixels.columns.div_ceil(width) + 1;
            let down = pixels.rows.div_ceil(height) + 1;
            let patch = size_of::<(Rectangle, Vec<Segment>)>() + size_of::<(usize, Vec<Segment>)>();
            // Vectors grow by doubling.
            across * (down * patch + 2 * pixels.rows * size_of::<Segment>())
        });
        bytes.sum::<usize>() as u64
    }
}

/// At most `most` of `count` indices, evenly spaced from first to last.
pub(crate) fn spread(count: usize, most: usize) -> impl Iterator<Item = usize> {
    let seen = count.min(most);
    (0..seen).map(move |i| match seen {
        1 => count / 2,
        _ => i * (count - 1) / (seen - 1),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_tile_the_image_and_any_tiles_of_it() {
        let grid: ImageGrid = "x=0:11:1,y=0:7:1".parse().unwrap();
        let at_most = PatchSize {
            rows: 3,
            columns: 4,
        };
        let patches = Patches::new(&grid, at_most);
        let all = rectangles(&grid, at_most);
        assert_eq!(all.len(), 9);
        let place = |row, column, rows, columns| Rectangle {
            row,
            column,
            size: PatchSize { rows, columns },
        };
        for places in [
            vec![place(0, 0, 7, 11)],
            vec![place(2, 3, 4, 5), place(0, 8, 7, 3)],
        ] {
            let mut tiles: Vec<Tile> = places.into_iter().map(Tile::new).collect();
            for (rectangle, segments) in patches.split(&mut tiles) {
                let index = all.iter().position(|r| *r == rectangle).unwrap();
                for segment in segments {
                    for (column, pixel) in (segment.column..).zip(segment.pixels) {
                        let size = rectangle.size;
                        assert!((rectangle.row..rectangle.row + size.rows).contains(&segment.row));
                        assert!(
                            (rectangle.column..rectangle.column + size.columns).contains(&column)
                        );
                        *pixel += Complex32::new(index as f32 + 1.0, 0.0);
                    }
                }
            }
            for tile in tiles {
                for (i, z) in tile.pixels.iter().enumerate() {
                    let row = tile.place.row + i / tile.place.size.columns;
                    let column = tile.place.column + i % tile.place.size.columns;
                    assert_eq!(z.re as usize, row / 3 * 3 + column / 4 + 1);
                }
            }
        }
    }
}
