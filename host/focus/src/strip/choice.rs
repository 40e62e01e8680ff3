//! How a recording and a grid are fitted to a strip, and which motion compensation that takes.
//!
//! The cheapest that keeps the bound; where none does, the one that leaves least ([`super::motion`]).

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::f64::consts::PI;

use serde_json::json;

use super::bounds::Bounds;
use super::motion::{Compensation, Motion};
use super::prediction::{self, Prediction};
use super::{Axes, RangeMethod, Sizes, cost};
use crate::accuracy::misses;
use crate::patch::PatchSize;
use crate::straight_track::StraightTrack;
use crate::sub_cpi::shared_band;
use crate::{Aim, Asked, Decision, FormError, Reason, former, rounding};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::{Collection, Weights};
use subaperture_signal::window::Window;

/// A track's part of an error below which another compensation is not looked for, where the line misses the bound.
const NEGLIGIBLE: f64 = 0.1;

/// What a strip's formers choose.
#[derive(Clone, Copy, Debug, Default, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Choices {
    compensation: Compensation,
}

/// A collection and a grid fitted to a straight track.
pub(super) struct Fitted {
    pub(super) motion: Motion,
    /// Two-way wavenumbers of the samples, rad/m.
    pub(super) wavenumbers: Vec<f64>,
    pub(super) axes: Axes,
}

impl Fitted {
    /// Turns by which all samples of pulse `n` are brought down along the track before they are transformed.
    pub(super) fn turns(&self, n: usize) -> f64 {
        match self.motion.is_uneven() {
            true => {
                let from_first_m = self.motion.along_m(n) - self.motion.span_m()[0];
                let middle = self.axes.along_wavenumber(self.axes.num_bins / 2);
                -middle * from_first_m / (2.0 * PI)
            }
            false => 0.0,
        }
    }
}

/// What does not depend on how motion is compensated.
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
            axes: Axes::new(&motion, kept, &self.bounds, self.method)?,
            motion,
            wavenumbers: self.wavenumbers.clone(),
        })
    }

    /// With what it errs by. [`Prediction::line`] is looked at only where all else is within the bound, for that may take long.
    fn predicted(
        &self,
        weights: &Weights,
        compensation: Compensation,
        bound_db: Option<f64>,
    ) -> Result<Candidate, FormError> {
        let fitted = self.fitted(compensation)?;
        let track = prediction::of_track(
            self.collection,
            weights,
            self.grid,
            &fitted.motion,
            &self.wavenumbers,
        );
        let [spread, read] = fitted.motion.floors();
        let mut errors = Errors {
            track,
            line: None,
            beside: [
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

    /// The one to take within a bound, and what each that was looked at leaves of the track, dB.
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
                // What cannot be done is left, for there is another way.
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

/// A way to compensate, and what it errs by.
struct Candidate {
    fitted: Fitted,
    errors: Errors,
}

/// What a way to compensate errs by, relative.
#[derive(Clone, Copy, Debug)]
struct Errors {
    track: f64,
    /// Unless without it the bound is missed.
    line: Option<f64>,
    /// Of what is done besides, and of rounded paths.
    beside: [f64; 3],
}

impl Errors {
    fn prediction(&self) -> Prediction {
        Prediction {
            track: self.track,
            line: self.line.unwrap_or(0.0),
        }
    }

    /// What is planned with; at least that where the line was not looked at.
    fn planned_db(&self) -> f64 {
        self.prediction().total_db(&self.beside)
    }

    fn track_db(&self) -> f64 {
        20.0 * libm::log10(self.track.max(1e-15))
    }

    /// Whether all that is planned is known, and keeps the bound.
    fn keep(&self, bound_db: Option<f64>) -> bool {
        self.line.is_some() && !misses(self.planned_db(), bound_db)
    }

    /// Whether to look no further: the bound is kept, or missed by the line, which is the same for all.
    fn settle(&self, bound_db: Option<f64>) -> bool {
        let by_line = |line| self.track <= NEGLIGIBLE * line;
        self.keep(bound_db) || self.line.is_some_and(by_line)
    }

    /// What keeps the bound comes first, then that of which only the line misses it; then what leaves least.
    fn better_than(&self, other: &Self, bound_db: Option<f64>) -> bool {
        let of = |errors: &Self| (errors.keep(bound_db), errors.line.is_some());
        match of(self).cmp(&of(other)) {
            Ordering::Equal => self.planned_db() < other.planned_db(),
            order => order == Ordering::Greater,
        }
    }
}

/// What `method` works with for the pixels of `grid`, within `error_db`.
///
/// # Errors
/// [`FormError::Unsuited`] as [`decide`].
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

/// Decides how the image of `aim` is formed with `method`, and what it errs by. `limit` is what limits it where the line
/// does; `settings` are the method's own, a JSON object.
///
/// # Errors
/// [`FormError::Unsuited`] if the pulses stand still, the band changes, or pixels lie too near; [`FormError::BoundMissed`]
/// if what is `asked` is missed; by all but the line before that is looked at, for it may take long.
pub(crate) fn decide(
    aim: &Aim,
    method: &dyn RangeMethod,
    asked: &Asked,
    limit: &Reason,
    settings: serde_json::Value,
) -> Result<Decision, FormError> {
    let ground = Ground::new(aim.collection, aim.grid, method)?;
    let (best, looked_at) = ground.best(aim.weights, asked.bound_db)?;
    let Candidate { fitted, mut errors } = best;
    let check =
        |errors: &Errors| asked.check(errors.planned_db(), || errors.prediction().limit(limit));
    check(&errors)?;
    if errors.line.is_none() {
        errors.line = Some(ground.line(aim.weights, &fitted));
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
        choices: json!(Choices { compensation }),
        settings: all,
        planned_db,
        grain: PatchSize::PIXEL,
        cost: cost::cost(aim.means.model, aim.grid, &fitted, method),
    })
}

/// As was decided.
///
/// # Errors
/// [`FormError::Choices`] of choices that are none of a strip's, and those of [`decide`].
pub(super) fn chosen(
    former: &'static str,
    aim: &Aim,
    method: &dyn RangeMethod,
    choices: &serde_json::Value,
) -> Result<Fitted, FormError> {
    let Choices { compensation } = former::chosen(former, choices)?;
    Ground::new(aim.collection, aim.grid, method)?.fitted(compensation)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative to the bound.
    fn errors(bound_db: f64, track: f64, line: Option<f64>, beside: f64) -> Errors {
        let bound = libm::pow(10.0, bound_db / 20.0);
        Errors {
            track: track * bound,
            line: line.map(|line| line * bound),
            beside: [beside * bound, 0.0, 0.0],
        }
    }

    /// 0.3 + 0.8 of the bound misses it, 0.4 + 0.5 keeps it, though it leaves more of the track.
    #[test]
    fn what_keeps_the_bound_is_taken_before_what_leaves_less_of_the_track() {
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
        // Of those that keep it none is looked for any more.
        assert!(keeps.settle(bound_db) && !misses.settle(bound_db) && !beyond.settle(bound_db));
        assert!(errors(-60.0, 0.1, Some(1.1), 0.0).settle(bound_db));
        assert!(beyond.better_than(&errors(-60.0, 1.6, None, 0.0), None));
    }

    /// Track and line make 0.9 of the bound; a kernel's 0.6 beside them make 1.08.
    #[test]
    fn what_is_done_besides_counts() {
        let bound_db = Some(-60.0);
        assert!(errors(-60.0, 0.4, Some(0.5), 0.3).keep(bound_db));
        let floored = errors(-60.0, 0.4, Some(0.5), 0.6);
        assert!(!floored.keep(bound_db) && !floored.settle(bound_db));
    }
}
