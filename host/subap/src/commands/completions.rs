//! `subap completions`: what a shell needs to complete our options.

use clap::CommandFactory;

use crate::args::{Args, Completions};
use crate::text;

/// Prints the script.
pub(crate) fn run(typed: &Completions) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(typed.shell, &mut Args::command(), "subap", &mut script);
    text::print(&script)?;
    Ok(())
}
