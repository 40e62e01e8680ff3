//! Static radar shared by the items of Chim 2018, looking along y.

use std::sync::Arc;

use glam::DVec3;

use subaperture_model::geometry::SceneFrame;
use subaperture_model::radar::{Antenna, Motion, Pattern, Radar, Receiver, Reference, Waveform};
use subaperture_model::track::Linear;
use subaperture_simulate::Experiment;
use subaperture_simulate::engine::Method;
use subaperture_simulate::scene::Scene;

/// One undisturbed pulse of `waveform` over `scene` from `radar_m`, without phase
/// compensation.
pub(super) fn standing(
    name: &str,
    waveform: Waveform,
    pattern: Pattern,
    radar_m: DVec3,
    scene: Scene,
) -> Experiment {
    let antenna = Antenna {
        name: "antenna".to_owned(),
        offset_m: DVec3::ZERO,
        boresight: DVec3::Y,
        up: DVec3::Z,
        pattern,
        aim_m: None,
    };
    Experiment {
        name: name.to_owned(),
        frame: SceneFrame::Local,
        extent: None,
        radar: Radar {
            waveform,
            num_pulses: 1,
            pri_s: 1e-3,
            start_s: 0.0,
            transmitters: vec![antenna.clone()],
            receivers: vec![antenna],
            motion: Motion::StopAndGo,
            spreading: false,
            receiver: Receiver::default(),
        },
        track: Arc::new(Linear {
            position_m: radar_m,
            velocity_m_s: DVec3::ZERO,
            at_s: 0.0,
        }),
        measured: None,
        scene,
        reference: Reference::Range(0.0),
        seed: 1,
        method: Method::Sum,
        collection_start: None,
        logs: Vec::new(),
    }
}
