//! The surface on which an image is focused: the grid's plane, turned or with a relief over it.

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

/// Of the memory for the work, what an elevation model may take: it is gone before the image is formed.
const SHARE: u64 = 2;

/// Error of a surface's nodes, of a pixel, from which on it is told.
const TOLD: f64 = 1.0;

/// Refuses what cannot be, before anything is read.
pub(crate) fn check(typed: &Imaging) -> anyhow::Result<()> {
    let own = &typed.grid;
    let is_dem = matches!(own.surface, SurfaceKind::Dem(_));
    if own.geoid.is_some() && !is_dem {
        let what =
            "--geoid is for --surface dem:FILE: other surfaces state heights above the ellipsoid";
        return Err(Usage(what.to_owned()).into());
    }
    if let (SurfaceKind::Slant, Some(grid)) = (&own.surface, &own.pixels)
        && (grid.x_axis != DVec3::X || grid.y_axis != DVec3::Y || grid.polar)
    {
        let what = "--surface slant turns the grid itself: give --grid x and y (cross-range and range), and no yaw, pitch or roll";
        return Err(Usage(what.to_owned()).into());
    }
    let geoid = own.geoid.as_ref().and_then(|geoid| geoid.file());
    for path in own.surface.file().into_iter().chain(geoid) {
        std::fs::metadata(path).with_context(|| format!("cannot read {}", path.display()))?;
    }
    Ok(())
}

/// The grid that is given, or else the one that suits, with its pixels on the surface that is asked for.
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
        "--surface slant: the antennas do not move across their line of sight, so that there is no slant plane",
    )?;
    Ok(ImageGrid {
        x_axis,
        y_axis,
        ..plane
    })
}

/// The plane with the relief of a surface over it.
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
    let said = format!(
        "pixels lie on {}, {low_m:.1} to {high_m:.1} m over the grid's plane, by {} x {} nodes to {:.2} m",
        relief.surface(),
        relief.columns().count,
        relief.rows().count,
        relief.error_m(),
    );
    match plane.polar || relief.error_m() <= TOLD * pixel_m {
        true => session.note(1, || said),
        false => messages::warning(format!(
            "{said}: more than a pixel; a smaller grid has finer nodes"
        )),
    }
    Ok(plane.on(relief))
}
