//! Phases of a point.

use glam::DVec3;
use num_complex::Complex64;
use subaperture_model::phase_history::Pulse;
use subaperture_model::resolution::support::path_gradient;

/// Smallest variance of a phase, radians squared: geometry and range cells leave as much.
const MIN_VARIANCE: f64 = 1e-4;
/// Residual, in standard deviations, at which a weight is halved (Cauchy, 95 % efficient).
const HALVED_AT: f64 = 2.385;

/// History with its geometry.
#[derive(Clone)]
pub(crate) struct Sighted<'a> {
    /// Index of the point.
    pub(crate) point: usize,
    /// Assumed position of the point, metres.
    pub(crate) place_m: DVec3,
    /// Pulses with the recorded antennas.
    pub(crate) pulses: &'a [Pulse],
    /// Wavenumber of each pulse, radians per metre of path.
    pub(crate) wavenumbers: Vec<f64>,
    /// Values, one per turn.
    pub(crate) values: Vec<Complex64>,
    /// Power of noise and other scatterers.
    pub(crate) rest: f64,
}

impl Sighted<'_> {
    /// Variance of the phase in turn `n`.
    pub(super) fn variance(&self, n: usize) -> f64 {
        let power = self.values[n].norm_sqr();
        MIN_VARIANCE + 0.5 * self.rest / power.max(1e-3 * self.rest)
    }

    /// Model phase of turn `n`, radians, for a point displaced by `off_m` and antennas displaced by `moved_m`.
    pub(super) fn model(&self, n: usize, moved_m: DVec3, off_m: DVec3) -> f64 {
        let pulse = &self.pulses[n];
        // The path from displaced antennas is that to the point displaced in the opposite direction.
        let there_m = self.place_m + off_m - moved_m;
        -self.wavenumbers[n] * (pulse.path_m(there_m) - pulse.path_m(self.place_m))
    }

    /// Derivatives of the phase by the displacement along both axes, radians per metre.
    pub(super) fn slopes(
        &self,
        n: usize,
        axes: [DVec3; 2],
        moved_m: DVec3,
        off_m: DVec3,
    ) -> [f64; 2] {
        let pulse = &self.pulses[n];
        let there_m = self.place_m + off_m - moved_m;
        let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, there_m);
        axes.map(|axis| self.wavenumbers[n] * gradient.dot(axis))
    }
}

/// Weight of a residual (Cauchy).
pub(super) fn cauchy(residual: f64, variance: f64) -> f64 {
    1.0 / (1.0 + residual * residual / (variance * HALVED_AT * HALVED_AT))
}
