//! Range profiles without the blur of motion from sample to sample, in even steps of it.

use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::Meaning;
use crate::Aim;
use crate::sweep::{self, places};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::phase::phasor32;

/// Profiles a pulse that no motion from sample to sample needs.
const MOST_BLURS: usize = 1 << 20;

/// Even steps of the phase `q (K/2)^2`, turns at the band's edge, that motion from sample to sample leaves.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Blurs {
    num_samples: usize,
    least_turns: f64,
    step_turns: f64,
    pub(super) count: usize,
}

impl Blurs {
    /// For all pulses and points of a grid, so fine that reading between the steps errs by `error_db`; and the relative RMS
    /// error that is left, of the steps and of what is no parabola.
    pub(super) fn new(aim: &Aim, error_db: f64, meaning: Meaning) -> (Self, f64) {
        let collection = aim.collection;
        let error;
        let mut blurs = Self {
            num_samples: collection.num_samples,
            least_turns: 0.0,
            step_turns: 0.0,
            count: 1,
        };
        // Smooth over the grid, so its extremes are near those of 9 x 9 points, or of its edges.
        let points: Vec<DVec3> = places(aim.grid, 9).collect();
        let of_pulse = |pulse: &Pulse| {
            let reference = pulse.reference_terms();
            let turns = points.iter().map(|&point| {
                let (at, velocity_m_s) = meaning.target(pulse, point);
                blurs.turns(pulse, &(pulse.path_terms(at, velocity_m_s) - reference))
            });
            turns.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
                (low.min(q), high.max(q))
            })
        };
        let (low, high) = collection.pulses.par_iter().map(of_pulse).reduce(
            || (f64::INFINITY, f64::NEG_INFINITY),
            |a, b| (a.0.min(b.0), a.1.max(b.1)),
        );
        let margin = 0.05 * (high - low);
        let span = high - low + 2.0 * margin;
        let allowed = libm::pow(10.0, error_db / 20.0);
        let most_rad = (allowed * 120f64.sqrt()).sqrt();
        // A single profile, halfway, errs by its distance from the halfway.
        if TAU * span / 2.0 <= allowed {
            blurs.least_turns = 0.5 * (low + high);
            error = TAU * span / 2.0;
        } else {
            let steps = (TAU * span / most_rad).ceil().clamp(1.0, 1e9);
            blurs.count = steps as usize + 1;
            blurs.least_turns = low - margin;
            blurs.step_turns = span / steps;
            error = (TAU * blurs.step_turns).powi(2) / 120f64.sqrt();
        }
        let cubic = sweep::worst(collection, aim.grid, |pulse, point, after| {
            let (at, velocity_m_s) = meaning.target(pulse, point);
            let moved_m = velocity_m_s * (after * pulse.sweep.sample_s);
            let path_m = pulse.path_after_m(at + moved_m, after) - pulse.reference_drift_m(after);
            let terms = pulse.path_terms(at, velocity_m_s) - pulse.reference_terms();
            let frequency_hz =
                pulse.start_hz + (after + (collection.num_samples / 2) as f64) * pulse.step_hz;
            let centre_hz = pulse.frequency_hz(collection.num_samples / 2);
            let modelled = centre_hz * terms.path_m
                + after * (pulse.step_hz * terms.path_m + centre_hz * terms.rate_m)
                + after * after * (pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m);
            (frequency_hz * (path_m - pulse.reference_path_m) - modelled) / SPEED_OF_LIGHT_M_S
        });
        (blurs, libm::hypot(error, cubic))
    }

    /// Whether a decision for pulses of so many samples could have come to this.
    pub(super) fn suit(&self, num_samples: usize) -> bool {
        let steps = self.least_turns.is_finite() && self.step_turns.is_finite();
        steps && (1..=MOST_BLURS).contains(&self.count) && self.num_samples == num_samples
    }

    /// `q (K/2)^2`.
    pub(super) fn turns(&self, pulse: &Pulse, terms: &PathTerms) -> f64 {
        let half = (self.num_samples / 2) as f64;
        let centre_hz = pulse.start_hz + half * pulse.step_hz;
        let q = pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m;
        q / SPEED_OF_LIGHT_M_S * half * half
    }

    /// The place of a phase among the profiles.
    pub(super) fn level(&self, turns: f64) -> f64 {
        match self.count {
            1 => 0.0,
            _ => ((turns - self.least_turns) / self.step_turns).max(0.0),
        }
    }

    /// A pulse without the blur of a level.
    pub(super) fn sharpen(&self, level: usize, pulse: &[Complex32], row: &mut [Complex32]) {
        let turns = self.least_turns + level as f64 * self.step_turns;
        let half = (self.num_samples / 2).max(1) as f64;
        for (k, (out, z)) in row.iter_mut().zip(pulse).enumerate() {
            let x = (k as f64 - (self.num_samples / 2) as f64) / half;
            *out = z * phasor32(turns * x * x);
        }
    }
}
