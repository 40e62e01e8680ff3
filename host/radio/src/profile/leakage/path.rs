//! Leakage from the transmitter to both receivers.

use num_complex::Complex64;

/// Direct waves from the transmitter to both receivers.
#[derive(Clone, Debug, PartialEq)]
pub struct Leakage {
    /// Delay from the transmitter's to each receiver's phase centre, seconds.
    pub delays_s: [f64; 2],
    /// Calibrated frequency response of each receiver's leakage, if any: received with an empty scene, with phases such
    /// that receiver 0's response has its geometric delay.
    pub shapes: Option<[Vec<Complex64>; 2]>,
}
