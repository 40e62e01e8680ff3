//! Planning of SAR collections: resolution, sampling, ambiguities, sensitivity, memory and processing time.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `planner`.
//!
//! [`RadarPlan`] combines all parts for one collection, recorded or defined by numbers
//! ([`Parameters`]). Each module can be used alone and documents its equations:
//!
//! - [`sampling`]: resolution, and Nyquist pulse spacing;
//! - [`grating`]: position and level of grating lobes of sub-CPIs in the thesis's mode;
//! - [`cost`]: memory and operations of the image formers;
//! - [`forecast`]: processing time on this machine;
//! - [`radar_equation`]: the radar equation;
//! - [`chain`]: levels, noise and compression along the signal chain;
//! - [`stepped`]: speed limits of sweeps of stepped carriers;
//! - [`ambiguity`]: ambiguity function of pulses and bursts.
#![forbid(unsafe_code)]

pub mod ambiguity;
pub mod chain;
pub mod cost;
pub mod forecast;
pub mod grating;
pub mod parameters;
mod radar;
pub mod radar_equation;
pub mod sampling;
pub mod stepped;

pub use parameters::{ParameterError, Parameters};
pub use radar::{Aperture, PlanError, RadarPlan, Request, SubCpis};
