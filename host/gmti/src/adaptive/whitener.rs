//! Cholesky factor of a covariance matrix: whitening, quadratic forms, weights and SINR loss.

use num_complex::{Complex, Complex64};

use super::AdaptiveError;
use super::covariance::{triangle, widen};

/// Smallest pivot, relative to its diagonal element: a smaller one is rounding of some ten terms.
const MIN_PIVOT: f64 = 1e-14;

/// Cholesky factor `G` of a positive definite matrix `S = G G^H` of `N` rows.
///
/// `S` is the sum of the outer products of training snapshots ([`Covariance::factor`](super::Covariance::factor)) or a known covariance ([`Whitener::known`]). All vectors have `N` elements.
#[derive(Clone, Debug, PartialEq)]
pub struct Whitener {
    size: usize,
    /// Lower triangle, row by row.
    lower: Vec<Complex64>,
    /// Inverse of each diagonal element.
    inverse: Vec<f64>,
}

impl Whitener {
    /// Cholesky factor of a known covariance: `size` rows of `size` columns, row by row, in units of power. The lower triangle is read.
    ///
    /// # Errors
    /// [`AdaptiveError::NotPositiveDefinite`].
    ///
    /// # Panics
    /// If `size` is 0 or `matrix` does not have `size` times `size` elements.
    pub fn known(size: usize, matrix: &[Complex64]) -> Result<Self, AdaptiveError> {
        assert!(size > 0, "expected at least one degree of freedom");
        assert_eq!(matrix.len(), size * size);
        let rows = matrix.chunks_exact(size).enumerate();
        let lower: Vec<_> = rows.flat_map(|(i, row)| &row[..=i]).copied().collect();
        let mut whitener = Self::identity(size);
        whitener.factor(&lower, 0.0)?;
        Ok(whitener)
    }

    pub(super) fn identity(size: usize) -> Self {
        let mut lower = vec![Complex64::ZERO; triangle(size)];
        (0..size).for_each(|i| lower[triangle(i) + i] = Complex64::ONE);
        let inverse = vec![1.0; size];
        Self {
            size,
            lower,
            inverse,
        }
    }

    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Least ratio of a pivot to its element of the `diagonal` that was factorised.
    pub(super) fn least_pivot(&self, diagonal: impl Iterator<Item = f64>) -> f64 {
        let ratios = self.inverse.iter().zip(diagonal);
        let ratios = ratios.map(|(inverse, element)| 1.0 / (inverse * inverse * element));
        ratios.fold(f64::INFINITY, f64::min)
    }

    /// Replace the factor by that of a matrix given by its lower triangle, with `added` on its diagonal.
    pub(super) fn factor(&mut self, matrix: &[Complex64], added: f64) -> Result<(), AdaptiveError> {
        for i in 0..self.size {
            let (above, own) = self.lower.split_at_mut(triangle(i));
            let given = &matrix[triangle(i)..];
            for j in 0..i {
                let other = &above[triangle(j)..triangle(j) + j];
                let left = given[j] - product(other, &own[..j]);
                own[j] = left * self.inverse[j];
            }
            let diagonal = given[i].re + added;
            let pivot = diagonal - power(&own[..i]);
            // The comparison is false for NaN as well.
            if !(pivot > MIN_PIVOT * diagonal && pivot.is_finite()) {
                return Err(AdaptiveError::NotPositiveDefinite { row: i, pivot });
            }
            let root = pivot.sqrt();
            own[i] = root.into();
            self.inverse[i] = 1.0 / root;
        }
        Ok(())
    }

    /// Whiten `x`: `out = G^-1 x`, of unit covariance if `S` is the covariance of `x`. No allocation.
    ///
    /// # Panics
    /// If `x` or `out` does not have `N` elements.
    pub fn whiten<T: Copy + Into<f64>>(&self, x: &[Complex<T>], out: &mut [Complex64]) {
        assert_eq!((x.len(), out.len()), (self.size, self.size));
        for (i, &value) in x.iter().enumerate() {
            let row = &self.lower[triangle(i)..triangle(i) + i];
            let (known, rest) = out.split_at_mut(i);
            let terms = row.iter().zip(known.iter());
            let left = terms.fold(widen(value), |left, (a, b)| left - a * b);
            rest[0] = left * self.inverse[i];
        }
    }

    /// Quadratic form `x^H S^-1 y`. It allocates; [`Detector`](super::Detector) evaluates cells without allocation.
    ///
    /// # Panics
    /// If `x` or `y` does not have `N` elements.
    pub fn quadratic_form<T: Copy + Into<f64>>(
        &self,
        x: &[Complex<T>],
        y: &[Complex<T>],
    ) -> Complex64 {
        product(&self.whitened(x), &self.whitened(y))
    }

    fn whitened<T: Copy + Into<f64>>(&self, x: &[Complex<T>]) -> Vec<Complex64> {
        let mut out = vec![Complex64::ZERO; self.size];
        self.whiten(x, &mut out);
        out
    }

    /// Adaptive weights `w = S^-1 s` of a steering vector; the filter output is `w^H x`. No allocation.
    ///
    /// # Panics
    /// If `steering` or `weights` does not have `N` elements.
    pub fn weights(&self, steering: &[Complex64], weights: &mut [Complex64]) {
        self.whiten(steering, weights);
        for i in (0..self.size).rev() {
            let below = (i + 1..self.size).map(|k| self.lower[triangle(k) + i].conj() * weights[k]);
            let known: Complex64 = below.sum();
            weights[i] = (weights[i] - known) * self.inverse[i];
        }
    }

    /// SINR of the weights of this estimate, relative to that of the weights of the `known` covariance `R`:
    /// `|s^H S^-1 s|^2 / ((s^H S^-1 R S^-1 s) (s^H R^-1 s))`, a power ratio of 0 to 1. It allocates.
    ///
    /// # Panics
    /// If `steering` does not have `N` elements or the sizes differ.
    pub fn sinr_loss(&self, steering: &[Complex64], known: &Whitener) -> f64 {
        assert_eq!(self.size, known.size);
        let mut weights = vec![Complex64::ZERO; self.size];
        self.weights(steering, &mut weights);
        let signal = product(&weights, steering).norm_sqr();
        signal / (known.output_power(&weights) * power(&known.whitened(steering)))
    }

    /// Mean output power `w^H S w = |G^H w|^2`.
    fn output_power(&self, weights: &[Complex64]) -> f64 {
        let column = |j: usize| {
            let below = (j..self.size).map(|i| self.lower[triangle(i) + j].conj() * weights[i]);
            below.sum::<Complex64>().norm_sqr()
        };
        (0..self.size).map(column).sum()
    }
}

/// Inner product `a^H b`.
pub(crate) fn product(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    let terms = a.iter().zip(b);
    terms.fold(Complex64::ZERO, |sum, (a, b)| sum + a.conj() * b)
}

/// Sum of squared magnitudes.
pub(crate) fn power(a: &[Complex64]) -> f64 {
    a.iter().fold(0.0, |sum, a| sum + a.norm_sqr())
}
