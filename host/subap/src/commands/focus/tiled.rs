//! An image formed tile by tile: by `--tiled` into a store that several processes may fill, else, if it is larger than memory,
//! into the one array that an image is.
//!
//! ```text
//! options ─> Plan (or --plan FILE) ─> image.zarr: plan, tiles, marks ─┬─> once all tiles are there: image.json, image.png
//!                                 └─> image.npy, beside its place ────┘
//! ```
//!
//! What a store holds by the same plan is not formed again, whoever formed it, so that a run that was killed goes on
//! (`--resume`), and processes with a part each (`--tiles I/N`) need not know of one another. A tile's mark keeps what tells
//! the image's error; whoever finds all marks judges it. An image whose scene makes more of its errors than was planned is
//! planned for less and formed once more, unless the plan is shared.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use subaperture::focus::formers;
use subaperture::focus::plan::{Opened, Request, Sink};
use subaperture::focus::{
    FormError, ImageFormer, ImageSpec, Judgement, Numerics, Plan, SCRATCH_BYTES, Task, Tile,
    TileRecord, Work,
};
use subaperture::geometry::ImageGrid;
use subaperture::image::{Image, ImageSource, ImageSourceError, power};
use subaperture::io::atomic::WriteError;
use subaperture::io::claim::OutputClaims;
use subaperture::io::input::open_file;
use subaperture::io::json::{self, JsonError};
use subaperture::io::product::record::Brightest;
use subaperture::io::product::{self, PendingProduct};
use subaperture::io::tiles::{self, TileStore};
use subaperture::monitor::{Monitor, Silent};
use subaperture::phase_history::{PhaseHistory, Weights};

use super::deliver::Whole;
use super::{Job, beam, check, missed, record, with_advice};
use crate::args::{Focus, Imaging, Part};
use crate::commands::forming::{self, Surveying};
use crate::config::Session;
use crate::failure::Usage;
use crate::{messages, stages, text};

/// A pass over the pulses forms at most this part of the tiles, so that a run that is killed loses little.
const PASSES: usize = 16;

/// Forms the tiles that are missing of the part asked for, in a store.
pub(super) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    let start = Instant::now();
    // Processes that carry out a plan side by side share the folder; only who makes the record has to have it alone.
    let claims = claim(session, typed)?;
    let own = claims.filter(|_| typed.tiled.plan.is_none());
    let products = super::products(typed);
    let _products = products.claim(session, &typed.input.paths)?;
    super::with_history(session, typed, |history, movers| {
        products.check_place(&history.collection().frame)?;
        formed(session, typed, (history, movers), own, start)
    })
}

/// Forms what is missing of a recording's image.
fn formed(
    session: &Session,
    typed: &Focus,
    (history, movers): (&dyn PhaseHistory, Value),
    own: Option<OutputClaims>,
    start: Instant,
) -> anyhow::Result<()> {
    let survey = Surveying::of(history)?;
    let model = forming::time_model(&typed.image)?;
    let job = Job {
        numerics: typed.image.numerics(model.as_ref()),
        session,
        typed,
        history,
        survey: &survey,
        movers,
        start,
    };
    let plan = match &typed.tiled.plan {
        Some(path) => read_plan(path)?,
        None => {
            let grid = job.grid()?;
            let of = (job.history, typed.velocity);
            let former = beam::former(session, &typed.image, of, &grid)?;
            make_plan(&job, &*former, &grid)?
        }
    };
    if typed.tiled.plan.is_some() {
        // What cannot be carried out says so before anything is written.
        let weights = plan.weights(job.history.collection())?;
        plan.open(job.history.collection(), &weights)?;
    }
    if typed.rehearsal.dry_run {
        let part = typed.tiled.tiles.unwrap_or(Part::WHOLE);
        return text::say(describe(&plan, part)).map_err(Into::into);
    }
    into_store(&job, plan, own)
}

/// Forms an image that is larger than memory into one array.
pub(super) fn into_array(
    job: &Job,
    former: &dyn ImageFormer,
    grid: &ImageGrid,
) -> anyhow::Result<()> {
    let mut plan = make_plan(job, former, grid)?;
    loop {
        let weights = plan.weights(job.history.collection())?;
        let opened = plan.open(job.history.collection(), &weights)?;
        let growing = PendingProduct::begin(&job.typed.out, plan.tiling().image)?;
        let mut keep = Keep::new(&plan, Store::Array(growing));
        let all: Vec<usize> = (0..plan.num_tiles()).collect();
        form(job, &opened, &all, usize::MAX, &mut keep)?;
        let judged = Judged::of(job, &plan, &opened, &keep.notes)?;
        if let Some(next) = judged.next_plan(job)? {
            drop((opened, keep));
            plan = next;
            continue;
        }
        judged.check(job, &weights)?;
        let Store::Array(growing) = keep.store else {
            unreachable!("an array is kept in an array")
        };
        let whole = Whole::Array(Box::new(growing.finish()?));
        return judged.deliver(job, &weights, whole);
    }
}

/// Forms the part of a plan that is missing in the store; whoever forms the last tile makes record and picture.
fn into_store(job: &Job, plan: Plan, mut own: Option<OutputClaims>) -> anyhow::Result<()> {
    let Job { session, typed, .. } = *job;
    let part = typed.tiled.tiles.unwrap_or(Part::WHOLE);
    let (mut store, mut plan) = store(job, plan)?;
    loop {
        session.note(1, || describe(&plan, part));
        stages::foretell(session, &plan.cost);
        let weights = plan.weights(job.history.collection())?;
        let opened = plan.open(job.history.collection(), &weights)?;
        fill(job, &plan, &opened, &store)?;
        let notes = store.done()?;
        if notes.len() < plan.num_tiles() {
            if session.tells() {
                let (there, all) = (notes.len(), plan.num_tiles());
                text::say(format!(
                    "{}: part {part} is there; {there} of {all} tiles are, and the rest is others' work",
                    store.folder().display()
                ))?;
            }
            return Ok(());
        }
        if own.is_none() {
            own = claim(session, typed)?;
        }
        if own.is_none() {
            // Another process makes the record.
            return Ok(());
        }
        let notes: Result<Vec<Note>, _> = notes.into_values().map(Note::from_mark).collect();
        let judged = Judged::of(job, &plan, &opened, &notes?)?;
        let next = match typed.tiled.plan {
            Some(_) => None,
            None => judged.next_plan(job)?,
        };
        let Some(next) = next else {
            let kept = || format!("{} keeps the tiles", store.folder().display());
            judged.check(job, &weights).with_context(kept)?;
            return judged.deliver(job, &weights, Whole::Tiles(&store));
        };
        TileStore::discard(&typed.out)?;
        store = TileStore::create(&typed.out, next.tiling(), &next.to_text())?;
        drop(opened);
        plan = next;
    }
}

/// Forms what is missing of the part asked for.
fn fill(job: &Job, plan: &Plan, opened: &Opened, store: &TileStore) -> anyhow::Result<()> {
    let part = job.typed.tiled.tiles.unwrap_or(Part::WHOLE);
    let _claimed = store.claim(&part.to_string().replace('/', " of "))?;
    let done = store.done()?;
    let of_part = part.of(plan.num_tiles());
    let missing: Vec<usize> = of_part.clone().filter(|i| !done.contains_key(i)).collect();
    if missing.len() < of_part.len() {
        let there = of_part.len() - missing.len();
        messages::note(&format!("{there} of {} tiles are there", of_part.len()));
    }
    let most_a_pass = plan.num_tiles().div_ceil(PASSES);
    let mut keep = Keep::new(plan, Store::Tiles(store));
    form(job, opened, &missing, most_a_pass, &mut keep)
}

fn form(
    job: &Job,
    opened: &Opened,
    indices: &[usize],
    most_a_pass: usize,
    keep: &mut Keep,
) -> anyhow::Result<()> {
    let progress = job.session.progress("focusing");
    let formed = stages::measured(job.session, &progress, |monitor| {
        let work = Work {
            history: job.history,
            memory_bytes: job.session.memory_bytes,
            monitor,
        };
        opened.form(&work, indices, most_a_pass, keep)
    });
    formed.map_err(with_advice)?;
    progress.finish();
    Ok(())
}

/// Sees that record and picture may be written, and keeps others from it. `None` if another process is at it that
/// carries out the same plan.
fn claim(session: &Session, typed: &Focus) -> anyhow::Result<Option<OutputClaims>> {
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    match claims.folder(&typed.out, product::TILED_NAMES) {
        Ok(()) => Ok(Some(claims)),
        Err(WriteError::Locked { .. }) if typed.tiled.plan.is_some() => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The plan in a file.
fn read_plan(path: &Path) -> anyhow::Result<Plan> {
    let value = open_file(path)
        .map_err(JsonError::Io)
        .and_then(|file| json::value(file, tiles::PLAN_LIMITS))
        .with_context(|| format!("cannot read the plan {}", path.display()))?;
    Plan::from_value(value).with_context(|| path.display().to_string())
}

fn make_plan(job: &Job, former: &dyn ImageFormer, grid: &ImageGrid) -> anyhow::Result<Plan> {
    let request = request(&job.typed.image, job.history, grid, job.numerics);
    planned(job.session, former, &request, Plan::new)
}

/// The plan of the options for a recording, to be carried out by others: it leaves room for scatterers outside the grid.
pub(crate) fn plan_recording(
    session: &Session,
    typed: &Imaging,
    history: &dyn PhaseHistory,
    grid: &ImageGrid,
    numerics: Numerics,
) -> anyhow::Result<Plan> {
    let former = beam::former(session, typed, (history, None), grid)?;
    let request = request(typed, history, grid, numerics);
    planned(session, &*former, &request, |former, request, monitor| {
        Plan::for_recording(former, request, history, monitor)
    })
}

/// The plan of the options, by `plan`.
fn planned(
    session: &Session,
    former: &dyn ImageFormer,
    request: &Request,
    plan: impl FnOnce(&dyn ImageFormer, &Request, &dyn Monitor) -> Result<Plan, FormError>,
) -> anyhow::Result<Plan> {
    let progress = session.progress("planning");
    let plan = plan(former, request, &progress).map_err(|error| {
        let Request { fast, slow, .. } = *request;
        match former.weights(request.collection, request.grid, fast, slow) {
            Ok(weights) => missed::refusal(error, former, &request.spec(&weights), &progress),
            Err(error) => error.into(),
        }
    })?;
    progress.finish();
    Ok(plan)
}

fn request<'a>(
    typed: &Imaging,
    history: &'a dyn PhaseHistory,
    grid: &'a ImageGrid,
    numerics: Numerics<'a>,
) -> Request<'a> {
    Request {
        collection: history.collection(),
        grid,
        fast: typed.window,
        slow: typed.slow_window,
        scratch_bytes: typed.scratch.unwrap_or(SCRATCH_BYTES),
        bound_policy: typed.bound_policy(),
        numerics,
    }
}

/// The plan of the same options as `plan` has for an error of `error_db`, if there is any.
fn plan_for_less(job: &Job, plan: &Plan, error_db: f64) -> Result<Option<Plan>, FormError> {
    let typed = &job.typed.image;
    let Ok(former) = formers::former(&plan.former, &plan.settings) else {
        return Ok(None);
    };
    let progress = job.session.progress("planning");
    let plan = match Plan::for_less(
        &*former,
        error_db,
        &request(typed, job.history, &plan.grid, job.numerics),
        &progress,
    ) {
        // No such plan: what the first one's miss says is what can be done.
        Err(FormError::BoundMissed { .. }) => None,
        plan => plan?,
    };
    progress.finish();
    Ok(plan)
}

/// In a few lines, what a plan or a part of it is.
pub(crate) fn describe(plan: &Plan, part: Part) -> String {
    let [down, across] = plan.tiling().tiles();
    let grid = &plan.grid;
    let tiles = match part {
        Part::WHOLE => String::new(),
        part => format!(", part {part}: {} of them", part.of(plan.num_tiles()).len()),
    };
    let choices = plan.summary.as_object().into_iter().flatten();
    let choices: Vec<String> = choices
        .map(|(key, value)| match value {
            Value::String(text) => format!("{} {text}", key.replace('_', " ")),
            value => format!("{} {value}", key.replace('_', " ")),
        })
        .collect();
    format!(
        "{:<16} {} pulses of {} samples onto {} x {} pixels by {}\n{:<16} {}\n{:<16} {:.1} dB{}\n{:<16} {across} x {down} of {} x \
         {} pixels{tiles}\n{:<16} {} a thread at the most",
        "work",
        plan.recording.pulses,
        plan.recording.samples,
        grid.columns.count,
        grid.rows.count,
        plan.former,
        "choices",
        choices.join(", "),
        "planned error",
        plan.planned_db,
        plan.bound_db
            .map_or(String::new(), |bound| format!(", {bound} dB asked")),
        "tiles",
        plan.tile.columns,
        plan.tile.rows,
        "scratch",
        text::bytes(plan.scratch_bytes.into()),
    )
}

/// The store of a plan: the one that is there, if it is the same plan's and may be gone on with, or a new one. A store may be
/// of the same options' plan for less, which is then what is carried out.
fn store(job: &Job, plan: Plan) -> anyhow::Result<(TileStore, Plan)> {
    let typed = job.typed;
    let goes_on = typed.tiled.resume || typed.tiled.plan.is_some();
    let name = typed.out.join(tiles::NAME);
    let there = match TileStore::open(&typed.out) {
        Err(_) if typed.writing.force && !goes_on => None,
        store => store?,
    };
    match there {
        Some(store) if goes_on => match plan_of(job, &store, plan)? {
            Some(plan) => return Ok((store, plan)),
            None => bail!(
                "{}: what is there is of another plan: give the same recording and options as then, or begin anew with \
                 --force and without --resume",
                name.display()
            ),
        },
        Some(_) if !typed.writing.force => {
            return Err(Usage(format!(
                "{}: there is one already: go on with it by --resume, or begin anew by --force",
                name.display()
            ))
            .into());
        }
        _ if typed.writing.force => TileStore::discard(&typed.out)?,
        _ => {}
    }
    let text = plan.to_text();
    match TileStore::create(&typed.out, plan.tiling(), &text) {
        Ok(store) => Ok((store, plan)),
        // Another process was quicker.
        Err(error) => match TileStore::open(&typed.out) {
            Ok(Some(store)) if goes_on && store.plan() == text => Ok((store, plan)),
            _ => Err(error.into()),
        },
    }
}

/// The plan by which a store is filled, if it is `plan` or what that came to for less.
fn plan_of(job: &Job, store: &TileStore, plan: Plan) -> anyhow::Result<Option<Plan>> {
    let is_of = |plan: &Plan| store.plan() == plan.to_text() && store.tiling() == plan.tiling();
    if is_of(&plan) {
        return Ok(Some(plan));
    }
    let stored = json::value(store.plan().as_bytes(), tiles::PLAN_LIMITS).ok();
    let stored = stored.and_then(|value| Plan::from_value(value).ok());
    let for_less = stored.and_then(|stored| stored.planned_for_db);
    let (None, Some(error_db)) = (&job.typed.tiled.plan, for_less) else {
        return Ok(None);
    };
    Ok(plan_for_less(job, &plan, error_db)?.filter(is_of))
}

impl Job<'_> {
    /// What a plan forms.
    fn spec<'a>(&'a self, plan: &'a Plan, weights: &'a Weights) -> ImageSpec<'a> {
        ImageSpec {
            collection: self.history.collection(),
            grid: &plan.grid,
            weights,
            scratch_bytes: plan.scratch_bytes,
            numerics: Numerics {
                transforms: plan.transforms,
                model: &plan.time_model,
            },
        }
    }
}

/// What is noted of a tile beside its pixels.
#[derive(Debug, Serialize, Deserialize)]
struct Note {
    record: TileRecord,
    /// Row and column in the image of the brightest pixel, and its power.
    peak: Option<(usize, usize, f64)>,
}

impl Note {
    fn of(tile: Tile, record: TileRecord) -> (Self, Image) {
        let Tile { place, pixels } = tile;
        let image = Image {
            rows: place.size.rows,
            columns: place.size.columns,
            pixels,
        };
        let at = |peak: subaperture::image::Peak| {
            let (row, column) = (place.row + peak.row, place.column + peak.column);
            (row, column, power(peak.value))
        };
        let peak = image.peak().map(at);
        (Self { record, peak }, image)
    }

    fn from_mark(mark: Value) -> anyhow::Result<Self> {
        serde_json::from_value(mark).context("a tile's mark is damaged")
    }
}

/// Where tiles are kept.
enum Store<'a> {
    Tiles(&'a TileStore),
    Array(PendingProduct),
}

/// Keeps tiles, and what is noted of them if that is kept nowhere else.
struct Keep<'a> {
    plan: &'a Plan,
    store: Store<'a>,
    notes: Vec<Note>,
}

impl<'a> Keep<'a> {
    fn new(plan: &'a Plan, store: Store<'a>) -> Self {
        Self {
            plan,
            store,
            notes: Vec::new(),
        }
    }
}

impl Sink for Keep<'_> {
    fn take(
        &mut self,
        index: usize,
        tile: Tile,
        record: TileRecord,
    ) -> Result<(), ImageSourceError> {
        let (note, image) = Note::of(tile, record);
        match &mut self.store {
            Store::Tiles(store) => store.put(index, &image.pixels, &serde_json::json!(note))?,
            Store::Array(growing) => {
                growing.put(&self.plan.tiling().place(index), &image.pixels)?;
                self.notes.push(note);
            }
        }
        Ok(())
    }
}

/// A whole image, and what is known of it.
struct Judged<'a> {
    plan: &'a Plan,
    judgement: Judgement,
    peak: Option<Brightest>,
}

impl<'a> Judged<'a> {
    fn of(job: &Job, plan: &'a Plan, opened: &Opened, notes: &[Note]) -> anyhow::Result<Self> {
        let records: Vec<TileRecord> = notes.iter().map(|note| note.record.clone()).collect();
        // The first in the image of several that are as bright.
        let peaks = notes.iter().filter_map(|note| note.peak);
        let peak = peaks.max_by(|a, b| a.2.total_cmp(&b.2).then((b.0, b.1).cmp(&(a.0, a.1))));
        let history = job.history;
        let judgement = opened
            .judge_again(&records, history, &Silent)
            .map_err(with_advice)?;
        Ok(Self {
            plan,
            judgement,
            peak: peak
                .and_then(|(row, column, power)| Brightest::at(&plan.grid, [row, column], power)),
        })
    }

    /// What to form in its place, where the scene makes more of its errors than was planned.
    fn next_plan(&self, job: &Job) -> anyhow::Result<Option<Plan>> {
        let next = self.judgement.next_plan_db(&self.plan.goal());
        match next.filter(|_| self.plan.planned_for_db.is_none()) {
            Some(error_db) => {
                let next = plan_for_less(job, self.plan, error_db)?;
                Ok(next.filter(|next| self.plan.is_worth_replacing(next)))
            }
            None => Ok(None),
        }
    }

    /// Refuses an image that is not what was asked for.
    fn check(&self, job: &Job, weights: &Weights) -> anyhow::Result<()> {
        let plan = self.plan;
        let Err(error) = self.judgement.check(&plan.goal()) else {
            return Ok(());
        };
        let former = formers::former(&plan.former, &plan.settings)?;
        Err(missed::refusal(
            error,
            &*former,
            &job.spec(plan, weights),
            &Silent,
        ))
    }

    /// Checks the image against the exact sum, if that is asked for, and writes it.
    fn deliver(self, job: &Job, weights: &Weights, image: Whole) -> anyhow::Result<()> {
        let Self { plan, .. } = self;
        let mut resolved = plan.summary.as_object().cloned().unwrap_or_default();
        if self.judgement.note(plan.bound_db, &mut resolved) {
            let former = formers::former(&plan.former, &plan.settings)?;
            let spec = job.spec(plan, weights);
            missed::tell(&*former, &spec, self.judgement.predicted_db(), &Silent);
        }
        if let Some(error_db) = plan.planned_for_db {
            resolved.insert("planned_for_db".to_owned(), error_db.into());
        }
        super::tell_settings(&resolved);
        let mut settings = record::settings(job, &plan.former, &resolved);
        settings["window"] = plan.window.clone().into();
        settings["slow_window"] = plan.slow_window.clone().into();
        settings["scratch_bytes"] = plan.scratch_bytes.into();
        let about = record::About {
            settings,
            check: self.checked(job, weights, image.parts())?,
            peak: self.peak,
        };
        let beam = formers::former(&plan.former, &plan.settings)?.beam();
        job.deliver(&plan.grid, (&plan.former, beam), about, image)
    }

    fn checked(
        &self,
        job: &Job,
        weights: &Weights,
        image: &dyn ImageSource,
    ) -> anyhow::Result<Option<check::Check>> {
        let Some(count) = job.typed.check else {
            return Ok(None);
        };
        let progress = job.session.progress("checking");
        let task = Task {
            history: job.history,
            grid: &self.plan.grid,
            weights,
            memory_bytes: job.session.memory_bytes,
            monitor: &progress,
            numerics: Default::default(),
        };
        let checking = check::Plan::of_parts(&task, image, count)?;
        Ok(Some(checking.against_exact(
            &task,
            image,
            self.plan.bound_db,
        )?))
    }
}
