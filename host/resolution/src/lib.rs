//! What a collection can show: the support of its spectrum around a place, and what follows from it.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `resolution`.
//!
//! - [`slant`]: the plane of range and cross-range;
//! - [`support`]: which spatial frequencies pulses sample, their projection on a line and the response along it;
//! - [`theory`]: widths and side lobes of a response;
//! - [`survey`]: what a whole collection can show, in numbers: aperture, resolution, sampling, and a grid to form without being told.
#![forbid(unsafe_code)]

pub mod slant;
pub mod support;
pub mod survey;
pub mod theory;
