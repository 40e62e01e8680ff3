//! Where things are: the scene frame, image grids and their axes.

mod frame;
mod geodetic;
mod grid;
mod scene_axes;
mod utm;

pub use frame::SceneFrame;
pub use geodetic::Geodetic;
pub use grid::{Axis, Extent, GridError, ImageGrid};
pub use scene_axes::SceneAxis;
pub use utm::{Utm, UtmError, Zone};
