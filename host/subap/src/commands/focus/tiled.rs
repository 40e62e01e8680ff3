//! `subap focus --tiled`: an image formed tile by tile into a store that several processes may fill.
//!
//! ```text
//! options ─> Plan (or --plan FILE) ─> image.zarr: plan, tiles, marks ─> once all tiles are there: image.json, image.png
//! ```
//!
//! What the store holds by the same plan is not formed again, whoever formed it, so that a run that was killed goes on
//! (`--resume`), and processes with a part each (`--tiles I/N`) need not know of one another. A tile's mark keeps what tells
//! the image's error; whoever finds all marks judges it.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, bail};
use serde_json::{Value, json};
use subaperture::focus::moving::Moving;
use subaperture::focus::plan::{Opened, Request, Sink};
use subaperture::focus::{Plan, SCRATCH_BYTES, Tile, TileRecord, Work};
use subaperture::image::PartsError;
use subaperture::image::power;
use subaperture::io::atomic::WriteError;
use subaperture::io::claim::Claims;
use subaperture::io::product::record::Brightest;
use subaperture::io::product::{self, TiledProduct};
use subaperture::io::tiles::{Layout, TileStore};
use subaperture::phase_history::PhaseHistory;
use subaperture::plot::{self, Orientation, Panel};
use subaperture::resolution::support::RecordedLooks;
use subaperture::resolution::survey::Survey;

use super::record;
use crate::args::{Focus, Part};
use crate::commands::forming;
use crate::config::{Session, former};
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// A pass over the pulses forms at most this part of the tiles, so that a run that is killed loses little.
const PASSES: usize = 16;

/// Forms the tiles that are missing of the part asked for.
pub(super) fn run(session: &Session, typed: &Focus) -> anyhow::Result<()> {
    let start = Instant::now();
    // Processes that carry out a plan side by side share the folder; only who makes the record has to have it alone.
    let claims = claim(session, typed)?;
    let own = claims.filter(|_| typed.tiled.plan.is_none());
    let recorded = session.open(&typed.input)?;
    let survey = Survey::of(recorded.collection()).context("the input holds no pulses")?;
    let first_s = recorded.collection().pulses[0].time_s;
    let moving = typed.velocity.map(|v| Moving::new(&recorded, v, first_s));
    let moving = moving.transpose()?;
    let history: &dyn PhaseHistory = match &moving {
        Some(moving) => moving,
        None => &recorded,
    };
    let plan = match &typed.tiled.plan {
        Some(path) => read_plan(path)?,
        None => make_plan(session, typed, history, &survey)?,
    };
    let weights = plan.weights(history.collection())?;
    let opened = plan.open(history.collection(), &weights)?;
    let part = typed.tiled.tiles.unwrap_or(Part::WHOLE);
    if typed.rehearsal.dry_run {
        return text::say(describe(&plan, part)).map_err(Into::into);
    }
    session.note(1, || describe(&plan, part));

    let store = store(typed, &plan)?;
    let claimed = store.claim(&part.to_string().replace('/', " of "))?;
    let done = store.done()?;
    let of_part = part.of(plan.num_tiles());
    let missing: Vec<usize> = of_part.clone().filter(|i| !done.contains_key(i)).collect();
    if missing.len() < of_part.len() {
        let there = of_part.len() - missing.len();
        messages::note(&format!("{there} of {} tiles are there", of_part.len()));
    }
    let progress = session.progress("focusing");
    let work = Work {
        history,
        memory_bytes: session.memory_bytes,
        monitor: &progress,
    };
    let most_a_pass = plan.num_tiles().div_ceil(PASSES);
    opened.form(&work, &missing, most_a_pass, &mut Keep { store: &store })?;
    progress.finish();
    let notes = store.done()?;
    drop(claimed);
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
    let claimed = own.map_or_else(|| claim(session, typed), |own| Ok(Some(own)))?;
    let Some(_claimed) = claimed else {
        // Another process makes the record.
        return Ok(());
    };
    let whole = Whole {
        session,
        typed,
        plan: &plan,
        opened: &opened,
        history,
        survey: &survey,
        store: &store,
    };
    whole.deliver(notes.into_values(), start)
}

/// Sees that record and picture may be written, and keeps others from it. `None` if another process is at it that
/// carries out the same plan.
fn claim(session: &Session, typed: &Focus) -> anyhow::Result<Option<Claims>> {
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    match claims.folder(&typed.out, product::TILED_NAMES) {
        Ok(()) => Ok(Some(claims)),
        Err(WriteError::Locked { .. }) if typed.tiled.plan.is_some() => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The plan in a file.
fn read_plan(path: &Path) -> anyhow::Result<Plan> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the plan {}", path.display()))?;
    Plan::from_text(&text).with_context(|| path.display().to_string())
}

/// The plan that the options come to.
pub(crate) fn make_plan(
    session: &Session,
    typed: &Focus,
    history: &dyn PhaseHistory,
    survey: &Survey,
) -> anyhow::Result<Plan> {
    let grid = match typed.grid {
        Some(grid) => grid,
        None => session.default_grid(survey)?,
    };
    let request = Request {
        collection: history.collection(),
        grid: &grid,
        fast: typed.window,
        slow: typed.slow_window,
        scratch_bytes: typed.tiled.scratch.unwrap_or(SCRATCH_BYTES),
        misses: typed.misses(),
    };
    let progress = session.progress("planning");
    let former = former(typed)?;
    let plan = Plan::new(&*former, &request, &progress).map_err(super::with_advice)?;
    progress.finish();
    Ok(plan)
}

/// In a few lines, what a plan or a part of it is.
pub(crate) fn describe(plan: &Plan, part: Part) -> String {
    let [down, across] = plan.tiles_each_way();
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

/// The store of a plan: the one that is there, if it is the same plan's and may be gone on with, or a new one.
fn store(typed: &Focus, plan: &Plan) -> anyhow::Result<TileStore> {
    let text = plan.to_text();
    let grid = &plan.grid;
    let layout = Layout {
        image: [grid.rows.count, grid.columns.count],
        tile: [plan.tile.rows, plan.tile.columns],
    };
    let goes_on = typed.tiled.resume || typed.tiled.plan.is_some();
    let name = typed.out.join(subaperture::io::tiles::NAME);
    let there = match TileStore::open(&typed.out) {
        Err(_) if typed.writing.force && !goes_on => None,
        store => store?,
    };
    match there {
        Some(store) if goes_on && store.plan() == text && store.layout() == layout => {
            return Ok(store);
        }
        Some(_) if goes_on => bail!(
            "{}: what is there is of another plan: give the same recording and options as then, or begin anew with \
             --force and without --resume",
            name.display()
        ),
        Some(_) if typed.writing.force => {
            std::fs::remove_dir_all(&name)
                .with_context(|| format!("cannot remove {}", name.display()))?;
        }
        Some(_) => {
            return Err(Usage(format!(
                "{}: there is one already: go on with it by --resume, or begin anew by --force",
                name.display()
            ))
            .into());
        }
        None if typed.writing.force && name.exists() => {
            std::fs::remove_dir_all(&name)
                .with_context(|| format!("cannot remove {}", name.display()))?;
        }
        None => {}
    }
    match TileStore::create(&typed.out, layout, &text) {
        Ok(store) => Ok(store),
        // Another process was quicker.
        Err(error) => match TileStore::open(&typed.out) {
            Ok(Some(store)) if goes_on && store.plan() == text => Ok(store),
            _ => Err(error.into()),
        },
    }
}

/// Keeps tiles in a store.
struct Keep<'a> {
    store: &'a TileStore,
}

impl Sink for Keep<'_> {
    fn take(&mut self, index: usize, tile: Tile, record: TileRecord) -> Result<(), PartsError> {
        let brightest = tile.pixels.iter().enumerate();
        let brightest = brightest.max_by(|a, b| power(*a.1).total_cmp(&power(*b.1)));
        let peak = brightest.map(|(i, z)| {
            let columns = tile.place.size.columns;
            let (row, column) = (
                tile.place.row + i / columns,
                tile.place.column + i % columns,
            );
            json!([row, column, power(*z)])
        });
        let note = json!({ "record": record, "peak": peak });
        Ok(self.store.put(index, &tile.pixels, &note)?)
    }
}

/// An image of which all tiles are there.
struct Whole<'a> {
    session: &'a Session,
    typed: &'a Focus,
    plan: &'a Plan,
    opened: &'a Opened<'a>,
    history: &'a dyn PhaseHistory,
    survey: &'a Survey,
    store: &'a TileStore,
}

impl Whole<'_> {
    /// Judges it, and writes record and picture beside it.
    fn deliver(&self, notes: impl Iterator<Item = Value>, start: Instant) -> anyhow::Result<()> {
        let Self { session, plan, .. } = *self;
        let (mut records, mut peak): (Vec<TileRecord>, Option<Brightest>) = (Vec::new(), None);
        for note in notes {
            let (row, column) = (&note["peak"][0], &note["peak"][1]);
            let power = note["peak"][2].as_f64().unwrap_or(0.0);
            let level_db = 10.0 * power.log10();
            if power > 0.0 && peak.is_none_or(|peak| level_db > peak.level_db) {
                let [row, column] = [row, column].map(|n| n.as_u64().unwrap_or(0) as usize);
                peak = Some(Brightest {
                    position_m: plan.grid.position_m(row, column).to_array(),
                    level_db,
                    row,
                    column,
                });
            }
            records.push(
                serde_json::from_value(note["record"].clone())
                    .context("a tile's mark is damaged")?,
            );
        }
        let settings = self.judged(&records)?;
        interrupt::check()?;
        let checksums = session.progress("checksums");
        let inputs = self.history.inputs()?;
        checksums.finish();
        let collection = self.history.collection();
        let grid = &plan.grid;
        let record = record::Record {
            session,
            settings,
            grid,
            frame: &collection.frame,
            collection: forming::about(self.survey, self.history)?,
            support: {
                let middle_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
                RecordedLooks::of(collection, middle_m, [grid.x_axis, grid.y_axis])
            },
            inputs: &inputs,
            check: None,
            peak,
            orientation: Orientation::of(collection, grid),
            taken: start.elapsed(),
        };
        self.write(&record)
    }

    /// What was planned, and how well it turned out.
    fn judged(&self, records: &[TileRecord]) -> anyhow::Result<Value> {
        let Self { typed, plan, .. } = *self;
        let predicted_db = self.opened.judge(records);
        let missed = plan.bound_db.filter(|bound_db| predicted_db > *bound_db);
        if let Some(bound_db) = missed {
            let words = format!(
                "the predicted error is {predicted_db:.1} dB, above the {bound_db} dB asked"
            );
            if !plan.misses_allowed {
                let next = bound_db + plan.planned_db - predicted_db - 1.0;
                bail!(
                    "{words}: the grid is dark, beside something bright that it leaves out; include that in --grid, or plan \
                     for less with --error-db {next:.0}; {} keeps the tiles",
                    self.store.folder().display()
                );
            }
            messages::bound_missed(words);
        }
        let mut resolved = plan.summary.as_object().cloned().unwrap_or_default();
        resolved.insert("predicted_error_db".to_owned(), predicted_db.into());
        resolved.insert("planned_error_db".to_owned(), plan.planned_db.into());
        if let Some(bound_db) = plan.bound_db {
            resolved.insert("error_db".to_owned(), bound_db.into());
            resolved.insert("bound_missed".to_owned(), missed.is_some().into());
        }
        let mut settings = record::settings(typed, &plan.former, &resolved);
        settings["window"] = plan.window.clone().into();
        settings["slow_window"] = plan.slow_window.clone().into();
        settings["scratch_bytes"] = plan.scratch_bytes.into();
        Ok(settings)
    }

    fn write(&self, record: &record::Record) -> anyhow::Result<()> {
        let Self {
            session,
            typed,
            plan,
            store,
            ..
        } = *self;
        let writing = session.progress("writing");
        let title = format!("{}, {}", self.survey.name, plan.former);
        let quicklook = plot::quicklook_within(
            &Panel {
                scale: typed.look.scale(),
                colours: typed.look.colours(),
                orientation: record.orientation,
                ..Panel::new(plot::Source::Parts(store), record.grid, title.as_str())
            },
            session.memory.picture_bytes,
        )?;
        let mut metadata = record.to_json(&title);
        metadata["image"]["file"] = subaperture::io::tiles::NAME.into();
        TiledProduct {
            store,
            metadata: &metadata,
            quicklook: &quicklook,
        }
        .write(&typed.out)?;
        writing.finish();
        super::tell(
            session,
            typed,
            [plan.grid.rows.count, plan.grid.columns.count],
            record,
            metadata,
        )
    }
}
