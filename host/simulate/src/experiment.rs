//! A radar, its way, and a scene: everything that a simulation is made from.

use std::sync::Arc;

use super::engine::Method;
use super::scene::Scene;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::Channel;
use subaperture_model::radar::{Antenna, Radar, Reference};
use subaperture_model::track::Trajectory;

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

    /// What the channel of a pair is. Its name is `1` where there is one pair only, else as `T1R2`.
    pub fn about(&self, pair: Pair) -> Channel {
        let radar = &self.radar;
        let name = match radar.transmitters.len() * radar.receivers.len() {
            1 => "1".to_owned(),
            _ => format!("T{}R{}", pair.transmitter + 1, pair.receiver + 1),
        };
        let antenna = |all: &[Antenna], i: usize| all.get(i).map(|antenna| antenna.name.clone());
        match (
            antenna(&radar.transmitters, pair.transmitter),
            antenna(&radar.receivers, pair.receiver),
        ) {
            (Some(transmitter), Some(receiver)) => {
                Channel::new(name).of_antennas(transmitter, receiver)
            }
            _ => Channel::new(name),
        }
    }
}
