//! Orthorectified maps of radar images, and resampling of images.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture` has it as its module `maps`.
//!
//! An image whose scene has a position on the Earth ([`subaperture_model::geometry::SceneFrame`]) is interpolated at the pixels of a north-up map in UTM or in
//! longitude and latitude:
//!
//! ```text
//! Raster::covering ──> Ortho (remove carrier, windowed sinc, restore carrier) ──> cog::write, kmz::write, picture::write
//! ```
//!
//! | module | output |
//! |---|---|
//! | [`cog`] | cloud-optimised GeoTIFF: dB in 8 bits, amplitude or complex values in float32; overview levels |
//! | [`stac`] | STAC item of a map |
//! | [`kmz`] | ground overlays for Google Earth, tiled for large maps |
//! | [`picture`] | PNG with a world file |
//!
//! [`Resampled`] resamples an image to the pixels of another, so that both can be compared.
//!
//! A map position shows the point of the focusing surface vertically above or below it ([`Raster`]). Images from other software are projected by their metadata
//! ([`ProjectionModel`]). UTM is exact to nanometres. Images are read in windows and written tile by tile; neither has to fit in memory.
#![forbid(unsafe_code)]

mod carrier;
pub mod cog;
mod error;
mod first_error;
pub mod kmz;
mod levels;
mod ortho;
pub mod picture;
mod projection;
mod projection_model;
mod pyramid;
mod raster;
mod reader;
mod resampled;
pub mod stac;
mod surface;
mod tiff;

pub use error::MapError;
pub use levels::{Levels, Remap};
pub use ortho::{Ortho, Source};
pub use projection::Projection;
pub use projection_model::ProjectionModel;
pub use raster::Raster;
pub use resampled::{PixelPositions, Resampled};
