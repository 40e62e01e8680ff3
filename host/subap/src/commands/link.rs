//! `subap link`: send recordings to the embedded module and store its maps or its image.

mod detect;
mod image;
mod outcome;
mod picture;
mod receiving;
mod work;

use std::time::{Duration, Instant, SystemTime};

use anyhow::Context;
use subaperture::io::ours::Kind;
use subaperture::io::product::{self, Product};
use subaperture::module::link::{self, Buffers, ModuleAddress, Settings};
use subaperture::module::plan::ModuleProduct;
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;
use subaperture_core::link as wire;

use self::receiving::Watching;
use self::work::{Work, plan};
use crate::args::{Link, Sent};
use crate::config::Session;
use crate::failure::Usage;

/// Let the module compute the maps. Maps received are kept in any case.
pub(crate) fn run(session: &Session, typed: &Link) -> anyhow::Result<()> {
    let start = Instant::now();
    check_options(typed)?;
    typed.input.refuse_several("a module")?;
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    match typed.send {
        Sent::Maps => claims.file(&typed.out, Kind::Maps)?,
        Sent::Image => claims.folder(&typed.out, product::NAMES)?,
        Sent::Detections => claims.file(&typed.out, Kind::Text)?,
    }
    if let Some(picture) = &typed.picture {
        claims.file(picture, Kind::Picture).context("--picture")?;
    }
    let history = session.open(&typed.input)?;
    let collection = history.collection();
    let survey = Survey::of(collection).context("the input holds no pulses")?;
    let grid = session.grid(typed.grid.as_ref(), &survey)?;
    session.check_grid(&grid, 1)?;
    ModuleProduct::from(typed.send)
        .check_grid(&grid)
        .context("--send image")?;
    if typed.send == Sent::Image {
        Product::prepare(&typed.out, grid.num_pixels())?;
    }

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
    match typed.send {
        Sent::Maps => {
            let run = work.run(&survey.name, &identity, &job)?;
            work.transfer(&mut module, &run, &mut job, &mut watch, start)
        }
        Sent::Image => work.accumulate(&mut module, &survey, &mut job, &mut watch, start),
        Sent::Detections => work.detect(&mut module, &mut job, &mut watch, start),
    }
}

/// Check that options suit the product, and that a program is given only for an emulated module.
fn check_options(typed: &Link) -> Result<(), Usage> {
    let sent = ModuleProduct::from(typed.send).name();
    let false_alarms = typed.false_alarms.is_some();
    for (option, given, expected) in [
        ("--picture", typed.picture.is_some(), &["maps"][..]),
        ("--verify", typed.verify, &["maps", "image"]),
        ("--false-alarms", false_alarms, &["detections"]),
    ] {
        if given && !expected.contains(&sent) {
            return Err(Usage(format!(
                "{option}: expected --send {}, found --send {sent}: leave {option} out, or change --send",
                expected.join(" or ")
            )));
        }
    }
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

/// Session number from the clock, different from earlier sessions in all likelihood.
fn number_of_now() -> u32 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(1, |now| now.as_millis() as u32)
}
