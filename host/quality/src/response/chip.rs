//! A piece of an image around a point, as the trigonometric polynomial through its pixels.
//!
//! An image's phase turns from pixel to pixel by its mean spatial frequency, `2 f / c` for a monostatic
//! radar, which a grid takes modulo one cycle a pixel: the band may lie anywhere on the circle of
//! frequencies, across its cut too. Before it is interpolated, it is turned to lie about zero by the
//! mean turn from pixel to pixel, `arg sum I[i + 1] conj(I[i])`, a circular mean of the spectrum's power.
//! Zero padding then adds frequencies where there is nothing. The polynomial is evaluated directly
//! anywhere, or on a grid by the padded transform; both give the same.

use std::f64::consts::TAU;

use num_complex::Complex64;
use subaperture_fft::FftDirection;

use super::super::transform::{signed, transform};
use super::super::widen;
use subaperture_model::image::Image;

/// An odd number of rows and columns around a pixel.
pub(super) struct Chip {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Turn of the phase a chip's pixel, down and across, radians: in (-pi, pi] for each of the image's.
    pub(super) turn: [f64; 2],
    /// Spectrum with the turn taken out; pixel (0, 0) is the middle.
    spectrum: Vec<Complex64>,
}

impl Chip {
    /// Every `stride`-th pixel, `half` of them to each side of `(row, column)`, all within the image.
    pub(super) fn cut(
        image: &Image,
        (row, column): (usize, usize),
        half: [usize; 2],
        stride: [usize; 2],
    ) -> Self {
        let (rows, columns) = (2 * half[0] + 1, 2 * half[1] + 1);
        let pixel = |i: usize, j: usize| widen(image.pixels[i * image.columns + j]);
        let place = |i: usize, j: usize| {
            [
                row + i * stride[0] - half[0] * stride[0],
                column + j * stride[1] - half[1] * stride[1],
            ]
        };
        // From one pixel of the image to the next, which tells more whole turns than the chip's own pixels do.
        let mut steps = [Complex64::ZERO; 2];
        for i in 0..rows {
            for j in 0..columns {
                let [y, x] = place(i, j);
                if i > 0 {
                    steps[0] += pixel(y, x) * pixel(y - 1, x).conj();
                }
                if j > 0 {
                    steps[1] += pixel(y, x) * pixel(y, x - 1).conj();
                }
            }
        }
        let turn = [0, 1].map(|i| steps[i].arg() * stride[i] as f64);
        let at = |i: usize, j: usize| {
            let [y, x] = place(i, j);
            pixel(y, x)
        };
        let mut spectrum = vec![Complex64::ZERO; rows * columns];
        for i in 0..rows {
            for j in 0..columns {
                let (y, x) = (i as f64 - half[0] as f64, j as f64 - half[1] as f64);
                let (k, l) = (
                    (i + rows - half[0]) % rows,
                    (j + columns - half[1]) % columns,
                );
                spectrum[k * columns + l] = at(i, j) * Complex64::cis(-(turn[0] * y + turn[1] * x));
            }
        }
        transform(&mut spectrum, rows, columns, FftDirection::Forward);
        let scale = 1.0 / (rows * columns) as f64;
        spectrum.iter_mut().for_each(|z| *z *= scale);
        Self {
            rows,
            columns,
            turn,
            spectrum,
        }
    }

    /// The value `y` rows below and `x` columns right of the middle, without the mean turn.
    pub(super) fn at(&self, y: f64, x: f64) -> Complex64 {
        let waves = |n: usize, v: f64| -> Vec<Complex64> {
            let wave = |k| Complex64::cis(TAU * signed(k, n) * v / n as f64);
            (0..n).map(wave).collect()
        };
        let (down, across) = (waves(self.rows, y), waves(self.columns, x));
        self.spectrum
            .chunks_exact(self.columns)
            .zip(down)
            .map(|(row, wave)| {
                let sum: Complex64 = row.iter().zip(&across).map(|(s, w)| s * w).sum();
                sum * wave
            })
            .sum()
    }

    /// Power at `(y, x)`.
    pub(super) fn power(&self, y: f64, x: f64) -> f64 {
        self.at(y, x).norm_sqr()
    }

    /// The peak next to the middle, which is the brightest pixel: parabolas through three values of
    /// `ln |I|^2`, along each axis in turn, on ever smaller steps.
    pub(super) fn peak(&self) -> (f64, f64) {
        let vertex = |below: f64, here: f64, above: f64| {
            let (below, here, above) = (below.ln(), here.ln(), above.ln());
            let bend = below - 2.0 * here + above;
            let shift = 0.5 * (below - above) / bend;
            // Off the top there is no parabola to trust: a whole step uphill.
            match bend < 0.0 && shift.is_finite() {
                true => shift.clamp(-1.0, 1.0),
                false => (above - below).signum(),
            }
        };
        let (mut y, mut x) = (0.0, 0.0);
        for halvings in 1..=8 {
            let step = 0.5f64.powi(halvings);
            // The lobe may be slanted: each axis again after the other.
            for _ in 0..3 {
                let here = self.power(y, x);
                y += step * vertex(self.power(y - step, x), here, self.power(y + step, x));
                let here = self.power(y, x);
                x += step * vertex(self.power(y, x - step), here, self.power(y, x + step));
            }
        }
        (y, x)
    }

    /// The whole chip on a grid `factor` times finer, its first pixel first, by zero padding.
    pub(super) fn upsampled(&self, factor: usize) -> Vec<Complex64> {
        let (rows, columns) = (self.rows * factor, self.columns * factor);
        let mut fine = vec![Complex64::ZERO; rows * columns];
        // Turned from the middle to the first pixel.
        let (y, x) = ((self.rows / 2) as f64, (self.columns / 2) as f64);
        for k in 0..self.rows {
            let down = signed(k, self.rows);
            for l in 0..self.columns {
                let across = signed(l, self.columns);
                let turn = -TAU * (down * y / self.rows as f64 + across * x / self.columns as f64);
                let at = |f: f64, n: usize| f.rem_euclid(n as f64) as usize;
                fine[at(down, rows) * columns + at(across, columns)] =
                    self.spectrum[k * self.columns + l] * Complex64::cis(turn);
            }
        }
        transform(&mut fine, rows, columns, FftDirection::Inverse);
        fine
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;

    /// A band around a frequency beyond half a cycle a pixel, by its definition.
    fn value(y: f64, x: f64) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for k in -4..=4 {
            for l in -3..=3 {
                let (k, l) = (f64::from(k), f64::from(l));
                sum += Complex64::cis(TAU * ((k / 21.0 + 0.47) * y + (l / 21.0 - 0.3) * x));
            }
        }
        sum
    }

    #[test]
    fn both_ways_give_the_polynomial_through_the_pixels() {
        // The band's lines lie on those of 21 pixels, but for the turn, which is estimated to
        // rounding as the band is even about it: the polynomial is the band itself.
        let image = Image {
            rows: 21,
            columns: 21,
            pixels: (0..441)
                .map(|i| {
                    let z = value((i / 21) as f64 - 10.3, (i % 21) as f64 - 9.8);
                    Complex32::new(z.re as f32, z.im as f32)
                })
                .collect(),
        };
        let chip = Chip::cut(&image, (10, 10), [10, 10], [1, 1]);
        // -0.3 and 0.47 cycles; truncation to the chip moves neither, as the band is periodic in it.
        assert!((chip.turn[0] / TAU - 0.47).abs() < 0.02, "{:?}", chip.turn);
        assert!((chip.turn[1] / TAU + 0.3).abs() < 0.02, "{:?}", chip.turn);
        let fine = chip.upsampled(4);
        for (i, j) in [(40, 40), (41, 38), (37, 55)] {
            let direct = chip.at(i as f64 / 4.0 - 10.0, j as f64 / 4.0 - 10.0);
            let error = (fine[i * 84 + j] - direct).norm();
            assert!(error < 1e-9, "{i} {j}: {error}");
        }
    }
}
