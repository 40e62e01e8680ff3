//! Sub-aperture tiles.

use subaperture_model::image::{ImageSource, ImageSourceError, PixelBlock};
use subaperture_quality::aperture::Aperture;
use subaperture_quality::sub_aperture::parts_of;

use super::pixels::Pixels;
use super::tile::{average, cells};
use subaperture_model::geometry::ImageGrid;

/// Coarsest level of a sub-aperture tile: 1024 x 1024 pixels, 8 MB, computed from patches of 768 x 768 pixels, 5 MB each in two copies.
pub(super) const COARSEST: u32 = 2;

/// Maximum memory of a sub-aperture tile, bytes.
pub(super) const MAX_BYTES: u64 = 24 << 20;

/// Cells of a tile and their mean powers, for the part of the aperture between two fractions of it. `None` if the tile
/// does not exist or the aperture is unknown there.
pub(super) fn powers(
    pixels: &Pixels,
    grid: &ImageGrid,
    aperture: &Aperture,
    part: [f64; 2],
    (level, at): (u32, [usize; 2]),
) -> Result<Option<(PixelBlock, Vec<f64>)>, ImageSourceError> {
    let (rows, columns) = pixels.size();
    let size = [rows, columns];
    let Some(tile) = cells(size, level, at).filter(|_| level <= COARSEST) else {
        return Ok(None);
    };
    let place: PixelBlock =
        [0, 1].map(|i| (tile[i].start << level)..(tile[i].end << level).min(size[i]));
    let found = parts_of(pixels, grid, aperture, &place, &[part])?;
    let one = found.and_then(|mut found| found.pop());
    Ok(one.map(|seen| (tile, average(&seen, level))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::TILE;
    use num_complex::Complex32;
    use std::f64::consts::TAU;
    use subaperture_model::image::Image;
    use subaperture_quality::sub_aperture::AperturePart;

    const SIZE: [usize; 2] = [600, 900];

    /// Waves of random phases over 0.5 cycles per pixel along columns, about a mean frequency that grows from 0 to 0.3 cycles per pixel across the image.
    fn image() -> Image {
        let mut state = 3u64;
        let mut uniform = move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let waves: Vec<[f64; 3]> = (0..40)
            .map(|_| [uniform() - 0.5, 0.5 * (uniform() - 0.5), uniform()])
            .collect();
        let value = |i: usize| {
            let [row, column] = [i / SIZE[1], i % SIZE[1]].map(|x| x as f64);
            let mean = 0.3 * column / SIZE[1] as f64 / 2.0;
            let mut sum = num_complex::Complex64::ZERO;
            for [down, across, phase] in &waves {
                let turns = down * row + (across + mean) * column + phase;
                sum += num_complex::Complex64::cis(TAU * turns);
            }
            Complex32::new(sum.re as f32, sum.im as f32)
        };
        Image {
            rows: SIZE[0],
            columns: SIZE[1],
            pixels: (0..SIZE[0] * SIZE[1]).map(value).collect(),
        }
    }

    /// Tiles equal the sub-aperture of the whole image, and levels jump no more across their edges than elsewhere. With a mean frequency of each tile, the bounds
    /// would jump by 256 x 0.3 / 900 = 0.09 cycles per pixel from tile to tile.
    #[test]
    fn sub_aperture_tiles_have_no_seams() {
        let image = image();
        let grid: ImageGrid = "x=0:900:1,y=0:600:1".parse().unwrap();
        let aperture = Aperture::columns(0.5, &image).unwrap().unwrap();
        let part = [0.25, 0.5];
        let whole = AperturePart::new(&image, &grid, &aperture, part);
        let whole = whole.window(&[0..SIZE[0], 0..SIZE[1]]).unwrap();
        let pixels = Pixels::whole(Box::new(image));
        for level in 0..=COARSEST {
            let size = SIZE.map(|n| n.div_ceil(1 << level));
            let expected = average(&whole, level);
            let mean = expected.iter().sum::<f64>() / expected.len() as f64;
            let mut shown = vec![0.0; expected.len()];
            for row in 0..size[0].div_ceil(TILE) {
                for column in 0..size[1].div_ceil(TILE) {
                    let found = powers(&pixels, &grid, &aperture, part, (level, [row, column]));
                    let (place, cells) = found.unwrap().unwrap();
                    for (i, power) in cells.iter().enumerate() {
                        let at = [i / place[1].len(), i % place[1].len()];
                        let [row, column] = [0, 1].map(|k| place[k].start + at[k]);
                        shown[row * size[1] + column] = *power;
                    }
                }
            }
            // Transforms err by some 1e-6 of the image's RMS, 50 times that of a tile where the sub-aperture is dark.
            for (a, b) in shown.iter().zip(&expected) {
                assert!(
                    (a - b).abs() < 1e-4 * mean,
                    "level {level}: {a} {b} of {mean}"
                );
            }
            // Mean difference between neighbouring columns, of levels limited to 30 dB below the mean.
            let db = |power: f64| 10.0 * (power / mean).max(1e-3).log10();
            let jump = |column: usize| {
                let rows = (0..size[0]).map(|row| row * size[1] + column);
                let steps = rows.map(|i| (db(shown[i]) - db(shown[i - 1])).abs());
                steps.sum::<f64>() / size[0] as f64
            };
            let inside = (1..size[1]).filter(|column| column % TILE != 0).map(jump);
            let largest = inside.fold(0.0, f64::max);
            for edge in (TILE..size[1]).step_by(TILE) {
                assert!(
                    jump(edge) <= largest,
                    "level {level}: {} {largest}",
                    jump(edge)
                );
            }
        }
    }
}
