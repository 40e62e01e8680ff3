//! Plane of the targets, and the measurement of a target that moves in it.

use glam::DVec3;
use subaperture_model::geometry::ImageGrid;
use subaperture_signal::dense::fixed::Matrix;

/// Least cosine of the angle between the line of sight and the plane at which a radial velocity is used.
const LEAST_COSINE: f64 = 1e-3;

/// Plane in which targets move: `position = origin + x x_axis + y y_axis`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Plane {
    /// Point at `x = y = 0`, metres in the scene frame.
    pub origin_m: DVec3,
    /// Unit vector of x.
    pub x_axis: DVec3,
    /// Unit vector of y, perpendicular to x.
    pub y_axis: DVec3,
}

impl Plane {
    /// Horizontal plane at height `z_m`, with the scene's x and y.
    pub const fn horizontal(z_m: f64) -> Self {
        Self {
            origin_m: DVec3::new(0.0, 0.0, z_m),
            x_axis: DVec3::X,
            y_axis: DVec3::Y,
        }
    }

    /// Plane of an image grid.
    pub fn of(grid: &ImageGrid) -> Self {
        Self {
            origin_m: grid.origin_m,
            x_axis: grid.x_axis,
            y_axis: grid.y_axis,
        }
    }

    /// Position in the scene frame of `(x, y)`, metres.
    pub fn position_m(&self, [x_m, y_m]: [f64; 2]) -> DVec3 {
        self.origin_m + self.x_axis * x_m + self.y_axis * y_m
    }

    /// Coordinates `(x, y)` of the foot of the perpendicular from a position in the scene frame, metres.
    pub fn coordinates_m(&self, position_m: DVec3) -> [f64; 2] {
        self.along(position_m - self.origin_m)
    }

    /// Components of a vector along both axes.
    pub(super) fn along(&self, vector: DVec3) -> [f64; 2] {
        [vector.dot(self.x_axis), vector.dot(self.y_axis)]
    }

    /// Mixed second derivatives of the radial velocity by position (row) and velocity (column): `-(I - u u^T) / range`, 1/m.
    pub(super) fn curvature(&self, sensor_m: DVec3, position_m: [f64; 2]) -> Matrix<2, 2> {
        let line_m = self.position_m(position_m) - sensor_m;
        let range_m = line_m.length();
        let [ux, uy] = self.along(line_m / range_m);
        let mixed = -ux * uy;
        [[1.0 - ux * ux, mixed], [mixed, 1.0 - uy * uy]]
            .map(|row| row.map(|value| -value / range_m))
    }

    /// Measurement `(x, y, v_r)` of the state `(x, y, vx, vy)` from a radar at `sensor_m`, and its Jacobian. `None` if the line of
    /// sight is perpendicular to the plane.
    pub(super) fn measure(
        &self,
        sensor_m: DVec3,
        [x, y, vx, vy]: [f64; 4],
    ) -> Option<([f64; 3], Matrix<3, 4>)> {
        let line_m = self.position_m([x, y]) - sensor_m;
        let range_m = line_m.length();
        let sight = line_m / range_m;
        let [ux, uy] = self.along(sight);
        let usable = range_m > 0.0 && libm::hypot(ux, uy) >= LEAST_COSINE;
        let velocity = self.x_axis * vx + self.y_axis * vy;
        let receding = velocity.dot(sight);
        let [turn_x, turn_y] = self.along((velocity - sight * receding) / range_m);
        let jacobian = [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [-turn_x, -turn_y, -ux, -uy],
        ];
        usable.then_some(([x, y, -receding], jacobian))
    }
}

#[cfg(test)]
mod tests {
    use subaperture_model::geometry::Axis;

    use super::*;

    /// Radial velocity as minus the rate of the distance, by central differences of the distance in time.
    fn closing_m_s(plane: &Plane, sensor_m: DVec3, [x, y, vx, vy]: [f64; 4]) -> f64 {
        let distance = |t: f64| {
            let at = plane.position_m([x + vx * t, y + vy * t]);
            (at - sensor_m).length()
        };
        let h = 1e-3;
        (distance(-h) - distance(h)) / (2.0 * h)
    }

    #[test]
    fn jacobian_agrees_with_finite_differences() {
        let tilted = Plane {
            origin_m: DVec3::new(30.0, -20.0, 50.0),
            x_axis: DVec3::new(0.8, 0.6, 0.0),
            y_axis: DVec3::new(-0.48, 0.64, 0.6),
        };
        let sensor_m = DVec3::new(200.0, -900.0, 400.0);
        for plane in [Plane::horizontal(12.0), tilted] {
            for state in [
                [10.0, 40.0, 7.0, -3.0],
                [-150.0, 300.0, -12.0, 18.0],
                [150.0, -700.0, 0.0, 15.0],
            ] {
                let (z, jacobian) = plane.measure(sensor_m, state).unwrap();
                assert_eq!(z[..2], state[..2]);
                // Central differences of distances up to 1.5 km: rounding 2e-13 m over 2e-3 s, and a third derivative below 1e-3 m/s^3.
                let closing = closing_m_s(&plane, sensor_m, state);
                assert!((z[2] - closing).abs() < 1e-8, "{} {closing}", z[2]);
                for i in 0..4 {
                    let h = [1e-2, 1e-2, 1e-3, 1e-3][i];
                    let at = |step: f64| {
                        let mut moved = state;
                        moved[i] += step;
                        plane.measure(sensor_m, moved).unwrap().0
                    };
                    let (above, below) = (at(h), at(-h));
                    for row in 0..3 {
                        let slope = (above[row] - below[row]) / (2.0 * h);
                        // Rounding 1e-13 over 2e-3; the third derivatives contribute less.
                        assert!((jacobian[row][i] - slope).abs() < 1e-9, "{row} {i}");
                    }
                    let slopes = |state| plane.measure(sensor_m, state).unwrap().1[2];
                    if let Some(mixed) = plane.curvature(sensor_m, [state[0], state[1]]).get(i) {
                        let mut moved = [state; 2];
                        moved[0][i] += h;
                        moved[1][i] -= h;
                        let [above, below] = moved.map(slopes);
                        for j in 0..2 {
                            let slope = (above[j + 2] - below[j + 2]) / (2.0 * h);
                            // Rounding of direction cosines, 1e-16 over 2e-2.
                            assert!((mixed[j] - slope).abs() < 1e-11, "{i} {j}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn line_of_sight_along_the_normal_is_not_used() {
        let plane = Plane::horizontal(0.0);
        let above = DVec3::new(5.0, 5.0, 1000.0);
        let from = |sensor_m| plane.measure(sensor_m, [5.0, 5.0, 3.0, 4.0]);
        assert!(from(above).is_none());
        assert!(from(plane.position_m([5.0, 5.0])).is_none());
        assert!(from(above + DVec3::X * 2.0).is_some());
    }

    #[test]
    fn coordinates_invert_positions() {
        let axis = Axis::from_range(-5.0, 5.0, 1.0).unwrap();
        let grid = ImageGrid::horizontal(axis, axis, 7.0);
        let plane = Plane::of(&grid);
        assert_eq!(plane, Plane::horizontal(7.0));
        assert_eq!(
            plane.coordinates_m(plane.position_m([3.0, -4.0])),
            [3.0, -4.0]
        );
    }
}
