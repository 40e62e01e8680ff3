//! Images larger than memory, read in parts.

use std::fmt::Debug;
use std::ops::Range;

use super::{Image, Peak, Tiling, power};

/// Rows and columns of an image.
pub type PixelBlock = [Range<usize>; 2];

/// Error of reading a part of an image.
pub type ImageSourceError = Box<dyn std::error::Error + Send + Sync>;

/// Maximum number of pixels of a part.
const PART_PIXELS: usize = 1 << 16;

/// Approximate number of pixels of a block.
const BLOCK_PIXELS: usize = 1 << 18;
/// Maximum number of columns of a block.
const BLOCK_COLUMNS: usize = 4096;

/// Image that is read in parts.
pub trait ImageSource: Debug {
    /// Rows and columns.
    fn size(&self) -> (usize, usize);

    /// Blocks that cover the image once, each of few pixels, in the order that is cheapest to read.
    fn places(&self) -> PixelBlocks;

    /// Read a block within the image.
    ///
    /// # Errors
    /// [`ImageSourceError`] if it cannot be read.
    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError>;
}

impl<P: ImageSource + ?Sized> ImageSource for Box<P> {
    fn size(&self) -> (usize, usize) {
        (**self).size()
    }

    fn places(&self) -> PixelBlocks {
        (**self).places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        (**self).window(place)
    }
}

impl<P: ImageSource + ?Sized> ImageSource for &P {
    fn size(&self) -> (usize, usize) {
        (**self).size()
    }

    fn places(&self) -> PixelBlocks {
        (**self).places()
    }

    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        (**self).window(place)
    }
}

impl ImageSource for Image {
    fn size(&self) -> (usize, usize) {
        (self.rows, self.columns)
    }

    fn places(&self) -> PixelBlocks {
        bands(self.rows, self.columns)
    }

    fn window(&self, [rows, columns]: &PixelBlock) -> Result<Image, ImageSourceError> {
        let row = |row: usize| &self.pixels[row * self.columns..][columns.clone()];
        Ok(Image {
            rows: rows.len(),
            columns: columns.len(),
            pixels: rows.clone().flat_map(row).copied().collect(),
        })
    }
}

/// Brightest pixel of an image read in parts, as by [`Image::peak`].
///
/// # Errors
/// [`ImageSourceError`] if a part cannot be read.
pub fn peak_of(image: &dyn ImageSource) -> Result<Option<Peak>, ImageSourceError> {
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

/// Blocks of some hundred thousand pixels that cover an image with rows of any length.
pub fn blocks(rows: usize, columns: usize) -> PixelBlocks {
    let width = columns.clamp(1, BLOCK_COLUMNS);
    let image = [rows, columns];
    PixelBlocks::of_size(Tiling { image, tile: image }, [BLOCK_PIXELS / width, width])
}

/// Blocks of whole rows with some ten thousand pixels; longer rows are split.
pub fn bands(rows: usize, columns: usize) -> PixelBlocks {
    let image = [rows, columns];
    PixelBlocks::within_tiles(Tiling { image, tile: image })
}

/// Iterator over blocks that cover an image once.
///
/// It needs no memory per block, since the size may be an unverified statement of a file header.
#[derive(Clone, Debug)]
pub struct PixelBlocks {
    tiling: Tiling,
    /// Rows and columns of a block.
    part: [usize; 2],
    /// Current tile, block within it, and end tile.
    tile: usize,
    within: usize,
    end: usize,
}

impl PixelBlocks {
    /// Blocks tile by tile, each tile split into whole rows of at most 65536 pixels.
    pub fn within_tiles(tiling: Tiling) -> Self {
        let columns = tiling.tile[1].clamp(1, PART_PIXELS);
        Self::of_size(tiling, [(PART_PIXELS / columns).max(1), columns])
    }

    /// Blocks of [`Self::within_tiles`] in tile `index`.
    ///
    /// # Panics
    /// Panics if there is no such tile.
    pub fn within_tile(tiling: Tiling, index: usize) -> Self {
        assert!(index < tiling.count(), "no tile {index}");
        Self {
            tile: index,
            end: index + 1,
            ..Self::within_tiles(tiling)
        }
    }

    /// Blocks tile by tile, each tile split into blocks of at most `part` rows and columns.
    pub fn of_size(tiling: Tiling, part: [usize; 2]) -> Self {
        Self {
            tiling,
            part: part.map(|side| side.max(1)),
            tile: 0,
            within: 0,
            // An image without pixels has no tiles of any size.
            end: match tiling.image.contains(&0) {
                true => 0,
                false => tiling.count(),
            },
        }
    }
}

impl Iterator for PixelBlocks {
    type Item = PixelBlock;

    fn next(&mut self) -> Option<PixelBlock> {
        if self.tile >= self.end {
            return None;
        }
        let tile = self.tiling.place(self.tile);
        let cut = Tiling {
            image: [tile[0].len(), tile[1].len()],
            tile: self.part,
        };
        let part = cut.place(self.within);
        self.within += 1;
        if self.within == cut.count() {
            self.tile += 1;
            self.within = 0;
        }
        let shifted = |i: usize| tile[i].start + part[i].start..tile[i].start + part[i].end;
        Some([shifted(0), shifted(1)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of times each pixel is covered, and the maximum number of pixels of a block.
    fn covered(places: PixelBlocks, [rows, columns]: [usize; 2]) -> (Vec<u8>, usize) {
        let (mut seen, mut most) = (vec![0; rows * columns], 0);
        for [down, across] in places {
            most = most.max(down.len() * across.len());
            for row in down {
                across
                    .clone()
                    .for_each(|column| seen[row * columns + column] += 1);
            }
        }
        (seen, most)
    }

    #[test]
    fn blocks_cover_each_pixel_once_with_bounded_size() {
        for (image, tile) in [
            ([5, 7], [2, 3]),
            ([700, 300], [700, 300]),
            ([3, 200_000], [3, 200_000]),
            ([900, 400], [512, 400]),
            ([1, 1], [1, 1]),
        ] {
            let (seen, most) = covered(PixelBlocks::within_tiles(Tiling { image, tile }), image);
            assert!(seen.iter().all(|&count| count == 1), "{image:?}");
            assert!(most <= PART_PIXELS, "{image:?}: {most}");
        }
        let tiling = Tiling {
            image: [5, 7],
            tile: [2, 3],
        };
        assert_eq!(
            PixelBlocks::within_tile(tiling, 5).collect::<Vec<_>>(),
            [[2..4, 6..7]]
        );
        let (seen, most) = covered(
            PixelBlocks::of_size(
                Tiling {
                    image: [9, 9],
                    tile: [9, 9],
                },
                [4, 2],
            ),
            [9, 9],
        );
        assert!(seen.iter().all(|&count| count == 1) && most == 8);
        assert_eq!(bands(0, 5).count() + bands(5, 0).count(), 0);
    }

    #[test]
    fn blocks_of_huge_image_take_no_memory() {
        let image = [1_000_000_000; 2];
        let mut places = PixelBlocks::within_tiles(Tiling {
            image,
            tile: [1, 1],
        });
        assert_eq!(places.next(), Some([0..1, 0..1]));
        assert_eq!(
            bands(image[0], image[1]).nth(1),
            Some([0..1, 65_536..131_072])
        );
    }
}
