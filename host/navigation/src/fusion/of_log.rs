//! Measurements for the fusion from a log.

use glam::{DVec3, EulerRot};

use subaperture_model::geometry::SceneFrame;

use super::{Inertial, Position};
use crate::{GpsTime, Kind, Log, Record};

/// Default standard deviations, for logs that state none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DefaultSigmas {
    /// Standard deviation of positions, metres.
    pub place_m: f64,
    /// Standard deviation of velocities, m/s.
    pub velocity_m_s: f64,
    /// Standard deviation of headings, degrees.
    pub heading_deg: f64,
}

impl Default for DefaultSigmas {
    /// For a receiver without corrections and a small inertial unit.
    fn default() -> Self {
        Self {
            place_m: 1.5,
            velocity_m_s: 0.1,
            heading_deg: 0.5,
        }
    }
}

/// Standard deviations along a frame's axes from those along east, north and up, or from the default.
fn along(record: &Record, frame: &SceneFrame, stated: Option<DVec3>, default: f64) -> DVec3 {
    let Some((stated, turn)) = stated.zip(record.to_scene(frame)) else {
        return DVec3::splat(default);
    };
    let [east, north, up] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
    let square = |axis: DVec3, sigma: f64| axis * axis * sigma * sigma;
    let sum = square(east, stated.x) + square(north, stated.y) + square(up, stated.z);
    // A stated 0 is rounded up to 0.1 mm.
    DVec3::from(sum.to_array().map(|variance| variance.sqrt().max(1e-4)))
}

/// Largest time from a receiver's velocity to its position, seconds.
const TOGETHER_S: f64 = 0.05;
/// Change of velocity of a vehicle between the two, m/s^2.
const CHANGES_M_S2: f64 = 1.0;
/// Standard deviation of a vertical velocity that is not measured, m/s.
const UNMEASURED_M_S: f64 = 1e3;

/// Positions of a kind of records in a frame with times counted from `start`, and with velocities: their own, or those of NovAtel's `BESTVEL`. Each `BESTVEL` is assigned to one position only, so that it counts once.
///
/// Standard deviations are the stated ones, else those of `default`. The missing vertical velocity of NMEA has a negligible weight.
pub fn positions(
    log: &Log,
    kind: Kind,
    frame: &SceneFrame,
    start: GpsTime,
    default: &DefaultSigmas,
) -> Vec<Position> {
    let placed = |record: &&Record| record.place.is_some_and(|p| p.in_frame(frame).is_some());
    let places: Vec<&Record> = log.of(kind).filter(placed).collect();
    let separate = match kind {
        Kind::Bestpos => assigned(&places, log.of(Kind::Bestvel)),
        _ => vec![None; places.len()],
    };
    let position = |(record, separate): (&Record, Option<&Record>)| {
        let mut moving = *record;
        let mut away_s = 0.0;
        if let Some(one) = separate.filter(|_| record.velocity_m_s.is_none()) {
            moving.velocity_m_s = one.velocity_m_s;
            moving.velocity_sigma_m_s = one.velocity_sigma_m_s;
            away_s = one.time.since(record.time);
        }
        Some(Position {
            time_s: record.time.since(start),
            position_m: record.place?.in_frame(frame)?,
            sigma_m: along(record, frame, record.place_sigma_m, default.place_m),
            velocity_m_s: velocity(&moving, frame, default.velocity_m_s, away_s),
        })
    };
    places
        .into_iter()
        .zip(separate)
        .filter_map(position)
        .collect()
}

/// Assignment of each velocity to its nearest position, in the order of time.
fn assigned<'a>(
    places: &[&Record],
    velocities: impl Iterator<Item = &'a Record>,
) -> Vec<Option<&'a Record>> {
    let mut assigned: Vec<Option<&Record>> = vec![None; places.len()];
    for one in velocities {
        let away_s = |n: &usize| one.time.since(places[*n].time).abs();
        let after = places.partition_point(|place| place.time < one.time);
        let around = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let around = around.filter(|&n| n < places.len());
        let Some(n) = around.min_by(|a, b| away_s(a).total_cmp(&away_s(b))) else {
            continue;
        };
        let before_s = assigned[n].map_or(TOGETHER_S, |other: &Record| {
            other.time.since(places[n].time).abs()
        });
        if away_s(&n) <= before_s {
            assigned[n] = Some(one);
        }
    }
    assigned
}

/// Velocity of a record along a frame's axes with standard deviations, measured `away_s` seconds from the position.
fn velocity(record: &Record, frame: &SceneFrame, default: f64, away_s: f64) -> Option<[DVec3; 2]> {
    let velocity = record.to_scene(frame)? * record.velocity_m_s?;
    let mut stated = record.velocity_sigma_m_s;
    if record.kind == Kind::Nmea {
        let [level, _, _] = stated.unwrap_or(DVec3::splat(default)).to_array();
        stated = Some(DVec3::new(level, level, UNMEASURED_M_S));
    }
    let sigma = along(record, frame, stated, default);
    let changed = CHANGES_M_S2 * away_s;
    let both = |sigma: f64| libm::hypot(sigma, changed);
    Some([velocity, DVec3::from(sigma.to_array().map(both))])
}

/// Positions, velocities and attitudes of a kind of records in a frame, with times counted from `start`.
///
/// Standard deviations are those from record to record, which logs do not state: those of `default`, or the stated ones of the whole error where
/// these are smaller. Drift is described by the model ([`velocity_walk`]).
pub fn inertial(
    log: &Log,
    kind: Kind,
    frame: &SceneFrame,
    start: GpsTime,
    default: &DefaultSigmas,
) -> Vec<Inertial> {
    let moment = |record: &Record| {
        let turn = record.to_scene(frame)?;
        let attitude = record.attitude.map(|a| turn * a.to_east_north_up());
        let angles = attitude.map(|attitude| attitude.to_euler(EulerRot::ZYX));
        let least = |stated: Option<DVec3>, default: f64| {
            along(record, frame, stated, default).min(DVec3::splat(default))
        };
        let heading_deg = match record.attitude_sigma_deg {
            // A stated 0 is rounded up to 0.0001 degrees.
            Some([.., azimuth]) => azimuth.clamp(1e-4, default.heading_deg),
            None => default.heading_deg,
        };
        Some(Inertial {
            time_s: record.time.since(start),
            position_m: Some([
                record.place?.in_frame(frame)?,
                least(record.place_sigma_m, default.place_m),
            ]),
            velocity_m_s: record.velocity_m_s.map(|velocity| {
                let sigma = least(record.velocity_sigma_m_s, default.velocity_m_s);
                [turn * velocity, sigma]
            }),
            heading_rad: angles.map(|(yaw, ..)| [yaw, heading_deg.to_radians()]),
            roll_pitch_rad: angles.map_or([0.0; 2], |(_, pitch, roll)| [roll, pitch]),
        })
    };
    log.of(kind).filter_map(moment).collect()
}

/// Shortest growth of stated deviations that counts, seconds: shorter ones are corrections and rounding.
const GROWTH_S: f64 = 1.0;

/// Random walk of the velocity error of an inertial solution, m/s a root second, from the growth of its stated standard deviations: the largest
/// growth of their mean square over time, in a second or more without a decrease. `None` without growth or without stated deviations.
///
/// Stated deviations grow where the receiver has no positions.
pub fn velocity_walk(log: &Log, kind: Kind) -> Option<f64> {
    let mut largest: f64 = 0.0;
    let mut from: Option<(GpsTime, f64)> = None;
    let mut before = 0.0;
    for record in log.of(kind) {
        let Some(sigma) = record.velocity_sigma_m_s else {
            continue;
        };
        let square = sigma.length_squared() / 3.0;
        let start = match from {
            Some(start) if square >= before => start,
            _ => (record.time, square),
        };
        // Deviations that stay the same are no growth yet.
        let start = match square > start.1 {
            true => start,
            false => (record.time, square),
        };
        let seconds = record.time.since(start.0);
        if seconds >= GROWTH_S {
            largest = largest.max((square - start.1) / seconds);
        }
        (from, before) = (Some(start), square);
    }
    (largest > 0.0).then(|| largest.sqrt())
}
