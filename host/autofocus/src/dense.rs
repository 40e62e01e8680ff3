//! Small dense systems of linear equations.

/// `x` of `matrix x = right`, row-major and square, by elimination with pivots; `None` of a singular one.
pub(crate) fn solve(matrix: &[f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
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

/// `x` of `matrix x = right`, symmetric and positive definite, its lower triangle given and overwritten, by Cholesky; `None` of another.
pub(crate) fn solve_definite(matrix: &mut [f64], right: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    for i in 0..n {
        for j in 0..=i {
            let (above, below) = matrix.split_at(i * n);
            let known: f64 = match i == j {
                true => below[..j].iter().map(|v| v * v).sum(),
                false => below[..j]
                    .iter()
                    .zip(&above[j * n..])
                    .map(|(a, b)| a * b)
                    .sum(),
            };
            let left = matrix[i * n + j] - known;
            matrix[i * n + j] = match i == j {
                true if left > 0.0 => left.sqrt(),
                true => return None,
                false => left / matrix[j * n + j],
            };
        }
    }
    let mut x = right.to_vec();
    for i in 0..n {
        let known: f64 = matrix[i * n..i * n + i]
            .iter()
            .zip(&x)
            .map(|(a, b)| a * b)
            .sum();
        x[i] = (x[i] - known) / matrix[i * n + i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| matrix[k * n + i] * x[k]).sum();
        x[i] = (x[i] - known) / matrix[i * n + i];
    }
    x.iter().all(|v| v.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_solved() {
        // A^T A + 1 of a random A is definite; x = 1, 2, ..., n.
        let n = 7;
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
        let mut matrix: Vec<f64> = (0..n * n).map(|i| at(i / n, i % n)).collect();
        let right: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| matrix[i * n + j] * (j + 1) as f64).sum())
            .collect();
        let by_pivots = solve(&matrix, &right).unwrap();
        let by_cholesky = solve_definite(&mut matrix, &right).unwrap();
        for (j, (x, y)) in by_pivots.iter().zip(&by_cholesky).enumerate() {
            // Conditions below 100, of rounding of 1e-16.
            assert!((x - (j + 1) as f64).abs() < 1e-12 && (y - (j + 1) as f64).abs() < 1e-12);
        }
        assert_eq!(solve(&[1.0, 2.0, 2.0, 4.0], &[1.0, 1.0]), None);
        assert_eq!(solve_definite(&mut [1.0, 2.0, 2.0, 1.0], &[1.0, 1.0]), None);
    }
}
