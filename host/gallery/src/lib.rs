//! Reproduction of the figures and tables of two theses by simulation, with a comparison of
//! their values.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: the items of `subap reproduce`.
//!
//! An [`Item`] is one figure or table: it simulates the thesis's scene, applies the thesis's method, and
//! returns a [`Finding`]: pictures, and checks that compare the thesis's value with ours. The verdict
//! is computed; where values differ, a line states the reason.
//!
//! [`run`] computes the items and writes to one folder:
//!
//! | file | content |
//! |---|---|
//! | `index.html` | page with all pictures embedded; needs no other file and no network |
//! | `ID.json` | finding of an item, without its pictures |
//! | `ID-NAME.png` | picture of an item |
//!
//! An item already present, computed by the same version from the same inputs, is reused:
//! an interrupted run resumes. The page is rewritten after every item.
#![forbid(unsafe_code)]

mod expect;
mod items;
mod page;
mod store;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use subaperture_focus::FormError;
use subaperture_io::atomic::WriteError;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::ReadError;
use subaperture_motion::targets::TargetsError;
use subaperture_plot::PlotError;
use subaperture_quality::PairError;
use subaperture_simulate::RecordError;
use subaperture_simulate::scenario::ScenarioError;

pub use expect::{Expected, expect};
pub use items::items;

/// Figure or table of a thesis.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Name on the command line and in file names, such as `s-4-5` for Schone 2020, Fig. 4.5.
    pub id: &'static str,
    /// Thesis, and number of the figure or table.
    pub source: &'static str,
    /// Short statement of the subject shown.
    pub title: &'static str,
    /// Approximate time relative to that of [`expect()`]'s image.
    pub work: f64,
    /// Function that computes the finding.
    pub reproduce: fn(&Context) -> Result<Finding, ItemError>,
}

/// Resources of items.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Memory limit of an item, bytes.
    pub memory_bytes: u64,
    /// Progress and cancellation within an item.
    pub monitor: &'a dyn Monitor,
    /// GOTCHA recordings for the items that can use them; may be empty.
    pub gotcha: &'a [PathBuf],
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
    /// Images could not be compared.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A quantity could not be measured.
    #[error("{0}")]
    Measure(String),
}

/// Error of a run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// An item could not be computed.
    #[error("{id}: {source}")]
    Item {
        /// Name of the item.
        id: &'static str,
        /// Error that caused the failure.
        source: ItemError,
    },
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Progress of [`run`].
#[derive(Clone, Copy, Debug)]
pub enum Step<'a> {
    /// Item started; its index from 0, and the number of items.
    Begun(&'a Item, usize, usize),
    /// Item finished, or already present.
    Done(&'a Item, &'a Finding),
}

/// Names of the files in `folder` that [`run`] may write or replace.
pub fn names(folder: &Path, items: &[Item]) -> Vec<String> {
    store::names(folder, items)
}

/// Compute `items` and write them to `folder`, which is created if missing. `on_step` is called for every step.
///
/// # Errors
/// [`RunError`] if an item or file fails; finished items remain, and the page shows them.
pub fn run(
    items: &[Item],
    folder: &Path,
    context: &Context,
    mut on_step: impl FnMut(Step),
) -> Result<(), RunError> {
    let mut done = Vec::with_capacity(items.len());
    for (index, item) in items.iter().enumerate() {
        on_step(Step::Begun(item, index, items.len()));
        let key = store::key(item, context);
        let finding = match store::load(folder, item, &key) {
            Some(finding) => finding,
            None => {
                let made = (item.reproduce)(context);
                let finding = made.map_err(|source| RunError::Item {
                    id: item.id,
                    source,
                })?;
                store::save(folder, item, &key, &finding)?;
                finding
            }
        };
        on_step(Step::Done(item, &finding));
        done.push((item, finding));
        page::write(folder, &done)?;
    }
    Ok(())
}
