//! Radar of Chim 2018, 7.5, on its rail: recording, targets, and motion between pulses.

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::chim_strip::rms;
use super::forming::{experiment, hold, pulses_of};
use crate::{Context, ItemError};
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channel, Channels, InMemory, PhaseHistory};
use subaperture_model::track::{Pose, Profile, Trajectory};
use subaperture_motion::targets::{Detections, Recovered, Settings, recover};
use subaperture_motion::{Heading, Increment, Pairwise};

/// Reflector positions, metres, at 2 to 6 m; the thesis names the first two.
pub(super) const REFLECTORS_M: [DVec3; 4] = [
    DVec3::new(0.6, 3.0, 0.0),
    DVec3::new(0.1, 4.0, 0.0),
    DVec3::new(-0.9, 2.2, 0.0),
    DVec3::new(1.6, 5.6, 0.0),
];
/// Squint of the array against the rail, degrees; not contained in the recording. The thesis has one and does not give its value.
pub(super) const SQUINT_DEG: f64 = 0.5;
/// Chirp interval, seconds.
pub(super) const PRI_S: f64 = 1e-3;
/// Range of the wall, metres; beyond it the range mask applies.
pub(super) const WALL_M: f64 = 6.0;
const NEAREST_M: f64 = 1.0;

/// Image grid of the room.
pub(super) fn room_grid() -> ImageGrid {
    let axis = |start, step, count| Axis { start, step, count };
    ImageGrid::horizontal(axis(-1.2, 0.008, 388), axis(1.9, 0.04, 100), 0.0)
}

/// Carriage with piecewise constant acceleration (seconds, metres per second squared).
pub(super) fn carriage(start_m_s: f64, pieces: &[(f64, f64)]) -> Result<Profile, ItemError> {
    let pieces: Vec<(f64, DVec3)> = pieces
        .iter()
        .map(|&(s, m_s2)| (s, DVec3::X * m_s2))
        .collect();
    Profile::new(0.0, DVec3::ZERO, DVec3::X * start_m_s, &pieces)
        .map_err(|error| ItemError::Measure(error.to_string()))
}

/// Carriage with the radar's body.
#[derive(Debug)]
struct Carried {
    carriage: Profile,
    attitude: DQuat,
}

impl Trajectory for Carried {
    fn pose(&self, time_s: f64) -> Pose {
        Pose {
            attitude: self.attitude,
            ..self.carriage.pose(time_s)
        }
    }
}

/// Recording of both receivers over `chirps`, without the chirps that `sends` excludes.
pub(super) fn recorded(
    context: &Context,
    carriage: Profile,
    chirps: usize,
    sends: impl Fn(usize) -> bool,
) -> Result<Vec<(Channel, InMemory)>, ItemError> {
    let mut radar = experiment("rail", include_str!("scenes/rail.toml"))?;
    radar.radar.num_pulses = chirps;
    radar.radar.pri_s = PRI_S;
    let carried = |attitude| {
        let carriage = carriage.clone();
        Arc::new(Carried { carriage, attitude })
    };
    radar.track = carried(DQuat::from_rotation_z(SQUINT_DEG.to_radians()));
    // Not contained in the recording.
    radar.measured = Some(carried(DQuat::IDENTITY));
    let chosen: Vec<usize> = (0..chirps).filter(|&n| sends(n)).collect();
    let record = |pair| {
        let whole = hold(context, &radar.record(pair)?)?;
        Ok((radar.about(pair), pulses_of(&whole, &chosen)?))
    };
    radar.pairs().into_iter().map(record).collect()
}

/// Joint track estimate of all pulses, and the observations.
pub(super) fn found(
    monitor: &dyn Monitor,
    recorded: &[(Channel, InMemory)],
) -> Result<Recovered, ItemError> {
    let boxed = recorded.iter().map(|(about, history)| {
        let history: Box<dyn PhaseHistory> = Box::new(history.clone());
        (about.clone(), history)
    });
    let channels = Channels::new(boxed.collect()).map_err(|e| ItemError::Measure(e.to_string()))?;
    let settings = Settings {
        ranges_m: Some((NEAREST_M, WALL_M)),
        ..Settings::default()
    };
    Ok(recover(channels, &settings, monitor)?)
}

/// Motion between pulses by the thesis's two least squares, along the array's axes.
pub(super) fn increments(seen: &Detections) -> Result<Vec<Increment>, ItemError> {
    let unsuited = |error: subaperture_motion::MotionError| ItemError::Measure(error.to_string());
    let mut pairwise = Pairwise::new(seen.array.clone(), Heading::Estimated).map_err(unsuited)?;
    let mut found = Vec::with_capacity(seen.pulses.len());
    for pulse in &seen.pulses {
        found.extend(pairwise.push(pulse).map_err(unsuited)?);
    }
    Ok(found.into_iter().map(|moved| moved.increment).collect())
}

/// Mean and standard deviation.
pub(super) fn spread(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    [mean, rms(values.map(|x| x - mean))]
}
