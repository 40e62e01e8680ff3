//! Options of every command.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

use super::values::{size, threads};
use crate::log::Format;

/// Options of every command.
#[derive(Debug, Group)]
pub(crate) struct Global {
    /// Number of threads [default: one per processor]
    #[arg(long, global = true, hide_short_help = true, value_name = "N", value_parser = threads, help_heading = "Global options")]
    pub(crate) threads: Option<usize>,

    /// Memory limit of the process: bytes, or with K, M, G or T (powers of 1024); at least 24M and 1M per thread; 16M
    /// and 1M per thread are the program's own [default: half of the machine's memory]
    #[arg(long, global = true, hide_short_help = true, value_name = "SIZE", value_parser = size, help_heading = "Global options")]
    pub(crate) memory: Option<u64>,

    /// Print more on standard error; give it twice for all settings
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Global options")]
    pub(crate) verbose: u8,

    /// Print only results, warnings and errors: no progress, no notes
    #[arg(
        short,
        long,
        global = true,
        conflicts_with = "verbose",
        help_heading = "Global options"
    )]
    pub(crate) quiet: bool,

    /// Print the result as one JSON object on standard output
    #[arg(long, global = true, help_heading = "Global options")]
    pub(crate) json: bool,

    /// Append a log with times to this file: notes, warnings, settings, progress, durations
    #[arg(long, global = true, hide_short_help = true, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Global options")]
    pub(crate) log: Option<PathBuf>,

    /// Format of the log: text, or JSON with one object per line [default: JSON if FILE ends in .json or .jsonl]
    #[arg(
        long,
        global = true,
        value_enum,
        hide_short_help = true,
        requires = "log",
        help_heading = "Global options"
    )]
    pub(crate) log_format: Option<Format>,
}
