//! Images of independent cells: pixels at the spacing of independent samples, as interleaved images.

use std::ops::Range;

use num_complex::Complex32;

use crate::correlation::Spacing;

/// Rows of an interleaved image that are processed with one running sum.
const BAND_ROWS: usize = 64;

/// Division of an image into interleaved images.
pub(crate) struct Interleaved {
    size: [usize; 2],
    spacing: [usize; 2],
}

/// Image rows at the spacing of cells, whose rings are summed together.
pub(crate) struct Band {
    phase: usize,
    rows: Range<usize>,
}

/// Sums over the training rings of all pixels of an image row.
///
/// The outer product of a vector of `N` elements has `N^2` real elements: row by row of the lower triangle, real and imaginary part of each product
/// with an earlier element, then the power.
pub(crate) struct RingRow<'a> {
    /// Row of the image.
    pub(crate) row: usize,
    /// Outer product of each pixel, element by element.
    pub(crate) own: &'a [Vec<f32>],
    /// Sum over the ring of each pixel, element by element.
    pub(crate) sums: &'a [Vec<f64>],
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
        for phase in 0..self.spacing[0] {
            let [rows, _] = self.count([phase, 0]);
            for start in (0..rows).step_by(BAND_ROWS) {
                let rows = start..(start + BAND_ROWS).min(rows);
                bands.push(Band { phase, rows });
            }
        }
        bands
    }

    /// Number of cells within a reach of each row or column of pixels.
    pub(crate) fn cells_within(&self, axis: usize, reach: usize) -> Vec<usize> {
        let cells = |pixel: usize| {
            let (phase, own) = (pixel % self.spacing[axis], pixel / self.spacing[axis]);
            let count = (self.size[axis] - phase).div_ceil(self.spacing[axis]);
            (own + reach + 1).min(count) - own.saturating_sub(reach)
        };
        (0..self.size[axis]).map(cells).collect()
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

    /// Call `visit` for each row of a band with the sums over the training rings. `vectors` reads the vectors of an image row, element by element.
    ///
    /// Outer products are computed once for each row, in float32. Their sums are float64, so that a product that leaves a ring is subtracted exactly but for
    /// the rounding of the sum.
    pub(crate) fn for_each_row(
        &self,
        band: &Band,
        [inner, outer]: [usize; 2],
        degrees: usize,
        vectors: impl Fn(usize, &mut [Vec<Complex32>]),
        mut visit: impl FnMut(&RingRow),
    ) {
        let ([rows, _], columns) = (self.count([band.phase, 0]), self.size[1]);
        let elements = degrees * degrees;
        // Rows from the one that leaves the outer reach to the one that enters it.
        let kept = (2 * outer + 2).min(rows);
        let mut products = vec![vec![vec![0f32; columns]; elements]; kept];
        let mut line = vec![vec![Complex32::ZERO; columns]; degrees];
        let mut next = band.rows.start.saturating_sub(outer);
        // Sums over the rows within each reach.
        let mut strips = [inner, outer].map(|_| vec![vec![0f64; columns]; elements]);
        let mut sums = vec![vec![0f64; columns]; elements];
        for row in band.rows.clone() {
            while next < (row + outer + 1).min(rows) {
                vectors(band.phase + next * self.spacing[0], &mut line);
                outer_products(&line, &mut products[next % kept]);
                next += 1;
            }
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
                for (e, sum) in strip.iter_mut().enumerate() {
                    let products = |row: usize| &products[row % kept][e];
                    // Most rows: one enters and one leaves, in one pass over the sums.
                    if entering.len() == 1 && leaving.len() == 1 {
                        let pairs = products(entering.start).iter();
                        let pairs = pairs.zip(products(leaving.start));
                        let changes = sum.iter_mut().zip(pairs);
                        changes.for_each(|(sum, (&a, &b))| *sum += f64::from(a) - f64::from(b));
                        continue;
                    }
                    for row in entering.clone() {
                        let entering = sum.iter_mut().zip(products(row));
                        entering.for_each(|(sum, &value)| *sum += f64::from(value));
                    }
                    for row in leaving.clone() {
                        let leaving = sum.iter_mut().zip(products(row));
                        leaving.for_each(|(sum, &value)| *sum -= f64::from(value));
                    }
                }
            }
            for (e, sum) in sums.iter_mut().enumerate() {
                let [inner_strip, outer_strip] = [0, 1].map(|i| &strips[i][e][..]);
                self.across(outer_strip, outer, inner_strip, inner, sum);
            }
            visit(&RingRow {
                row: band.phase + row * self.spacing[0],
                own: &products[row % kept],
                sums: &sums,
            });
        }
    }

    /// Running sums over the columns: within the outer reach, less those within the inner one.
    fn across(
        &self,
        outer_strip: &[f64],
        outer: usize,
        inner_strip: &[f64],
        inner: usize,
        out: &mut [f64],
    ) {
        let (step, columns) = (self.spacing[1], out.len());
        let within = |strip: &[f64], column: usize, reach: usize| -> f64 {
            let ahead = strip.iter().skip(column).step_by(step);
            ahead.take(reach + 1).sum()
        };
        for (column, sum) in out.iter_mut().enumerate().take(step) {
            *sum = within(outer_strip, column, outer) - within(inner_strip, column, inner);
        }
        // Change from the column one cell before.
        let change = |column: usize| {
            let of = |strip: &[f64], reach: usize| {
                let entering = strip.get(column + reach * step).copied().unwrap_or(0.0);
                let leaving = column.checked_sub((reach + 1) * step);
                entering - leaving.map_or(0.0, |column| strip[column])
            };
            of(outer_strip, outer) - of(inner_strip, inner)
        };
        let first = ((outer + 1) * step).min(columns);
        let last = columns.saturating_sub(outer * step).max(first);
        for column in (step..first).chain(last..columns) {
            out[column] = change(column);
        }
        if first < last {
            let count = last - first;
            let [entering, leaving] = [first + outer * step, first - (outer + 1) * step];
            let [entering_in, leaving_in] = [first + inner * step, first - (inner + 1) * step];
            let outer_ends = outer_strip[entering..][..count]
                .iter()
                .zip(&outer_strip[leaving..][..count]);
            let inner_ends = inner_strip[entering_in..][..count]
                .iter()
                .zip(&inner_strip[leaving_in..][..count]);
            for (out, (outer, inner)) in out[first..last].iter_mut().zip(outer_ends.zip(inner_ends))
            {
                *out = (outer.0 - outer.1) - (inner.0 - inner.1);
            }
        }
        for column in step..columns {
            out[column] += out[column - step];
        }
    }
}

/// Outer products of the vectors of a row.
fn outer_products(line: &[Vec<Complex32>], out: &mut [Vec<f32>]) {
    let mut out = out.iter_mut();
    for (i, own) in line.iter().enumerate() {
        for other in &line[..i] {
            let [Some(re), Some(im)] = [out.next(), out.next()] else {
                return;
            };
            let parts = re.iter_mut().zip(im);
            for ((re, im), (a, b)) in parts.zip(own.iter().zip(other)) {
                *re = a.re * b.re + a.im * b.im;
                *im = a.im * b.re - a.re * b.im;
            }
        }
        let Some(power) = out.next() else { return };
        for (power, a) in power.iter_mut().zip(own) {
            *power = a.re * a.re + a.im * a.im;
        }
    }
}
