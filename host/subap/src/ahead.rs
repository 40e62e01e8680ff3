//! Forecast of a command's time and memory: complete with `--dry-run`, otherwise one line if the work is long or large.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};
use subaperture::focus::forecast::Forecast;
use subaperture::focus::{Cost, FormError, ImageFormer, Plan, Task};
use subaperture::io::atomic::free_bytes;
use subaperture::io::npy;
use subaperture::phase_history::PhaseHistory;
use subaperture::planner::forecast::{forecast_of, operations};

use crate::args::Rehearsal;
use crate::config::Session;
use crate::{messages, text};

/// Time above which work counts as long, and disk space above which output counts as large.
const LONG_S: f64 = 10.0;
const LARGE_BYTES: u64 = 1 << 30;

/// Operations per thread above which the time is measured: about 5 s of work. Measuring a part takes up to a second and would
/// only delay shorter work.
const MANY_OPERATIONS: f64 = 1e10;

/// Predicted cost of a piece of work.
pub(crate) struct Ahead {
    /// Description of the work.
    work: String,
    time: Option<Forecast>,
    /// Samples read to form the image and once more to compare it with the exact sum, bytes.
    read_bytes: Option<[u64; 2]>,
    /// Total memory of the process, bytes, approximate.
    memory_bytes: u64,
    /// Output paths with their sizes, bytes.
    disk: Vec<(PathBuf, u64)>,
}

impl Ahead {
    /// Cost of an image by `former` in the folder `out`; `cost` is that of its plan. The time is measured for long work and in every dry run.
    pub(crate) fn of_image(
        session: &Session,
        rehearsal: &Rehearsal,
        (former, cost): (&dyn ImageFormer, &Cost),
        task: &Task,
        out: &Path,
    ) -> Result<Self, FormError> {
        let (grid, pulses) = (task.grid, task.history.collection().pulses.len());
        let pixels = grid.num_pixels();
        let many = MANY_OPERATIONS * session.threads as f64;
        let (mut time, mut buffers_bytes) = (None, 8 * pixels);
        if rehearsal.dry_run || operations(task, cost) > many {
            time = forecast_of(former, task, cost)?;
            let held_bytes = buffers_bytes.saturating_add(cost.bytes(1.0));
            buffers_bytes = held_bytes.min(task.memory_bytes);
        }
        Ok(Self {
            work: format!(
                "{pulses} pulses onto {} x {} pixels by {}",
                grid.columns.count,
                grid.rows.count,
                former.name()
            ),
            time,
            read_bytes: None,
            memory_bytes: session.memory.own_bytes_for(pixels)
                + task.history.held_bytes()
                + buffers_bytes,
            disk: vec![(out.to_owned(), npy::file_bytes(pixels))],
        })
    }

    /// Add the samples that are read to form the image of `plan`, in memory as a `whole` or tile by tile.
    pub(crate) fn with_reading(
        mut self,
        (former, plan): (&dyn ImageFormer, &Plan),
        task: &Task,
        whole: bool,
    ) -> Result<Self, FormError> {
        if task.history.samples_in_memory(0..0).is_none() {
            let collection = task.history.collection();
            let pulse_bytes = 8 * collection.num_samples as u64;
            let pulses_read = plan.pulses_read(former, task, whole)?;
            let each = [pulses_read, collection.pulses.len() as u64];
            self.read_bytes = Some(each.map(|count| count * pulse_bytes));
        }
        Ok(self)
    }

    /// Cost of `work`, which needs so many bytes in addition to the program itself and writes so many to each path of `disk`.
    pub(crate) fn new(
        session: &Session,
        work: String,
        held_bytes: u64,
        time: Option<Forecast>,
        disk: Vec<(PathBuf, u64)>,
    ) -> Self {
        Self {
            work,
            time,
            read_bytes: None,
            memory_bytes: session.memory.own_bytes() + held_bytes,
            disk,
        }
    }

    /// Print the cost. Returns whether this was a dry run.
    pub(crate) fn announce(
        &self,
        session: &Session,
        rehearsal: &Rehearsal,
    ) -> anyhow::Result<bool> {
        if rehearsal.dry_run {
            if session.json() {
                text::say_json("forecast", self.to_json(session))?;
            } else {
                text::say(self.describe(session))?;
            }
            return Ok(true);
        }
        let seconds = self.time.map_or(0.0, |time| time.seconds);
        let bytes: u64 = self.disk.iter().map(|(_, bytes)| bytes).sum();
        if seconds > LONG_S || bytes > LARGE_BYTES {
            let time = match self.time {
                Some(time) => format!("about {} of time and ", duration(time.seconds)),
                None => String::new(),
            };
            let disk = text::bytes(bytes.into());
            messages::note(&format!(
                "this takes {time}{disk} of disk (details: --dry-run)"
            ));
        }
        Ok(false)
    }

    fn to_json(&self, session: &Session) -> Value {
        json!({
            "work": self.work,
            "time_s": self.time.map(|time| time.seconds),
            "measured_s": self.time.map(|time| time.measured_s),
            "threads": session.threads,
            "read_bytes": self.read_bytes.map(|[formed, _]| formed),
            "compared_bytes": self.read_bytes.map(|[_, compared]| compared),
            "memory_bytes": self.memory_bytes,
            "memory_allowed_bytes": session.memory.total_bytes,
            "disk": self.disk.iter().map(|(path, bytes)| json!({
                "path": path.display().to_string(),
                "bytes": bytes,
                "free_bytes": free_bytes(path),
            })).collect::<Vec<_>>(),
        })
    }

    fn describe(&self, session: &Session) -> String {
        let mut lines = vec![format!("{:<16} {}", "work", self.work)];
        lines.push(format!(
            "{:<16} {}",
            "time",
            match self.time {
                Some(time) => format!(
                    "about {}, estimated from {:.1} s of the same work",
                    duration(time.seconds),
                    time.measured_s
                ),
                None => "unknown: no part of this work could be timed".to_owned(),
            }
        ));
        if let Some(read_bytes) = self.read_bytes {
            let [formed, compared] = read_bytes.map(|bytes| text::bytes(bytes.into()));
            lines.push(format!(
                "{:<16} {formed} of samples, and up to {compared} to compare the image with the exact sum",
                "read"
            ));
        }
        lines.push(format!(
            "{:<16} about {}; {} allowed (--memory)",
            "memory",
            text::bytes(self.memory_bytes.into()),
            text::bytes(session.memory.total_bytes.into())
        ));
        for (path, bytes) in &self.disk {
            let free = match free_bytes(path) {
                Some(free) if free < *bytes => {
                    format!("{} free: too little", text::bytes(free.into()))
                }
                Some(free) => format!("{} free", text::bytes(free.into())),
                None => "free space unknown".to_owned(),
            };
            let size = text::bytes((*bytes).into());
            lines.push(format!(
                "{:<16} {size} in {}; {free}",
                "disk",
                path.display()
            ));
        }
        lines.join("\n")
    }
}

/// Format a duration with two digits, the accuracy of an estimate.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => text::duration(Duration::from_secs_f64(s)),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

/// Time to read `history` completely, measured on a part of it.
pub(crate) fn reading(history: &dyn PhaseHistory) -> anyhow::Result<Forecast> {
    let collection = history.collection();
    let width = collection.num_samples;
    Ok(subaperture::focus::forecast::reading(
        collection.pulses.len(),
        width,
        |pulses, samples| history.read(pulses, samples),
    )?)
}
