//! Progress bars on standard error, with time left; nothing where standard error is no terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use subaperture::focus::Monitor;

use crate::interrupt;

/// Steps of a full bar.
const FULL: u64 = 1000;

/// One stretch of long work. Asks for its end when Ctrl-C was pressed; vanishes when finished or dropped.
pub(crate) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar called `what`; none to see if `quiet`.
    pub(crate) fn new(what: &str, quiet: bool) -> Self {
        // indicatif draws nothing if standard error is not a terminal.
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr()
        };
        let style = ProgressStyle::with_template("{msg:>16} {wide_bar} {percent:>3} %  {eta} left")
            .expect("the template is well-formed");
        let bar = ProgressBar::with_draw_target(Some(FULL), target)
            .with_style(style)
            .with_message(what.to_owned());
        Self { bar }
    }

    /// What is called on the bar from now on.
    pub(crate) fn tell(&self, what: String) {
        self.bar.set_message(what);
    }

    /// The next stretch, from nothing, called `what`.
    pub(crate) fn begin(&self, what: String) {
        self.bar.set_message(what);
        self.bar.set_position(0);
    }

    /// Prints a line above the bar.
    pub(crate) fn print(&self, line: &str) {
        self.bar.suspend(|| eprintln!("{line}"));
    }

    /// Takes the bar off the screen.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Monitor for Progress {
    fn progress(&self, fraction: f64) {
        let position = (fraction.clamp(0.0, 1.0) * FULL as f64) as u64;
        // Threads report out of order; the bar only grows.
        if position > self.bar.position() {
            self.bar.set_position(position);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::pressed()
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
