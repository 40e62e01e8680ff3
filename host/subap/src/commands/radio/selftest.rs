//! `subap radio selftest`: test a radio with its transmitter looped back.

use anyhow::bail;
use subaperture::io::ours::Kind;
use subaperture::radio::experiment::{Device, Experiment};
use subaperture::radio::selftest::{self, Options};

use crate::args::RadioSelftest;
use crate::commands::checks;
use crate::config::Session;
use crate::log;

pub(super) fn run(session: &Session, typed: &RadioSelftest) -> anyhow::Result<()> {
    let mut claims = session.claims(&typed.writing, std::slice::from_ref(&typed.experiment));
    if let Some(out) = &typed.out {
        claims.file(out, Kind::Record)?;
    }
    let experiment = Experiment::read_within(&typed.experiment, &typed.set, session.memory_bytes)?;
    if let Device::Replay(recording) = &experiment.device {
        bail!(
            "{}: expected a radio, found a recording, which answers no test: set device.kind to \"uhd\" or \"simulated\"",
            recording.display()
        );
    }
    let options = Options {
        stream_s: typed.stream,
        delay_s: typed.delay,
    };
    let testing = session.progress("testing");
    let report = experiment.with_radio(session.memory_bytes, |radio| {
        selftest::run(radio, &experiment.plan, &options, log::now())
    })?;
    testing.finish();
    let tested = &report.about;
    let title = format!(
        "{}, {}, driver {}{}",
        tested.product,
        tested.serial,
        tested.driver,
        if tested.simulated { ", simulated" } else { "" }
    );
    checks::finish(
        session,
        "radio-selftest",
        &title,
        &report,
        typed.out.as_deref(),
    )
}
