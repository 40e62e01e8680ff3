//! Tasks of `cargo xtask` that need the library: fuzzing, and the module's report.
#![forbid(unsafe_code)]

mod fuzz;
mod module;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["fuzz", target, seconds] => fuzz::run(target, seconds),
        ["module-report"] => module::report(false),
        ["module-report", "--check"] => module::report(true),
        _ => {
            eprintln!("these are called by  cargo xtask help");
            ExitCode::from(2)
        }
    }
}
