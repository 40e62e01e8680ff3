//! `subap completions`: print a shell completion script.

use crate::args::{self, Completions};
use crate::text;

/// Print the completion script of a shell.
pub(crate) fn run(typed: &Completions) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(typed.shell, &mut args::command(), "subap", &mut script);
    text::print(&script)?;
    Ok(())
}
