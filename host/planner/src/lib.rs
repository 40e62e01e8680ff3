//! Planning a collection: what a radar will show, what that takes, and what it costs.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `planner`.
//!
//! [`RadarPlan`] gathers everything for one collection, be it a recording or a pass that exists in numbers only
//! ([`Parameters`]). Each part stands for itself, with its equations:
//!
//! - [`sampling`]: resolution, and pulse spacing by Nyquist;
//! - [`grating`]: grating lobes of sub-CPIs in the thesis's mode, place and level;
//! - [`cost`]: memory and operations of the image formers;
//! - [`forecast`]: how long an image will take on this machine;
//! - [`radar_equation`]: the radar equation;
//! - [`ambiguity`]: the ambiguity function of pulses and bursts.
#![forbid(unsafe_code)]

pub mod ambiguity;
pub mod cost;
pub mod forecast;
pub mod grating;
pub mod parameters;
mod radar;
pub mod radar_equation;
pub mod sampling;

pub use parameters::{ParameterError, Parameters};
pub use radar::{Aperture, PlanError, RadarPlan, Request, SubCpis};
