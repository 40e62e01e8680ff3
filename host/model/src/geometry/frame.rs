//! Scene frame: the Cartesian axes of all positions.

use glam::DVec3;

use super::Geodetic;

/// Origin and axes of the scene. `z = x cross y`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SceneFrame {
    /// Local axes of the recording, without a position on the Earth.
    Local,
    /// Axes tied to the Earth, for example by a CPHD's `IARP`, `uIAX` and `uIAY`.
    Earth {
        /// Scene origin, Earth-centred Earth-fixed (WGS 84), metres.
        origin_ecf_m: DVec3,
        /// Unit vector of the scene's x axis in ECF.
        x_axis_ecf: DVec3,
        /// Unit vector of the scene's y axis in ECF, orthogonal to `x_axis_ecf`.
        y_axis_ecf: DVec3,
    },
}

impl SceneFrame {
    /// Frame with axes east, north and up (normal to the ellipsoid) at a point on the Earth.
    pub fn east_north_up(origin: &Geodetic) -> Self {
        let [east, north, _] = origin.east_north_up();
        Self::Earth {
            origin_ecf_m: origin.to_ecf_m(),
            x_axis_ecf: east,
            y_axis_ecf: north,
        }
    }

    /// Convert a scene position to geodetic coordinates; `None` in a local frame.
    pub fn geodetic(&self, position: DVec3) -> Option<Geodetic> {
        match self {
            Self::Local => None,
            Self::Earth { .. } => Some(Geodetic::from_ecf_m(self.to_ecf_m(position))),
        }
    }

    /// Whether equal coordinates in both frames are the same point, within a micrometre at a kilometre.
    pub fn agrees_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Local, Self::Local) => true,
            (
                Self::Earth {
                    origin_ecf_m: o1,
                    x_axis_ecf: x1,
                    y_axis_ecf: y1,
                },
                Self::Earth {
                    origin_ecf_m: o2,
                    x_axis_ecf: x2,
                    y_axis_ecf: y2,
                },
            ) => o1.distance(*o2) < 1e-6 && x1.distance(*x2) < 1e-9 && y1.distance(*y2) < 1e-9,
            _ => false,
        }
    }

    /// Whether the axes are orthogonal unit vectors (to 1e-6) and the origin lies within 10^10 m of the Earth's
    /// centre.
    pub fn is_sound(&self) -> bool {
        let Self::Earth {
            origin_ecf_m,
            x_axis_ecf,
            y_axis_ecf,
        } = self
        else {
            return true;
        };
        let unit = |v: &DVec3| (v.length() - 1.0).abs() <= 1e-6;
        unit(x_axis_ecf)
            && unit(y_axis_ecf)
            && x_axis_ecf.dot(*y_axis_ecf).abs() <= 1e-6
            && origin_ecf_m.length() <= 1e10
    }

    /// Convert an ECF position to the scene frame. Unchanged in a local frame.
    pub fn from_ecf_m(&self, position: DVec3) -> DVec3 {
        match *self {
            Self::Local => position,
            Self::Earth { origin_ecf_m, .. } => self.direction_from_ecf(position - origin_ecf_m),
        }
    }

    /// Convert a scene position to ECF. Unchanged in a local frame. Inverse of [`Self::from_ecf_m`].
    pub fn to_ecf_m(&self, position: DVec3) -> DVec3 {
        match *self {
            Self::Local => position,
            Self::Earth { origin_ecf_m, .. } => origin_ecf_m + self.direction_to_ecf(position),
        }
    }

    /// Convert an ECF direction to scene axes. Unchanged in a local frame.
    pub fn direction_from_ecf(&self, direction: DVec3) -> DVec3 {
        match *self {
            Self::Local => direction,
            Self::Earth {
                x_axis_ecf,
                y_axis_ecf,
                ..
            } => DVec3::new(
                direction.dot(x_axis_ecf),
                direction.dot(y_axis_ecf),
                direction.dot(x_axis_ecf.cross(y_axis_ecf)),
            ),
        }
    }

    /// Convert a scene direction to ECF axes. Unchanged in a local frame.
    pub fn direction_to_ecf(&self, direction: DVec3) -> DVec3 {
        match *self {
            Self::Local => direction,
            Self::Earth {
                x_axis_ecf,
                y_axis_ecf,
                ..
            } => {
                x_axis_ecf * direction.x
                    + y_axis_ecf * direction.y
                    + x_axis_ecf.cross(y_axis_ecf) * direction.z
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_frame_converts_positions_and_directions() {
        // On the equator at 90 deg east: x east is -X, y north is Z, so z up is Y.
        let frame = SceneFrame::Earth {
            origin_ecf_m: DVec3::new(0.0, 6_378_137.0, 0.0),
            x_axis_ecf: DVec3::NEG_X,
            y_axis_ecf: DVec3::Z,
        };
        let place = DVec3::new(1.0, 20.0, 300.0);
        let ecf = DVec3::new(-1.0, 6_378_437.0, 20.0);
        assert!(frame.to_ecf_m(place).distance(ecf) < 1e-9);
        assert!(frame.from_ecf_m(ecf).distance(place) < 1e-9);
        assert!(frame.agrees_with(&frame) && !frame.agrees_with(&SceneFrame::Local));
        let there = Geodetic {
            latitude_deg: 0.0,
            longitude_deg: 90.0,
            height_m: 0.0,
        };
        assert!(SceneFrame::east_north_up(&there).agrees_with(&frame));
        // 20 m north are 20 m / 6335.4 km of latitude. The height is 300 m up plus the drop of the curved Earth.
        let found = frame.geodetic(DVec3::new(0.0, 20.0, 300.0)).unwrap();
        let north_deg = (20.0f64 / (6_335_439.3 + 300.0)).to_degrees();
        assert!((found.latitude_deg - north_deg).abs() < 1e-10, "{found:?}");
        assert!(
            (found.height_m - 300.0 - 20.0 * 20.0 / (2.0 * 6_335_739.3)).abs() < 1e-7,
            "{found:?}"
        );
        assert_eq!(SceneFrame::Local.geodetic(place), None);
    }
}
