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
//! an interrupted run resumes. Within an item at the thesis's own scale it resumes after the last finished image, kept as
//! `.subap-unfinished-CRC.npy` until the item is finished. The page is rewritten after every item.
#![forbid(unsafe_code)]

mod expect;
mod item;
mod items;
mod page;
mod store;
mod unfinished;

use std::path::Path;

use subaperture_io::atomic::WriteError;
use subaperture_io::written::WrittenFile;

pub use expect::{Expected, expect};
pub use items::items;

pub use item::{Check, Context, Finding, Item, ItemError, Picture};
pub(crate) use item::{NOT_DONE, NOT_GIVEN};

/// Error of a run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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

/// Compute `items` and write them to `folder`, which is created if missing. `on_step` is called for every step. Returns the
/// files of all items, reused ones included, and the page.
///
/// # Errors
/// [`RunError`] if an item or file fails; finished items remain, and the page shows them.
pub fn run(
    items: &[Item],
    folder: &Path,
    context: &Context,
    mut on_step: impl FnMut(Step),
) -> Result<Vec<WrittenFile>, RunError> {
    let mut done = Vec::with_capacity(items.len());
    let mut files = Vec::new();
    let mut page = None;
    for (index, item) in items.iter().enumerate() {
        on_step(Step::Begun(item, index, items.len()));
        let key = store::key(item, context);
        let (finding, stored) = match store::load(folder, item, &key) {
            Some(loaded) => loaded,
            None => {
                let unfinished = context.unfinished.filter(|_| item.full_work().is_some());
                let made = (item.reproduce)(&Context {
                    unfinished,
                    ..*context
                });
                let finding = made.map_err(|source| RunError::Item {
                    id: item.id,
                    source,
                })?;
                let stored = store::save(folder, item, &key, &finding)?;
                unfinished.map(unfinished::clear);
                (finding, stored)
            }
        };
        files.extend(stored);
        on_step(Step::Done(item, &finding));
        done.push((item, finding));
        page = Some(page::write(folder, &done)?);
    }
    files.extend(page);
    Ok(files)
}
