//! Display of a grid's coordinates in the scene frame.
//!
//! A grid counts x and y from its origin along its own axes. If such an axis is parallel to one of the scene's, the
//! scene coordinate is displayed: `origin + sign * coordinate`. Any other axis is named u (columns) or v (rows), with
//! a note on its direction and origin.

use glam::DVec3;

use super::ImageGrid;

/// Maximum difference of unit vectors that count as equal; rounding of described rotations is about 1e-16.
const SAME: f64 = 1e-9;

/// Scene coordinate of a Cartesian grid's axis: `offset_m + sign * coordinate`.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneAxis {
    /// x, y or z of the scene; u or v of a rotated grid.
    pub name: &'static str,
    /// Value at coordinate 0, metres.
    pub offset_m: f64,
    /// 1, or -1 for an axis opposite to the scene's.
    pub sign: f64,
    /// Direction and origin of u or v, such as `along (0.87, 0.50, 0.00) from (10, -5, 0) m`; otherwise empty.
    pub note: String,
}

impl SceneAxis {
    /// Displayed value for a grid coordinate in metres.
    pub fn value_m(&self, coordinate_m: f64) -> f64 {
        self.offset_m + self.sign * coordinate_m
    }

    fn new(origin_m: DVec3, along: DVec3, otherwise: &'static str) -> Self {
        for (name, axis) in [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)] {
            for sign in [1.0, -1.0] {
                if along.distance(axis * sign) < SAME {
                    return Self {
                        name,
                        offset_m: origin_m.dot(axis),
                        sign,
                        note: String::new(),
                    };
                }
            }
        }
        // Adding zero turns -0 into 0.
        let [x, y, z] = along.to_array().map(|v| (v * 100.0).round() / 100.0 + 0.0);
        let from = match origin_m == DVec3::ZERO {
            true => String::new(),
            false => format!(" from {}", place(origin_m)),
        };
        Self {
            name: otherwise,
            offset_m: 0.0,
            sign: 1.0,
            note: format!("along ({x:.2}, {y:.2}, {z:.2}){from}"),
        }
    }
}

/// Point as text, in millimetres without trailing zeros.
fn place(point: DVec3) -> String {
    let number = |v: f64| {
        let text = format!("{v:.3}");
        let text = text.trim_end_matches('0').trim_end_matches('.');
        match text {
            "-0" => "0".to_owned(),
            _ => text.to_owned(),
        }
    };
    let DVec3 { x, y, z } = point;
    format!("({}, {}, {}) m", number(x), number(y), number(z))
}

impl ImageGrid {
    /// Scene axes of the columns and rows of a Cartesian grid; for a polar grid, of
    /// `theta = 0` and `theta = pi / 2`.
    pub fn scene_axes(&self) -> [SceneAxis; 2] {
        [
            SceneAxis::new(self.origin_m, self.x_axis, "u"),
            SceneAxis::new(self.origin_m, self.y_axis, "v"),
        ]
    }

    /// Origin of a polar grid's range and angle, such as ` from (1, 2, 0) m`; empty at the scene's origin.
    pub fn pole_note(&self) -> String {
        match self.origin_m == DVec3::ZERO {
            true => String::new(),
            false => format!(" from {}", place(self.origin_m)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For any axis name, the displayed coordinates of a pixel are those of its scene position.
    #[test]
    fn scene_axes_display_scene_coordinates() {
        for (text, names) in [
            ("x=-3:3:1,y=-3:3:1,z=2", ["x", "y"]),
            ("x=-3:3:1,y=-3:3:1,cx=10,cy=-5", ["x", "y"]),
            ("x=-3:3:1,y=-3:3:1,cx=10,cy=-5,yaw=90", ["y", "x"]),
            ("x=-3:3:1,y=-3:3:1,cx=-15.6,cy=21.6,roll=90", ["x", "z"]),
            ("x=-3:3:1,y=-3:3:1,yaw=90,roll=90,cy=4", ["y", "z"]),
            ("x=-3:3:1,y=-3:3:1,yaw=180,cx=1", ["x", "y"]),
        ] {
            let grid: ImageGrid = text.parse().unwrap();
            let axes = grid.scene_axes();
            assert_eq!([axes[0].name, axes[1].name], names, "{text}");
            let point = grid.point_m(1.25, -2.0);
            for (axis, coordinate) in axes.iter().zip([-2.0, 1.25]) {
                let expected = match axis.name {
                    "x" => point.x,
                    "y" => point.y,
                    _ => point.z,
                };
                let shown = axis.value_m(coordinate);
                assert!((shown - expected).abs() < 1e-9, "{text}: {shown}");
                assert!(axis.note.is_empty());
            }
        }
    }

    #[test]
    fn rotated_axes_have_a_note_on_direction() {
        let grid: ImageGrid = "x=0:9:1,y=0:9:1,yaw=30,cx=10,cy=-5.25".parse().unwrap();
        let [u, v] = grid.scene_axes();
        assert_eq!((u.name, v.name), ("u", "v"));
        assert_eq!(u.note, "along (0.87, 0.50, 0.00) from (10, -5.25, 0) m");
        assert_eq!(v.note, "along (-0.50, 0.87, 0.00) from (10, -5.25, 0) m");
        assert_eq!(u.value_m(3.0), 3.0);
        let grid: ImageGrid = "x=0:9:1,y=0:9:1,roll=30".parse().unwrap();
        let [x, v] = grid.scene_axes();
        assert_eq!((x.name, v.name), ("x", "v"));
        assert_eq!(v.note, "along (0.00, 0.87, 0.50)");
    }
}
