//! Occlusion: whether the straight line between two points passes through a box.
//!
//! The line `from + t (to - from)`, `0 <= t <= 1`, is transformed into the box's axes and clipped by its three slabs
//! `|x| <= half`; the remaining interval of `t` lies inside. Neglected: diffraction and transmission through the box. A
//! shadow has a hard edge, where a real one has a transition of `sqrt(wavelength distance)`, 1.7 m for X band at 100 m.
//!
//! Cost: two rotations and three divisions per box.

use glam::DVec3;

use super::Block;

/// Minimum penetration depth, metres. Points on a wall (with rounding errors of at most 1e-9 m) are not occluded by it
/// from in front.
const SKIN_M: f64 = 1e-6;

/// Whether any of `blocks` lies between two points, metres in the scene frame.
///
/// A line that only touches a face, such as one that ends on a wall, is not blocked. A block thinner than 2 micrometres
/// occludes nothing.
pub fn hidden(blocks: &[Block], from: DVec3, to: DVec3) -> bool {
    blocks.iter().any(|block| crosses(block, from, to))
}

fn crosses(block: &Block, from: DVec3, to: DVec3) -> bool {
    let turn = block.attitude.conjugate();
    let start = (turn * (from - block.centre_m)).to_array();
    let step = (turn * (to - from)).to_array();
    let half = (block.half_m - DVec3::splat(SKIN_M)).to_array();
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    for ((start, step), half) in start.into_iter().zip(step).zip(half) {
        if step == 0.0 {
            if start.abs() > half {
                return false;
            }
            continue;
        }
        let (a, b) = ((-half - start) / step, (half - start) / step);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
        // A negative half length, of a block thinner than the skin, must not be treated as its mirror image.
        if half < 0.0 || enter > leave {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn house() -> Block {
        Block {
            centre_m: DVec3::new(10.0, 20.0, 3.0),
            half_m: DVec3::new(4.0, 2.0, 3.0),
            attitude: DQuat::IDENTITY,
        }
    }

    #[test]
    fn ground_shadow_has_geometric_length() {
        // From (10, -80, 30), over the far roof edge (10, 22, 6): the line drops 24 m in 102 m, so that it meets the
        // ground 6 * 102 / 24 = 25.5 m behind the edge.
        let radar = DVec3::new(10.0, -80.0, 30.0);
        let ground = |y| DVec3::new(10.0, y, 0.0);
        let hides = |y| hidden(&[house()], radar, ground(y));
        assert!(!hides(17.9) && hides(22.1));
        assert!(hides(22.0 + 25.499) && !hides(22.0 + 25.501));
        // Occlusion is symmetric, and another block in the list has no effect.
        assert!(hidden(&[house()], ground(40.0), radar));
        let far = Block {
            centre_m: DVec3::new(500.0, 0.0, 0.0),
            ..house()
        };
        assert!(hidden(&[far, house()], radar, ground(40.0)));
        assert!(!hidden(&[far], radar, ground(40.0)));
        assert!(!hidden(&[], radar, ground(40.0)));
    }

    #[test]
    fn own_walls_are_visible_only_from_in_front() {
        let radar = DVec3::new(10.0, -80.0, 30.0);
        let seen = |x, y, z| !hidden(&[house()], radar, DVec3::new(x, y, z));
        assert!(
            seen(10.0, 18.0, 3.0) && seen(10.0, 18.0, 0.0),
            "front wall and its foot"
        );
        assert!(
            seen(12.0, 20.0, 6.0) && seen(10.0, 22.0, 6.0),
            "roof and its far edge"
        );
        assert!(!seen(10.0, 22.0, 3.0), "back wall");
        // A side wall is visible only from its own side: x = 14 is seen from x > 14.
        assert!(!seen(14.0, 20.0, 3.0));
        assert!(!hidden(
            &[house()],
            DVec3::new(80.0, 20.0, 3.0),
            DVec3::new(14.0, 20.0, 3.0)
        ));
    }

    #[test]
    fn rotated_box_occludes_at_its_rotated_position() {
        // A wall 8 m long and 0.2 m thick, rotated by 45 deg: it runs along x = y.
        let wall = Block {
            centre_m: DVec3::ZERO,
            half_m: DVec3::new(4.0, 0.1, 3.0),
            attitude: DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4),
        };
        let across = |middle: f64| {
            let centre = DVec3::new(middle, middle, 0.0);
            let aside = DVec3::new(1.0, -1.0, 0.0);
            hidden(&[wall], centre + aside, centre - aside)
        };
        // The wall's end lies at 4 / sqrt 2 = 2.8284 on both axes.
        assert!(across(0.0) && across(2.828) && !across(2.829));
        // Lines parallel to the wall.
        let along = |off: f64| {
            hidden(
                &[wall],
                DVec3::new(-9.0, -9.0 + off, 0.0),
                DVec3::new(9.0, 9.0 + off, 0.0),
            )
        };
        // A thickness of 0.1 m is 0.1 sqrt 2 along y.
        assert!(along(0.141) && !along(0.142));
    }

    #[test]
    fn line_ending_before_box_and_box_without_depth_are_unobstructed() {
        assert!(!hidden(
            &[house()],
            DVec3::ZERO,
            DVec3::new(10.0, 17.0, 3.0)
        ));
        let sheet = Block {
            half_m: DVec3::new(4.0, 0.0, 3.0),
            ..house()
        };
        assert!(!hidden(
            &[sheet],
            DVec3::new(10.0, 0.0, 3.0),
            DVec3::new(10.0, 40.0, 3.0)
        ));
    }
}
