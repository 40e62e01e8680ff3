//! One track of a recording's echoes and of navigation: logs are read, and what each brought is told.

use anyhow::Context;
use glam::DQuat;
use serde_json::{Value, json};
use subaperture::navigation::{Log, Options};
use subaperture::phase_history::Channels;
use subaperture::targets::Recovered;
use subaperture::track::Fix;
use subaperture::track_fusion::{About, FusedTrack, Mounting, Navigation, NoNavigation};

use super::navigation;
use crate::args::Logs;
use crate::config::Session;
use crate::{interrupt, messages};

/// What a recording says of itself, before its echoes are looked at.
pub(super) fn about(channels: &Channels) -> anyhow::Result<About> {
    About::of(channels).context("the recording holds no pulses")
}

/// The track of what the echoes told and of the logs that are given, or else of the recording's own positions.
pub(super) fn of(
    session: &Session,
    found: &Recovered,
    about: &About,
    logs: &Logs,
) -> anyhow::Result<FusedTrack> {
    let said = match logs.navigation.is_empty() {
        true => Navigation::of_recording(found),
        false => of_logs(session, about, logs)?,
    };
    let progress = session.progress("one track");
    let mounting = Mounting {
        arm_m: logs.lever_arm.unwrap_or_default(),
    };
    let track = FusedTrack::new(found, &said, &mounting, &progress);
    interrupt::check()?;
    let track = track?;
    progress.finish();
    if let Some(times) = track.widened {
        messages::warning(format!(
            "the navigation is off the echoes by {times:.1} times what it states: it counts as that much worse, and the track's shape is that of the echoes"
        ));
    }
    let [steps, ..] = track.left_out;
    if steps > 0 {
        messages::warning(format!(
            "the echoes' motion is not believed in {steps} stretches, where navigation contradicts it"
        ));
    }
    Ok(track)
}

/// The track of the logs alone, of antennas that are turned as the recording has them at first.
pub(super) fn alone(
    session: &Session,
    about: &About,
    logs: &Logs,
    attitude: DQuat,
) -> anyhow::Result<Vec<Fix>> {
    let mounting = Mounting {
        arm_m: logs.lever_arm.unwrap_or_default(),
    };
    Ok(of_logs(session, about, logs)?.alone(about, attitude, &mounting))
}

fn of_logs(session: &Session, about: &About, logs: &Logs) -> anyhow::Result<Navigation> {
    let mut read = Vec::with_capacity(logs.navigation.len());
    for path in &logs.navigation {
        let log: Log = navigation::read(session, path, &Options::default())?;
        read.push((path.display().to_string(), log));
    }
    let about = About {
        start: logs.navigation_start.or(about.start),
        ..about.clone()
    };
    Navigation::of_logs(&read, &about).map_err(|error| match error {
        NoNavigation::Start { .. } => {
            anyhow::anyhow!("{error}: say when by --navigation-start")
        }
        NoNavigation::Elsewhen { .. } => {
            anyhow::anyhow!("{error}: it is of another time, or --navigation-start is another")
        }
        error => error.into(),
    })
}

/// What each source brought and how well they agree, in lines.
pub(super) fn lines(track: &FusedTrack) -> Vec<String> {
    let (poses, seconds) = track.radar;
    let mut lines = vec![format!(
        "one track: of the echoes {poses} poses over {seconds:.3} s, x {:+.3} % too long",
        1e2 * track.fused.scale.value
    )];
    lines.extend(track.sources.iter().map(|source| {
        let what = match source.inertial {
            true => "inertial moments",
            false => "positions",
        };
        format!(
            "of {}: {} of {} {what}",
            source.name, source.used, source.of
        )
    }));
    let off = match track.positions_off_m {
        Some(off_m) => format!("positions are off it by {off_m:.3} m RMS; "),
        None => String::new(),
    };
    let [steps, positions, inertial] = track.left_out;
    lines.push(format!(
        "{off}chi-square is {:.2} of what is expected; left out: {steps} stretches of motion, {positions} positions, {inertial} inertial moments",
        track.agreement()
    ));
    lines
}

/// The same for programs.
pub(super) fn record(track: &FusedTrack) -> Value {
    let [steps, positions, inertial] = track.left_out;
    json!({
        "poses": track.radar.0,
        "sources": track.sources.iter().map(|source| json!({
            "name": source.name,
            "inertial": source.inertial,
            "used": source.used,
            "of": source.of,
        })).collect::<Vec<_>>(),
        "positions_off_m": track.positions_off_m,
        "chi_square": track.fused.chi_square[0],
        "chi_square_expected": track.fused.chi_square[1],
        "scale": track.fused.scale.value,
        "widened": track.widened,
        "left_out": { "motion": steps, "positions": positions, "inertial": inertial },
    })
}
