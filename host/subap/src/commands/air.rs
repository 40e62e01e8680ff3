//! Tropospheric delay correction of a recording (`--troposphere`).

use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{PhaseHistory, ReadError, TroposphereCorrected};

use crate::args::GridSettings;
use crate::config::Session;

/// Recording, with or without the tropospheric delay.
pub(crate) enum Recorded<'a> {
    Uncorrected(Box<dyn PhaseHistory + 'a>),
    Corrected(Box<TroposphereCorrected<'a>>),
}

impl<'a> Recorded<'a> {
    /// Apply the tropospheric correction, if one is requested.
    pub(crate) fn new(
        typed: &GridSettings,
        history: Box<dyn PhaseHistory + 'a>,
    ) -> Result<Self, ReadError> {
        Ok(match typed.troposphere.0 {
            None => Self::Uncorrected(history),
            Some(air) => Self::Corrected(Box::new(TroposphereCorrected::new(history, air)?)),
        })
    }

    pub(crate) fn history(&self) -> &(dyn PhaseHistory + 'a) {
        match self {
            Self::Uncorrected(history) => &**history,
            Self::Corrected(history) => &**history,
        }
    }

    /// Report the delay that was corrected and the residual over a grid.
    pub(crate) fn report(&self, session: &Session, grid: &ImageGrid) {
        if let Self::Corrected(history) = self {
            session.note(1, || {
                format!(
                    "troposphere: corrected a two-way excess path of {:.3} m (middle pulse); it varies by at most {:.2e} m over the corners of the grid",
                    history.extra_path_m(),
                    history.residual_m(grid)
                )
            });
        }
    }
}
