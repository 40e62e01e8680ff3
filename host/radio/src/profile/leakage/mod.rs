//! The leakage from antenna to antenna as the reference: two receivers, one phase of the synthesisers at each carrier.
//!
//! **Model.** At carrier `f_n` both receivers see one random phase, the transmitter directly after a known short delay, and echoes after it:
//!
//! ```text
//! z_i(f_n) = exp(j phi_n) (L_i l_i(f_n) + S_i(f_n)),     l_i(f) = exp(-j 2 pi f tau_i), or as it was calibrated
//! ```
//!
//! **Why not the phase of channel 0.** With `s = S_0 / (L_0 l_0)`, small, the phase of `z_0` is `phi` and that of the leakage and `Im s`. Turned back by it, there is
//! left, of either receiver, `1 + s - j Im s = 1 + (s + s*) / 2`: half of the scene is where it belongs, 6 dB down, and the other half, as strong, is its
//! conjugate, mirrored about the leakage.
//!
//! **Remedy.** Phases are found with the echoes, by what is known of these: they come later than the leakage, by what ways of
//! `nearest` to `reach` more take. Alike strong on the mean at any delay between, their covariance `K` over carriers is that of
//! [`super::gaps`], with the noise `e`, 1e-4 of them; the leakage's amplitude `L_i` is free. The likelihood of phases is then greatest where
//!
//! ```text
//! sum_i a_i^H Q_i a_i,   a_i = exp(-j phi) z_i,   Q = P - P l l^H P / (l^H P l),   P = (K + e I)^-1
//! ```
//!
//! is least. From `phi = arg z_0 - arg l_0`, eight times in turn responses by phases (`a - e Q a`) and phases by responses, each of which halves what is off (the mirrored half is
//! beyond what echoes can be, and is left out); then Gauss and Newton's steps, damped, until none makes it less.
//!
//! **What it takes.**
//! - Echoes within less than half of the unambiguous range beyond the leakage: what is mirrored falls into the other half. More is refused. To first order two
//!   receivers tell no more than one: errors of phase are the same for both.
//! - Leakage 3 dB over all echoes together (RMS over carriers). From there on every one of 300 random scenes of 1 to 7 echoes came to its phases; at 0 dB
//!   two of eighteen did not. What is found to have less is refused.
//! - Echoes two resolution cells beyond the leakage at the least: nearer ones are taken for a part of it.
//!
//! Accuracy: at 40 dB over noise in each carrier, errors of the responses are -27 to -40 dB of the echoes, -35 on the median: noise, and what of it the
//! edges of the band let through. `tests/leakage.rs` holds it.
//!
//! **Refused** is besides what leaves more than a twentieth of the echoes' power, and three times what scatter within bursts says of noise, unexplained: echoes from beyond the
//! reach, or a leakage that is elsewhere.
//!
//! Cost: for `k` carriers that are there `k^3 / 2` products once for each pattern of missing ones, then some six times `k^3 / 6` a sweep: below 4 ms for
//! 150, mixing included. Memory: four matrices of `k^2` float64, 32 MiB for 1024, the most.

mod phases;

use num_complex::Complex64;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_signal::phase::phasor;

use super::error::ProfileError;
use super::sweep::{Steps, Sweep};
use phases::Phases;

/// Part of the unambiguous range within which echoes have to lie beyond the leakage.
pub const MOST_REACH: f64 = 0.48;
/// Cells of resolution between the leakage and the nearest echo.
const NEAREST_CELLS: f64 = 2.0;
/// Carriers that phases are found for, at the most.
pub const MOST_CARRIERS: usize = 1024;
/// Carriers at the least.
const LEAST_CARRIERS: usize = 8;
/// Leakage over echoes, of powers, at the least.
const LEAST_RATIO: f64 = 2.0;
/// Part of the echoes' power that may be left, and how often the noise's.
const UNEXPLAINED: (f64, f64) = (0.05, 3.0);

/// The direct ways, as they are known.
#[derive(Clone, Debug, PartialEq)]
pub struct Leakage {
    /// From the transmitter's phase centre to each receiver's, seconds.
    pub delays_s: [f64; 2],
    /// Of each receiver at each carrier, if it was calibrated: what was heard with nothing to reflect, of phases such that receiver 0's is its delay's.
    pub shapes: Option<[Vec<Complex64>; 2]>,
}

/// What a sweep came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Of each receiver: echoes over the leakage, referred to the delay of the direct way, so that a path of `d` reads `exp(-j 2 pi f d / c)`.
    pub sweeps: [Sweep; 2],
    /// Amplitude of the leakage in each, over [`Leakage::shapes`], but for one phase of both.
    pub amplitudes: [Complex64; 2],
    /// Power of the leakage over that of echoes.
    pub over_echoes: f64,
    /// What neither phases, leakage nor echoes explain, of the echoes' power.
    pub unexplained: f64,
}

/// Finds phases of sweeps of one set of carriers.
#[derive(Debug)]
pub struct Solver {
    leakage: Leakage,
    reach_m: f64,
    phases: Option<Phases>,
}

impl Solver {
    /// For echoes up to `reach_m` (half a way) beyond the direct way.
    ///
    /// # Errors
    /// If carriers `step_hz` apart do not tell echoes from their mirror images there; if there are too few or too many.
    pub fn new(
        leakage: Leakage,
        step_hz: f64,
        steps: usize,
        reach_m: f64,
    ) -> Result<Self, ProfileError> {
        if !(LEAST_CARRIERS..=MOST_CARRIERS).contains(&steps) {
            return Err(ProfileError::Options(format!(
                "{steps} carriers; with the leakage as the reference there are {LEAST_CARRIERS} to {MOST_CARRIERS}"
            )));
        }
        let unambiguous_m = SPEED_OF_LIGHT_M_S / (2.0 * step_hz);
        let (least_m, most_m) = (
            (NEAREST_CELLS + 1.0) * unambiguous_m / steps as f64,
            MOST_REACH * unambiguous_m,
        );
        if !(reach_m >= least_m && reach_m <= most_m) {
            return Err(ProfileError::Options(format!(
                "a reach of {reach_m} m; with the leakage as the reference it is {least_m:.2} m to {most_m:.2} m, for echoes from beyond half of the unambiguous \
                 {unambiguous_m:.2} m look as mirrored ones do: take more carriers, closer together"
            )));
        }
        Ok(Self {
            leakage,
            reach_m,
            phases: None,
        })
    }

    /// Finds a sweep's phases, and the echoes of both receivers.
    ///
    /// # Errors
    /// Too few carriers; a leakage that is too weak; echoes that are not explained.
    pub fn solve(&mut self, steps: &Steps) -> Result<Found, ProfileError> {
        let [mut first, mut second] = [steps.empty_sweep(), steps.empty_sweep()];
        let known: Vec<usize> = (0..steps.mixed.len())
            .filter(|&n| steps.mixed[n].is_some())
            .collect();
        if 3 * known.len() < 2 * steps.mixed.len() || known.len() < LEAST_CARRIERS {
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
        // Of no echoes at all there is nothing to be wrong.
        let silent = solved.echoes <= UNEXPLAINED.1 * noise;
        let [first_ns, second_ns] = self.leakage.delays_s.map(|delay_s| 1e9 * delay_s);
        if over_echoes < LEAST_RATIO {
            return Err(ProfileError::Leakage(format!(
                "the leakage is {:.1} dB over the echoes, and takes 3 dB to be a reference: move the antennas closer together, away from what reflects, or take a loop; if it \
                 is strong but not at {first_ns:.2} ns and {second_ns:.2} ns, calibrate",
                10.0 * over_echoes.log10()
            )));
        }
        let allowed = UNEXPLAINED.0 * solved.echoes + UNEXPLAINED.1 * noise;
        if !silent && solved.residual > allowed {
            return Err(ProfileError::Leakage(format!(
                "no phases explain both receivers: {:.0} % of the echoes' power is left over. Are there echoes from beyond {:.1} m, or is the leakage not at \
                 {first_ns:.2} ns and {second_ns:.2} ns, so that it wants calibrating?",
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
