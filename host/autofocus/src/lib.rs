//! Unknown geometry, phases and tracks found by the sharpness of the image.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `autofocus`.
//!
//! # Parameters
//!
//! A search knows its parameters only by their intervals, and the image only by a figure of merit, larger is better:
//! the caller says how values become a merit, usually through [`merit`]. It goes
//!
//! 1. over a grid: every combination of the parameters' values, or one parameter after another
//!    ([`Order::InTurn`]), the others kept at the best so far, from the middles of the intervals on, until nothing
//!    changes. In turn costs the sum of the counts in place of their product. It finds the same where the peak
//!    shows with the other parameters at the middles of their intervals, and its ridges are not oblique to the axes;
//! 2. around the best: all neighbours at half the step, moving while one is better, then half of that, and so on;
//! 3. to the vertex of a parabola through the best and its two last neighbours on each axis.
//!
//! How sharply the merit peaks is told by its *width*: how far apart the points are, on both sides of the
//! best, where the merit has fallen half way to its median over the interval, the other parameters at their
//! best. It says nothing of how far the peak is from the truth. That is told by the *error*, from what the search finds
//! without one part of the aperture and without another (`certainty.rs`), and by the [`Verdict`]: whether there is
//! a finding at all.
//!
//! Sharpness has many maxima: a grid whose step is above the width can miss the highest one. The widths tell
//! afterwards whether the step was fine enough.
//!
//! Some parameters move the image more than they defocus it. [`determine`] therefore compares the same pulses and the
//! same points, with pixels that follow them (`anchor.rs`): without, a clock's offset was found to 0.6 s and was
//! 2.4 s wrong.
//!
//! Focus does not tell everything. A shift that stays focused (of ranges seen from a short aperture, of clocks while the
//! platform goes evenly) needs a point of known place: [`Sight::Points`]. Measured on a public recording of a radar pushed
//! along a rail (`tests/recordings/described.rs`): sharpness finds the clocks' offset to 0.06 s and leaves the range bias open, the power at
//! one surveyed reflector finds both, and the reflector then lies within 3 cm of its survey.
//!
//! Every evaluation is made once. The result depends on nothing but the merit: it is deterministic if that is.
//!
//! # Phases and tracks
//!
//! What changes from pulse to pulse is no matter of a few parameters. [`sharpen()`] finds it by a [`Method`] and images of any
//! former, and never makes an image worse:
//!
//! | method | finds | for |
//! |---|---|---|
//! | [`PhaseGradient`] | a phase a pulse | scenes with some bright points, any error that is alike for all of them |
//! | [`ModifiedPhaseGradient`] | displacements of the antennas, two components a pulse | near scenes, points under different directions |
//! | [`Sharpness`] | either, as curves of more and more numbers | scenes without points that stand alone; tracks seen from afar |
//! | [`MapDrift`] | a polynomial of few terms | smooth errors, scenes without points |
//!
//! What comes out is a [`Correction`], and [`Corrected`] is the recording with it.
#![forbid(unsafe_code)]

mod anchor;
mod centring;
mod certainty;
mod correction;
mod curve;
mod determine;
mod echoes;
mod estimator;
mod joint;
mod lbfgs;
mod map_drift;
mod measure;
mod modified_pga;
mod patches;
mod pga;
mod rigid;
mod search;
mod sharpen;
mod sharpness;
mod trials;

pub use correction::{Corrected, Correction, Misfit};
pub use determine::{Expected, Model, Problem, determine, rehearse};
pub use echoes::Points;
pub use estimator::{Estimator, UnknownEstimator};
pub use map_drift::MapDrift;
pub use measure::{Measure, PARTS, Sight, UnknownMeasure, merit, merits};
pub use modified_pga::ModifiedPhaseGradient;
pub use pga::PhaseGradient;
pub use search::{Axis, Order, Search, Tuned, search};
pub use sharpen::{
    Figures, Look, Method, Round, SharpenError, Sharpened, Stopping, Subject, sharpen,
};

pub use sharpness::{Goal, LEAST_ACROSS, Sharpness, Unknown, UnknownGoal, UnknownName};
pub use trials::{Scan, TuneError, Verdict, Views};
