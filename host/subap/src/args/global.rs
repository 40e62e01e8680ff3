//! Options of every command.

use std::path::PathBuf;

use clap::{Args as Group, ValueHint};

use super::values::{size, threads};
use crate::log::Format;

/// Options of every command.
#[derive(Debug, Group)]
pub(crate) struct Global {
    /// Threads to work on [default: one a processor]
    #[arg(long, global = true, hide_short_help = true, value_name = "N", value_parser = threads, help_heading = "Global options")]
    pub(crate) threads: Option<usize>,

    /// Memory that the process may take, of which 16M and 1M a thread are the program's own: bytes, or with K,
    /// M, G or T (powers of 1024); 24M and 1M a thread at the least [default: half of what the machine has]
    #[arg(long, global = true, hide_short_help = true, value_name = "SIZE", value_parser = size, help_heading = "Global options")]
    pub(crate) memory: Option<u64>,

    /// Say more on standard error; twice for every setting
    #[arg(short, long, global = true, action = clap::ArgAction::Count, help_heading = "Global options")]
    pub(crate) verbose: u8,

    /// Show no progress and no notes: only results, warnings and errors
    #[arg(
        short,
        long,
        global = true,
        conflicts_with = "verbose",
        help_heading = "Global options"
    )]
    pub(crate) quiet: bool,

    /// Print results as JSON, one object, on standard output
    #[arg(long, global = true, help_heading = "Global options")]
    pub(crate) json: bool,

    /// Append to this file, with the times, all that is said and shown: notes, warnings, settings, progress,
    /// how long what took
    #[arg(long, global = true, hide_short_help = true, value_name = "FILE", value_hint = ValueHint::FilePath, help_heading = "Global options")]
    pub(crate) log: Option<PathBuf>,

    /// Write the log as text or as JSON, an object a line [default: JSON if FILE ends in .json or .jsonl]
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
