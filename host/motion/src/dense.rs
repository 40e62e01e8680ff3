//! Small symmetric systems.

/// A symmetric positive definite matrix as the product of a lower triangle and its transpose (Cholesky).
pub(crate) struct Factor {
    size: usize,
    lower: Vec<f64>,
}

impl Factor {
    /// Of a matrix, row by row, whose lower triangle is looked at; none if it is not positive definite.
    pub(crate) fn new(size: usize, matrix: &[f64]) -> Option<Self> {
        assert_eq!(matrix.len(), size * size);
        let mut lower = vec![0.0; size * size];
        for i in 0..size {
            for j in 0..=i {
                let (a, b) = (
                    &lower[i * size..i * size + j],
                    &lower[j * size..j * size + j],
                );
                let left = matrix[i * size + j] - a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                lower[i * size + j] = match i == j {
                    // What is left of a pivot by rounding alone is none.
                    true if left > 1e-13 * matrix[i * size + i] => left.sqrt(),
                    true => return None,
                    false => left / lower[j * size + j],
                };
            }
        }
        Some(Self { size, lower })
    }

    /// The solution for a right side, in its place.
    pub(crate) fn solve(&self, x: &mut [f64]) {
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

    /// The inverse, row by row.
    pub(crate) fn inverse(&self) -> Vec<f64> {
        let n = self.size;
        let mut inverse = vec![0.0; n * n];
        for (i, row) in inverse.chunks_exact_mut(n.max(1)).enumerate() {
            row[i] = 1.0;
            self.solve(row);
        }
        inverse
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_times_its_inverse_is_one() {
        let n = 7;
        let a: Vec<f64> = (0..n * n).map(|i| ((i * 37 % 101) as f64).sin()).collect();
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| a[i * n + k] * a[j * n + k]).sum();
                matrix[i * n + j] = sum + if i == j { 0.5 } else { 0.0 };
            }
        }
        let inverse = Factor::new(n, &matrix).unwrap().inverse();
        for i in 0..n {
            for j in 0..n {
                let sum: f64 = (0..n).map(|k| matrix[i * n + k] * inverse[k * n + j]).sum();
                assert!((sum - f64::from(u8::from(i == j))).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn what_is_not_definite_has_no_factor() {
        assert!(Factor::new(2, &[1.0, 2.0, 2.0, 1.0]).is_none());
        assert!(Factor::new(2, &[1.0, 1.0, 1.0, 1.0]).is_none());
        assert!(Factor::new(1, &[f64::NAN]).is_none());
    }
}
