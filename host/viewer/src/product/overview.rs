//! Multi-resolution overview of an image: planes of mean power, each half the resolution of the previous one, computed
//! in one pass over the pixels.
//!
//! A cell of level `k` covers `2^k x 2^k` pixels, or the remainder at the last row and column. Its value is the mean
//! power of the pixels, as in multilooking. The finest level kept is the third, memory permitting: 4 bytes per 64
//! pixels, plus one third for all coarser levels. Finer levels are computed from the pixels, one tile at a time
//! ([`super::tile`]).
//!
//! **Approximations.** Powers are summed in float64 within a row of a cell and in float32 across rows: the relative
//! error is at most 1e-6 for cells of 64 pixels. Magnitudes above 1e19 or below 1e-19 exceed the range of float32
//! powers. Non-finite pixels count as zero.

use subaperture_model::image::{Image, PixelBlock, power};

/// Side of a tile as sent, pixels.
pub const TILE: usize = 256;

/// Finest level that is ever kept.
const FINEST: u32 = 3;

/// Planes of summed power, from the finest level kept to the level that fits one tile.
#[derive(Debug)]
pub(super) struct Overview {
    /// Rows and columns of the image.
    size: [usize; 2],
    /// Level of the first plane.
    finest: u32,
    planes: Vec<Plane>,
    /// Maximum power of the pixels added so far.
    peak: f64,
}

#[derive(Debug)]
struct Plane {
    columns: usize,
    sums: Vec<f32>,
}

/// Coarsest level of an image: the first that fits one tile.
pub(super) fn coarsest(size: [usize; 2]) -> u32 {
    let side = size[0].max(size[1]);
    (0..).find(|&k| side.div_ceil(1 << k) <= TILE).unwrap_or(0)
}

/// Rows and columns of a level.
pub(super) fn size_at(size: [usize; 2], level: u32) -> [usize; 2] {
    size.map(|n| n.div_ceil(1 << level))
}

/// Memory of the planes from level `finest` on, bytes.
fn bytes_from(size: [usize; 2], finest: u32) -> u64 {
    let plane = |k| size_at(size, k).iter().map(|&n| n as u64).product::<u64>();
    (finest..=coarsest(size)).map(|k| 4 * plane(k)).sum()
}

impl Overview {
    /// Empty overview with the finest level that fits in `bytes`.
    pub(super) fn new(size: [usize; 2], bytes: u64) -> Self {
        let coarsest = coarsest(size);
        let fits = |&k: &u32| bytes_from(size, k) <= bytes;
        let finest = (FINEST.min(coarsest)..coarsest).find(fits);
        let finest = finest.unwrap_or(coarsest);
        let plane = |k| {
            let [rows, columns] = size_at(size, k);
            Plane {
                columns,
                sums: vec![0.0; rows * columns],
            }
        };
        Self {
            size,
            finest,
            planes: (finest..=coarsest).map(plane).collect(),
            peak: 0.0,
        }
    }

    /// Finest level kept.
    pub(super) fn finest(&self) -> u32 {
        self.finest
    }

    /// Maximum power of the pixels added so far.
    pub(super) fn peak(&self) -> f64 {
        self.peak
    }

    /// Add pixels to the finest plane. Each pixel may be added only once.
    pub(super) fn add(&mut self, [rows, columns]: &PixelBlock, part: &Image) {
        let plane = &mut self.planes[0];
        let lines = part.pixels.chunks_exact(columns.len().max(1));
        for (row, line) in rows.clone().zip(lines) {
            let cells = &mut plane.sums[(row >> self.finest) * plane.columns..][..plane.columns];
            let mut from = 0;
            while from < line.len() {
                let cell = (columns.start + from) >> self.finest;
                let end = (((cell + 1) << self.finest) - columns.start).min(line.len());
                let mut sum = 0.0;
                for &z in &line[from..end] {
                    let power = power(z);
                    if power.is_finite() {
                        sum += power;
                        self.peak = self.peak.max(power);
                    }
                }
                cells[cell] += sum as f32;
                from = end;
            }
        }
    }

    /// Compute the coarser planes from the finest.
    pub(super) fn fold(&mut self) {
        for k in 1..self.planes.len() {
            let (finer, coarser) = self.planes.split_at_mut(k);
            let (from, to) = (&finer[k - 1], &mut coarser[0]);
            to.sums.fill(0.0);
            for (row, line) in from.sums.chunks_exact(from.columns).enumerate() {
                let cells = &mut to.sums[(row / 2) * to.columns..][..to.columns];
                for (column, sum) in line.iter().enumerate() {
                    cells[column / 2] += sum;
                }
            }
        }
    }

    /// Mean powers of a region of a level, row-major. For levels finer than those kept, the powers of the enclosing
    /// cells.
    pub(super) fn powers(&self, level: u32, place: &PixelBlock) -> Vec<f64> {
        let missing = self.finest.saturating_sub(level);
        let around = |i: usize| place[i].start >> missing..((place[i].end - 1) >> missing) + 1;
        let kept = self.kept(level + missing, &[around(0), around(1)]);
        if missing == 0 {
            return kept;
        }
        let [first, across] = [around(0).start, around(1).start];
        let width = around(1).len();
        let cell = |row: usize, column: usize| {
            kept[((row >> missing) - first) * width + (column >> missing) - across]
        };
        let rows = place[0].clone();
        rows.flat_map(|row| place[1].clone().map(move |column| (row, column)))
            .map(|(row, column)| cell(row, column))
            .collect()
    }

    /// Mean powers of a region of a level that is kept.
    fn kept(&self, level: u32, [rows, columns]: &PixelBlock) -> Vec<f64> {
        let plane = &self.planes[(level - self.finest) as usize];
        let mut powers = Vec::with_capacity(rows.len() * columns.len());
        for row in rows.clone() {
            let height = pixels_of(self.size[0], level, row);
            let line = &plane.sums[row * plane.columns..][..plane.columns];
            powers.extend(columns.clone().map(|column| {
                let count = height * pixels_of(self.size[1], level, column);
                f64::from(line[column]) / count as f64
            }));
        }
        powers
    }

    /// Mean powers of the whole image at the finest kept level with at most `side` rows and columns.
    pub(super) fn small(&self, side: usize) -> Vec<f64> {
        let fits = |&k: &u32| size_at(self.size, k).iter().all(|&n| n <= side);
        let last = self.finest + self.planes.len() as u32 - 1;
        let level = (self.finest..last).find(fits).unwrap_or(last);
        let [rows, columns] = size_at(self.size, level);
        self.powers(level, &[0..rows, 0..columns])
    }
}

/// Number of pixels in row or column `cell` of a level, for an image with `count` of them.
fn pixels_of(count: usize, level: u32, cell: usize) -> usize {
    (count - (cell << level)).min(1 << level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;

    fn image(rows: usize, columns: usize) -> Image {
        let value = |i: usize| {
            let x = (i as u32).wrapping_mul(2_654_435_761) >> 8;
            Complex32::new(x as f32 * 1e-6, (x % 977) as f32 * 1e-2)
        };
        Image {
            rows,
            columns,
            pixels: (0..rows * columns).map(value).collect(),
        }
    }

    /// Reference: mean power of the pixels of a cell.
    fn mean(image: &Image, level: u32, row: usize, column: usize) -> f64 {
        let side = 1usize << level;
        let (mut sum, mut count) = (0.0, 0.0);
        for r in row * side..((row + 1) * side).min(image.rows) {
            for c in column * side..((column + 1) * side).min(image.columns) {
                let z = image.pixels[r * image.columns + c];
                sum += f64::from(z.re).powi(2) + f64::from(z.im).powi(2);
                count += 1.0;
            }
        }
        sum / count
    }

    /// Parts of any shape in any order give the same planes. Float32 sums of up to 2^13 partial cells err by at most
    /// 2^13 half units of 6e-8. The tolerance of 1e-5 is far below the display resolution of 0.1 dB, 2 %.
    #[test]
    fn cells_are_mean_powers() {
        let image = image(1100, 777);
        let size = [1100, 777];
        let mut overview = Overview::new(size, u64::MAX);
        assert_eq!((overview.finest(), coarsest(size)), (3, 3));
        let mut coarse = Overview::new([1100 * 8, 777], 1 << 20);
        assert!(coarse.finest() >= 3 && bytes_from(coarse.size, coarse.finest()) <= 1 << 20);
        coarse.fold();
        // Tiles not aligned with cells, last first.
        let mut places = Vec::new();
        for row in (0..1100).step_by(101) {
            for column in (0..777).step_by(53) {
                places.push([row..(row + 101).min(1100), column..(column + 53).min(777)]);
            }
        }
        use subaperture_model::image::ImageSource;
        for place in places.iter().rev() {
            overview.add(place, &image.window(place).unwrap());
        }
        overview.fold();
        let place = [3..138, 5..98];
        let powers = overview.powers(3, &place);
        for (i, power) in powers.iter().enumerate() {
            let (row, column) = (3 + i / 93, 5 + i % 93);
            let expected = mean(&image, 3, row, column);
            assert!((power / expected - 1.0).abs() < 1e-5, "{row} {column}");
        }
        let brightest = image.peak().unwrap().value;
        assert_eq!(overview.peak(), power(brightest));
    }

    #[test]
    fn coarser_planes_are_mean_powers() {
        let size = [2300, 4100];
        let image = image(2300, 4100);
        let mut overview = Overview::new(size, u64::MAX);
        overview.add(&[0..2300, 0..4100], &image);
        overview.fold();
        assert_eq!(coarsest(size), 5);
        for level in 3..=5 {
            let [rows, columns] = size_at(size, level);
            let powers = overview.powers(level, &[0..rows, 0..columns]);
            for (row, column) in [
                (0, 0),
                (rows - 1, columns - 1),
                (rows / 2, columns - 1),
                (7, 11),
            ] {
                let expected = mean(&image, level, row, column);
                let power = powers[row * columns + column];
                assert!(
                    (power / expected - 1.0).abs() < 1e-5,
                    "{level} {row} {column}"
                );
            }
        }
        // With memory for the last level only, its cells are used for the level before it.
        let mut little = Overview::new(size, 40_000);
        little.add(&[0..2300, 0..4100], &image);
        assert_eq!(little.finest(), 5);
        let place = [3..72, 100..129];
        for (i, power) in little.powers(4, &place).into_iter().enumerate() {
            let (row, column) = (3 + i / 29, 100 + i % 29);
            let expected = mean(&image, 5, row / 2, column / 2);
            assert!((power / expected - 1.0).abs() < 1e-5, "{row} {column}");
        }
        assert_eq!(
            overview.small(150).len(),
            size_at(size, 5).iter().product::<usize>()
        );
    }
}
