//! Recorded track: positions, and attitudes if recorded, at given times.

use glam::{DQuat, DVec3};

use super::cubic::Cubic;
use super::{Spline, TrackError, strays};
use crate::track::{Pose, Trajectory};

/// Position and attitude of a recorded track at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Time, seconds from the collection's start.
    pub time_s: f64,
    /// Position, metres in the scene frame.
    pub position_m: DVec3,
    /// Attitude, if known.
    pub attitude: Option<DQuat>,
}

/// Smooth curve through the fixes of a recorded track.
///
/// Positions are a [`Spline`]. Attitudes, if every fix has one, are natural cubic splines of the quaternion
/// components, normalised to unit length, so that an antenna away from the body's origin moves smoothly as well; they
/// are constant before the first and after the last fix. Without attitudes the heading is along the velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledTrack {
    position: Spline,
    attitude: Option<Cubic<4>>,
}

impl SampledTrack {
    /// Track through `fixes` with ascending times.
    ///
    /// # Errors
    /// [`TrackError`] for fewer than two fixes, times that do not ascend, values that are not finite, positions that
    /// jump away and back as no vehicle does ([`strays`]), and attitudes that only some fixes have or that rotate by
    /// more than 90 degrees from one fix to the next.
    pub fn new(fixes: &[Fix]) -> Result<Self, TrackError> {
        Self::with_gaps(fixes, f64::INFINITY)
    }

    /// Like [`Self::new`], but the attitude may rotate by more than 90 degrees between fixes more than `longest_s`
    /// apart. The track is unknown in such a gap.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_gaps(fixes: &[Fix], longest_s: f64) -> Result<Self, TrackError> {
        let times: Vec<f64> = fixes.iter().map(|f| f.time_s).collect();
        let positions: Vec<DVec3> = fixes.iter().map(|f| f.position_m).collect();
        let position = Spline::new(times.clone(), &positions)?;
        check_strays(&times, &positions)?;
        let attitudes: Vec<DQuat> = fixes.iter().filter_map(|f| f.attitude).collect();
        if attitudes.is_empty() {
            return Ok(Self {
                position,
                attitude: None,
            });
        }
        if attitudes.len() < fixes.len() {
            return Err(TrackError(format!(
                "{} of {} fixes have an attitude; give one for all or none",
                attitudes.len(),
                fixes.len()
            )));
        }
        if let Some(n) = attitudes.iter().position(|q| !q.is_normalized()) {
            return Err(TrackError(format!(
                "the attitude of fix {} is {}: expected unit length",
                n + 1,
                attitudes[n]
            )));
        }
        // A quaternion and its negative are the same attitude; choose the nearer one.
        let mut parts: Vec<[f64; 4]> = Vec::with_capacity(attitudes.len());
        let mut previous = attitudes[0];
        for (n, &attitude) in attitudes.iter().enumerate() {
            let near = if attitude.dot(previous) < 0.0 {
                -attitude
            } else {
                attitude
            };
            // Cosine of half the rotation angle.
            let gap = n > 0 && times[n] - times[n - 1] > longest_s;
            if near.dot(previous) < std::f64::consts::FRAC_1_SQRT_2 && !gap {
                let step_s = times[n] - times[n - 1];
                let advice = match step_s < SOON_S {
                    true => "no vehicle rotates so fast: leave out or correct one of them",
                    false => "give fixes closer in time",
                };
                return Err(TrackError(format!(
                    "the attitude rotates by more than 90 degrees from fix {n} to fix {} ({} s, {step_s:e} s later); {advice}",
                    n + 1,
                    times[n]
                )));
            }
            parts.push(near.to_array());
            previous = near;
        }
        Ok(Self {
            position,
            attitude: Some(Cubic::new(times, parts)),
        })
    }
}

/// Time in which no vehicle rotates by 90 degrees, seconds.
const SOON_S: f64 = 0.1;

/// Step up to which no position jumps, metres.
const FLOOR_M: f64 = 1.0;

fn check_strays(times_s: &[f64], positions_m: &[DVec3]) -> Result<(), TrackError> {
    let found = strays(Some(times_s), positions_m, FLOOR_M);
    let Some(first) = found.first() else {
        return Ok(());
    };
    let count: usize = found.iter().map(ExactSizeIterator::len).sum();
    let (n, place) = (first.start, positions_m[first.start]);
    let beside = positions_m[if n > 0 { n - 1 } else { first.end }];
    Err(TrackError(format!(
        "{count} of {} fixes have positions that no vehicle can have: fix {} ({} s) is at {:.1}, {:.1}, {:.1} m, {:.1} m from its neighbour, and the track continues \
         where it was; leave out or correct {}",
        positions_m.len(),
        n + 1,
        times_s[n],
        place.x,
        place.y,
        place.z,
        place.distance(beside),
        if count == 1 { "this one" } else { "these" }
    )))
}

impl Trajectory for SampledTrack {
    fn pose(&self, time_s: f64) -> Pose {
        let mut pose = self.position.pose(time_s);
        if let Some(attitude) = &self.attitude {
            let (first, last) = attitude.span();
            let (parts, _) = attitude.at(time_s.clamp(first, last));
            pose.attitude = DQuat::from_array(parts).normalize();
        }
        pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::turned;

    fn rolling(t: f64) -> DQuat {
        turned(0.2 * (0.5 * t).sin(), -0.1 * (0.3 * t).cos(), 1.5 + 0.3 * t)
    }

    fn fixes(count: u32) -> Vec<Fix> {
        let fix = |i| {
            let time_s = f64::from(i) * 0.25;
            // Every other quaternion has the opposite sign.
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            Fix {
                time_s,
                position_m: DVec3::new(time_s, 0.0, 5.0),
                attitude: Some(rolling(time_s) * sign),
            }
        };
        (0..count).map(fix).collect()
    }

    #[test]
    fn attitudes_are_interpolated_independent_of_quaternion_sign() {
        let track = SampledTrack::new(&fixes(101)).unwrap();
        for i in 0..200 {
            let t = 5.0 + f64::from(i) * 0.07;
            let apart = track.pose(t).attitude.angle_between(rolling(t));
            // Components change by at most 0.3 rad/s, half of it in the quaternion: fourth derivatives are below 1e-2
            // / s^4, and 5 / 384 of that times 0.25^4 is 5e-7. (angle_between is accurate to 1e-7.)
            assert!(apart < 2e-6, "{apart}");
        }
        let end = track.pose(1e3);
        assert!(end.attitude.angle_between(rolling(25.0)) < 1e-7);
        assert!(end.position_m.distance(DVec3::new(1e3, 0.0, 5.0)) < 1e-9);
    }

    #[test]
    fn heading_follows_velocity_without_attitudes() {
        let mut fixes = fixes(5);
        fixes.iter_mut().for_each(|f| f.attitude = None);
        let track = SampledTrack::new(&fixes).unwrap();
        assert!((track.pose(0.4).attitude * DVec3::X).distance(DVec3::X) < 1e-14);
    }

    #[test]
    fn impossible_positions_are_refused_by_number() {
        let mut fixes = fixes(40);
        fixes[12].position_m = DVec3::ZERO;
        let error = SampledTrack::new(&fixes).unwrap_err().to_string();
        assert!(
            error.contains("1 of 40 fixes") && error.contains("fix 13 (3 s)"),
            "{error}"
        );
        fixes[12].position_m = DVec3::new(3.0, 5000.0, 5.0);
        assert!(SampledTrack::new(&fixes).is_err());
        fixes[12].position_m = DVec3::new(3.0, 0.0, 5.0);
        assert!(SampledTrack::new(&fixes).is_ok());
    }

    #[test]
    fn attitudes_that_cannot_be_interpolated_are_refused() {
        let message = |fixes: &[Fix]| SampledTrack::new(fixes).unwrap_err().to_string();
        let mut some = fixes(4);
        some[2].attitude = None;
        assert!(message(&some).contains("3 of 4 fixes"));
        let mut wild = fixes(4);
        wild[2].attitude = Some(rolling(0.5) * DQuat::from_rotation_x(2.0));
        assert!(message(&wild).contains("from fix 2 to fix 3"));
        assert!(SampledTrack::with_gaps(&wild, 0.2).is_ok());
        assert!(SampledTrack::with_gaps(&wild, 0.3).is_err());
        let mut swapped = fixes(4);
        for fix in &mut swapped {
            fix.time_s *= 0.01;
        }
        swapped[2].attitude = wild[2].attitude;
        assert!(message(&swapped).contains("no vehicle rotates so fast"));
        let mut long = fixes(4);
        long[1].attitude = Some(rolling(0.0) * 1.5);
        assert!(message(&long).contains("unit length"));
    }
}
