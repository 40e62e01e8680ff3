//! What a capture's phases are referred to, and where its antennas are on the body that carries them.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// What the echo is referred to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// The loop from the transmitter to receiver 0; receiver 1 has the antenna (Chim 2018, Fig. 5.4).
    #[default]
    Loopback,
    /// The transmitter heard directly, at a known short delay, by the antennas of both receivers.
    Leakage,
    /// Nothing but the tone as it was sent: the synthesisers' phases stay in the echo, and there is no profile. To show that.
    None,
}

impl Reference {
    /// As plans and messages have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Loopback => "loopback",
            Self::Leakage => "leakage",
            Self::None => "none",
        }
    }

    /// Which of the two receivers' channels hold echoes.
    pub fn receivers(self) -> &'static [usize] {
        match self {
            Self::Leakage => &[0, 1],
            Self::Loopback | Self::None => &[1],
        }
    }
}

/// Phase centres, metres from the body's origin; its axes are x forward, y left, z up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Antennas {
    /// The transmitter's.
    pub transmitter_m: DVec3,
    /// Those of receivers 0 and 1; with a loop the former has none, and its place says nothing.
    pub receivers_m: [DVec3; 2],
}

impl Antennas {
    /// What the transmitter's wave takes to a receiver's antenna, seconds.
    pub fn direct_s(&self, receiver: usize) -> f64 {
        self.transmitter_m.distance(self.receivers_m[receiver]) / SPEED_OF_LIGHT_M_S
    }

    /// Whether all places are of numbers.
    pub fn is_finite(&self) -> bool {
        self.transmitter_m.is_finite() && self.receivers_m.iter().all(|place| place.is_finite())
    }
}
