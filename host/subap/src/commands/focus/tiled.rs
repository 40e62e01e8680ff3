//! Image formation tile by tile: with `--tiled` or `--plan` into a store that several processes may fill, otherwise into
//! one array if the image is larger than memory.
//!
//! ```text
//! options ─> Plan (or --plan FILE) ─> image.zarr: plan, tiles, marks ─┬─> once all tiles are there: image.json, image.png
//!                                 └─> image.npy in a temporary file ──┘
//! ```
//!
//! Tiles that a store already contains for the same plan are not formed again: a killed run can be continued (`--resume`), and processes
//! with a part each (`--tiles I/N`) run independently. The mark of a tile contains its record; the process that finds all marks
//! measures the error of the image. [`Execution`] forms tiles, measures errors and replans; `sinks.rs` stores the tiles.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use serde_json::Value;
use subaperture::corrections::CorrectedRecording;
use subaperture::focus::StageCost;
use subaperture::focus::accuracy::comparison_cost;
use subaperture::focus::coverage;
use subaperture::focus::plan::ImageSink;
use subaperture::focus::{
    Executed, Execution, FormError, ImageFormer, ImageSpec, Numerics, Plan, SCRATCH_BYTES, Task,
    Work, formers,
};
use subaperture::geometry::ImageGrid;
use subaperture::image::ImageSource;
use subaperture::io::atomic::WriteError;
use subaperture::io::claim::OutputClaims;
use subaperture::io::input::open_file;
use subaperture::io::json::{self, JsonError};
use subaperture::io::product::record::Brightest;
use subaperture::io::tiles::{self, TileStore};
use subaperture::monitor::Silent;
use subaperture::phase_history::{Collection, PhaseHistory, Weights};

use super::deliver::Whole;
use super::job::{Job, opened, products};
use super::missed::with_advice;
use super::sinks::{ArraySink, StoreSink, claim};
use super::summary::describe;
use super::{beam, check, coarse, device, missed, record};
use crate::args::{Focus, Imaging, Part};
use crate::commands::forming::{self, Surveying};
use crate::config::Session;
use crate::failure::Usage;
use crate::{messages, stages, text};

/// Time limit for the creation of a store by another process.
const CREATION: Duration = Duration::from_secs(10);

/// Form the missing tiles of the requested part in a store.
pub(super) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    let start = Instant::now();
    // Processes that execute a plan in parallel share the folder; only the one that writes the record needs an exclusive claim.
    let claims = claim(session, typed)?;
    let own = claims.filter(|_| typed.tiled.plan.is_none());
    let products = products(typed);
    let _products = products.claim(session, &typed.input.files)?;
    let (recorded, movers) = opened(session, typed)?;
    products.check_place(&recorded.history().collection().frame)?;
    formed(session, typed, (&recorded, movers), own, start)
}

/// Form the missing tiles of an image of a recording.
fn formed(
    session: &Session,
    typed: &Focus,
    (recorded, movers): (&CorrectedRecording, Value),
    own: Option<OutputClaims>,
    start: Instant,
) -> anyhow::Result<()> {
    let history = recorded.history();
    let survey = Surveying::of(recorded.at_rest())?;
    let model = forming::time_model(&typed.image)?;
    let device = device::open(typed.device);
    let job = Job {
        numerics: Numerics {
            device: device.as_deref(),
            ..typed.image.forming.numerics(model.as_ref())
        },
        session,
        typed,
        history,
        survey: &survey,
        movers,
        start,
    };
    let collection = history.collection();
    let (plan, former) = match &typed.tiled.plan {
        Some(path) => {
            let plan = read_plan(path)?;
            // A plan that cannot be executed is refused before any output is written.
            plan.open(collection, &plan.weights(collection)?)?;
            let former = formers::former(&plan.former, &plan.settings)?;
            (plan, former)
        }
        None => {
            let grid = job.grid()?;
            coarse::note(&job, &grid);
            let former = beam::former(session, &typed.image, job.history, &grid)?;
            let weights = weights(&typed.image, &*former, collection, &grid)?;
            let spec = spec(&typed.image, collection, &grid, &weights, job.numerics);
            (plan(session, &typed.image, &*former, &spec)?, former)
        }
    };
    if typed.rehearsal.dry_run {
        let part = typed.tiled.tiles.unwrap_or(Part::WHOLE);
        return text::say(describe(&plan, part)).map_err(Into::into);
    }
    device::note_unused(job.numerics.device, &plan.former, &plan.summary);
    let weights = plan.weights(collection)?;
    let mut spec = plan.spec(collection, &weights);
    spec.numerics.device = job.numerics.device;
    let work = InParts {
        job: &job,
        former: &*former,
        spec,
    };
    let (store, plan) = work.store(&plan)?;
    let comparison = comparison_cost(&work.spec);
    let sink = StoreSink::new(session, typed, store, own, comparison);
    work.fill_store(&plan, sink)
}

/// Weights by the requested windows, within the beam of `former`.
pub(super) fn weights(
    typed: &Imaging,
    former: &dyn ImageFormer,
    collection: &Collection,
    grid: &ImageGrid,
) -> Result<Weights, FormError> {
    former.weights(
        collection,
        grid,
        typed.forming.windows.window,
        typed.forming.windows.slow_window,
    )
}

/// Specification of the requested image.
pub(super) fn spec<'a>(
    typed: &Imaging,
    collection: &'a Collection,
    grid: &'a ImageGrid,
    weights: &'a Weights,
    numerics: Numerics<'a>,
) -> ImageSpec<'a> {
    ImageSpec {
        collection,
        grid,
        weights,
        scratch_bytes: typed.forming.scratch.unwrap_or(SCRATCH_BYTES),
        numerics,
    }
}

/// Plan of `former` for the requested image.
pub(super) fn plan(
    session: &Session,
    typed: &Imaging,
    former: &dyn ImageFormer,
    spec: &ImageSpec,
) -> anyhow::Result<Plan> {
    let progress = session.progress("planning");
    let plan = Plan::new(former, spec, typed.forming.bound_policy(), &progress)
        .map_err(|error| missed::refusal(error, former, spec, &progress))?;
    progress.finish();
    warn_of_uncovered(&plan);
    Ok(plan)
}

/// Warn of pixels outside the recorded delays.
fn warn_of_uncovered(plan: &Plan) {
    let summary = plan.summary.as_object();
    if let Some(warning) = summary.and_then(|summary| coverage::warning(summary, &plan.grid)) {
        messages::warning(warning);
    }
}

/// Plan for a recording, to be executed later. It allows for scatterers outside the grid.
pub(crate) fn plan_recording(
    session: &Session,
    typed: &Imaging,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    numerics: Numerics,
) -> anyhow::Result<(Plan, StageCost)> {
    let former = beam::former(session, typed, history, grid)?;
    let collection = history.collection();
    let weights = weights(typed, &*former, collection, grid)?;
    let spec = spec(typed, collection, grid, &weights, numerics);
    let progress = session.progress("planning");
    let policy = typed.forming.bound_policy();
    let plan = Plan::for_recording(&*former, &spec, policy, history, &progress)
        .map_err(|error| missed::refusal(error, &*former, &spec, &progress))?;
    progress.finish();
    warn_of_uncovered(&plan);
    Ok((plan, comparison_cost(&spec)))
}

/// Read a plan from a file.
fn read_plan(path: &Path) -> anyhow::Result<Plan> {
    let value = open_file(path)
        .map_err(JsonError::Io)
        .and_then(|file| json::value(file, tiles::PLAN_LIMITS))
        .with_context(|| format!("cannot read the plan {}", path.display()))?;
    Plan::from_value(value).with_context(|| path.display().to_string())
}

/// Image formed tile by tile.
pub(super) struct InParts<'a> {
    pub(super) job: &'a Job<'a>,
    pub(super) former: &'a dyn ImageFormer,
    pub(super) spec: ImageSpec<'a>,
}

impl InParts<'_> {
    /// Form an image that is larger than memory into one array.
    pub(super) fn form_array(&self, plan: &Plan) -> anyhow::Result<()> {
        let mut sink = ArraySink::new(&self.job.typed.out);
        let executed = self.execute(plan, &mut sink, None)?;
        let executed = executed.context("an array is formed by one process")?;
        let (peak, array) = sink.finish(self.spec.grid);
        let array = array.context("an image has tiles")?.finish()?;
        self.deliver(&executed, peak, Whole::Array(Box::new(array)))
    }

    /// Form the missing tiles of a part of a store. The process that forms the last tile writes the record and the picture.
    fn fill_store(&self, plan: &Plan, mut sink: StoreSink) -> anyhow::Result<()> {
        let kept = format!("{} keeps the tiles", sink.store().folder().display());
        let Some(executed) = self.execute(plan, &mut sink, Some(kept))? else {
            return Ok(());
        };
        let peak = sink.brightest(self.spec.grid);
        self.deliver(&executed, peak, Whole::Tiles(sink.store()))
    }

    /// Execute the plan. `kept` describes the partial output that remains if the image is refused.
    fn execute<'p>(
        &self,
        plan: &'p Plan,
        sink: &mut dyn ImageSink,
        kept: Option<String>,
    ) -> anyhow::Result<Option<Executed<'p>>> {
        let Job { session, typed, .. } = *self.job;
        let progress = session.progress("focusing");
        let executed = stages::measured(session, &progress, |monitor| {
            let execution = Execution {
                former: self.former,
                spec: self.spec,
                work: Work {
                    history: self.job.history,
                    memory_bytes: session.memory_bytes,
                    monitor,
                },
                may_replan: typed.tiled.plan.is_none(),
            };
            execution.run(plan, sink)
        });
        let executed = executed.map_err(|error| match error {
            FormError::BoundMissed { .. } => {
                let refusal = missed::refusal(error, self.former, &self.spec, &Silent);
                match kept {
                    Some(kept) => refusal.context(kept),
                    None => refusal,
                }
            }
            error => with_advice(error),
        })?;
        progress.finish();
        Ok(executed)
    }

    /// Tile store of `plan`: an existing one to continue, or a new one. An existing store may contain the stricter plan of the same options,
    /// made after a measurement; that plan is then executed.
    fn store(&self, plan: &Plan) -> anyhow::Result<(TileStore, Plan)> {
        let typed = self.job.typed;
        let goes_on = typed.tiled.resume || typed.tiled.plan.is_some();
        let name = typed.out.join(tiles::NAME);
        let there = match TileStore::open(&typed.out) {
            Err(_) if typed.writing.force && !goes_on => None,
            store => store?,
        };
        match there {
            Some(store) if goes_on => match self.plan_of(&store, plan)? {
                Some(plan) => return Ok((store, plan)),
                None => bail!(
                    "{}: expected tiles of the same plan, found another: repeat the recording and options of the first run, or start over with \
                     --force and without --resume",
                    name.display()
                ),
            },
            Some(_) if !typed.writing.force => {
                return Err(Usage(format!(
                    "{}: the folder already contains tiles: continue with --resume, or start over with --force",
                    name.display()
                ))
                .into());
            }
            _ if typed.writing.force => TileStore::discard(&typed.out)?,
            _ => {}
        }
        let text = plan.to_text();
        let begun = Instant::now();
        loop {
            let error = match TileStore::create(&typed.out, plan.tiling(), &text) {
                Ok(store) => return Ok((store, plan.clone())),
                Err(error) => error,
            };
            let is_locked = matches!(error, WriteError::Locked { .. });
            match TileStore::open(&typed.out) {
                // Another process has created the store in the meantime.
                Ok(Some(store))
                    if goes_on && store.plan() == text && store.tiling() == plan.tiling() =>
                {
                    return Ok((store, plan.clone()));
                }
                // Another process creates the store.
                Ok(None) if goes_on && is_locked && begun.elapsed() < CREATION => {
                    thread::sleep(CREATION / 500);
                }
                _ => return Err(error.into()),
            }
        }
    }

    /// Plan of a store if it is `plan` or the stricter plan of the same options; else `None`.
    fn plan_of(&self, store: &TileStore, plan: &Plan) -> anyhow::Result<Option<Plan>> {
        let is_of = |plan: &Plan| store.plan() == plan.to_text() && store.tiling() == plan.tiling();
        if is_of(plan) {
            return Ok(Some(plan.clone()));
        }
        let stored = json::value(store.plan().as_bytes(), tiles::PLAN_LIMITS).ok();
        let stored = stored.and_then(|value| Plan::from_value(value).ok());
        let for_less = stored.and_then(|stored| stored.planned_for_db);
        let (None, Some(error_db)) = (&self.job.typed.tiled.plan, for_less) else {
            return Ok(None);
        };
        let policy = plan.goal().bound_policy;
        let progress = self.job.session.progress("planning");
        let stricter = Plan::for_less(self.former, error_db, &self.spec, policy, &progress)?;
        progress.finish();
        Ok(stricter.filter(is_of))
    }

    /// Compare the image with the exact sum if requested, and write it.
    fn deliver(
        &self,
        executed: &Executed,
        peak: Option<Brightest>,
        image: Whole,
    ) -> anyhow::Result<()> {
        let job = self.job;
        let Executed {
            plan, judgement, ..
        } = executed;
        let mut resolved = plan.summary.as_object().cloned().unwrap_or_default();
        if judgement.note(plan.bound_db, &mut resolved) {
            let predicted_db = judgement.predicted_db();
            missed::warn(self.former, &self.spec, predicted_db, &Silent);
        }
        if let Some(error_db) = plan.planned_for_db {
            resolved.insert("planned_for_db".to_owned(), error_db.into());
        }
        record::report_settings(&resolved);
        let mut settings = record::settings(job, &plan.former, &resolved);
        settings["window"] = plan.window.clone().into();
        settings["slow_window"] = plan.slow_window.clone().into();
        settings["scratch_bytes"] = plan.scratch_bytes.into();
        let about = record::About {
            settings,
            check: self.checked(plan, image.parts())?,
            peak,
        };
        job.deliver(
            self.spec.grid,
            (&plan.former, self.former.beam()),
            about,
            image,
            None,
        )
    }

    fn checked(
        &self,
        plan: &Plan,
        image: &dyn ImageSource,
    ) -> anyhow::Result<Option<check::Check>> {
        let job = self.job;
        let Some(count) = job.typed.check else {
            return Ok(None);
        };
        let progress = job.session.progress("checking");
        let task = Task {
            memory_bytes: job.session.memory_bytes,
            monitor: &progress,
            ..Task::new(job.history, self.spec.grid, self.spec.weights)
        };
        let checking = check::Plan::of_parts(&task, image, count)?;
        Ok(Some(checking.against_exact(&task, image, plan.bound_db)?))
    }
}
