//! Radar images on the map.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture` has it as its module `maps`.
//!
//! An image of a scene that is tied to the Earth ([`subaperture_model::geometry::SceneFrame`]) is read where the pixels of a map are, north up, in UTM or in
//! longitude and latitude:
//!
//! ```text
//! Raster::covering ──> Ortho (carrier off, windowed sinc, carrier on) ──> cog::write, kmz::write, picture::write
//! ```
//!
//! | module | what it writes |
//! |---|---|
//! | [`cog`] | cloud-optimised GeoTIFF: dB in 8 bits, amplitude or complex values in float32; overviews |
//! | [`stac`] | a STAC item beside it |
//! | [`kmz`] | ground overlays for Google Earth, tiles for large maps |
//! | [`picture`] | PNG with a world file |
//!
//! Places are those of the grid's plane, straight above or below the map's ([`Raster`]), or for images of others where their metadata say ([`Lying`]); UTM is exact to nanometres. Images are read in windows and written
//! tile by tile: neither need fit in memory.
#![forbid(unsafe_code)]

mod carrier;
pub mod cog;
mod error;
pub mod kmz;
mod levels;
mod lying;
mod ortho;
pub mod picture;
mod projection;
mod pyramid;
mod raster;
pub mod stac;
mod surface;
mod tiff;

pub use error::MapError;
pub use levels::{Levels, Remap};
pub use lying::Lying;
pub use ortho::{Ortho, Source};
pub use projection::Projection;
pub use raster::Raster;
