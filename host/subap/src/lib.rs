//! Command-line program `subap`, which forms focused images from phase history with the library
//! [`subaperture`](https://docs.rs/subaperture).
//!
//! [`run`] is the whole program. The Python package calls it too, so that it provides the same command.
#![forbid(unsafe_code)]

mod advice;
mod ahead;
mod args;
mod arguments;
mod commands;
mod config;
mod failure;
mod html;
mod interrupt;
mod log;
mod memory;
mod messages;
mod progress;
mod stages;
mod terminal;
mod text;
mod watch;

use std::ffi::OsString;

/// Run the command with the arguments of a process, the name of the program first. Returns the exit status.
///
/// Signal handlers, worker threads and limits are those of the whole process, so it is called once.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    arguments::set(arguments);
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
            return code;
        }
    };
    let Some(command) = typed.command else {
        let _ = text::say(args::help());
        return failure::DONE;
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
    status
}
