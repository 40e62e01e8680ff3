//! `subap run`: run a processing pipeline from one TOML file; unchanged stages are reused.
//!
//! [`subaperture::job`] contains the schema, the stage logic and the state. Modules here: options of each stage (`options`), dependencies
//! (`chain`), processing (`work`), and the report (`report`, `tables`, `page`).

mod chain;
mod options;
mod page;
mod rehearsal;
mod report;
mod tables;
mod work;

use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::geometry::SceneFrame;
use subaperture::io::claim::OutputClaims;
use subaperture::job::{self, FinishedStage, JobText, RunReason, State, stamp};
use subaperture::phase_history::{InputFile, PhaseHistory};

use crate::args::{Run, Writing};
use crate::config::Session;
use crate::failure::InterruptedJob;
use crate::{interrupt, messages, text};
use chain::{Link, REPORT, Stage};
use options::Options;
use work::Worker;

/// Does a job, or prints what there is to know of jobs.
pub(crate) fn run(session: &Session, typed: &Run) -> anyhow::Result<()> {
    if typed.keys {
        text::say(job::reference())?;
    }
    if typed.example {
        text::say(job::EXAMPLE)?;
    }
    let Some(path) = &typed.job else {
        return Ok(());
    };
    let job = JobText::read(path, "--set", &typed.set, session.memory_bytes)?;
    let options = Options::of(&job, path, typed.writing).map_err(|found| job.explain(found))?;
    // Settings that say nothing together are told before anything is read.
    options.focus.typed.image.former.former()?;
    if typed.rehearsal.dry_run {
        let state = State::read(&options.out)?;
        let (inputs, frame) = inputs(session, &options)?;
        check_place(&job, &options, &frame)?;
        let chain = chain::chain(&job, &options, &inputs)?;
        return rehearsal::tell(session, &options, &chain, &state);
    }
    let done = whole(session, typed, &job, &options);
    match done {
        Err(error) if interrupt::pressed() => {
            // What was done stands, and is worth a word.
            Err(match options.out.join(job::NAME).exists() {
                true => InterruptedJob(options.out.display().to_string()).into(),
                false => error,
            })
        }
        done => done,
    }
}

/// What was done of a stage.
struct Stood {
    name: &'static str,
    /// Why it was done; `None` if it stood.
    why: Option<RunReason>,
    seconds: f64,
}

fn whole(session: &Session, typed: &Run, job: &JobText, options: &Options) -> anyhow::Result<()> {
    let out = &options.out;
    let path = typed.job.as_deref().expect("a job is done");
    let _claims = claim(session, &typed.writing, path, options)?;
    let ours = out.join(job::NAME).exists();
    let mut state = match State::read(out) {
        Err(_) if typed.writing.force => State::default(),
        state => state?,
    };
    let silent = session.silent();
    let worker = Worker {
        session: &silent,
        options,
        writing: typed.writing,
        ours,
    };
    worker.refuse_others()?;
    let (inputs, frame) = inputs(&silent, options)?;
    check_place(job, options, &frame)?;
    let reading = messages::part();
    let chain = chain::chain(job, options, &inputs)?;
    let names: Vec<&str> = chain.iter().map(Link::name).collect();
    for gone in state.keep(&[&names[..], &[REPORT]].concat()) {
        worker.sweep(&gone.outputs);
    }
    let mut all = Vec::new();
    for link in &chain {
        all.push(done(session, &worker, link, &mut state)?);
        interrupt::check()?;
    }
    let warnings = warnings(&reading.warnings, &chain, &state);
    report::stage(
        session, &worker, job, &inputs, &chain, &mut state, &mut all, &warnings,
    )?;
    messages::keep(warnings);
    tell(session, options, &state, &all)
}

/// Every warning, once: of the recordings, and of all stages, those that stand too.
fn warnings(reading: &[String], chain: &[Link], state: &State) -> Vec<String> {
    let of_stages = chain.iter().filter_map(|link| state.made(link.name()));
    let of_stages = of_stages.flat_map(|made| &made.warnings);
    let mut all: Vec<String> = Vec::new();
    for warning in reading.iter().chain(of_stages) {
        if !all.contains(warning) {
            all.push(warning.clone());
        }
    }
    all
}

/// Keeps other runs from the folder, and refuses what may not be replaced of the files that are no stage's own to claim.
fn claim(
    session: &Session,
    writing: &Writing,
    path: &Path,
    options: &Options,
) -> anyhow::Result<OutputClaims> {
    let typed = &options.focus.typed;
    let inputs = std::iter::once(path).chain(typed.input.paths.iter().map(AsRef::as_ref));
    let mut claims = session.claims(writing, &inputs.collect::<Vec<_>>());
    claims.folder(
        &options.out,
        [
            job::NAME,
            report::NAME,
            "image.json",
            "image.png",
            options::PICTURE_PNG,
            options::TRACK_CSV,
            options::TRACK_PNG,
            options::CORRECTION,
            options::AUTOFOCUS_PNG,
            work::AUTOFOCUS_JSON,
            work::CHECK_JSON,
            work::QUALITY_JSON,
        ],
    )?;
    Ok(claims)
}

/// Refuses products that have no place on the Earth, where the recording is to be one's that has none.
fn check_place(job: &JobText, options: &Options, frame: &SceneFrame) -> anyhow::Result<()> {
    let mut formats = options.formats.iter();
    let of_the_earth = formats.find(|format| format.is_of_the_earth());
    match (of_the_earth, options.place, frame) {
        (Some(format), None, SceneFrame::Local) => {
            let products = job.values().section("products");
            let what = format!(
                "{} says where on the Earth an image is, and the recording ties its scene to no place there: say where its origin is, as \
                 place = \"39.78, -84.08, 230\"",
                format.name()
            );
            Err(job.explain(vec![products.fault("formats", what)]).into())
        }
        _ => Ok(()),
    }
}

/// Reads the recordings whole, for their sizes and checksums, and where the scene is.
fn inputs(session: &Session, options: &Options) -> anyhow::Result<(Vec<InputFile>, SceneFrame)> {
    let history = session.open(&options.focus.typed.input)?;
    let checksums = session.progress("checksums");
    let inputs = history.inputs()?;
    checksums.finish();
    if history.collection().pulses.is_empty() {
        anyhow::bail!("the input holds no pulses");
    }
    Ok((inputs, history.collection().frame))
}

/// Does a stage, unless it stands.
fn done(
    session: &Session,
    worker: &Worker,
    link: &Link,
    state: &mut State,
) -> anyhow::Result<Stood> {
    let name = link.name();
    let out = &worker.options.out;
    let why = state
        .why(out, &link.basis, &link.before)
        .with_context(|| format!("cannot read what {name} left in {}", out.display()))?;
    let Some(why) = why else {
        let made = state.made(name).expect("it stands");
        for warning in &made.warnings {
            match made.bound_missed {
                true => messages::bound_missed(warning),
                false => messages::warning(warning),
            }
        }
        messages::part();
        if session.tells() {
            text::say(format!("{name:<10} stands"))?;
        }
        return Ok(Stood {
            name,
            why: None,
            seconds: made.seconds,
        });
    };
    messages::note(&format!("{name}: {} ({why})", link.stage.what()));
    // Their files have names that depend on what is asked for.
    if matches!(link.stage, Stage::Products | Stage::Quality)
        && let Some(made) = state.made(name)
    {
        worker.sweep(&made.outputs.clone());
    }
    let resumed = worker.begin(link, &why, state)?;
    let begun = Instant::now();
    let outputs = worker.work(link.stage)?;
    interrupt::check()?;
    let stamps = outputs.iter().map(|output| {
        let path = out.join(output);
        let stamped =
            stamp(&path, output).with_context(|| format!("cannot read {}", path.display()))?;
        stamped.with_context(|| format!("{} is gone", path.display()))
    });
    let part = messages::part();
    let seconds = begun.elapsed().as_secs_f64();
    state.finish(FinishedStage {
        basis: link.basis.clone(),
        outputs: stamps.collect::<Result<_, _>>()?,
        seconds,
        resumed,
        warnings: part.warnings,
        bound_missed: part.bound_missed,
    });
    state.write(out)?;
    if session.tells() {
        text::say(format!(
            "{name:<10} done in {} ({why})",
            text::duration(begun.elapsed())
        ))?;
    }
    Ok(Stood {
        name,
        why: Some(why),
        seconds,
    })
}

/// Says what is there.
fn tell(session: &Session, options: &Options, state: &State, all: &[Stood]) -> anyhow::Result<()> {
    let page = options.out.join(report::NAME);
    if session.json() {
        let stages: Vec<Value> = all
            .iter()
            .map(|stood| {
                json!({
                    "stage": stood.name,
                    "done": stood.why.is_some(),
                    "why": stood.why.as_ref().map(ToString::to_string),
                    "seconds": stood.seconds,
                })
            })
            .collect();
        let products = state.made(Stage::Products.name());
        return text::say_json(
            "run",
            json!({
                "folder": options.out.display().to_string(),
                "report": page.display().to_string(),
                "stages": stages,
                "products": products.map_or(&[][..], |made| &made.outputs),
            }),
        );
    }
    if session.tells() {
        text::say(page.display().to_string())?;
    }
    Ok(())
}
