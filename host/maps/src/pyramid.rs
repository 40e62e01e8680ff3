//! A map's tiles and those of its overviews, each once, in memory that grows with the number of overviews alone.
//!
//! Overviews are half as fine each, down to one that is a single tile. They are made depth first: four tiles are made, and theirs above of them, so that of
//! each level one tile is held. Detected ones are averaged in power over what lies on the image; complex ones take every second pixel, for
//! the mean of complex values is none of their level.

use num_complex::Complex32;

use subaperture_model::monitor::Monitor;

use crate::{MapError, Ortho};

/// Pixels of a tile's side.
pub(crate) const TILE: usize = 512;

/// What a tile's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Values {
    /// Mean powers, in the real part.
    Powers,
    /// Complex values.
    Complex,
}

/// A tile, its values NaN beyond the image.
pub(crate) struct Tile {
    /// Rows and columns that lie on the map.
    pub(crate) size: [usize; 2],
    /// [`TILE`] rows of as many columns.
    pub(crate) values: Vec<Complex32>,
}

/// Sizes of a map and of its overviews, rows first.
pub(crate) fn levels(rows: usize, columns: usize) -> Vec<[usize; 2]> {
    let mut levels = vec![[rows, columns]];
    while let Some(&last) = levels.last()
        && last.iter().any(|&n| n > TILE)
    {
        levels.push(last.map(|n| n.div_ceil(2)));
    }
    levels
}

/// Rows and columns of tiles of such a level.
pub(crate) fn tiles(level: [usize; 2]) -> [usize; 2] {
    level.map(|n| n.div_ceil(TILE))
}

/// Makes all tiles. `put` has a tile's level, 0 the finest, and its row and column of tiles.
pub(crate) struct Pyramid<'a> {
    ortho: &'a Ortho<'a>,
    values: Values,
    levels: Vec<[usize; 2]>,
    monitor: &'a dyn Monitor,
    made: usize,
}

/// What takes tiles.
pub(crate) type Put<'p> = dyn FnMut(usize, [usize; 2], &Tile) -> Result<(), MapError> + 'p;

impl<'a> Pyramid<'a> {
    pub(crate) fn new(ortho: &'a Ortho, values: Values, monitor: &'a dyn Monitor) -> Self {
        let raster = ortho.raster();
        Self {
            ortho,
            values,
            levels: levels(raster.rows, raster.columns),
            monitor,
            made: 0,
        }
    }

    pub(crate) fn levels(&self) -> &[[usize; 2]] {
        &self.levels
    }

    pub(crate) fn make(&mut self, put: &mut Put) -> Result<(), MapError> {
        self.tile(self.levels.len() - 1, [0, 0], put)?;
        Ok(())
    }

    /// Makes a tile and all below it.
    fn tile(&mut self, level: usize, at: [usize; 2], put: &mut Put) -> Result<Tile, MapError> {
        let size = [0, 1].map(|i| (self.levels[level][i] - at[i] * TILE).min(TILE));
        let mut tile = Tile {
            size,
            values: vec![Complex32::new(f32::NAN, f32::NAN); TILE * TILE],
        };
        if level == 0 {
            self.finest(at, &mut tile)?;
        } else {
            let below = tiles(self.levels[level - 1]);
            for [down, right] in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                let of = [2 * at[0] + down, 2 * at[1] + right];
                if of[0] < below[0] && of[1] < below[1] {
                    let finer = self.tile(level - 1, of, put)?;
                    self.halve(&finer, [down, right], &mut tile);
                }
            }
        }
        put(level, at, &tile)?;
        Ok(tile)
    }

    fn finest(&mut self, at: [usize; 2], tile: &mut Tile) -> Result<(), MapError> {
        if self.monitor.cancelled() {
            return Err(MapError::Cancelled);
        }
        let place = [0, 1].map(|i| at[i] * TILE..at[i] * TILE + tile.size[i]);
        let values: Vec<Complex32> = match self.values {
            Values::Complex => self.ortho.complex(&place)?,
            Values::Powers => {
                let powers = self.ortho.powers(&place)?.into_iter();
                powers.map(|power| Complex32::new(power, 0.0)).collect()
            }
        };
        let lines = values.chunks(tile.size[1]);
        for (line, from) in tile.values.chunks_mut(TILE).zip(lines) {
            line[..from.len()].copy_from_slice(from);
        }
        self.made += 1;
        let [down, across] = tiles(self.levels[0]);
        self.monitor
            .progress(self.made as f64 / (down * across) as f64);
        Ok(())
    }

    /// Fills a quarter of a tile.
    fn halve(&self, finer: &Tile, quarter: [usize; 2], tile: &mut Tile) {
        let half = TILE / 2;
        let size = finer.size.map(|n| n.div_ceil(2));
        for row in 0..size[0] {
            for column in 0..size[1] {
                let at = 2 * row * TILE + 2 * column;
                let of = [at, at + 1, at + TILE, at + TILE + 1].map(|i| finer.values[i]);
                let to = (quarter[0] * half + row) * TILE + quarter[1] * half + column;
                tile.values[to] = match self.values {
                    Values::Complex => of[0],
                    Values::Powers => Complex32::new(mean(of.map(|z| z.re)), 0.0),
                };
            }
        }
    }
}

/// Of those that are numbers; NaN of none.
fn mean(of: [f32; 4]) -> f32 {
    let (sum, count) = of
        .iter()
        .filter(|x| x.is_finite())
        .fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}
