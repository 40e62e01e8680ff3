//! Recordings of an evaluation.

use subaperture_focus::FormError;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channels, Collection};

use super::draw::{TestTarget, draw};
use super::outcomes::Setup;
use super::trials::Evaluation;
use crate::error::GmtiError;

/// Recordings with targets for each one without.
const WITH_TARGETS: usize = 10;

/// Numbers of recordings and targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Number of recordings with targets. For every ten, one is made without.
    pub recordings: usize,
    /// Targets in each. They must be apart by more than the training cells, or the covariance contains them.
    pub targets: usize,
    /// Motions that are tested in each recording without targets.
    pub absent: usize,
    /// Smallest and largest radial speed, metres per second.
    pub speeds_m_s: [f64; 2],
}

impl Evaluation {
    /// Simulate and test the recordings of a plan. `simulate` makes a recording of different clutter and noise for each number, with the given targets; `uniform` returns numbers
    /// from 0, included, to 1.
    ///
    /// # Errors
    /// [`GmtiError`], [`GmtiError::Form`] if `monitor` cancels; errors of `simulate`.
    pub fn run<'a, E: From<GmtiError>>(
        setup: &Setup,
        plan: &Plan,
        monitor: &dyn Monitor,
        mut uniform: impl FnMut() -> f64,
        mut simulate: impl FnMut(u64, &[TestTarget]) -> Result<Channels<'a>, E>,
    ) -> Result<Self, E> {
        let mut evaluation = Self::default();
        let mut drawn = |collection: &Collection, count| {
            let (grid, section_m2) = (setup.imaging.grid, setup.cross_section_m2);
            draw(
                collection,
                grid,
                count,
                plan.speeds_m_s,
                section_m2,
                &mut uniform,
            )
        };
        let check = |done: usize| {
            monitor.progress(done as f64 / plan.recordings as f64);
            match monitor.cancelled() {
                true => Err(GmtiError::from(FormError::Cancelled)),
                false => Ok(()),
            }
        };
        for first in (0..plan.recordings).step_by(WITH_TARGETS) {
            check(first)?;
            let number = (first + first / WITH_TARGETS) as u64;
            let clutter = simulate(number, &[])?;
            let collection = clutter.channel(0).collection();
            evaluation.add_clutter(&clutter, setup, &drawn(collection, plan.absent)?)?;
            for done in first..plan.recordings.min(first + WITH_TARGETS) {
                check(done)?;
                let number = number + 1 + (done - first) as u64;
                let targets = drawn(collection, plan.targets)?;
                evaluation.add_targets(&simulate(number, &targets)?, setup, &targets)?;
            }
        }
        Ok(evaluation)
    }
}
