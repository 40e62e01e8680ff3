//! Antenna gain over slow time, measured from a point's own echo.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use subaperture_signal::phase::phasor;

use crate::SPEED_OF_LIGHT_M_S;
use crate::monitor::Monitor;
use crate::phase_history::{PhaseHistory, ReadError};
use subaperture_signal::window::Window;

/// The averaging window has 1 / `SHARE` of the pulses; its half-power width is about half of that.
const SHARE: usize = 32;

/// Error of measuring gains.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GainsError {
    /// Pulses could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// Cancelled by the monitor.
    #[error("interrupted")]
    Cancelled,
}

/// Measure the relative gain of each pulse at a scatterer at `place_m`: magnitude of
///
/// ```text
/// e_n = sum_k w_fast[k] z[n][k] exp(+j 2 pi f_k (path_n(place) - reference_path_n) / c)
/// ```
///
/// averaged over a thirty-second of the pulses about each. The scatterer at `place_m` has the same phase in
/// every pulse and adds coherently; noise and other scatterers average out. Valid for an isolated
/// point; a beam that spans a quarter of the pulses is broadened by less than 1 %.
///
/// Cost: reads the recording once, pulse by pulse. Memory: 16 bytes per pulse.
///
/// # Errors
/// [`GainsError::Read`] if pulses cannot be read; [`GainsError::Cancelled`] if the monitor cancels.
pub fn measured_gains(
    history: &dyn PhaseHistory,
    place_m: DVec3,
    fast: Window,
    monitor: &dyn Monitor,
) -> Result<Vec<f64>, GainsError> {
    let collection = history.collection();
    let weights = fast.weights(collection.num_samples);
    let mut samples = vec![Complex32::ZERO; collection.num_samples];
    let count = collection.pulses.len();
    let mut echoes = Vec::with_capacity(count);
    for (n, pulse) in collection.pulses.iter().enumerate() {
        if n % 256 == 0 && monitor.cancelled() {
            return Err(GainsError::Cancelled);
        }
        history.read(n..n + 1, &mut samples)?;
        let turns = pulse.relative_path_m(place_m) / SPEED_OF_LIGHT_M_S;
        let turn = |hz: f64| phasor(hz * turns);
        let step = turn(pulse.step_hz);
        // Horner's rule, from the highest frequency down.
        let sum = samples
            .iter()
            .zip(&weights)
            .rev()
            .fold(Complex64::ZERO, |sum, (z, w)| {
                sum * step + Complex64::new(z.re.into(), z.im.into()) * w
            });
        echoes.push(sum * turn(pulse.start_hz));
    }
    let reach = (count / SHARE / 2).max(1) as isize;
    let kernel: Vec<f64> = (-reach..=reach)
        .map(|m| 1.0 + libm::cos(std::f64::consts::PI * m as f64 / (reach + 1) as f64))
        .collect();
    let gain = |n: usize| {
        let (mut sum, mut weight) = (Complex64::ZERO, 0.0);
        for (m, w) in (-reach..=reach).zip(&kernel) {
            if let Some(echo) = n.checked_add_signed(m).and_then(|at| echoes.get(at)) {
                sum += echo * w;
                weight += w;
            }
        }
        (sum / weight).norm_sqr().sqrt()
    };
    Ok((0..count).map(gain).collect())
}
