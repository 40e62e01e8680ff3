//! `subap module`: test an embedded module.

use subaperture::io::ours::Kind;
use subaperture::module::selftest;
use subaperture_core::link::Level;

use super::checks;
use super::link::line::{Line, with_module};
use super::link::receiving::Watching;
use crate::args::{Module, ModuleSelftest, ModuleTask};
use crate::config::Session;
use crate::log;

/// Samples of the longest frame of the test.
const FRAME_SAMPLES: usize = 64;

/// Run the requested subcommand.
pub(crate) fn run(session: &Session, typed: &Module) -> anyhow::Result<()> {
    match &typed.task {
        ModuleTask::Selftest(typed) => selftest(session, typed),
    }
}

fn selftest(session: &Session, typed: &ModuleSelftest) -> anyhow::Result<()> {
    let mut claims = session.claims(&typed.writing, typed.firmware.as_slice());
    if let Some(out) = &typed.out {
        claims.file(out, Kind::Record)?;
    }
    let line = Line {
        place: &typed.place,
        firmware: typed.firmware.as_deref(),
        retries: 3,
        rate_hz: None,
        // The cost of each run is an event.
        events: Some(Level::Info),
    };
    line.check()?;
    let mut watch = Watching::new(session);
    let report = with_module(session, line, FRAME_SAMPLES, &mut watch, |module, watch| {
        Ok(selftest::run(module, &typed.place, log::now(), watch)?)
    })?;
    let tested = &report.about;
    let title = format!(
        "{} in {} at {}{}",
        tested.firmware,
        tested.arithmetic,
        tested.address,
        if tested.emulated == Some(true) {
            ", emulated"
        } else {
            ""
        }
    );
    checks::finish(
        session,
        "module-selftest",
        &title,
        &report,
        typed.out.as_deref(),
    )
}
