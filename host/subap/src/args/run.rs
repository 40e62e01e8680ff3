//! `subap run`.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

use super::values::setting;
use super::{Rehearsal, Writing};

/// `subap run`.
#[derive(Debug, Group)]
#[command(after_help = "First steps:\n  \
    subap run --example > job.toml\n  \
    subap run job.toml --dry-run\n  \
    subap run job.toml\n\n\
    The same command resumes an interrupted run, and after a change of the job runs only the stages that depend on it.")]
pub(crate) struct Run {
    /// Job in TOML; see --keys and --example
    #[arg(value_name = "JOB", value_hint = ValueHint::FilePath, required_unless_present_any = ["keys", "example"])]
    pub(crate) job: Option<PathBuf>,

    // Not a doc comment, in which brackets are a link.
    #[arg(
        long,
        value_name = "KEY=VALUE",
        value_parser = setting,
        help = "Override a key of the job, such as former.error=\"-50 dB\". May be repeated"
    )]
    pub(crate) set: Vec<(String, String)>,

    /// Print every key of a job with its unit, default and meaning
    #[arg(long, conflicts_with_all = ["job", "example"])]
    pub(crate) keys: bool,

    /// Print an example job with all keys
    #[arg(long, conflicts_with_all = ["job"])]
    pub(crate) example: bool,

    #[command(flatten)]
    pub(crate) writing: Writing,

    #[command(flatten)]
    pub(crate) rehearsal: Rehearsal,
}
