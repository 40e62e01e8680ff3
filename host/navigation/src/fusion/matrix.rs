//! Small matrices of fixed sizes, row by row.

/// `R` rows of `C`.
pub(super) type Matrix<const R: usize, const C: usize> = [[f64; C]; R];

pub(super) fn zero<const R: usize, const C: usize>() -> Matrix<R, C> {
    [[0.0; C]; R]
}

/// The lower triangle whose product with its transpose a symmetric matrix is (Cholesky); none if it is not positive definite. The matrix's lower triangle is
/// looked at.
pub(super) fn factor<const N: usize>(matrix: &Matrix<N, N>) -> Option<Matrix<N, N>> {
    let mut lower = zero();
    for i in 0..N {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let left: f64 = matrix[i][j] - known;
            lower[i][j] = match i == j {
                // What is left of a pivot by rounding alone is none.
                true if left > 1e-14 * matrix[i][i] => left.sqrt(),
                true => return None,
                false => left / lower[j][j],
            };
        }
    }
    Some(lower)
}

/// `L^-1 x`, in place.
pub(super) fn forward<const N: usize, const K: usize>(lower: &Matrix<N, N>, x: &mut Matrix<N, K>) {
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

/// `L^-T x`, in place.
pub(super) fn backward<const N: usize, const K: usize>(lower: &Matrix<N, N>, x: &mut Matrix<N, K>) {
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

/// `a b`.
pub(super) fn times<const R: usize, const N: usize, const C: usize>(
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

/// `a^T`.
pub(super) fn transposed<const R: usize, const C: usize>(a: &Matrix<R, C>) -> Matrix<C, R> {
    std::array::from_fn(|j| std::array::from_fn(|i| a[i][j]))
}

/// `target - a^T b`, in place.
pub(super) fn less<const N: usize, const R: usize, const C: usize>(
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

/// Sum of two.
pub(super) fn plus<const R: usize, const C: usize>(
    a: &Matrix<R, C>,
    b: &Matrix<R, C>,
) -> Matrix<R, C> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + b[i][j]))
}

/// The inverse of a matrix of this factor.
pub(super) fn inverse<const N: usize>(lower: &Matrix<N, N>) -> Matrix<N, N> {
    let mut inverse = zero();
    for (i, row) in inverse.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    forward(lower, &mut inverse);
    backward(lower, &mut inverse);
    inverse
}
