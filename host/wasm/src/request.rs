//! Image requested by the page.

use serde::{Deserialize, Serialize};
use serde_json::json;
use subaperture::focus::ImageFormer;
use subaperture::focus::formers::former;
use subaperture::geometry::{Axis, ImageGrid};

/// Largest number of pixels along an axis of a default grid.
const DEFAULT_PIXELS: usize = 500;

/// Formers that the page offers.
pub const FORMERS: [&str; 4] = ["auto", "bp", "ffbp", "rdbp"];

/// Horizontal grid at `z = 0`, with x along columns and y along rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Centre, metres: x and y.
    pub centre_m: [f64; 2],
    /// Width and height, metres.
    pub size_m: [f64; 2],
    /// Pixels along x and y.
    pub pixels: [usize; 2],
}

impl Grid {
    /// A default grid, cropped about its centre to [`DEFAULT_PIXELS`] along each axis, and whether it was cropped. Its pixel spacing is
    /// kept, because coarser pixels would alias.
    pub(crate) fn default_of(grid: &ImageGrid) -> (Self, bool) {
        let axes = [&grid.columns, &grid.rows];
        let pixels = axes.map(|axis| axis.count.min(DEFAULT_PIXELS));
        let steps_m = axes.map(|axis| axis.step);
        let centre = |axis: &Axis| axis.start + axis.step * axis.count as f64 / 2.0;
        let cropped = Self {
            centre_m: axes.map(centre),
            size_m: [0, 1].map(|i| pixels[i] as f64 * steps_m[i]),
            pixels,
        };
        (cropped, axes.iter().any(|axis| axis.count > DEFAULT_PIXELS))
    }

    /// Positions of the pixels: from `centre - size / 2` on, in steps of `size / pixels`.
    ///
    /// # Errors
    /// Text for the user: a number that is no valid grid.
    pub fn image_grid(&self) -> Result<ImageGrid, String> {
        let [columns, rows] = [0, 1].map(|i| {
            let (centre_m, size_m, count) = (self.centre_m[i], self.size_m[i], self.pixels[i]);
            let name = ["x", "y"][i];
            if !(centre_m.is_finite() && size_m.is_finite() && size_m > 0.0 && count > 0) {
                return Err(format!(
                    "grid along {name}: expected a finite centre, a positive size and at least 1 pixel, found {centre_m} m, {size_m} m and {count}"
                ));
            }
            Ok(Axis {
                start: centre_m - size_m / 2.0,
                step: size_m / count as f64,
                count,
            })
        });
        Ok(ImageGrid::horizontal(columns?, rows?, 0.0))
    }
}

/// Settings of the image to form.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Positions of the pixels.
    pub grid: Grid,
    /// Short name of a former of [`FORMERS`].
    pub former: String,
    /// Error bound against the exact sum, dB, relative RMS.
    pub error_db: f64,
    /// Whether the bits must be those of every other machine.
    pub portable: bool,
}

impl Request {
    /// The requested former.
    ///
    /// # Errors
    /// Text for the user: an unknown former, or a bound that is not a negative number of decibels.
    pub fn former(&self) -> Result<Box<dyn ImageFormer>, String> {
        if !FORMERS.contains(&self.former.as_str()) {
            return Err(format!(
                "former: expected one of {}, found '{}'",
                FORMERS.join(", "),
                self.former
            ));
        }
        former(&self.former, &json!({ "error_db": self.error_db }))
            .map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_has_requested_size_and_spacing() {
        let grid = Grid {
            centre_m: [0.0, 10.0],
            size_m: [100.0, 50.0],
            pixels: [500, 200],
        };
        let expected: ImageGrid = "x=-50:50:0.2,y=-15:35:0.25,z=0".parse().unwrap();
        assert_eq!(grid.image_grid().unwrap(), expected);
    }

    #[test]
    fn faulty_requests_are_refused_with_a_reason() {
        let grid = Grid {
            centre_m: [0.0; 2],
            size_m: [100.0, f64::NAN],
            pixels: [500, 500],
        };
        let error = grid.image_grid().unwrap_err();
        assert!(
            error.contains("grid along y") && error.contains("NaN m"),
            "{error}"
        );
        let mut request = Request {
            grid,
            former: "exact".to_owned(),
            error_db: -50.0,
            portable: true,
        };
        let error = request.former().err().unwrap();
        assert!(error.contains("auto, bp, ffbp, rdbp"), "{error}");
        request.former = "bp".to_owned();
        assert!(request.former().is_ok());
    }
}
