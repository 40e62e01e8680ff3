//! Fit of a recording and a grid to a strip, and choice of the motion compensation.
//!
//! The cheapest compensation that keeps the bound is chosen, or else the one with the smallest residual error ([`super::motion`]).

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::f64::consts::PI;

use serde_json::json;

use super::bounds::Bounds;
use super::motion::{Compensation, Motion};
use super::prediction::{self, Prediction};
use super::{Axes, RangeMethod, Sizes, cost};
use crate::goal::misses;
use crate::patch::PatchSize;
use crate::straight_track::StraightTrack;
use crate::sub_cpi::shared_band;
use crate::{Decision, ErrorGoal, FormError, ImageSpec, Reason, rounding};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Weights};
use subaperture_signal::window::Window;

/// Fraction of the bound below which the track error does not justify another compensation when the line error exceeds the bound.
const NEGLIGIBLE: f64 = 0.1;

/// Choices of the frequency-domain formers.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Choices {
    compensation: Compensation,
}

/// Collection and grid fitted to a straight track.
pub(super) struct Fitted {
    pub(super) motion: Motion,
    /// Two-way wavenumbers of the samples, rad/m.
    pub(super) wavenumbers: Vec<f64>,
    pub(super) axes: Axes,
}

impl Fitted {
    /// Phase rotation of all samples of pulse `n` by the along-track carrier before the transform, turns.
    pub(super) fn turns(&self, n: usize) -> f64 {
        match self.motion.positions.is_uneven() {
            true => {
                let from_first_m =
                    self.motion.positions.along_m(n) - self.motion.positions.span_m()[0];
                let middle = self.axes.along_wavenumber(self.axes.num_bins / 2);
                -middle * from_first_m / (2.0 * PI)
            }
            false => 0.0,
        }
    }
}

/// Inputs that do not depend on the motion compensation.
struct Ground<'a> {
    collection: &'a Collection,
    grid: &'a ImageGrid,
    method: &'a dyn RangeMethod,
    track: StraightTrack,
    bounds: Bounds,
    wavenumbers: Vec<f64>,
}

impl<'a> Ground<'a> {
    fn new(
        collection: &'a Collection,
        grid: &'a ImageGrid,
        method: &'a dyn RangeMethod,
    ) -> Result<Self, FormError> {
        let band = shared_band(collection)?;
        let track = StraightTrack::fit(collection)?;
        track.check(collection)?;
        let wavenumber = |k| 4.0 * PI * band.frequency_hz(k) / SPEED_OF_LIGHT_M_S;
        Ok(Self {
            collection,
            grid,
            method,
            bounds: Bounds::of(&track, grid),
            track,
            wavenumbers: (0..band.count).map(wavenumber).collect(),
        })
    }

    fn fitted(&self, compensation: Compensation) -> Result<Fitted, FormError> {
        let motion = Motion::new(
            self.collection,
            self.grid,
            self.track,
            &self.bounds,
            &self.wavenumbers,
            compensation,
        )?;
        let kept = match motion.profiles() {
            Some(profiles) => profiles.wavenumbers(),
            None => self.wavenumbers.clone(),
        };
        Ok(Fitted {
            axes: Axes::new(&motion, kept, &self.bounds, &|kappa, kx| {
                self.method.range_wavenumber(kappa, kx)
            })?,
            motion,
            wavenumbers: self.wavenumbers.clone(),
        })
    }

    /// Add the prediction. [`Prediction::line`] is evaluated only if all other errors are within the bound, since it may take long.
    fn predicted(
        &self,
        weights: &Weights,
        compensation: Compensation,
        bound_db: Option<f64>,
    ) -> Result<Candidate, FormError> {
        let fitted = self.fitted(compensation)?;
        let [track, rough] = prediction::of_track(
            self.collection,
            weights,
            self.grid,
            &fitted.motion,
            &self.wavenumbers,
        );
        let [spread, read] = fitted.motion.floors();
        let mut errors = Errors {
            track,
            rough,
            line: None,
            others: [
                rounding::path_phase_rad(self.collection, self.grid),
                spread,
                read,
            ],
        };
        if !misses(errors.planned_db(), bound_db) {
            errors.line = Some(self.line(weights, &fitted));
        }
        Ok(Candidate { fitted, errors })
    }

    fn line(&self, weights: &Weights, fitted: &Fitted) -> f64 {
        let samples = (&fitted.axes, &self.wavenumbers[..]);
        prediction::of_line(weights, self.grid, &fitted.motion, samples, self.method)
    }

    /// Choose the compensation for a bound. Return it with the track error of each candidate, dB.
    fn best(
        &self,
        weights: &Weights,
        bound_db: Option<f64>,
    ) -> Result<(Candidate, BTreeMap<Compensation, f64>), FormError> {
        let [cheapest, dearer @ ..] = Compensation::ALL;
        let mut best = self.predicted(weights, cheapest, bound_db)?;
        let mut looked_at = BTreeMap::from([(cheapest, best.errors.track_db())]);
        for compensation in dearer {
            if best.errors.settle(bound_db) {
                break;
            }
            let next = match self.predicted(weights, compensation, bound_db) {
                Ok(next) => next,
                // Skip a compensation that is impossible; another one exists.
                Err(FormError::Unsuited(_)) => continue,
                Err(error) => return Err(error),
            };
            looked_at.insert(compensation, next.errors.track_db());
            if next.errors.better_than(&best.errors, bound_db) {
                best = next;
            }
        }
        Ok((best, looked_at))
    }
}

/// Candidate compensation with its predicted errors.
struct Candidate {
    fitted: Fitted,
    errors: Errors,
}

/// Predicted relative errors of a compensation.
#[derive(Clone, Copy, Debug)]
struct Errors {
    track: f64,
    /// Part of the track error that varies fast from pulse to pulse.
    rough: f64,
    /// Error on the straight line; `None` if the bound is exceeded without it.
    line: Option<f64>,
    /// Errors of the other steps and of rounded paths.
    others: [f64; 3],
}

impl Errors {
    fn prediction(&self) -> Prediction {
        Prediction {
            track: self.track,
            line: self.line.unwrap_or(0.0),
        }
    }

    /// Planned error, dB; a lower limit where the line error was not evaluated.
    fn planned_db(&self) -> f64 {
        self.prediction().total_db(&self.others)
    }

    /// Planned error that can focus scatterers outside the grid to points, dB.
    fn stray_db(&self) -> f64 {
        let [a, b, c] = self.others;
        let line = self.line.unwrap_or(0.0);
        rounding::total_db(&[self.rough + line, prediction::FLOOR, a, b, c])
    }

    fn track_db(&self) -> f64 {
        20.0 * libm::log10(self.track.max(1e-15))
    }

    /// Whether all errors are evaluated and the bound is kept.
    fn keep(&self, bound_db: Option<f64>) -> bool {
        self.line.is_some() && !misses(self.planned_db(), bound_db)
    }

    /// Whether the search can end: the bound is kept, or exceeded by the line error, which all candidates share.
    fn settle(&self, bound_db: Option<f64>) -> bool {
        let by_line = |line| self.track <= NEGLIGIBLE * line;
        self.keep(bound_db) || self.line.is_some_and(by_line)
    }

    /// Rank candidates: first those that keep the bound, then those where only the line error exceeds it, then by remaining error.
    fn better_than(&self, other: &Self, bound_db: Option<f64>) -> bool {
        let of = |errors: &Self| (errors.keep(bound_db), errors.line.is_some());
        match of(self).cmp(&of(other)) {
            Ordering::Equal => self.planned_db() < other.planned_db(),
            order => order == Ordering::Greater,
        }
    }
}

/// Array sizes of `method` for the pixels of `grid` within `error_db`.
///
/// # Errors
/// [`FormError::Unsuited`], as for [`decide`].
pub(crate) fn sizes(
    collection: &Collection,
    grid: &ImageGrid,
    method: &dyn RangeMethod,
    error_db: f64,
) -> Result<Sizes, FormError> {
    let ground = Ground::new(collection, grid, method)?;
    let weights = Weights::new(collection, Window::None, Window::None);
    let (best, _) = ground.best(&weights, Some(error_db))?;
    Ok(Sizes::of(&best.fitted.axes))
}

/// Decide how to form the image of `spec` with `method`, with its planned error. `limit` is the reason reported where the line error
/// limits; `settings` are those of the method, a JSON object.
///
/// # Errors
/// [`FormError::Unsuited`] if the pulses do not move, the band changes, or pixels are too close; [`FormError::BoundMissed`]
/// if the bound of `goal` is exceeded. All errors except that of the line are checked first, since the line may take long.
pub(crate) fn decide(
    spec: &ImageSpec,
    method: &dyn RangeMethod,
    goal: &ErrorGoal,
    limit: &Reason,
    settings: serde_json::Value,
) -> Result<Decision<Choices>, FormError> {
    let ground = Ground::new(spec.collection, spec.grid, method)?;
    let (best, looked_at) = ground.best(spec.weights, goal.bound_db)?;
    let Candidate { fitted, mut errors } = best;
    let check =
        |errors: &Errors| goal.check(errors.planned_db(), || errors.prediction().limit(limit));
    check(&errors)?;
    if errors.line.is_none() {
        errors.line = Some(ground.line(spec.weights, &fitted));
        check(&errors)?;
    }
    let prediction = errors.prediction();
    let axes = &fitted.axes;
    let steepest = axes
        .needed_sines()
        .map(|s| libm::asin(s.abs()).to_degrees())
        .into_iter()
        .fold(0.0, f64::max);
    let compensation = fitted.motion.compensation;
    let planned_db = errors.planned_db();
    let mut all = json!({
        "track_error_db": errors.track_db(),
        "line_error_db": 20.0 * libm::log10(prediction.line.max(1e-15)),
        "stray_error_db": errors.stray_db(),
        "motion_compensation": compensation,
        "compensations_db": looked_at,
        "padded_pulses": axes.slow_length,
        "along_track_wavenumbers": axes.num_bins,
        "range_bins": axes.range.count,
        "steepest_angle_deg": steepest,
    });
    if let (Some(all), serde_json::Value::Object(own)) = (all.as_object_mut(), settings) {
        all.extend(own);
    }
    Ok(Decision {
        choices: Choices { compensation },
        settings: all,
        planned_db,
        grain: PatchSize::PIXEL,
        cost: cost::cost(spec.numerics.model, spec.grid, &fitted, method),
    })
}

/// Fit by stored choices.
///
/// # Errors
/// Errors of [`decide`].
pub(super) fn chosen(
    spec: &ImageSpec,
    method: &dyn RangeMethod,
    Choices { compensation }: Choices,
) -> Result<Fitted, FormError> {
    Ground::new(spec.collection, spec.grid, method)?.fitted(compensation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors relative to the bound.
    fn errors(bound_db: f64, track: f64, line: Option<f64>, others: f64) -> Errors {
        let bound = libm::pow(10.0, bound_db / 20.0);
        Errors {
            track: track * bound,
            rough: 0.0,
            line: line.map(|line| line * bound),
            others: [others * bound, 0.0, 0.0],
        }
    }

    /// 0.3 + 0.8 of the bound exceeds it, 0.4 + 0.5 keeps it despite the larger track error.
    #[test]
    fn compensation_within_bound_precedes_smaller_track_error() {
        let bound_db = Some(-60.0);
        let misses = errors(-60.0, 0.3, Some(0.8), 0.0);
        let keeps = errors(-60.0, 0.4, Some(0.5), 0.0);
        let beyond = errors(-60.0, 1.5, None, 0.0);
        assert!(keeps.keep(bound_db) && !misses.keep(bound_db) && !beyond.keep(bound_db));
        for other in [misses, beyond] {
            assert!(keeps.better_than(&other, bound_db) && !other.better_than(&keeps, bound_db));
        }
        assert!(misses.better_than(&beyond, bound_db) && !beyond.better_than(&misses, bound_db));
        assert!(errors(-60.0, 1.2, None, 0.0).better_than(&beyond, bound_db));
        // The search ends at a candidate that keeps the bound.
        assert!(keeps.settle(bound_db) && !misses.settle(bound_db) && !beyond.settle(bound_db));
        assert!(errors(-60.0, 0.1, Some(1.1), 0.0).settle(bound_db));
        assert!(beyond.better_than(&errors(-60.0, 1.6, None, 0.0), None));
    }

    /// Track and line amount to 0.9 of the bound; with a kernel error of 0.6 the total is 1.08.
    #[test]
    fn errors_of_other_steps_count_against_bound() {
        let bound_db = Some(-60.0);
        assert!(errors(-60.0, 0.4, Some(0.5), 0.3).keep(bound_db));
        let floored = errors(-60.0, 0.4, Some(0.5), 0.6);
        assert!(!floored.keep(bound_db) && !floored.settle(bound_db));
    }
}
