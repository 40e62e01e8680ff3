//! `[scene]`: from its keys to where it is and what it holds.

use std::path::Path;

use num_complex::Complex64;

use crate::geometry::{Extent, Geodetic, SceneFrame};
use crate::simulate::Scatterer;
use crate::simulate::experiment::Reference;
use crate::simulate::radar::Radar;
use crate::simulate::scene::{Corner, Mover, Scene};

use super::error::Found;
use super::platform;
use super::values::Values;

/// Where the scene is.
pub(super) struct Place {
    pub(super) frame: SceneFrame,
    pub(super) extent: Option<Extent>,
    pub(super) reference: Reference,
}

/// Where the scene is, and what phases are referred to.
pub(super) fn place(values: &Values) -> Result<Place, Found> {
    let origin = values.section("origin");
    let origin = Geodetic {
        latitude_deg: origin.number("latitude").to_degrees(),
        longitude_deg: origin.number("longitude").to_degrees(),
        height_m: origin.number("height"),
    };
    let [east, north, _] = origin.east_north_up();
    let extent = match (values.optional_interval("x"), values.optional_interval("y")) {
        (Some(x_m), Some(y_m)) => Some(Extent { x_m, y_m }),
        (None, None) => None,
        (Some(_), None) => return Err(values.fault("x", "there is x but no y: give both")),
        (None, Some(_)) => return Err(values.fault("y", "there is y but no x: give both")),
    };
    let point = values.optional_vector("reference");
    let reference = match (point, values.optional_number("reference_range")) {
        (Some(_), Some(_)) => {
            return Err(values.fault(
                "reference_range",
                "give either reference or reference_range, not both",
            ));
        }
        (None, Some(range_m)) => Reference::Range(range_m),
        (point, None) => Reference::Point(point.unwrap_or_default()),
    };
    Ok(Place {
        frame: SceneFrame::Earth {
            origin_ecf_m: origin.to_ecf_m(),
            x_axis_ecf: east,
            y_axis_ecf: north,
        },
        extent,
        reference,
    })
}

/// What the scene holds.
pub(super) fn build(
    values: &Values,
    radar: &Radar,
    _seed: u64,
    _folder: &Path,
) -> Result<Scene, Found> {
    let mut scene = Scene::default();
    for point in values.sections("point") {
        scene.points.push(Scatterer {
            position_m: point.vector("position"),
            amplitude: amplitude(point),
        });
    }
    for corner in values.sections("corner") {
        scene.corners.push(Corner {
            position_m: corner.vector("position"),
            boresight: corner.direction("boresight")?,
            edge_m: corner.number("edge"),
        });
    }
    for mover in values.sections("mover") {
        scene.movers.push(Mover {
            motion: platform::track(mover, platform::middle_s(radar))?,
            amplitude: amplitude(mover),
        });
    }
    Ok(scene)
}

/// The square root of the cross section, with the phase of the reflection.
fn amplitude(values: &Values) -> Complex64 {
    Complex64::from_polar(values.number("cross_section").sqrt(), values.number("phase"))
}
