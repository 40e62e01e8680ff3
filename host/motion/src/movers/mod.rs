//! Moving targets among standing ones (C 1.2.4), and their velocities.
//!
//! **Classification.** Over a segment of pulses, phases give the change `dr` of each target's range, and directions of arrival their change `dw`. Standing targets obey
//!
//! ```text
//! dr_i = -u_i . D        dw_i = -Phi - across(u_i) . D / range_i
//! ```
//!
//! with one motion `D` of the array's centre and one turn `Phi`, in the frame of the segment's mean heading, and `u_i` the mean direction (to the third order in `D / range`). `D` has the relative error of the mean
//! directions: for a motion of some centimetres it is a tenth of a millimetre, and targets that move by more are detected. Two targets agree with any motion: the largest group of three or more that agree with one is
//! taken to stand still. A small error of constant sign in each segment is detected in the sum over segments.
//!
//! **Velocity.** With the track known from standing targets, least squares of a mover's phases and ranges give its position and its constant velocity.
//!
//! **Limits.** Only relative motion is measured. If all targets have the same velocity, the radar appears to have the opposite one. If more targets share a velocity than stand still, they are taken for standing ones;
//! if the numbers are equal, [`Doubt::Divided`] is reported. A target that circles the radar keeps its range: its change of direction is a hundred times less sensitive.
//!
//! **Units** metres, radians, seconds. **Cost** the cube of the targets a segment. **Accuracy** `tests/movers.rs`.

mod change;
mod classify;
mod velocity;

use crate::check::MotionError;
use crate::model::{Array, Sighting};
use crate::series::Series;
use crate::tracker::{Track, track};

pub use classify::{Classification, Doubt, classify};
pub(crate) use classify::{MIN_SEGMENT, Record, segment_changes};
pub(crate) use velocity::velocity;
pub use velocity::{Mover, velocities};

/// Track among moving targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Track from standing targets.
    pub track: Track,
    /// Moving targets, in the track's frame.
    pub movers: Vec<Mover>,
    /// Classification of all targets.
    pub classes: Classification,
}

/// Reason why there is no track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoScene {
    /// A pulse is invalid, or does not determine its pose.
    #[error("pulse {pulse}: {error}")]
    Motion {
        /// Number of the pulse.
        pulse: usize,
        /// Reason of the refusal.
        error: MotionError,
    },
    /// The number of times differs from the number of pulses, or times are not finite and ascending.
    #[error("expected one finite, ascending time per pulse ({pulses}), got {times} times")]
    Times {
        /// Number of times given.
        times: usize,
        /// Number of pulses of the recording.
        pulses: usize,
    },
    /// Standing and moving targets cannot be separated.
    #[error("{0}")]
    Doubt(Doubt),
}

/// Estimate the track from standing targets and the velocities of the others. `segment_length` and `window` are numbers of pulses: see [`classify`] and [`track`].
///
/// # Errors
/// [`NoScene`].
pub fn track_among_movers(
    array: &Array,
    pulses: &[Vec<Sighting>],
    times_s: &[f64],
    segment_length: usize,
    window: usize,
) -> Result<Scene, NoScene> {
    let grow = times_s.windows(2).all(|pair| pair[0] < pair[1]);
    if times_s.len() != pulses.len() || !grow || !times_s.iter().all(|time| time.is_finite()) {
        return Err(NoScene::Times {
            times: times_s.len(),
            pulses: pulses.len(),
        });
    }
    let wrong = |(pulse, error)| NoScene::Motion { pulse, error };
    let classes = classify(array, pulses, segment_length).map_err(wrong)?;
    if classes.standing.is_empty() {
        let [targets, last] = [classes.unknown.len(), pulses.len().max(1) - 1];
        let no_group = match targets < 3 {
            true => Doubt::Few {
                targets,
                first: 0,
                last,
            },
            false => Doubt::Disagree {
                targets,
                first: 0,
                last,
            },
        };
        let divided = |doubt: &&Doubt| matches!(doubt, Doubt::Divided { .. });
        let doubt = classes.doubts.iter().find(divided).cloned();
        return Err(NoScene::Doubt(doubt.unwrap_or(no_group)));
    }
    let stands = |sighting: &&Sighting| classes.standing.contains(&sighting.target);
    let standing: Vec<Vec<Sighting>> = pulses
        .iter()
        .map(|pulse| pulse.iter().filter(stands).cloned().collect())
        .collect();
    let track = track(array, &standing, window).map_err(wrong)?;
    let series = Series::all(array, pulses);
    let movers = series
        .iter()
        .filter(|series| classes.moving.contains(&series.name))
        .filter_map(|series| velocity(array, series, &track.poses, times_s))
        .collect();
    Ok(Scene {
        track,
        movers,
        classes,
    })
}
