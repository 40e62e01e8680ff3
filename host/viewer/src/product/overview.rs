//! An image made smaller: planes of mean power, each half as fine as the one before, made in one pass over the pixels.
//!
//! A cell of level `k` is `2^k x 2^k` pixels, those at the last row and column what is left; it has the mean of their powers, which is what many looks of so many pixels
//! are. The finest level that is kept is the third, where memory allows it: 4 bytes for 64 pixels, and a third more for all coarser ones. Finer levels are not kept but
//! computed of the pixels a tile at a time ([`super::tile`]).
//!
//! **Neglected.** Powers are summed in float32 after each row of a cell (float64 within it): relative to the sum of cells of 64 pixels 1e-6 at the most. Magnitudes beyond
//! 1e19 or below 1e-19 are beyond float32's powers. Pixels that are no numbers count as zero.

use subaperture_model::image::{Image, Place, power};

/// Pixels a side of a tile as it is sent.
pub const TILE: usize = 256;

/// The finest level that is kept at all.
const FINEST: u32 = 3;

/// Planes of sums of powers, from the finest that is kept to one that fits a tile.
#[derive(Debug)]
pub(super) struct Overview {
    /// Rows and columns of the image.
    size: [usize; 2],
    /// Level of the first plane.
    finest: u32,
    planes: Vec<Plane>,
    /// Of the pixels that were added.
    peak: f64,
}

#[derive(Debug)]
struct Plane {
    columns: usize,
    sums: Vec<f32>,
}

/// The coarsest level of an image: the first that fits a tile.
pub(super) fn coarsest(size: [usize; 2]) -> u32 {
    let side = size[0].max(size[1]);
    (0..).find(|&k| side.div_ceil(1 << k) <= TILE).unwrap_or(0)
}

/// Rows and columns of a level.
pub(super) fn size_at(size: [usize; 2], level: u32) -> [usize; 2] {
    size.map(|n| n.div_ceil(1 << level))
}

/// Bytes of the planes from a level on.
fn bytes_from(size: [usize; 2], finest: u32) -> u64 {
    let plane = |k| size_at(size, k).iter().map(|&n| n as u64).product::<u64>();
    (finest..=coarsest(size)).map(|k| 4 * plane(k)).sum()
}

impl Overview {
    /// One of nothing yet, of as fine levels as `bytes` hold.
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

    /// The finest level that is kept.
    pub(super) fn finest(&self) -> u32 {
        self.finest
    }

    /// The largest power of a pixel, of those that were added.
    pub(super) fn peak(&self) -> f64 {
        self.peak
    }

    /// Adds a part's pixels to the finest plane; no pixel may come twice.
    pub(super) fn add(&mut self, [rows, columns]: &Place, part: &Image) {
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

    /// Makes the coarser planes of the finest.
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

    /// Mean powers of a place of a level, row-major: of a level finer than those that are kept those of the cells around it.
    pub(super) fn powers(&self, level: u32, place: &Place) -> Vec<f64> {
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

    /// Those of a level that is kept.
    fn kept(&self, level: u32, [rows, columns]: &Place) -> Vec<f64> {
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

    /// Mean powers of the whole image at the finest level kept at which it has no more than `side` rows and columns.
    pub(super) fn small(&self, side: usize) -> Vec<f64> {
        let fits = |&k: &u32| size_at(self.size, k).iter().all(|&n| n <= side);
        let last = self.finest + self.planes.len() as u32 - 1;
        let level = (self.finest..last).find(fits).unwrap_or(last);
        let [rows, columns] = size_at(self.size, level);
        self.powers(level, &[0..rows, 0..columns])
    }
}

/// Pixels of a row or column of a level, of the image's `count`.
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

    /// The mean of the powers of the pixels that a cell has, written out.
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

    /// Parts of any shape, in any order, come to the same planes. Float32 sums of up to 2^13 parts of cells err by 2^13 half units of 6e-8 at the very most; 1e-5 is
    /// far below what a tenth of a decibel shows, 2 %.
    #[test]
    fn cells_are_means_of_powers() {
        let image = image(1100, 777);
        let size = [1100, 777];
        let mut overview = Overview::new(size, u64::MAX);
        assert_eq!((overview.finest(), coarsest(size)), (3, 3));
        let mut coarse = Overview::new([1100 * 8, 777], 1 << 20);
        assert!(coarse.finest() >= 3 && bytes_from(coarse.size, coarse.finest()) <= 1 << 20);
        coarse.fold();
        // Tiles that no cell's edge knows, last first.
        let mut places = Vec::new();
        for row in (0..1100).step_by(101) {
            for column in (0..777).step_by(53) {
                places.push([row..(row + 101).min(1100), column..(column + 53).min(777)]);
            }
        }
        use subaperture_model::image::Parts;
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
    fn coarser_planes_are_means_too() {
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
        // With room for the last level alone, its cells stand for those of the level before.
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
