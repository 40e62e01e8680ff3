//! Images of independent cells: pixels at the spacing of independent samples, as interleaved images.

use num_complex::{Complex32, Complex64};
use subaperture_model::image::Image;

use crate::adaptive::{Covariance, widen};

/// Rows of an interleaved image that are processed with one running sum.
const BAND_ROWS: usize = 32;

/// Largest spacing that is searched, pixels.
const MAX_SPACING: usize = 32;

/// Edge of the blocks whose correlation is averaged, pixels.
const BLOCK: usize = 64;

/// Spacing of independent cells in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Spacing {
    /// Along rows of the grid.
    pub rows: usize,
    /// Along columns of the grid.
    pub columns: usize,
}

impl Spacing {
    /// Measure the correlation length `sum |r(lag)|^2` of the pixels of an image along both axes, rounded up; `r` is the autocorrelation, averaged over
    /// blocks of equal weight.
    pub fn measure(image: &Image) -> Self {
        let along = |rows: bool| {
            let (count, others) = match rows {
                true => (image.rows, image.columns),
                false => (image.columns, image.rows),
            };
            let most = MAX_SPACING.min(count.saturating_sub(1));
            let mut sums = vec![Complex64::ZERO; most + 1];
            for start in (0..count).step_by(BLOCK) {
                let end = (start + BLOCK).min(count);
                for line in (0..others).step_by(BLOCK) {
                    let lines = line..(line + BLOCK).min(others);
                    let mut block = vec![Complex64::ZERO; most + 1];
                    for other in lines {
                        let at = |i: usize| {
                            let index = match rows {
                                true => i * image.columns + other,
                                false => other * image.columns + i,
                            };
                            widen(image.pixels[index])
                        };
                        for i in start..end {
                            let own = at(i).conj();
                            let last = (i + most).min(end - 1);
                            for j in i..=last {
                                block[j - i] += at(j) * own;
                            }
                        }
                    }
                    if block[0].re > 0.0 && block[0].re.is_finite() {
                        let length = end - start;
                        for (lag, (sum, value)) in sums.iter_mut().zip(&block).enumerate() {
                            let pairs = length.saturating_sub(lag).max(1);
                            *sum += value / block[0].re * (length as f64 / pairs as f64);
                        }
                    }
                }
            }
            let squares = sums[1..]
                .iter()
                .map(|r| (r / sums[0].re.max(1e-300)).norm_sqr());
            // Noise of the estimate is left out.
            let squares = squares.take_while(|&square| square > 0.01);
            let cells = 1.0 + 2.0 * squares.sum::<f64>();
            (cells.ceil() as usize).clamp(1, MAX_SPACING)
        };
        Self {
            rows: along(true),
            columns: along(false),
        }
    }
}

/// Division of an image into interleaved images.
pub(crate) struct Interleaved {
    size: [usize; 2],
    spacing: [usize; 2],
}

/// Rows of one interleaved image.
pub(crate) struct Band {
    phase: [usize; 2],
    rows: std::ops::Range<usize>,
}

impl Interleaved {
    pub(crate) fn new(size: [usize; 2], spacing: Spacing) -> Self {
        Self {
            size,
            spacing: [spacing.rows, spacing.columns],
        }
    }

    /// Number of rows and columns of the interleaved image with this phase.
    fn count(&self, phase: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|i| {
            self.size[i]
                .saturating_sub(phase[i])
                .div_ceil(self.spacing[i])
        })
    }

    /// Bands of all interleaved images; they do not depend on the number of threads.
    pub(crate) fn bands(&self) -> Vec<Band> {
        let mut bands = Vec::new();
        for row in 0..self.spacing[0] {
            for column in 0..self.spacing[1] {
                let phase = [row, column];
                let rows = self.count(phase)[0];
                for start in (0..rows).step_by(BAND_ROWS) {
                    let rows = start..(start + BAND_ROWS).min(rows);
                    bands.push(Band { phase, rows });
                }
            }
        }
        bands
    }

    fn pixel(&self, phase: [usize; 2], row: usize, column: usize) -> usize {
        (phase[0] + row * self.spacing[0]) * self.size[1] + phase[1] + column * self.spacing[1]
    }

    /// Pixels of the training ring of a pixel: cells farther than `inner` and at most `outer` along either axis.
    pub(crate) fn ring(
        &self,
        pixel: usize,
        [inner, outer]: [usize; 2],
    ) -> impl Iterator<Item = usize> + '_ {
        let place = [pixel / self.size[1], pixel % self.size[1]];
        let phase = [0, 1].map(|i| place[i] % self.spacing[i]);
        let own = [0, 1].map(|i| place[i] / self.spacing[i]);
        let [rows, columns] = self.count(phase);
        let span =
            move |own: usize, count: usize| own.saturating_sub(outer)..(own + outer + 1).min(count);
        span(own[0], rows).flat_map(move |row| {
            span(own[1], columns)
                .filter(move |&column| {
                    row.abs_diff(own[0]) > inner || column.abs_diff(own[1]) > inner
                })
                .map(move |column| self.pixel(phase, row, column))
        })
    }

    /// Call `visit` for each pixel of a band with the sum over its training ring. `vector` reads the vector of a pixel.
    pub(crate) fn for_each_ring(
        &self,
        band: &Band,
        [inner, outer]: [usize; 2],
        degrees: usize,
        vector: impl Fn(usize, &mut [Complex32]),
        mut visit: impl FnMut(usize, &Covariance),
    ) {
        let [rows, columns] = self.count(band.phase);
        let empty = Covariance::new(degrees);
        // Sums over rows within each reach, for each column.
        let mut strips = [inner, outer].map(|_| vec![empty.clone(); columns]);
        let mut cell = vec![Complex32::ZERO; degrees];
        for row in band.rows.clone() {
            for (strip, reach) in strips.iter_mut().zip([inner, outer]) {
                let first = row == band.rows.start;
                let entering = match first {
                    true => row.saturating_sub(reach)..(row + reach + 1).min(rows),
                    false => (row + reach).min(rows)..(row + reach + 1).min(rows),
                };
                let leaving = match row.checked_sub(reach + 1) {
                    Some(last) if !first => last..last + 1,
                    _ => 0..0,
                };
                for (column, sum) in strip.iter_mut().enumerate() {
                    for row in entering.clone() {
                        vector(self.pixel(band.phase, row, column), &mut cell);
                        sum.add(&cell);
                    }
                    for row in leaving.clone() {
                        vector(self.pixel(band.phase, row, column), &mut cell);
                        sum.subtract(&cell);
                    }
                }
            }
            let mut windows = [empty.clone(), empty.clone()];
            for ((window, strip), reach) in windows.iter_mut().zip(&strips).zip([inner, outer]) {
                strip.iter().take(reach).for_each(|sum| window.add_sum(sum));
            }
            let mut ring = empty.clone();
            for column in 0..columns {
                for ((window, strip), reach) in windows.iter_mut().zip(&strips).zip([inner, outer])
                {
                    if let Some(sum) = strip.get(column + reach) {
                        window.add_sum(sum);
                    }
                    if let Some(last) = column.checked_sub(reach + 1) {
                        window.subtract_sum(&strip[last]);
                    }
                }
                ring.clone_from(&windows[1]);
                ring.subtract_sum(&windows[0]);
                visit(self.pixel(band.phase, row, column), &ring);
            }
        }
    }
}
