//! Values on a raster of another size.

/// Values of `rows x columns` pixels, `value` of each of the first of a `line`, on `height x width` cells that
/// cover them evenly, row 0 first: the area-weighted mean of the pixels under each cell. Values that
/// are not finite do not count; a cell of none else is NaN.
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
        // 0 / 0 is the NaN promised.
        out.iter_mut().zip(&weights).for_each(|(c, w)| *c /= w);
    }
    cells
}

/// The same of values that come in any order, a run of a row at a time.
pub(super) struct Reduced {
    across: Vec<Span>,
    down: Vec<Span>,
    width: usize,
    cells: Vec<f64>,
    weights: Vec<f64>,
}

impl Reduced {
    pub(super) fn new(size: (usize, usize), height: usize, width: usize) -> Self {
        Self {
            // The cells that a pixel lies on.
            across: spans(width, size.1),
            down: spans(height, size.0),
            width,
            cells: vec![0.0; height * width],
            weights: vec![0.0; height * width],
        }
    }

    /// Adds pixels from a row and column on.
    pub(super) fn add(&mut self, row: usize, column: usize, values: impl Iterator<Item = f64>) {
        for (value, across) in values.zip(&self.across[column..]) {
            if !value.is_finite() {
                continue;
            }
            for (cell_row, down) in self.down[row].cells() {
                for (cell_column, along) in across.cells() {
                    let cell = cell_row * self.width + cell_column;
                    self.cells[cell] += down * along * value;
                    self.weights[cell] += down * along;
                }
            }
        }
    }

    /// The cells.
    pub(super) fn finish(mut self) -> Vec<f64> {
        let cells = self.cells.iter_mut().zip(&self.weights);
        // 0 / 0 is the NaN promised.
        cells.for_each(|(cell, weight)| *cell /= weight);
        self.cells
    }
}

/// A run of source pixels, the first and last in part.
struct Span {
    first: usize,
    last: usize,
    /// Parts of the first and last pixel; of the one there is, if they are the same.
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

/// Splits `count` pixels evenly over `cells`. In whole numbers: cell `i` runs from `i count / cells`
/// to `(i + 1) count / cells`, so edges fall on pixels where they should.
fn spans(count: usize, cells: usize) -> Vec<Span> {
    let part = |numerator: usize| numerator as f64 / cells as f64;
    (0..cells)
        .map(|i| {
            let (begin, end) = (i * count, (i + 1) * count);
            let (first, last) = (begin / cells, (end - 1) / cells);
            let ends = if first == last {
                (part(end - begin), 0.0)
            } else {
                (part((first + 1) * cells - begin), part(end - last * cells))
            };
            Span { first, last, ends }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{Reduced, resample};

    #[test]
    fn values_are_averaged_by_area() {
        // Three pixels of 1, 4, 9 on two cells of one and a half each.
        let cells = resample((1, 3), |_| &[1.0, 4.0, 9.0], |&x| x, 1, 2);
        assert!((cells[0] - (1.0 + 2.0) / 1.5).abs() < 1e-12);
        assert!((cells[1] - (2.0 + 9.0) / 1.5).abs() < 1e-12);
        // Two by two on one.
        let cells = resample((2, 2), |j| &[[1.0, 4.0], [9.0, 16.0]][j], |&x| x, 1, 1);
        assert!((cells[0] - 30.0 / 4.0).abs() < 1e-12);
    }

    #[test]
    fn pieces_in_any_order_are_the_same() {
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
    fn pixels_are_repeated() {
        let cells = resample((2, 2), |j| &[[1.0, 4.0], [9.0, 16.0]][j], |&x| x, 4, 6);
        let expected = [[1.0, 4.0], [1.0, 4.0], [9.0, 16.0], [9.0, 16.0]];
        for (row, expected) in cells.chunks(6).zip(expected) {
            for (i, cell) in row.iter().enumerate() {
                assert!((cell - expected[i / 3]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn what_is_not_finite_does_not_count() {
        let values = [1.0, f64::NAN, f64::INFINITY, f64::NAN];
        let cells = resample((1, 4), |_| &values, |&x| x, 1, 2);
        assert!((cells[0] - 1.0).abs() < 1e-12);
        assert!(cells[1].is_nan());
    }
}
