//! Frame, extent and reference of a scene from `[scene]`.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;
use subaperture_model::geometry::{Extent, Geodetic, SceneFrame};
use subaperture_model::radar::Reference;

use crate::declare::{Located, section};
use crate::error::{Fault, Location};

/// Origin of the scene on the Earth (WGS 84); x points east, y north, z up.
#[section]
#[derive(Clone, Debug)]
pub struct OriginKeys {
    /// Position of the header.
    #[at]
    header: Location,
    /// Latitude, north positive.
    #[key(default = "0 deg", within(-FRAC_PI_2, FRAC_PI_2, "-90 to 90 deg"))]
    latitude_rad: Located<f64>,
    /// Longitude, east positive.
    #[key(default = "0 deg", within(-PI, PI, "-180 to 180 deg"))]
    longitude_rad: Located<f64>,
    /// Height above the ellipsoid.
    #[key(default = "0 m", within(-1e4, 1e6, "-10 to 1000 km"))]
    height_m: f64,
}

impl OriginKeys {
    /// Scene frame with this origin.
    pub fn frame(&self) -> SceneFrame {
        let origin = Geodetic {
            latitude_deg: self.latitude_rad.to_degrees(),
            longitude_deg: self.longitude_rad.to_degrees(),
            height_m: self.height_m,
        };
        let [east, north, _] = origin.east_north_up();
        SceneFrame::Earth {
            origin_ecf_m: origin.to_ecf_m(),
            x_axis_ecf: east,
            y_axis_ecf: north,
        }
    }

    /// Whether latitude or longitude is given instead of left to its default.
    pub fn is_given(&self) -> bool {
        [&self.latitude_rad, &self.longitude_rad]
            .iter()
            .any(|given| *given.at() != self.header)
    }
}

/// Extent in x and y; `None` if not given. The error is that of x without y, or y without x.
pub fn extent(
    x_m: &Option<Located<(f64, f64)>>,
    y_m: &Option<Located<(f64, f64)>>,
) -> Result<Option<Extent>, Fault> {
    match (x_m, y_m) {
        (Some(x_m), Some(y_m)) => Ok(Some(Extent {
            x_m: **x_m,
            y_m: **y_m,
        })),
        (None, None) => Ok(None),
        (Some(x_m), None) => Err(x_m.fault("x is given without y: give both")),
        (None, Some(y_m)) => Err(y_m.fault("y is given without x: give both")),
    }
}

/// Motion compensation reference; `None` if not given. The error is that of both a point and a range.
pub fn reference(
    point_m: Option<DVec3>,
    range_m: &Option<Located<f64>>,
) -> Result<Option<Reference>, Fault> {
    match (point_m, range_m) {
        (Some(_), Some(range_m)) => {
            Err(range_m.fault("give either reference or reference_range, not both"))
        }
        (None, Some(range_m)) => Ok(Some(Reference::Range(**range_m))),
        (point, None) => Ok(point.map(Reference::Point)),
    }
}
