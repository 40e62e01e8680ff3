//! Geometry: scene frame, image grids and their axes.

mod axis;
mod frame;
mod geodetic;
mod grid;
mod relief;
mod scene_axes;
mod troposphere;
mod utm;

pub use axis::{Axis, GridError};
pub use frame::SceneFrame;
pub use geodetic::Geodetic;
pub use grid::{Extent, ImageGrid};
pub use relief::Relief;
pub use scene_axes::SceneAxis;
pub use troposphere::Troposphere;
pub use utm::{Utm, UtmError, Zone};
