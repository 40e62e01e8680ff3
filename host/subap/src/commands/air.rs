//! Tropospheric delay correction of a recording (`--troposphere`).

use subaperture::geometry::ImageGrid;
use subaperture::phase_history::{PhaseHistory, ReadError, ThroughAir};

use crate::args::GridSettings;
use crate::config::Session;

/// A recording, with or without the air's delay.
pub(crate) enum Recorded<'a> {
    AsItIs(Box<dyn PhaseHistory + 'a>),
    InVacuum(Box<ThroughAir<'a>>),
}

impl<'a> Recorded<'a> {
    /// The recording less the delay that is asked to be taken away.
    pub(crate) fn new(
        typed: &GridSettings,
        history: Box<dyn PhaseHistory + 'a>,
    ) -> Result<Self, ReadError> {
        Ok(match typed.troposphere.0 {
            None => Self::AsItIs(history),
            Some(air) => Self::InVacuum(Box::new(ThroughAir::new(history, air)?)),
        })
    }

    pub(crate) fn history(&self) -> &(dyn PhaseHistory + 'a) {
        match self {
            Self::AsItIs(history) => &**history,
            Self::InVacuum(history) => &**history,
        }
    }

    /// Says what was taken away, and what that leaves on a grid.
    pub(crate) fn tell(&self, session: &Session, grid: &ImageGrid) {
        if let Self::InVacuum(history) = self {
            session.note(1, || {
                format!(
                    "the air's extra path of {:.3} m (two ways, middle pulse) is taken away; at the corners of the grid it differs by {:.2e} m at most",
                    history.extra_path_m(),
                    history.left_m(grid)
                )
            });
        }
    }
}
