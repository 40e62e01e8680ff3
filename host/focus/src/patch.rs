//! A grid cut into rectangular patches, each with its own pixels of the image to write to.

use std::collections::BTreeMap;
use std::sync::Mutex;

use glam::DVec3;
use num_complex::Complex32;

use super::Tile;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Place, Tiling};

/// How many rows and columns of pixels a patch has at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PatchSize {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
}

impl PatchSize {
    /// A single pixel.
    pub const PIXEL: Self = Self {
        rows: 1,
        columns: 1,
    };

    /// As many rows as columns.
    pub(crate) const fn square(side: usize) -> Self {
        Self {
            rows: side,
            columns: side,
        }
    }

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
    /// The rectangle of these rows and columns.
    pub fn of([rows, columns]: &Place) -> Self {
        Self {
            row: rows.start,
            column: columns.start,
            size: PatchSize {
                rows: rows.len(),
                columns: columns.len(),
            },
        }
    }

    /// Its rows and columns.
    pub fn place(&self) -> Place {
        [
            self.row..self.row + self.size.rows,
            self.column..self.column + self.size.columns,
        ]
    }

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

    /// Whether a row and column of the grid are in it.
    pub fn contains(&self, row: usize, column: usize) -> bool {
        let [rows, columns] = self.place();
        rows.contains(&row) && columns.contains(&column)
    }

    /// The scene point in its middle.
    pub fn centre_m(&self, grid: &ImageGrid) -> DVec3 {
        self.point_m(grid, 0.5, 0.5)
    }
}

/// The rectangles that cover the grid, row by row of patches: as many as `at_most` needs, of one size, those at the ends
/// what is left.
pub fn rectangles(grid: &ImageGrid, at_most: PatchSize) -> Vec<Rectangle> {
    Patches::new(grid, at_most).all().collect()
}

/// A grid cut into patches of one size, those at the ends smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Patches(Tiling);

/// Some pixels of a row.
pub(crate) struct Segment<'a> {
    pub(crate) row: usize,
    /// Of its first pixel.
    pub(crate) column: usize,
    pub(crate) pixels: &'a mut [Complex32],
}

impl Patches {
    pub(crate) fn new(grid: &ImageGrid, at_most: PatchSize) -> Self {
        // As even as patches of one size can be.
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

    /// Of exactly this size.
    pub(crate) fn of_size(grid: &ImageGrid, size: PatchSize) -> Self {
        Self(Tiling {
            image: [grid.rows.count, grid.columns.count],
            tile: [size.rows.max(1), size.columns.max(1)],
        })
    }

    /// Of all patches but those at the ends.
    pub(crate) fn size(&self) -> PatchSize {
        let [rows, columns] = self.0.tile;
        PatchSize { rows, columns }
    }

    /// How many there are.
    pub(crate) fn count(&self) -> usize {
        self.0.count()
    }

    /// Some of them, at most so many a side, from corner to corner.
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

    /// The tiles' pixels by the patches that they lie in, row by row of patches. Of a patch that reaches beyond the tiles
    /// there are only the pixels in them.
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

    /// The same by row and column of patches, for whoever comes first.
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

    /// Bytes that [`Self::split`] makes of them, at most.
    pub(crate) fn account_bytes(&self, tiles: &[Tile]) -> u64 {
        let [height, width] = self.0.tile;
        let bytes = tiles.iter().map(|tile| {
            let Rectangle { size: pixels, .. } = tile.place;
            let across = pixels.columns.div_ceil(width) + 1;
            let down = pixels.rows.div_ceil(height) + 1;
            let patch = size_of::<(Rectangle, Vec<Segment>)>() + size_of::<(usize, Vec<Segment>)>();
            // Vectors grow by doubling.
            across * (down * patch + 2 * pixels.rows * size_of::<Segment>())
        });
        bytes.sum::<usize>() as u64
    }
}

/// At most `most` of `count` places, evenly from the first to the last.
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
