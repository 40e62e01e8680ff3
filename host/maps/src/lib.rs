//! Orthorectified maps of radar images, and resampling of images.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the crate `subaperture` has it as its module `maps`.
//!
//! With the feature `terrain`, [`terrain`] reads elevation models and makes surfaces to focus on.
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

#[cfg(feature = "products")]
mod carrier;
#[cfg(feature = "products")]
pub mod cog;
#[cfg(feature = "products")]
mod error;
#[cfg(feature = "products")]
mod first_error;
#[cfg(feature = "products")]
pub mod kmz;
#[cfg(feature = "products")]
mod levels;
#[cfg(feature = "products")]
mod ortho;
#[cfg(feature = "products")]
pub mod picture;
#[cfg(feature = "products")]
mod projection;
#[cfg(feature = "products")]
mod projection_model;
#[cfg(feature = "products")]
mod pyramid;
#[cfg(feature = "products")]
mod raster;
#[cfg(feature = "products")]
mod reader;
#[cfg(feature = "products")]
mod resampled;
#[cfg(feature = "products")]
pub mod stac;
#[cfg(feature = "products")]
mod surface;
#[cfg(feature = "terrain")]
pub mod terrain;
#[cfg(feature = "products")]
mod tiff;

#[cfg(feature = "products")]
pub use error::MapError;
#[cfg(feature = "products")]
pub use levels::{Levels, Remap};
#[cfg(feature = "products")]
pub use ortho::{Ortho, Source};
#[cfg(feature = "products")]
pub use projection::Projection;
#[cfg(feature = "products")]
pub use projection_model::ProjectionModel;
#[cfg(feature = "products")]
pub use raster::Raster;
#[cfg(feature = "products")]
pub use resampled::{PixelPositions, Resampled};
