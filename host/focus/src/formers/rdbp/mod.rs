//! Sub-CPI range-Doppler backprojection: the aperture in short pieces, each turned into a
//! range-Doppler map, every pixel read from the map at its own range and Doppler.
//!
//! Schone 2020, chapter 3, in two modes:
//!
//! - [`Mode::Thesis`], as written there: sinc-resampled Keystone, zero-padded Doppler and range
//!   transforms, bilinear reading ([`thesis`]). Long sub-CPIs give grating lobes. [`Thesis`] has what the
//!   thesis varies.
//! - [`Mode::Precise`], the default ([`precise`]): the phase history of every patch of pixels is first
//!   motion-compensated to the patch's centre with each pulse's own position, Keystone is an exact
//!   scaled transform, and maps are read with a Kaiser-Bessel kernel on a grid twice as fine as
//!   Nyquist's. The quadratic phase that made the grating lobes is common to the patch, and gone with
//!   the compensation; what varies across the patch sets how long a sub-CPI may be ([`Plan`]).

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

use super::{Entry, of};
use crate::former::chosen;
use crate::{
    Aim, Asked, DEFAULT_ERROR_DB, Decision, FormError, Forming, ImageFormer, Reason, Remedy,
};
use subaperture_model::monitor::Monitor;

pub use plan::{Plan, Request};
pub use thesis::Thesis;

/// How maps are made and read.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Patch compensation, scaled transform, Kaiser-Bessel kernel.
    #[default]
    Precise,
    /// As the thesis has it.
    Thesis(Thesis),
}

/// Sub-CPI range-Doppler backprojection.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RangeDoppler {
    /// How maps are made and read.
    pub mode: Mode,
    /// Bound on the relative RMS error of the image, dB (negative). The thesis's mode does not plan by it: it
    /// takes 40 pulses a sub-CPI, as its chapter 4, unless told otherwise, and has a bound of its own to be held to
    /// ([`Thesis::error_db`]).
    pub error_db: f64,
    /// Pulses a sub-CPI; planned if not given.
    pub sub_cpi: Option<usize>,
    /// Side of a patch, metres; planned if not given. The thesis's mode has no patches.
    pub patch_m: Option<f64>,
}

impl Default for RangeDoppler {
    fn default() -> Self {
        Self {
            mode: Mode::Precise,
            error_db: DEFAULT_ERROR_DB,
            sub_cpi: None,
            patch_m: None,
        }
    }
}

impl RangeDoppler {
    /// With this bound on the relative RMS error of the image, dB (negative).
    #[must_use]
    pub fn error_db(self, error_db: f64) -> Self {
        Self { error_db, ..self }
    }

    /// With maps made and read in this way.
    #[must_use]
    pub fn mode(self, mode: Mode) -> Self {
        Self { mode, ..self }
    }

    /// With so many pulses a sub-CPI.
    #[must_use]
    pub fn sub_cpi(self, pulses: usize) -> Self {
        Self {
            sub_cpi: Some(pulses),
            ..self
        }
    }

    /// With patches of this side, metres.
    #[must_use]
    pub fn patch_m(self, side_m: f64) -> Self {
        Self {
            patch_m: Some(side_m),
            ..self
        }
    }
}

/// In the list of formers.
pub(super) const ENTRY: Entry = Entry {
    name: "rdbp",
    summary: "sub-CPI range-Doppler backprojection: any track, fast",
    options: &options::ALL,
    of: of::<RangeDoppler>,
};

impl ImageFormer for RangeDoppler {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!(self)
    }

    fn bound_db(&self) -> Option<f64> {
        match self.mode {
            Mode::Precise => Some(self.error_db),
            Mode::Thesis(thesis) => thesis.error_db,
        }
    }

    fn follows_sweeps(&self) -> bool {
        self.mode == Mode::Precise
    }

    fn planning_for(&self, error_db: f64) -> Option<Box<dyn ImageFormer>> {
        match self.mode {
            Mode::Precise => Some(Box::new(Self { error_db, ..*self })),
            Mode::Thesis(_) => None,
        }
    }

    fn decide(
        &self,
        aim: &Aim,
        asked: &Asked,
        monitor: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        match self.mode {
            Mode::Thesis(options) => {
                let sub_cpi = self.sub_cpi.unwrap_or(thesis::SUB_CPI);
                thesis::Choices::new(sub_cpi, &options)?.decide(aim, asked)
            }
            Mode::Precise => {
                let request = Request {
                    error_db: self.error_db,
                    sub_cpi: self.sub_cpi,
                    patch_m: self.patch_m,
                    memory_bytes: aim.scratch_bytes,
                };
                let plan = Plan::by(aim.means.model, aim.collection, aim.grid, &request)?;
                asked.check(plan.predicted_db, || {
                    Reason::new(
                        "sub-CPIs and patches of these sizes, or float32 sums, leave no less",
                    )
                    .helped_by(self.remedies())
                })?;
                let choices = precise::Choices::new(aim, &plan, monitor)?;
                let (grain, cost) = choices.grain_and_cost(aim)?;
                Ok(Decision {
                    choices: json!({ "precise": choices }),
                    settings: json!({
                        "mode": "precise",
                        "sub_cpi_pulses": plan.sub_cpi_length,
                        "sub_cpis": plan.sub_cpis.len(),
                        "patch_rows": plan.patch.rows,
                        "patch_columns": plan.patch.columns,
                        "kernel_taps": plan.taps,
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
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        Ok(match chosen("rdbp", choices)? {
            Choices::Precise(choices) => choices.open(aim)?,
            Choices::Thesis(choices) => Box::new(thesis::Opened::new(aim, choices)?),
        })
    }
}

/// What a plan fixes, of either mode.
#[derive(serde::Deserialize)]
#[serde(rename_all = "lowercase")]
enum Choices {
    Precise(precise::Choices),
    Thesis(thesis::Choices),
}

impl RangeDoppler {
    /// What brings the error down: sizes of the plan's choice, else another former.
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
