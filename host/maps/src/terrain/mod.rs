//! Elevation models and surfaces of the Earth on which images are focused.
//!
//! ```text
//! PixelSurface: grid, frame ─> Region ─> Ground (HGT, GeoTIFF: the part that the grid needs) ─> relief ─> ImageGrid::on
//! ```
//!
//! An image focused on a plane shows terrain above the plane displaced towards the radar (layover, foreshortening).
//! [`relief`] places the pixels of a grid on the ground instead, or on a surface of constant height above the ellipsoid.
//!
//! **Heights.** [`Ground`] gives heights above the WGS 84 ellipsoid. Most elevation models state heights above mean sea level, that is the geoid
//! (SRTM: EGM96; Copernicus: EGM2008); the geoid undulation ranges from -107 to +86 m. It is added where a [`Geoid`] is given; otherwise
//! heights are used as ellipsoidal.
//!
//! **Limits.** A relief is single-valued: no overhangs, no bridges. Heights between posts are bilinear.

pub mod bands;
mod chunks;
mod directory;
mod error;
mod geokeys;
mod geotiff;
mod ground;
mod hgt;
mod lattice;
mod pixels;
mod raster;
mod region;
mod surface;
mod vertical;

pub use error::TerrainError;
pub use ground::{Geoid, Ground};
pub use pixels::{PixelSurface, Placed, PlacementError};
pub use region::Region;
pub use surface::{Surface, relief};
