//! Look direction and north, as arrows on a picture.

use glam::DVec3;

use subaperture_model::geometry::{ImageGrid, SceneFrame};
use subaperture_model::phase_history::Collection;

/// Smallest length of an arrow in the picture plane, relative to its direction's unit vector.
const LEAST: f64 = 0.05;

/// Look direction and north in the scene; `None` if unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Orientation {
    /// Direction from radar to scene at the middle pulse, unit vector.
    pub look: Option<DVec3>,
    /// North, unit vector; `None` without a position on the Earth.
    pub north: Option<DVec3>,
}

/// Arrow on the page: name, and components to the right and upwards; unit length or
/// foreshortened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrow {
    pub(super) name: &'static str,
    pub(super) right: f64,
    pub(super) up: f64,
}

impl Orientation {
    /// Directions of a collection's middle pulse at the centre of `grid`.
    pub fn of(collection: &Collection, grid: &ImageGrid) -> Self {
        let middle = centre(grid);
        let pulse = collection.pulses.get(collection.pulses.len() / 2);
        let look = pulse.and_then(|pulse| {
            let antenna = pulse.phase_centre_m();
            (middle - antenna).try_normalize()
        });
        Self {
            look,
            north: north(&collection.frame, middle),
        }
    }

    /// Arrows on a picture of `grid`, at its centre.
    pub(super) fn arrows(&self, grid: &ImageGrid) -> Vec<Arrow> {
        let (right, up) = page_axes(grid);
        let arrow = |name, direction: Option<DVec3>| {
            let direction = direction?;
            let arrow = Arrow {
                name,
                right: direction.dot(right),
                up: direction.dot(up),
            };
            (arrow.right.hypot(arrow.up) > LEAST).then_some(arrow)
        };
        [arrow("look", self.look), arrow("N", self.north)]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// Scene point at the centre of a grid.
fn centre(grid: &ImageGrid) -> DVec3 {
    let half = |count: usize| (count.max(1) - 1) as f64 / 2.0;
    let at = |axis: &subaperture_model::geometry::Axis| axis.start + half(axis.count) * axis.step;
    grid.point_m(at(&grid.rows), at(&grid.columns))
}

/// Scene directions of right and up on a picture of `grid`, at its centre. Angles of a
/// polar grid increase to the left.
fn page_axes(grid: &ImageGrid) -> (DVec3, DVec3) {
    if !grid.polar {
        return (grid.x_axis, grid.y_axis);
    }
    let outwards = (centre(grid) - grid.origin_m).normalize_or_zero();
    let (cos, sin) = (outwards.dot(grid.x_axis), outwards.dot(grid.y_axis));
    (grid.x_axis * sin - grid.y_axis * cos, outwards)
}

/// North at a scene point: the component of the Earth's axis normal to the vertical.
fn north(frame: &SceneFrame, point: DVec3) -> Option<DVec3> {
    let SceneFrame::Earth {
        origin_ecf_m,
        x_axis_ecf,
        y_axis_ecf,
    } = *frame
    else {
        return None;
    };
    let z_axis_ecf = x_axis_ecf.cross(y_axis_ecf);
    let at = origin_ecf_m + x_axis_ecf * point.x + y_axis_ecf * point.y + z_axis_ecf * point.z;
    // The geocentric direction differs from the vertical by up to 0.2 degrees, in the meridian
    // plane: the azimuth of north is exact.
    let up = at.try_normalize()?;
    let north_ecf = (DVec3::Z - up * up.z).try_normalize()?;
    Some(DVec3::new(
        north_ecf.dot(x_axis_ecf),
        north_ecf.dot(y_axis_ecf),
        north_ecf.dot(z_axis_ecf),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_follow_picture_axes() {
        let look = Orientation {
            look: Some(DVec3::new(0.0, 0.8, -0.6)),
            north: None,
        };
        let arrows = |text: &str| look.arrows(&text.parse().unwrap());
        let arrow = |right: f64, up: f64| Arrow {
            name: "look",
            right,
            up,
        };
        assert_eq!(arrows("x=-1:1:1,y=-1:1:1"), [arrow(0.0, 0.8)]);
        // A vertical grid facing the radar: the look direction points down the picture, mostly out of plane.
        let wall = arrows("x=-1:1:1,y=-1:1:1,roll=90");
        assert!((wall[0].up + 0.6).abs() < 1e-12 && wall[0].right.abs() < 1e-12);
        // At theta = 90 degrees range increases along y, and angles to the left: -x is left.
        let polar = arrows("r=1:3:1,theta=80:101:10");
        assert!((polar[0].up - 0.8).abs() < 1e-12 && polar[0].right.abs() < 1e-12);
        let aside = Orientation {
            look: Some(DVec3::X),
            north: None,
        };
        let polar = aside.arrows(&"r=1:3:1,theta=80:101:10".parse().unwrap());
        assert!((polar[0].right - 1.0).abs() < 1e-12, "{polar:?}");
        // Normal to the picture: no arrow.
        let down = Orientation {
            look: Some(-DVec3::Z),
            north: None,
        };
        assert_eq!(down.arrows(&"x=-1:1:1,y=-1:1:1".parse().unwrap()), []);
    }

    #[test]
    fn north_follows_earth_frame() {
        // Frame at 30 N, 0 E with x north and y west.
        let (sin, cos) = (0.5, 0.75f64.sqrt());
        let frame = SceneFrame::Earth {
            origin_ecf_m: DVec3::new(cos, 0.0, sin) * 6.37e6,
            x_axis_ecf: DVec3::new(-sin, 0.0, cos),
            y_axis_ecf: DVec3::new(0.0, -1.0, 0.0),
        };
        let found = north(&frame, DVec3::ZERO).unwrap();
        assert!(found.distance(DVec3::X) < 1e-9, "{found}");
        assert_eq!(north(&SceneFrame::Local, DVec3::ZERO), None);
    }
}
