//! Corrections of a recording before its image is formed.
//!
//! ```text
//! recording ─> troposphere ─> phase or track ─> frame of a moving target ─> image
//! ```

use std::sync::Arc;

use subaperture_autofocus::{Corrected, Correction, Misfit};
use subaperture_focus::FormError;
use subaperture_focus::moving::Moving;
use subaperture_model::geometry::{ImageGrid, Troposphere};
use subaperture_model::phase_history::{PhaseHistory, ReadError, TroposphereCorrected};
use subaperture_model::track::Displacement;

/// Corrections of a recording, applied in this order. Default: none.
#[derive(Clone, Debug, Default)]
pub struct Corrections {
    /// Troposphere whose delay is removed, relative to the recording's reference point.
    pub troposphere: Option<Troposphere>,
    /// Errors of phase or track that are removed.
    pub errors: Option<Correction>,
    /// Motion of the target that is focused; pixels are positions at the first pulse.
    pub target: Option<Displacement>,
}

/// Error of correcting a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CorrectionsError {
    /// The recording does not state its position on the Earth.
    #[error(transparent)]
    Troposphere(#[from] ReadError),
    /// The errors to be removed do not fit the recording.
    #[error(transparent)]
    Errors(#[from] Misfit),
    /// The motion of the target does not fit the recording.
    #[error(transparent)]
    Target(FormError),
}

/// Recording with its corrections applied. Samples are not copied.
pub struct CorrectedRecording<'a> {
    air: Option<Arc<TroposphereCorrected<'a>>>,
    at_rest: Arc<dyn PhaseHistory + 'a>,
    history: Arc<dyn PhaseHistory + 'a>,
}

impl Corrections {
    /// Apply the corrections to `recorded`.
    ///
    /// # Errors
    /// [`CorrectionsError`].
    pub fn apply<'a>(
        &self,
        recorded: Arc<dyn PhaseHistory + 'a>,
    ) -> Result<CorrectedRecording<'a>, CorrectionsError> {
        let mut at_rest = recorded;
        let mut air = None;
        if let Some(troposphere) = self.troposphere {
            let corrected = TroposphereCorrected::new(Box::new(at_rest), troposphere)?;
            let corrected = Arc::new(corrected);
            at_rest = corrected.clone();
            air = Some(corrected);
        }
        if let Some(errors) = &self.errors {
            at_rest = Arc::new(Corrected::new(at_rest, errors)?);
        }
        let mut history = at_rest.clone();
        if let Some(target) = self.target.clone() {
            let first = history.collection().pulses.first();
            let first_s = first.map_or(0.0, |pulse| pulse.time_s);
            let moving = Moving::new(history, target, first_s);
            history = Arc::new(moving.map_err(CorrectionsError::Target)?);
        }
        Ok(CorrectedRecording {
            air,
            at_rest,
            history,
        })
    }
}

impl<'a> CorrectedRecording<'a> {
    /// Pulses of the image, in the frame of the moving target if there is one.
    pub fn history(&self) -> &(dyn PhaseHistory + 'a) {
        &*self.history
    }

    /// Pulses in the frame of the scene.
    pub fn at_rest(&self) -> &(dyn PhaseHistory + 'a) {
        &*self.at_rest
    }

    /// Delay of the troposphere that was removed, and its residual over a grid; `None` without this correction.
    pub fn delay(&self, grid: &ImageGrid) -> Option<String> {
        let air = self.air.as_ref()?;
        Some(format!(
            "troposphere: corrected a two-way excess path of {:.3} m (middle pulse); it varies by at most {:.2e} m over the corners of the grid",
            air.extra_path_m(),
            air.residual_m(grid)
        ))
    }
}
