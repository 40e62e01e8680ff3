//! `subap completions`: what a shell needs to complete our options.

use std::io::{Write, stdout};

use clap::CommandFactory;

use crate::args::{Args, Completions};

/// Prints the script.
pub(crate) fn run(typed: &Completions) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(typed.shell, &mut Args::command(), "subap", &mut script);
    stdout().write_all(&script)?;
    Ok(())
}
