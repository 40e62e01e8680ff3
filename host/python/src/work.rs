//! Long work: without the interpreter lock, with progress and interruption.

use std::panic::resume_unwind;
use std::process;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use subaperture::monitor::Monitor;

use crate::errors::{Class, Error};

/// Interval of progress reports and of checks for Ctrl-C.
const INTERVAL: Duration = Duration::from_millis(100);

/// Process whose first work started the threads of the library.
static STARTED_BY: OnceLock<u32> = OnceLock::new();

/// Fail in a process that was forked from one with threads: threads are not forked, and it would wait forever.
fn check_process() -> Result<(), Error> {
    let own = process::id();
    match *STARTED_BY.get_or_init(|| own) == own {
        true => Ok(()),
        false => Err(Error::new(
            Class::Unsuited,
            "expected a process of its own start, found one forked after work with subaperture: use multiprocessing with \
             the start method 'spawn' or 'forkserver'",
        )),
    }
}

/// Finished fraction and request to stop, shared with the threads of the work.
#[derive(Default)]
struct Shared {
    /// Bits of the largest fraction reported. Those of non-negative floats are in the order of the numbers.
    fraction: AtomicU64,
    cancelled: AtomicBool,
}

impl Monitor for Shared {
    fn progress(&self, fraction: f64) {
        self.fraction
            .fetch_max(fraction.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Run `work` in a thread of its own. Meanwhile the calling thread passes the finished fraction to `progress` and handles signals, each
/// 0.1 s; an exception of either cancels the work and is raised when the work has stopped.
///
/// # Errors
/// Those of `work`, an exception of `progress`, `KeyboardInterrupt`, and an error in a forked process.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&dyn Monitor) -> Result<T, Error> + Send,
) -> Result<T, Error> {
    check_process()?;
    let shared = Shared::default();
    let report = |py: Python<'_>, fraction: f64| match &progress {
        Some(progress) => progress.call1(py, (fraction,)).map(drop),
        None => Ok(()),
    };
    let finished = py.detach(|| {
        thread::scope(|scope| {
            let (done, ended) = channel();
            let (monitor, mut raised) = (&shared, None);
            let worker = scope.spawn(move || {
                let result = work(monitor);
                let _ = done.send(());
                result
            });
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(INTERVAL) {
                if raised.is_some() {
                    continue;
                }
                let fraction = f64::from_bits(shared.fraction.load(Ordering::Relaxed));
                let heard = Python::attach(|py| {
                    py.check_signals()?;
                    report(py, fraction)
                });
                if let Err(error) = heard {
                    shared.cancelled.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
            let result = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            raised.map_or(result, |error| Err(error.into()))
        })
    })?;
    report(py, 1.0)?;
    Ok(finished)
}
