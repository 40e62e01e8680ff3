//! Surface on which an image is focused: the grid's plane, rotated or with a relief.

use anyhow::Context;
use subaperture::geometry::ImageGrid;
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;
use subaperture::terrain::{Geoid, PlacementError};

use crate::args::Imaging;
use crate::config::Session;
use crate::failure::Usage;
use crate::messages;

/// Check the options before any file is read.
pub(crate) fn check(typed: &Imaging) -> anyhow::Result<()> {
    let own = &typed.grid;
    let geoid = own.geoid.as_ref().unwrap_or(&Geoid::None);
    own.surface
        .check(geoid, own.pixels.as_ref())
        .map_err(|error| {
            let fault = match error {
                PlacementError::Geoid => "--geoid applies to --surface dem:FILE only: other surfaces have heights above the ellipsoid",
                PlacementError::Rotated => "--surface slant rotates the grid itself: give --grid with x (cross-range) and y (range) only, without yaw, pitch or roll",
                error => return error.into(),
            };
            anyhow::Error::from(Usage(fault.to_owned()))
        })?;
    for path in own.surface.file().into_iter().chain(geoid.file()) {
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
    let own = &typed.grid;
    let plane = match own.pixels.clone() {
        Some(grid) => (grid, false),
        None => (session.default_grid(survey())?, true),
    };
    let geoid = own.geoid.as_ref().unwrap_or(&Geoid::None);
    let progress = session.progress("surface");
    let budget = session.memory_bytes;
    let placed = own
        .surface
        .place(plane, geoid, history.collection(), budget, &progress)?;
    progress.finish();
    for warning in placed.warnings {
        messages::warning(warning);
    }
    if let Some(relief) = placed.relief {
        session.note(1, || relief);
    }
    Ok(placed.grid)
}
