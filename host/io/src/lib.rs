//! File input and output: recordings, images and products. Part of [Subaperture](https://docs.rs/subaperture); the
//! crate `subaperture` contains it as its module `io`.
//!
//! [`open`] opens recordings by their content, on disk or at URLs ([`remote`]). [`product`] is the output folder of an image. [`atomic`],
//! [`together`], [`place`], [`lock`] and [`claim`] ensure that outputs are complete or absent and replace no file of
//! another program. [`written`] lists the written files with their kinds.
//!
//! # Features
//! All are on by default:
//!
//! | feature | adds | dependencies |
//! |---|---|---|
//! | `container` | XML elements, NITF segments and bounded reads: `container` | `roxmltree` |
//! | `cphd` | CPHD 1.x, read and written: `cphd`; CRSD 1.0, read: `crsd`; raw echoes to phase history: `receive` (brings `container`) | |
//! | `gotcha` | AFRL's GOTCHA files (MATLAB 5): `gotcha`; with `cphd`, AFRL's GMTI challenge: `gotcha_gmti` | `flate2` |
//! | `npz` | arrays in NumPy archives ([`npy::Array::read`]), and phase history from them: `arrays` | `zip`, `flate2` |
//! | `hdf5` | phase history from arrays in HDF5 (requires `npz`); with `cphd`, NISAR L0B: `l0b` | `hdf5-pure`, `flate2` |
//! | `recording` | raw recordings described in TOML, and tracks: `recording`, `receive`, `recorded_track`, `motive`, `track_csv`, `estimated_track`, `track_axes`, `target_csv`, `phase_csv`, `pattern_csv` | `subaperture-describe`, `subaperture-navigation` |
//!
//! NumPy's `.npy` and images are always available. A file whose feature is off is recognised and refused with the
//! name of the feature.
#![forbid(unsafe_code)]

#[cfg(feature = "npz")]
pub mod arrays;
pub mod atomic;
pub mod claim;
#[cfg(feature = "container")]
pub mod container;
#[cfg(feature = "cphd")]
pub mod cphd;
#[cfg(feature = "cphd")]
pub mod crsd;
pub mod date;
#[cfg(feature = "recording")]
pub mod estimated_track;
#[cfg(any(feature = "gotcha", feature = "npz"))]
mod frequencies;
pub mod geojson;
#[cfg(feature = "gotcha")]
pub mod gotcha;
pub mod gotcha_gmti;
#[cfg(feature = "hdf5")]
mod hdf5_numbers;
pub mod input;
pub mod json;
#[cfg(all(feature = "cphd", feature = "hdf5"))]
pub mod l0b;
pub mod lock;
#[cfg(feature = "recording")]
mod marker_swaps;
#[cfg(feature = "gotcha")]
mod matlab;
#[cfg(feature = "gotcha")]
mod matlab_fields;
#[cfg(feature = "recording")]
pub mod motive;
mod moves;
pub mod npy;
pub mod open;
pub mod ours;
#[cfg(feature = "recording")]
pub mod pattern_csv;
#[cfg(feature = "recording")]
pub mod phase_csv;
pub mod place;
pub mod product;
#[cfg(any(feature = "cphd", feature = "recording"))]
mod raw_check;
#[cfg(any(feature = "cphd", feature = "recording"))]
pub mod receive;
#[cfg(feature = "recording")]
pub mod recorded_track;
#[cfg(feature = "recording")]
pub mod recording;
pub mod remote;
pub mod selftest;
pub mod stack;
pub mod staging;
#[cfg(feature = "recording")]
pub mod target_csv;
pub mod tiles;
pub mod together;
#[cfg(feature = "recording")]
pub mod touchstone;
#[cfg(feature = "recording")]
pub mod track_axes;
#[cfg(feature = "recording")]
pub mod track_csv;
pub mod unfinished;
mod write_error;
pub mod written;
pub mod xml;
pub mod zarr;
mod zarr_arrays;

pub use subaperture_model::phase_history::ReadError;
