//! Image chip around a point, as the trigonometric polynomial through its pixels.
//!
//! The image spectrum lies about the mean spatial frequency, `2 f / c` for a monostatic
//! radar, aliased to one cycle per pixel: it may lie anywhere on the circle of
//! frequencies and wrap around. Before interpolation it is shifted to zero by the
//! mean phase step, `arg sum I[i + 1] conj(I[i])`, a circular mean of the power spectrum.
//! Zero padding then interpolates. The polynomial is evaluated directly
//! at any position, or on a grid by the padded FFT; both agree.

use std::f64::consts::TAU;
use std::ops::Range;

use num_complex::Complex64;
use subaperture_fft::{FftDirection, Real, Transforms};

use super::super::transform::{signed, transform};
use super::super::widen;
use subaperture_model::image::Image;

/// Chip with an odd number of rows and columns.
#[derive(Clone, Debug)]
pub(super) struct Chip {
    pub(super) rows: usize,
    pub(super) columns: usize,
    /// Phase step per chip pixel along rows and columns, radians; within (-pi, pi] per image pixel.
    pub(super) turn: [f64; 2],
    /// Spectrum after removal of the phase step; pixel (0, 0) is the centre.
    spectrum: Vec<Complex64>,
}

impl Chip {
    /// Cut a chip of every `stride`-th pixel, `half` pixels to each side of `(row, column)`, all inside the image.
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
        // Phase step between adjacent image pixels, which is less ambiguous than between chip pixels.
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

    /// Value at `y` rows and `x` columns from the centre, without the mean phase step.
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

    /// Peak near the centre, which is the brightest pixel: parabolas through three values of
    /// `ln |I|^2`, along each axis alternately, with decreasing steps.
    pub(super) fn peak(&self) -> (f64, f64) {
        let vertex = |below: f64, here: f64, above: f64| {
            let (below, here, above) = (below.ln(), here.ln(), above.ln());
            let bend = below - 2.0 * here + above;
            let shift = 0.5 * (below - above) / bend;
            // Away from the peak the parabola is unreliable: a whole step uphill.
            match bend < 0.0 && shift.is_finite() {
                true => shift.clamp(-1.0, 1.0),
                false => (above - below).signum(),
            }
        };
        let (mut y, mut x) = (0.0, 0.0);
        for halvings in 1..=8 {
            let step = 0.5f64.powi(halvings);
            // A rotated main lobe needs alternating iterations.
            for _ in 0..3 {
                let here = self.power(y, x);
                y += step * vertex(self.power(y - step, x), here, self.power(y + step, x));
                let here = self.power(y, x);
                x += step * vertex(self.power(y, x - step), here, self.power(y, x + step));
            }
        }
        (y, x)
    }

    /// Interpolate `rows` of the chip on a grid `factor` times finer by zero padding, counted from its first pixel; each is passed with its index.
    /// Cost: one transform per row. Memory: one row.
    pub(super) fn fine_rows(
        &self,
        factor: usize,
        rows: Range<usize>,
        mut take: impl FnMut(usize, &[Complex64]),
    ) {
        let columns = self.columns * factor;
        let across = f64::plan(Transforms::Fastest, columns, FftDirection::Inverse);
        let mut scratch = vec![Complex64::ZERO; across.get_inplace_scratch_len()];
        // Phase shift from the centre to the first pixel.
        let turns: Vec<Complex64> = (0..self.columns)
            .map(|l| {
                let half = (self.columns / 2) as f64 / self.columns as f64;
                Complex64::cis(-TAU * signed(l, self.columns) * half)
            })
            .collect();
        let mut line = vec![Complex64::ZERO; columns];
        for i in rows {
            let y = i as f64 / factor as f64 - (self.rows / 2) as f64;
            line.fill(Complex64::ZERO);
            for (k, spectrum) in self.spectrum.chunks_exact(self.columns).enumerate() {
                let wave = Complex64::cis(TAU * signed(k, self.rows) * y / self.rows as f64);
                for (l, (s, turn)) in spectrum.iter().zip(&turns).enumerate() {
                    let at = signed(l, self.columns).rem_euclid(columns as f64) as usize;
                    line[at] += s * turn * wave;
                }
            }
            across.process_with_scratch(&mut line, &mut scratch);
            take(i, &line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;

    /// Band about a frequency above half a cycle per pixel, by its definition.
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
    fn direct_and_padded_interpolation_agree_with_band() {
        // The band's lines coincide with those of 21 pixels after the phase step, which is exact to
        // rounding because the band is symmetric about it: the polynomial is the band itself.
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
        // -0.3 and 0.47 cycles; truncation to the chip changes neither, because the band is periodic in it.
        assert!((chip.turn[0] / TAU - 0.47).abs() < 0.02, "{:?}", chip.turn);
        assert!((chip.turn[1] / TAU + 0.3).abs() < 0.02, "{:?}", chip.turn);
        let mut seen = 0;
        chip.fine_rows(4, 37..42, |i, row| {
            assert_eq!(row.len(), 84);
            for j in [38, 40, 55] {
                let direct = chip.at(i as f64 / 4.0 - 10.0, j as f64 / 4.0 - 10.0);
                let error = (row[j] - direct).norm();
                assert!(error < 1e-9, "{i} {j}: {error}");
                seen += 1;
            }
        });
        assert_eq!(seen, 15);
    }
}
