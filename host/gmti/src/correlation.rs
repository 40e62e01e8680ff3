//! Correlation of neighbouring pixels: independent cells, and their spacing.
//!
//! The autocorrelation `r(lag)` along an axis is the mean over blocks of equal weight. The spectrum of an image is centred on a carrier that changes over the image: at a distance `x` along the
//! track from the middle of the aperture it is `4 pi x / (lambda R)`. In each block the carrier is a straight line through its phases of `r(1)` in both halves, and is removed, or the mean would lose the correlation.
//!
//! The correlation length `sum |r(lag)|^2` is the number of pixels of an independent cell: the mean power of `n` pixels has the variance of that of `n / length` independent ones.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_model::image::Image;

use crate::adaptive::widen;

/// Largest spacing that is searched, pixels.
const MAX_SPACING: usize = 32;

/// Edge of the blocks whose correlation is averaged, pixels.
const BLOCK: usize = 64;

/// Largest number of blocks: of more, as many are taken at equal distances. Some 40,000 independent cells determine `|r|^2` to 3e-5.
const MOST_BLOCKS: usize = 64;

/// Squared correlation from which it is noise of the estimate.
const NOISE: f64 = 0.01;

/// Spacing of independent cells in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Spacing {
    /// Along rows of the grid.
    pub rows: usize,
    /// Along columns of the grid.
    pub columns: usize,
}

/// Correlation lengths of the pixels of an image along rows and columns of the grid, pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Correlation([f64; 2]);

impl Correlation {
    /// Measure the correlation of an image.
    pub(crate) fn measure(image: &Image) -> Self {
        let blocks = blocks(image);
        Self([0, 1].map(|axis| length(&blocks, image, axis)))
    }

    /// Spacing of independent pixels: the lengths, rounded up.
    pub(crate) fn spacing(&self) -> Spacing {
        let [rows, columns] = self
            .0
            .map(|length| (length.ceil() as usize).min(MAX_SPACING));
        Spacing { rows, columns }
    }

    /// Number of pixels of an independent cell.
    pub(crate) fn cell_pixels(&self) -> f64 {
        self.0.iter().product()
    }
}

/// Correlation length along an axis, at least 1.
fn length(blocks: &[Block], image: &Image, axis: usize) -> f64 {
    let longest = [image.rows, image.columns][axis];
    let sound: Vec<(&Block, f64, Carrier)> = blocks
        .par_iter()
        .filter_map(|block| {
            let power = products(block, image, axis, 0)
                .iter()
                .map(|z| z.re)
                .sum::<f64>();
            let carrier = Carrier::of(&products(block, image, axis, 1));
            (power > 0.0 && power.is_finite()).then_some((block, power, carrier))
        })
        .collect();
    let correlation = |lag: usize| {
        let of_block = |(block, power, carrier): &(&Block, f64, Carrier)| {
            let length = block[axis].len();
            let pairs = length.saturating_sub(lag).max(1);
            let products = products(block, image, axis, lag);
            let products = products.into_iter().enumerate();
            let turned = products.map(|(i, z)| z * carrier.removed(i, lag));
            turned.sum::<Complex64>() / power * (length as f64 / pairs as f64)
        };
        // A sum in order, so that it does not depend on the number of threads.
        let terms: Vec<Complex64> = sound.par_iter().map(of_block).collect();
        terms.iter().sum::<Complex64>() / (sound.len() as f64).max(1e-300)
    };
    let most = MAX_SPACING.min(longest.saturating_sub(1));
    let squares = (1..=most).map(|lag| correlation(lag).norm_sqr());
    1.0 + 2.0 * squares.take_while(|&square| square > NOISE).sum::<f64>()
}

/// Rows and columns of a block.
type Block = [Range<usize>; 2];

/// Blocks of an image whose correlation is averaged.
fn blocks(image: &Image) -> Vec<Block> {
    let size = [image.rows, image.columns];
    let tiles = size.map(|count| count.div_ceil(BLOCK));
    let all = tiles[0] * tiles[1];
    let used = all.min(MOST_BLOCKS);
    let part = |tile: usize, count: usize| tile * BLOCK..((tile + 1) * BLOCK).min(count);
    let block = |i: usize| {
        let tile = i * all / used;
        [
            part(tile / tiles[1], size[0]),
            part(tile % tiles[1], size[1]),
        ]
    };
    (0..used).map(block).collect()
}

/// Products of the pixels of a block at a `lag` along an axis, one for each place along it: sums over the other axis.
fn products(block: &Block, image: &Image, axis: usize, lag: usize) -> Vec<Complex64> {
    let [down, across] = [[lag, 0], [0, lag]][axis];
    let [rows, columns] = [(0, down), (1, across)].map(|(axis, lag)| {
        let Range { start, end } = block[axis];
        start..end.saturating_sub(lag).max(start)
    });
    let line = |row: usize, from: usize| &image.pixels[row * image.columns + from..];
    let product = |(&a, &b): (&Complex32, &Complex32)| widen(b) * widen(a).conj();
    let mut sums = vec![Complex64::ZERO; [rows.len(), columns.len()][axis]];
    for row in rows.clone() {
        let own = &line(row, columns.start)[..columns.len()];
        let other = &line(row + down, columns.start + across)[..columns.len()];
        let products = own.iter().zip(other).map(product);
        match axis {
            0 => sums[row - rows.start] = products.sum(),
            _ => sums.iter_mut().zip(products).for_each(|(sum, z)| *sum += z),
        }
    }
    sums
}

/// Carrier of a block along an axis: phase between neighbouring pixels, a straight line.
struct Carrier {
    /// Phase between the first two pixels, radians.
    start_rad: f64,
    /// Change of the phase from pixel to pixel, radians.
    change_rad: f64,
}

impl Carrier {
    /// Carrier by the products of neighbouring pixels.
    fn of(products: &[Complex64]) -> Self {
        let middle = products.len() / 2;
        let [first, second] =
            [&products[..middle], &products[middle..]].map(|half| half.iter().sum::<Complex64>());
        let between_rad = (second * first.conj()).arg();
        let change_rad = 2.0 * between_rad / products.len().max(1) as f64;
        // The first half is as far from its middle.
        let start_rad = first.arg() - change_rad * 0.5 * (middle.max(1) - 1) as f64;
        Self {
            start_rad,
            change_rad,
        }
    }

    /// Factor that removes the phase between the pixels at `i` and `i + lag`.
    fn removed(&self, i: usize, lag: usize) -> Complex64 {
        let lag = lag as f64;
        let mean_rad = self.start_rad + self.change_rad * (i as f64 + 0.5 * (lag - 1.0));
        Complex64::cis(-(lag * mean_rad) % TAU)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// White noise, averaged over 3 rows and 2 columns, with a carrier that changes over the columns.
    fn image(change_rad: f64) -> Image {
        let (rows, columns) = (256, 512);
        let mut state = 1u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let wide = columns + 1;
        let noise: Vec<Complex64> = (0..(rows + 2) * wide)
            .map(|_| Complex64::new(uniform(), uniform()))
            .collect();
        let pixel = |i: usize| {
            let (row, column) = (i / columns, i % columns);
            let near = (0..6).map(|k| noise[(row + k / 2) * wide + column + k % 2]);
            let phase_rad = 0.5 * change_rad * (column as f64).powi(2) + 2.0 * row as f64;
            let value = near.sum::<Complex64>() * Complex64::cis(phase_rad % TAU);
            Complex32::new(value.re as f32, value.im as f32)
        };
        Image {
            rows,
            columns,
            pixels: (0..rows * columns).map(pixel).collect(),
        }
    }

    /// The autocorrelation of a mean over `n` pixels is `1 - lag / n`.
    #[test]
    fn correlation_length_does_not_depend_on_the_carrier() {
        let expected = [1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 9.0), 1.0 + 2.0 / 4.0];
        for change_rad in [0.0, 0.005, 0.02] {
            let correlation = Correlation::measure(&image(change_rad));
            println!("{change_rad}: {correlation:?}, expected {expected:?}");
            // 32 blocks of 4096 pixels, 1300 independent ones: a standard deviation of |r|^2 of 0.007.
            for (found, expected) in correlation.0.into_iter().zip(expected) {
                assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
            }
            assert_eq!(
                correlation.spacing(),
                Spacing {
                    rows: 3,
                    columns: 2
                }
            );
        }
    }
}
