//! Image split into tiles of one size, in row-major order; tiles in the last row and column of tiles may be smaller.

use num_complex::Complex32;

use super::PixelBlock;

/// Sizes of an image and of its tiles in pixels, rows first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiling {
    /// Rows and columns of the image.
    pub image: [usize; 2],
    /// Rows and columns of a tile, at least one each.
    pub tile: [usize; 2],
}

impl Tiling {
    /// Number of rows and columns of tiles.
    pub fn tiles(&self) -> [usize; 2] {
        [0, 1].map(|i| self.image[i].div_ceil(self.tile[i]))
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.tiles().iter().product()
    }

    /// Row and column of tile `index` in the grid of tiles.
    ///
    /// # Panics
    /// Panics if there is no such tile.
    pub fn at(&self, index: usize) -> [usize; 2] {
        assert!(index < self.count(), "no tile {index}");
        let across = self.tiles()[1];
        [index / across, index % across]
    }

    /// Rows and columns of the image in tile `index`.
    ///
    /// # Panics
    /// Panics if there is no such tile.
    pub fn place(&self, index: usize) -> PixelBlock {
        let at = self.at(index);
        [0, 1].map(|i| {
            let first = at[i] * self.tile[i];
            first..(first + self.tile[i]).min(self.image[i])
        })
    }

    /// Tiles that overlap `place`, ascending.
    pub fn meeting(&self, [rows, columns]: &PixelBlock) -> impl Iterator<Item = usize> + use<> {
        let across = self.tiles()[1];
        let [height, width] = self.tile;
        let down = rows.start / height..rows.end.div_ceil(height);
        let along = columns.start / width..columns.end.div_ceil(width);
        down.flat_map(move |row| along.clone().map(move |column| row * across + column))
    }
}

/// Copy the overlap of two blocks: pixels of `from` over those of `to`, each row-major on its own block.
///
/// # Panics
/// Panics if the number of pixels differs from that of a block.
pub fn copy_common(
    to_place: &PixelBlock,
    to: &mut [Complex32],
    from_place: &PixelBlock,
    from: &[Complex32],
) {
    for (place, pixels) in [(to_place, to.len()), (from_place, from.len())] {
        assert_eq!(
            place[0].len() * place[1].len(),
            pixels,
            "pixels of {place:?}"
        );
    }
    let [rows, columns] = [0, 1].map(|i| {
        to_place[i].start.max(from_place[i].start)..to_place[i].end.min(from_place[i].end)
    });
    if columns.is_empty() {
        return;
    }
    let first = |place: &PixelBlock, row: usize| {
        (row - place[0].start) * place[1].len() + columns.start - place[1].start
    };
    for row in rows {
        let (into, out_of) = (first(to_place, row), first(from_place, row));
        to[into..into + columns.len()].copy_from_slice(&from[out_of..out_of + columns.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILING: Tiling = Tiling {
        image: [5, 7],
        tile: [2, 3],
    };

    #[test]
    fn tiles_cover_the_image_once() {
        assert_eq!((TILING.tiles(), TILING.count()), ([3, 3], 9));
        let mut seen = [[0; 7]; 5];
        for index in 0..TILING.count() {
            let [rows, columns] = TILING.place(index);
            assert!(rows.len() <= 2 && columns.len() <= 3);
            rows.for_each(|row| columns.clone().for_each(|column| seen[row][column] += 1));
        }
        assert_eq!(seen, [[1; 7]; 5]);
        assert_eq!(TILING.place(8), [4..5, 6..7]);
    }

    #[test]
    fn block_overlaps_tiles_with_its_pixels() {
        for place in [[0..5, 0..7], [1..2, 2..3], [1..4, 2..7], [3..3, 0..7]] {
            let has = |index: &usize| {
                let tile = TILING.place(*index);
                let both =
                    |i: usize| tile[i].start.max(place[i].start) < tile[i].end.min(place[i].end);
                both(0) && both(1)
            };
            let expected: Vec<usize> = (0..9).filter(has).collect();
            let met: Vec<usize> = TILING.meeting(&place).filter(has).collect();
            assert_eq!(met, expected, "{place:?}");
            let most = if place[0].is_empty() {
                3
            } else {
                expected.len()
            };
            assert!(TILING.meeting(&place).count() <= most, "{place:?}");
        }
    }

    #[test]
    fn overlap_of_blocks_is_copied() {
        let (to_place, from_place) = ([1..4, 2..6], [2..9, 0..4]);
        let value = |row: usize, column: usize| Complex32::new(row as f32, column as f32);
        let from: Vec<Complex32> = (2..9)
            .flat_map(|r| (0..4).map(move |c| value(r, c)))
            .collect();
        let mut to = vec![Complex32::ZERO; 12];
        copy_common(&to_place, &mut to, &from_place, &from);
        for (i, z) in to.iter().enumerate() {
            let (row, column) = (1 + i / 4, 2 + i % 4);
            let shared = row >= 2 && column < 4;
            assert_eq!(
                *z,
                if shared {
                    value(row, column)
                } else {
                    Complex32::ZERO
                }
            );
        }
        let apart = [0..2, 7..9];
        copy_common(&apart, &mut [Complex32::ONE; 4], &from_place, &from);
    }
}
