//! Antenna beam across the track, which selects the pulses that illuminate a point.

use serde::{Deserialize, Serialize};

/// Interval of the cone angle about the track, measured from broadside, in which the antennas illuminate the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// Full beamwidth, radians, in (0, pi).
    pub width_rad: f64,
    /// Squint of the beam centre, radians, positive forward of broadside.
    pub squint_rad: f64,
    /// Origin of width and squint.
    pub source: BeamSource,
    /// Velocity of the target in whose frame the geometry is given, m/s. The velocity of the antennas is that of the geometry plus this one.
    /// `None` for a frame at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_m_s: Option<[f64; 3]>,
}

/// Origin of a beam's width and squint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum BeamSource {
    /// Given by the user.
    Given,
    /// Stated in the recording's antenna description.
    Stated,
    /// Estimated from the azimuth Doppler spectrum of the samples.
    Estimated,
}

impl BeamSource {
    /// Description of the origin that follows the word "beam" in a message.
    pub fn name(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Stated => "stated by the recording",
            Self::Estimated => "estimated from the Doppler spectrum",
        }
    }
}

impl Beam {
    /// Create a beam of full width `width_rad` centred at `squint_rad`, for a frame at rest.
    pub fn new(width_rad: f64, squint_rad: f64, source: BeamSource) -> Self {
        Self {
            width_rad,
            squint_rad,
            source,
            target_m_s: None,
        }
    }

    /// Whether the width is positive and both edges of the beam are less than 90 degrees from broadside.
    pub fn is_sound(&self) -> bool {
        let edge = self.squint_rad.abs() + 0.5 * self.width_rad;
        self.width_rad > 0.0 && edge < std::f64::consts::FRAC_PI_2
    }
}
