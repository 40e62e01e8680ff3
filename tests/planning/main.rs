//! What is told before the work: the radar's planner, widths from the support, the survey of an aperture.

mod radar;
mod support;
mod survey;
