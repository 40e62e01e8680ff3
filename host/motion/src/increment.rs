//! Increments of motion from pulse to pulse, and tracks composed of them.

use glam::{DVec2, DVec3};

use crate::model::{Array, Pose};

/// Motion of the radar from one pulse to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Increment {
    /// Displacement of the array's origin in the array's frame at the former pulse, metres: x along the array, y along boresight.
    pub moved_m: DVec2,
    /// Change of heading, radians, counterclockwise.
    pub turn_rad: f64,
}

/// Prior knowledge of the heading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Heading {
    /// Unknown: turns are estimated.
    #[default]
    Estimated,
    /// Known: measured by another sensor, or constant as on a rail.
    Known,
}

/// Distance of a phase from its prediction, as a fraction of half a turn, beyond which its whole turns are in doubt.
pub(crate) const WRAPPED: f64 = 0.6;

impl Pose {
    /// Pose after an increment.
    #[must_use]
    pub fn after(&self, increment: &Increment) -> Self {
        let (sin, cos) = libm::sincos(self.heading_rad);
        Self {
            at_m: self.at_m + DVec2::new(cos, sin).rotate(increment.moved_m),
            heading_rad: self.heading_rad + increment.turn_rad,
        }
    }
}

impl Increment {
    /// Increment between two poses, in the axes of the first.
    pub(crate) fn between(from: &Pose, to: &Pose) -> Self {
        let (sin, cos) = libm::sincos(from.heading_rad);
        Self {
            moved_m: DVec2::new(cos, -sin).rotate(to.at_m - from.at_m),
            turn_rad: to.heading_rad - from.heading_rad,
        }
    }

    /// Add a correction of x, y and turn.
    pub(crate) fn step(&mut self, by: DVec3) {
        self.moved_m += by.truncate();
        self.turn_rad += by.z;
    }

    /// Pose after this increment from the origin.
    pub(crate) fn pose(&self) -> Pose {
        Pose::default().after(self)
    }

    /// Position of a standing target in the array's frame after this increment.
    pub(crate) fn seen_after(&self, at_m: DVec2) -> DVec2 {
        let (sin, cos) = libm::sincos(self.turn_rad);
        DVec2::new(cos, -sin).rotate(at_m - self.moved_m)
    }

    /// Phase changes of a standing target, channel by channel.
    pub(crate) fn phases_rad(&self, array: &Array, at_m: DVec2) -> impl Iterator<Item = f64> {
        let k = array.rad_m();
        let before = array.paths(&Pose::default(), at_m);
        let after = array.paths(&self.pose(), at_m);
        let both = before.into_iter().zip(after);
        both.map(move |(before, after)| -k * (after.length_m - before.length_m))
    }
}

/// Poses after each increment, from the origin at heading 0: one more than increments.
pub fn chain(increments: impl IntoIterator<Item = Increment>) -> Vec<Pose> {
    let start = Pose::default();
    let next = |pose: &mut Pose, increment: Increment| {
        *pose = pose.after(&increment);
        Some(*pose)
    };
    let rest = increments.into_iter().scan(start, next);
    std::iter::once(start).chain(rest).collect()
}

/// Longest unbroken chain of poses, each with the number of its pulse. An increment has the numbers of its earlier and its later pulse, in
/// ascending order of the later; one without motion begins a new chain, from the origin at heading 0.
pub fn longest_chain(
    increments: impl IntoIterator<Item = (usize, usize, Option<Increment>)>,
) -> Vec<(usize, Pose)> {
    let mut chains: Vec<Vec<(usize, Pose)>> = Vec::new();
    for (from, to, increment) in increments {
        let current = chains.last_mut();
        let current = current.filter(|chain| chain.last().is_some_and(|(last, _)| *last == from));
        match (increment, current) {
            (Some(increment), Some(chain)) => {
                let before = chain.last().map_or_else(Pose::default, |(_, pose)| *pose);
                chain.push((to, before.after(&increment)));
            }
            _ => chains.push(vec![(to, Pose::default())]),
        }
    }
    chains.sort_by_key(Vec::len);
    chains.pop().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_right_angle_steps_close_a_square() {
        let side = Increment {
            moved_m: DVec2::new(2.0, 1.0),
            turn_rad: std::f64::consts::FRAC_PI_2,
        };
        let poses = chain([side; 4]);
        assert_eq!(poses.len(), 5);
        assert!(poses[4].at_m.length() < 1e-15 && poses[1].at_m == DVec2::new(2.0, 1.0));
        // A point in the array's frame after the first side.
        let place = DVec2::new(3.0, -1.0);
        let seen = side.seen_after(place);
        assert!((poses[1].at_m + DVec2::Y.rotate(seen)).distance(place) < 1e-15);
    }

    #[test]
    fn longest_chain_ends_at_unknown_motion() {
        let step = Increment {
            moved_m: DVec2::X,
            turn_rad: 0.0,
        };
        let known = |from, to| (from, to, Some(step));
        let all = [
            (0, 0, None),
            known(0, 1),
            // Relative to pulse 1, but unknown: the next one is relative to pulse 3.
            (1, 3, None),
            known(3, 4),
            known(4, 6),
            (6, 7, None),
            known(7, 8),
        ];
        let chain = longest_chain(all);
        let pulses: Vec<usize> = chain.iter().map(|(pulse, _)| *pulse).collect();
        assert_eq!(pulses, [3, 4, 6]);
        assert_eq!(chain[2].1.at_m, 2.0 * DVec2::X);
        assert_eq!(longest_chain([]), []);
    }
}
