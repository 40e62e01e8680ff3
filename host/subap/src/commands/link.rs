//! `subap link`: send recordings to the embedded module and store its products.

mod detect;
mod image;
mod increments;
pub(super) mod line;
mod outcome;
mod picture;
pub(super) mod profiles;
pub(super) mod receiving;
mod work;

use std::time::Instant;

use anyhow::Context;
use subaperture::io::ours::Kind;
use subaperture::io::product::{self, Product};
use subaperture::module::plan::ModuleProduct;
use subaperture::phase_history::PhaseHistory;
use subaperture::resolution::survey::Survey;
use subaperture::signal::window::Window;

use self::line::{Line, with_module};
use self::receiving::Watching;
use self::work::{Work, cancellation, plan};
use crate::args::{Link, Sent};
use crate::config::Session;
use crate::failure::Usage;

/// Let the module compute the product, and store it. Received parts are kept in any case.
pub(crate) fn run(session: &Session, typed: &Link) -> anyhow::Result<()> {
    let start = Instant::now();
    check_options(typed)?;
    let Some(product) = typed.send.planned() else {
        return match typed.send {
            Sent::Profiles => profiles::run(session, typed, start),
            _ => increments::run(session, typed, start),
        };
    };
    let mut claims = session.claims(&typed.writing, &typed.input.files);
    match product {
        ModuleProduct::Maps => claims.file(&typed.out, Kind::Maps)?,
        ModuleProduct::Image => claims.folder(&typed.out, product::NAMES)?,
        ModuleProduct::Detections => claims.file(&typed.out, Kind::Text)?,
    }
    if let Some(picture) = &typed.picture {
        claims.file(picture, Kind::Picture).context("--picture")?;
    }
    let channels = session.open_for_module(&typed.input, product)?;
    let channels: Vec<&dyn PhaseHistory> = channels.iter().map(|channel| &**channel).collect();
    let dpca = typed.dpca.then(|| cancellation(&channels)).transpose()?;
    let collection = channels[0].collection();
    let survey = Survey::of(collection).context("the input holds no pulses")?;
    let grid = session.grid(typed.grid.as_ref(), &survey)?;
    session.check_grid(&grid, 1)?;
    product.check_grid(&grid).context("--send image")?;
    if product == ModuleProduct::Image {
        Product::prepare(&typed.out, grid.num_pixels())?;
    }
    let (line, num_samples) = (Line::of(typed), collection.num_samples);
    let mut watch = Watching::new(session);
    with_module(session, line, num_samples, &mut watch, |module, watch| {
        let identity = module.identity().clone();
        let plan = plan(session, typed, &channels, &grid, &identity, product)?;
        let work = Work::new(session, typed, &channels, &grid, &plan, product, dpca)?;
        let mut job = work.job()?;
        if typed.rehearsal.dry_run {
            return work.rehearse(module, &job, watch);
        }
        match product {
            ModuleProduct::Maps => {
                let run = work.run(&survey.name, &identity, &job)?;
                work.transfer(module, &run, &mut job, watch, start)
            }
            ModuleProduct::Image => work.accumulate(module, &survey, &mut job, watch, start),
            ModuleProduct::Detections => work.detect(module, &mut job, watch, start),
        }
    })
}

/// Check that options suit the product and the module.
fn check_options(typed: &Link) -> Result<(), Usage> {
    const PLANNED: &[&str] = &["maps", "image", "detections"];
    const RECORDING: &[&str] = &["maps", "image", "detections", "increments"];
    let sent = typed.send.name();
    let other_slow_window = typed.windows.slow_window != Window::default();
    for (option, given, expected) in [
        ("--picture", typed.picture.is_some(), &["maps", "image"][..]),
        ("--power", typed.power, &["image"]),
        ("--verify", typed.verify, &["maps", "image"]),
        (
            "--false-alarms",
            typed.false_alarms.is_some(),
            &["detections"],
        ),
        ("--dpca", typed.dpca, &["detections"]),
        ("--range", typed.range.is_some(), &["increments"]),
        ("--channel", typed.input.channel.is_some(), PLANNED),
        ("--channels", typed.input.channels.is_some(), RECORDING),
        ("--set", !typed.input.set.is_empty(), RECORDING),
        ("--slow-window", other_slow_window, PLANNED),
        ("--grid", typed.grid.is_some(), PLANNED),
        ("--error-db", typed.error_db.is_some(), PLANNED),
        ("--rate", typed.rate.is_some(), PLANNED),
        ("--front-end", typed.front_end, RECORDING),
        ("--dry-run", typed.rehearsal.dry_run, PLANNED),
    ] {
        if given && !expected.contains(&&*sent) {
            return Err(Usage(format!(
                "{option}: expected --send {}, found --send {sent}: leave {option} out, or change --send",
                expected.join(" or ")
            )));
        }
    }
    if typed.dpca && other_slow_window {
        return Err(Usage(
            "--slow-window: expected no other window with --dpca, whose Hann window is displaced by the lag of the second channel: leave it \
             out"
            .to_owned(),
        ));
    }
    let paced = typed.rate.is_some() || typed.front_end;
    if typed.picture.is_some() && typed.send == Sent::Image && paced {
        return Err(Usage(
            "--picture: with --send image expected pulses that can wait, found --rate or --front-end: leave --picture out, or \
             give --send maps"
                .to_owned(),
        ));
    }
    Line::of(typed).check()
}
