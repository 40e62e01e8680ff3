//! `subap link`: recordings to a module, its maps into a file.

mod picture;

use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, bail};
use serde_json::{Map, Value, json};
use subaperture::geometry::ImageGrid;
use subaperture::io::ours::Kind;
use subaperture::io::product::record::grid as grid_record;
use subaperture::monitor::Monitor;
use subaperture::onboard::link::{
    self, Buffers, Counts, Ending, HostCore, Identity, Job, LinkError, MapSink, Outcome, Place,
    PulseSource, Settings, SinkError, Verified, Watch,
};
use subaperture::onboard::maps::{Arithmetic, Closing, OwnedMap, Run};
use subaperture::onboard::maps_file as maps;
use subaperture::onboard::maps_file::{MOST_MAPS, MapWriter};
use subaperture::onboard::plan::{OnboardPlan, Requirements, Room};
use subaperture::phase_history::{Collection, PhaseHistory, Weights};
use subaperture::resolution::survey::Survey;
use subaperture_core::link as wire;
use subaperture_core::link::{AssembledMap, Encoding};

use self::picture::Picture;
use crate::ahead::Ahead;
use crate::args::Link;
use crate::commands::plan::gaps;
use crate::config::{DEFAULT_MAPS_ERROR_DB, Session, record_of_run};
use crate::failure::{InterruptedWithMaps, Usage};
use crate::progress::Progress;
use crate::{interrupt, messages, text};

/// Has the module compute the maps. Those that came are kept, however it ends.
pub(crate) fn run(session: &Session, typed: &Link) -> anyhow::Result<()> {
    let start = Instant::now();
    check_firmware(typed)?;
    let mut claims = session.claims(&typed.writing, &typed.input.paths);
    claims.file(&typed.out, Kind::Maps)?;
    if let Some(picture) = &typed.picture {
        claims.file(picture, Kind::Picture).context("--picture")?;
    }
    let history = session.open(&typed.input)?;
    let collection = history.collection();
    let survey = Survey::of(collection).context("the input holds no pulses")?;
    let grid = match typed.grid {
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
        told: None,
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

/// A program is given only where there is one to emulate.
fn check_firmware(typed: &Link) -> Result<(), Usage> {
    if typed.firmware.is_some() && !matches!(typed.place, Place::Emulate(_)) {
        let what = format!(
            "--firmware is what to emulate, and {} runs its own",
            typed.place
        );
        return Err(Usage(what));
    }
    Ok(())
}

/// How patient the session is, on a line of this speed.
fn settings(typed: &Link, baud: Option<u32>, num_samples: usize) -> Settings {
    Settings {
        // Half a second, and four of the longest frames on a line of this speed.
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

/// The plan for a module that was built so.
fn plan(
    session: &Session,
    typed: &Link,
    collection: &Collection,
    grid: &ImageGrid,
    identity: &Identity,
) -> anyhow::Result<OnboardPlan> {
    let requirements = Requirements {
        error_db: typed.error_db.unwrap_or(DEFAULT_MAPS_ERROR_DB),
        room: Room::Built(identity.capacity),
        arithmetic: match identity.arithmetic {
            wire::Arithmetic::Float => Arithmetic::Float,
            wire::Arithmetic::Fixed => Arithmetic::Fixed,
        },
    };
    let plan = OnboardPlan::new(collection, grid, &requirements)?;
    session.note(1, || {
        format!(
            "{} patches, {} sub-CPIs of {} pulses, predicted error {:.1} dB",
            plan.patches.len(),
            plan.num_sub_cpis,
            plan.setup.num_pulses,
            plan.predicted_db
        )
    });
    if let Some(gaps) = gaps(&plan) {
        session.note(1, || format!("track: {gaps}"));
    }
    let num_maps = num_maps(&plan);
    if num_maps > MOST_MAPS {
        bail!(
            "{num_maps} maps are more than the {MOST_MAPS} of a file: give a smaller --grid, or link the \
             recordings one by one"
        );
    }
    Ok(plan)
}

/// Maps that there are to be.
fn num_maps(plan: &OnboardPlan) -> u64 {
    plan.num_sub_cpis as u64 * plan.patches.len() as u64
}

/// What the module is to do.
struct Work<'w> {
    session: &'w Session,
    typed: &'w Link,
    history: &'w dyn PhaseHistory,
    grid: &'w ImageGrid,
    plan: &'w OnboardPlan,
    /// One a frequency; they sum to 1.
    fast_weights: Vec<f32>,
    slow_weights: Vec<f64>,
}

impl<'w> Work<'w> {
    fn new(
        session: &'w Session,
        typed: &'w Link,
        history: &'w dyn PhaseHistory,
        grid: &'w ImageGrid,
        plan: &'w OnboardPlan,
    ) -> Self {
        let weights = Weights::new(history.collection(), typed.window, typed.slow_window);
        let fast_sum: f64 = weights.fast.iter().sum();
        Self {
            session,
            typed,
            history,
            grid,
            plan,
            fast_weights: weights.fast.iter().map(|w| (w / fast_sum) as f32).collect(),
            slow_weights: weights.slow,
        }
    }

    fn job(&self) -> anyhow::Result<Job<'w>> {
        let encoding = match self.plan.arithmetic {
            Arithmetic::Float => Encoding::Complex32,
            Arithmetic::Fixed => Encoding::Sc16,
        };
        Ok(Job {
            setup: self.plan.setup,
            fast_weights: self.fast_weights.clone(),
            patches: self.plan.patches.clone(),
            pulses: PulseSource::new(self.history, &self.slow_weights, encoding)?,
        })
    }

    /// Says what the transfer will take.
    fn rehearse(
        &self,
        module: &mut link::Session<'_>,
        job: &Job<'_>,
        watch: &mut Watching,
    ) -> anyhow::Result<()> {
        let Self { typed, plan, .. } = *self;
        let time = link::rehearse(module, job, self.history, watch)?;
        watch.bar.finish();
        let what = format!(
            "{} maps of {} pulses by the module at {}; lost ones come on top",
            num_maps(plan),
            job.pulses.len(),
            typed.place
        );
        let file_bytes = maps::file_bytes(plan.num_sub_cpis as u64, &plan.patches, plan.arithmetic);
        let picture_bytes = match &typed.picture {
            Some(_) => link::RunningImage::held_bytes(self.grid, &plan.patches),
            None => 0,
        };
        let held_bytes = self.history.held_bytes() + picture_bytes;
        let disk = vec![(typed.out.clone(), file_bytes)];
        Ahead::new(self.session, what, held_bytes, time, disk)
            .announce(self.session, &typed.rehearsal)?;
        Ok(())
    }

    /// What the file says of its maps before there are any.
    fn run(&self, name: &str, identity: &Identity, job: &Job<'_>) -> anyhow::Result<Run> {
        Ok(Run {
            name: name.to_owned(),
            setup: self.plan.setup,
            arithmetic: self.plan.arithmetic,
            fast_window: self.typed.window.to_string(),
            fast_weights: self.fast_weights.clone(),
            frame: self.history.collection().frame,
            provenance: self.provenance(identity, job)?,
        })
    }

    /// Has the module do it, and keeps the maps that come.
    fn transfer(
        &self,
        module: &mut link::Session<'_>,
        run: &Run,
        job: &mut Job<'_>,
        watch: &mut Watching,
        start: Instant,
    ) -> anyhow::Result<()> {
        let Self { session, typed, .. } = *self;
        // From here on an interruption keeps the maps that came.
        let _keeping = interrupt::Keeping::begin();
        let mut writer = MapWriter::create(&typed.out, run)?;
        let mut keep = Keep {
            writer: &mut writer,
            picture: self.picture(run),
        };
        let (outcome, compared) = if typed.verify {
            let core = HostCore::new(self.job()?)?;
            let mut verified = Verified::new(&mut keep, core);
            let outcome = module.transfer(job, &mut verified, watch);
            (outcome, Some(verified.counts()))
        } else {
            (module.transfer(job, &mut keep, watch), None)
        };
        watch.bar.finish();
        let picture = keep.picture.take();
        let maps = writer.num_maps() as u64;
        if maps > 0 {
            writer.finish(&closing(&outcome, job, compared, maps))?;
        }
        // The maps are safe before the last picture is drawn.
        let drawn = picture.map(Picture::finish);
        report(session, typed, &outcome, compared, maps, start.elapsed())?;
        if let Some(drawn) = drawn {
            let left_out = drawn?;
            if left_out > 0 {
                messages::warning(format!(
                    "{left_out} maps came too fast for --picture and are not in it; they are in {}",
                    typed.out.display()
                ));
            }
        }
        Ok(())
    }

    /// The picture that grows with the maps, if it is wanted.
    fn picture(&self, run: &Run) -> Option<Picture> {
        let path = self.typed.picture.as_deref()?;
        let image = link::RunningImage::new(
            run,
            self.grid,
            self.plan.patches.len(),
            self.typed.error_db.unwrap_or(DEFAULT_MAPS_ERROR_DB),
            self.session.memory_bytes,
        );
        Some(Picture::start(path, image, self.grid, run.name.clone()))
    }

    /// Where the maps come from.
    fn provenance(&self, identity: &Identity, job: &Job<'_>) -> anyhow::Result<Map<String, Value>> {
        let Self {
            session,
            typed,
            history,
            grid,
            plan,
            ..
        } = *self;
        let capacity = identity.capacity;
        let record = json!({
            "run": record_of_run(session, Duration::ZERO),
            "module": {
                "place": typed.place.to_string(),
                "version": identity.version,
                "capacity": {
                    "pulses": capacity.pulses,
                    "frequencies": capacity.frequencies,
                    "range_bins": capacity.range_bins,
                    "doppler_bins": capacity.doppler_bins,
                    "patches": capacity.patches,
                },
            },
            "inputs": history.inputs()?,
            "grid": grid_record(grid),
            "error_db": typed.error_db.unwrap_or(DEFAULT_MAPS_ERROR_DB),
            "predicted_error_db": plan.predicted_db,
            "slow_window": typed.slow_window.to_string(),
            "rate_hz": typed.rate,
            "amplitude_scale": job.pulses.amplitude_scale(),
        });
        match record {
            Value::Object(object) => Ok(object),
            _ => Ok(Map::new()),
        }
    }
}

/// What is said at the end, and whether it is a failure: it is unless every map came.
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
            "path": path,
            "maps": maps,
            "ending": ending_name(&outcome.ending, maps < outcome.counts.maps_wanted),
            "counters": outcome.counts.to_json(),
            "run": record_of_run(session, taken),
        });
        if let Some((same, different)) = compared {
            report["verified"] = json!({ "same": same, "different": different });
        }
        text::say_json("link", report)?;
    } else if session.tells() && maps > 0 {
        text::say(format!("{path}: {maps} maps in {}", text::duration(taken)))?;
        text::say(outcome.counts.to_string())?;
    }
    if let Some((same, different)) = compared
        && maps > 0
        && !session.json()
    {
        text::say(format!(
            "verified  {same} maps the same as the core's here, bit by bit, {different} not"
        ))?;
    }
    if let Some((_, different)) = compared
        && different > 0
    {
        bail!(
            "{different} maps differ from the core's here and were left out: is the firmware of this \
             version?"
        );
    }
    match &outcome.ending {
        Ending::Complete => Ok(()),
        // A failure, so that no script takes an image of half the aperture for the whole.
        Ending::Incomplete => bail!(
            "{} of {} maps are missing: {}; {}",
            outcome.missing.len(),
            outcome.counts.maps_wanted,
            match typed.rate {
                Some(_) => "the module or the line are too slow for this --rate",
                None => "the line loses too much, and more --retries may fetch them",
            },
            match maps {
                0 => "nothing was written".to_owned(),
                _ => format!("the {maps} that came are in {path}"),
            }
        ),
        Ending::Failed(LinkError::Cancelled) if maps > 0 => {
            Err(InterruptedWithMaps { maps, path }.into())
        }
        Ending::Failed(LinkError::Cancelled) => Err(LinkError::Cancelled.into()),
        Ending::Failed(error) if maps > 0 => {
            bail!("{error}; the {maps} maps received so far are in {path}")
        }
        Ending::Failed(error) => bail!("{error}"),
    }
}

/// A number that an earlier session is unlikely to have used.
fn number_of_now() -> u32 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(1, |now| now.as_millis() as u32)
}

/// What is known at the end.
fn closing(
    outcome: &Outcome,
    job: &Job<'_>,
    compared: Option<(u64, u64)>,
    written: u64,
) -> Closing {
    /// Missing maps that are named one by one.
    const NAMED: usize = 1000;
    // Those that came and were not the core's own are missing too.
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
    Closing {
        num_pulses: job.pulses.len().into(),
        weight_sum: job.pulses.weight_sum(),
        counters,
    }
}

/// How a transfer ended, in a word, or why it failed.
fn ending_name(ending: &Ending, some_are_missing: bool) -> String {
    match ending {
        Ending::Complete if !some_are_missing => "complete".to_owned(),
        Ending::Complete | Ending::Incomplete => "incomplete".to_owned(),
        Ending::Failed(error) => error.to_string(),
    }
}

/// Into the file, and into the picture.
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

/// The progress line.
struct Watching {
    bar: Progress,
    verbose: bool,
    /// When numbers were shown last, and the bytes of then.
    told: Option<(Instant, u64, u64)>,
}

impl Watch for Watching {
    fn update(&mut self, counts: &Counts) {
        let now = Instant::now();
        let (bytes_out, bytes_in) = (counts.bytes_to_module, counts.bytes_from_module);
        let Some((then, before_out, before_in)) = self.told else {
            self.told = Some((now, bytes_out, bytes_in));
            return;
        };
        let passed_s = (now - then).as_secs_f64();
        if passed_s < 0.5 {
            return;
        }
        self.told = Some((now, bytes_out, bytes_in));
        let rate = |now: u64, before: u64| (now - before) as f64 / passed_s / 1e3;
        let damaged = counts.frames_from_module.damaged + counts.frames_to_module.damaged;
        self.bar.tell(format!(
            "{} of {} maps, {:.0} kB/s out, {:.0} kB/s in, {damaged} damaged, {} maps lost",
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
