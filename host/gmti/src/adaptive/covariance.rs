//! Running sample covariance with diagonal loading.

use num_complex::{Complex, Complex64};

use super::{AdaptiveError, Whitener};

/// Diagonal loading of the estimate `S / K`, chosen by the caller.
///
/// Loading bounds the smallest eigenvalue: fewer than `2 N` snapshots then suffice. The thresholds of [`Performance`](super::Performance) hold without loading only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loading {
    /// No loading: at least `2 N` snapshots are required, for a mean SINR loss of about 3 dB (RMB 1974).
    Off,
    /// Level in units of a snapshot's power, for example the noise power per element. Finite and above 0.
    Absolute(f64),
    /// Fraction of the mean diagonal element of `S / K`, finite and above 0. A positive definite result needs about 1e-12 or more.
    Relative(f64),
}

/// Running sum `S = sum_k x_k x_k^H` of `K` snapshots of `N` degrees of freedom, in float64.
///
/// A sliding window adds the snapshot that enters and subtracts the one that leaves. Each of both leaves a rounding error of about 1e-16 of the power in the sum: start anew with [`Covariance::clear`]
/// where the clutter power falls by more than about 100 dB.
///
/// **Cost**: `N (N + 1) / 2` complex products a snapshot and as many stored values.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    degrees_of_freedom: usize,
    snapshots: usize,
    /// Lower triangle, row by row.
    lower: Vec<Complex64>,
}

impl Covariance {
    /// Sum of no snapshots, for vectors of `degrees_of_freedom` elements.
    ///
    /// # Panics
    /// If `degrees_of_freedom` is 0.
    pub fn new(degrees_of_freedom: usize) -> Self {
        assert!(
            degrees_of_freedom > 0,
            "expected at least one degree of freedom"
        );
        Self {
            degrees_of_freedom,
            snapshots: 0,
            lower: vec![Complex64::ZERO; triangle(degrees_of_freedom)],
        }
    }

    /// Number of snapshots `K` in the sum.
    pub fn snapshots(&self) -> usize {
        self.snapshots
    }

    pub(super) fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// Remove all snapshots and keep the memory.
    pub fn clear(&mut self) {
        self.snapshots = 0;
        self.lower.fill(Complex64::ZERO);
    }

    /// Add a snapshot of `N` elements, float32 or float64.
    ///
    /// # Panics
    /// If the snapshot does not have `N` elements.
    pub fn add<T: Copy + Into<f64>>(&mut self, snapshot: &[Complex<T>]) {
        self.accumulate(snapshot, 1.0);
        self.snapshots += 1;
    }

    /// Subtract a snapshot that was added before.
    ///
    /// # Panics
    /// If the snapshot does not have `N` elements or the sum has no snapshots.
    pub fn subtract<T: Copy + Into<f64>>(&mut self, snapshot: &[Complex<T>]) {
        assert!(
            self.snapshots > 0,
            "expected a snapshot that was added before"
        );
        self.accumulate(snapshot, -1.0);
        self.snapshots -= 1;
    }

    fn accumulate<T: Copy + Into<f64>>(&mut self, snapshot: &[Complex<T>], sign: f64) {
        assert_eq!(snapshot.len(), self.degrees_of_freedom);
        let mut lower = self.lower.iter_mut();
        for (i, &own) in snapshot.iter().enumerate() {
            let own = widen(own) * sign;
            for (&other, sum) in snapshot[..=i].iter().zip(lower.by_ref().take(i + 1)) {
                *sum += own * widen(other).conj();
            }
        }
    }

    /// Cholesky factor of `S + K d I`, with `d` the level of the diagonal loading.
    ///
    /// # Errors
    /// [`AdaptiveError::Snapshots`] if `K < 2 N` and the caller chose no loading, or without any snapshot. [`AdaptiveError::Loading`] if the level is not finite and above 0.
    /// [`AdaptiveError::NotPositiveDefinite`] if elimination leaves a pivot below 1e-14 of its diagonal element.
    pub fn factor(&self, loading: Loading) -> Result<Whitener, AdaptiveError> {
        let mut whitener = Whitener::identity(self.degrees_of_freedom);
        self.factor_into(loading, &mut whitener)?;
        Ok(whitener)
    }

    /// [`Covariance::factor`] without allocation. After [`AdaptiveError::NotPositiveDefinite`] the whitener is invalid.
    pub(super) fn factor_into(
        &self,
        loading: Loading,
        whitener: &mut Whitener,
    ) -> Result<(), AdaptiveError> {
        let required = match loading {
            Loading::Off => 2 * self.degrees_of_freedom,
            Loading::Absolute(_) | Loading::Relative(_) => 1,
        };
        if self.snapshots < required {
            return Err(AdaptiveError::Snapshots {
                snapshots: self.snapshots,
                degrees_of_freedom: self.degrees_of_freedom,
                required,
            });
        }
        let added = match loading {
            Loading::Off => 0.0,
            Loading::Absolute(level) => checked(level)? * self.snapshots as f64,
            Loading::Relative(level) => checked(level)? * self.mean_diagonal(),
        };
        whitener.factor(&self.lower, added)
    }

    fn mean_diagonal(&self) -> f64 {
        self.diagonal().sum::<f64>() / self.degrees_of_freedom as f64
    }
}

/// Number of elements in the lower triangle of a square matrix; the index of the first one of row `size`.
pub(super) fn triangle(size: usize) -> usize {
    size * (size + 1) / 2
}

/// Complex number in float64.
pub(crate) fn widen<T: Into<f64>>(value: Complex<T>) -> Complex64 {
    Complex64::new(value.re.into(), value.im.into())
}

fn checked(level: f64) -> Result<f64, AdaptiveError> {
    match level.is_finite() && level > 0.0 {
        true => Ok(level),
        false => Err(AdaptiveError::Loading(level)),
    }
}

impl Covariance {
    /// Replace the sum by one of `snapshots` snapshots with these `N^2` real elements: row by row of the lower triangle, real and imaginary part of each
    /// element before the diagonal, then the diagonal.
    pub(crate) fn set(&mut self, snapshots: usize, mut elements: impl Iterator<Item = f64>) {
        let mut next = || elements.next().expect("a matrix has N^2 real elements");
        self.snapshots = snapshots;
        let mut lower = self.lower.iter_mut();
        for i in 0..self.degrees_of_freedom {
            for (j, element) in lower.by_ref().take(i + 1).enumerate() {
                *element = match j == i {
                    true => next().into(),
                    false => Complex64::new(next(), next()),
                };
            }
        }
    }

    /// Diagonal of the sum, element by element.
    pub(super) fn diagonal(&self) -> impl Iterator<Item = f64> {
        (0..self.degrees_of_freedom).map(|i| self.lower[triangle(i) + i].re)
    }
}
