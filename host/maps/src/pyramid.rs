//! Tiles of a map and of its overview levels, each computed once.
//!
//! Each overview level halves the resolution, down to a single tile. Tiles are computed depth first, four tiles and then their parent, so that one tile per level is
//! in memory. Power is averaged over the pixels inside the image. Complex values are decimated by two, because a mean of complex values would not keep
//! their level.

use num_complex::Complex32;

use subaperture_model::monitor::Monitor;

use crate::{MapError, Ortho};

/// Tile side, pixels.
pub(crate) const TILE: usize = 512;

/// Kind of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Values {
    /// Mean power, in the real part.
    Powers,
    /// Complex values.
    Complex,
}

/// Tile of a level; values outside the image are NaN.
pub(crate) struct Tile {
    /// Rows and columns inside the map.
    pub(crate) size: [usize; 2],
    /// [`TILE`] x [`TILE`] values, row-major.
    pub(crate) values: Vec<Complex32>,
}

/// Rows and columns of a map and of its overview levels.
pub(crate) fn levels(rows: usize, columns: usize) -> Vec<[usize; 2]> {
    let mut levels = vec![[rows, columns]];
    while let Some(&last) = levels.last()
        && last.iter().any(|&n| n > TILE)
    {
        levels.push(last.map(|n| n.div_ceil(2)));
    }
    levels
}

/// Rows and columns of tiles of a level.
pub(crate) fn tiles(level: [usize; 2]) -> [usize; 2] {
    level.map(|n| n.div_ceil(TILE))
}

/// Producer of all tiles.
pub(crate) struct Pyramid<'a> {
    ortho: &'a Ortho<'a>,
    values: Values,
    levels: Vec<[usize; 2]>,
    monitor: &'a dyn Monitor,
    made: usize,
}

/// Receiver of a tile: its level (0 is full resolution), its row and column of tiles, its values.
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

    /// Compute a tile and all finer tiles under it.
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
                    self.decimate(&finer, [down, right], &mut tile);
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

    /// Fill one quarter of a tile from a finer tile, decimated by two.
    fn decimate(&self, finer: &Tile, quarter: [usize; 2], tile: &mut Tile) {
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

/// Mean of the finite values; NaN if there are none.
fn mean(of: [f32; 4]) -> f32 {
    let (sum, count) = of
        .iter()
        .filter(|x| x.is_finite())
        .fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
    sum / count
}
