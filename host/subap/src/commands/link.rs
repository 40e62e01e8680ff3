//! `subap link`: send recordings to the embedded module and store its maps.

mod picture;
mod work;

use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, bail};
use serde_json::json;
use subaperture::io::ours::Kind;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::module::link::{
    self, Buffers, Counts, Job, LinkError, MapSink, ModuleAddress, Outcome, SessionObserver,
    Settings, SinkError, TransferEnd,
};
use subaperture::module::maps::{OwnedMap, RunTotals};
use subaperture::module::maps_file::MapWriter;
use subaperture::monitor::Monitor;
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;
use subaperture_core::link as wire;
use subaperture_core::link::AssembledMap;

use self::picture::Picture;
use self::work::{Work, plan};
use crate::advice;
use crate::args::Link;
use crate::config::{Session, record_of_run};
use crate::failure::{InterruptedWithMaps, Usage};
use crate::progress::Progress;
use crate::{interrupt, messages, text};

/// Let the module compute the maps. Maps received are kept in any case.
pub(crate) fn run(session: &Session, typed: &Link) -> anyhow::Result<()> {
    let start = Instant::now();
    check_firmware(typed)?;
    typed.input.refuse_several("a module")?;
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    claims.file(&typed.out, Kind::Maps)?;
    if let Some(picture) = &typed.picture {
        claims.file(picture, Kind::Picture).context("--picture")?;
    }
    let history = session.open(&typed.input)?;
    let collection = history.collection();
    let survey = Survey::of(collection).context("the input holds no pulses")?;
    let grid = match typed.grid.clone() {
        Some(grid) => grid,
        None => session.default_grid(&survey)?,
    };
    session.check_grid(&grid, 1)?;

    let verbose = session.verbosity() > 0;
    let mut transport = link::open(&typed.place, typed.firmware.as_deref(), verbose)?;
    let settings = settings(typed, transport.baud(), collection.num_samples);
    let mut watch = Watching {
        bar: session.progress("linking"),
        verbose,
        last: None,
    };
    let mut buffers = Buffers::new();
    let mut module = link::Session::open(&mut *transport, &mut buffers, settings, &mut watch)
        .with_context(|| format!("{}", typed.place))?;
    let identity = module.identity().clone();
    session.note(1, || format!("{} at {}", identity.version, typed.place));

    let plan = plan(session, typed, collection, &grid, &identity)?;
    let work = Work::new(session, typed, &history, &grid, &plan);
    let mut job = work.job()?;
    if typed.rehearsal.dry_run {
        return work.rehearse(&mut module, &job, &mut watch);
    }
    let run = work.run(&survey.name, &identity, &job)?;
    work.transfer(&mut module, &run, &mut job, &mut watch, start)
}

/// Check that a program is given only for an emulated module.
fn check_firmware(typed: &Link) -> Result<(), Usage> {
    if typed.firmware.is_some() && !matches!(typed.place, ModuleAddress::Emulate(_)) {
        let fault = format!(
            "--firmware applies to an emulated module; {} runs its own: leave it out",
            typed.place
        );
        return Err(Usage(fault));
    }
    Ok(())
}

/// Time limits of the session on a line of this speed.
fn settings(typed: &Link, baud: Option<u32>, num_samples: usize) -> Settings {
    Settings {
        // Half a second, and four times the longest frame on a line of this speed.
        answer: Duration::from_millis(500)
            + baud.map_or(Duration::ZERO, |baud| {
                let bits = 10.0 * wire::max_frame_bytes(num_samples) as f64;
                Duration::from_secs_f64(4.0 * bits / f64::from(baud))
            }),
        retries: typed.retries,
        rate_hz: typed.rate,
        first_number: number_of_now(),
        ..Settings::default()
    }
}

/// Report the outcome. It is an error unless all maps were received.
fn report(
    session: &Session,
    typed: &Link,
    outcome: &Outcome,
    compared: Option<(u64, u64)>,
    maps: u64,
    taken: Duration,
) -> anyhow::Result<()> {
    let path = typed.out.display().to_string();
    if session.json() {
        let mut report = json!({
            "maps": maps,
            "ending": ending_name(&outcome.ending, maps < outcome.counts.maps_wanted),
            "counters": outcome.counts.to_json(),
            "run": record_of_run(session, taken),
        });
        if let Some((same, different)) = compared {
            report["verified"] = json!({ "same": same, "different": different });
        }
        let mut files = Vec::new();
        if maps > 0 {
            files.push(WrittenFile::new(&typed.out, FileKind::Maps));
        }
        let picture = typed.picture.iter().filter(|path| path.exists());
        files.extend(picture.map(|path| WrittenFile::new(path, FileKind::Picture)));
        report["files"] = json!(files);
        text::say_json("link", report)?;
    } else if session.prints_text() && maps > 0 {
        text::say(format!("{path}: {maps} maps in {}", text::duration(taken)))?;
        text::say(outcome.counts.to_string())?;
    }
    if let Some((same, different)) = compared
        && maps > 0
        && !session.json()
    {
        text::say(format!(
            "verified  {same} maps bit-identical to the core on this computer, {different} not"
        ))?;
    }
    if let Some((_, different)) = compared
        && different > 0
    {
        bail!(
            "{different} maps differ from those of the core on this computer and were left out: is the firmware of this \
             version?"
        );
    }
    match &outcome.ending {
        TransferEnd::Complete => Ok(()),
        // An error status, so that scripts do not use an incomplete aperture unnoticed.
        TransferEnd::Incomplete => bail!(
            "{} of {} maps are missing: {}; {}",
            outcome.missing.len(),
            outcome.counts.maps_wanted,
            match typed.rate {
                Some(_) => "module or line are too slow for this --rate",
                None => "the line loses too many frames: raise --retries",
            },
            match maps {
                0 => "nothing was written".to_owned(),
                _ => format!("the {maps} maps received are in {path}"),
            }
        ),
        TransferEnd::Failed(LinkError::Cancelled) if maps > 0 => {
            Err(InterruptedWithMaps { maps, path }.into())
        }
        TransferEnd::Failed(LinkError::Cancelled) => Err(LinkError::Cancelled.into()),
        TransferEnd::Failed(error) if maps > 0 => {
            bail!(
                "{}; the {maps} maps received so far are in {path}",
                advice::with_advice(error)
            )
        }
        TransferEnd::Failed(error) => bail!("{}", advice::with_advice(error)),
    }
}

/// Session number from the clock, different from earlier sessions in all likelihood.
fn number_of_now() -> u32 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(1, |now| now.as_millis() as u32)
}

/// Closing record of the file.
fn closing(
    outcome: &Outcome,
    job: &Job<'_>,
    compared: Option<(u64, u64)>,
    written: u64,
) -> RunTotals {
    /// Maximum number of missing maps listed individually.
    const NAMED: usize = 1000;
    // Received maps that failed verification count as missing too.
    let missing = outcome.counts.maps_wanted.saturating_sub(written);
    let mut counters = outcome.counts.to_json();
    let named = outcome.missing.iter().take(NAMED);
    counters.insert(
        "missing".to_owned(),
        named
            .map(|(sub_cpi, patch)| json!([sub_cpi, patch]))
            .collect(),
    );
    counters.insert("maps_missing".to_owned(), json!(missing));
    counters.insert(
        "ending".to_owned(),
        json!(ending_name(
            &outcome.ending,
            written < outcome.counts.maps_wanted
        )),
    );
    if let Some((same, different)) = compared {
        counters.insert(
            "verified".to_owned(),
            json!({ "same": same, "different": different }),
        );
    }
    RunTotals {
        num_pulses: job.pulses.len().into(),
        weight_sum: job.pulses.weight_sum(),
        counters,
    }
}

/// Ending of a transfer in one word, or its failure.
fn ending_name(ending: &TransferEnd, some_are_missing: bool) -> String {
    match ending {
        TransferEnd::Complete if !some_are_missing => "complete".to_owned(),
        TransferEnd::Complete | TransferEnd::Incomplete => "incomplete".to_owned(),
        TransferEnd::Failed(error) => error.to_string(),
    }
}

/// Sink that writes maps to the file and adds them to the picture.
struct Keep<'a> {
    writer: &'a mut MapWriter,
    picture: Option<Picture>,
}

impl MapSink for Keep<'_> {
    fn accept(&mut self, map: &AssembledMap<'_>) -> Result<(), SinkError> {
        let map = OwnedMap::from(map);
        self.writer.append(&map.view())?;
        if let Some(picture) = &mut self.picture {
            picture.take(map);
        }
        Ok(())
    }
}

/// Monitor that shows a progress line.
struct Watching {
    bar: Progress,
    verbose: bool,
    /// Time and byte counts of the last display.
    last: Option<(Instant, u64, u64)>,
}

impl SessionObserver for Watching {
    fn update(&mut self, counts: &Counts) {
        let now = Instant::now();
        let (bytes_out, bytes_in) = (counts.bytes_to_module, counts.bytes_from_module);
        let Some((then, before_out, before_in)) = self.last else {
            self.last = Some((now, bytes_out, bytes_in));
            return;
        };
        let passed_s = (now - then).as_secs_f64();
        if passed_s < 0.5 {
            return;
        }
        self.last = Some((now, bytes_out, bytes_in));
        let rate = |now: u64, before: u64| (now - before) as f64 / passed_s / 1e3;
        let damaged = counts.frames_from_module.damaged + counts.frames_to_module.damaged;
        self.bar.set_label(format!(
            "{} of {} maps, {:.0} kB/s sent, {:.0} kB/s received, {damaged} damaged frames, {} lost maps",
            counts.maps_taken,
            counts.maps_wanted,
            rate(bytes_out, before_out),
            rate(bytes_in, before_in),
            counts.maps_lost
        ));
        if counts.maps_wanted > 0 {
            let done = counts.maps_taken as f64 / counts.maps_wanted as f64;
            self.bar.progress(done);
        }
    }

    fn log(&mut self, text: &str) {
        if self.verbose {
            messages::note(text);
        }
    }

    fn cancelled(&self) -> bool {
        interrupt::pressed()
    }
}
