//! Resolution of the command line into threads, memory and recordings.

use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::convention::INFERENCE;
use subaperture::geometry::ImageGrid;
use subaperture::io::claim::OutputClaims;
use subaperture::io::open::{Options, open_all, open_joined_channels, open_sum};
use subaperture::module::plan::ModuleProduct;
use subaperture::phase_history::{Joined, PhaseHistory, ReadError};
use subaperture::resolution::survey::Survey;

use crate::args::{self, Global};
use crate::arguments::arguments;
use crate::memory::Memory;
use crate::progress::Progress;
use crate::{interrupt, log, messages, text};

/// Default error bound, dB.
pub(crate) const DEFAULT_ERROR_DB: f64 = -60.0;

/// Default error bound of maps, dB. It is lower than that of images because image formation from maps adds its own error.
const DEFAULT_MAPS_ERROR_DB: f64 = -66.0;

/// Default error bound of maps for detections, dB. Detection needs no phase across sub-CPIs.
const DEFAULT_DETECTIONS_ERROR_DB: f64 = -40.0;

/// Error bound of an embedded module's maps for this product, dB: `given`, or the default.
pub(crate) fn module_error_db(given: Option<f64>, product: ModuleProduct) -> f64 {
    given.unwrap_or(match product {
        ModuleProduct::Maps | ModuleProduct::Image => DEFAULT_MAPS_ERROR_DB,
        ModuleProduct::Detections => DEFAULT_DETECTIONS_ERROR_DB,
    })
}

/// Advice on a default grid that does not cover the whole scene.
pub(crate) const OTHER_GRID: &str = "give --grid for another part or for all of it";

/// Settings shared by all commands.
#[derive(Clone, Copy)]
pub(crate) struct Session {
    /// Number of worker threads.
    pub(crate) threads: usize,
    /// Memory for images, samples and scratch together, bytes.
    pub(crate) memory_bytes: u64,
    /// Division of the total memory.
    pub(crate) memory: Memory,
    verbosity: u8,
    quiet: bool,
    json: bool,
    silent: bool,
}

impl Session {
    /// Set up threads, memory budget, log and signal handling.
    pub(crate) fn new(global: &Global) -> anyhow::Result<Self> {
        let log = global.log.as_deref().map(|path| {
            let format = global.log_format.unwrap_or(log::Format::of(path));
            log::Log::open(path, format)
        });
        messages::set_up(global.quiet, global.verbose, log.transpose()?);
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(threads) = global.threads {
            pool = pool.num_threads(threads);
        }
        pool.build_global()
            .with_context(|| no_threads(global.threads))?;
        interrupt::listen();
        let threads = rayon::current_num_threads();
        let memory = Memory::new(global.memory, threads)?;
        if let Some(requested) = memory.requested_bytes {
            messages::warning(format!(
                "--memory {} exceeds the memory of this machine: {} is used",
                text::bytes(requested.into()),
                text::bytes(memory.total_bytes.into())
            ));
        }
        let session = Self {
            threads,
            memory_bytes: memory.work_bytes,
            memory,
            verbosity: global.verbose,
            quiet: global.quiet,
            json: global.json,
            silent: false,
        };
        messages::begin(json!({
            "command_line": command_line(),
            "version": env!("CARGO_PKG_VERSION"),
            "threads": session.threads,
            "memory_bytes": session.memory_bytes,
        }));
        session.note(1, || {
            format!(
                "{} threads, memory limit {} including {} for images and samples",
                session.threads,
                text::bytes(session.memory.total_bytes.into()),
                text::bytes(session.memory_bytes.into())
            )
        });
        Ok(session)
    }

    /// Print a note if `-v` is given at least `level` times.
    pub(crate) fn note(&self, level: u8, line: impl FnOnce() -> String) {
        messages::detail(level, line);
    }

    /// Open the given recordings as one aperture within the budget; several channels as their coherent sum.
    pub(crate) fn open(&self, input: &args::Input) -> Result<Joined, ReadError> {
        let options = self.options(input);
        let reading = self.progress("reading");
        let history = match &input.channels {
            None => open_all(&input.files, &options)?,
            Some(several) => open_sum(&input.files, several.named(), &options)?,
        };
        reading.finish();
        report_reading(&history);
        Ok(history)
    }

    /// Options for opening the given recordings within the budget.
    fn options<'i>(&self, input: &'i args::Input) -> Options<'i> {
        Options {
            channel: input.channel.as_deref(),
            memory_bytes: self.memory_bytes,
            settings: &input.set,
            inference: Some(INFERENCE),
        }
    }

    /// Open the channels that an embedded module processes for this product: one, or several for detections.
    pub(crate) fn open_for_module(
        &self,
        input: &args::Input,
        product: ModuleProduct,
    ) -> anyhow::Result<Vec<Box<dyn PhaseHistory>>> {
        let Some(several) = &input.channels else {
            return Ok(vec![Box::new(self.open(input)?)]);
        };
        if product != ModuleProduct::Detections {
            input.refuse_several(&format!("--send {}", product.name()))?;
        }
        let reading = self.progress("reading");
        let channels = open_joined_channels(&input.files, several.named(), &self.options(input))?;
        reading.finish();
        report_reading(channels.channel(0));
        Ok((channels.into_inner().into_iter())
            .map(|(_, history)| history)
            .collect())
    }

    /// Start the claims on output files of a command that reads `inputs`. Claims last until the command ends.
    pub(crate) fn claims<P: AsRef<Path>>(
        &self,
        writing: &args::Writing,
        inputs: &[P],
    ) -> OutputClaims {
        OutputClaims::new(inputs, writing.force)
    }

    /// Progress display for a named piece of work.
    pub(crate) fn progress(&self, work: &str) -> Progress {
        Progress::new(work, self.quiet)
    }

    /// Number of times `-v` was given.
    pub(crate) fn verbosity(&self) -> u8 {
        self.verbosity
    }

    /// Whether results are printed as JSON.
    pub(crate) fn json(&self) -> bool {
        self.json && !self.silent
    }

    /// Whether results are printed as text.
    pub(crate) fn prints_text(&self) -> bool {
        !(self.json || self.silent)
    }

    /// Whether progress is shown on standard error.
    pub(crate) fn shows_progress(&self) -> bool {
        !(self.quiet || self.json || self.silent)
    }

    /// Session for a step of a larger command, which prints no results of its own.
    pub(crate) fn silent(&self) -> Self {
        Self {
            silent: true,
            ..*self
        }
    }

    /// `given`, or the default grid of a collection.
    pub(crate) fn grid(
        &self,
        given: Option<&ImageGrid>,
        survey: &Survey,
    ) -> anyhow::Result<ImageGrid> {
        given.map_or_else(|| self.default_grid(survey), |grid| Ok(grid.clone()))
    }

    /// Default grid of a collection; notes the parts left out and which ambiguities it contains.
    pub(crate) fn default_grid(&self, survey: &Survey) -> anyhow::Result<ImageGrid> {
        let suited = survey.default_grid()?;
        if let Some(ambiguity) = survey.ambiguity() {
            messages::warning(ambiguity);
        }
        if let Some(cropped) = suited.cropped {
            messages::note(&format!("{cropped}: {OTHER_GRID}"));
        }
        Ok(suited.grid)
    }

    /// Check that `count` images of this grid fit the budget.
    pub(crate) fn check_grid(&self, grid: &ImageGrid, count: u64) -> anyhow::Result<()> {
        let bytes = u128::from(grid.num_pixels()) * u128::from(count) * 8;
        if bytes > u128::from(self.memory_bytes) {
            let images = match count {
                1 => "an image".to_owned(),
                _ => format!("{count} images"),
            };
            anyhow::bail!(
                "--grid has {} x {} pixels, {images} of {}; of {} of memory (--memory) {} are for images and samples: use a \
                 smaller or coarser --grid, or raise --memory",
                grid.columns.count,
                grid.rows.count,
                text::bytes(bytes),
                text::bytes(self.memory.total_bytes.into()),
                text::bytes(self.memory_bytes.into())
            );
        }
        Ok(())
    }
}

/// Error text where the system refuses worker threads: their number, and where it comes from.
fn no_threads(requested: Option<usize>) -> String {
    if let Some(count) = requested {
        return format!("cannot start {count} worker threads (--threads {count}): give fewer");
    }
    // The thread pool takes its default from this variable.
    let variable = std::env::var("RAYON_NUM_THREADS");
    let set: Option<usize> = variable.ok().and_then(|text| text.parse().ok());
    if let Some(count) = set.filter(|&count| count > 0) {
        return format!(
            "cannot start {count} worker threads (environment variable RAYON_NUM_THREADS): give fewer with --threads"
        );
    }
    let count = std::thread::available_parallelism().map_or(1, usize::from);
    format!("cannot start {count} worker threads, one per processor: give fewer with --threads")
}

/// Print the warnings and the inferred properties of a recording.
pub(crate) fn report_reading(history: &dyn PhaseHistory) {
    for warning in history.warnings() {
        messages::warning(warning);
    }
    note_inferred(history);
}

/// Note the inferred sign and reference of the phase.
pub(crate) fn note_inferred(history: &dyn PhaseHistory) {
    for convention in history.phase_conventions() {
        if convention.is_inferred() {
            let name = &history.collection().name;
            messages::note(&format!(
                "{name}: phase convention inferred from the sharpest image: {convention}",
            ));
        }
    }
}

/// Arguments of the command line; invalid UTF-8 is replaced.
pub(crate) fn command_line() -> Vec<String> {
    let words = arguments().iter();
    words
        .map(|word| word.to_string_lossy().into_owned())
        .collect()
}

/// Entries common to all image records.
pub(crate) fn record_of_run(session: &Session, taken: Duration) -> Value {
    json!({
        "program": "subap",
        "version": env!("CARGO_PKG_VERSION"),
        "run_time_s": taken.as_secs_f64(),
        "threads": session.threads,
        "instructions": subaperture::focus::instructions(),
        "memory_bytes": session.memory.total_bytes,
    })
}
