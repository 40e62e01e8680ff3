//! Capture into a folder: sweeps, their repetition after faults, and the end.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::error::VnaError;
use super::fault::Fault;
use super::folder::{Folder, MOST_SWEEPS, Record};
use super::instrument::{Failure, Instrument, Sweep};
use super::settings::{Mode, VnaExperiment};

/// Longest time until a request to stop is noticed.
const NOTICE: Duration = Duration::from_millis(20);

/// Why a capture ended.
#[derive(Debug)]
pub enum Ended {
    /// All sweeps are complete.
    Done,
    /// A stop was requested.
    Stopped,
    /// An error, after which the sweeps before it remain.
    Failed(VnaError),
}

/// Summary of a capture.
#[derive(Debug)]
pub struct Summary {
    /// Reason for the end.
    pub ended: Ended,
    /// Sweeps recorded in this run.
    pub new_sweeps: u64,
    /// Record of the folder, with all sweeps and faults.
    pub record: Record,
}

/// Capture into the folder `path`, which is new or that of an earlier capture with the same settings. In [`Mode::Enter`], `next` is called before
/// each sweep with its number, and ends the capture by `false`. `seen` is called after each sweep with the number of sweeps.
///
/// # Errors
/// If the folder does not fit. Later errors are in [`Summary::ended`].
pub fn capture(
    experiment: &VnaExperiment,
    path: &Path,
    next: &mut dyn FnMut(u64) -> bool,
    seen: &mut dyn FnMut(u64),
    stop: &AtomicBool,
) -> Result<Summary, VnaError> {
    let folder = Folder::open(path, experiment)?;
    let before = folder.count();
    let most = match experiment.sweeps {
        0 => MOST_SWEEPS,
        sweeps => sweeps,
    };
    if before >= most {
        return Err(VnaError::Folder(format!(
            "{}: all {before} sweeps are captured: raise plan.sweeps to continue, or choose another folder",
            path.display()
        )));
    }
    let mut run = Run {
        experiment,
        folder,
        instrument: None,
        stop,
    };
    let mut ended = match run.all(most, next, seen) {
        Ok(true) => Ended::Done,
        Ok(false) => Ended::Stopped,
        Err(error) => Ended::Failed(error),
    };
    let state = match ended {
        Ended::Done => "done",
        Ended::Stopped => "stopped",
        Ended::Failed(_) => "failed",
    };
    if let Err(error) = run.folder.finish(state)
        && !matches!(ended, Ended::Failed(_))
    {
        ended = Ended::Failed(error);
    }
    Ok(Summary {
        ended,
        new_sweeps: run.folder.count() - before,
        record: run.folder.record,
    })
}

struct Run<'a> {
    experiment: &'a VnaExperiment,
    folder: Folder<'a>,
    instrument: Option<Instrument<'a>>,
    stop: &'a AtomicBool,
}

impl Run<'_> {
    fn stops(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
    }

    /// Wait until `until`, or a stop is requested.
    fn wait(&self, until: Instant) {
        while !self.stops() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return;
            }
            sleep(left.min(NOTICE));
        }
    }

    /// Measure all sweeps; `false` if a stop was requested.
    fn all(
        &mut self,
        most: u64,
        next: &mut dyn FnMut(u64) -> bool,
        seen: &mut dyn FnMut(u64),
    ) -> Result<bool, VnaError> {
        // Before the first stop, so that the operator knows that the analyser is ready.
        self.connected()?;
        let mut begun = None;
        while self.folder.count() < most {
            match (self.experiment.scan.mode, begun) {
                (Mode::Enter, _) if !self.stops() && !next(self.folder.count()) => {
                    return Ok(false);
                }
                (Mode::Interval(seconds), Some(begun)) => {
                    // At most the time representable by the clock.
                    let interval = Duration::from_secs_f64(seconds.min(1e9));
                    self.wait(begun + interval);
                }
                _ => {}
            }
            if self.stops() {
                return Ok(false);
            }
            begun = Some(Instant::now());
            let Some(sweep) = self.repeated()? else {
                return Ok(false);
            };
            self.folder.put(&sweep)?;
            seen(self.folder.count());
        }
        Ok(true)
    }

    /// Measure a sweep, again after faults; `None` if a stop was requested meanwhile.
    fn repeated(&mut self) -> Result<Option<Sweep>, VnaError> {
        let mut attempts = 0;
        loop {
            if !self.connected()? {
                return Ok(None);
            }
            let Some(instrument) = &mut self.instrument else {
                return Ok(None);
            };
            let faults = match instrument.sweep() {
                Ok(sweep) => return Ok(Some(sweep)),
                Err(faults) => faults,
            };
            attempts += 1;
            self.folder.note(&faults)?;
            if faults.iter().any(|fault| fault.kind.needs_reconnection()) {
                self.instrument = None;
            }
            if attempts > self.experiment.analyser.retries {
                return Err(self.failed(attempts, faults));
            }
            if self.stops() {
                return Ok(None);
            }
        }
    }

    fn failed(&self, attempts: u32, mut faults: Vec<Fault>) -> VnaError {
        let sweep = self.folder.count();
        match faults.pop() {
            Some(fault) => VnaError::Sweep {
                sweep,
                attempts,
                fault,
            },
            None => VnaError::Refused("no attempt to connect".to_owned()),
        }
    }

    /// Connect if there is no connection; `false` if a stop was requested meanwhile.
    fn connected(&mut self) -> Result<bool, VnaError> {
        let analyser = &self.experiment.analyser;
        let mut last = Vec::new();
        for attempt in 0..analyser.connections {
            if self.instrument.is_some() {
                return Ok(true);
            }
            if attempt > 0 {
                self.wait(Instant::now() + Duration::from_secs_f64(analyser.pause_s));
            }
            if self.stops() {
                return Ok(false);
            }
            let is_again = self.folder.has_begun();
            let mut earlier = Vec::new();
            match Instrument::open(analyser, &mut earlier) {
                Ok(instrument) => {
                    self.folder
                        .begin(&instrument.identity, instrument.sweep_s)?;
                    self.instrument = Some(instrument);
                }
                Err(Failure::Refused(message)) => return Err(VnaError::Refused(message)),
                Err(Failure::Faults(faults)) => {
                    self.folder.note(&faults)?;
                    last = faults;
                }
            }
            // Errors from before the capture are no faults of it.
            if is_again {
                self.folder.note(&earlier)?;
            }
        }
        match self.instrument {
            Some(_) => Ok(true),
            None => Err(self.failed(analyser.connections, last)),
        }
    }
}
