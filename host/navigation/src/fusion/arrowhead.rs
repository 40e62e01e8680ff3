//! Arrowhead (bordered block-tridiagonal) normal equations of a chain: each link couples with itself and the next, and all with common unknowns.
//!
//! ```text
//! | D_0  E_0            B_0 |
//! | E_0' D_1  E_1       B_1 |
//! |      E_1' D_2  ..   B_2 |
//! | B_0' B_1' B_2  ..   C   |
//! ```
//!
//! The Cholesky factor has the same form, so that time and memory grow with the number of links. With `L_i` the factor of the reduced `D_i`, `W_i = L_i^-1 E_i` and `V_i = L_i^-1 B_i` (reduced),
//!
//! ```text
//! D_(i+1) -= W_i' W_i      B_(i+1) -= W_i' V_i      C -= V_i' V_i
//! ```
//!
//! The blocks of the inverse follow backwards from `x_i = -A_i x_(i+1) - F_i g` plus noise of covariance `(L_i L_i')^-1`, with `A_i = L_i^-T W_i` and `F_i = L_i^-T V_i`: they are the covariances of this linear model. (This is the
//! Rauch-Tung-Striebel fixed-interval smoother in information form.)

use super::MIN_PIVOT;
use subaperture_signal::dense::fixed::{
    Matrix, backward, factor, forward, inverse, less, plus, times, transposed, zero,
};

/// Blocks of a link and its right side: `N` unknowns a link, `G` common ones.
#[derive(Clone)]
pub(super) struct Link<const N: usize, const G: usize> {
    pub(super) own: Matrix<N, N>,
    /// Block with the next link.
    pub(super) next: Matrix<N, N>,
    pub(super) common: Matrix<N, G>,
    pub(super) right: [f64; N],
}

/// Arrowhead normal equations.
pub(super) struct Arrowhead<const N: usize, const G: usize> {
    pub(super) links: Vec<Link<N, G>>,
    pub(super) common: Matrix<G, G>,
    pub(super) right: [f64; G],
}

/// Factor: `L`, `W`, `V` and the reduced right side of each link.
pub(super) struct Factored<const N: usize, const G: usize> {
    links: Vec<Link<N, G>>,
    common: Matrix<G, G>,
    right: [f64; G],
}

/// Covariances of a link: its own, with the next link, and with the common unknowns.
#[derive(Clone)]
pub(super) struct Covariance<const N: usize, const G: usize> {
    pub(super) own: Matrix<N, N>,
    pub(super) next: Matrix<N, N>,
    pub(super) common: Matrix<N, G>,
}

fn column<const N: usize>(values: &[f64; N]) -> Matrix<N, 1> {
    values.map(|value| [value])
}

fn values<const N: usize>(column: &Matrix<N, 1>) -> [f64; N] {
    column.map(|[value]| value)
}

impl<const N: usize, const G: usize> Arrowhead<N, G> {
    pub(super) fn new(links: usize) -> Self {
        let empty = Link {
            own: zero(),
            next: zero(),
            common: zero(),
            right: [0.0; N],
        };
        Self {
            links: vec![empty; links],
            common: zero(),
            right: [0.0; G],
        }
    }

    /// Factorise. The error is the link at which the matrix is not positive definite.
    pub(super) fn factor(mut self) -> Result<Factored<N, G>, usize> {
        for i in 0..self.links.len() {
            let (done, rest) = self.links.split_at_mut(i + 1);
            let link = &mut done[i];
            let lower = factor(&link.own, MIN_PIVOT).ok_or(i)?;
            let mut right = column(&link.right);
            forward(&lower, &mut link.next);
            forward(&lower, &mut link.common);
            forward(&lower, &mut right);
            link.own = lower;
            link.right = values(&right);
            if let Some(next) = rest.first_mut() {
                let mut left = column(&next.right);
                less(&mut next.own, &link.next, &link.next);
                less(&mut next.common, &link.next, &link.common);
                less(&mut left, &link.next, &right);
                next.right = values(&left);
            }
            let mut left = column(&self.right);
            less(&mut self.common, &link.common, &link.common);
            less(&mut left, &link.common, &right);
            self.right = values(&left);
        }
        let lower = factor(&self.common, MIN_PIVOT).ok_or(self.links.len())?;
        let mut right = column(&self.right);
        forward(&lower, &mut right);
        Ok(Factored {
            links: self.links,
            common: lower,
            right: values(&right),
        })
    }
}

impl<const N: usize, const G: usize> Factored<N, G> {
    /// Solution: unknowns of each link, and the common ones.
    pub(super) fn solution(&self) -> (Vec<[f64; N]>, [f64; G]) {
        let rights = self.links.iter().map(|link| link.right);
        self.back(rights.collect(), self.right)
    }

    /// Sample with the inverse as covariance, from independent numbers of unit variance.
    pub(super) fn coloured(&self, mut white: impl FnMut() -> f64) -> (Vec<[f64; N]>, [f64; G]) {
        let links = self.links.iter().map(|_| std::array::from_fn(|_| white()));
        let links: Vec<[f64; N]> = links.collect();
        let common = std::array::from_fn(|_| white());
        self.back(links, common)
    }

    /// `L^-T` of a vector.
    fn back(&self, mut links: Vec<[f64; N]>, common: [f64; G]) -> (Vec<[f64; N]>, [f64; G]) {
        let mut common = column(&common);
        backward(&self.common, &mut common);
        let mut next: Option<Matrix<N, 1>> = None;
        for (link, x) in self.links.iter().zip(&mut links).rev() {
            let mut own = column(x);
            if let Some(next) = &next {
                less(&mut own, &transposed(&link.next), next);
            }
            less(&mut own, &transposed(&link.common), &common);
            backward(&link.own, &mut own);
            *x = values(&own);
            next = Some(own);
        }
        (links, values(&common))
    }

    /// Covariances of the solution: of each link, and of the common unknowns.
    pub(super) fn covariances(&self) -> (Vec<Covariance<N, G>>, Matrix<G, G>) {
        let common = inverse(&self.common);
        let mut all: Vec<Covariance<N, G>> = Vec::with_capacity(self.links.len());
        for link in self.links.iter().rev() {
            let mut along = link.next;
            backward(&link.own, &mut along);
            let mut with = link.common;
            backward(&link.own, &mut with);
            let negative = |a: Matrix<N, N>| a.map(|row| row.map(|value| -value));
            let zeros = zero();
            let (next_own, next_common) = match all.last() {
                Some(next) => (&next.own, &next.common),
                None => (&zeros, &zero()),
            };
            let by_common = times(&with, &transposed(next_common));
            let next = negative(plus(&times(&along, next_own), &by_common));
            let sum = plus(&times(&along, next_common), &times(&with, &common));
            let common_with = sum.map(|row| row.map(|value| -value));
            let mut own = inverse(&link.own);
            less(&mut own, &transposed(&next), &transposed(&along));
            less(&mut own, &transposed(&common_with), &transposed(&with));
            all.push(Covariance {
                own,
                next,
                common: common_with,
            });
        }
        all.reverse();
        (all, common)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chain of 4 links of 3 unknowns with 2 common ones, and the same matrix in full.
    fn chain() -> (Arrowhead<3, 2>, Vec<Vec<f64>>, Vec<f64>) {
        let mut system = Arrowhead::<3, 2>::new(4);
        let size = 14;
        let mut whole = vec![vec![0.0; size]; size];
        let mut right = vec![0.0; size];
        // Sums of squares of rows that couple a link, the next and the common unknowns, with a small diagonal.
        for n in 0..60 {
            let i = n % 4;
            let mut row = vec![0.0; size];
            let at = |k: usize| ((n * 31 + k * 17) as f64 * 0.7).sin();
            for k in 0..3 {
                row[3 * i + k] = at(k);
                if i < 3 {
                    row[3 * i + 3 + k] = at(k + 3);
                }
            }
            row[12] = at(6);
            row[13] = at(7);
            for a in 0..size {
                right[a] += row[a] * at(8);
                for b in 0..size {
                    whole[a][b] += row[a] * row[b];
                }
            }
        }
        for (a, row) in whole.iter_mut().enumerate() {
            row[a] += 0.1;
        }
        for (i, link) in system.links.iter_mut().enumerate() {
            for a in 0..3 {
                link.right[a] = right[3 * i + a];
                for b in 0..3 {
                    link.own[a][b] = whole[3 * i + a][3 * i + b];
                    if i < 3 {
                        link.next[a][b] = whole[3 * i + a][3 * i + 3 + b];
                    }
                }
                for b in 0..2 {
                    link.common[a][b] = whole[3 * i + a][12 + b];
                }
            }
        }
        for a in 0..2 {
            system.right[a] = right[12 + a];
            for b in 0..2 {
                system.common[a][b] = whole[12 + a][12 + b];
            }
        }
        (system, whole, right)
    }

    #[test]
    fn solution_satisfies_equations() {
        let (system, whole, right) = chain();
        let (links, common) = system.factor().ok().unwrap().solution();
        let x: Vec<f64> = links.iter().flatten().chain(&common).copied().collect();
        for (row, right) in whole.iter().zip(right) {
            let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
            assert!((sum - right).abs() < 1e-11, "{sum} {right}");
        }
    }

    /// The matrix times a column of the inverse is a column of the identity. For link 1 the blocks of links 0, 1, 2 and the common unknowns are available; that of link 3 follows from the rows of link 2.
    #[test]
    fn covariances_equal_blocks_of_inverse() {
        let (system, whole, _) = chain();
        let (all, common) = system.factor().ok().unwrap().covariances();
        // Full inverse by elimination.
        let size = whole.len();
        let mut left = whole.clone();
        let mut inverse: Vec<Vec<f64>> = (0..size)
            .map(|i| (0..size).map(|j| f64::from(u8::from(i == j))).collect())
            .collect();
        for p in 0..size {
            let pivot = left[p][p];
            for j in 0..size {
                left[p][j] /= pivot;
                inverse[p][j] /= pivot;
            }
            for i in (0..size).filter(|&i| i != p) {
                let factor = left[i][p];
                for j in 0..size {
                    left[i][j] -= factor * left[p][j];
                    inverse[i][j] -= factor * inverse[p][j];
                }
            }
        }
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-10, "{a} {b}");
        for (i, link) in all.iter().enumerate() {
            for a in 0..3 {
                for b in 0..3 {
                    near(link.own[a][b], inverse[3 * i + a][3 * i + b]);
                    if i < 3 {
                        near(link.next[a][b], inverse[3 * i + a][3 * i + 3 + b]);
                    }
                }
                for b in 0..2 {
                    near(link.common[a][b], inverse[3 * i + a][12 + b]);
                }
            }
        }
        for a in 0..2 {
            for b in 0..2 {
                near(common[a][b], inverse[12 + a][12 + b]);
            }
        }
    }

    #[test]
    fn indefinite_system_is_refused_with_its_link() {
        let (mut system, ..) = chain();
        system.links[2].own = zero();
        assert_eq!(system.factor().err(), Some(2));
    }
}
