//! Leakage from antenna to antenna as the phase reference: two receivers with a common random phase at each carrier.
//!
//! **Model.** At carrier `f_n`, both receivers have the same random phase. They receive the direct wave with a known
//! short delay, and then the echoes:
//!
//! ```text
//! z_i(f_n) = exp(j phi_n) (L_i l_i(f_n) + S_i(f_n)),     l_i(f) = exp(-j 2 pi f tau_i), or its calibrated response
//! ```
//!
//! **Why the phase of channel 0 is not enough.** With a small `s = S_0 / (L_0 l_0)`, the phase of `z_0` is that of the
//! leakage plus `phi + Im s`. Rotating either receiver by it leaves `1 + s - j Im s = 1 + (s + s*) / 2`: half of the
//! scene in its place, 6 dB down, and an equally strong conjugate, a mirror image about the leakage.
//!
//! **Method.** The phases are estimated together with the echoes. The echoes arrive after the leakage, with additional
//! delays corresponding to ranges from `nearest` to `reach`. They are modelled as equally strong on average at all
//! delays in between. Their covariance `K` over carriers is then that of [`super::gaps`], with noise `e` of 1e-4 of
//! their power. The leakage amplitude `L_i` is free. The phases of maximum likelihood minimise
//!
//! ```text
//! sum_i a_i^H Q_i a_i,   a_i = exp(-j phi) z_i,   Q = P - P l l^H P / (l^H P l),   P = (K + e I)^-1
//! ```
//!
//! The iteration starts at `phi = arg z_0 - arg l_0`. Eight alternations compute the responses from the phases (`a - e
//! Q a`) and the phases from the responses. Each halves the error, because the mirrored half lies outside the support
//! of echoes and is rejected. Damped Gauss-Newton steps follow until the sum no longer decreases.
//!
//! **Requirements.**
//! - Echoes within less than half of the unambiguous range beyond the leakage, since the mirror image occupies the
//!   other half. A larger reach is refused. To first order a second receiver adds no information, since phase errors
//!   are common to both.
//! - Leakage at least 3 dB above all echoes together (RMS over carriers). Above this, each of 300 random scenes of 1 to
//!   7 echoes converged to the true phases; at 0 dB two of eighteen failed. A weaker estimated leakage is refused.
//! - Echoes at least two resolution cells beyond the leakage. Nearer ones are attributed to the leakage.
//!
//! Accuracy: with a signal-to-noise ratio of 40 dB in each carrier, the errors of the responses are -27 to -40 dB
//! relative to the echoes, with a median of -35 dB. They come from noise and its leakage through the band edges. Tested
//! in `tests/leakage.rs`.
//!
//! **Refused** is also a sweep whose unexplained power exceeds a twentieth of the echoes' power plus three times the
//! noise estimated from the scatter within bursts. Causes are echoes beyond the reach, or a leakage with another delay.
//!
//! Cost, for `k` known carriers: `k^3 / 2` products once per pattern of missing carriers, then about six times `k^3 /
//! 6` per sweep; below 4 ms for 150 carriers, mixing included. Memory: four `k` x `k` matrices of float64, 32 MiB at
//! the maximum of 1024 carriers.

mod path;
mod phases;

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;

use super::error::ProfileError;
use super::sweep::{Steps, Sweep};
use phases::Phases;

pub use path::Leakage;

/// Largest range of echoes beyond the leakage, as a fraction of the unambiguous range.
pub const MAX_REACH: f64 = 0.48;
/// Smallest distance between leakage and echoes, in resolution cells.
const NEAREST_CELLS: f64 = 2.0;
/// Maximum number of carriers.
pub const MAX_CARRIERS: usize = 1024;
/// Minimum number of carriers.
const MIN_CARRIERS: usize = 8;
/// Smallest ratio of leakage power to echo power.
const MIN_RATIO: f64 = 2.0;
/// Tolerance on unexplained power: fraction of the echoes' power, and multiple of the noise power.
const UNEXPLAINED: (f64, f64) = (0.05, 3.0);

/// Responses and leakage estimated for a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Echoes divided by the leakage, for each receiver, with delays from the transmitter: a path of length `d` has the
    /// phase `exp(-j 2 pi f d / c)`.
    pub sweeps: [Sweep; 2],
    /// Amplitude of the leakage in each receiver relative to [`Leakage::shapes`], up to a common phase.
    pub amplitudes: [Complex64; 2],
    /// Ratio of leakage power to echo power.
    pub over_echoes: f64,
    /// Ratio of unexplained power to echo power.
    pub unexplained: f64,
}

/// Phase estimator for sweeps with the same carriers.
#[derive(Debug)]
pub struct Solver {
    leakage: Leakage,
    reach_m: f64,
    phases: Option<Phases>,
}

impl Solver {
    /// Make a solver for echoes up to a range of `reach_m` beyond the direct wave.
    ///
    /// # Errors
    /// If `reach_m` does not allow echoes to be separated from their mirror images with carriers `step_hz` apart, or if
    /// there are too few or too many carriers.
    pub fn new(
        leakage: Leakage,
        step_hz: f64,
        steps: usize,
        reach_m: f64,
    ) -> Result<Self, ProfileError> {
        if !(MIN_CARRIERS..=MAX_CARRIERS).contains(&steps) {
            return Err(ProfileError::Options(format!(
                "{steps} carriers: expected {MIN_CARRIERS} to {MAX_CARRIERS} with a leakage reference"
            )));
        }
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz);
        let (least_m, most_m) = (
            (NEAREST_CELLS + 1.0) * unambiguous_m / steps as f64,
            MAX_REACH * unambiguous_m,
        );
        if !(reach_m >= least_m && reach_m <= most_m) {
            return Err(ProfileError::Options(format!(
                "reach of {reach_m} m: expected {least_m:.2} m to {most_m:.2} m with a leakage reference, since echoes beyond half of the unambiguous range of \
                 {unambiguous_m:.2} m cannot be separated from mirror images. Use more carriers with a smaller step"
            )));
        }
        Ok(Self {
            leakage,
            reach_m,
            phases: None,
        })
    }

    /// Estimate the phases of a sweep, and the responses of both receivers.
    ///
    /// # Errors
    /// If there are too few carriers, the leakage is too weak, or the echoes are not explained by the model.
    pub fn solve(&mut self, steps: &Steps) -> Result<Found, ProfileError> {
        let [mut first, mut second] = [steps.empty_sweep(), steps.empty_sweep()];
        let known: Vec<usize> = (0..steps.mixed.len())
            .filter(|&n| steps.mixed[n].is_some())
            .collect();
        if 3 * known.len() < 2 * steps.mixed.len() || known.len() < MIN_CARRIERS {
            return Err(ProfileError::TooFew {
                left: known.len(),
                steps: steps.mixed.len(),
            });
        }
        let frequencies_hz: Vec<f64> = known.iter().map(|&n| first.frequency_hz(n)).collect();
        let phases = match self.phases.take().filter(|it| it.known == known) {
            Some(phases) => phases,
            None => {
                let cell_m = SPEED_OF_LIGHT_M_S / (2.0 * steps.step_hz * steps.mixed.len() as f64);
                let span_m = (NEAREST_CELLS * cell_m, self.reach_m);
                Phases::new(&self.leakage, steps.step_hz, known, &frequencies_hz, span_m)?
            }
        };
        let bursts = || steps.mixed.iter().flatten();
        let z = [
            bursts().map(|burst| burst.reference.into()).collect(),
            bursts()
                .map(|burst| burst.value * burst.reference)
                .collect(),
        ];
        let noise: f64 = bursts()
            .map(|burst| burst.reference.powi(2) * burst.variance)
            .sum();
        let solved = phases.solve(&z);
        let [over_echoes, unexplained] = [solved.leakage, solved.residual]
            .map(|power| power / solved.echoes.max(f64::MIN_POSITIVE));
        // Without echoes there is nothing to explain.
        let silent = solved.echoes <= UNEXPLAINED.1 * noise;
        let [first_ns, second_ns] = self.leakage.delays_s.map(|delay_s| 1e9 * delay_s);
        if over_echoes < MIN_RATIO {
            return Err(ProfileError::Leakage(format!(
                "leakage of {:.1} dB over the echoes: expected at least 3 dB for a reference. Move the antennas closer together or away from reflecting objects, or use a loopback reference; if the leakage \
                 is strong but has delays other than {first_ns:.2} ns and {second_ns:.2} ns, calibrate",
                10.0 * over_echoes.log10()
            )));
        }
        let allowed = UNEXPLAINED.0 * solved.echoes + UNEXPLAINED.1 * noise;
        if !silent && solved.residual > allowed {
            return Err(ProfileError::Leakage(format!(
                "no phases explain both receivers: {:.0} % of the echoes' power is unexplained. Echoes may come from beyond {:.1} m, or the leakage may have delays other than \
                 {first_ns:.2} ns and {second_ns:.2} ns; in that case calibrate",
                100.0 * unexplained,
                self.reach_m
            )));
        }
        for (i, sweep) in [&mut first, &mut second].into_iter().enumerate() {
            for (place, &n) in phases.known.iter().enumerate() {
                let direct = phasor(-frequencies_hz[place] * self.leakage.delays_s[i]);
                sweep.values[n] = Some(solved.over_leakage[i][place] * direct);
            }
        }
        self.phases = Some(phases);
        Ok(Found {
            sweeps: [first, second],
            amplitudes: solved.amplitudes,
            over_echoes,
            unexplained,
        })
    }
}
