//! `subap run`: run a processing pipeline from one TOML file; unchanged stages are reused.
//!
//! Every setting is defined once, as a field of a settings struct: the arguments of a command (`args`), or a section that only a job has
//! (`sections`). Its value in a job is parsed once:
//!
//! ```text
//! settings structs ── clap ──> options of the commands
//!        │    └────── keys ──> schema: names, help, defaults and words of the arguments; units, bounds and conditions by rules
//!        │                        │
//!        │   job.toml ── describe ┴─> settings by key (JSON, SI units) ──> fingerprint of each stage (chain)
//!        │                                 │
//!        └───────────── serde ─────────────┴─> sections ──> job: the arguments of each stage's command ──> work
//! ```
//!
//! A key has the name of its field. A key whose value is a text is read by the value parser of the option; a quantity is a number in SI units,
//! dB, or degrees where the option has degrees. Faults are collected: the schema reports names, types and bounds, `sections` invalid texts and
//! contradictions, each with its line.
//!
//! [`subaperture::job`] contains the text, the dependencies and the state of stages. Modules here: dependencies (`chain`), processing (`work`),
//! forecast (`forecast`), and the report (`report`, `tables`, `page`).

mod chain;
mod forecast;
mod job;
pub(crate) mod keys;
mod report;
mod sections;
mod tables;
mod work;

use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use serde_json::{Value, json};
use subaperture::geometry::SceneFrame;
use subaperture::io::claim::OutputClaims;
use subaperture::io::written::WrittenFile;
use subaperture::job::{FinishedStage, JobText, NAME, StageOutput, State};
use subaperture::phase_history::{InputFile, PhaseHistory};

use crate::args::{Run, Writing};
use crate::config::Session;
use crate::failure::InterruptedJob;
use crate::{interrupt, messages, text};
use chain::{Link, REPORT, Stage};
use job::Job;
use work::{StageOutcome, Worker};

/// Run a job, or print the keys or an example of jobs.
pub(crate) fn run(session: &Session, args: &Run) -> anyhow::Result<()> {
    if args.keys {
        text::say(keys::SCHEMA.reference())?;
    }
    if args.example {
        text::say(keys::EXAMPLE)?;
    }
    let Some(path) = &args.job else {
        return Ok(());
    };
    let text = JobText::read(
        path,
        &keys::SCHEMA,
        "--set",
        &args.set,
        session.memory_bytes,
    )?;
    let job = Job::new(&text, path, args.writing).map_err(|faults| text.explain(faults))?;
    // Options of the former that exclude each other are refused before any file is read.
    job.focus.image.forming.former.former()?;
    if args.rehearsal.dry_run {
        let state = State::read(&job.out)?;
        let (inputs, frame) = inputs(session, &job)?;
        check_place(&text, &job, &frame)?;
        let chain = chain::chain(&text, &job, &inputs)?;
        return forecast::print(session, &job, &chain, &state);
    }
    match run_stages(session, args, path, &text, &job) {
        // Finished stages remain, which the message states.
        Err(_) if interrupt::pressed() && job.out.join(NAME).exists() => {
            Err(InterruptedJob(job.out.display().to_string()).into())
        }
        result => result,
    }
}

/// Run the stages that are not up to date, and write the report.
fn run_stages(
    session: &Session,
    args: &Run,
    path: &Path,
    text: &JobText,
    job: &Job,
) -> anyhow::Result<()> {
    let out = &job.out;
    let _claims = claim(session, &args.writing, path, job)?;
    let is_job_folder = out.join(NAME).exists();
    let mut state = match State::read(out) {
        Err(_) if args.writing.force => State::default(),
        state => state?,
    };
    let silent = session.silent();
    let worker = Worker {
        session: &silent,
        job,
        writing: args.writing,
        is_job_folder,
    };
    worker.refuse_foreign_image()?;
    let (inputs, frame) = inputs(&silent, job)?;
    check_place(text, job, &frame)?;
    let reading = messages::part();
    let chain = chain::chain(text, job, &inputs)?;
    let names: Vec<&str> = chain.iter().map(Link::name).collect();
    for removed in state.keep(&[&names[..], &[REPORT]].concat()) {
        worker.remove_outputs(&removed.outputs);
    }
    let mut outcomes = Vec::new();
    for link in &chain {
        outcomes.push(run_stage(session, &worker, link, &mut state)?);
        interrupt::check()?;
    }
    let warnings = warnings(&reading.warnings, &chain, &state);
    outcomes.push(report::run_stage(
        session, &worker, text, &inputs, &chain, &mut state, &warnings,
    )?);
    messages::keep(warnings);
    print(session, job, &state, &outcomes)
}

/// Warnings of the recordings and of all stages, reused ones included, each once.
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

/// Lock the output folder, and refuse to replace files of other programs in it.
fn claim(
    session: &Session,
    writing: &Writing,
    path: &Path,
    job: &Job,
) -> anyhow::Result<OutputClaims> {
    let recordings = job.focus.input.files.iter().map(AsRef::as_ref);
    let inputs = std::iter::once(path).chain(recordings);
    let mut claims = session.claims(writing, &inputs.collect::<Vec<_>>());
    claims.folder(
        &job.out,
        [
            NAME,
            report::NAME,
            "image.json",
            "image.png",
            job::PICTURE_PNG,
            job::TRACK_CSV,
            job::TRACK_PNG,
            job::CORRECTION,
            job::AUTOFOCUS_PNG,
            work::AUTOFOCUS_JSON,
            work::CHECK_JSON,
            work::QUALITY_JSON,
        ],
    )?;
    Ok(claims)
}

/// Refuse products that need a position on the Earth if neither the job nor the recording states one.
fn check_place(text: &JobText, job: &Job, frame: &SceneFrame) -> anyhow::Result<()> {
    let mut formats = job.products.formats.iter();
    let placed = formats.find(|format| format.is_of_the_earth());
    match (placed, job.products.place, frame) {
        (Some(format), None, SceneFrame::Local) => {
            let products = text.values().section("products");
            let fault = format!(
                "{} needs the position of the scene on the Earth, which the recording does not state: give that of the scene's origin, as \
                 place = \"39.78, -84.08, 230\"",
                format.name()
            );
            Err(text.explain(vec![products.fault("formats", fault)]).into())
        }
        _ => Ok(()),
    }
}

/// Files of the recordings with sizes and checksums, and the frame of the scene. Reads the recordings completely.
fn inputs(session: &Session, job: &Job) -> anyhow::Result<(Vec<InputFile>, SceneFrame)> {
    let history = session.open(&job.focus.input)?;
    let checksums = session.progress("checksums");
    let inputs = history.inputs()?;
    checksums.finish();
    if history.collection().pulses.is_empty() {
        anyhow::bail!("the input holds no pulses");
    }
    Ok((inputs, history.collection().frame))
}

/// Run a stage, unless it is up to date.
fn run_stage(
    session: &Session,
    worker: &Worker,
    link: &Link,
    state: &mut State,
) -> anyhow::Result<StageOutcome> {
    let name = link.name();
    let out = &worker.job.out;
    let why = state
        .why(out, &link.basis, &link.before)
        .with_context(|| format!("cannot read the outputs of {name} in {}", out.display()))?;
    let Some(why) = why else {
        let made = state.made(name).expect("an up-to-date stage is finished");
        for warning in &made.warnings {
            match made.bound_missed {
                true => messages::bound_missed(warning),
                false => messages::warning(warning),
            }
        }
        messages::part();
        if session.prints_text() {
            text::say(format!("{name:<10} up to date"))?;
        }
        return Ok(StageOutcome {
            name,
            why: None,
            seconds: made.seconds,
        });
    };
    messages::note(&format!("{name}: {} ({why})", link.stage.result()));
    // The names of these files depend on the settings.
    if matches!(link.stage, Stage::Products | Stage::Quality)
        && let Some(made) = state.made(name)
    {
        worker.remove_outputs(&made.outputs.clone());
    }
    let resumed = worker.begin(link, &why, state)?;
    let begun = Instant::now();
    let outputs = worker.work(link.stage)?;
    interrupt::check()?;
    let stamps = outputs.iter().map(|output| {
        let path = output.path.display();
        let stamped = StageOutput::of(output, out);
        let stamped = stamped.with_context(|| format!("cannot read {path}"))?;
        stamped.with_context(|| format!("{path} is missing"))
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
    if session.prints_text() {
        text::say(format!(
            "{name:<10} done in {} ({why})",
            text::duration(begun.elapsed())
        ))?;
    }
    Ok(StageOutcome {
        name,
        why: Some(why),
        seconds,
    })
}

/// Print the stages and the path of the report.
fn print(
    session: &Session,
    job: &Job,
    state: &State,
    outcomes: &[StageOutcome],
) -> anyhow::Result<()> {
    let page = job.out.join(report::NAME);
    if session.json() {
        let stages: Vec<Value> = outcomes
            .iter()
            .map(|stage| {
                json!({
                    "stage": stage.name,
                    "done": stage.why.is_some(),
                    "why": stage.why.as_ref().map(ToString::to_string),
                    "seconds": stage.seconds,
                })
            })
            .collect();
        let made = outcomes.iter().filter_map(|stage| state.made(stage.name));
        let files: Vec<WrittenFile> = made
            .flat_map(|made| &made.outputs)
            .map(|output| output.file(&job.out))
            .collect();
        return text::say_json("run", json!({ "stages": stages, "files": files }));
    }
    if session.prints_text() {
        text::say(page.display().to_string())?;
    }
    Ok(())
}
