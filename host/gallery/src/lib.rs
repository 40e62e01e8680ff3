//! The figures and tables of the two theses, made again from simulation, and held against what
//! they show.
//!
//! A part of [Subaperture](https://docs.rs/subaperture), radar image formation: what `subap reproduce` runs.
//!
//! An [`Item`] is one figure or table: it simulates what the thesis had, does what the thesis did, and
//! returns a [`Finding`]: pictures, and checks that set the thesis's number beside ours. Whether the
//! two agree is computed, never written down; where they do not, a line says why.
//!
//! [`run`] makes the items one after another and leaves, in one folder,
//!
//! | file | holds |
//! |---|---|
//! | `index.html` | the page: every picture in it, no other file needed, no network |
//! | `ID.json` | an item's finding, without its pictures |
//! | `ID-NAME.png` | an item's pictures |
//!
//! An item that is there already, made by the same version with the same inputs, is not made again:
//! an interrupted run goes on where it stopped. The page is written anew after every item.
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
use subaperture_plot::PlotError;
use subaperture_quality::PairError;
use subaperture_simulate::RecordError;
use subaperture_simulate::scenario::ScenarioError;
use subaperture_targets::TargetsError;

pub use expect::{Expected, expect};
pub use items::items;

/// One figure or table of a thesis.
#[derive(Clone, Copy, Debug)]
pub struct Item {
    /// Its name on the command line and in file names: `s-4-5` for Schone 2020, Fig. 4.5.
    pub id: &'static str,
    /// The thesis and its number there.
    pub source: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The time it takes over that of [`expect`]'s image, about.
    pub work: f64,
    /// Makes it again.
    pub reproduce: fn(&Context) -> Result<Finding, ItemError>,
}

/// What items may use.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Bytes that an item may take.
    pub memory_bytes: u64,
    /// Told of progress within the item, asked whether to go on.
    pub monitor: &'a dyn Monitor,
    /// Recordings of the GOTCHA scene, for the items that can be shown on them; may be empty.
    pub gotcha: &'a [PathBuf],
}

/// What an item found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Finding {
    /// What the thesis shows and says, in a sentence or two.
    pub thesis: String,
    /// What was done here, with the numbers that it was done with.
    pub method: String,
    /// The thesis's figures beside ours.
    pub checks: Vec<Check>,
    /// Why they differ, where they do: one line.
    pub why: Option<String>,
    /// The pictures.
    pub pictures: Vec<Picture>,
}

/// One figure of the thesis beside ours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// What is compared.
    pub what: String,
    /// The thesis's figure, with its unit.
    pub thesis: String,
    /// Ours, with its unit.
    pub ours: String,
    /// Whether they agree, as far as the thesis's figure is given.
    pub agrees: bool,
}

/// A picture.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Picture {
    /// Its name within the item, for its file.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// The bytes of a PNG file; kept in a file of their own.
    #[serde(skip)]
    pub png: Vec<u8>,
}

impl Check {
    /// A number of the thesis and ours, which agree within `tolerance`; all in `unit`, shown with
    /// `digits` decimals.
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

    /// A claim of the thesis in words, and what we measured.
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
    /// Whether every figure agrees.
    pub fn agrees(&self) -> bool {
        self.checks.iter().all(|check| check.agrees)
    }
}

/// Why an item could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ItemError {
    /// An image could not be formed.
    // Not transparent: who asks whether the user stopped the work looks for this cause.
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
    /// Targets, or a track of them, were not found.
    // As of images.
    #[error("{0}")]
    Targets(#[from] TargetsError),
    /// Images could not be compared.
    #[error(transparent)]
    Pair(#[from] PairError),
    /// A picture could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// Something was not there to be measured.
    #[error("{0}")]
    Measure(String),
}

/// Why a run broke off.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// An item could not be made.
    #[error("{id}: {source}")]
    Item {
        /// Its name.
        id: &'static str,
        /// Cause.
        source: ItemError,
    },
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// An item as [`run`] goes along.
#[derive(Clone, Copy, Debug)]
pub enum Step<'a> {
    /// It is begun: its place among all, from 0, and their number.
    Begun(&'a Item, usize, usize),
    /// It is done, or was there.
    Done(&'a Item, &'a Finding),
}

/// Names of the files in `folder` that [`run`] may write or replace.
pub fn names(folder: &Path, items: &[Item]) -> Vec<String> {
    store::names(folder, items)
}

/// Makes `items` and leaves them in `folder`, which is made if need be. `tell` hears of every item.
///
/// # Errors
/// [`RunError`]; items that were finished before stay, and the page shows them.
pub fn run(
    items: &[Item],
    folder: &Path,
    context: &Context,
    mut tell: impl FnMut(Step),
) -> Result<(), RunError> {
    let mut done = Vec::with_capacity(items.len());
    for (index, item) in items.iter().enumerate() {
        tell(Step::Begun(item, index, items.len()));
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
        tell(Step::Done(item, &finding));
        done.push((item, finding));
        page::write(folder, &done)?;
    }
    Ok(())
}
