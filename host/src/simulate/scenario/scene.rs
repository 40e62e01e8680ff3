//! `[scene]`: from its keys to where it is and what it holds.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;

use crate::geometry::{Extent, Geodetic, SceneFrame};
use crate::simulate::Scatterer;
use crate::simulate::experiment::Reference;
use crate::simulate::radar::Radar;
use crate::simulate::scene::MOST_POINTS;
use crate::simulate::scene::{
    Area, Building, Clutter, Corner, Density, Mover, Picture, Placement, Scene, SceneError,
};

use super::error::Found;
use super::platform;
use super::values::Values;

/// What a point takes while a scene is made ready: 40 bytes as it is, once more while it is made, 32 of the
/// engine's, and as many while those are sorted.
const BYTES_A_POINT: u64 = 160;

/// Where the scene is.
pub(super) struct Place {
    pub(super) frame: SceneFrame,
    pub(super) extent: Option<Extent>,
    pub(super) reference: Reference,
}

/// Where the scene is, and what phases are referred to.
pub(super) fn place(values: &Values) -> Result<Place, Found> {
    Ok(Place {
        frame: frame(values.section("origin")),
        extent: scene_extent(values)?,
        reference: reference(values)?.unwrap_or(Reference::Point(DVec3::ZERO)),
    })
}

/// The frame whose origin `[scene.origin]` gives.
pub(crate) fn frame(origin: &Values) -> SceneFrame {
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

/// The extent in x and y, if it is given.
pub(crate) fn scene_extent(values: &Values) -> Result<Option<Extent>, Found> {
    match (values.optional_interval("x"), values.optional_interval("y")) {
        (Some(x_m), Some(y_m)) => Ok(Some(Extent { x_m, y_m })),
        (None, None) => Ok(None),
        (Some(_), None) => Err(values.fault("x", "there is x but no y: give both")),
        (None, Some(_)) => Err(values.fault("y", "there is y but no x: give both")),
    }
}

/// What phases are referred to, if it is given.
pub(crate) fn reference(values: &Values) -> Result<Option<Reference>, Found> {
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

/// What the scene holds.
pub(super) fn build(
    values: &Values,
    radar: &Radar,
    seed: u64,
    folder: &Path,
    memory_bytes: u64,
) -> Result<Scene, Found> {
    let most = (memory_bytes / BYTES_A_POINT) as f64;
    let mut scene = Scene::default();
    let left = |scene: &Scene| (most - scene.points.len() as f64).min(MOST_POINTS);
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
    for (values, index) in values.sections("clutter").iter().zip(0..) {
        let points = clutter(values)?.points_within(seed, index, left(&scene));
        scene.points.extend(made(values, "sigma0", points)?);
    }
    for (values, index) in values.sections("picture").iter().zip(0..) {
        let picture = Picture::read(&folder.join(values.text("file")));
        let placement = Placement {
            extent: extent(values),
            height_m: values.number("height"),
            spacing_m: values.number("spacing"),
            white_sigma0_db: values.number("sigma0"),
            speckle: values.flag("speckle"),
        };
        let points =
            made(values, "file", picture)?.points_within(&placement, seed, index, left(&scene));
        scene.points.extend(made(values, "spacing", points)?);
    }
    for (values, index) in values.sections("building").iter().zip(0..) {
        let building = Building {
            centre_m: values.vector("position"),
            size_m: values.vector("size"),
            yaw_rad: values.number("yaw"),
            spacing_m: values.number("spacing"),
            wall_sigma0_db: values.number("wall"),
            edge_sigma_db: values.number("edge"),
            foot_sigma_db: values.number("foot"),
        };
        let points = building.points_within(seed, index, left(&scene));
        scene.points.extend(made(values, "size", points)?);
        scene.blocks.push(building.block());
    }
    Ok(scene)
}

/// What a maker made, or its error at `key`.
fn made<T>(values: &Values, key: &str, result: Result<T, SceneError>) -> Result<T, Found> {
    result.map_err(|error| values.fault(key, error.to_string()))
}

fn extent(values: &Values) -> Extent {
    Extent {
        x_m: values.interval("x"),
        y_m: values.interval("y"),
    }
}

fn clutter(values: &Values) -> Result<Clutter, Found> {
    let (area, height_m) = if values.text("kind") == "rectangle" {
        (Area::Rectangle(extent(values)), values.number("height"))
    } else {
        let centre = values.vector("centre");
        let disc = Area::Disc {
            centre_m: centre.truncate(),
            radius_m: values.number("radius"),
        };
        (disc, centre.z)
    };
    let density = match (
        values.optional_number("density"),
        values.optional_count("count"),
    ) {
        (Some(density), None) => Density::PerSquareMetre(density),
        (None, Some(count)) => Density::Total(count as usize),
        (Some(_), Some(_)) => {
            return Err(values.fault("count", "give either density or count, not both"));
        }
        (None, None) => {
            return Err(values.fault(
                "density",
                "[[scene.clutter]] needs 'density' or 'count': write for example density = 1",
            ));
        }
    };
    Ok(Clutter {
        area,
        height_m,
        density,
        sigma0_db: values.number("sigma0"),
    })
}

/// The square root of the cross section, with the phase of the reflection.
fn amplitude(values: &Values) -> Complex64 {
    Complex64::from_polar(
        values.number("cross_section").sqrt(),
        values.number("phase"),
    )
}
