//! Image grids: positions of the pixels in the scene.
//!
//! A grid has rows and columns; pixel `(row, column)` has the index `row * columns + column`. Two kinds:
//! - Cartesian in a plane of any orientation: `origin + x_axis x(column) + y_axis y(row)`;
//! - polar in such a plane: `origin + r (x_axis cos(theta) + y_axis sin(theta))` with range `r` by
//!   row and angle `theta` by column.
//!
//! With a [`Relief`] the pixels are on a surface above the plane, displaced along the plane's normal.

use std::str::FromStr;

use glam::{DQuat, DVec3, EulerRot};

use super::axis::MAX_ELEMENTS;
use super::{Axis, GridError, Relief};
use crate::units::Dimension;

/// Rectangle in the scene plane, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Smallest and largest x.
    pub x_m: (f64, f64),
    /// Smallest and largest y.
    pub y_m: (f64, f64),
}

/// Rectangular array of scene points.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ImageGrid {
    /// Point at `x = y = 0`, or the pole of a polar grid, metres in the scene frame.
    pub origin_m: DVec3,
    /// Unit vector of x, or of `theta = 0`.
    pub x_axis: DVec3,
    /// Unit vector of y, or of `theta = pi / 2`.
    pub y_axis: DVec3,
    /// Columns: x in metres, or angle in radians.
    pub columns: Axis,
    /// Rows: y in metres, or range from the pole in metres.
    pub rows: Axis,
    /// Whether rows and columns are range and angle.
    pub polar: bool,
    /// Heights of the pixels' surface above the plane. `None` for pixels in the plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relief: Option<Relief>,
}

impl ImageGrid {
    /// Create a horizontal Cartesian grid at height `z_m`.
    pub fn horizontal(x: Axis, y: Axis, z_m: f64) -> Self {
        Self {
            origin_m: DVec3::new(0.0, 0.0, z_m),
            x_axis: DVec3::X,
            y_axis: DVec3::Y,
            columns: x,
            rows: y,
            polar: false,
            relief: None,
        }
    }

    /// Same grid with pixels on a surface above its plane.
    #[must_use]
    pub fn on(self, relief: Relief) -> Self {
        Self {
            relief: Some(relief),
            ..self
        }
    }

    /// Same grid with pixels in its plane.
    #[must_use]
    pub fn flat(&self) -> Self {
        Self {
            relief: None,
            ..self.clone()
        }
    }

    /// Whether the grid is Cartesian and planar, so that pixels are equally spaced on straight lines.
    #[inline]
    pub fn is_raster(&self) -> bool {
        !self.polar && self.relief.is_none()
    }

    /// Describe the fault of an invalid grid; `None` if it is valid. Faults: axes that are not orthogonal unit
    /// vectors, axes without elements or with more than 1e9, a coordinate that is NaN or farther than 1e9 m from the
    /// scene's origin (for an angle 1e9 rad).
    pub fn fault(&self) -> Option<GridError> {
        let (x, y) = (self.x_axis, self.y_axis);
        let off = (x.length() - 1.0)
            .abs()
            .max((y.length() - 1.0).abs())
            .max(x.dot(y).abs());
        // An overflowing length is NaN or infinite.
        if off.is_nan() || off > AXIS_TOLERANCE {
            let what = format!(
                "expected x_axis and y_axis to be orthogonal unit vectors, found a deviation of {off:.1e}"
            );
            return Some(GridError(what));
        }
        for (name, axis) in [("columns", self.columns), ("rows", self.rows)] {
            if axis.count == 0 || axis.count as f64 > MAX_ELEMENTS {
                let what = format!(
                    "expected 1 to {MAX_ELEMENTS:e} {name}, found {}",
                    axis.count
                );
                return Some(GridError(what));
            }
            let ends = [axis.start, axis.at(axis.count - 1)];
            let known = axis.step > 0.0 && axis.step.is_finite();
            if !known || !ends.iter().all(|end| end.abs() <= FARTHEST_M) {
                let what = format!(
                    "its {name} run from {} to {} in steps of {}: a positive step and ends of at most \
                     {FARTHEST_M:e} are possible",
                    ends[0], ends[1], axis.step
                );
                return Some(GridError(what));
            }
        }
        let far = !self
            .origin_m
            .to_array()
            .iter()
            .all(|x| x.abs() <= FARTHEST_M);
        far.then(|| {
            GridError(format!(
                "its origin is more than {FARTHEST_M:e} m from the scene's origin"
            ))
        })
    }

    /// Number of pixels. Cannot overflow for axes of at most 1e9 elements.
    #[inline]
    pub fn num_pixels(&self) -> u64 {
        self.rows.count as u64 * self.columns.count as u64
    }

    /// Scene position of a pixel in metres.
    #[inline]
    pub fn position_m(&self, row: usize, column: usize) -> DVec3 {
        self.point_m(self.rows.at(row), self.columns.at(column))
    }

    /// Scene position in metres at grid coordinates: y and x, or range and angle.
    #[inline]
    pub fn point_m(&self, row_value: f64, column_value: f64) -> DVec3 {
        let flat = if self.polar {
            let (sin, cos) = libm::sincos(column_value);
            self.origin_m + (self.x_axis * cos + self.y_axis * sin) * row_value
        } else {
            self.origin_m + self.x_axis * column_value + self.y_axis * row_value
        };
        match &self.relief {
            None => flat,
            Some(relief) => {
                let [x, y] = self.plane_m(row_value, column_value);
                flat + self.normal() * relief.height_m(x, y)
            }
        }
    }

    /// Position in the plane at grid coordinates, metres along the plane's axes from the origin.
    #[inline]
    pub fn plane_m(&self, row_value: f64, column_value: f64) -> [f64; 2] {
        match self.polar {
            true => {
                let (sin, cos) = libm::sincos(column_value);
                [row_value * cos, row_value * sin]
            }
            false => [column_value, row_value],
        }
    }

    /// Normal of the plane, `x_axis` cross `y_axis`.
    #[inline]
    pub fn normal(&self) -> DVec3 {
        self.x_axis.cross(self.y_axis)
    }
}

/// Maximum deviation of the axes from orthonormal; rounding causes about 1e-16.
const AXIS_TOLERANCE: f64 = 1e-6;

impl ImageGrid {
    /// Derivatives of the scene position with respect to the column's and the row's value at grid coordinates: unit
    /// vectors, except metres per radian for the angle of a polar grid, and longer vectors on a sloping surface.
    #[inline]
    pub fn directions(&self, row_value: f64, column_value: f64) -> [DVec3; 2] {
        let flat = match self.polar {
            false => [self.x_axis, self.y_axis],
            true => {
                let (sin, cos) = libm::sincos(column_value);
                [
                    (self.y_axis * cos - self.x_axis * sin) * row_value,
                    self.x_axis * cos + self.y_axis * sin,
                ]
            }
        };
        let Some(relief) = &self.relief else {
            return flat;
        };
        let [x, y] = self.plane_m(row_value, column_value);
        let [along_x, along_y] = relief.slopes(x, y);
        flat.map(|direction| {
            let rise = along_x * direction.dot(self.x_axis) + along_y * direction.dot(self.y_axis);
            direction + self.normal() * rise
        })
    }

    /// Grid coordinates (row's and column's value) of the point of the plane nearest to a scene point. For a point of
    /// the grid's surface these are the coordinates of that point.
    #[inline]
    pub fn coordinates(&self, point_m: DVec3) -> [f64; 2] {
        let from = point_m - self.origin_m;
        let (x, y) = (from.dot(self.x_axis), from.dot(self.y_axis));
        match self.polar {
            true => [libm::hypot(x, y), libm::atan2(y, x)],
            false => [y, x],
        }
    }
}

/// Maximum distance of a coordinate from the scene's origin in metres: beyond any scene, but still resolved to 1e-7 m
/// in float64.
const FARTHEST_M: f64 = 1e9;

/// Parse `x=START:STOP:STEP,y=START:STOP:STEP` or, with theta in degrees, `r=START:STOP:STEP,theta=START:STOP:STEP`.
/// Either may be followed by `cx=X`, `cy=Y`, `z=Z` (origin or pole, metres) and `yaw=DEG`, `pitch=DEG`, `roll=DEG`.
/// Keys may be in any order, each at most once. The stop is excluded. One of x and y may omit its step, which is then
/// that of the other. Coordinates are at most 1e9 m.
///
/// The plane is rotated about its origin by yaw (about z), then pitch (about the new y), then roll (about the new x),
/// each right-handed: positive yaw rotates x towards y, positive pitch lowers x, positive roll raises y.
impl FromStr for ImageGrid {
    type Err = GridError;

    fn from_str(text: &str) -> Result<Self, GridError> {
        let mut ranges: [Option<Range>; 4] = [None; 4]; // x, y, r, theta
        let mut numbers = [0.0; 6]; // z, yaw, pitch, roll, cx, cy
        let mut seen: Vec<&str> = Vec::new();
        for part in text.split(',') {
            let (key, value) = part.split_once('=').ok_or_else(|| {
                GridError(format!(
                    "'{part}' is not KEY=VALUE; for example x=-50:50:0.2,y=-50:50:0.2,z=0"
                ))
            })?;
            let (key, value) = (key.trim(), value.trim());
            if seen.contains(&key) {
                return Err(GridError(format!("{key} is given more than once")));
            }
            seen.push(key);
            if let Some(i) = ["x", "y", "r", "theta"].iter().position(|&k| k == key) {
                ranges[i] = Some(Range::parse(key, value)?);
            } else if let Some(i) = ["z", "yaw", "pitch", "roll", "cx", "cy"]
                .iter()
                .position(|&k| k == key)
            {
                let [number] = parse_numbers(key, value)?[..] else {
                    return Err(GridError(format!("{key}={value}: write one number")));
                };
                numbers[i] = match key {
                    "yaw" | "pitch" | "roll" => number,
                    _ => near_enough(key, number)?,
                };
            } else {
                return Err(GridError(format!(
                    "unknown key '{key}'; known: x, y, z, r, theta, cx, cy, yaw, pitch, roll"
                )));
            }
        }
        let [z, yaw, pitch, roll, cx, cy] = numbers;
        let turn = DQuat::from_euler(
            EulerRot::ZYX,
            yaw.to_radians(),
            pitch.to_radians(),
            roll.to_radians(),
        );
        let (columns, rows, polar) = match ranges {
            [Some(x), Some(y), None, None] => (x.axis("x", y.step)?, y.axis("y", x.step)?, false),
            [None, None, Some(r), Some(theta)] => {
                let theta = theta.axis("theta", None)?;
                let theta = Axis {
                    start: theta.start.to_radians(),
                    step: theta.step.to_radians(),
                    ..theta
                };
                (theta, r.axis("r", None)?, true)
            }
            _ => return Err(GridError("give x and y, or r and theta".to_owned())),
        };
        Ok(Self {
            origin_m: DVec3::new(cx, cy, z),
            x_axis: turn * DVec3::X,
            y_axis: turn * DVec3::Y,
            columns,
            rows,
            polar,
            relief: None,
        })
    }
}

/// Axis as written; the step is optional.
#[derive(Clone, Copy)]
struct Range {
    start: f64,
    stop: f64,
    step: Option<f64>,
}

impl Range {
    fn parse(key: &str, value: &str) -> Result<Self, GridError> {
        let fields = parse_numbers(key, value)?;
        if key != "theta" {
            for &end in fields.iter().take(2) {
                near_enough(key, end)?;
            }
        }
        match *fields.as_slice() {
            [start, stop] => Ok(Self {
                start,
                stop,
                step: None,
            }),
            [start, stop, step] => Ok(Self {
                start,
                stop,
                step: Some(step),
            }),
            _ => Err(GridError(format!(
                "{key}={value}: write {key}=START:STOP:STEP"
            ))),
        }
    }

    fn axis(&self, key: &str, other_step: Option<f64>) -> Result<Axis, GridError> {
        let step = self
            .step
            .or(other_step)
            .ok_or_else(|| GridError(format!("{key} has no step: write {key}=START:STOP:STEP")))?;
        Axis::from_range(self.start, self.stop, step)
    }
}

fn parse_number(key: &str, text: &str) -> Result<f64, GridError> {
    text.parse::<f64>()
        .ok()
        .filter(|v| v.is_finite())
        .ok_or_else(|| GridError(format!("{key}: '{text}' is not a finite number")))
}

/// Numbers separated by colons, in metres or, for angles, degrees; or quantities with units, such as `-1:1:0.5km`,
/// where a number without a unit has the unit to its right.
fn parse_numbers(key: &str, value: &str) -> Result<Vec<f64>, GridError> {
    let parts: Vec<&str> = value.split(':').map(str::trim).collect();
    let has_unit = |part: &str| {
        let digits = part.trim_start_matches(['+', '-', '.']);
        digits.starts_with(|c: char| c.is_ascii_digit()) && part.parse::<f64>().is_err()
    };
    if !parts.iter().any(|part| has_unit(part)) {
        return parts.iter().map(|part| parse_number(key, part)).collect();
    }
    let is_angle = ["theta", "yaw", "pitch", "roll"].contains(&key);
    let dimension = match is_angle {
        true => Dimension::Angle,
        false => Dimension::Length,
    };
    let values = dimension.parse_list(&parts.join(","), parts.len());
    let values = values.map_err(|why| GridError(format!("{key}: {why}")))?;
    Ok(match is_angle {
        true => values.into_iter().map(f64::to_degrees).collect(),
        false => values,
    })
}

fn near_enough(key: &str, value_m: f64) -> Result<f64, GridError> {
    if value_m.abs() > FARTHEST_M {
        return Err(GridError(format!(
            "{key}: expected coordinates of at most {FARTHEST_M:e} m, found {value_m:e} m"
        )));
    }
    Ok(value_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stop_is_excluded() {
        let grid: ImageGrid = "x=-50:50:0.2,y=0:1:0.25,z=3".parse().unwrap();
        assert_eq!(grid.columns.count, 500);
        assert_eq!(grid.rows.count, 4);
        let p = grid.position_m(1, 499);
        assert!((p - DVec3::new(49.8, 0.25, 3.0)).length() < 1e-9);
        let short: ImageGrid = "x=-50:50:0.2,y=0:1".parse().unwrap();
        assert_eq!((short.rows.step, short.rows.count), (0.2, 5));
    }

    #[test]
    fn quantities_with_units_are_parsed() {
        let grid = |text: &str| text.parse::<ImageGrid>();
        let plain = grid("x=-50:50:0.5,y=1000:2000:2,z=3,cx=10,yaw=30").unwrap();
        let united = grid("x=-50m:50m:50cm,y=1:2km:2m,z=3m,cx=0.01km,yaw=30deg").unwrap();
        assert_eq!(united.columns, plain.columns);
        // "1:2km:2m": a number without a unit has the unit to its right.
        assert_eq!(united.rows, plain.rows);
        assert!((united.origin_m - plain.origin_m).length() < 1e-12);
        assert!((united.x_axis - plain.x_axis).length() < 1e-12);
        for (text, part) in [
            ("x=0:1:1Hz,y=0:1:1", "expected a length, found a frequency"),
            (
                "x=0:1:1,y=0:1:1,yaw=3m",
                "expected an angle, found a length",
            ),
            ("x=0:1:1,y=0:1:1,z=1:2", "write one number"),
            ("x=0:2e9:1km,y=0:1:1", "is too large"),
            ("x=0:2e9:1,y=0:1:1", "expected coordinates of at most"),
        ] {
            let error = grid(text).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn polar_grid_and_rotated_plane_have_expected_positions() {
        let grid: ImageGrid = "r=10:20:5,theta=0:180:90,cx=1".parse().unwrap();
        let p = grid.position_m(1, 1);
        assert!((p - DVec3::new(1.0, 15.0, 0.0)).length() < 1e-9);
        let yawed: ImageGrid = "x=0:2:1,y=0:2:1,yaw=90".parse().unwrap();
        assert!((yawed.position_m(0, 1) - DVec3::Y).length() < 1e-9);
    }

    /// Right-handed quarter turns take x to -z about y, y to z about x and x to y about z.
    #[test]
    fn pitch_lowers_x_and_roll_raises_y() {
        let (sin, cos) = (0.5, 0.75f64.sqrt());
        for (turn, x_axis, y_axis) in [
            ("pitch=30", [cos, 0.0, -sin], [0.0, 1.0, 0.0]),
            ("roll=30", [1.0, 0.0, 0.0], [0.0, cos, sin]),
            // Yaw first: then pitch is about the new y, -x, and lowers the new x, y.
            ("yaw=90,pitch=30", [0.0, cos, -sin], [-1.0, 0.0, 0.0]),
            // Roll last, about the pitched x: y rises normal to it, along (sin 30, 0, cos 30).
            ("pitch=30,roll=90", [cos, 0.0, -sin], [sin, 0.0, cos]),
        ] {
            let text = format!("x=0:2:1,y=0:2:1,cx=5,cy=6,z=7,{turn}");
            let grid: ImageGrid = text.parse().unwrap();
            let pole = DVec3::new(5.0, 6.0, 7.0);
            let x = grid.position_m(0, 1) - pole;
            let y = grid.position_m(1, 0) - pole;
            assert!((x - DVec3::from(x_axis)).length() < 1e-12, "{turn}: {x}");
            assert!((y - DVec3::from(y_axis)).length() < 1e-12, "{turn}: {y}");
        }
    }

    #[test]
    fn invalid_grids_state_the_expected_syntax() {
        for (text, part) in [
            ("x=1", "x=START:STOP:STEP"),
            ("x=1:2,y=1:2", "x has no step"),
            ("x=0:1:0.1", "give x and y"),
            ("x=0:1:0,y=0:1:1", "positive step"),
            ("x=0:1:1,y=0:nan:1", "not a finite number"),
            ("q=1", "unknown key"),
            ("x=0:1e9:0.1,y=0:1:1", "expected at most 1e9 elements"),
            ("x=0:1e12:1,y=0:1:1", "found 1e12 m"),
            ("x=-2e9:0:1,y=0:1:1", "found -2e9 m"),
            ("x=0:1:1,y=0:1:1,z=1e10", "found 1e10 m"),
            ("r=0:1:1,theta=0:1:1,cy=1e300", "of at most 1e9 m"),
            ("x=0:1:1,y=0:1:1,x=0:2:1", "x is given more than once"),
            ("x=0:1:1,y=0:1:1,z=0, z=1", "z is given more than once"),
        ] {
            let error = text.parse::<ImageGrid>().unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
