//! Targets that move (C 1.2.4): which, and how fast.
//!
//! **Which.** Through a stretch of pulses each target's range changes by what its phases tell, `dr`, and the direction in which it is seen by `dw`. Of targets that stand still
//!
//! ```text
//! dr_i = -u_i . D        dw_i = -Phi - across(u_i) . D / range_i
//! ```
//!
//! with one motion `D` of the array's middle and one turn `Phi`, in the frame of the stretch's mean heading, and `u_i` the mean direction (to the third order in `D / range`).
//! `D` is good to the error of the mean direction times itself, so that of a motion of some centimetres a tenth of a millimetre is left: what moves by more is
//! seen to. Two targets agree with any motion; the largest group of three or more that agree with one is taken to stand still. What is a little off in each
//! stretch, always to the same side, is found by the sum of its errors.
//!
//! **How fast.** The track being found of the others, a place and a velocity that does not change are found by least squares of the mover's phases and ranges.
//!
//! **What cannot be told.** Only relative motion is measured. If all that is seen moves alike, the radar seems to move the other way; if more targets move alike
//! than stand still, they are taken for those that stand; if as many, [`Doubt::Divided`] says so. A target that moves along a circle about the radar changes no
//! range: its direction tells it, a hundred times less surely.
//!
//! **Units** metres, radians, seconds. **Cost** the cube of the targets a stretch. **Accuracy** `tests/movers.rs`.

mod change;
mod told;
mod velocity;

use crate::check::MotionError;
use crate::model::{Array, Sighting};
use crate::series::Series;
use crate::tracker::{Track, track};

pub use told::{Doubt, Sorted, sort};
pub(crate) use told::{LEAST_STRETCH, Told, stretch};
pub use velocity::Mover;
pub(crate) use velocity::velocity;

/// A track among targets that move.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// By targets that stand still.
    pub track: Track,
    /// The others, in its frame.
    pub movers: Vec<Mover>,
    /// Which are which.
    pub sorted: Sorted,
}

/// Why there is no such track.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoScene {
    /// A pulse is wrong, or tells nothing.
    #[error("pulse {pulse}: {error}")]
    Motion {
        /// Which.
        pulse: usize,
        /// What is wrong.
        error: MotionError,
    },
    /// There is not a time of each pulse.
    #[error("{times} times are given of {pulses} pulses, or they do not grow")]
    Times {
        /// Times.
        times: usize,
        /// Pulses.
        pulses: usize,
    },
    /// It is not told which targets stand still.
    #[error("{0}")]
    Doubt(Doubt),
}

/// The track of a radar that saw this, by what stands still, and the velocities of what does not. Stretches and window count pulses: see [`sort`], [`track`].
///
/// # Errors
/// [`NoScene`].
pub fn track_among_movers(
    array: &Array,
    pulses: &[Vec<Sighting>],
    times_s: &[f64],
    stretch: usize,
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
    let sorted = sort(array, pulses, stretch).map_err(wrong)?;
    if sorted.standing.is_empty() {
        let [targets, last] = [sorted.unknown.len(), pulses.len().max(1) - 1];
        let nothing = match targets < 3 {
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
        let doubt = sorted.doubts.iter().find(divided).cloned();
        return Err(NoScene::Doubt(doubt.unwrap_or(nothing)));
    }
    let stands = |sighting: &&Sighting| sorted.standing.contains(&sighting.target);
    let standing: Vec<Vec<Sighting>> = pulses
        .iter()
        .map(|pulse| pulse.iter().filter(stands).cloned().collect())
        .collect();
    let track = track(array, &standing, window).map_err(wrong)?;
    let series = Series::all(array, pulses);
    let movers = series
        .iter()
        .filter(|series| sorted.moving.contains(&series.name))
        .filter_map(|series| velocity(array, series, &track.poses, times_s))
        .collect();
    Ok(Scene {
        track,
        movers,
        sorted,
    })
}
