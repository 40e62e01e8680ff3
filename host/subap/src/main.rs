//! The command `subap`: from phase history to a focused image. The library behind it is the crate
//! [`subaperture`](https://docs.rs/subaperture).
#![forbid(unsafe_code)]

mod advice;
mod ahead;
mod args;
mod commands;
mod config;
mod failure;
mod interrupt;
mod log;
mod memory;
mod messages;
mod progress;
mod stages;
mod terminal;
mod text;
mod watch;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let typed = match args::Args::try_parse() {
        Ok(typed) => typed,
        Err(message) => {
            // Help and version are on standard output and no failure. A reader that has gone is
            // none either.
            let code = u8::try_from(message.exit_code()).unwrap_or(failure::WRONG_USAGE);
            let _ = message.print();
            return ExitCode::from(code);
        }
    };
    let Some(command) = typed.command else {
        let _ = text::say(args::help());
        return ExitCode::SUCCESS;
    };
    let done = config::Session::new(&typed.global).and_then(|session| {
        let done = commands::run(&session, command);
        if let Some(bytes) = subaperture::focus::machine::peak_bytes() {
            session.note(1, || {
                format!("{} of memory at the most", text::bytes(bytes.into()))
            });
        }
        done.map_err(|error| session.memory.explain(error))
    });
    let status = failure::exit_status(done);
    messages::end(status);
    ExitCode::from(status)
}
