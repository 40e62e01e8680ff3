//! Options of `subap completions` and `subap man`.

use clap::Args as Group;

/// `subap completions`.
#[derive(Debug, Group)]
pub(crate) struct Completions {
    /// Shell for which completions are printed
    #[arg(value_enum)]
    pub(crate) shell: clap_complete::Shell,
}

/// `subap man`.
#[derive(Debug, Group)]
pub(crate) struct Man {
    /// Command with its subcommand, such as plan focus [default: subap]
    pub(crate) command: Vec<String>,
}
