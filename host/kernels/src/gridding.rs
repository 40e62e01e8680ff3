//! Gridding (adjoint NUFFT): samples along arbitrary lines convolved onto a raster.
//!
//! ```text
//! cell[i][j] += sum_k phi(row_k - i) phi(column_k - j) z_k,    row_k = r_0 + k r_1,  column_k = c_0 + k c_1
//! ```
//!
//! This is the first half of a type-1 NUFFT with the Kaiser-Bessel kernel `phi` of `W` taps
//! ([`subaperture_signal::kaiser_bessel`]); each sample contributes to `W` by `W` cells. A call fills a band of whole rows. The raster is
//! bit-identical for any division into bands, because the samples of a cell are added in the order of lines and of `k`.
//!
//! **Accuracy** positions float64, weights polynomials with an error of 1e-6, sums float32. **Cost** per sample: `W^2` complex multiply-adds in its band.

use std::ops::Range;

use num_complex::Complex32;
use subaperture_signal::kaiser_bessel::KaiserBessel;

use crate::lanes::{GROUP, Instructions, Kernel, Lanes};
use crate::taps::{below, weights};

/// Samples per block of weights.
const BLOCK: usize = 4 * GROUP;

/// Positions of a pulse's samples on the raster, `start + k step`, in rows and columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Row and column of sample 0.
    pub start: [f64; 2],
    /// Step per sample, rows and columns.
    pub step: [f64; 2],
}

/// Band of whole rows of a raster.
pub struct Band<'a> {
    /// Raster row of the band's first row.
    pub first_row: usize,
    /// Cells per row.
    pub columns: usize,
    /// Cells, row by row, real and imaginary parts interleaved.
    pub cells: &'a mut [f32],
}

impl Band<'_> {
    /// Add the samples of a pulse that contribute to these rows. Every sample must be at least half a kernel
    /// from the first and last column.
    ///
    /// # Panics
    /// If a sample is too close to the first or last column, or the kernel does not have `W` taps.
    pub fn spread<const W: usize>(
        &mut self,
        instructions: Instructions,
        kernel: &KaiserBessel,
        line: &Line,
        samples: &[Complex32],
    ) {
        const { assert!(W >= 2 && W.is_multiple_of(2) && 2 * W <= GROUP) };
        assert_eq!(kernel.taps(), W);
        instructions.run(Spread::<W> {
            band: self,
            kernel,
            line,
            samples,
        });
    }

    fn num_rows(&self) -> usize {
        self.cells.len() / (2 * self.columns)
    }
}

struct Spread<'a, 'b, const W: usize> {
    band: &'a mut Band<'b>,
    kernel: &'a KaiserBessel,
    line: &'a Line,
    samples: &'a [Complex32],
}

/// Weighted samples of a block.
struct Terms {
    /// First row and column of each sample's kernel.
    tops: [f64; BLOCK],
    lefts: [f64; BLOCK],
    /// Row weights per sample.
    rows: [[f32; GROUP / 2]; BLOCK],
    /// Samples times column weights, real and imaginary parts, zero-padded.
    columns: [[f32; GROUP]; BLOCK],
}

impl Terms {
    /// Fill with the samples from `first` on.
    #[inline(always)]
    fn fill<L: Lanes, const W: usize>(
        &mut self,
        lanes: L,
        kernel: &KaiserBessel,
        line: &Line,
        first: usize,
        samples: &[Complex32],
    ) {
        let before = (W / 2 - 1) as f64;
        let [mut along, mut across] = [[0.0f32; BLOCK]; 2];
        let [row_start, column_start] = line.start;
        let [row_step, column_step] = line.step;
        for i in 0..samples.len() {
            let k = (first + i) as f64;
            let [row, column] = [row_start + k * row_step, column_start + k * column_step];
            let [row_whole, column_whole] = [row, column].map(below);
            across[i] = (row - row_whole - 0.5) as f32;
            along[i] = (column - column_whole - 0.5) as f32;
            self.tops[i] = row_whole - before;
            self.lefts[i] = column_whole - before;
        }
        for group in (0..samples.len()).step_by(GROUP) {
            let [mut of_rows, mut of_columns] = [[[0.0f32; GROUP]; W]; 2];
            for part in (0..GROUP).step_by(L::COUNT) {
                for (at, out) in [(&across, &mut of_rows), (&along, &mut of_columns)] {
                    let weights: [_; W] =
                        weights(lanes, kernel.polynomials(), lanes.load(&at[group + part..]));
                    for (weight, out) in weights.into_iter().zip(out) {
                        lanes.store(weight, &mut out[part..]);
                    }
                }
            }
            for (i, z) in samples[group..].iter().take(GROUP).enumerate() {
                let (rows, columns) = (&mut self.rows[group + i], &mut self.columns[group + i]);
                for tap in 0..W {
                    rows[tap] = of_rows[tap][i];
                    columns[2 * tap] = z.re * of_columns[tap][i];
                    columns[2 * tap + 1] = z.im * of_columns[tap][i];
                }
            }
        }
    }
}

impl<const W: usize> Kernel for Spread<'_, '_, W> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self {
            band,
            kernel,
            line,
            samples,
        } = self;
        let (num_rows, row_length) = (band.num_rows(), 2 * band.columns);
        let low = band.first_row as f64 - W as f64;
        let high = (band.first_row + num_rows + W) as f64;
        let reached = within(line.start[0], line.step[0], low, high, samples.len());
        let mut terms = Terms {
            tops: [0.0; BLOCK],
            lefts: [0.0; BLOCK],
            rows: [[0.0; GROUP / 2]; BLOCK],
            columns: [[0.0; GROUP]; BLOCK],
        };
        for first in reached.clone().step_by(BLOCK) {
            let block = &samples[first..reached.end.min(first + BLOCK)];
            terms.fill::<L, W>(lanes, kernel, line, first, block);
            for i in 0..block.len() {
                let left = 2 * terms.lefts[i] as usize;
                assert!(left + 2 * W <= row_length);
                let top = terms.tops[i] as isize - band.first_row as isize;
                let inside = top.max(0)..(top + W as isize).min(num_rows as isize);
                for row in inside {
                    let weight = terms.rows[i][(row - top) as usize];
                    let start = row as usize * row_length + left;
                    add::<L, W>(lanes, weight, &terms.columns[i], &mut band.cells[start..]);
                }
            }
        }
    }
}

/// Add `2 W` weighted terms to cells; padding terms are zero and change nothing.
#[inline(always)]
fn add<L: Lanes, const W: usize>(lanes: L, weight: f32, terms: &[f32; GROUP], cells: &mut [f32]) {
    let whole = (2 * W).next_multiple_of(L::COUNT);
    if cells.len() >= whole {
        let weight = lanes.splat(weight);
        for part in (0..whole).step_by(L::COUNT) {
            let sum = lanes.load(&cells[part..]);
            let sum = lanes.mul_add(weight, lanes.load(&terms[part..]), sum);
            lanes.store(sum, &mut cells[part..]);
        }
    } else {
        for (cell, term) in cells[..2 * W].iter_mut().zip(terms) {
            *cell = weight.mul_add(*term, *cell);
        }
    }
}

/// Range of `k` with `low <= start + k step <= high`, possibly a few more.
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

    /// Lines of 60 samples: oblique, backwards, along a row, along a column. None is exactly half a kernel from a cell, where
    /// the kernel is discontinuous.
    fn lines() -> Vec<Line> {
        let line = |start, step| Line { start, step };
        vec![
            line([1.2137, 4.3071], [0.51, 0.33]),
            line([35.6173, 24.7039], [-0.57, -0.34]),
            line([17.8171, 4.1039], [0.0, 0.35]),
            line([-2.0173, 13.3719], [0.61, 0.0]),
        ]
    }

    fn spread<const W: usize>(
        instructions: Instructions,
        rows_a_band: usize,
        samples: &[Vec<Complex32>],
    ) -> Vec<f32> {
        let kernel = KaiserBessel::new(W);
        let mut raster = vec![0.0; 2 * ROWS * COLUMNS];
        let bands = raster.chunks_mut(2 * rows_a_band * COLUMNS);
        for (band, cells) in bands.enumerate() {
            let mut band = Band {
                first_row: band * rows_a_band,
                columns: COLUMNS,
                cells,
            };
            for (line, samples) in lines().iter().zip(samples) {
                band.spread::<W>(instructions, &kernel, line, samples);
            }
        }
        raster
    }

    fn check<const W: usize>() {
        let mut numbers = Numbers::new(W as u64);
        let samples: Vec<Vec<Complex32>> = lines().iter().map(|_| numbers.samples(60)).collect();
        let raster = spread::<W>(Instructions::Portable, ROWS, &samples);
        for instructions in Instructions::available() {
            for rows_a_band in [1, 5, 36, ROWS] {
                let got = spread::<W>(instructions, rows_a_band, &samples);
                assert_eq!(got, raster, "{instructions:?} {rows_a_band}");
            }
        }
        let mut largest = 0.0f64;
        for (cell, got) in raster.as_chunks::<2>().0.iter().enumerate() {
            let got = Complex32::new(got[0], got[1]);
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
            // Weight error 1e-6 in rows and in columns. Rounding: a fraction, a product and a sum, about 40
            // per cell, each at most half a unit of the whole.
            let allowed = 1e-6 * reach + magnitude * 45.0 * 8.5e-8 + 1e-11;
            let error = (wide(got) - expected).norm();
            assert!(error < allowed, "{i} {j}: {error} {allowed}");
            largest = largest.max(expected.norm());
        }
        assert!(largest > 0.5);
    }

    #[test]
    fn gridding_agrees_with_defining_sum() {
        check::<4>();
        check::<6>();
    }

    #[test]
    fn within_covers_all_samples_of_rows() {
        assert_eq!(within(0.0, 1.0, 2.0, 5.0, 100), 2..6);
        assert_eq!(within(10.0, -2.0, 0.0, 4.0, 100), 3..6);
        assert_eq!(within(3.0, 0.0, 2.0, 5.0, 7), 0..7);
        assert_eq!(within(9.0, 0.0, 2.0, 5.0, 7), 0..0);
        assert!(within(50.0, 1.0, 2.0, 5.0, 7).is_empty());
        assert!(within(-50.0, 1.0, 2.0, 5.0, 7).is_empty());
    }
}
