//! Sub-CPI range-Doppler backprojection: the aperture is divided into short sub-apertures, each transformed to a
//! range-Doppler map, and every pixel is interpolated in the map at its range and Doppler.
//!
//! Schone 2020, chapter 3, in two modes:
//!
//! - [`Mode::Thesis`], as published: sinc-resampled Keystone, zero-padded Doppler and range
//!   transforms, bilinear interpolation ([`thesis`]). Long sub-CPIs give grating lobes. [`Thesis`] contains the parameters that the
//!   thesis varies.
//! - [`Mode::Precise`], the default. The phase history of every patch of pixels is
//!   motion-compensated to the patch centre with each pulse's own position. The quadratic phase that caused the grating lobes is common to the patch and
//!   removed by the compensation.
//!
//! The precise mode has two algorithms:
//!
//! - *Nested patches*. The history is decimated for patches within patches, as in [`crate::ffbp`], down to patches of some hundred pixels a side. Their
//!   sub-apertures are gridded on the plane of frequency and rate of the line of sight, transformed to range-Doppler maps, and
//!   interpolated in range and then in Doppler. Keystone is part of the gridding, and follows the turn of the line of sight.
//! - *Patches of one level* ([`precise`]). Keystone is an exact
//!   scaled transform of all frequencies, and maps are interpolated with a Kaiser-Bessel kernel on a grid twice as fine as
//!   Nyquist's. The variation of the quadratic phase across the patch limits the length of a sub-CPI ([`Plan`]). It follows intra-pulse motion, polar grids and
//!   rough tracks, and is used there, and where the size of sub-CPIs or of patches is given.

mod cost;
mod doppler;
mod layout;
mod mapper;
mod options;
pub mod plan;
pub mod precise;
pub mod thesis;
mod times;

use serde_json::json;

use super::Entry;
use super::algorithm::Algorithm;
use super::error_bound::error_bound;
use crate::compared::SWATH;
use crate::factorised::{self, Leaves};
use crate::{Decision, ErrorGoal, FormError, Forming, ImageSpec, Reason, Remedy};
use subaperture_model::monitor::Monitor;

pub use plan::{Plan, Request};
pub use thesis::Thesis;

/// Method for computing and interpolating maps.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Patch compensation, scaled transform, Kaiser-Bessel kernel.
    #[default]
    Precise,
    /// Method of the thesis.
    Thesis(Thesis),
}

/// Former by sub-CPI range-Doppler backprojection.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RangeDopplerBackprojection {
    /// Method for computing and interpolating maps.
    pub mode: Mode,
    /// Bound on the relative RMS error of the image, dB (negative). The thesis mode does not plan by it: it
    /// uses sub-CPIs of 40 pulses by default, as in its chapter 4, and has a separate optional bound
    /// ([`Thesis::error_db`]).
    pub error_db: f64,
    /// Pulses per sub-CPI; planned by default.
    pub sub_cpi: Option<usize>,
    /// Side of a patch, metres; planned by default. The thesis mode has no patches.
    pub patch_m: Option<f64>,
}

error_bound!(RangeDopplerBackprojection {
    mode: Mode::Precise,
    sub_cpi: None,
    patch_m: None,
});

impl RangeDopplerBackprojection {
    /// Set the method for computing and interpolating maps.
    #[must_use]
    pub fn mode(self, mode: Mode) -> Self {
        Self { mode, ..self }
    }

    /// Set the number of pulses per sub-CPI.
    #[must_use]
    pub fn sub_cpi(self, pulses: usize) -> Self {
        Self {
            sub_cpi: Some(pulses),
            ..self
        }
    }

    /// Set the side of a patch, metres.
    #[must_use]
    pub fn patch_m(self, side_m: f64) -> Self {
        Self {
            patch_m: Some(side_m),
            ..self
        }
    }
}

impl Algorithm for RangeDopplerBackprojection {
    const ENTRY: Entry = Entry::new::<Self>(
        options::NAME,
        "sub-CPI range-Doppler backprojection: any track, fast",
        &options::ALL,
    );

    type Choices = Choices;

    fn bound_db(&self) -> Option<f64> {
        match self.mode {
            Mode::Precise => Some(self.error_db),
            Mode::Thesis(thesis) => thesis.error_db,
        }
    }

    fn follows_sweeps(&self) -> bool {
        self.mode == Mode::Precise
    }

    fn planning_for(&self, error_db: f64) -> Option<Self> {
        match self.mode {
            Mode::Precise => Some(self.error_db(error_db)),
            Mode::Thesis(_) => None,
        }
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        monitor: &dyn Monitor,
    ) -> Result<Decision<Choices>, FormError> {
        match self.mode {
            Mode::Thesis(options) => {
                let sub_cpi = self.sub_cpi.unwrap_or(thesis::SUB_CPI);
                let choices = thesis::Choices::new(sub_cpi, &options)?;
                let decision = choices.decide(spec, goal)?;
                Ok(decision.map_choices(Choices::Thesis))
            }
            Mode::Precise => {
                if let Some(decision) = self.nested(spec, goal)? {
                    return Ok(decision);
                }
                let request = Request {
                    error_db: self.error_db,
                    sub_cpi: self.sub_cpi,
                    patch_m: self.patch_m,
                    memory_bytes: spec.scratch_bytes,
                };
                let plan = Plan::by(spec.numerics.model, spec.collection, spec.grid, &request)?;
                goal.check(plan.predicted_db, || {
                    Reason::new(
                        "the sizes of sub-CPIs and patches, or the rounding of float32 sums, limit the error",
                    )
                    .helped_by(self.remedies())
                })?;
                let choices = precise::Choices::new(spec, &plan, monitor)?;
                let (grain, cost) = choices.grain_and_cost(spec)?;
                Ok(Decision {
                    choices: Choices::Precise(choices),
                    settings: json!({
                        "mode": "precise",
                        "sub_cpi_pulses": plan.sub_cpi_length,
                        "sub_cpis": plan.sub_cpis.len(),
                        "patch_rows": plan.patch.rows,
                        "patch_columns": plan.patch.columns,
                        "kernel_taps": plan.taps,
                        "stray_from": SWATH,
                    }),
                    planned_db: plan.predicted_db,
                    grain,
                    cost,
                })
            }
        }
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: Choices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(match choices {
            Choices::Nested(choices) => factorised::open(options::NAME, spec, choices)?,
            Choices::Precise(choices) => choices.open(spec)?,
            Choices::Thesis(choices) => Box::new(thesis::Opened::new(spec, choices)?),
        })
    }
}

/// Parameters fixed by a plan of either mode.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Choices {
    Nested(factorised::Choices),
    Precise(precise::Choices),
    Thesis(thesis::Choices),
}

impl RangeDopplerBackprojection {
    /// Maps of nested patches, where sizes are left to the plan, the antennas rest during a pulse and maps suit the grid.
    pub(super) fn nested(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
    ) -> Result<Option<Decision<Choices>>, FormError> {
        if self.sub_cpi.is_some() || self.patch_m.is_some() || spec.collection.sweeps() {
            return Ok(None);
        }
        let decision = factorised::decide(self.error_db, Leaves::Maps, spec, goal)?;
        Ok(decision.map(|mut decision| {
            decision.settings["mode"] = "precise".into();
            decision.map_choices(Choices::Nested)
        }))
    }

    /// Remedies for an excessive error: leave the sizes to the plan, or use another former.
    fn remedies(&self) -> &'static [Remedy] {
        const BP: Remedy = Remedy::OtherFormer(&["bp"]);
        match (self.sub_cpi.is_some(), self.patch_m.is_some()) {
            (true, true) => &[Remedy::LeftOut(&["sub_cpi", "patch"]), BP],
            (true, false) => &[Remedy::LeftOut(&["sub_cpi"]), BP],
            (false, true) => &[Remedy::LeftOut(&["patch"]), BP],
            (false, false) => &[BP],
        }
    }
}
