//! Frame, extent and reference of a scene from `[scene]`.

use subaperture_model::geometry::{Extent, Geodetic, SceneFrame};
use subaperture_model::radar::Reference;

use crate::error::Fault;
use crate::values::Values;

/// Scene frame with the origin given by `[scene.origin]`.
pub fn frame(origin: &Values) -> SceneFrame {
    let origin = Geodetic {
        latitude_deg: origin.number("latitude").to_degrees(),
        longitude_deg: origin.number("longitude").to_degrees(),
        height_m: origin.number("height"),
    };
    let [east, north, _] = origin.east_north_up();
    SceneFrame::Earth {
        origin_ecf_m: origin.to_ecf_m(),
        x_axis_ecf: east,
        y_axis_ecf: north,
    }
}

/// Extent in x and y; `None` if not given. The error is that of x without y, or y without x.
pub fn extent(values: &Values) -> Result<Option<Extent>, Fault> {
    match (values.optional_interval("x"), values.optional_interval("y")) {
        (Some(x_m), Some(y_m)) => Ok(Some(Extent { x_m, y_m })),
        (None, None) => Ok(None),
        (Some(_), None) => Err(values.fault("x", "x is given without y: give both")),
        (None, Some(_)) => Err(values.fault("y", "y is given without x: give both")),
    }
}

/// Motion compensation reference; `None` if not given. The error is that of both a point and a range.
pub fn reference(values: &Values) -> Result<Option<Reference>, Fault> {
    let point = values.optional_vector("reference");
    match (point, values.optional_number("reference_range")) {
        (Some(_), Some(_)) => Err(values.fault(
            "reference_range",
            "give either reference or reference_range, not both",
        )),
        (None, Some(range_m)) => Ok(Some(Reference::Range(range_m))),
        (point, None) => Ok(point.map(Reference::Point)),
    }
}
