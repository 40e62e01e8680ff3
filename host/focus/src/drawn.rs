//! Pixels of a formed tile drawn by local power.
//!
//! The probability of a pixel is proportional to the mean power of its 3 x 3 neighbourhood plus the mean power of the tile (defensive
//! mixture: Hesterberg 1995), so that errors of weak pixels are found as well. Sampling is systematic: every run draws the same pixels,
//! for any number of threads. [`super::second_look`] compares them with the exact sum.

use super::Tile;
use subaperture_model::image;

/// Number of pixels drawn per tile, and largest number compared per image.
pub(super) const MOST_DRAWS: usize = 256;

/// Pixels of a tile drawn by local power.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SampledPixels {
    /// Sum over the tile's pixels of the mean neighbourhood power plus the mean power of the tile.
    pub power: f64,
    /// Drawn pixels in row order: grid index, real and imaginary part, mean power of neighbourhood and tile together.
    pub pixels: Vec<(usize, [f32; 2], f64)>,
}

impl SampledPixels {
    /// Draw pixels from a formed tile.
    pub(super) fn of(tile: &Tile, columns_of_grid: usize) -> Self {
        let size = tile.place.size;
        let mut about = About::new(tile);
        let mut row_power = Vec::with_capacity(size.rows);
        for row in 0..size.rows {
            row_power.push(about.row(row).iter().sum::<f64>());
        }
        let mean = row_power.iter().sum::<f64>() / tile.pixels.len() as f64;
        for of_row in &mut row_power {
            *of_row += size.columns as f64 * mean;
        }
        let power: f64 = row_power.iter().sum();
        let mut drawn = Self {
            power,
            pixels: Vec::new(),
        };
        if !(power > 0.0 && power.is_finite()) {
            return drawn;
        }
        let step = power / MOST_DRAWS as f64;
        let (mut before, mut next) = (0.0, 0.5 * step);
        for (row, of_row) in row_power.into_iter().enumerate() {
            if before + of_row > next {
                let mut reached = before;
                for (column, about) in about.row(row).iter().enumerate() {
                    let about = about + mean;
                    reached += about;
                    while reached > next && drawn.pixels.len() < MOST_DRAWS {
                        let value = tile.pixels[row * size.columns + column];
                        let pixel =
                            (tile.place.row + row) * columns_of_grid + tile.place.column + column;
                        drawn.pixels.push((pixel, [value.re, value.im], about));
                        next += step;
                    }
                }
            }
            before += of_row;
        }
        drawn
    }

    /// Mean power of the tile, of `num_pixels`.
    pub(super) fn mean(&self, num_pixels: usize) -> f64 {
        0.5 * self.power / num_pixels as f64
    }
}

/// Mean power of 3 x 3 neighbourhoods, row by row; edge pixels are replicated beyond the edge.
struct About<'a> {
    tile: &'a Tile,
    sums: Vec<f64>,
    means: Vec<f64>,
}

impl<'a> About<'a> {
    fn new(tile: &'a Tile) -> Self {
        let columns = tile.place.size.columns;
        Self {
            tile,
            sums: vec![0.0; columns],
            means: vec![0.0; columns],
        }
    }

    fn row(&mut self, row: usize) -> &[f64] {
        let size = self.tile.place.size;
        self.sums.fill(0.0);
        for row in [row.saturating_sub(1), row, (row + 1).min(size.rows - 1)] {
            let values = &self.tile.pixels[row * size.columns..][..size.columns];
            for (sum, &value) in self.sums.iter_mut().zip(values) {
                *sum += image::power(value);
            }
        }
        for (column, mean) in self.means.iter_mut().enumerate() {
            let after = (column + 1).min(size.columns - 1);
            let near = [column.saturating_sub(1), column, after];
            *mean = near.iter().map(|&c| self.sums[c]).sum::<f64>() / 9.0;
        }
        &self.means
    }
}

/// Mean power of the 3 x 3 neighbourhood of a pixel in a tile.
pub(super) fn power_about(tile: &Tile, row: usize, column: usize) -> f64 {
    let size = tile.place.size;
    let near = |at: usize, count: usize| [at.saturating_sub(1), at, (at + 1).min(count - 1)];
    let values = near(row, size.rows).into_iter().flat_map(|row| {
        near(column, size.columns).map(|column| tile.pixels[row * size.columns + column])
    });
    values.map(image::power).sum::<f64>() / 9.0
}

#[cfg(test)]
pub(super) mod tests {
    use num_complex::Complex32;

    use super::*;
    use crate::patch::{PatchSize, Rectangle};

    /// Tile at row 2 and column 1 with the given pixel powers.
    pub(in super::super) fn tile(
        rows: usize,
        columns: usize,
        power: impl Fn(usize, usize) -> f32,
    ) -> Tile {
        let place = Rectangle {
            row: 2,
            column: 1,
            size: PatchSize { rows, columns },
        };
        let mut tile = Tile::new(place);
        for (i, pixel) in tile.pixels.iter_mut().enumerate() {
            *pixel = Complex32::new(power(i / columns, i % columns).sqrt(), 0.0);
        }
        tile
    }

    #[test]
    fn draws_follow_the_power() {
        // Ten columns of power 1 and ten of power 9.
        let drawn = SampledPixels::of(&tile(30, 20, |_, c| if c < 10 { 1.0 } else { 9.0 }), 50);
        assert_eq!(drawn.pixels.len(), MOST_DRAWS);
        assert!(drawn.pixels.is_sorted_by_key(|drawn| drawn.0));
        let bright = drawn.pixels.iter().filter(|drawn| drawn.0 % 50 > 9);
        // Eleven columns of 14, and of 8.7 and 11.3 at the edge, of 200 in all: 187 of 256. Systematic sampling differs by half a pixel per row.
        assert!((172..=202).contains(&bright.count()));
        let tile = tile(3, 4, |r, c| (r * 4 + c) as f32);
        let drawn = SampledPixels::of(&tile, 6);
        for &(pixel, value, about) in &drawn.pixels {
            let (row, column) = (pixel / 6 - 2, pixel % 6 - 1);
            let own = tile.pixels[row * 4 + column];
            assert_eq!(value, [own.re, own.im]);
            let expected = power_about(&tile, row, column) + drawn.mean(12);
            assert!((about / expected - 1.0).abs() < 1e-12);
        }
        assert_eq!(
            SampledPixels::of(&Tile::new(tile.place), 6),
            SampledPixels::default()
        );
    }
}
