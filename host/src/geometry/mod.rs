//! Where things are: the scene frame, image grids, patches of a grid.

mod frame;
mod geodetic;
mod grid;

pub use frame::SceneFrame;
pub use geodetic::Geodetic;
pub use grid::{Axis, Extent, GridError, ImageGrid};
