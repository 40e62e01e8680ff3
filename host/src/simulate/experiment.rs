//! A radar, its way, and a scene: everything that a simulation is made from.

use std::sync::Arc;

use glam::DVec3;

use super::body::Trajectory;
use super::engine::Method;
use super::radar::Radar;
use super::scene::Scene;
use crate::geometry::{Extent, SceneFrame};

/// One simulated collection.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// A name for titles and reports.
    pub name: String,
    /// Where the scene frame lies.
    pub frame: SceneFrame,
    /// The part of the scene that the collection is meant for.
    pub extent: Option<Extent>,
    /// The radar.
    pub radar: Radar,
    /// How it moves.
    pub track: Arc<dyn Trajectory>,
    /// How the recording says it moves; as it does, if `None`.
    pub measured: Option<Arc<dyn Trajectory>>,
    /// What it sees.
    pub scene: Scene,
    /// What phases and amplitudes are referred to.
    pub reference: Reference,
    /// Seed of everything random.
    pub seed: u64,
    /// How sums over scatterers are computed.
    pub method: Method,
}

/// What phases and amplitudes are referred to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// A point of the scene: phases are compensated to it with the measured track, pulse by pulse.
    Point(DVec3),
    /// A range from the radar, metres, as a receiver with one range gate has it: the same path for all
    /// pulses. Positions count from the origin of the scene for amplitudes.
    Range(f64),
}

/// A transmitter and a receiver of the radar, by index: a channel of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Index into [`Radar::transmitters`].
    pub transmitter: usize,
    /// Index into [`Radar::receivers`].
    pub receiver: usize,
}

impl Experiment {
    /// Every pair, receivers fastest.
    pub fn pairs(&self) -> Vec<Pair> {
        let receivers = self.radar.receivers.len();
        let all = 0..self.radar.transmitters.len() * receivers;
        all.map(|i| Pair {
            transmitter: i / receivers,
            receiver: i % receivers,
        })
        .collect()
    }
}
