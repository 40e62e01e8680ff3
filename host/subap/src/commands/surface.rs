//! Surface on which an image is focused: the grid's plane, rotated or with a relief.

use anyhow::Context;
use glam::DVec3;
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{Collection, PhaseHistory};
use subaperture::resolution::slant::{slant_axes, slant_grid};
use subaperture::resolution::survey::Survey;
use subaperture::terrain::{Geoid, Ground, Region, Surface, relief};

use crate::args::{Imaging, SurfaceKind};
use crate::config::Session;
use crate::failure::Usage;
use crate::messages;

/// Divisor of the work memory for an elevation model, which is released before the image is formed.
const SHARE: u64 = 2;

/// Height error of the relief, in pixels, above which a warning is given.
const WARNED_PIXELS: f64 = 1.0;

/// Check the options before any file is read.
pub(crate) fn check(typed: &Imaging) -> anyhow::Result<()> {
    let own = &typed.grid;
    let is_dem = matches!(own.surface, SurfaceKind::Dem(_));
    if own.geoid.is_some() && !is_dem {
        let fault = "--geoid applies to --surface dem:FILE only: other surfaces have heights above the ellipsoid";
        return Err(Usage(fault.to_owned()).into());
    }
    if let (SurfaceKind::Slant, Some(grid)) = (&own.surface, &own.pixels)
        && (grid.x_axis != DVec3::X || grid.y_axis != DVec3::Y || grid.polar)
    {
        let fault = "--surface slant rotates the grid itself: give --grid with x (cross-range) and y (range) only, without yaw, pitch or roll";
        return Err(Usage(fault.to_owned()).into());
    }
    let geoid = own.geoid.as_ref().and_then(|geoid| geoid.file());
    for path in own.surface.file().into_iter().chain(geoid) {
        std::fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?;
    }
    Ok(())
}

/// The given grid or the default one, with its pixels on the requested surface.
pub(crate) fn grid<'s>(
    session: &Session,
    typed: &Imaging,
    history: &dyn PhaseHistory,
    survey: impl FnOnce() -> &'s Survey,
) -> anyhow::Result<ImageGrid> {
    let collection = history.collection();
    let plane = match typed.grid.pixels.clone() {
        Some(grid) => grid,
        None => session.default_grid(survey())?,
    };
    match &typed.grid.surface {
        SurfaceKind::Plane => Ok(plane),
        SurfaceKind::Slant => slant(typed, collection, plane),
        SurfaceKind::Ellipsoid(height_m) => {
            let origin = collection.frame.geodetic(plane.origin_m);
            let own_m = origin.map_or(0.0, |origin| origin.height_m);
            let surface = Surface::Ellipsoid(height_m.unwrap_or(own_m));
            lay(session, collection, plane, surface)
        }
        SurfaceKind::Dem(path) => {
            let region = Region::of(&plane, &collection.frame)?;
            let geoid = typed.grid.geoid.as_ref();
            let geoid = geoid.map_or(Geoid::None, |geoid| geoid.geoid());
            let ground = Ground::open(path, &geoid, &region, session.memory_bytes / SHARE)?;
            for warning in ground.warnings() {
                messages::warning(warning.as_str());
            }
            lay(session, collection, plane, Surface::Ground(&ground))
        }
    }
}

fn slant(typed: &Imaging, collection: &Collection, plane: ImageGrid) -> anyhow::Result<ImageGrid> {
    if typed.grid.pixels.is_none() {
        return Ok(slant_grid(collection, &plane)?);
    }
    let [x_axis, y_axis] = slant_axes(collection, plane.origin_m).context(
        "--surface slant: the antennas do not move across their line of sight, so that no slant plane is defined",
    )?;
    Ok(ImageGrid {
        x_axis,
        y_axis,
        ..plane
    })
}

/// Add the relief of a surface to the plane.
fn lay(
    session: &Session,
    collection: &Collection,
    plane: ImageGrid,
    surface: Surface,
) -> anyhow::Result<ImageGrid> {
    let progress = session.progress("surface");
    let relief = relief(&plane, &collection.frame, surface, &progress)?;
    progress.finish();
    let pixel_m = plane.rows.step.min(plane.columns.step);
    let [low_m, high_m] = relief.range_m();
    let summary = format!(
        "relief: {}, {low_m:.1} to {high_m:.1} m above the grid's plane, {} x {} nodes, height error {:.2} m",
        relief.surface(),
        relief.columns().count,
        relief.rows().count,
        relief.error_m(),
    );
    match plane.polar || relief.error_m() <= WARNED_PIXELS * pixel_m {
        true => session.note(1, || summary),
        false => messages::warning(format!(
            "{summary}: more than a pixel; use a smaller grid, which has finer nodes"
        )),
    }
    Ok(plane.on(relief))
}
