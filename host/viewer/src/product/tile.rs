//! Tiles of 256 x 256 cells, encoded in tenths of a decibel.

use std::ops::Range;

use subaperture_model::image::{Image, ImageSource, ImageSourceError, PixelBlock, power};

use super::overview::{TILE, size_at};
use super::pixels::{Glance, Pixels};
use crate::level::{NONE, tenths};

/// Number of pixels read at a time.
const BAND_PIXELS: usize = 1 << 17;

/// Cells of tile `at` of a level; `None` if the tile does not exist.
pub(super) fn cells(size: [usize; 2], level: u32, at: [usize; 2]) -> Option<PixelBlock> {
    let size = size_at(size, level);
    let range = |i: usize| -> Option<Range<usize>> {
        let first = at[i].checked_mul(TILE)?;
        (first < size[i]).then(|| first..(first + TILE).min(size[i]))
    };
    Some([range(0)?, range(1)?])
}

/// Mean powers of cells of a level, computed from the pixels.
pub(super) fn powers(
    pixels: &Pixels,
    level: u32,
    [rows, columns]: &PixelBlock,
) -> Result<Vec<f64>, ImageSourceError> {
    let (all_rows, all_columns) = pixels.size();
    let side = 1usize << level;
    let across = (columns.start << level)..(columns.end << level).min(all_columns);
    let at_once = (BAND_PIXELS / (across.len().max(1) * side)).max(1);
    let mut powers = Vec::with_capacity(rows.len() * columns.len());
    for first in rows.clone().step_by(at_once) {
        let last = (first + at_once).min(rows.end);
        let down = (first << level)..(last << level).min(all_rows);
        let band = pixels.window(&[down, across.clone()])?;
        powers.extend(average(&band, level));
    }
    Ok(powers)
}

/// Mean powers of cells of a level. All cells are complete except in the last row and column.
pub(super) fn average(pixels: &Image, level: u32) -> Vec<f64> {
    let side = 1usize << level;
    let across = pixels.columns.div_ceil(side);
    let lines: Vec<&[_]> = pixels.pixels.chunks_exact(pixels.columns).collect();
    let mut powers = Vec::with_capacity(pixels.rows.div_ceil(side) * across);
    for cell_lines in lines.chunks(side) {
        let mut sums = vec![0.0; across];
        for line in cell_lines {
            for (sum, run) in sums.iter_mut().zip(line.chunks(side)) {
                *sum += run.iter().map(|&z| power(z)).sum::<f64>();
            }
        }
        powers.extend(sums.iter().enumerate().map(|(i, sum)| {
            let width = (pixels.columns - i * side).min(side);
            sum / (width * cell_lines.len()) as f64
        }));
    }
    powers
}

/// Powers of the preview pixels nearest to the centre of each cell.
pub(super) fn glanced(glance: &Glance, level: u32, [rows, columns]: &PixelBlock) -> Vec<f64> {
    let near = |cell: usize, step: usize, count: usize| {
        let middle = (cell << level) + (1 << level) / 2;
        ((middle + step / 2) / step).min(count - 1)
    };
    let image = &glance.image;
    let across: Vec<usize> = columns
        .clone()
        .map(|column| near(column, glance.steps[1], image.columns))
        .collect();
    let mut powers = Vec::with_capacity(rows.len() * columns.len());
    for row in rows.clone() {
        let line = &image.pixels[near(row, glance.steps[0], image.rows) * image.columns..];
        powers.extend(across.iter().map(|&column| power(line[column])));
    }
    powers
}

/// Encode powers as a tile: 16-bit tenths of a decibel, little-endian, row-major, padded to 256 x 256.
pub(super) fn encode([rows, columns]: &PixelBlock, powers: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(2 * TILE * TILE);
    let mut lines = powers.chunks_exact(columns.len());
    for _ in 0..TILE {
        let line = lines.next().unwrap_or(&[]);
        for column in 0..TILE {
            let power = line.get(column).copied().unwrap_or(0.0);
            let level = match power > 0.0 {
                true => tenths((10.0 * power.log10()) as f32),
                false => NONE,
            };
            bytes.extend(level.to_le_bytes());
        }
    }
    debug_assert!(rows.len() <= TILE);
    bytes
}

/// Encode phases of pixels in 1/256 turn, one byte each, padded with zeros.
pub(super) fn phases(pixels: &Pixels, place: &PixelBlock) -> Result<Vec<u8>, ImageSourceError> {
    let image = pixels.window(place)?;
    let mut bytes = vec![0; TILE * TILE];
    let lines = image.pixels.chunks_exact(image.columns.max(1));
    for (to, line) in bytes.chunks_exact_mut(TILE).zip(lines) {
        for (byte, z) in to.iter_mut().zip(line) {
            let turns = f64::from(z.arg()) / std::f64::consts::TAU;
            // Rounded and wrapped: -1/512 turn rounds to 0.
            *byte = ((256.0 * turns).round() as i32).rem_euclid(256) as u8;
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use std::collections::HashSet;
    use subaperture_io::tiles::TileStore;
    use subaperture_model::image::Tiling;

    fn value(row: usize, column: usize) -> Complex32 {
        let x = (row * 7919 + column * 104_729) % 65_537;
        Complex32::new(x as f32 / 65_537.0, (x % 31) as f32 - 15.0)
    }

    fn image(rows: usize, columns: usize) -> Image {
        let pixels = (0..rows * columns).map(|i| value(i / columns, i % columns));
        Image {
            rows,
            columns,
            pixels: pixels.collect(),
        }
    }

    /// Reference: level of a cell from its pixels.
    fn level_of(size: [usize; 2], level: u32, row: usize, column: usize) -> i16 {
        let side = 1 << level;
        let mut all = Vec::new();
        for r in (row * side..(row + 1) * side).filter(|&r| r < size[0]) {
            for c in (column * side..(column + 1) * side).filter(|&c| c < size[1]) {
                let z = value(r, c);
                all.push(f64::from(z.re).powi(2) + f64::from(z.im).powi(2));
            }
        }
        (100.0 * (all.iter().sum::<f64>() / all.len() as f64).log10()).round() as i16
    }

    fn decode(bytes: &[u8]) -> Vec<i16> {
        let pairs = bytes.chunks_exact(2);
        pairs.map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
    }

    /// Levels are rounded to tenths of a decibel. Two float64 sums in different order may round differently by one at a
    /// boundary.
    #[test]
    fn tiles_are_mean_powers_of_pixels() {
        let size = [700, 1333];
        let pixels = Pixels::whole(Box::new(image(size[0], size[1])));
        for level in 0..=2 {
            for at in [[0, 0], [0, 1], [size_at(size, level)[0] / TILE, 1]] {
                let Some(place) = cells(size, level, at) else {
                    assert!(size_at(size, level)[1] <= TILE);
                    continue;
                };
                let tile = decode(&encode(&place, &powers(&pixels, level, &place).unwrap()));
                assert_eq!(tile.len(), TILE * TILE);
                for (i, level_sent) in tile.iter().enumerate() {
                    let [row, column] = [place[0].start + i / TILE, place[1].start + i % TILE];
                    if row >= place[0].end || column >= place[1].end {
                        assert_eq!(*level_sent, NONE);
                        continue;
                    }
                    let expected = level_of(size, level, row, column);
                    assert!((level_sent - expected).abs() <= 1, "{level} {row} {column}");
                }
            }
        }
        assert!(cells(size, 0, [3, 0]).is_none() && cells(size, 0, [usize::MAX, 0]).is_none());
    }

    #[test]
    fn phases_are_encoded_in_256ths_of_a_turn() {
        let pixels = Pixels::whole(Box::new(image(9, 11)));
        let bytes = phases(&pixels, &[0..9, 0..11]).unwrap();
        for row in 0..9 {
            for column in 0..11 {
                let z = value(row, column);
                let turns = f64::from(z.im).atan2(f64::from(z.re)) / std::f64::consts::TAU;
                let off = f64::from(bytes[row * TILE + column]) / 256.0 - turns;
                let off = off - off.round();
                assert!(off.abs() <= 0.5 / 256.0 + 1e-6, "{row} {column}");
            }
        }
    }

    /// In a store with half of its tiles missing, missing pixels have no level, and the preview holds the stated
    /// pixels.
    #[test]
    fn missing_tiles_have_no_level() {
        let folder = tempfile::tempdir().unwrap();
        let tiling = Tiling {
            image: [600, 1100],
            tile: [128, 200],
        };
        let store = TileStore::create(folder.path(), tiling, "plan").unwrap();
        let whole = image(600, 1100);
        for index in (0..tiling.count()).step_by(2) {
            let part = whole.window(&tiling.place(index)).unwrap();
            store
                .put(index, &part.pixels, &serde_json::Value::Null)
                .unwrap();
        }
        let there = |row: usize, column: usize| {
            let index = tiling.meeting(&[row..row + 1, column..column + 1]).next();
            index.unwrap().is_multiple_of(2)
        };
        let pixels = Pixels::tiles(store);
        let place = [0..256, 256..512];
        let tile = decode(&encode(&place, &powers(&pixels, 0, &place).unwrap()));
        for (i, level) in tile.iter().enumerate() {
            let (row, column) = (i / TILE, 256 + i % TILE);
            let shown = match there(row, column) {
                true => level_of([600, 1100], 0, row, column),
                false => NONE,
            };
            assert!(
                i32::from(*level).abs_diff(shown.into()) <= 1,
                "{row} {column}"
            );
        }
        let glance = pixels.glance().unwrap();
        for i in 0..glance.image.rows {
            for j in 0..glance.image.columns {
                let (row, column) = (i * glance.steps[0], j * glance.steps[1]);
                let z = glance.image.pixels[i * glance.image.columns + j];
                let expected = match there(row, column) {
                    true => value(row, column),
                    false => Complex32::ZERO,
                };
                assert_eq!(z, expected, "{row} {column}");
            }
        }
        let mut has = HashSet::new();
        let new = pixels.new_pieces(&has).unwrap();
        assert_eq!(new.len(), tiling.count().div_ceil(2));
        has.extend(new);
        assert!(pixels.new_pieces(&has).unwrap().is_empty());
        assert_eq!(pixels.num_pieces(), tiling.count());
    }
}
