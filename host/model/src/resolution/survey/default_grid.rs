//! Default image grid of a collection.

use super::Survey;
use crate::geometry::{Axis, Extent, ImageGrid};
use crate::phase_history::PhaseHistory;

/// The collection has no default grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no default grid: {0}")]
pub struct NoDefaultGrid(String);

impl NoDefaultGrid {
    pub(crate) fn of(what: String) -> Self {
        Self(what)
    }

    pub(crate) fn no_slant_plane() -> Self {
        Self(
            "no slant plane, because the antennas do not move across their line of sight"
                .to_owned(),
        )
    }
}

/// Largest number of pixels of a default grid: an image of 32 MiB.
pub const MAX_PIXELS: usize = 1 << 22;

/// Default grid, with a warning if cropped.
#[derive(Clone, Debug, PartialEq)]
pub struct DefaultGrid {
    /// Image grid.
    pub grid: ImageGrid,
    /// Reason why the grid does not cover the whole extent; `None` if it does.
    pub cropped: Option<String>,
}

/// Default grid of a recording: [`Survey::default_grid`] of its collection.
///
/// # Errors
/// [`NoDefaultGrid`] if there are no pulses, no extent or no resolution.
pub fn scene_grid(history: &dyn PhaseHistory) -> Result<ImageGrid, NoDefaultGrid> {
    let survey = Survey::of(history.collection());
    let survey =
        survey.ok_or_else(|| NoDefaultGrid("the recording contains no pulses".to_owned()))?;
    Ok(survey.default_grid()?.grid)
}

impl Survey {
    /// Rectangle of the default grid: the declared extent, or else the largest rectangle
    /// along the frame's axes within the unambiguous extent and the recorded delays, centred on the scene centre.
    ///
    /// # Errors
    /// [`NoDefaultGrid`] if no extent is declared and the unambiguous extent is zero or infinite, or the scene centre is at the antennas.
    pub fn extent(&self) -> Result<Extent, NoDefaultGrid> {
        if let Some([x_m, y_m]) = self.declared_extent_m {
            return Ok(Extent { x_m, y_m });
        }
        if self.centre_at_antennas {
            let [x, y, z] = self.scene_centre_m;
            return Err(NoDefaultGrid(format!(
                "the recording does not state the position of its scene, and the assumed centre, x {x} m, y {y} m, z {z} m, lies at the \
                 antennas: state the scene's extent or a reference point"
            )));
        }
        let (Some(range_m), Some(cross_m)) =
            (self.unambiguous_range_m, self.unambiguous_cross_range_m)
        else {
            return Err(NoDefaultGrid(
                "the antenna does not move across its line of sight".to_owned(),
            ));
        };
        let range_m = self.recorded_range_m.map_or(range_m, |m| m.min(range_m));
        let (half_x, half_y) = if self.is_wide_angle() {
            // The line of sight rotates, and the rectangle with it: the square inside a circle remains.
            let half = range_m.min(cross_m) / 8f64.sqrt();
            (half, half)
        } else {
            let turn = self.azimuth_deg.to_radians();
            largest_upright_rectangle(range_m, cross_m, turn)
        };
        let [x, y, _] = self.scene_centre_m;
        Ok(Extent {
            x_m: (x - half_x, x + half_x),
            y_m: (y - half_y, y + half_y),
        })
    }

    /// Horizontal grid at `z = 0` over [`Self::extent`], with a pixel spacing of half [`Self::nyquist_step_m`], which
    /// is valid at every corner. A scene of more than [`MAX_PIXELS`] is cropped about its centre
    /// ([`DefaultGrid::cropped`]), because coarser pixels would alias.
    ///
    /// # Errors
    /// [`NoDefaultGrid`] if there is no extent or no resolution.
    pub fn default_grid(&self) -> Result<DefaultGrid, NoDefaultGrid> {
        let extent = self.extent()?;
        let sides_m = [extent.x_m, extent.y_m].map(|(low, high)| high - low);
        let mut steps_m = [0.0; 2];
        for (i, name) in ["x", "y"].into_iter().enumerate() {
            let (Some(resolution_m), Some(step_m)) =
                (self.axis_resolution_m[i], self.nyquist_step_m[i])
            else {
                return Err(NoDefaultGrid(format!(
                    "the collection has no resolution along {name}"
                )));
            };
            if resolution_m > sides_m[i] {
                return Err(NoDefaultGrid(format!(
                    "along {name} the resolution is {resolution_m:.3} m and the extent only {:.3} m",
                    sides_m[i]
                )));
            }
            steps_m[i] = round_to_two_digits(step_m / 2.0);
        }
        let pixels = [0, 1].map(|i| sides_m[i] / steps_m[i]);
        // The longer side is cropped first.
        let most = (MAX_PIXELS as f64).sqrt();
        let [x, y] = pixels;
        let kept = match x * y <= MAX_PIXELS as f64 {
            true => pixels,
            false if y < most => [MAX_PIXELS as f64 / y, y],
            false if x < most => [x, MAX_PIXELS as f64 / x],
            false => [most; 2],
        };
        let axis = |i: usize, (low, high): (f64, f64)| {
            // Whole steps from the centre, which becomes a pixel.
            let middle = low.midpoint(high);
            let half = (kept[i] / 2.0 + 1e-9).floor() * steps_m[i];
            Axis::from_range(middle - half, middle + half, steps_m[i])
                .map_err(|error| NoDefaultGrid(error.0))
        };
        let grid = ImageGrid::horizontal(axis(0, extent.x_m)?, axis(1, extent.y_m)?, 0.0);
        if let Some(fault) = grid.fault() {
            return Err(NoDefaultGrid(fault.0));
        }
        let cropped = (kept != pixels).then(|| {
            format!(
                "the scene's {:.1} x {:.1} m would take {x:.0} x {y:.0} pixels at steps that do not fold ({} x {} m); the \
                 default grid is its middle, {:.1} x {:.1} m",
                sides_m[0],
                sides_m[1],
                steps_m[0],
                steps_m[1],
                kept[0] * steps_m[0],
                kept[1] * steps_m[1],
            )
        });
        Ok(DefaultGrid { grid, cropped })
    }

    /// Warning if the declared extent exceeds the unambiguous extent: a scatterer near one edge has an ambiguity, one unambiguous
    /// extent away, inside the scene.
    pub fn ambiguity(&self) -> Option<String> {
        let [x_m, y_m] = self.declared_extent_m?;
        let (x, y) = (x_m.1 - x_m.0, y_m.1 - y_m.0);
        // Scene extent along and across the line of sight, corner to corner; for a circular aperture its diagonal.
        let (deep_m, wide_m) = match self.is_wide_angle() {
            true => (libm::hypot(x, y), libm::hypot(x, y)),
            false => {
                let (sin, cos) = libm::sincos(self.azimuth_deg.to_radians());
                (x * cos.abs() + y * sin.abs(), x * sin.abs() + y * cos.abs())
            }
        };
        let over = |what: &str, scene_m: f64, unambiguous_m: Option<f64>, cause: &str| {
            let unambiguous_m = unambiguous_m.filter(|&m| m < scene_m)?;
            Some(format!(
                "the scene is {scene_m:.1} m {what} and repeats every {unambiguous_m:.1} m ({cause})"
            ))
        };
        let across = over(
            "across the line of sight",
            wide_m,
            self.unambiguous_cross_range_m,
            "the pulses' spacing",
        );
        let along = over(
            "along the line of sight",
            deep_m,
            self.unambiguous_range_m,
            "the frequencies' spacing",
        );
        let all: Vec<String> = [across, along].into_iter().flatten().collect();
        (!all.is_empty()).then(|| {
            format!(
                "{}: ambiguities (ghosts) of targets are possible, unless the antenna beam suppresses them",
                all.join("; ")
            )
        })
    }

    /// Whether the aperture is so wide that directions along and across the line of sight are undefined.
    fn is_wide_angle(&self) -> bool {
        self.aperture_azimuth_deg > 45.0
    }
}

/// Half sides of the largest rectangle along x and y inside a rectangle of `a` by `b` whose side
/// `a` is rotated by `turn` from x, both centred on the origin.
///
/// Half sides `(p, q)` fit if `p |cos| + q |sin| <= a / 2` and `p |sin| + q |cos| <= b / 2`. With one
/// constraint alone the area is largest where its terms are equal; where that point violates the
/// other, the largest rectangle touches both.
fn largest_upright_rectangle(a: f64, b: f64, turn: f64) -> (f64, f64) {
    let (sin, cos) = (libm::sin(turn).abs(), libm::cos(turn).abs());
    let (short, long) = (a.min(b), a.max(b));
    if short <= long * 2.0 * sin * cos {
        let quarter = short / 4.0;
        // The short side's constraint is active; its terms are equal.
        if a < b {
            (quarter / cos, quarter / sin)
        } else {
            (quarter / sin, quarter / cos)
        }
    } else {
        let determinant = 2.0 * (cos * cos - sin * sin);
        (
            (a * cos - b * sin) / determinant,
            (b * cos - a * sin) / determinant,
        )
    }
}

/// Round down to two significant digits.
pub fn round_to_two_digits(value: f64) -> f64 {
    let unit = libm::pow(10.0, libm::log10(value).floor() - 1.0);
    let digits = (value / unit + 1e-9).floor();
    // Division by a power of ten is correctly rounded; multiplication by 0.01 is not.
    if unit < 1.0 {
        digits / (1.0 / unit).round()
    } else {
        digits * unit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upright_rectangle_is_largest_inside_rotated_one() {
        // Oracle: best of a fine scan of half sides.
        for (a, b, turn_deg) in [
            (10.0, 4.0, 0.0),
            (10.0, 4.0, 30.0),
            (4.0, 10.0, 30.0),
            (7.0, 6.0, 45.0),
            (5.0, 5.0, 80.0),
        ] {
            let turn = f64::to_radians(turn_deg);
            let (sin, cos) = (turn.sin().abs(), turn.cos().abs());
            let fits = |p: f64, q: f64| {
                p * cos + q * sin <= a / 2.0 + 1e-9 && p * sin + q * cos <= b / 2.0 + 1e-9
            };
            let mut best = 0.0;
            for i in 0..=1000 {
                let p = 5.5 * f64::from(i) / 1000.0;
                for j in 0..=1000 {
                    let q = 5.5 * f64::from(j) / 1000.0;
                    if fits(p, q) {
                        best = f64::max(best, p * q);
                    }
                }
            }
            let (p, q) = largest_upright_rectangle(a, b, turn);
            assert!(fits(p, q), "{a} {b} {turn_deg}: {p} {q}");
            // The scan misses at most a step of 5.5 mm per side.
            assert!(
                p * q >= best && p * q < best + 0.06,
                "{a} {b} {turn_deg}: {} {best}",
                p * q
            );
        }
    }

    #[test]
    fn steps_round_down_to_two_digits() {
        for (value, round) in [
            (0.1234, 0.12),
            (1.0, 1.0),
            (0.2, 0.2),
            (37.9, 37.0),
            (561.0, 560.0),
        ] {
            assert_eq!(round_to_two_digits(value), round);
        }
    }
}
