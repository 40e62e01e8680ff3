//! Image to be formed by `subap focus`: its recording as the image uses it, and its outputs.

use std::sync::Arc;
use std::time::Instant;

use serde_json::Value;
use subaperture::autofocus::Correction;
use subaperture::corrections::{CorrectedRecording, Corrections, CorrectionsError};
use subaperture::focus::Numerics;
use subaperture::geometry::ImageGrid;
use subaperture::io::{phase_csv, target_csv};
use subaperture::phase_history::PhaseHistory;
use subaperture::track::Displacement;

use super::on_track;
use crate::args::Focus;
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

/// The recordings as the image uses them: on the requested track, corrected for delay and phase, in the frame of a moving target. The JSON value
/// has the movers found by a track estimate, for the record.
pub(super) fn opened(
    session: &Session,
    typed: &Focus,
) -> anyhow::Result<(CorrectedRecording<'static>, Value)> {
    let (recorded, movers) = match &typed.track {
        None => (session.open(&typed.input)?, Value::Null),
        Some(track) => on_track::open(session, &typed.input, track, &typed.logs)?,
    };
    let target = &typed.target;
    let phase = typed.phase.as_deref().map(phase_csv::read).transpose()?;
    let sampled = target.motion.as_deref().map(target_csv::read).transpose()?;
    let corrections = Corrections {
        troposphere: typed.image.grid.troposphere.0,
        errors: phase.map(|error_rad| Correction::Phase { error_rad }),
        target: sampled.or(target.velocity.map(Displacement::Velocity)),
    };
    let corrected = corrections.apply(Arc::new(recorded));
    let corrected = corrected.map_err(|error| {
        let source = match error {
            CorrectionsError::Errors(_) => typed.phase.as_ref(),
            CorrectionsError::Target(_) => target.motion.as_ref(),
            _ => None,
        };
        let named = source.map(|path| path.display().to_string());
        let error = anyhow::Error::from(error);
        match named {
            Some(named) => error.context(named),
            None => error,
        }
    })?;
    Ok((corrected, movers))
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
