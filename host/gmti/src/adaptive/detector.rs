//! Detection statistics of a cell over a grid of steering vectors.

use num_complex::{Complex, Complex64};

use super::whitener::{power, product};
use super::{AdaptiveError, Covariance, Loading, Whitener};

/// Detection statistic; `S` is the sum of the outer products of the training snapshots, `R` a known covariance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Statistic {
    /// Filter matched to a known covariance: `|s^H R^-1 x|^2 / (s^H R^-1 s)`, exponential of mean 1 in clutter.
    MatchedFilter,
    /// Adaptive matched filter (Robey et al. 1992): `|s^H S^-1 x|^2 / (s^H S^-1 s)`, 0 or more.
    Amf,
    /// Generalised likelihood ratio test (Kelly 1986): `AMF / (1 + x^H S^-1 x)`, 0 to 1.
    Kelly,
    /// Adaptive coherence (cosine) estimator: `AMF / (x^H S^-1 x)`, 0 to 1, independent of the scale of `x`.
    Ace,
}

impl Statistic {
    /// Value from that of the matched filter and the form `x^H S^-1 x`. Both rise together, so one steering vector has the maximum of all statistics.
    fn value(self, matched: f64, energy: f64) -> f64 {
        match self {
            Self::MatchedFilter | Self::Amf => matched,
            Self::Kelly => matched / (1.0 + energy),
            Self::Ace if energy == 0.0 => 0.0,
            Self::Ace => matched / energy,
        }
    }
}

/// Largest statistic of a cell over the grid of steering vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Value of the statistic, without unit; NaN or minus infinity if the cell is not finite, hence below every threshold.
    pub value: f64,
    /// Index of the steering vector, from 0; the first of equal ones.
    pub index: usize,
}

/// Evaluator of cells for a grid of `M` steering vectors, for example one per radial velocity.
///
/// **Cost**: [`Detector::train`] takes `N^3 / 6` complex products, the first cell evaluated after it `M N^2 / 2`, each cell `N^2 / 2 + M N`, and an energy `N^2 / 2`. They do not allocate. Threads use clones.
#[derive(Clone, Debug)]
pub struct Detector {
    whitener: Whitener,
    /// Steering vectors as given, vector by vector.
    steering: Vec<Complex64>,
    /// Whitened steering vectors of norm 1.
    normalised: Vec<Complex64>,
    /// Whether the covariance has changed since the steering vectors were whitened.
    normalised_is_old: bool,
    /// Whitened cell under test.
    cell: Vec<Complex64>,
}

impl Detector {
    /// Detector for a covariance, with `steering` of `M` vectors of `N` elements, vector by vector. Their norms do not matter.
    ///
    /// # Errors
    /// [`AdaptiveError::Steering`].
    pub fn new(whitener: Whitener, steering: &[Complex64]) -> Result<Self, AdaptiveError> {
        let size = whitener.size();
        let valid = |vector: &[Complex64]| {
            let power = power(vector);
            vector.len() == size && power > 0.0 && power.is_finite()
        };
        let invalid = steering.chunks(size).position(|vector| !valid(vector));
        if invalid.is_some() || steering.is_empty() {
            return Err(AdaptiveError::Steering {
                degrees_of_freedom: size,
                elements: steering.len(),
                invalid: invalid.unwrap_or(0),
            });
        }
        let mut detector = Self {
            whitener,
            steering: steering.to_vec(),
            normalised: steering.to_vec(),
            normalised_is_old: true,
            cell: vec![Complex64::ZERO; size],
        };
        detector.normalise();
        Ok(detector)
    }

    /// Replace the covariance by the sum of training snapshots. No allocation.
    ///
    /// # Errors
    /// Those of [`Covariance::factor`]. Statistics are then NaN or minus infinity, below every threshold, until training succeeds.
    ///
    /// # Panics
    /// If the degrees of freedom of the covariance are not those of the detector.
    pub fn train(
        &mut self,
        covariance: &Covariance,
        loading: Loading,
    ) -> Result<(), AdaptiveError> {
        assert_eq!(covariance.degrees_of_freedom(), self.whitener.size());
        let trained = covariance.factor_into(loading, &mut self.whitener);
        // The steering vectors are whitened when a cell is evaluated.
        self.normalised_is_old = trained.is_ok();
        if trained.is_err() {
            self.normalised.fill(Complex64::new(f64::NAN, f64::NAN));
        }
        trained
    }

    /// Least ratio of a pivot to its diagonal element in the factor of `covariance`, to which the detector was trained.
    pub(crate) fn least_pivot(&self, covariance: &Covariance) -> f64 {
        self.whitener.least_pivot(covariance.diagonal())
    }

    /// Energy `x^H S^-1 x` of a cell of `N` elements, at least its AMF for any steering vector. No allocation.
    ///
    /// # Panics
    /// If the cell does not have `N` elements.
    pub fn energy<T: Copy + Into<f64>>(&mut self, cell: &[Complex<T>]) -> f64 {
        self.whitener.whiten(cell, &mut self.cell);
        power(&self.cell)
    }

    fn normalise(&mut self) {
        self.normalised_is_old = false;
        let size = self.whitener.size();
        let vectors = self.steering.chunks_exact(size);
        for (vector, normalised) in vectors.zip(self.normalised.chunks_exact_mut(size)) {
            self.whitener.whiten(vector, normalised);
            let scale = 1.0 / power(normalised).sqrt();
            normalised.iter_mut().for_each(|value| *value *= scale);
        }
    }

    /// Evaluate a statistic of a cell of `N` elements: the maximum over the steering vectors. No allocation.
    ///
    /// # Panics
    /// If the cell does not have `N` elements.
    pub fn evaluate<T: Copy + Into<f64>>(
        &mut self,
        statistic: Statistic,
        cell: &[Complex<T>],
    ) -> Peak {
        if self.normalised_is_old {
            self.normalise();
        }
        self.whitener.whiten(cell, &mut self.cell);
        let mut matched = f64::NEG_INFINITY;
        let mut index = 0;
        let vectors = self.normalised.chunks_exact(self.whitener.size());
        for (i, vector) in vectors.enumerate() {
            let value = product(vector, &self.cell).norm_sqr();
            if value > matched {
                (matched, index) = (value, i);
            }
        }
        let value = statistic.value(matched, power(&self.cell));
        Peak { value, index }
    }
}
