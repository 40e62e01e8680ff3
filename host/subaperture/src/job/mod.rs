//! Processing pipelines from one TOML text: recording, grid, former, autofocus and products.
//!
//! A job is a chain of stages. Each stage declares its dependencies, writes its outputs atomically, and runs once:
//!
//! ```text
//! inputs ─> track | autofocus ─> focus ─┬─> check
//!  (always)       (if in the job)       ├─> picture
//!                                       ├─> quality
//!                                       └─> products ─────> report (of all of them)
//! ```
//!
//! | stage | depends on (and on the program's version) | outputs |
//! |---|---|---|
//! | inputs | | no output: every run reads the recordings completely, for their sizes and CRC-32 |
//! | track | the recordings, `[track]`, its logs | `track.csv`, `track.png` |
//! | autofocus | the recordings, `[grid]`, `[former]`, `[autofocus]` | `correction.csv`, `autofocus.json`, `autofocus.png` |
//! | focus | the recordings, `[grid]`, `[former]`, `[track]`, the files that these name; track or autofocus | `image.zarr`, `image.json`, `image.png` |
//! | check | `[check]`; focus | `check.json` |
//! | picture | `[picture]`; focus | `picture.png` |
//! | quality | `[quality]`; focus | `quality.json`, `quality/` |
//! | products | `[products]`; focus | files by their formats |
//! | report | all | `report.html` |
//!
//! A [`Basis`] lists the dependencies of one stage: its settings, its input files, the fingerprints of the preceding stages and the
//! program's version. Its fingerprint is a digest of these, and so covers all preceding stages. [`State`] is a file in the job's folder,
//! replaced atomically after each stage. It records the basis of every finished stage, and size and CRC-32 of its outputs. A stage
//! is reused if its basis and outputs are unchanged; otherwise [`RunReason`] gives the reason for running it again.
//!
//! **Interruption.** The entry of a stage is removed from the state before its outputs are modified, and is added with the new basis once
//! they are complete. An interrupted stage has no entry and is run again; equal settings give bit-identical outputs. Focusing resumes:
//! finished tiles are marked ([`crate::io::tiles`]), and the state records the fingerprint with which they were begun
//! ([`State::begin`]). Tiles with another fingerprint are discarded.
//!
//! **Limits.** A fingerprint is a 128-bit FNV-1a hash. CRC-32 detects accidental changes of files, not deliberate forgery. Threads, memory and
//! the machine are not part of the basis: they do not change the result, except for the rounding of transforms without `portable` of
//! `[former]`.
//!
//! This module defines stages, their state, and the text of a job. The command `subap run` does the processing, and defines the schema of
//! jobs by the settings of its commands.

mod basis;
mod output;
mod stamp;
mod state;
mod text;

pub use basis::{Basis, fingerprint};
pub use output::StageOutput;
pub use stamp::{FileStamp, stamp};
pub use state::{FinishedStage, NAME, RunReason, State, StateError};
pub use text::{JobError, JobText};
