//! Smallest pivot of factorisations.

/// Smallest pivot of a factorisation, relative to the diagonal: a smaller one is rounding of some 15 terms.
pub(super) const MIN_PIVOT: f64 = 1e-14;
