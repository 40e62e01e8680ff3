//! Image to be formed by `subap focus`: its recording as the image uses it, and its outputs.

use std::time::Instant;

use anyhow::Context;
use serde_json::Value;
use subaperture::focus::Numerics;
use subaperture::focus::moving::Moving;
use subaperture::geometry::ImageGrid;
use subaperture::io::target_csv;
use subaperture::phase_history::PhaseHistory;

use super::{corrected, on_track};
use crate::args::Focus;
use crate::commands::air::Recorded;
use crate::commands::export::Products;
use crate::commands::forming::Surveying;
use crate::commands::surface;
use crate::config::Session;

/// Image to be formed from a recording.
pub(super) struct Job<'a> {
    pub(super) session: &'a Session,
    pub(super) typed: &'a Focus,
    /// Pulses, in the frame of the moving target if one is requested.
    pub(super) history: &'a dyn PhaseHistory,
    pub(super) survey: &'a Surveying<'a>,
    /// Moving targets found by a track estimate; null otherwise.
    pub(super) movers: Value,
    /// Transforms and timing model.
    pub(super) numerics: Numerics<'a>,
    /// Time at which the run began.
    pub(super) start: Instant,
}

impl Job<'_> {
    /// The given grid or the default one, on the requested surface.
    pub(super) fn grid(&self) -> anyhow::Result<ImageGrid> {
        surface::grid(self.session, &self.typed.image, self.history, || {
            self.survey.get()
        })
    }
}

/// Call a function with the recordings as the image uses them: on the requested track, corrected for delay and phase, in the frame of a moving
/// target. The function also gets the movers found by a track estimate, for the record.
pub(super) fn with_history<T>(
    session: &Session,
    typed: &Focus,
    act: impl FnOnce(&dyn PhaseHistory, Value) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let (recorded, movers) = match &typed.track {
        None => (session.open(&typed.input)?, Value::Null),
        Some(track) => on_track::open(session, &typed.input, track, &typed.logs)?,
    };
    let air = Recorded::new(&typed.image.grid, Box::new(recorded))?;
    let corrected = corrected::corrected(typed, air.history())?;
    let recorded: &dyn PhaseHistory = match &corrected {
        Some(corrected) => corrected,
        None => air.history(),
    };
    match moving(typed, recorded)? {
        Some(moving) => act(&moving, movers),
        None => act(recorded, movers),
    }
}

/// The recording in the frame of a moving target, if one is requested.
pub(super) fn moving<'a>(
    typed: &Focus,
    recorded: &'a dyn PhaseHistory,
) -> anyhow::Result<Option<Moving<'a>>> {
    let first_s = recorded.collection().pulses[0].time_s;
    let target = &typed.target;
    if let Some(path) = &target.motion {
        let moving = Moving::new(recorded, target_csv::read(path)?, first_s);
        return moving.map(Some).with_context(|| path.display().to_string());
    }
    let moving = target
        .velocity
        .map(|velocity| Moving::new(recorded, velocity, first_s));
    Ok(moving.transpose()?)
}

/// Additional output formats of the image.
pub(super) fn products(typed: &Focus) -> Products<'_> {
    Products {
        folder: &typed.out,
        formats: &typed.producing.formats,
        place: typed.producing.place,
        writing: typed.writing,
    }
}
