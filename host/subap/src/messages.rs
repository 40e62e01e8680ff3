//! Output on standard error: errors, warnings, notes and progress lines. Results go to standard output by
//! [`crate::text::say`].
//!
//! | kind | begins with | `-q` | in records |
//! |---|---|---|---|
//! | error | `error:` | shown | |
//! | warning | `warning:` | shown | under `warnings` |
//! | note, detail of `-v` | `note:` | not shown | |
//! | progress | the current work | not shown | |
//!
//! All messages and results are also written to the log, if there is one (see [`crate::log`]), shown or not.
//!
//! A closed standard error does not stop the run.

use std::io::{self, IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::WeakProgressBar;
use serde_json::{Map, Value, json};
use subaperture::quantity::seconds;

use crate::log::Log;
use crate::terminal::printable;

static STATE: Mutex<State> = Mutex::new(State {
    begun: None,
    quiet: false,
    verbosity: 0,
    warnings: Vec::new(),
    shown: Vec::new(),
    part_missed: false,
    bound_is_missed: false,
    has_result: false,
    bar: None,
    log: None,
});

/// Messages so far, and which kinds are shown.
struct State {
    begun: Option<Instant>,
    quiet: bool,
    verbosity: u8,
    /// Distinct warnings of the current step, in order.
    warnings: Vec<String>,
    /// Distinct warnings shown so far.
    shown: Vec<String>,
    /// Whether a result of the current step exceeds its bound.
    part_missed: bool,
    bound_is_missed: bool,
    /// Whether a result was printed on standard output.
    has_result: bool,
    /// Progress bar on the screen, which is moved for other lines.
    bar: Option<WeakProgressBar>,
    log: Option<Log>,
}

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl State {
    /// Print one or more lines on standard error.
    fn print(&self, text: &str) {
        let text = printable(text);
        let write = || {
            let _ = writeln!(io::stderr().lock(), "{text}");
        };
        match self.bar.as_ref().and_then(WeakProgressBar::upgrade) {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Append to the log; `more` is an object. If the log cannot be written, it ends and the work continues.
    fn log(&mut self, kind: &str, message: &str, more: Value) {
        let more = match more {
            Value::Object(more) => more,
            _ => Map::new(),
        };
        let Some(log) = &mut self.log else { return };
        if let Err(error) = log.write(kind, message, more) {
            self.log = None;
            let text = format!("the log ends here because it cannot be written: {error}");
            self.print(&format!("warning: {text}"));
            self.warnings.push(text);
        }
    }
}

/// Set the verbosity (`-q`, number of `-v`) and the log.
pub(crate) fn set_up(quiet: bool, verbosity: u8, log: Option<Log>) {
    let mut state = state();
    state.begun = Some(Instant::now());
    state.quiet = quiet;
    state.verbosity = verbosity;
    state.log = log;
}

/// Print the error that ends the command.
pub(crate) fn error(text: &str) {
    let mut state = state();
    state.print(&format!("error: {text}"));
    state.log("error", text, Value::Null);
}

/// Warn of a limitation of a result. A warning is shown once, and kept for the records.
pub(crate) fn warning(text: impl Into<String>) {
    let (mut state, text) = (state(), text.into());
    if !state.shown.contains(&text) {
        state.print(&format!("warning: {text}"));
        state.log("warning", &text, Value::Null);
        state.shown.push(text.clone());
    }
    if !state.warnings.contains(&text) {
        state.warnings.push(text);
    }
}

/// Warn that a result exceeds the error bound; the exit status reports it as well.
pub(crate) fn bound_missed(text: impl Into<String>) {
    warning(text);
    let mut state = state();
    state.bound_is_missed = true;
    state.part_missed = true;
}

/// Print a note, unless `-q` is given.
pub(crate) fn note(text: &str) {
    let mut state = state();
    if !state.quiet {
        state.print(&format!("note: {text}"));
    }
    state.log("note", text, Value::Null);
}

/// Print a detail, shown if `-v` is given at least `level` times.
pub(crate) fn detail(level: u8, text: impl FnOnce() -> String) {
    let mut state = state();
    let shown = state.verbosity >= level;
    if shown || state.log.is_some() {
        let text = text();
        if shown {
            state.print(&format!("note: {text}"));
        }
        state.log("note", &text, Value::Null);
    }
}

/// Print a chosen setting, shown if `-v` is given twice.
pub(crate) fn setting(key: &str, value: &Value) {
    let mut state = state();
    let text = format!("{key} = {value}");
    if state.verbosity >= 2 {
        state.print(&format!("note: {text}"));
    }
    state.log("setting", &text, json!({ "key": key, "value": value }));
}

/// Log what was printed on standard output.
pub(crate) fn result(text: &str) {
    let mut state = state();
    state.has_result = true;
    state.log("result", text, Value::Null);
}

/// Whether a result was printed on standard output.
pub(crate) fn has_result() -> bool {
    state().has_result
}

/// Begin the log of a run.
pub(crate) fn begin(more: Value) {
    let words: Vec<&str> = more["command_line"]
        .as_array()
        .map_or_else(Vec::new, |words| {
            words.iter().filter_map(Value::as_str).collect()
        });
    state().log("begin", &words.join(" "), more.clone());
}

/// Log the end of the run.
pub(crate) fn end(exit_status: u8) {
    let mut state = state();
    let elapsed = state.begun.map_or(Duration::ZERO, |begun| begun.elapsed());
    let text = format!(
        "exit status {exit_status} after {}",
        seconds(elapsed.as_secs_f64())
    );
    let more = json!({ "exit_status": exit_status, "elapsed_s": elapsed.as_secs_f64() });
    state.log("end", &text, more);
}

/// Print a line of progress where no bar is shown.
pub(crate) fn progress(text: &str, work: &str, fraction: Option<f64>, elapsed: Duration) {
    let mut state = state();
    if !state.quiet && !io::stderr().is_terminal() {
        state.print(text);
    }
    let more = json!({ "work": work, "fraction": fraction, "elapsed_s": elapsed.as_secs_f64() });
    state.log("progress", text, more);
}

/// Log the duration of a piece of work.
pub(crate) fn timing(work: &str, elapsed: Duration) {
    let text = format!("{work} took {}", seconds(elapsed.as_secs_f64()));
    let more = json!({ "work": work, "elapsed_s": elapsed.as_secs_f64() });
    state().log("timing", &text, more);
}

/// Seconds since the start.
pub(crate) fn run_time_s() -> f64 {
    let begun = state().begun;
    begun.map_or(0.0, |begun| begun.elapsed().as_secs_f64())
}

/// All warnings so far of the current step.
pub(crate) fn warnings() -> Vec<String> {
    state().warnings.clone()
}

/// Warnings and bound of a step.
pub(crate) struct Part {
    pub(crate) warnings: Vec<String>,
    pub(crate) bound_missed: bool,
}

/// End a step of the work, and return its warnings. They do not count for the next step.
pub(crate) fn part() -> Part {
    let mut state = state();
    Part {
        warnings: std::mem::take(&mut state.warnings),
        bound_missed: std::mem::take(&mut state.part_missed),
    }
}

/// Set the warnings of the current step without showing them again.
pub(crate) fn keep(warnings: Vec<String>) {
    state().warnings = warnings;
}

/// Whether a result exceeds its bound.
pub(crate) fn bound_is_missed() -> bool {
    state().bound_is_missed
}

/// Set the progress bar on the screen.
pub(crate) fn show_bar(bar: Option<WeakProgressBar>) {
    state().bar = bar;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_is_kept_once() {
        warning("the track has gaps");
        warning("the track has gaps");
        let kept = warnings();
        assert_eq!(
            kept.iter().filter(|w| *w == "the track has gaps").count(),
            1
        );
    }
}
