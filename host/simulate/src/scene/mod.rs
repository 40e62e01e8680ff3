//! Reflecting and occluding objects of a scene.
//!
//! The amplitude of a scatterer is the square root of its radar cross section in square metres, with the phase of its
//! reflection: an amplitude of 1 is 1 m². The pixel of a point in a focused image has this amplitude, times the mean
//! over pulses (weighted by the slow-time window) of antenna gain, spreading and visibility ([`super::engine`]); the
//! mean is 1 for isotropic antennas without spreading loss.
//!
//! [`Clutter`], [`Picture`], [`Building`], [`Vehicle`] and [`Tree`] represent extended objects by points. [`InternalMotion`] gives the points of
//! clutter velocities, [`Texture`] K-distributed amplitudes, and [`Backscatter`] means that depend on the angle of incidence ([`Cover`]). All stand on
//! the [`Ground`], a plane or a [`Terrain`], which casts shadows ([`TerrainShadow`]).

mod building;
mod clutter;
mod corner;
mod cover;
mod facet;
mod ground;
mod internal_motion;
mod mask;
mod parts;
mod picture;
pub mod shadow;
mod terrain;
mod terrain_shadow;
mod texture;
mod tree;
mod vehicle;

use std::sync::Arc;

pub use building::Building;
pub(crate) use clutter::MAX_POINTS;
pub use clutter::{Area, Clutter, Density};
pub use cover::{Backscatter, Cover, Polarisation};
pub use facet::Facet;
pub use ground::Ground;
pub use internal_motion::InternalMotion;
pub(crate) use internal_motion::MAX_SPREAD_M_S;
pub use mask::Mask;
pub use parts::{Block, Corner, Mover, MovingBlock, MovingPoint, SceneError};
pub use picture::{Picture, Placement};
pub use terrain::{HeightFunction, Hill, Ridges, Terrain};
pub use terrain_shadow::{MAX_MAPS, Shade, TerrainShadow};
pub use texture::Texture;
pub use tree::{Canopy, Tree};
pub use vehicle::Vehicle;

use super::Scatterer;

/// Reflecting and occluding objects.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Static isotropic points: point targets, clutter, pixels of a picture, walls.
    pub points: Vec<Scatterer>,
    /// Isotropic points of constant velocity: clutter with internal motion.
    pub moving_points: Vec<MovingPoint>,
    /// Triangular trihedral corner reflectors.
    pub corners: Vec<Corner>,
    /// Moving isotropic point targets.
    pub movers: Vec<Mover>,
    /// Scatterers that depend on the azimuth, of constant velocity: parts of vehicles.
    pub facets: Vec<Facet>,
    /// Opaque boxes, which occlude objects behind them.
    pub blocks: Vec<Block>,
    /// Opaque boxes of constant velocity.
    pub moving_blocks: Vec<MovingBlock>,
    /// Foliage, which attenuates objects behind and within it.
    pub canopies: Vec<Canopy>,
    /// Shadow of the terrain.
    pub terrain_shadow: Option<Arc<TerrainShadow>>,
}

impl Scene {
    /// Whether no object hides or attenuates another.
    pub fn is_open(&self) -> bool {
        self.blocks.is_empty()
            && self.moving_blocks.is_empty()
            && self.canopies.is_empty()
            && self.terrain_shadow.is_none()
    }
}
