//! How a recording and a grid are fitted to a strip, and which motion compensation that takes.
//!
//! The cheapest that keeps the bound; where none does, the one that leaves least ([`super::motion`]).

use std::f64::consts::PI;

use serde_json::json;

use super::bounds::Bounds;
use super::motion::{Compensation, Motion};
use super::prediction::{self, Prediction};
use super::{Axes, RangeMethod, Sizes, cost};
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

    /// With what it errs by; of [`Prediction::line`] only where the track alone is within `bound`, or `whole` is asked for.
    fn predicted(
        &self,
        weights: &Weights,
        compensation: Compensation,
        bound: f64,
    ) -> Result<Candidate, FormError> {
        let fitted = self.fitted(compensation)?;
        let track = prediction::of_track(
            self.collection,
            weights,
            self.grid,
            &fitted.motion,
            &self.wavenumbers,
        );
        let line = (track <= bound).then(|| self.line(weights, &fitted));
        Ok(Candidate {
            fitted,
            track,
            line,
        })
    }

    fn line(&self, weights: &Weights, fitted: &Fitted) -> f64 {
        let samples = (&fitted.axes, &self.wavenumbers[..]);
        prediction::of_line(weights, self.grid, &fitted.motion, samples, self.method)
    }

    /// The one to take within a bound, and what each that was looked at leaves of the track.
    fn best(
        &self,
        weights: &Weights,
        bound: f64,
    ) -> Result<(Candidate, serde_json::Map<String, serde_json::Value>), FormError> {
        let mut looked_at = serde_json::Map::new();
        let mut best: Option<Candidate> = None;
        for compensation in Compensation::ALL {
            let next = match (self.predicted(weights, compensation, bound), &best) {
                (Ok(next), _) => next,
                // What cannot be done is left, if there is another way.
                (Err(FormError::Unsuited(_)), Some(_)) => continue,
                (Err(error), _) => return Err(error),
            };
            let track_db = 20.0 * libm::log10(next.track.max(1e-15));
            looked_at.insert(compensation.name().to_owned(), track_db.into());
            let enough = next
                .line
                .is_some_and(|line| next.track + line <= bound || next.track <= NEGLIGIBLE * line);
            if best.as_ref().is_none_or(|best| next.track < best.track) {
                best = Some(next);
            }
            if enough {
                break;
            }
        }
        let best = best.ok_or_else(|| FormError::unsuited("the track has no line".to_owned()))?;
        Ok((best, looked_at))
    }
}

/// A way to compensate, and what it errs by, relative.
struct Candidate {
    fitted: Fitted,
    track: f64,
    line: Option<f64>,
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
    let (best, _) = ground.best(&weights, libm::pow(10.0, error_db / 20.0))?;
    Ok(Sizes::of(&best.fitted.axes))
}

/// Decides how the image of `aim` is formed with `method`, and what it errs by. `limit` is what limits it where the line
/// does; `settings` are the method's own, a JSON object.
///
/// # Errors
/// [`FormError::Unsuited`] if the pulses stand still, the band changes, or pixels lie too near; [`FormError::BoundMissed`]
/// if what is `asked` is missed; by the track alone before the line is looked at, for that may take long.
pub(crate) fn decide(
    aim: &Aim,
    method: &dyn RangeMethod,
    asked: &Asked,
    limit: &Reason,
    settings: serde_json::Value,
) -> Result<Decision, FormError> {
    let ground = Ground::new(aim.collection, aim.grid, method)?;
    let bound = asked
        .bound_db
        .map_or(f64::INFINITY, |db| libm::pow(10.0, db / 20.0));
    let (best, looked_at) = ground.best(aim.weights, bound)?;
    let fitted = &best.fitted;
    let mut prediction = Prediction {
        track: best.track,
        line: best.line.unwrap_or(0.0),
    };
    asked.check(20.0 * libm::log10(prediction.track), || {
        prediction.limit(limit)
    })?;
    if best.line.is_none() {
        prediction.line = ground.line(aim.weights, fitted);
    }
    let [spread, read] = fitted.motion.floors();
    let planned_db = prediction.total_db(&[rounding::path_phase_rad(aim), spread, read]);
    asked.check(planned_db, || prediction.limit(limit))?;
    let axes = &fitted.axes;
    let steepest = axes
        .needed_sines()
        .map(|s| libm::asin(s.abs()).to_degrees())
        .into_iter()
        .fold(0.0, f64::max);
    let compensation = fitted.motion.compensation;
    let mut all = json!({
        "track_error_db": 20.0 * libm::log10(prediction.track.max(1e-15)),
        "line_error_db": 20.0 * libm::log10(prediction.line.max(1e-15)),
        "motion_compensation": compensation.name(),
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
        cost: cost::cost(aim.means.model, aim.grid, fitted, method),
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
