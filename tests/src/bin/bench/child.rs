//! Measuring processes: this program, or another, with a number of threads and processors and a time limit.

use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;

/// Reason of a missing measurement.
#[derive(Debug)]
pub(crate) enum Failure {
    /// It exceeded the time limit.
    Late(Duration),
    /// It failed with this message.
    Said(String),
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Late(limit) => write!(f, "not measured: takes more than {} s", limit.as_secs()),
            Self::Said(message) => write!(f, "not formed: {message}"),
        }
    }
}

/// Whether processes can be bound to processors.
pub(crate) fn pins() -> bool {
    let mut command = Command::new("taskset");
    command
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// A command for `program` with this number of threads, bound to as many processors where possible. Libraries that read the number of
/// threads from other variables get those too.
pub(crate) fn command(program: &Path, threads: usize) -> Command {
    let mut command = if pins() {
        let mut command = Command::new("taskset");
        command
            .args(["--cpu-list", &format!("0-{}", threads - 1)])
            .arg(program);
        command
    } else {
        Command::new(program)
    };
    let threads = threads.to_string();
    for name in ["RAYON_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"] {
        command.env(name, &threads);
    }
    command.stdin(Stdio::null());
    command
}

/// Run it; the last printed line, parsed as JSON.
///
/// # Errors
/// The reason: it was stopped, or its last line before it failed.
pub(crate) fn run<T: DeserializeOwned>(
    mut command: Command,
    limit: Duration,
) -> Result<T, Failure> {
    let said = |error: std::io::Error| Failure::Said(error.to_string());
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(said)?;
    let outputs = [
        child
            .stdout
            .take()
            .map(|stream| Box::new(stream) as Box<dyn Read + Send>),
        child
            .stderr
            .take()
            .map(|stream| Box::new(stream) as Box<dyn Read + Send>),
    ];
    let readers = outputs.map(|stream| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            // A truncated line fails to parse.
            stream.map(|mut stream| stream.read_to_end(&mut bytes));
            String::from_utf8_lossy(&bytes).into_owned()
        })
    });
    let begun = Instant::now();
    let status = loop {
        match child.try_wait().map_err(said)? {
            Some(status) => break Some(status),
            None if begun.elapsed() > limit => {
                child
                    .kill()
                    .and_then(|()| child.wait().map(drop))
                    .map_err(said)?;
                break None;
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let [out, err] = readers.map(|reader| reader.join().unwrap_or_default());
    let last = |text: &str| text.trim_end().lines().next_back().unwrap_or("").to_owned();
    match status {
        None => Err(Failure::Late(limit)),
        Some(status) if status.success() => serde_json::from_str(&last(&out))
            .map_err(|error| Failure::Said(format!("{error}: {}", last(&out)))),
        Some(status) => Err(Failure::Said(match last(&err) {
            message if message.is_empty() => status.to_string(),
            message => message,
        })),
    }
}
