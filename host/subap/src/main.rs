//! Command-line program `subap`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(subap::run(std::env::args_os()))
}
