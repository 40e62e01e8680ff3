//! Small row-major matrices of fixed sizes, for chains of thousands of them.

use super::factor_in_place;

/// Matrix of `R` rows and `C` columns.
pub type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

/// Zero matrix.
pub fn zero<const R: usize, const C: usize>() -> Matrix<R, C> {
    [[0.0; C]; R]
}

/// Cholesky factor: the lower triangle whose product with its transpose is the symmetric `matrix`. `None` if the matrix
/// is not positive definite, or if elimination leaves less than the fraction `least` of a diagonal element. Only the
/// lower triangle is read.
pub fn factor<const N: usize>(matrix: &Matrix<N, N>, least: f64) -> Option<Matrix<N, N>> {
    let mut lower = *matrix;
    for (i, row) in lower.iter_mut().enumerate() {
        row[i + 1..].fill(0.0);
    }
    factor_in_place(N, lower.as_flattened_mut(), least).then_some(lower)
}

/// Forward substitution `L^-1 x`, in place.
pub fn forward<const N: usize, const K: usize>(lower: &Matrix<N, N>, x: &mut Matrix<N, K>) {
    for (i, factors) in lower.iter().enumerate() {
        let (done, rest) = x.split_at_mut(i);
        for (factor, row) in factors.iter().zip(done.iter()) {
            for (value, known) in rest[0].iter_mut().zip(row) {
                *value -= factor * known;
            }
        }
        for value in &mut rest[0] {
            *value /= factors[i];
        }
    }
}

/// Backward substitution `L^-T x`, in place.
pub fn backward<const N: usize, const K: usize>(lower: &Matrix<N, N>, x: &mut Matrix<N, K>) {
    for i in (0..N).rev() {
        let (rest, done) = x.split_at_mut(i + 1);
        for (row, values) in done.iter().enumerate() {
            for (value, known) in rest[i].iter_mut().zip(values) {
                *value -= lower[i + 1 + row][i] * known;
            }
        }
        for value in &mut rest[i] {
            *value /= lower[i][i];
        }
    }
}

/// Matrix product `a b`.
pub fn times<const R: usize, const N: usize, const C: usize>(
    a: &Matrix<R, N>,
    b: &Matrix<N, C>,
) -> Matrix<R, C> {
    let mut product = zero();
    for (sums, row) in product.iter_mut().zip(a) {
        for (factor, values) in row.iter().zip(b) {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum += factor * value;
            }
        }
    }
    product
}

/// Transpose `a^T`.
pub fn transposed<const R: usize, const C: usize>(a: &Matrix<R, C>) -> Matrix<C, R> {
    std::array::from_fn(|j| std::array::from_fn(|i| a[i][j]))
}

/// Subtract `a^T b` from `target`, in place.
pub fn less<const N: usize, const R: usize, const C: usize>(
    target: &mut Matrix<R, C>,
    a: &Matrix<N, R>,
    b: &Matrix<N, C>,
) {
    for (row, values) in a.iter().zip(b) {
        for (sums, factor) in target.iter_mut().zip(row) {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum -= factor * value;
            }
        }
    }
}

/// Matrix sum `a + b`.
pub fn plus<const R: usize, const C: usize>(a: &Matrix<R, C>, b: &Matrix<R, C>) -> Matrix<R, C> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}

/// Inverse of the matrix with this Cholesky factor.
pub fn inverse<const N: usize>(lower: &Matrix<N, N>) -> Matrix<N, N> {
    let mut inverse = zero();
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    forward(lower, &mut inverse);
    backward(lower, &mut inverse);
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cholesky_factor_product_and_inverse_agree() {
        let lower: Matrix<3, 3> = [[2.0, 0.0, 0.0], [-1.0, 0.5, 0.0], [0.25, 3.0, 1.5]];
        let matrix = times(&lower, &transposed(&lower));
        // Exact, since all values are multiples of powers of two.
        assert_eq!(factor(&matrix, 1e-14), Some(lower));
        let whole = times(&matrix, &inverse(&lower));
        let mut x = [[1.0], [2.0], [-1.0]];
        let right = times(&matrix, &x);
        let mut solved = right;
        forward(&lower, &mut solved);
        backward(&lower, &mut solved);
        for i in 0..3 {
            for (j, value) in whole[i].iter().enumerate() {
                assert!((value - f64::from(u8::from(i == j))).abs() < 1e-12);
            }
            // Condition number of some hundreds.
            assert!((solved[i][0] - x[i][0]).abs() < 1e-12);
        }
        // x - A'A x with A = L'.
        let upper = transposed(&lower);
        let product = times(&matrix, &x);
        let wanted = plus(&x, &product.map(|row| row.map(|v| -v)));
        let through = times(&upper, &x);
        less(&mut x, &upper, &through);
        assert_eq!(x, wanted);
        assert_eq!(factor(&[[1.0, 1.0], [1.0, 1.0]], 1e-14), None);
    }
}
