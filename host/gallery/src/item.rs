//! Items of the gallery and their findings.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use subaperture_focus::FormError;
use subaperture_gmti::GmtiError;
use subaperture_io::atomic::WriteError;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::ReadError;
use subaperture_motion::targets::TargetsError;
use subaperture_plot::PlotError;
use subaperture_quality::PairError;
use subaperture_simulate::RecordError;
use subaperture_simulate::scenario::ScenarioError;

/// Figure or table of a thesis.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Name on the command line and in file names, such as `s-4-5` for Schone 2020, Fig. 4.5.
    pub id: &'static str,
    /// Thesis, and number of the figure or table.
    pub source: &'static str,
    /// Short statement of the subject shown.
    pub title: &'static str,
    /// Approximate time relative to that of [`expect()`](crate::expect())'s image.
    pub work: f64,
    /// Function that computes the finding.
    pub reproduce: fn(&Context) -> Result<Finding, ItemError>,
}

impl Item {
    /// [`Self::work`] at the thesis's own scale ([`Context::full`]); `None` for an item that is made at one scale.
    pub fn full_work(&self) -> Option<f64> {
        FULL.iter()
            .find(|(id, _)| *id == self.id)
            .map(|&(_, work)| work)
    }
}

/// Items that are made at the thesis's own scale on request, and their work.
const FULL: [(&str, f64); 2] = [("s-4-10", 12_000.0), ("s-4-11", 9_000.0)];

/// Resources of items.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Memory limit of an item, bytes.
    pub memory_bytes: u64,
    /// Progress and cancellation within an item.
    pub monitor: &'a dyn Monitor,
    /// GOTCHA recordings for the items that can use them; may be empty.
    pub gotcha: &'a [PathBuf],
    /// Whether to make the items with [`Item::full_work`] at the thesis's own scale.
    pub full: bool,
    /// Folder that keeps the images of an unfinished item, so that an interrupted run reuses them; `None` keeps no image.
    pub unfinished: Option<&'a Path>,
}

/// Result of an item.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Finding {
    /// Content and claims of the thesis, in a sentence or two.
    pub thesis: String,
    /// Method and parameters used here, and scaling relative to the thesis with its reason (`Scale: ` or `Scaled down: `).
    pub method: String,
    /// Values of the thesis compared with ours.
    pub checks: Vec<Check>,
    /// Reason for differences; `None` without differences.
    pub why: Option<String>,
    /// Pictures of the item.
    pub pictures: Vec<Picture>,
}

/// Value of the thesis compared with ours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// Quantity.
    pub what: String,
    /// Value of the thesis, with unit.
    pub thesis: String,
    /// Our value, with unit.
    pub ours: String,
    /// Whether they agree, to the accuracy that the thesis states or prints. Where [`Self::has_thesis_value`] is false: whether our value
    /// is within the bound derived for it.
    pub agrees: bool,
}

/// [`Check::thesis`] of a value that the thesis does not give.
pub(crate) const NOT_GIVEN: &str = "not given";
/// [`Check::thesis`] of a method that the thesis does not use.
pub(crate) const NOT_DONE: &str = "not done";

/// A picture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Picture {
    /// Name within the item, for its file.
    pub name: String,
    /// Short statement of the subject shown.
    pub caption: String,
    /// PNG file, stored separately.
    #[serde(skip)]
    pub png: Vec<u8>,
}

impl Check {
    /// Compare a printed value of the thesis with ours, shown with `digits` decimals, both in `unit`. They agree if ours is within half a unit of
    /// the last digit printed.
    ///
    /// # Panics
    /// If `thesis` is not a number.
    pub fn printed(what: &str, thesis: &str, ours: f64, digits: usize, unit: &str) -> Self {
        let decimals = thesis.split_once('.').map_or(0, |(_, after)| after.len());
        let value: f64 = thesis.parse().expect("the thesis prints a number");
        let half_unit = 0.5 * 10f64.powi(-(decimals as i32));
        Self::claim(
            what,
            &format!("{thesis} {unit}"),
            format!("{ours:.digits$} {unit}"),
            // Tolerance for binary rounding.
            (ours - value).abs() <= half_unit * (1.0 + 1e-9),
        )
    }

    /// Compare a value computed from a formula of the thesis, or from the simulated parameters, with a measured one, within
    /// `tolerance`; all in `unit`, shown with `digits` decimals. For values that the thesis prints, use [`Self::printed`].
    pub fn number(
        what: &str,
        thesis: f64,
        ours: f64,
        tolerance: f64,
        digits: usize,
        unit: &str,
    ) -> Self {
        Self::claim(
            what,
            &format!("{thesis:.digits$} {unit}"),
            format!("{ours:.digits$} {unit}"),
            (ours - thesis).abs() <= tolerance,
        )
    }

    /// Whether the thesis states a value or claim to compare with.
    pub fn has_thesis_value(&self) -> bool {
        ![NOT_GIVEN, NOT_DONE].contains(&self.thesis.as_str())
    }

    /// Compare a claim of the thesis in words with a measured value.
    pub fn claim(what: &str, thesis: &str, ours: String, agrees: bool) -> Self {
        Self {
            what: what.to_owned(),
            thesis: thesis.to_owned(),
            ours,
            agrees,
        }
    }
}

impl Finding {
    /// `why`, unless all checks agree.
    pub(crate) fn unless_all_agree(checks: &[Check], why: &str) -> Option<String> {
        let differ = checks.iter().any(|check| !check.agrees);
        differ.then(|| why.to_owned())
    }

    /// Whether all checks agree.
    pub fn agrees(&self) -> bool {
        self.checks.iter().all(|check| check.agrees)
    }
}

/// Error of computing an item.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ItemError {
    /// An image could not be formed.
    // Not transparent: callers search the chain for this cause to detect cancellation.
    #[error("{0}")]
    Form(#[from] FormError),
    /// Pulses could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A scene could not be simulated.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A simulated scene could not be recorded.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Targets or their track could not be estimated.
    // Not transparent, as above.
    #[error("{0}")]
    Targets(#[from] TargetsError),
    /// An image of an unfinished item could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Images could not be compared.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// Moving targets could not be detected.
    #[error(transparent)]
    Gmti(Box<GmtiError>),
    /// A quantity could not be measured.
    #[error("{0}")]
    Measure(String),
}

impl From<GmtiError> for ItemError {
    /// An image that could not be formed is [`ItemError::Form`]: cancellation has one cause in the chain.
    fn from(error: GmtiError) -> Self {
        match error {
            GmtiError::Form(error) => Self::Form(error),
            error => Self::Gmti(error.into()),
        }
    }
}
