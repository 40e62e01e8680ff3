//! Samples along lines anywhere, spread onto the cells of a raster.
//!
//! ```text
//! cell[i][j] += sum_k phi(row_k - i) phi(column_k - j) z_k,    row_k = r_0 + k r_1,  column_k = c_0 + k c_1
//! ```
//!
//! the first half of a type-1 non-uniform transform, with the Kaiser-Bessel kernel `phi` of `W` taps
//! ([`subaperture_signal::kaiser_bessel`]), so each sample goes to `W x W` cells. A call fills a band of whole rows; bands side by side
//! make the raster, the same bits however it is divided, for the samples of a cell come in the order of lines and of `k`.
//!
//! Places are float64, weights from a table good to 2e-6, sums float32. Cost a sample: `W^2` complex multiply-adds in its band.

use std::ops::Range;

use num_complex::Complex32;
use subaperture_signal::kaiser_bessel::KaiserBessel;

/// Where the samples of a pulse lie on the raster: `start + k step`, in rows and columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Row and column of sample 0.
    pub start: [f64; 2],
    /// From sample to sample.
    pub step: [f64; 2],
}

/// Some whole rows of a raster.
pub struct Band<'a> {
    /// The raster's row that is the first here.
    pub first_row: usize,
    /// Cells of a row.
    pub columns: usize,
    /// The cells, row by row.
    pub cells: &'a mut [Complex32],
}

impl Band<'_> {
    /// Adds the samples of a pulse, as far as they reach these rows. No sample may come nearer to the first or last column than the
    /// kernel reaches.
    ///
    /// # Panics
    /// If one does, or the kernel has not `W` taps.
    pub fn spread<const W: usize>(
        &mut self,
        kernel: &KaiserBessel,
        line: &Line,
        samples: &[Complex32],
    ) {
        let num_rows = self.cells.len() / self.columns;
        let low = self.first_row as f64 - W as f64;
        let high = (self.first_row + num_rows + W) as f64;
        let [row_start, column_start] = line.start;
        let [row_step, column_step] = line.step;
        for k in within(row_start, row_step, low, high, samples.len()) {
            let row = row_start + k as f64 * row_step;
            let column = column_start + k as f64 * column_step;
            let (row_whole, column_whole) = (row.floor(), column.floor());
            let row_weights = kernel.weights::<W>((row - row_whole) as f32);
            let column_weights = kernel.weights::<W>((column - column_whole) as f32);
            let left = column_whole as usize + 1 - W / 2;
            let top = row_whole as isize + 1 - (W / 2) as isize - self.first_row as isize;
            for (i, row_weight) in (top..).zip(row_weights) {
                if i < 0 || i >= num_rows as isize {
                    continue;
                }
                let value = samples[k] * row_weight;
                let start = i as usize * self.columns + left;
                let cells = &mut self.cells[start..start + W];
                for (cell, weight) in cells.iter_mut().zip(column_weights) {
                    *cell += value * weight;
                }
            }
        }
    }
}

/// The samples `k` for which `low <= start + k step <= high`, or a few more.
fn within(start: f64, step: f64, low: f64, high: f64, count: usize) -> Range<usize> {
    if step == 0.0 {
        return if (low..=high).contains(&start) {
            0..count
        } else {
            0..0
        };
    }
    let (a, b) = ((low - start) / step, (high - start) / step);
    let first = a.min(b).floor().clamp(0.0, count as f64) as usize;
    let last = a.max(b).ceil().clamp(-1.0, count as f64 - 1.0) + 1.0;
    first..(last as usize).max(first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::{Numbers, kaiser_bessel, wide};
    use num_complex::Complex64;

    const ROWS: usize = 37;
    const COLUMNS: usize = 29;

    /// Lines of 60 samples: slanted, backwards, along a row, along a column. None is half a kernel from a cell to the last digit, where
    /// the kernel ends in a step.
    fn lines() -> Vec<Line> {
        let line = |start, step| Line { start, step };
        vec![
            line([1.2137, 4.3071], [0.51, 0.33]),
            line([35.6173, 24.7039], [-0.57, -0.34]),
            line([17.8171, 4.1039], [0.0, 0.35]),
            line([-2.0173, 13.3719], [0.61, 0.0]),
        ]
    }

    fn spread<const W: usize>(rows_a_band: usize, samples: &[Vec<Complex32>]) -> Vec<Complex32> {
        let kernel = KaiserBessel::new(W);
        let mut raster = vec![Complex32::ZERO; ROWS * COLUMNS];
        let bands = raster.chunks_mut(rows_a_band * COLUMNS);
        for (band, cells) in bands.enumerate() {
            let mut band = Band {
                first_row: band * rows_a_band,
                columns: COLUMNS,
                cells,
            };
            for (line, samples) in lines().iter().zip(samples) {
                band.spread::<W>(&kernel, line, samples);
            }
        }
        raster
    }

    fn check<const W: usize>() {
        let mut numbers = Numbers::new(W as u64);
        let samples: Vec<Vec<Complex32>> = lines().iter().map(|_| numbers.samples(60)).collect();
        let raster = spread::<W>(ROWS, &samples);
        for rows_a_band in [1, 5, 36] {
            assert_eq!(spread::<W>(rows_a_band, &samples), raster, "{rows_a_band}");
        }
        let mut largest = 0.0f64;
        for (cell, got) in raster.iter().enumerate() {
            let [i, j] = [cell / COLUMNS, cell % COLUMNS].map(|n| n as f64);
            let (mut expected, mut magnitude, mut reach) = (Complex64::ZERO, 0.0, 0.0);
            for (line, samples) in lines().iter().zip(&samples) {
                for (k, &z) in (0..).map(f64::from).zip(samples) {
                    let off = [
                        line.start[0] + k * line.step[0] - i,
                        line.start[1] + k * line.step[1] - j,
                    ];
                    let [a, b] = off.map(|t| kaiser_bessel(W, t));
                    expected += wide(z) * (a * b);
                    magnitude += a * b;
                    if off.iter().all(|t| t.abs() <= W as f64 / 2.0) {
                        reach += a + b;
                    }
                }
            }
            // Each weight is off by the table's 2e-6, in rows and in columns. Roundings: a fraction, two products and a sum, of which there
            // are some 40 to a cell, by at most half a unit of the whole.
            let allowed = 2e-6 * reach + magnitude * 45.0 * 8.5e-8 + 1e-11;
            let error = (wide(*got) - expected).norm();
            assert!(error < allowed, "{i} {j}: {error} {allowed}");
            largest = largest.max(expected.norm());
        }
        assert!(largest > 0.5);
    }

    #[test]
    fn samples_go_where_the_sum_says() {
        check::<4>();
        check::<6>();
    }

    #[test]
    fn samples_within_rows_are_found() {
        assert_eq!(within(0.0, 1.0, 2.0, 5.0, 100), 2..6);
        assert_eq!(within(10.0, -2.0, 0.0, 4.0, 100), 3..6);
        assert_eq!(within(3.0, 0.0, 2.0, 5.0, 7), 0..7);
        assert_eq!(within(9.0, 0.0, 2.0, 5.0, 7), 0..0);
        assert!(within(50.0, 1.0, 2.0, 5.0, 7).is_empty());
        assert!(within(-50.0, 1.0, 2.0, 5.0, 7).is_empty());
    }
}
