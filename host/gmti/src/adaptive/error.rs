//! Errors of adaptive detection.

/// Reason why training, steering vectors or a detection problem are refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AdaptiveError {
    /// The number of training snapshots is too small for the degrees of freedom.
    #[error(
        "covariance: expected at least {required} training snapshots for {degrees_of_freedom} degrees of freedom, found {snapshots}: train on more cells, use fewer degrees of freedom or choose a diagonal loading"
    )]
    Snapshots {
        /// Number of snapshots `K` in the sum.
        snapshots: usize,
        /// Degrees of freedom `N` of a snapshot.
        degrees_of_freedom: usize,
        /// Smallest accepted number of snapshots: `2 N` without diagonal loading, 1 with it.
        required: usize,
    },
    /// The covariance matrix is singular, indefinite or not finite.
    #[error(
        "covariance: expected a positive definite matrix, found pivot {pivot:e} at row {row}: check the samples for linear dependence and values that are not finite, or choose a diagonal loading"
    )]
    NotPositiveDefinite {
        /// Row of the first invalid pivot, from 0.
        row: usize,
        /// Value of the pivot, in units of power.
        pivot: f64,
    },
    /// The level of the diagonal loading is invalid.
    #[error(
        "diagonal loading: expected a finite level above 0, found {0}: use Loading::Off for no loading"
    )]
    Loading(f64),
    /// The steering vectors do not form a grid of whole, finite, nonzero vectors.
    #[error(
        "steering vectors: expected one or more finite nonzero vectors of {degrees_of_freedom} elements, found {elements} elements, vector {invalid} being invalid"
    )]
    Steering {
        /// Degrees of freedom `N` of the covariance.
        degrees_of_freedom: usize,
        /// Number of elements given.
        elements: usize,
        /// Index of the first invalid or incomplete vector, from 0.
        invalid: usize,
    },
    /// The statistic has no threshold for these numbers.
    #[error(
        "detection performance: expected {least} or more degrees of freedom and as many snapshots or more, found {degrees_of_freedom} degrees of freedom and {snapshots} snapshots: train on more cells or choose another statistic"
    )]
    Training {
        /// Smallest number of degrees of freedom of the statistic: 2 for ACE, otherwise 1.
        least: usize,
        /// Degrees of freedom `N` given.
        degrees_of_freedom: usize,
        /// Number of snapshots `K` given.
        snapshots: usize,
    },
    /// The false-alarm probability is out of range.
    #[error("false-alarm probability: expected a value above 0 and below 1, found {0}")]
    Probability(f64),
}
