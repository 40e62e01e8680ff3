//! Opening a page in the default browser.

use std::process::{Child, Command, Stdio};

use crate::messages;

/// Program that opens a URL, and its arguments before the URL.
const OPENER: (&str, &[&str]) = if cfg!(target_os = "macos") {
    ("open", &[])
} else if cfg!(windows) {
    // `start` takes its first quoted argument as the title of a window.
    ("cmd", &["/C", "start", ""])
} else {
    ("xdg-open", &[])
};

/// Started opener.
pub(super) struct Browser(Child);

impl Browser {
    /// Open a URL. Failure is a warning.
    pub(super) fn open(url: &str) -> Option<Self> {
        let (program, arguments) = OPENER;
        let mut command = Command::new(program);
        command.args(arguments).arg(url);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        match command.spawn() {
            Ok(child) => Some(Self(child)),
            Err(error) => {
                failed(&format!("cannot run {program}: {error}"));
                None
            }
        }
    }

    /// Whether the opener has ended; warns if it failed.
    pub(super) fn has_ended(&mut self) -> bool {
        match self.0.try_wait() {
            Ok(None) => false,
            Ok(Some(status)) => {
                if !status.success() {
                    failed(&format!("{} ended with {status}", OPENER.0));
                }
                true
            }
            Err(_) => true,
        }
    }
}

fn failed(reason: &str) {
    messages::warning(format!(
        "--open: no browser was opened ({reason}); open the URL by hand"
    ));
}
