//! Command-line program `subap`, which forms focused images from phase history with the library
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

fn main() -> ExitCode {
    let typed = match args::parse() {
        Ok(typed) => typed,
        Err(message) => {
            // Help and version go to standard output and are not failures. Neither is a reader that has closed
            // the pipe.
            let code = u8::try_from(message.exit_code()).unwrap_or(failure::WRONG_USAGE);
            let _ = message.print();
            if code != failure::DONE && failure::json_is_asked_for() {
                failure::say_wrong_usage(&message);
            }
            return ExitCode::from(code);
        }
    };
    let Some(command) = typed.command else {
        let _ = text::say(args::help());
        return ExitCode::SUCCESS;
    };
    let json = typed.global.json;
    let done = config::Session::new(&typed.global).and_then(|session| {
        let done = commands::run(&session, command);
        if let Some(bytes) = subaperture::focus::machine::peak_bytes() {
            session.note(1, || format!("peak memory {}", text::bytes(bytes.into())));
        }
        done.map_err(|error| session.memory.explain(error))
    });
    let status = failure::exit_status(done, json);
    messages::end(status);
    ExitCode::from(status)
}
