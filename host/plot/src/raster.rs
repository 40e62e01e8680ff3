//! Area-weighted resampling of rasters.

/// Resample `rows` x `columns` pixels to `height` x `width` cells that
/// cover them evenly, row 0 first: area-weighted mean of the finite values under each cell; NaN
/// without any. `value` converts the first pixels of a `line`.
pub(super) fn resample<'l, T: 'l>(
    (rows, columns): (usize, usize),
    line: impl Fn(usize) -> &'l [T],
    value: impl Fn(&T) -> f64,
    height: usize,
    width: usize,
) -> Vec<f64> {
    if (height, width) == (rows, columns) {
        let finite = |value: f64| if value.is_finite() { value } else { f64::NAN };
        let mut cells = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            cells.extend(line(row)[..columns].iter().map(|x| finite(value(x))));
        }
        return cells;
    }
    let across = spans(columns, width);
    let mut cells = vec![0.0; height * width];
    let mut weights = vec![0.0; width];
    for (span, out) in spans(rows, height)
        .iter()
        .zip(cells.chunks_exact_mut(width))
    {
        weights.fill(0.0);
        for (row, down) in span.cells() {
            let line = line(row);
            for ((cell, weight), span) in out.iter_mut().zip(&mut weights).zip(&across) {
                for (column, along) in span.cells() {
                    let value = value(&line[column]);
                    if value.is_finite() {
                        *cell += down * along * value;
                        *weight += down * along;
                    }
                }
            }
        }
        // 0 / 0 is NaN: no finite value.
        out.iter_mut().zip(&weights).for_each(|(c, w)| *c /= w);
    }
    cells
}

/// As [`resample`], for blocks of a row in any order. Memory: the cells and the longest block, not the image.
#[derive(Debug)]
pub(super) struct Reduced {
    size: (usize, usize),
    height: usize,
    width: usize,
    cells: Vec<f64>,
    weights: Vec<f64>,
    /// First column of the last block, and the cells of its pixels.
    across: (usize, Vec<Span>),
}

impl Reduced {
    pub(super) fn new(size: (usize, usize), height: usize, width: usize) -> Self {
        Self {
            size,
            height,
            width,
            cells: vec![0.0; height * width],
            weights: vec![0.0; height * width],
            across: (0, Vec::new()),
        }
    }

    /// Add pixels from a row and column on.
    pub(super) fn add(
        &mut self,
        row: usize,
        column: usize,
        values: impl ExactSizeIterator<Item = f64>,
    ) {
        let (rows, columns) = self.size;
        let count = values.len().min(columns.saturating_sub(column));
        // Blocks of adjacent rows mostly have the same columns.
        if (self.across.0, self.across.1.len()) != (column, count) {
            let spans = (column..column + count).map(|i| Span::of(i, self.width, columns));
            self.across = (column, spans.collect());
        }
        let down = Span::of(row, self.height, rows);
        for (value, across) in values.zip(&self.across.1) {
            if !value.is_finite() {
                continue;
            }
            for (cell_row, down) in down.cells() {
                for (cell_column, along) in across.cells() {
                    let cell = cell_row * self.width + cell_column;
                    self.cells[cell] += down * along * value;
                    self.weights[cell] += down * along;
                }
            }
        }
    }

    /// Values of the cells.
    pub(super) fn finish(mut self) -> Vec<f64> {
        let cells = self.cells.iter_mut().zip(&self.weights);
        // 0 / 0 is NaN: no finite value.
        cells.for_each(|(cell, weight)| *cell /= weight);
        self.cells
    }
}

/// Range of source pixels, the first and last fractional.
#[derive(Debug)]
struct Span {
    first: usize,
    last: usize,
    /// Fractions of the first and last pixel; of the only pixel if they are the same.
    ends: (f64, f64),
}

impl Span {
    fn cells(&self) -> impl Iterator<Item = (usize, f64)> {
        (self.first..=self.last).map(|i| {
            let weight = match i {
                _ if i == self.first => self.ends.0,
                _ if i == self.last => self.ends.1,
                _ => 1.0,
            };
            (i, weight)
        })
    }
}

impl Span {
    /// Cell `i` of `cells` that divide `count` pixels evenly, from `i count / cells` to `(i + 1) count / cells` in integer arithmetic, so that edges
    /// fall exactly on pixels.
    fn of(i: usize, count: usize, cells: usize) -> Self {
        let part = |numerator: usize| numerator as f64 / cells as f64;
        let (begin, end) = (i * count, (i + 1) * count);
        let (first, last) = (begin / cells, (end - 1) / cells);
        let ends = if first == last {
            (part(end - begin), 0.0)
        } else {
            (part((first + 1) * cells - begin), part(end - last * cells))
        };
        Self { first, last, ends }
    }
}

/// All cells that divide `count` pixels evenly.
fn spans(count: usize, cells: usize) -> Vec<Span> {
    (0..cells).map(|i| Span::of(i, count, cells)).collect()
}

#[cfg(test)]
mod tests {
    use super::{Reduced, resample};

    #[test]
    fn resampling_averages_by_area() {
        // Three pixels 1, 4, 9 on two cells of one and a half pixels.
        let cells = resample((1, 3), |_| &[1.0, 4.0, 9.0], |&x| x, 1, 2);
        assert!((cells[0] - (1.0 + 2.0) / 1.5).abs() < 1e-12);
        assert!((cells[1] - (2.0 + 9.0) / 1.5).abs() < 1e-12);
        // 2 x 2 pixels on one cell.
        let cells = resample((2, 2), |j| &[[1.0, 4.0], [9.0, 16.0]][j], |&x| x, 1, 1);
        assert!((cells[0] - 30.0 / 4.0).abs() < 1e-12);
    }

    #[test]
    fn block_order_does_not_change_cells() {
        let value = |i: usize| match i {
            17 => f64::NAN,
            _ => (i * 7919 % 101) as f64,
        };
        let values: Vec<f64> = (0..63).map(value).collect();
        for (height, width) in [(3, 4), (7, 9), (20, 31), (1, 1), (5, 2)] {
            let whole = resample((7, 9), |row| &values[row * 9..], |&x| x, height, width);
            let mut reduced = Reduced::new((7, 9), height, width);
            for (columns, rows) in [(5..9, 3..7), (0..5, 0..7), (5..9, 0..3)] {
                for row in rows {
                    let values = columns.clone().map(|column| value(row * 9 + column));
                    reduced.add(row, columns.start, values);
                }
            }
            for (a, b) in whole.iter().zip(reduced.finish()) {
                assert!((a - b).abs() < 1e-9 || a.is_nan() && b.is_nan(), "{a} {b}");
            }
        }
    }

    #[test]
    fn enlargement_repeats_pixels() {
        let cells = resample((2, 2), |j| &[[1.0, 4.0], [9.0, 16.0]][j], |&x| x, 4, 6);
        let expected = [[1.0, 4.0], [1.0, 4.0], [9.0, 16.0], [9.0, 16.0]];
        for (row, expected) in cells.chunks(6).zip(expected) {
            for (i, cell) in row.iter().enumerate() {
                assert!((cell - expected[i / 3]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn non_finite_pixels_are_excluded_from_mean() {
        let values = [1.0, f64::NAN, f64::INFINITY, f64::NAN];
        let cells = resample((1, 4), |_| &values, |&x| x, 1, 2);
        assert!((cells[0] - 1.0).abs() < 1e-12);
        assert!(cells[1].is_nan());
    }
}
