//! What a box hides: whether the straight line between two points passes through it.
//!
//! The line `from + t (to - from)`, `0 <= t <= 1`, is turned into the box's axes and cut with its three
//! slabs `|x| <= half`; what is left of `t` after all three lies inside. Diffraction and what
//! the box lets through are neglected: a shadow has a hard edge, where in truth it has one of
//! `sqrt(wavelength distance)`, 1.7 m for X band at 100 m.
//!
//! Cost: two rotations and three divisions a box.

use glam::DVec3;

use super::Block;

/// How deep the line has to enter, metres. Points on a wall (set there with roundings of 1e-9 m at most)
/// are not hidden by it from in front.
const SKIN_M: f64 = 1e-6;

/// Whether any of `blocks` lies between two points, metres in the scene frame.
///
/// A line that only touches a face, as one that ends on a wall, is free. A block thinner than 2
/// micrometres hides nothing.
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
        // A negative half, of a block thinner than the skin, must not be taken for its mirror image.
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
    fn a_shadow_on_the_ground_is_as_long_as_geometry_says() {
        // From (10, -80, 30), over the far roof edge (10, 22, 6): the line has fallen 24 m in 102 m, so
        // it meets the ground 6 * 102 / 24 = 25.5 m behind the edge.
        let radar = DVec3::new(10.0, -80.0, 30.0);
        let ground = |y| DVec3::new(10.0, y, 0.0);
        let hides = |y| hidden(&[house()], radar, ground(y));
        assert!(!hides(17.9) && hides(22.1));
        assert!(hides(22.0 + 25.499) && !hides(22.0 + 25.501));
        // Both ways alike, and the other house in the list does not matter.
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
    fn its_own_walls_are_seen_from_in_front_only() {
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
        // A side wall is seen from its own side: x = 14 is seen from x > 14 only.
        assert!(!seen(14.0, 20.0, 3.0));
        assert!(!hidden(
            &[house()],
            DVec3::new(80.0, 20.0, 3.0),
            DVec3::new(14.0, 20.0, 3.0)
        ));
    }

    #[test]
    fn a_turned_box_is_where_it_is_turned_to() {
        // A wall 8 m long, 0.2 m thick, turned by 45 deg: it runs along x = y.
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
        // Along it, beside it.
        let along = |off: f64| {
            hidden(
                &[wall],
                DVec3::new(-9.0, -9.0 + off, 0.0),
                DVec3::new(9.0, 9.0 + off, 0.0),
            )
        };
        // 0.1 m of thickness is 0.1 sqrt 2 along y.
        assert!(along(0.141) && !along(0.142));
    }

    #[test]
    fn a_line_that_ends_before_a_box_or_a_box_without_depth_is_free() {
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
