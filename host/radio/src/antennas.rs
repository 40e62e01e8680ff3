//! Phase reference of a capture, and positions of its antennas.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use subaperture_describe::declare::Choice;
use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Phase reference of the echo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Choice, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Loopback cable from the transmitter to receiver 0; receiver 1 has the antenna (Chim 2018, Fig. 5.4).
    #[default]
    Loopback,
    /// Direct wave from the transmitter to the antennas of both receivers, at a known short delay.
    Leakage,
    /// Transmitted tone only. The synthesisers' random phases stay in the echo, so that no range profile is possible;
    /// for demonstration.
    #[skip]
    None,
}

impl Reference {
    /// Name in plans and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Loopback => "loopback",
            Self::Leakage => "leakage",
            Self::None => "none",
        }
    }

    /// Receiver channels that contain echoes.
    pub fn receivers(self) -> &'static [usize] {
        match self {
            Self::Leakage => &[0, 1],
            Self::Loopback | Self::None => &[1],
        }
    }
}

/// Antenna phase centres in body axes, metres; x forward, y left, z up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Antennas {
    /// Position of the transmit antenna.
    pub transmitter_m: DVec3,
    /// Antennas of receivers 0 and 1. With a loopback reference, receiver 0 has no antenna and its position is ignored.
    pub receivers_m: [DVec3; 2],
}

impl Antennas {
    /// Delay of the direct wave from the transmitter to a receiver's antenna, seconds.
    pub fn direct_s(&self, receiver: usize) -> f64 {
        self.transmitter_m.distance(self.receivers_m[receiver]) / SPEED_OF_LIGHT_M_S
    }

    /// Whether all coordinates are finite.
    pub fn is_finite(&self) -> bool {
        self.transmitter_m.is_finite() && self.receivers_m.iter().all(|place| place.is_finite())
    }
}
