//! Simulated experiment: radar, track and scene.

use std::sync::Arc;

use super::engine::Method;
use super::navigation_log::NavigationLog;
use super::scene::Scene;
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::phase_history::Channel;
use subaperture_model::radar::{Antenna, Radar, Reference};
use subaperture_model::track::Trajectory;

/// All inputs of a simulated collection: radar, tracks, scene and seed.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Name, for titles and reports.
    pub name: String,
    /// Position of the scene frame on the Earth.
    pub frame: SceneFrame,
    /// Extent of the scene to be imaged; `None` if unspecified.
    pub extent: Option<Extent>,
    /// Waveform, antennas and receiver of the radar.
    pub radar: Radar,
    /// True track of the body that carries the antennas.
    pub track: Arc<dyn Trajectory>,
    /// Measured track written to the recording; `None` for the true track.
    pub measured: Option<Arc<dyn Trajectory>>,
    /// Scatterers and occluding boxes.
    pub scene: Scene,
    /// Motion compensation reference point or range; amplitudes also refer to it.
    pub reference: Reference,
    /// Seed of all random effects.
    pub seed: u64,
    /// Method for sums over scatterers.
    pub method: Method,
    /// Date and time of time 0, UTC, as `YYYY-MM-DDThh:mm:ss.ssssssZ`; `None` if unspecified.
    pub collection_start: Option<String>,
    /// Navigation logs of the true track.
    pub logs: Vec<NavigationLog>,
}

/// Transmitter and receiver of a channel, by index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Index into [`Radar::transmitters`].
    pub transmitter: usize,
    /// Index into [`Radar::receivers`].
    pub receiver: usize,
}

impl Experiment {
    /// All antenna pairs; the receiver index varies fastest.
    pub fn pairs(&self) -> Vec<Pair> {
        let receivers = self.radar.receivers.len();
        let all = 0..self.radar.transmitters.len() * receivers;
        all.map(|i| Pair {
            transmitter: i / receivers,
            receiver: i % receivers,
        })
        .collect()
    }

    /// Description of a pair's channel. Its name is `1` with a single pair, otherwise for example `T1R2`.
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
