//! Where antennas are when a wave is received.

use glam::DVec3;

use crate::experiment::Experiment;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{Antenna, Motion, Reference};
use subaperture_model::track::Trajectory;

/// Where antennas are when a wave is received, and the reference.
pub(super) struct Sight {
    pub(super) antennas_m: [DVec3; 2],
    pub(super) reference_m: DVec3,
    pub(super) reference_path_m: f64,
}

/// Rounds of the delay between transmission and reception; each shrinks its error by `v / c`.
const DELAY_ROUNDS: usize = 4;

pub(super) fn moving(motion: Motion) -> bool {
    motion == Motion::True
}

/// Antennas and reference of a wave received at `time_s`.
pub(super) fn look(
    experiment: &Experiment,
    body: &dyn Trajectory,
    transmitter: &Antenna,
    receiver: &Antenna,
    time_s: f64,
) -> Sight {
    let pose = body.pose(time_s);
    let receiver_m = pose.point_m(receiver.offset_m);
    let moves = moving(experiment.radar.motion);
    match experiment.reference {
        Reference::Point(reference_m) => {
            let mut transmitter_m = pose.point_m(transmitter.offset_m);
            let path_m = |transmitter_m: DVec3| {
                transmitter_m.distance(reference_m) + receiver_m.distance(reference_m)
            };
            for _ in 0..if moves { DELAY_ROUNDS } else { 0 } {
                let sent_s = time_s - path_m(transmitter_m) / SPEED_OF_LIGHT_M_S;
                transmitter_m = body.pose(sent_s).point_m(transmitter.offset_m);
            }
            Sight {
                antennas_m: [transmitter_m, receiver_m],
                reference_m,
                reference_path_m: path_m(transmitter_m),
            }
        }
        Reference::Range(range_m) => {
            let sent_s = time_s
                - if moves {
                    2.0 * range_m / SPEED_OF_LIGHT_M_S
                } else {
                    0.0
                };
            let transmitter_m = body.pose(sent_s).point_m(transmitter.offset_m);
            let ahead = pose.attitude * transmitter.boresight;
            Sight {
                antennas_m: [transmitter_m, receiver_m],
                reference_m: 0.5 * (transmitter_m + receiver_m) + ahead * range_m,
                reference_path_m: 2.0 * range_m,
            }
        }
    }
}
