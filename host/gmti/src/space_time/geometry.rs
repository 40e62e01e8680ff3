//! Geometry of sub-CPIs: positions of the antennas of each channel, and the place of a moving target in a range-Doppler map.

use glam::DVec3;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_model::phase_history::{Channels, Pulse};

use crate::alignment::Alignment;

/// Motion of a point target: constant acceleration about an epoch.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Motion {
    /// Time of the position, seconds from the start of the collection.
    pub epoch_s: f64,
    /// Position at the epoch, metres.
    pub position_m: DVec3,
    /// Velocity at the epoch, metres per second.
    pub velocity_m_s: DVec3,
    /// Acceleration, metres per second squared.
    pub acceleration_m_s2: DVec3,
}

impl Motion {
    /// Position at a time, metres.
    pub fn at(&self, time_s: f64) -> DVec3 {
        let t = time_s - self.epoch_s;
        self.position_m + self.velocity_m_s * t + self.acceleration_m_s2 * (0.5 * t * t)
    }
}

/// Distance of the nodes of a section from its middle, as a fraction of its length: the line through the paths at both nodes is the least-squares fit
/// to a quadratic path over the section.
const NODE: f64 = 0.288_675_134_594_812_9;

/// Antennas of a channel at an along-track position.
#[derive(Clone, Copy, Debug)]
struct Node {
    time_s: f64,
    transmitter_m: DVec3,
    receiver_m: DVec3,
    /// Path to the centre of the scene, metres.
    reference_path_m: f64,
}

impl Node {
    /// Path to a point relative to that to the centre of the scene, metres.
    fn path_m(&self, point: DVec3) -> f64 {
        (point - self.transmitter_m).length() + (point - self.receiver_m).length()
            - self.reference_path_m
    }
}

/// Nodes of a sub-CPI for every channel.
#[derive(Clone, Debug)]
pub(super) struct SubCpiGeometry {
    /// Section of the track, start and end, metres.
    pub(super) section_m: [f64; 2],
    nodes: Vec<[Node; 2]>,
}

/// Place of a target in the maps of a sub-CPI.
#[derive(Clone, Debug, Default)]
pub(super) struct Place {
    /// Path of each channel relative to the centre of the scene, metres.
    pub(super) paths_m: Vec<f64>,
    /// Path rate of channel 0 relative to the centre of the scene, metres per metre of track.
    pub(super) slope: f64,
}

impl Place {
    /// Mean path of the channels, metres. Clutter is aligned in the channels at one range bin, which is that of this path.
    pub(super) fn path_m(&self) -> f64 {
        self.paths_m.iter().sum::<f64>() / self.paths_m.len() as f64
    }
}

impl SubCpiGeometry {
    /// Geometry of a section of the track, with paths relative to `centre_m`.
    pub(super) fn new(
        channels: &Channels,
        alignment: &Alignment,
        section_m: [f64; 2],
        centre_m: DVec3,
    ) -> Self {
        let [start_m, end_m] = section_m;
        let (middle_m, offset_m) = ((start_m + end_m) / 2.0, NODE * (end_m - start_m));
        let node = |channel: usize, along_m: f64| {
            let pulses = &channels.channel(channel).collection().pulses;
            let (n, part) = alignment.place(channel, along_m);
            let between = |of: fn(&Pulse) -> DVec3| of(&pulses[n]).lerp(of(&pulses[n + 1]), part);
            let (transmitter_m, receiver_m) = (
                between(|pulse| pulse.transmitter_m),
                between(|pulse| pulse.receiver_m),
            );
            Node {
                time_s: alignment.time_s(channel, along_m),
                transmitter_m,
                receiver_m,
                reference_path_m: (centre_m - transmitter_m).length()
                    + (centre_m - receiver_m).length(),
            }
        };
        let nodes = (0..channels.len())
            .map(|channel| [-1.0, 1.0].map(|side| node(channel, middle_m + side * offset_m)));
        Self {
            section_m,
            nodes: nodes.collect(),
        }
    }

    /// Time at which channel 0 is in the middle of the section, seconds.
    pub(super) fn time_s(&self) -> f64 {
        let [early, late] = self.nodes[0];
        (early.time_s + late.time_s) / 2.0
    }

    /// Along-track position of the middle, metres.
    pub(super) fn along_m(&self) -> f64 {
        (self.section_m[0] + self.section_m[1]) / 2.0
    }

    /// Phase centre of channel 0 in the middle, metres.
    pub(super) fn antenna_m(&self) -> DVec3 {
        let centre = |node: &Node| node.transmitter_m.midpoint(node.receiver_m);
        centre(&self.nodes[0][0]).midpoint(centre(&self.nodes[0][1]))
    }

    /// Distance of the nodes along the track, metres.
    fn spacing_m(&self) -> f64 {
        2.0 * NODE * (self.section_m[1] - self.section_m[0])
    }

    /// Stationary point of the plane through `start_m` along `axes` with this relative path, metres, and this slope, metres per metre of track.
    pub(super) fn locate(
        &self,
        start_m: DVec3,
        axes: [DVec3; 2],
        path_m: f64,
        slope: f64,
    ) -> Option<DVec3> {
        let nodes = self.nodes[0].map(|node| [node.transmitter_m, node.receiver_m]);
        let [early_m, late_m] = self.nodes[0].map(|node| node.reference_path_m);
        let path_m = path_m + (early_m + late_m) / 2.0;
        let apart_m = slope * self.spacing_m() + late_m - early_m;
        // Two pulses, half a pulse from the middle: the rate is the difference of both paths.
        SubCpi::from_nodes(2, nodes).locate(start_m, axes, path_m, apart_m)
    }

    /// Place of a target at `position_m(time_s)`.
    pub(super) fn place(&self, position_m: impl Fn(f64) -> DVec3, place: &mut Place) {
        place.paths_m.clear();
        let spacing_m = self.spacing_m();
        for (channel, nodes) in self.nodes.iter().enumerate() {
            let [early_m, late_m] = nodes.map(|node| node.path_m(position_m(node.time_s)));
            place.paths_m.push((early_m + late_m) / 2.0);
            if channel == 0 {
                place.slope = (late_m - early_m) / spacing_m;
            }
        }
    }
}
