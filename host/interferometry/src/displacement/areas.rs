//! Areas at rest.

use std::fmt;

use subaperture_model::geometry::Extent;

/// Area whose points are at rest, in x and y of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StableArea {
    /// Rectangle along the axes of the scene.
    Rectangle(Extent),
    /// Disc about a point of the scene.
    Disc {
        /// Centre in x and y, metres.
        centre_m: [f64; 2],
        /// Radius in the horizontal plane, metres.
        radius_m: f64,
    },
}

impl StableArea {
    /// Whether the area contains a position.
    pub fn contains(&self, [x_m, y_m]: [f64; 2]) -> bool {
        match self {
            Self::Rectangle(extent) => {
                (extent.x_m.0..=extent.x_m.1).contains(&x_m)
                    && (extent.y_m.0..=extent.y_m.1).contains(&y_m)
            }
            Self::Disc { centre_m, radius_m } => {
                libm::hypot(x_m - centre_m[0], y_m - centre_m[1]) <= *radius_m
            }
        }
    }
}

impl fmt::Display for StableArea {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rectangle(extent) => write!(
                f,
                "x {} to {} m, y {} to {} m",
                extent.x_m.0, extent.x_m.1, extent.y_m.0, extent.y_m.1
            ),
            Self::Disc { centre_m, radius_m } => write!(
                f,
                "within {radius_m} m of x {} m, y {} m",
                centre_m[0], centre_m[1]
            ),
        }
    }
}
