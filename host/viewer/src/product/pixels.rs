//! Access to the pixels of an image: in a file that is read in parts, or in tiles that may still be incomplete.

use std::collections::HashSet;

use num_complex::Complex32;
use subaperture_io::product;
use subaperture_io::tiles::TileStore;
use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, PixelBlocks};

/// Bytes read for the preview of an image stored in rows.
const GLANCE_BYTES: usize = 96 << 20;
/// Maximum rows and columns of a preview.
const GLANCE_SIDE: usize = 512;
/// Pixels of a row read at once for a preview. If the pixels needed are farther apart than `FAR_APART`, each is read
/// alone.
const RUN_PIXELS: usize = 1 << 16;
const FAR_APART: usize = 1 << 12;

/// Pixels of an image.
#[derive(Debug)]
pub struct Pixels(Kind);

#[derive(Debug)]
enum Kind {
    Whole(Box<dyn ImageSource + Send + Sync>),
    Tiles(TileStore),
}

/// Piece of an image: the whole of it, or one tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Piece {
    /// Whole image.
    Whole,
    /// Tile with this index.
    Tile(usize),
}

/// Preview of every n-th pixel, row-major: row `i`, column `j` holds pixel `(i steps[0], j steps[1])`, or zero if it is
/// missing.
#[derive(Clone, Debug)]
pub(super) struct Glance {
    pub(super) steps: [usize; 2],
    pub(super) image: Image,
}

impl Pixels {
    /// Complete image.
    pub fn whole(parts: Box<dyn ImageSource + Send + Sync>) -> Self {
        Self(Kind::Whole(parts))
    }

    /// Tiled image, complete or still growing. Missing tiles read as zeros.
    pub fn tiles(store: TileStore) -> Self {
        Self(Kind::Tiles(store))
    }

    /// Pieces that exist and are not in `has`.
    ///
    /// # Errors
    /// If the tiles cannot be listed.
    pub(super) fn new_pieces(&self, has: &HashSet<Piece>) -> Result<Vec<Piece>, ImageSourceError> {
        let there = match &self.0 {
            Kind::Whole(_) => vec![Piece::Whole],
            Kind::Tiles(store) => store.present()?.into_iter().map(Piece::Tile).collect(),
        };
        Ok(there
            .into_iter()
            .filter(|piece| !has.contains(piece))
            .collect())
    }

    /// Regions of a piece.
    pub(super) fn places_of(&self, piece: Piece) -> PixelBlocks {
        match (&self.0, piece) {
            (Kind::Tiles(store), Piece::Tile(index)) => {
                PixelBlocks::within_tile(store.tiling(), index)
            }
            (kind, _) => kind.parts().places(),
        }
    }

    /// Total number of pieces: 1 for an image that is not tiled.
    pub(super) fn num_pieces(&self) -> usize {
        match &self.0 {
            Kind::Whole(_) => 1,
            Kind::Tiles(store) => store.tiling().count(),
        }
    }

    /// Read a preview of a few hundred rows and columns.
    pub(super) fn glance(&self) -> Result<Glance, ImageSourceError> {
        let (rows, columns) = self.size();
        let most_rows = (GLANCE_BYTES / (8 * columns.max(1))).clamp(64, GLANCE_SIDE);
        let steps = [
            rows.div_ceil(most_rows).max(1),
            columns.div_ceil(GLANCE_SIDE).max(1),
        ];
        let size = [rows.div_ceil(steps[0]), columns.div_ceil(steps[1])];
        let mut image = Image {
            rows: size[0],
            columns: size[1],
            pixels: vec![Complex32::ZERO; size[0] * size[1]],
        };
        match &self.0 {
            Kind::Whole(parts) => {
                let lines = image.pixels.chunks_exact_mut(size[1].max(1));
                for (i, line) in lines.enumerate() {
                    let row = i * steps[0];
                    let run = if steps[1] > FAR_APART {
                        1
                    } else {
                        RUN_PIXELS / steps[1]
                    };
                    for (j, chosen) in line.chunks_mut(run).enumerate() {
                        let first = j * run * steps[1];
                        let last = first + (chosen.len() - 1) * steps[1];
                        let seen = parts.window(&[row..row + 1, first..last + 1])?;
                        let seen = seen.pixels.into_iter().step_by(steps[1]);
                        chosen
                            .iter_mut()
                            .zip(seen)
                            .for_each(|(to, from)| *to = from);
                    }
                }
            }
            Kind::Tiles(store) => {
                for index in store.present()? {
                    let place = store.tiling().place(index);
                    let first = [0, 1].map(|i| place[i].start.div_ceil(steps[i]));
                    let within = [0, 1].map(|i| first[i] * steps[i] - place[i].start);
                    if (0..2).any(|i| within[i] >= place[i].len()) {
                        continue;
                    }
                    let seen = store.glance(index, within, steps)?;
                    for (i, line) in seen.pixels.chunks_exact(seen.columns).enumerate() {
                        let at = (first[0] + i) * size[1] + first[1];
                        image.pixels[at..at + line.len()].copy_from_slice(line);
                    }
                }
            }
        }
        Ok(Glance { steps, image })
    }
}

impl Kind {
    fn parts(&self) -> &dyn ImageSource {
        match self {
            Self::Whole(parts) => &**parts,
            Self::Tiles(store) => store,
        }
    }
}

impl From<product::Pixels> for Pixels {
    fn from(pixels: product::Pixels) -> Self {
        match pixels {
            product::Pixels::Array(file) => Self::whole(Box::new(file)),
            product::Pixels::Tiles(store) => Self::tiles(store),
        }
    }
}

impl ImageSource for Pixels {
    fn size(&self) -> (usize, usize) {
        self.0.parts().size()
    }

    fn places(&self) -> PixelBlocks {
        self.0.parts().places()
    }

    /// Missing tiles read as zeros.
    fn window(&self, place: &PixelBlock) -> Result<Image, ImageSourceError> {
        match &self.0 {
            Kind::Whole(parts) => parts.window(place),
            Kind::Tiles(store) => Ok(store.part_so_far(place)?),
        }
    }
}
