//! Surfaces of the Earth on which images are focused: models of the ground's elevation, and heights above the ellipsoid.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture`
//! has it as its module `terrain`.
//!
//! ```text
//! grid, frame ─> Region ─> Ground (HGT, GeoTIFF: the part that the grid needs) ─> relief ─> ImageGrid::on
//! ```
//!
//! What is focused in a plane stands where it is only if it lies in that plane: what is higher appears nearer to the radar (layover).
//! [`relief`] lays the pixels of a grid on the ground instead, or on a surface of constant height above the ellipsoid.
//!
//! **Heights.** [`Ground`] tells heights above the WGS 84 ellipsoid. Models of the ground mostly state heights above mean sea level, that is the geoid
//! (SRTM and Copernicus: EGM96, EGM2008); between both lie -107 to +86 m. The undulation is added where it is given ([`Geoid`]); where it is
//! not, heights are taken as they are.
//!
//! **Neglected.** A relief has one height over a place: no overhangs, no bridges. Between posts of a model, heights are bilinear.
#![forbid(unsafe_code)]

mod directory;
mod error;
mod geokeys;
mod geotiff;
mod ground;
mod hgt;
mod lattice;
mod raster;
mod region;
mod surface;

pub use error::TerrainError;
pub use ground::{Geoid, Ground};
pub use region::Region;
pub use surface::{Surface, relief};
