//! Range profiles compensated for intra-pulse motion at evenly spaced rates.

use std::borrow::Borrow;
use std::f64::consts::TAU;

use glam::DVec3;
use num_complex::Complex32;
use rayon::prelude::*;

use super::GridPoints;
use super::parts::{MAX_PARTS, PulseParts};
use crate::ImageSpec;
use crate::sweep::{self, places};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{PathTerms, Pulse};
use subaperture_signal::phase::phasor32;

/// Largest number of profiles per pulse; any plausible intra-pulse motion needs fewer.
const MAX_BLURS: usize = 1 << 20;

/// Part of a pulse and its regression of the cubic phase, samples squared.
struct PulsePart(Pulse, f64);

impl Borrow<Pulse> for PulsePart {
    fn borrow(&self) -> &Pulse {
        &self.0
    }
}

/// Even steps of the quadratic phase `q (K/2)^2` from intra-pulse motion, turns at the band edge, for the parts of pulses.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Blurs {
    /// Parts of a pulse.
    pub(super) parts: usize,
    /// Samples of a part, `K`.
    num_samples: usize,
    least_turns: f64,
    step_turns: f64,
    pub(super) count: usize,
}

impl Blurs {
    /// Choose steps for all pulses, divided into `parts`, and all grid points that keep the interpolation error within `error_db`. Return them with
    /// the relative RMS errors of the steps and of the phase terms that are neglected.
    pub(super) fn new(
        spec: &ImageSpec,
        parts: &PulseParts,
        error_db: f64,
        grid_points: GridPoints,
    ) -> (Self, [f64; 2]) {
        let collection = spec.collection;
        let error;
        let mut blurs = Self {
            parts: parts.count(),
            num_samples: parts.width(),
            least_turns: 0.0,
            step_turns: 0.0,
            count: 1,
        };
        // The phase is smooth over the grid: its extremes are near those of 9 x 9 points, or of the grid edges.
        let points: Vec<DVec3> = places(spec.grid, 9).collect();
        let of_part = |pulse: &Pulse| {
            let reference = pulse.reference_terms();
            let turns = points.iter().map(|&point| {
                let (at, velocity_m_s) = grid_points.target(pulse, point);
                blurs.turns(pulse, &(pulse.path_terms(at, velocity_m_s) - reference))
            });
            turns.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
                (low.min(q), high.max(q))
            })
        };
        let none = || (f64::INFINITY, f64::NEG_INFINITY);
        let both = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let of_pulse = |pulse: &Pulse| {
            let each = (0..parts.count()).map(|part| of_part(&parts.of(pulse, part)));
            each.fold(none(), both)
        };
        let pulses = collection.pulses.par_iter();
        let (low, high) = pulses.map(of_pulse).reduce(none, both);
        let margin = 0.05 * (high - low);
        let span = high - low + 2.0 * margin;
        let allowed = libm::pow(10.0, error_db / 20.0);
        let most_rad = (allowed * 120f64.sqrt()).sqrt();
        // A single profile at the midpoint errs by half the span.
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
        let seen: Vec<(PulsePart, &[f64])> = sweep::spread_pulses(collection)
            .flat_map(|pulse| {
                (0..parts.count()).map(|part| {
                    let regression = parts.regression(part);
                    (
                        PulsePart(parts.of(pulse, part), regression),
                        parts.window(part),
                    )
                })
            })
            .collect();
        let neglected = sweep::worst(
            &seen,
            spec.grid,
            |PulsePart(pulse, regression), point, after| {
                let (at, velocity_m_s) = grid_points.target(pulse, point);
                let moved_m = velocity_m_s * (after * pulse.sweep.sample_s);
                let path_m =
                    pulse.path_after_m(at + moved_m, after) - pulse.reference_drift_m(after);
                let terms = pulse.path_terms(at, velocity_m_s) - pulse.reference_terms();
                let frequency_hz =
                    pulse.start_hz + (after + (parts.width() / 2) as f64) * pulse.step_hz;
                let centre_hz = pulse.frequency_hz(parts.width() / 2);
                let shift_m = 0.5 * regression * terms.bend_m;
                let modelled = centre_hz * terms.path_m
                    + after * (pulse.step_hz * (terms.path_m + shift_m) + centre_hz * terms.rate_m)
                    + after
                        * after
                        * (pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m);
                (frequency_hz * (path_m - pulse.reference_path_m) - modelled) / SPEED_OF_LIGHT_M_S
            },
        );
        (blurs, [error, neglected])
    }

    /// Whether a plan for pulses of `num_samples` samples could contain these steps.
    pub(super) fn suit(&self, num_samples: usize) -> bool {
        let steps = self.least_turns.is_finite() && self.step_turns.is_finite();
        steps
            && (1..=MAX_BLURS).contains(&self.count)
            && (1..=MAX_PARTS).contains(&self.parts)
            && self.num_samples == num_samples.div_ceil(self.parts).max(1)
            && self.parts == num_samples.div_ceil(self.num_samples).max(1)
    }

    /// Samples of a part.
    pub(super) fn width(&self) -> usize {
        self.num_samples
    }

    /// Quadratic phase `q (K/2)^2`, turns.
    pub(super) fn turns(&self, pulse: &Pulse, terms: &PathTerms) -> f64 {
        let half = (self.num_samples / 2) as f64;
        let centre_hz = pulse.start_hz + half * pulse.step_hz;
        let q = pulse.step_hz * terms.rate_m + 0.5 * centre_hz * terms.bend_m;
        q / SPEED_OF_LIGHT_M_S * half * half
    }

    /// Fractional index of a phase among the profiles.
    pub(super) fn level(&self, turns: f64) -> f64 {
        match self.count {
            1 => 0.0,
            _ => ((turns - self.least_turns) / self.step_turns).max(0.0),
        }
    }

    /// Compensate a part of a pulse for the quadratic phase of a level.
    pub(super) fn sharpen(&self, level: usize, pulse: &[Complex32], row: &mut [Complex32]) {
        let turns = self.least_turns + level as f64 * self.step_turns;
        let half = (self.num_samples / 2).max(1) as f64;
        row[pulse.len()..].fill(Complex32::ZERO);
        for (k, (out, z)) in row.iter_mut().zip(pulse).enumerate() {
            let x = (k as f64 - (self.num_samples / 2) as f64) / half;
            *out = z * phasor32(turns * x * x);
        }
    }
}
