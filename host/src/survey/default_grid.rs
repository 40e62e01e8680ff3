//! The grid that suits a collection, where the user gives none.

use super::Survey;
use crate::geometry::{Axis, Extent, ImageGrid};

/// Why a collection has no default grid, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("no default grid: {0}; give one, for example --grid x=-50:50:0.5,y=-50:50:0.5,z=0")]
pub struct NoDefaultGrid(String);

impl Survey {
    /// The rectangle that the default grid covers: the declared extent, else the largest rectangle
    /// along the frame's axes within the unambiguous extent, centred on the scene's centre.
    ///
    /// # Errors
    /// [`NoDefaultGrid`] if the collection declares none and is ambiguous everywhere or nowhere.
    pub fn extent(&self) -> Result<Extent, NoDefaultGrid> {
        if let Some([x_m, y_m]) = self.declared_extent_m {
            return Ok(Extent { x_m, y_m });
        }
        let (Some(range_m), Some(cross_m)) =
            (self.unambiguous_range_m, self.unambiguous_cross_range_m)
        else {
            return Err(NoDefaultGrid(
                "the antenna does not move across its line of sight".to_owned(),
            ));
        };
        let (half_x, half_y) = if self.aperture_angle_deg > 45.0 {
            // The line of sight turns, and the rectangle with it: what is left is a circle's square.
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

    /// A horizontal grid at `z = 0` over [`Self::extent`] at half the resolution along each axis.
    ///
    /// # Errors
    /// [`NoDefaultGrid`] where there is no extent or no resolution.
    pub fn default_grid(&self) -> Result<ImageGrid, NoDefaultGrid> {
        let extent = self.extent()?;
        let axis = |name: &str, (low, high): (f64, f64), resolution_m: Option<f64>| {
            let resolution_m = resolution_m.ok_or_else(|| {
                NoDefaultGrid(format!("the collection has no resolution along {name}"))
            })?;
            if resolution_m > high - low {
                return Err(NoDefaultGrid(format!(
                    "along {name} the resolution is {resolution_m:.3} m and the extent only {:.3} m",
                    high - low
                )));
            }
            let step = round_to_two_digits(resolution_m / 2.0);
            // Whole steps from the middle, which becomes a pixel.
            let middle = low.midpoint(high);
            let half = ((high - low) / 2.0 / step).floor() * step;
            Axis::from_range(middle - half, middle + half, step)
                .map_err(|error| NoDefaultGrid(error.0))
        };
        let [x_resolution_m, y_resolution_m] = self.axis_resolution_m;
        Ok(ImageGrid::horizontal(
            axis("x", extent.x_m, x_resolution_m)?,
            axis("y", extent.y_m, y_resolution_m)?,
            0.0,
        ))
    }
}

/// Half sides of the largest rectangle along x and y within a rectangle of `a` by `b` whose side
/// `a` is turned by `turn` from x, both centred on the origin.
///
/// Half sides `(p, q)` fit if `p |cos| + q |sin| <= a / 2` and `p |sin| + q |cos| <= b / 2`. Of one
/// constraint alone the area is largest where its terms are equal; where that point breaks the
/// other, the largest rectangle touches both.
fn largest_upright_rectangle(a: f64, b: f64, turn: f64) -> (f64, f64) {
    let (sin, cos) = (turn.sin().abs(), turn.cos().abs());
    let (short, long) = (a.min(b), a.max(b));
    if short <= long * 2.0 * sin * cos {
        let quarter = short / 4.0;
        // The short side's constraint rules; its terms are equal.
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

/// Rounds down to two significant digits: grids with steps that a person would write.
pub(crate) fn round_to_two_digits(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 1.0);
    let digits = (value / unit + 1e-9).floor();
    // Division by a power of ten is exact to the last digit where multiplication by 0.01 is not.
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
    fn upright_rectangle_is_the_largest_that_fits() {
        // Oracle: the best of a fine scan of half sides.
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
            // The scan misses at most a step of 5.5 mm in each side.
            assert!(
                p * q >= best && p * q < best + 0.06,
                "{a} {b} {turn_deg}: {} {best}",
                p * q
            );
        }
    }

    #[test]
    fn steps_are_round() {
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
