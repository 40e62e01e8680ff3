//! Tests of planning: radar planner, widths from the spectral support, survey of an aperture.

mod radar;
mod support;
mod survey;
