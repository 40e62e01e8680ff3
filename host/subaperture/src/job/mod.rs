//! A whole job as one text: which recording, on which pixels, by which former, sharpened how, and what is made of the image.
//!
//! A job is a chain of stages. Each knows what it depends on, leaves its outputs complete or not at all, and is done once:
//!
//! ```text
//! inputs ─> track | autofocus ─> focus ─┬─> check
//!  (always)      (if asked for)         ├─> picture
//!                                       ├─> quality
//!                                       └─> products ─────> report (of all of them)
//! ```
//!
//! | stage | depends on, beside the version | leaves |
//! |---|---|---|
//! | inputs | | nothing: every run reads the recordings whole, for their sizes and CRC-32 |
//! | track | the recordings, `[track]`, its logs | `track.csv`, `track.png` |
//! | autofocus | the recordings, `[grid]`, `[former]`, `[autofocus]` | `correction.csv`, `autofocus.json`, `autofocus.png` |
//! | focus | the recordings, `[grid]`, `[former]`, `[track]`, the files that these name; track or autofocus | `image.zarr`, `image.json`, `image.png` |
//! | check | `[check]`; focus | `check.json` |
//! | picture | `[picture]`; focus | `picture.png` |
//! | quality | `[quality]`; focus | `quality.json`, `quality/` |
//! | products | `[products]`; focus | files by their formats |
//! | report | all | `report.html` |
//!
//! A [`Basis`] is what one stage depends on: its settings, the files that it reads, the fingerprints of the stages before it and the
//! program's version. Its fingerprint is a digest of these, so that it tells all that ever came before. [`State`] is the job's memory, a file in
//! the job's folder that is replaced as a whole after each stage: the basis by which every finished stage was done, and size and
//! CRC-32 of what it left. A stage stands if its basis is the one of then and its outputs are what they were;
//! else [`Why`] says what is to be done again, and for which reason.
//!
//! **Killed at any moment.** A stage's entry goes from the state before its outputs are touched, and comes back, with the new basis, once they are
//! complete. So what is half done has no entry and is done again, by the same settings to the same bits. Focusing is long, and
//! goes on: its tiles are marked as they are done ([`crate::io::tiles`]), and the state says for which fingerprint they were begun
//! ([`State::begin`]); tiles of another are discarded.
//!
//! **What is not seen.** A fingerprint is FNV-1a of 128 bits, and CRC-32 tells files apart that were changed by accident, not by somebody who means to
//! deceive. Threads, memory and the machine are no part of it, for they are none of the bits but by transforms
//! (`portable` of `[former]`).
//!
//! What the stages do is not here: the command does it.

mod basis;
mod keys;
mod stamp;
mod state;
mod text;

pub use basis::{Basis, fingerprint};
pub use stamp::{FileStamp, stamp};
pub use state::{Made, NAME, State, StateError, Why};
pub use text::{JobError, JobText};

/// A job to start from: every section with its keys and what they mean.
pub const EXAMPLE: &str = include_str!("example.toml");

/// Every key with its kind, default and explanation, as text.
pub fn reference() -> String {
    keys::SCHEMA.reference()
}
