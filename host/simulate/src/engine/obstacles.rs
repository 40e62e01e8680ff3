//! Boxes and foliage between scatterers and antennas.
//!
//! A point within the distance `rho` of `c` is seen from an antenna along a line that stays within `rho` of the line from `c`. An obstacle within a sphere of the
//! radius `beta` can lie on it only if its centre is within `beta + rho` of that line, so that chunks of neighbouring points are tested against few
//! obstacles.

use glam::DVec3;

use crate::scene::shadow::hidden;
use crate::scene::{Block, Canopy, Scene};

/// Obstacles at one time.
#[derive(Clone, Debug, Default)]
pub(super) struct Obstacles {
    blocks: Vec<Block>,
    canopies: Vec<Canopy>,
}

impl Obstacles {
    /// Obstacles of a scene at a time, seconds.
    pub(super) fn of(scene: &Scene, time_s: f64) -> Self {
        let moving = scene.moving_blocks.iter().map(|block| block.at(time_s));
        Self {
            blocks: scene.blocks.iter().copied().chain(moving).collect(),
            canopies: scene.canopies.clone(),
        }
    }

    /// Whether there are no obstacles.
    pub(super) fn is_empty(&self) -> bool {
        self.blocks.is_empty() && self.canopies.is_empty()
    }

    /// Obstacles that may lie between the antennas and points within `radius_m` of `centre_m`; all for a position that is not finite.
    pub(super) fn before(&self, antennas_m: [DVec3; 2], centre_m: DVec3, radius_m: f64) -> Self {
        let one = antennas_m[0] == antennas_m[1];
        let antennas_m = if one {
            &antennas_m[..1]
        } else {
            &antennas_m[..]
        };
        let near = |obstacle_m: DVec3, size_m: f64| {
            let far = |antenna_m: &DVec3| {
                let along = *antenna_m - centre_m;
                let part =
                    ((obstacle_m - centre_m).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                (centre_m + along * part).distance(obstacle_m) > size_m + radius_m
            };
            !antennas_m.iter().all(far)
        };
        let blocks = self.blocks.iter().copied();
        let canopies = self.canopies.iter().copied();
        Self {
            blocks: blocks
                .filter(|block| near(block.centre_m, block.half_m.length()))
                .collect(),
            canopies: canopies
                .filter(|canopy| near(canopy.centre_m, canopy.half_m.max_element()))
                .collect(),
        }
    }

    /// Factor of the amplitude of a point seen by a transmitter and a receiver.
    pub(super) fn transmission(
        &self,
        [transmitter_m, receiver_m]: [DVec3; 2],
        point_m: DVec3,
    ) -> f64 {
        let once = |antenna_m: DVec3| {
            if hidden(&self.blocks, antenna_m, point_m) {
                return 0.0;
            }
            let canopies = self.canopies.iter();
            canopies
                .map(|canopy| canopy.transmission(antenna_m, point_m))
                .product::<f64>()
        };
        let out = once(transmitter_m);
        match transmitter_m == receiver_m {
            true => out * out,
            false if out == 0.0 => 0.0,
            false => out * once(receiver_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn obstacles_left_out_hide_no_point_of_the_neighbourhood() {
        let mut scene = Scene::default();
        for i in 0..60 {
            let place = DVec3::new(
                f64::from(i * 37 % 60) - 30.0,
                f64::from(i * 23 % 60) - 30.0,
                2.0,
            );
            scene.blocks.push(Block {
                centre_m: place,
                half_m: DVec3::new(2.0, 0.5, 2.0),
                attitude: DQuat::from_rotation_z(f64::from(i)),
            });
            scene.canopies.push(Canopy {
                centre_m: place + DVec3::new(3.0, 1.0, 3.0),
                half_m: DVec3::new(1.0, 1.0, 2.0),
                attenuation_db_m: 2.0,
            });
        }
        let all = Obstacles::of(&scene, 0.0);
        let antennas_m = [
            DVec3::new(-100.0, -300.0, 150.0),
            DVec3::new(90.0, -310.0, 140.0),
        ];
        let mut kept = 0;
        for i in 0..400 {
            let centre_m = DVec3::new(
                f64::from(i % 20) * 3.0 - 30.0,
                f64::from(i / 20) * 3.0 - 30.0,
                1.0,
            );
            let near = all.before(antennas_m, centre_m, 4.0);
            kept += near.blocks.len();
            for k in 0..20 {
                let (sin, cos) = f64::from(k).sin_cos();
                let point_m = centre_m + DVec3::new(cos, sin, 0.2) * (0.19 * f64::from(k));
                assert_eq!(
                    all.transmission(antennas_m, point_m),
                    near.transmission(antennas_m, point_m)
                );
            }
        }
        assert!(kept * 3 < 400 * 60, "{kept}");
        assert_eq!(all.before(antennas_m, DVec3::NAN, 4.0).blocks.len(), 60);
    }
}
