//! `subap man`: a man page in roff.

use crate::args::{self, Man};
use crate::failure::Usage;
use crate::text;

/// Print the man page of the program or of a command.
pub(crate) fn run(typed: &Man) -> anyhow::Result<()> {
    let mut command = args::command();
    command.build();
    let mut name = "subap".to_owned();
    for word in &typed.command {
        let Some(found) = command.find_subcommand(word) else {
            let names: Vec<&str> = command.get_subcommands().map(|c| c.get_name()).collect();
            return Err(Usage(format!(
                "{name} has no command '{word}': expected {}",
                names.join(", ")
            ))
            .into());
        };
        command = found.clone();
        name += &format!("-{word}");
    }
    let mut page = Vec::new();
    clap_mangen::Man::new(command.name(name)).render(&mut page)?;
    text::print(&page)?;
    Ok(())
}
