//! Geometry and content of a scene from `[scene]`.

use std::path::Path;

use glam::DVec3;
use num_complex::Complex64;

use crate::Scatterer;
use crate::scene::{
    Area, Building, Clutter, Corner, Density, MAX_POINTS, Mover, Picture, Placement, Scene,
    SceneError,
};
use subaperture_describe::{place, track};
use subaperture_model::geometry::{Extent, SceneFrame};
use subaperture_model::radar::{Radar, Reference};
use subaperture_signal::phase::cis;

use super::error::Fault;
use super::platform;
use super::values::Values;

/// Memory per point while a scene is prepared, bytes: 40 for the point, as much while it is made, 32 of the engine, and
/// as much while those are sorted.
const BYTES_A_POINT: u64 = 160;

/// Geometry of the scene.
pub(super) struct Place {
    pub(super) frame: SceneFrame,
    pub(super) extent: Option<Extent>,
    pub(super) reference: Reference,
}

/// Build the frame, extent and reference of the scene.
pub(super) fn place(values: &Values) -> Result<Place, Fault> {
    Ok(Place {
        frame: place::frame(values.section("origin")),
        extent: place::extent(values)?,
        reference: place::reference(values)?.unwrap_or(Reference::Point(DVec3::ZERO)),
    })
}

/// Build the content of the scene.
pub(super) fn build(
    values: &Values,
    radar: &Radar,
    seed: u64,
    folder: &Path,
    memory_bytes: u64,
) -> Result<Scene, Fault> {
    let most = (memory_bytes / BYTES_A_POINT) as f64;
    let mut scene = Scene::default();
    let left = |scene: &Scene| (most - scene.points.len() as f64).min(MAX_POINTS);
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
            motion: track::track(mover, platform::middle_s(radar))?,
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

/// Attach an error to the key `key`.
fn made<T>(values: &Values, key: &str, result: Result<T, SceneError>) -> Result<T, Fault> {
    result.map_err(|error| values.fault(key, error.to_string()))
}

fn extent(values: &Values) -> Extent {
    Extent {
        x_m: values.interval("x"),
        y_m: values.interval("y"),
    }
}

fn clutter(values: &Values) -> Result<Clutter, Fault> {
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

/// Square root of the cross section, with the phase of the reflection.
fn amplitude(values: &Values) -> Complex64 {
    cis(values.number("phase")) * values.number("cross_section").sqrt()
}
