//! Small dense systems of linear equations of any size; fixed sizes are in [`fixed`].
//!
//! Matrices are row-major slices. **Cost**: a third of the cube of the size for a general system, a sixth for a
//! symmetric one. **Accuracy**: some rounding errors times the condition number. A pivot that elimination reduces to a
//! fraction `least` of its diagonal element, or less, is treated as zero: with `n` unknowns, rounding leaves about `n`
//! times 1.1e-16 of an exact zero. Use 1e-13 for up to some hundred unknowns, 1e-14 for some ten, and 0 to accept any
//! positive pivot.

pub mod fixed;

/// Cholesky factor of a symmetric positive definite matrix: the product of a lower triangle and its transpose.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    size: usize,
    lower: Vec<f64>,
}

/// Replace the lower triangle of a symmetric matrix by its Cholesky factor; `false` if it is not positive definite.
#[inline]
pub(crate) fn factor_in_place(size: usize, matrix: &mut [f64], least: f64) -> bool {
    for i in 0..size {
        for j in 0..=i {
            let (above, own) = matrix.split_at(i * size);
            let known: f64 = match i == j {
                true => own[..j].iter().map(|v| v * v).sum(),
                false => {
                    let other = &above[j * size..j * size + j];
                    own[..j].iter().zip(other).map(|(a, b)| a * b).sum()
                }
            };
            let value = matrix[i * size + j];
            let left = value - known;
            matrix[i * size + j] = match i == j {
                // A pivot left by rounding alone counts as zero.
                true if left > least * value => left.sqrt(),
                true => return false,
                false => left / matrix[j * size + j],
            };
        }
    }
    true
}

impl Factor {
    /// Factor a matrix, whose lower triangle is read. `None` if it is not positive definite, or if elimination leaves
    /// no more than the fraction `least` of a diagonal element.
    ///
    /// # Panics
    /// If `matrix` does not have `size` times `size` elements.
    pub fn new(size: usize, matrix: &[f64], least: f64) -> Option<Self> {
        assert_eq!(matrix.len(), size * size);
        let mut lower = matrix.to_vec();
        factor_in_place(size, &mut lower, least).then_some(Self { size, lower })
    }

    /// Solve for the right-hand side `x`, in place.
    ///
    /// # Panics
    /// If `x` is shorter than the size.
    pub fn solve(&self, x: &mut [f64]) {
        let (n, l) = (self.size, &self.lower);
        for i in 0..n {
            let known: f64 = (0..i).map(|j| l[i * n + j] * x[j]).sum();
            x[i] = (x[i] - known) / l[i * n + i];
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|j| l[j * n + i] * x[j]).sum();
            x[i] = (x[i] - known) / l[i * n + i];
        }
    }

    /// Solve for a right-hand side; `None` if the solution is not finite.
    ///
    /// # Panics
    /// If `right` is shorter than the size.
    pub fn solved(&self, right: &[f64]) -> Option<Vec<f64>> {
        let mut x = right.to_vec();
        self.solve(&mut x);
        x.iter().all(|v| v.is_finite()).then_some(x)
    }

    /// Natural logarithm of the matrix's determinant.
    pub fn log_determinant(&self) -> f64 {
        let diagonal = (0..self.size).map(|i| self.lower[i * self.size + i]);
        2.0 * diagonal.map(libm::log).sum::<f64>()
    }

    /// Inverse of the matrix, row-major.
    pub fn inverse(&self) -> Vec<f64> {
        let n = self.size;
        let mut inverse = vec![0.0; n * n];
        for (i, row) in inverse.chunks_exact_mut(n.max(1)).enumerate() {
            row[i] = 1.0;
            self.solve(row);
        }
        inverse
    }
}

/// Solve `matrix x = right` by elimination with pivoting; `None` for a singular matrix or a solution that is not
/// finite.
///
/// # Panics
/// If the matrix is not square with the size of `right`.
pub fn solve(matrix: &[f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    assert_eq!(matrix.len(), n * n);
    let mut a = matrix.to_vec();
    let mut x = right.to_vec();
    for column in 0..n {
        let largest =
            |&i: &usize, &j: &usize| a[i * n + column].abs().total_cmp(&a[j * n + column].abs());
        let pivot = (column..n).max_by(largest)?;
        let value = a[pivot * n + column];
        if value == 0.0 || !value.is_finite() {
            return None;
        }
        if pivot != column {
            for k in 0..n {
                a.swap(pivot * n + k, column * n + k);
            }
            x.swap(pivot, column);
        }
        for row in column + 1..n {
            let factor = a[row * n + column] / value;
            for k in column..n {
                a[row * n + k] -= factor * a[column * n + k];
            }
            x[row] -= factor * x[column];
        }
    }
    for row in (0..n).rev() {
        let known: f64 = (row + 1..n).map(|k| a[row * n + k] * x[k]).sum();
        x[row] = (x[row] - known) / a[row * n + row];
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random matrix `A A^T + 1`, with elements of `A` up to one half: positive definite, with a condition number below
    /// 100.
    fn definite(n: usize) -> Vec<f64> {
        let mut state = 1u64;
        let a: Vec<f64> = (0..n * n)
            .map(|_| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                (state >> 40) as f64 / (1u64 << 24) as f64 - 0.5
            })
            .collect();
        let at = |i: usize, j: usize| {
            let sum: f64 = (0..n).map(|k| a[k * n + i] * a[k * n + j]).sum();
            sum + f64::from(u8::from(i == j))
        };
        (0..n * n).map(|i| at(i / n, i % n)).collect()
    }

    #[test]
    fn linear_systems_are_solved_by_pivoting_and_cholesky() {
        // x = 1, 2, ..., n.
        let n = 7;
        let matrix = definite(n);
        let right: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| matrix[i * n + j] * (j + 1) as f64).sum())
            .collect();
        let by_pivots = solve(&matrix, &right).unwrap();
        let factor = Factor::new(n, &matrix, 1e-13).unwrap();
        let by_cholesky = factor.solved(&right).unwrap();
        for (j, (x, y)) in by_pivots.iter().zip(&by_cholesky).enumerate() {
            // Condition number below 100, rounding errors of 1e-16.
            assert!((x - (j + 1) as f64).abs() < 1e-12 && (y - (j + 1) as f64).abs() < 1e-12);
        }
        assert_eq!(solve(&[1.0, 2.0, 2.0, 4.0], &[1.0, 1.0]), None);
        assert_eq!(factor.solved(&[f64::MAX; 7]), None);
    }

    #[test]
    fn matrix_times_inverse_is_identity() {
        let n = 7;
        let matrix = definite(n);
        let inverse = Factor::new(n, &matrix, 0.0).unwrap().inverse();
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| matrix[i * n + k] * inverse[k * n + j]).sum();
                assert!((sum - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn indefinite_matrix_has_no_cholesky_factor() {
        assert_eq!(Factor::new(2, &[1.0, 2.0, 2.0, 1.0], 0.0), None);
        assert_eq!(Factor::new(2, &[1.0, 1.0, 1.0, 1.0], 1e-13), None);
        assert_eq!(Factor::new(1, &[f64::NAN], 0.0), None);
        // A pivot of 1e-9 of its diagonal element: accepted, unless a larger fraction is required.
        let nearly = [1.0, 1.0, 1.0, 1.0 + 1e-9];
        assert!(Factor::new(2, &nearly, 1e-10).is_some());
        assert_eq!(Factor::new(2, &nearly, 1e-8), None);
    }
}
