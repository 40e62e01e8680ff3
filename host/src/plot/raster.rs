//! An image's power on a raster of another size.

use crate::image::{Image, power};

/// Power of `image` on `height x width` cells that cover it evenly, row 0 first: the area-weighted mean
/// of the pixels under each cell. Pixels that are not finite do not count; a cell of none else is NaN.
pub(super) fn resample(image: &Image, height: usize, width: usize) -> Vec<f64> {
    let across = spans(image.columns, width);
    let mut cells = vec![0.0; height * width];
    let mut weights = vec![0.0; width];
    for (span, out) in spans(image.rows, height)
        .iter()
        .zip(cells.chunks_exact_mut(width))
    {
        weights.fill(0.0);
        for (row, down) in span.cells() {
            let pixels = &image.pixels[row * image.columns..(row + 1) * image.columns];
            for ((cell, weight), span) in out.iter_mut().zip(&mut weights).zip(&across) {
                for (column, along) in span.cells() {
                    let value = power(pixels[column]);
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
    use num_complex::Complex32;

    use super::resample;
    use crate::image::Image;

    fn image(rows: usize, columns: usize, amplitudes: &[f32]) -> Image {
        Image {
            rows,
            columns,
            pixels: amplitudes.iter().map(|&a| Complex32::new(0.0, a)).collect(),
        }
    }

    #[test]
    fn power_is_averaged_by_area() {
        // Three pixels of power 1, 4, 9 on two cells of one and a half each.
        let cells = resample(&image(1, 3, &[1.0, 2.0, 3.0]), 1, 2);
        assert!((cells[0] - (1.0 + 2.0) / 1.5).abs() < 1e-12);
        assert!((cells[1] - (2.0 + 9.0) / 1.5).abs() < 1e-12);
        // Two by two on one.
        let cells = resample(&image(2, 2, &[1.0, 2.0, 3.0, 4.0]), 1, 1);
        assert!((cells[0] - 30.0 / 4.0).abs() < 1e-12);
    }

    #[test]
    fn pixels_are_repeated() {
        let cells = resample(&image(2, 2, &[1.0, 2.0, 3.0, 4.0]), 4, 6);
        let expected = [[1.0, 4.0], [1.0, 4.0], [9.0, 16.0], [9.0, 16.0]];
        for (row, expected) in cells.chunks(6).zip(expected) {
            for (i, cell) in row.iter().enumerate() {
                assert!((cell - expected[i / 3]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn what_is_not_finite_does_not_count() {
        let cells = resample(
            &image(1, 4, &[1.0, f32::NAN, f32::INFINITY, f32::NAN]),
            1,
            2,
        );
        assert!((cells[0] - 1.0).abs() < 1e-12);
        assert!(cells[1].is_nan());
    }
}
