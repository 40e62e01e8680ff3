//! Advice on the sub-CPIs of range-Doppler backprojection.

use serde_json::{Value, json};
use subaperture::focus::rdbp::{Plan, Request};
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;

use crate::config::Session;

/// Error bound for which sub-CPIs are planned, dB.
pub(super) const BOUND_DB: f64 = -60.0;

/// Longest useful sub-CPIs in either mode of range-Doppler backprojection.
pub(super) struct Advice {
    /// Sub-CPI and patch chosen by the planner in precise mode.
    pub(super) precise: Option<Planned>,
    /// Longest sub-CPI whose first grating lobes lie outside the declared extent, thesis mode.
    pub(super) thesis_pulses: Option<usize>,
    /// Cross-range distance of the first grating lobe in thesis mode, metres times pulses per sub-CPI.
    grating_lobe_m: Option<f64>,
}

/// Choice of the range-Doppler backprojection planner for the default grid.
pub(super) struct Planned {
    pub(super) pulses: usize,
    pub(super) patch_m: [f64; 2],
    pub(super) predicted_db: f64,
}

impl Planned {
    fn of(session: &Session, history: &dyn PhaseHistory, survey: &Survey) -> Option<Self> {
        let grid = survey.default_grid().ok()?.grid;
        let request = Request {
            error_db: BOUND_DB,
            sub_cpi: None,
            patch_m: None,
            memory_bytes: session.memory_bytes / 2,
        };
        let plan = Plan::new(history.collection(), &grid, &request).ok()?;
        Some(Self {
            pulses: plan.sub_cpi_length,
            patch_m: [
                plan.patch.columns as f64 * grid.columns.step,
                plan.patch.rows as f64 * grid.rows.step,
            ],
            predicted_db: plan.predicted_db,
        })
    }
}

impl Advice {
    pub(super) fn of(session: &Session, history: &dyn PhaseHistory, survey: &Survey) -> Self {
        let thesis_pulses = survey.declared_extent_m.and_then(|[x_m, y_m]| {
            let (x, y) = (x_m.1 - x_m.0, y_m.1 - y_m.0);
            // Width of the scene across the line of sight, at most its diagonal.
            let turn = survey.azimuth_deg.to_radians();
            let width_m = x * turn.sin().abs() + y * turn.cos().abs();
            let pulses = (survey.unambiguous_cross_range_m? / width_m).floor() as usize;
            Some(pulses.clamp(1, survey.num_pulses))
        });
        Self {
            precise: Planned::of(session, history, survey),
            thesis_pulses,
            grating_lobe_m: survey.grating_lobe_m(1),
        }
    }

    pub(super) fn to_json(&self) -> Value {
        json!({
            "precise": self.precise.as_ref().map(|plan| json!({
                "error_bound_db": BOUND_DB,
                "predicted_error_db": plan.predicted_db,
                "pulses": plan.pulses,
                "patch_m": plan.patch_m,
            })),
            "thesis": {
                "first_grating_lobe_m_times_pulses": self.grating_lobe_m,
                "longest_outside_declared_extent": self.thesis_pulses,
            },
        })
    }
}
