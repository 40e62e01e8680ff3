//! Axes of an image for the page: names, units, values, and the directions of north and of the line of sight.
//!
//! Directions are unit vectors in the image's plane, `[along rows, along columns]`, positive towards ascending rows and columns. A direction of the scene appears
//! in the plane as its orthogonal projection: in a slant plane, points at constant range and Doppler frequency lie on the plane's normal. Directions hold at the
//! image's centre. On a polar grid they differ from column to column: the page computes them at the centre of the view, from the direction of north along the
//! plane's axes and from the antenna's position.

use glam::DVec3;
use serde_json::{Value, json};
use subaperture_model::geometry::{Geodetic, SceneFrame};

use super::{Product, point};

/// Length of a projected unit vector below which its direction is meaningless.
const SHORT: f64 = 0.05;

/// Axes of an image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axes {
    rows: Labelled,
    columns: Labelled,
    /// Angle between the image's plane and the horizontal plane, degrees; `None` without a grid.
    tilt_deg: Option<f64>,
    /// North, if the image is georeferenced; for a polar grid along the plane's y and x axes.
    north: Option<[f64; 2]>,
    /// Direction from the antenna to the scene, if the antenna's position is known and the grid is not polar.
    look: Option<[f64; 2]>,
    /// Antenna of a polar grid from the pole, along the plane's x and y axes and its normal, metres.
    antenna_m: Option<[f64; 3]>,
}

/// Values along rows or columns.
#[derive(Clone, Debug, PartialEq)]
struct Labelled {
    name: &'static str,
    /// Unit; empty for numbers of rows and columns.
    unit: &'static str,
    /// Value of the first pixel's centre, and increment per pixel.
    start: f64,
    step: f64,
}

impl Axes {
    /// Axes of a product.
    pub(super) fn of(product: &Product) -> Self {
        let labelled = |name, unit, start, step| Labelled {
            name,
            unit,
            start,
            step,
        };
        let Some(grid) = &product.grid else {
            return Self {
                rows: labelled("row", "", 0.0, 1.0),
                columns: labelled("column", "", 0.0, 1.0),
                tilt_deg: None,
                north: None,
                look: None,
                antenna_m: None,
            };
        };
        let (down, across) = (grid.rows, grid.columns);
        let middle =
            |start: f64, step: f64, count: usize| start + step * (count as f64 - 1.0) / 2.0;
        let centre = grid.point_m(
            middle(down.start, down.step, down.count),
            middle(across.start, across.step, across.count),
        );
        let place = point::place(product, centre);
        let direction = |of: fn([DVec3; 3]) -> DVec3| {
            let place: Option<Geodetic> = place;
            place.map(|place| product.frame.direction_from_ecf(of(place.east_north_up())))
        };
        let up = match product.frame {
            SceneFrame::Local => Some(DVec3::Z),
            SceneFrame::Earth { .. } => direction(|[_, _, up]| up),
        };
        let antenna_m = product.antenna_m;
        let antenna_m = antenna_m.or(product.carrier.map(|carrier| carrier.antenna_m));
        let look = antenna_m.map(|antenna_m| (centre - antenna_m).normalize_or_zero());
        let in_plane = |direction: DVec3| {
            let parts = [direction.dot(grid.y_axis), direction.dot(grid.x_axis)];
            let length = libm::hypot(parts[0], parts[1]);
            (length > SHORT).then(|| parts.map(|part| part / length))
        };
        let from_pole_m = |antenna_m: DVec3| {
            let axes = [grid.x_axis, grid.y_axis, grid.normal()];
            axes.map(|axis| axis.dot(antenna_m - grid.origin_m))
        };
        let [rows, columns] = match grid.polar {
            true => [
                labelled("range", "m", down.start, down.step),
                labelled(
                    "angle",
                    "°",
                    across.start.to_degrees(),
                    across.step.to_degrees(),
                ),
            ],
            false => [
                labelled("y", "m", down.start, down.step),
                labelled("x", "m", across.start, across.step),
            ],
        };
        let tilt = |up: DVec3| libm::acos(grid.normal().dot(up).abs().min(1.0)).to_degrees();
        Self {
            rows,
            columns,
            tilt_deg: up.map(tilt),
            north: direction(|[_, north, _]| north).and_then(in_plane),
            look: look.filter(|_| !grid.polar).and_then(in_plane),
            antenna_m: antenna_m.filter(|_| grid.polar).map(from_pole_m),
        }
    }

    pub(super) fn to_json(&self) -> Value {
        let axis = |axis: &Labelled| json!({ "name": axis.name, "unit": axis.unit, "start": axis.start, "step": axis.step });
        json!({
            "rows": axis(&self.rows),
            "columns": axis(&self.columns),
            "tilt_deg": self.tilt_deg,
            "north": self.north,
            "look": self.look,
            "antenna_m": self.antenna_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::samples::of_ones;

    fn assert_near(found: Option<[f64; 2]>, expected: [f64; 2], tolerance: f64) {
        let found = found.unwrap();
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < tolerance, "{found:?} {expected:?}");
        }
    }

    /// Axes of a grid turned by 30 degrees from x towards y: north (y) lies 30 degrees from its y axis, towards x. A radar at (-600, -800) looks towards
    /// (0.6, 0.8): components by the angle of 53.13 - 30 degrees from its x axis.
    #[test]
    fn directions_on_the_ground_follow_the_grid() {
        let origin = Geodetic {
            latitude_deg: 45.0,
            longitude_deg: 10.0,
            height_m: 300.0,
        };
        let mut shown = of_ones("x=-20:21:1,y=-10:11:0.5,z=0,yaw=30", SceneFrame::Local);
        shown.antenna_m = Some(DVec3::new(-600.0, -800.0, 5000.0));
        let angle = (0.8f64 / 0.6).atan() - 30f64.to_radians();
        // The centre of the rows is 0.25 m off the origin.
        let look = [angle.sin(), angle.cos()];
        let local = Axes::of(&shown);
        assert_near(local.look, look, 1e-3);
        assert_eq!((local.north, local.tilt_deg), (None, Some(0.0)));
        shown.frame = SceneFrame::east_north_up(&origin);
        let placed = Axes::of(&shown);
        assert_near(placed.north, [0.75f64.sqrt(), 0.5], 1e-6);
        assert_near(placed.look, look, 1e-3);
        assert!(placed.tilt_deg.unwrap() < 1e-3);
        // From directly above there is no direction on the ground.
        shown.antenna_m = Some(DVec3::new(0.0, 0.0, 5000.0));
        assert_eq!(Axes::of(&shown).look, None);
        let names = |axes: &Axes| [axes.rows.name, axes.columns.unit];
        assert_eq!(names(&placed), ["y", "m"]);
        let mut polar = of_ones("r=100:200:1,theta=-30:30:0.5", SceneFrame::Local);
        polar.antenna_m = Some(DVec3::new(1.0, -2.0, 3.0));
        let local = Axes::of(&polar);
        assert_eq!(
            (local.north, local.antenna_m),
            (None, Some([1.0, -2.0, 3.0]))
        );
        polar.frame = SceneFrame::east_north_up(&origin);
        let polar = Axes::of(&polar);
        // Meridians converge: 150 m to the east, north deviates by 24 microradians.
        assert_near(polar.north, [1.0, 0.0], 1e-4);
        assert_eq!((names(&polar), polar.look), (["range", "°"], None));
        assert!((polar.columns.start + 30.0).abs() < 1e-9);
        assert!((polar.columns.step - 0.5).abs() < 1e-9);
    }

    /// Slant plane of a radar that looks towards 40 degrees east of north, 35 degrees down: rows run away from it. A pixel displaced along the arrow lies due north
    /// on the ground: same longitude, higher latitude by the meridian's radius of 6367 km.
    #[test]
    fn north_in_a_slant_plane_points_north_on_the_ground() {
        let origin = Geodetic {
            latitude_deg: 45.0,
            longitude_deg: 10.0,
            height_m: 0.0,
        };
        let [east, north, up] = origin.east_north_up();
        let (sin, cos) = 40f64.to_radians().sin_cos();
        let (drop, along) = 35f64.to_radians().sin_cos();
        let mut shown = of_ones("x=-20:21:1,y=-20:21:1,z=0", SceneFrame::Local);
        shown.frame = SceneFrame::Earth {
            origin_ecf_m: origin.to_ecf_m(),
            x_axis_ecf: east * cos - north * sin,
            y_axis_ecf: (east * sin + north * cos) * along - up * drop,
        };
        shown.slant = true;
        let antenna = (east * sin + north * cos) * -along + up * drop;
        shown.antenna_m = Some(shown.frame.direction_from_ecf(antenna) * 1e5);
        let axes = Axes::of(&shown);
        assert_near(axes.look, [1.0, 0.0], 1e-6);
        assert!((axes.tilt_deg.unwrap() - 35.0).abs() < 1e-3);
        let [rows, columns] = axes.north.unwrap();
        let grid = shown.grid.as_ref().unwrap();
        let [from, to] = [0.0, 15.0].map(|d| {
            let position = grid.point_m(d * rows, d * columns);
            point::place(&shown, position).unwrap()
        });
        let east_m = (to.longitude_deg - from.longitude_deg).to_radians() * 6.39e6 * 0.5f64.sqrt();
        let north_m = (to.latitude_deg - from.latitude_deg).to_radians() * 6.367e6;
        assert!(east_m.abs() < 1e-3 * north_m, "{east_m} {north_m}");
        // Foreshortened along range by cos 35, not across.
        assert!(north_m > 15.0 && north_m < 15.0 / along, "{north_m}");
    }
}
