//! Antenna positions at the time of reception.

use glam::DVec3;

use crate::experiment::Experiment;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{Antenna, Motion, Reference, Waveform};
use subaperture_model::track::Trajectory;

/// Antenna positions at the time of reception, and the reference.
pub(super) struct Sight {
    pub(super) antennas_m: [DVec3; 2],
    pub(super) reference_m: DVec3,
    pub(super) reference_path_m: f64,
}

/// Iterations for the delay between transmission and reception; each reduces the error by `v / c`.
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

/// Antenna pair of an experiment.
pub(super) struct Eye<'a> {
    pub(super) experiment: &'a Experiment,
    pub(super) transmitter: &'a Antenna,
    pub(super) receiver: &'a Antenna,
}

impl Eye<'_> {
    /// Time at which positions of a pulse starting at `pulse_s` are taken, seconds: its middle for a radar with
    /// intra-pulse motion.
    pub(super) fn seen_at_s(&self, waveform: &Waveform, pulse_s: f64) -> f64 {
        let after_s = moving(self.experiment.radar.motion).then(|| waveform.middle_s());
        pulse_s + after_s.unwrap_or(0.0)
    }

    /// Name of the collection, with the names of the antennas if there are several pairs.
    pub(super) fn name(&self) -> String {
        let name = &self.experiment.name;
        match self.experiment.pairs().len() {
            1 => name.clone(),
            _ => format!("{name} {}-{}", self.transmitter.name, self.receiver.name),
        }
    }

    /// Antennas and reference of a body's pose at a time.
    pub(super) fn look(&self, body: &dyn Trajectory, time_s: f64) -> Sight {
        look(
            self.experiment,
            body,
            self.transmitter,
            self.receiver,
            time_s,
        )
    }
}
