//! Antennas: position on a body, direction and pattern.

mod combined;
mod pattern;
mod table;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

pub use combined::{AntennaPatterns, CombinedPattern, FLOOR, LEAST};
pub use pattern::cosine_exponent;
pub use table::PatternTable;

/// Antenna on a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Antenna {
    /// Name for channels and errors.
    pub name: String,
    /// Phase centre, metres in body axes.
    pub offset_m: DVec3,
    /// Unit vector of the boresight, body axes.
    pub boresight: DVec3,
    /// Unit vector of the beam's elevation axis, body axes, orthogonal to `boresight`; azimuth is the rotation about
    /// it.
    pub up: DVec3,
    /// Antenna pattern about the boresight.
    pub pattern: Pattern,
    /// Point of the scene to which the beam is steered, metres in the scene frame; `None` for a boresight fixed in the body.
    pub aim_m: Option<DVec3>,
}

/// Amplitude of an antenna over direction, one way, 1 on boresight.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Pattern {
    /// Equal in all directions.
    #[default]
    Isotropic,
    /// `exp(-2 ln 2 ((az / az_w)^2 + (el / el_w)^2))` in amplitude: half the power at half the widths.
    Gaussian {
        /// Full half-power width in azimuth (about `up`), radians.
        azimuth_rad: f64,
        /// Full half-power width in elevation, radians.
        elevation_rad: f64,
    },
    /// Power of the cosine of the azimuth and of the elevation, 0 behind; exponents by [`cosine_exponent`].
    Cosine {
        /// Full half-power width in azimuth, radians.
        azimuth_rad: f64,
        /// Full half-power width in elevation, radians.
        elevation_rad: f64,
    },
    /// Uniformly illuminated rectangular aperture: sinc in both planes, with side lobes.
    Aperture {
        /// Full half-power width in azimuth, radians.
        azimuth_rad: f64,
        /// Full half-power width in elevation, radians.
        elevation_rad: f64,
    },
    /// Samples over azimuth and elevation, 1 at their maximum; 0 outside.
    Table(PatternTable),
}

/// Transmitting and receiving antenna of a channel, with the attitude of their bodies at each pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct MountedAntennas {
    /// Transmitting and receiving antenna.
    pub antennas: [Antenna; 2],
    /// Attitudes of both bodies per pulse, in scene axes.
    pub attitudes: Vec<[DQuat; 2]>,
}

impl MountedAntennas {
    /// Whether one of the antennas has a pattern.
    pub fn is_directive(&self) -> bool {
        is_directive(&self.antennas)
    }
}

/// Whether one of these antennas has a pattern.
pub fn is_directive(antennas: &[Antenna]) -> bool {
    let isotropic = |antenna: &Antenna| antenna.pattern == Pattern::Isotropic;
    !antennas.iter().all(isotropic)
}
