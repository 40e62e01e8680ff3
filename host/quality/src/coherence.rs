//! Local coherence of two images.
//!
//! ```text
//! gamma = | sum a conj(b) | / sqrt( sum |a|^2  sum |b|^2 )
//! ```
//!
//! over a window of `n` by `n` pixels, truncated at the border ([`window_sums`] takes any odd numbers of rows and columns). It is 1 where the images differ by a
//! constant factor. For independent images it is biased: `n^2` independent pixels give
//! `sqrt(pi / 4) / n` on average (Touzi et al. 1999), and oversampled pixels, being fewer
//! independent samples, give more. A linear phase between the images lowers it.
//!
//! **Cost** running sums along columns and rows in float64: four additions and four subtractions
//! per pixel for each of four sums, independent of `n`. **Accuracy** their rounding, up to 1e-16 of the power in the
//! strip, can spoil windows 150 dB below it; those are NaN. So are windows with a pixel that is
//! not finite, or without power. **Memory** 32 bytes per column, and the result.

use num_complex::Complex64;

use super::{PairError, PixelMap, check_sizes, widen};
use subaperture_model::image::Image;

/// Smallest power of a window relative to the largest that its running sums have held.
const MIN_PART: f64 = 1e-15;

/// Sums over a window of two images, from which the sample coherence follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairSums {
    /// Sum of `a conj(b)`.
    pub cross: Complex64,
    /// Sum of `|a|^2` over the window.
    pub a: f64,
    /// Sum of `|b|^2` over the window.
    pub b: f64,
}

impl PairSums {
    /// Complex sample coherence: magnitude 0 to 1, phase of `a conj(b)`.
    pub fn coherence(&self) -> Complex64 {
        let coherence = self.cross / (self.a * self.b).sqrt();
        coherence / coherence.norm().max(1.0)
    }
}

/// Running sums over a block of pixels.
#[derive(Clone, Copy, Default)]
struct Sums {
    cross: Complex64,
    a: f64,
    b: f64,
    /// Number of non-finite pixels, which are summed as zero.
    bad: i64,
}

impl Sums {
    fn add(&mut self, other: &Self, sign: i8) {
        let factor = f64::from(sign);
        self.cross += other.cross * factor;
        self.a += other.a * factor;
        self.b += other.b * factor;
        self.bad += other.bad * i64::from(sign);
    }

    fn of(image: &Image, other: &Image, at: usize) -> Self {
        let (u, v) = (widen(image.pixels[at]), widen(other.pixels[at]));
        if !(u.is_finite() && v.is_finite()) {
            return Self {
                bad: 1,
                ..Self::default()
            };
        }
        Self {
            cross: u * v.conj(),
            a: u.norm_sqr(),
            b: v.norm_sqr(),
            bad: 0,
        }
    }
}

/// Coherence of `a` and `b` in windows of `n` by `n` pixels, 0 to 1; `n` is odd and at least 3.
///
/// # Errors
/// [`PairError`] if the sizes differ or `n` is not valid.
pub fn coherence(a: &Image, b: &Image, n: usize) -> Result<PixelMap, PairError> {
    if n.is_multiple_of(2) || n < 3 {
        return Err(PairError::Unsuited(format!(
            "coherence window: expected an odd number of pixels from 3, found {n}"
        )));
    }
    let mut values = Vec::with_capacity(a.pixels.len());
    window_sums(a, b, [n, n], |sums| {
        values.push(sums.map_or(f32::NAN, |sums| sums.coherence().norm() as f32));
    })?;
    Ok(PixelMap {
        rows: a.rows,
        columns: a.columns,
        values,
    })
}

/// Pass the sums over the window about each pixel to `each`, row by row; the window has `n` rows and columns, both odd.
///
/// Windows are truncated at the border. `None` where the coherence is undefined (see the module).
///
/// # Errors
/// [`PairError`] if the sizes differ or `n` is not valid.
pub fn window_sums(
    a: &Image,
    b: &Image,
    n: [usize; 2],
    mut each: impl FnMut(Option<PairSums>),
) -> Result<(), PairError> {
    check_sizes(a, b)?;
    if n.iter().any(|n| n.is_multiple_of(2)) {
        return Err(PairError::Unsuited(format!(
            "window: expected an odd number of rows and of columns, found {} x {}",
            n[0], n[1]
        )));
    }
    let (rows, columns) = (a.rows, a.columns);
    let [half, half_across] = n.map(|n| n / 2);
    let mut strip = vec![Sums::default(); columns];
    let mut most = (0f64, 0f64);
    for row in 0..rows {
        let mut change = |from: usize, sign: i8| {
            for (column, sums) in strip.iter_mut().enumerate() {
                sums.add(&Sums::of(a, b, from * columns + column), sign);
            }
        };
        match row {
            0 => (0..=half.min(rows - 1)).for_each(|from| change(from, 1)),
            _ if half < rows - row => change(row + half, 1),
            _ => {}
        }
        if row > half {
            change(row - half - 1, -1);
        }
        let mut window = Sums::default();
        strip[..half_across.min(columns)]
            .iter()
            .for_each(|sums| window.add(sums, 1));
        for column in 0..columns {
            if half_across < columns - column {
                window.add(&strip[column + half_across], 1);
            }
            if column > half_across {
                window.add(&strip[column - half_across - 1], -1);
            }
            most = (most.0.max(window.a), most.1.max(window.b));
            let sound =
                window.bad == 0 && window.a > MIN_PART * most.0 && window.b > MIN_PART * most.1;
            each(sound.then_some(PairSums {
                cross: window.cross,
                a: window.a,
                b: window.b,
            }));
        }
    }
    Ok(())
}
