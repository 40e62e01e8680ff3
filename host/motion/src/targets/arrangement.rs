//! Antennas of all channels, and their positions on the body, from the recorded positions of the first pulse.
//!
//! **Body.** Its origin is the midpoint between the mean transmitter and the mean receiver. Its x axis lies along the receivers, from one of the two farthest apart to the other (with one receiver from transmitter to
//! receiver; with both in one place level, across the direction to the reference point). Its y axis is boresight: towards the first pulse's reference point, as far as that is across x. Where x is level within 20
//! degrees, x and y are made level and z is up: the radar moves in the level plane, and height differences appear as range. Otherwise the plane contains x and the reference point.
//!
//! Antennas of pulses that are not simultaneous (time-multiplexed transmitters) are moved to the time of the first channel, by their motion to the channel's next pulse.

use crate::{Array, Pose};
use glam::{DMat3, DQuat, DVec2, DVec3};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Channels, PhaseHistory, Pulse};

/// Sine of the largest tilt of an array that counts as level.
const LEVEL: f64 = 0.34;

/// Distance below which two antenna positions are the same antenna, metres: far below any wavelength, above the rounding of positions in kilometres.
const SAME_M: f64 = 1e-6;

/// Antennas on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrangement {
    /// Origin of the body in the first pulse, metres in the scene frame.
    pub origin_m: DVec3,
    /// Rotation from the body's axes to the scene's in the first pulse.
    pub attitude: DQuat,
    /// Positions of the transmitters in the body's axes, metres.
    pub transmitters_m: Vec<DVec3>,
    /// Positions of the receivers in the body's axes, metres.
    pub receivers_m: Vec<DVec3>,
    /// Transmitter and receiver of each channel, by their numbers.
    pub of_channels: Vec<[usize; 2]>,
}

/// Reason why channels do not form an array.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ArrangementError {
    /// A channel has no pulses.
    #[error("the recording has no pulses")]
    NoPulses,
    /// Two channels have the same antennas.
    #[error("channels '{}' and '{}' have the same antennas: expected one channel per pair of transmitter and receiver", names[0], names[1])]
    Twice {
        /// Names of both channels.
        names: [String; 2],
    },
    /// A transmitter and a receiver have no channel.
    #[error(
        "expected {} channels, every pair of {transmitters} transmitters and {receivers} receivers, found {channels}",
        transmitters * receivers
    )]
    Pairs {
        /// Number of distinct transmitters.
        transmitters: usize,
        /// Number of distinct receivers.
        receivers: usize,
        /// Number of channels of the recording.
        channels: usize,
    },
}

impl Arrangement {
    /// Arrangement of a recording's channels.
    ///
    /// # Errors
    /// [`ArrangementError`].
    pub fn of(channels: &Channels) -> Result<Self, ArrangementError> {
        let antennas: Option<Vec<[DVec3; 2]>> = channels
            .iter()
            .map(|(_, history)| at_first(channels.channel(0), history))
            .collect();
        let antennas = antennas.ok_or(ArrangementError::NoPulses)?;
        let first = channels.channel(0).collection().pulses.first();
        let first = first.ok_or(ArrangementError::NoPulses)?;
        let names: Vec<String> = channels.about().map(|about| about.name.clone()).collect();
        Self::of_antennas(first, &antennas, |channel| names[channel].clone())
    }

    /// Arrangement from simultaneous pulses, one per channel.
    ///
    /// # Errors
    /// [`ArrangementError`], with numbers for names.
    pub fn of_pulses(pulses: &[Pulse]) -> Result<Self, ArrangementError> {
        let first = pulses.first().ok_or(ArrangementError::NoPulses)?;
        let each = pulses.iter();
        let antennas: Vec<[DVec3; 2]> = each
            .map(|pulse| [pulse.transmitter_m, pulse.receiver_m])
            .collect();
        Self::of_antennas(first, &antennas, |channel| channel.to_string())
    }

    fn of_antennas(
        first: &Pulse,
        antennas: &[[DVec3; 2]],
        name: impl Fn(usize) -> String,
    ) -> Result<Self, ArrangementError> {
        let (mut transmitters, mut receivers) = (Vec::new(), Vec::new());
        let of_channels: Vec<[usize; 2]> = antennas
            .iter()
            .map(|[t, r]| {
                [
                    numbered(&mut transmitters, *t),
                    numbered(&mut receivers, *r),
                ]
            })
            .collect();
        for (i, pair) in of_channels.iter().enumerate() {
            if let Some(j) = of_channels[..i].iter().position(|other| other == pair) {
                return Err(ArrangementError::Twice {
                    names: [j, i].map(name),
                });
            }
        }
        if transmitters.len() * receivers.len() != of_channels.len() {
            return Err(ArrangementError::Pairs {
                transmitters: transmitters.len(),
                receivers: receivers.len(),
                channels: of_channels.len(),
            });
        }
        let origin_m = 0.5 * (mean(&transmitters) + mean(&receivers));
        let attitude = attitude(first, origin_m, &transmitters, &receivers);
        let body = |at_m: &DVec3| attitude.inverse() * (*at_m - origin_m);
        Ok(Self {
            origin_m,
            attitude,
            transmitters_m: transmitters.iter().map(body).collect(),
            receivers_m: receivers.iter().map(body).collect(),
            of_channels,
        })
    }

    /// Channel numbers ordered transmitter by transmitter, receiver by receiver.
    pub fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.of_channels.len()).collect();
        order.sort_by_key(|&c| self.of_channels[c]);
        order
    }

    /// Position of the origin in metres and attitude, both in the scene frame, of a pose whose track begins with this arrangement.
    pub fn in_scene(&self, pose: &Pose) -> (DVec3, DQuat) {
        (
            self.origin_m + self.attitude * pose.at_m.extend(0.0),
            self.attitude * DQuat::from_rotation_z(pose.heading_rad),
        )
    }

    /// The array in its plane, with the wavelength at `middle_hz`.
    pub fn array(&self, middle_hz: f64) -> Array {
        let plane = |all: &[DVec3]| all.iter().map(|at| at.truncate()).collect::<Vec<DVec2>>();
        Array {
            transmitters_m: plane(&self.transmitters_m),
            receivers_m: plane(&self.receivers_m),
            wavelength_m: SPEED_OF_LIGHT_M_S / middle_hz,
        }
    }
}

fn mean(all: &[DVec3]) -> DVec3 {
    all.iter().sum::<DVec3>() / all.len() as f64
}

/// Antennas of a channel, moved to the time of the first channel's first pulse.
fn at_first(first: &dyn PhaseHistory, history: &dyn PhaseHistory) -> Option<[DVec3; 2]> {
    let first = first.collection().pulses.first()?;
    let pulses = &history.collection().pulses;
    let own = pulses.first()?;
    let antennas = |pulse: &Pulse| [pulse.transmitter_m, pulse.receiver_m];
    let later_s = own.time_s - first.time_s;
    let back = match pulses.get(1) {
        Some(next) if later_s != 0.0 && next.time_s > own.time_s => {
            later_s / (next.time_s - own.time_s)
        }
        _ => return Some(antennas(own)),
    };
    let next = antennas(&pulses[1]);
    let moved = |i: usize| antennas(own)[i] - back * (next[i] - antennas(own)[i]);
    Some([moved(0), moved(1)])
}

/// Number of a position among those known; a new one is added.
fn numbered(all: &mut Vec<DVec3>, at_m: DVec3) -> usize {
    let known = all.iter().position(|known| known.distance(at_m) < SAME_M);
    known.unwrap_or_else(|| {
        all.push(at_m);
        all.len() - 1
    })
}

/// Rotation from the body's axes to the scene's.
fn attitude(pulse: &Pulse, origin_m: DVec3, transmitters: &[DVec3], receivers: &[DVec3]) -> DQuat {
    let pairs = receivers
        .iter()
        .enumerate()
        .flat_map(|(i, a)| receivers[i + 1..].iter().map(move |b| *b - *a));
    let longest = pairs.max_by(|a, b| a.length().total_cmp(&b.length()));
    let look = pulse.reference_m - origin_m;
    let along = longest
        .and_then(DVec3::try_normalize)
        .or_else(|| (receivers[0] - transmitters[0]).try_normalize())
        .filter(|_| transmitters[0].distance(receivers[0]) > SAME_M || longest.is_some())
        .or_else(|| look.cross(DVec3::Z).try_normalize())
        .unwrap_or(DVec3::X);
    let level = along.z.abs() < LEVEL;
    let along = match level {
        true => along.with_z(0.0).normalize(),
        false => along,
    };
    let up = match level {
        true => DVec3::Z,
        false => along
            .cross(look)
            .try_normalize()
            .unwrap_or_else(|| along.any_orthonormal_vector()),
    };
    let ahead = up.cross(along);
    // Turn about z if boresight points backwards.
    let sign = if ahead.dot(look) < 0.0 { -1.0 } else { 1.0 };
    DQuat::from_mat3(&DMat3::from_cols(sign * along, sign * ahead, up))
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex32;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::{Channel, Collection, InMemory, Sweep};

    fn channel(name: &str, t: DVec3, r: DVec3, look: DVec3, delay_s: f64) -> (Channel, InMemory) {
        let pulse = |n: usize| {
            let time_s = n as f64 * 0.1 + delay_s;
            let moved = DVec3::X * time_s;
            Pulse {
                time_s,
                transmitter_m: t + moved,
                receiver_m: r + moved,
                reference_m: look,
                reference_path_m: 0.0,
                start_hz: 1e9,
                step_hz: 1e6,
                sweep: Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        let collection = Collection {
            name: name.to_owned(),
            num_samples: 2,
            pulses: (0..3).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let samples = vec![Complex32::ZERO; 6];
        (
            Channel::new(name),
            InMemory::new(collection, samples).unwrap(),
        )
    }

    fn of(all: Vec<(Channel, InMemory)>) -> Result<Arrangement, ArrangementError> {
        let boxed = all.into_iter().map(|(about, history)| {
            let boxed: Box<dyn PhaseHistory> = Box::new(history);
            (about, boxed)
        });
        Arrangement::of(&Channels::new(boxed.collect()).unwrap())
    }

    #[test]
    fn arrangement_recovers_antennas_of_all_channels() {
        let at = |x: f64, y: f64| DVec3::new(x, y, 2.0);
        // The array lies along y and looks along -x; the second transmitter sends later.
        let (t, r) = ([at(1.0, 0.0), at(1.0, 0.3)], [at(1.0, 0.1), at(1.02, 0.2)]);
        let look = DVec3::new(-50.0, 5.0, 0.0);
        let all = [[0, 1], [1, 0], [0, 0], [1, 1]];
        let arrangement = of(all
            .iter()
            .map(|&[i, j]| channel(&format!("{i}{j}"), t[i], r[j], look, 0.02 * i as f64))
            .collect())
        .unwrap();
        assert_eq!(arrangement.of_channels, [[0, 0], [1, 1], [0, 1], [1, 0]]);
        assert_eq!(arrangement.order(), [0, 2, 3, 1]);
        let middle_m = 0.25 * (t[0] + t[1] + r[0] + r[1]);
        assert!(arrangement.origin_m.distance(middle_m) < 1e-9);
        let (x, z) = (
            arrangement.attitude * DVec3::X,
            arrangement.attitude * DVec3::Z,
        );
        assert!(z.distance(DVec3::Z) < 1e-12);
        assert!((x.dot(look) / 50.0).abs() < 0.3, "{x}");
        assert!((arrangement.attitude * DVec3::Y).x < -0.9);
        for (got, wanted) in [
            (arrangement.transmitters_m[1], t[1]),
            (arrangement.receivers_m[0], r[1]),
        ] {
            let back = arrangement.origin_m + arrangement.attitude * got;
            assert!(back.distance(wanted) < 1e-9, "{back} {wanted}");
        }
    }

    #[test]
    fn invalid_array_is_refused() {
        let at = |x: f64| DVec3::new(x, 0.0, 0.0);
        let channel = |name: &str, t: f64, r: f64| channel(name, at(t), at(r), DVec3::Y, 0.0);
        let twice = of(vec![channel("a", 0.0, 1.0), channel("b", 0.0, 1.0)]).unwrap_err();
        assert!(twice.to_string().contains("'a' and 'b'"), "{twice}");
        let apart = of(vec![channel("a", 0.0, 1.0), channel("b", 2.0, 3.0)]).unwrap_err();
        assert!(apart.to_string().contains("expected 4 channels"));
    }
}
