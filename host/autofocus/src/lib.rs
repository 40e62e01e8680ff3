//! Calibration of geometry parameters, phases and tracks by image sharpness.
//!
//! Part of [Subaperture](https://docs.rs/subaperture), radar image formation; the crate `subaperture` re-exports this crate as
//! its module `autofocus`.
//!
//! # Parameters
//!
//! The search maximises a figure of merit over intervals of parameters. The caller supplies the merit, usually [`merit`].
//! The search has three steps:
//!
//! 1. A grid: every combination of values, or one parameter after another ([`Order::InTurn`]) with the others at their best
//!    values so far, starting at the middles of the intervals, until the best values are stable. Searching in turn costs the sum of the
//!    counts instead of their product. Both orders agree if the peak is visible with the other parameters at their
//!    middles and its ridges are parallel to the axes.
//! 2. Refinement: all neighbours at half the step, moving while one is better; then the step is halved again.
//! 3. Interpolation: the vertex of a parabola through the best value and its two neighbours on each axis.
//!
//! The *width* of the peak is the distance between the points on both sides of the best where the merit has fallen half way to
//! its median over the interval, with the other parameters at their best. It measures sharpness, not accuracy.
//! The *error* measures accuracy: it comes from searches that leave out parts of the aperture (`certainty.rs`). The
//! [`Verdict`] states whether the data determine the parameter.
//!
//! Sharpness has many local maxima. A grid with a step above the width can miss the highest; compare the
//! widths with the step after a search.
//!
//! Some parameters displace the image more than they defocus it. [`determine`] therefore compares the same pulses and the
//! same points, with pixels that follow them (`anchor.rs`). Without this the optimum of a clock offset was 2.4 s wrong, with an error estimate
//! of 0.6 s.
//!
//! Focus does not determine shifts that leave the image focused (of range from a short aperture, of clocks at constant platform
//! velocity). These need a point of known position: [`Sight::Points`]. On a public recording of a radar pushed
//! along a rail (`tests/recordings/described.rs`), sharpness determines the clock offset to 0.06 s but not the range bias. The power at
//! one surveyed reflector determines both, and the reflector then lies within 3 cm of its survey.
//!
//! Every evaluation is made once. The result is deterministic if the merit is.
//!
//! # Phases and tracks
//!
//! Errors that vary from pulse to pulse are estimated by [`sharpen()`], with a [`Method`] and images of any former. It never
//! makes an image worse, and judges the gain on range cells that were not used for estimation ([`HeldOut`]):
//!
//! | method | estimates | suited to |
//! |---|---|---|
//! | [`PhaseGradient`] | one phase per pulse | points, texture and clutter; errors common to the whole scene |
//! | [`ModifiedPhaseGradient`] | antenna displacements, two components per pulse | near scenes, points in different directions |
//! | [`Sharpness`] | phases or displacements, as curves with an increasing number of terms | scenes without isolated points; tracks in the far field |
//! | [`MapDrift`] | a polynomial of few terms | smooth errors, scenes without points |
//!
//! The result is a [`Correction`]. [`Corrected`] is the recording with the correction applied.
#![forbid(unsafe_code)]

mod anchor;
mod centring;
mod certainty;
mod chance;
mod correction;
mod curve;
mod determine;
mod echoes;
mod estimator;
mod far;
mod folds;
mod held_out;
mod joint;
mod lbfgs;
mod likelihood;
mod map_drift;
mod measure;
mod modified_pga;
mod patches;
mod pga;
mod rigid;
mod rounds;
mod search;
mod sharpen;
mod sharpness;
mod slips;
mod split;
mod starts;
mod texture;
mod tiles;
mod track_error;
mod trials;

pub use correction::{Corrected, Correction, Misfit};
pub use determine::{Expected, Model, Problem, determine, rehearse};
pub use echoes::Points;
pub use estimator::{Estimator, UnknownEstimator};
pub use held_out::{HeldOut, SIGNIFICANCE};
pub use map_drift::MapDrift;
pub use measure::{Measure, PARTS, Sight, UnknownMeasure, merit, merits};
pub use modified_pga::ModifiedPhaseGradient;
pub use pga::PhaseGradient;
pub use rounds::{
    Figures, HELD_IMAGES, Method, Round, RoundInput, SharpenError, Stopping, Subject,
};
pub use search::{Axis, Order, Search, Tuned, search};
pub use sharpen::{Outcome, Sharpened, most_images, sharpen};

pub use sharpness::{Goal, MIN_ACROSS, Sharpness, Unknown, UnknownGoal, UnknownName};
pub use slips::MAX_STEP_RAD;
pub use trials::{Scan, TuneError, Verdict, Views};
