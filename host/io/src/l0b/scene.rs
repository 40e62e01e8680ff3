//! Scene of an acquisition from orbit: points of the ellipsoid in the zero-Doppler plane.

use glam::DVec3;

use super::orbit::State;
use subaperture_model::geometry::{Geodetic, SceneFrame};

/// Side of the track on which the radar looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LookSide {
    /// Left of the direction of flight.
    Left,
    /// Right of the direction of flight.
    Right,
}

/// Halvings of the interval of the cosine of the look angle; the last one is below the resolution of float64.
const HALVINGS: usize = 60;

impl LookSide {
    /// Point of the ellipsoid WGS 84 (height 0) at a slant range in the plane normal to the velocity, ECF. `None` if
    /// there is no such point.
    pub(super) fn ground_m(self, [position, velocity]: State, slant_range_m: f64) -> Option<DVec3> {
        let forward = velocity.try_normalize()?;
        let right = forward.cross(position).try_normalize()?;
        let down = right.cross(forward);
        // Towards the Earth, for either sign of the cross products.
        let down = if down.dot(position) > 0.0 {
            -down
        } else {
            down
        };
        let aside = match self {
            Self::Left => -right,
            Self::Right => right,
        };
        let point = |cosine: f64| {
            let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
            position + (down * cosine + aside * sine) * slant_range_m
        };
        let height_m = |cosine: f64| Geodetic::from_ecf_m(point(cosine)).height_m;
        // The height falls as the cosine rises.
        let (mut above, mut below) = (0.0, 1.0);
        if !(height_m(above) > 0.0 && height_m(below) < 0.0) {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (above + below);
            if height_m(middle) > 0.0 {
                above = middle;
            } else {
                below = middle;
            }
        }
        Some(point(below))
    }

    /// Frame with its origin at `origin`, on the ellipsoid: x away from the radar along the ground, z up. `None` if the
    /// radar is above the origin.
    pub(super) fn frame(origin: DVec3, radar: DVec3) -> Option<SceneFrame> {
        let [_, _, up] = Geodetic::from_ecf_m(origin).east_north_up();
        let away = origin - radar;
        let x_axis_ecf = (away - up * away.dot(up)).try_normalize()?;
        Some(SceneFrame::Earth {
            origin_ecf_m: origin,
            x_axis_ecf,
            y_axis_ecf: up.cross(x_axis_ecf),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_point_has_range_side_and_height() {
        // Northwards over the equator at longitude 0: right is east.
        let state = [
            DVec3::new(7_078_137.0, 0.0, 0.0),
            DVec3::new(0.0, 0.0, 7500.0),
        ];
        for (side, sign) in [(LookSide::Right, 1.0), (LookSide::Left, -1.0)] {
            let point = side.ground_m(state, 850_000.0).unwrap();
            let place = Geodetic::from_ecf_m(point);
            assert!(place.height_m.abs() < 1e-6, "{place:?}");
            assert!((point.distance(state[0]) - 850_000.0).abs() < 1e-6);
            assert!(place.longitude_deg * sign > 4.0 && place.latitude_deg.abs() < 1e-12);
            let frame = LookSide::frame(point, state[0]).unwrap();
            assert!(frame.is_sound());
            // y is the direction of flight of a radar that looks to the right.
            let ahead = frame.direction_from_ecf(DVec3::Z);
            assert!((ahead.y - sign).abs() < 1e-9, "{ahead}");
        }
        // Nearer than the ground, and beyond the horizon.
        assert_eq!(LookSide::Right.ground_m(state, 600_000.0), None);
        assert_eq!(LookSide::Right.ground_m([DVec3::ZERO; 2], 1.0), None);
    }
}
