//! Range profile of a pulse as piecewise polynomials, one piece per bin.
//!
//! ```text
//! value(t) = sum_i c[i] B(t - i),          B the cardinal B-spline of degree d, c of period L
//!          = sum_k P_k[n] f^k,              t = n + f (+ 1/2 where d is odd), |f| <= 1/2
//! Q_k[n]   = weight P_k[n]
//! ```
//!
//! Pieces extend from `-L/2 - margin` to `L/2 + margin`, so that a tile whose centre lies within the period is read without wrapping: values continue periodically
//! past its ends. For a part of the range, only its pieces are computed ([`Pieces::over`], [`Pieces::around`]).
//!
//! **Layout** float32 planes: real parts of `Q_0`, imaginary parts of `Q_0`, real parts of `Q_1`, and so on.

use std::ops::Range;

use num_complex::Complex32;

use super::expansion::Raster;
use crate::lanes::{Instructions, Kernel, Lanes};

/// Largest spline degree.
pub const MAX_DEGREE: usize = 4;
/// Taps of the largest degree.
const MAX_TAPS: usize = MAX_DEGREE + 1;
/// Pieces per block.
const RUN: usize = 64;

/// Layout of a pulse's pieces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pieces {
    degree: usize,
    length: usize,
    /// Bin of the first piece.
    first: i64,
    row: usize,
    /// Places are counted from here on, within a turn.
    from: f64,
    /// Coefficients by [`taps`].
    taps: [[f32; MAX_TAPS]; MAX_TAPS],
}

impl Pieces {
    /// Layout for degree 1 to [`MAX_DEGREE`], profiles of `length` bins, and `margin` pieces beyond either end.
    ///
    /// # Panics
    /// If degree, length or margin is not valid.
    pub fn new(degree: usize, length: usize, margin: usize) -> Self {
        let first = -((length / 2 + margin) as i64);
        let from = -(length.div_ceil(2) as f64);
        Self::part(degree, length, first, length + 2 * margin, from)
    }

    /// Layout of the pieces within `reach` bins ([`Self::margin_for`]) of a tile at whose centre all paths are 0.
    ///
    /// # Panics
    /// If degree, length or reach is not valid.
    pub fn around(degree: usize, length: usize, reach: usize) -> Self {
        let from = -(length.div_ceil(2) as f64);
        Self::part(degree, length, -(reach as i64), 2 * reach, from)
    }

    /// Layout of the pieces about `places`, the range in bins of all paths to tile centres and points; all pieces if that is a period or more.
    ///
    /// # Panics
    /// If degree, length or margin is not valid.
    pub fn over(degree: usize, length: usize, places: &Range<f64>, margin: usize) -> Self {
        // Rounding may move a path beyond the ends, and a point may use the next piece.
        let (low, high) = (places.start.floor() - 2.0, places.end.ceil() + 2.0);
        // Bins are not resolved by float64 beyond this.
        let near = low.abs().max(high.abs()) < 1e12;
        if !near || high - low >= length as f64 {
            return Self::new(degree, length, margin);
        }
        let row = (high - low) as usize + 2 * margin;
        Self::part(degree, length, low as i64 - margin as i64, row, low)
    }

    fn part(degree: usize, length: usize, first: i64, row: usize, from: f64) -> Self {
        assert!((1..=MAX_DEGREE).contains(&degree) && length > 0);
        Self {
            degree,
            length,
            first,
            row,
            from,
            taps: taps(degree),
        }
    }

    /// Margin that a tile needs, for `bins_m` profile bins per metre of path.
    pub fn margin_for(raster: &Raster, bins_m: f64) -> usize {
        // Paths change by at most twice the distance; windows extend 16 further, and are counted from whole bins.
        (2.0 * raster.reach_m() * bins_m.abs()).ceil() as usize + 18
    }

    /// Degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Bins per period.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Pieces per plane.
    pub fn row(&self) -> usize {
        self.row
    }

    /// Length of a pulse's pieces, all planes.
    pub fn values(&self) -> usize {
        2 * (self.degree + 1) * self.row()
    }

    /// Offset of the pieces' centres from whole bins.
    pub(super) fn shift(&self) -> f64 {
        0.5 * (self.degree % 2) as f64
    }

    /// Bin of the first piece.
    pub(super) fn first(&self) -> f64 {
        self.first as f64
    }

    /// Start of the period of a position, bins.
    #[inline(always)]
    pub(super) fn turn(&self, at: f64) -> f64 {
        ((at - self.from) / self.length as f64).floor()
    }

    /// Compute the pieces of a profile of spline coefficients into `pieces`.
    ///
    /// # Panics
    /// If `profile` does not have [`Self::length`] values, or `pieces` is shorter than [`Self::values`].
    pub fn make(
        &self,
        instructions: Instructions,
        profile: &[Complex32],
        weight: f32,
        pieces: &mut [f32],
    ) {
        assert!(profile.len() == self.length && pieces.len() == self.values());
        instructions.run(Make {
            layout: self,
            profile,
            weight,
            pieces,
        });
    }
}

/// `[k][i]`: contribution of tap `i`, counted from the first under the piece, to the polynomial coefficient of `f^k`.
fn taps(degree: usize) -> [[f32; MAX_TAPS]; MAX_TAPS] {
    let d = degree as i32;
    let choose = |n: i32, k: i32| (0..k).fold(1.0, |c, i| c * f64::from(n - i) / f64::from(i + 1));
    let factorial = (1..=d).fold(1.0, |product, i| product * f64::from(i));
    let mut taps = [[0.0; MAX_TAPS]; MAX_TAPS];
    for (k, of_power) in (0..=d).zip(&mut taps) {
        for (i, tap) in (0..=d).zip(of_power.iter_mut()) {
            // B(x) = sum_m (-1)^m C(d + 1, m) (x + (d + 1) / 2 - m)^d / d! over the m whose bracket is positive, x = f + d / 2 - i.
            let terms = (0..=d - i).map(|m| {
                let sign = if m % 2 == 0 { 1.0 } else { -1.0 };
                let bracket = f64::from(d - i - m) + 0.5;
                sign * choose(d + 1, m) * choose(d, k) * bracket.powi(d - k)
            });
            *tap = (terms.sum::<f64>() / factorial) as f32;
        }
    }
    taps
}

struct Make<'a> {
    layout: &'a Pieces,
    profile: &'a [Complex32],
    weight: f32,
    pieces: &'a mut [f32],
}

impl Kernel for Make<'_> {
    type Output = ();

    /// Scalar loops, vectorised by the compiler.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        match self.layout.degree {
            1 => self.make::<2>(),
            2 => self.make::<3>(),
            3 => self.make::<4>(),
            _ => self.make::<5>(),
        }
    }
}

impl Make<'_> {
    #[inline(always)]
    fn make<const TAPS: usize>(self) {
        let Pieces {
            degree,
            length,
            first,
            row,
            taps,
            ..
        } = *self.layout;
        // Profile index of the first piece's first tap.
        let under = first - (degree / 2) as i64;
        let mut place = under.rem_euclid(length as i64) as usize;
        let [mut under_re, mut under_im] = [[0.0f32; RUN + MAX_TAPS - 1]; 2];
        for first in (0..row).step_by(RUN) {
            let count = RUN.min(row - first);
            let taken = under_re.len();
            match self.profile.get(place..place + taken) {
                Some(values) => {
                    for i in 0..taken {
                        (under_re[i], under_im[i]) = (values[i].re, values[i].im);
                    }
                }
                None => {
                    let values = self.profile.iter().cycle().skip(place);
                    for ((re, im), z) in under_re.iter_mut().zip(&mut under_im).zip(values) {
                        (*re, *im) = (z.re, z.im);
                    }
                }
            }
            place = (place + RUN) % length;
            for (k, taps) in taps[..TAPS].iter().enumerate() {
                let mut sums = [[0.0f32; RUN]; 2];
                for (sums, under) in sums.iter_mut().zip([&under_re, &under_im]) {
                    for (tap, &weight) in taps[..TAPS].iter().enumerate() {
                        for (sum, value) in sums.iter_mut().zip(&under[tap..]) {
                            *sum += weight * value;
                        }
                    }
                }
                let planes = &mut self.pieces[2 * k * row..(2 * k + 2) * row];
                let (real, imaginary) = planes.split_at_mut(row);
                let real = &mut real[first..first + count];
                let imaginary = &mut imaginary[first..first + count];
                for i in 0..count {
                    real[i] = sums[0][i] * self.weight;
                    imaginary[i] = sums[1][i] * self.weight;
                }
            }
        }
    }
}
