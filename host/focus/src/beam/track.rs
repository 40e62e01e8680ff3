//! Antenna positions and headings per pulse, and the pulses that illuminate a point.

use std::ops::Range;

use glam::DVec3;

use super::Beam;
use crate::FormError;
use subaperture_model::phase_history::{Collection, headings};

/// Largest number of pulses in the coarse search for the illumination of a point. A pass shorter than the coarse step is searched
/// pulse by pulse only where the coarse search finds no other pass.
const COARSE: usize = 2048;

/// Largest interruption of a pass, as a fraction of the pulses: noise of positions and attitudes at the edge of the beam. Headings are averaged over as many.
const INTERRUPTION: usize = 64;

/// Largest heading change, radians, and largest deviation of a step from a multiple of the spacing, relative to it, for a Doppler spectrum of the
/// whole track. Larger values smear the spectrum.
const MAX_TURN_RAD: f64 = 0.035;
const MAX_UNEVEN: f64 = 0.1;

/// Largest ratio of the number of evenly spaced positions to the number of pulses: half of them may be missing.
const MAX_MISSING: f64 = 2.0;

/// Even spacing of a track. Pulses may be missing.
pub(super) struct Spacing {
    /// Distance between neighbouring positions, metres.
    pub(super) step_m: f64,
    /// Position of each pulse, in steps from the first.
    pub(super) numbers: Vec<usize>,
}

/// Antenna track relative to the moving target.
pub(super) struct Track<'a> {
    name: &'a str,
    places_m: Vec<DVec3>,
    /// Heading of each pulse, unit vector.
    headings: Vec<DVec3>,
    /// Along-track distance from each pulse to the next, metres, relative to the target.
    steps_m: Vec<f64>,
    /// Squint of the beam at each pulse, radians; empty for a beam that does not turn.
    squints_rad: Vec<f64>,
}

impl<'a> Track<'a> {
    /// Compute the track of a single-channel collection relative to a target that moves as `beam.target`.
    pub(super) fn of(collection: &'a Collection, beam: &Beam) -> Result<Self, FormError> {
        let name = &collection.name;
        let count = collection.pulses.len();
        if collection.num_turns() != count {
            return Err(FormError::unsuited(format!(
                "{name}: expected pulses of one channel for a beam, found several channels: select one"
            )));
        }
        let places_m: Vec<DVec3> = collection
            .pulses
            .iter()
            .map(|pulse| pulse.phase_centre_m())
            .collect();
        let first_s = collection.pulses.first().map_or(0.0, |pulse| pulse.time_s);
        // Positions in a frame at rest.
        let at_rest_m: Vec<DVec3> = places_m
            .iter()
            .zip(&collection.pulses)
            .map(|(place_m, pulse)| match &beam.target {
                Some(target) => place_m + target.between(first_s, pulse.time_s).0,
                None => *place_m,
            })
            .collect();
        let steps_m = at_rest_m
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .collect();
        let headings = headings(&at_rest_m);
        match headings.iter().position(|heading| *heading == DVec3::ZERO) {
            None => Ok(Self {
                name,
                places_m,
                squints_rad: match beam.aims.is_empty() {
                    true => Vec::new(),
                    false => {
                        let times_s = collection.pulses.iter().map(|pulse| pulse.time_s);
                        beam.squints_rad(&times_s.collect::<Vec<_>>(), &headings)
                    }
                },
                headings,
                steps_m,
            }),
            Some(n) => Err(FormError::unsuited(format!(
                "{name}: the antenna does not move at pulse {n} (from 0): the beam's angle is measured from the direction of motion"
            ))),
        }
    }

    /// Sine of the angle of a point forward of broadside at pulse `n`.
    pub(super) fn sine(&self, n: usize, place_m: DVec3) -> f64 {
        let from = place_m - self.places_m[n];
        (self.headings[n].dot(from) / from.length()).clamp(-1.0, 1.0)
    }

    /// Whether a point lies forward of the centre of a beam at pulse `n`.
    pub(super) fn is_ahead(&self, beam: &Beam, n: usize, place_m: DVec3) -> bool {
        let squint_rad = self.squints_rad.get(n).unwrap_or(&beam.squint_rad);
        self.sine(n, place_m) > libm::sin(*squint_rad)
    }

    /// Mean pulse spacing, metres, of a straight track with even spacing.
    ///
    /// # Errors
    /// As [`Self::spacing`].
    pub(super) fn even_step_m(&self) -> Result<f64, String> {
        self.spacing().map(|spacing| spacing.step_m)
    }

    /// Spacing of a straight track. Pulses may be missing: a step may be a multiple of the spacing.
    ///
    /// # Errors
    /// Message that names the violated condition.
    pub(super) fn spacing(&self) -> Result<Spacing, String> {
        let mean: DVec3 = self.headings.iter().sum();
        let least = self
            .headings
            .iter()
            .map(|heading| heading.dot(mean.normalize_or_zero()));
        let most_rad = libm::acos(least.fold(1.0, f64::min).clamp(-1.0, 1.0));
        if most_rad > MAX_TURN_RAD {
            return Err(format!(
                "the track's heading varies by up to {:.1} deg; the Doppler spectrum needs a straight track",
                most_rad.to_degrees()
            ));
        }
        let mut sorted = self.steps_m.clone();
        sorted.sort_by(f64::total_cmp);
        let median_m = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        let mut last = 0.0;
        let mut multiples = Vec::with_capacity(self.steps_m.len());
        let mut numbers = vec![0];
        for step_m in &self.steps_m {
            let multiple = (step_m / median_m).round().max(1.0);
            last += multiple;
            multiples.push(multiple);
            numbers.push(last as usize);
        }
        let count = self.steps_m.len().max(1) as f64;
        let mean_m = self.steps_m.iter().sum::<f64>() / last.max(1.0);
        let uneven = (self.steps_m.iter().zip(&multiples))
            .map(|(step_m, multiple)| (step_m / mean_m - multiple).abs());
        let most = uneven.fold(0.0, f64::max);
        if !(most <= MAX_UNEVEN && last <= MAX_MISSING * count) {
            return Err(format!(
                "pulse spacing differs from a multiple of its mean by up to {:.0} % of it, and {:.0} % of evenly spaced pulses are missing; the Doppler spectrum needs even spacing",
                100.0 * most,
                100.0 * (1.0 - count / last.max(1.0))
            ));
        }
        Ok(Spacing {
            step_m: mean_m,
            numbers,
        })
    }

    /// Smallest distance from a point to a pulse's antenna position, metres.
    pub(super) fn nearest_m(&self, place_m: DVec3) -> f64 {
        let distances = self
            .places_m
            .iter()
            .map(|antenna_m| antenna_m.distance(place_m));
        distances.fold(f64::INFINITY, f64::min)
    }

    pub(super) fn len(&self) -> usize {
        self.places_m.len()
    }

    /// Pulses that illuminate a point; an empty range if no pulse does.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the beam passes the point more than once.
    pub(super) fn seeing(&self, beam: &Beam, place_m: DVec3) -> Result<Range<usize>, FormError> {
        let half_rad = 0.5 * beam.width_rad;
        let edges = [beam.squint_rad - half_rad, beam.squint_rad + half_rad].map(libm::sin);
        let sees = |n: usize| {
            let sine = self.sine(n, place_m);
            match self.squints_rad.get(n) {
                None => (edges[0]..=edges[1]).contains(&sine),
                Some(squint_rad) => (libm::asin(sine) - squint_rad).abs() <= half_rad,
            }
        };
        let step = self.len().div_ceil(COARSE).max(1);
        for step in [step, 1] {
            let mut seeing = (0..self.len()).step_by(step).filter(|&n| sees(n));
            let Some(first) = seeing.next() else {
                continue;
            };
            let (mut last, mut passes) = (first, 1);
            let longest = step.max(self.len() / INTERRUPTION);
            for n in seeing {
                passes += usize::from(n > last + longest);
                last = n;
            }
            if passes > 1 {
                return Err(FormError::unsuited(format!(
                    "{}: the beam illuminates x {:.3} m, y {:.3} m, z {:.3} m in {passes} passes, expected one: focus each pass separately",
                    self.name, place_m.x, place_m.y, place_m.z
                )));
            }
            // The pass extends up to one coarse step beyond either end.
            let begins = (first.saturating_sub(step - 1)..=first).find(|&n| sees(n));
            let ends = (last..self.len().min(last + step)).rev().find(|&n| sees(n));
            return Ok(begins.unwrap_or(first)..ends.unwrap_or(last) + 1);
        }
        Ok(0..0)
    }
}
