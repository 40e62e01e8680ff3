//! Everything that is said on standard error: errors, warnings, notes, and lines of progress. Results go to
//! standard output, by way of [`crate::text::say`].
//!
//! | kind | begins with | `-q` | in records |
//! |---|---|---|---|
//! | error | `error:` | shown | |
//! | warning | `warning:` | shown | under `warnings` |
//! | note, detail of `-v` | `note:` | not shown | |
//! | progress | what is at work | not shown | |
//!
//! A reader of standard error that has gone is no reason to stop.

use std::io::{self, IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};

use indicatif::WeakProgressBar;

static TOLD: Mutex<Told> = Mutex::new(Told {
    quiet: false,
    verbosity: 0,
    warnings: Vec::new(),
    bound_is_missed: false,
    bar: None,
});

/// What was said, and what may be.
struct Told {
    quiet: bool,
    verbosity: u8,
    /// Every warning once, in the order of their coming.
    warnings: Vec<String>,
    bound_is_missed: bool,
    /// The bar on the screen, which makes room for lines.
    bar: Option<WeakProgressBar>,
}

fn told() -> MutexGuard<'static, Told> {
    TOLD.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Told {
    /// A line, or several, on standard error.
    fn print(&self, text: &str) {
        let write = || {
            let _ = writeln!(io::stderr().lock(), "{text}");
        };
        match self.bar.as_ref().and_then(WeakProgressBar::upgrade) {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }
}

/// How much is to be said: `-q`, and how often `-v`.
pub(crate) fn set_up(quiet: bool, verbosity: u8) {
    let mut told = told();
    told.quiet = quiet;
    told.verbosity = verbosity;
}

/// What ends the command.
pub(crate) fn error(text: &str) {
    told().print(&format!("error: {text}"));
}

/// What the user has to know of a result that is not all it seems; said once, and kept for the records.
pub(crate) fn warning(text: impl Into<String>) {
    let (mut told, text) = (told(), text.into());
    if told.warnings.contains(&text) {
        return;
    }
    told.print(&format!("warning: {text}"));
    told.warnings.push(text);
}

/// A warning that a result misses the bound asked for: done all the same, and told by the exit status.
pub(crate) fn bound_missed(text: impl Into<String>) {
    warning(text);
    told().bound_is_missed = true;
}

/// What may be good to know.
pub(crate) fn note(text: &str) {
    let told = told();
    if !told.quiet {
        told.print(&format!("note: {text}"));
    }
}

/// What `-v` given `level` times shows.
pub(crate) fn detail(level: u8, text: impl FnOnce() -> String) {
    let told = told();
    if told.verbosity >= level {
        told.print(&format!("note: {}", text()));
    }
}

/// A line of progress, where no bar shows it.
pub(crate) fn progress(text: &str) {
    let told = told();
    if !told.quiet && !io::stderr().is_terminal() {
        told.print(text);
    }
}

/// Every warning so far.
pub(crate) fn warnings() -> Vec<String> {
    told().warnings.clone()
}

/// Whether a result missed its bound.
pub(crate) fn bound_is_missed() -> bool {
    told().bound_is_missed
}

/// The bar that is on the screen from now on.
pub(crate) fn show_bar(bar: Option<WeakProgressBar>) {
    told().bar = bar;
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
