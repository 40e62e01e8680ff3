//! Fusion of the track from echoes with navigation: reads logs and reports each source.

use anyhow::Context;
use glam::DQuat;
use serde_json::{Value, json};
use subaperture::navigation::{Log, Options};
use subaperture::phase_history::Channels;
use subaperture::targets::Recovered;
use subaperture::track::Fix;
use subaperture::track_fusion::{About, FusedTrack, Mounting, Navigation, UnusableLog};

use super::navigation;
use crate::args::Logs;
use crate::config::Session;
use crate::{interrupt, messages};

/// Frame, start time and duration of a recording.
pub(super) fn about(channels: &Channels) -> anyhow::Result<About> {
    About::of(channels).context("the recording holds no pulses")
}

/// Fuse the track from the echoes with the given logs, or else with the recording's own positions.
pub(super) fn of(
    session: &Session,
    found: &Recovered,
    about: &About,
    logs: &Logs,
) -> anyhow::Result<FusedTrack> {
    let navigation = match logs.navigation.is_empty() {
        true => Navigation::of_recording(found),
        false => of_logs(session, about, logs)?,
    };
    let progress = session.progress("one track");
    let mounting = Mounting {
        arm_m: logs.lever_arm.unwrap_or_default(),
    };
    let track = FusedTrack::new(found, &navigation, &mounting, &progress);
    interrupt::check()?;
    let track = track?;
    progress.finish();
    if let Some(times) = track.widened {
        messages::warning(format!(
            "navigation: deviates from the echoes by {times:.1} times its stated standard deviations, which are increased by this factor; the echoes determine the shape of the track"
        ));
    }
    let [steps, ..] = track.left_out;
    if steps > 0 {
        messages::warning(format!(
            "track: the echoes' motion is rejected in {steps} intervals, where it contradicts navigation"
        ));
    }
    Ok(track)
}

/// Track of the logs alone, with the antennas' initial attitude from the recording.
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
        UnusableLog::Start { .. } => {
            anyhow::anyhow!("{error}: give the start time with --navigation-start")
        }
        UnusableLog::OtherTime { .. } => {
            anyhow::anyhow!("{error}: give a log of this time, or correct --navigation-start")
        }
        error => error.into(),
    })
}

/// Contribution of each source and their agreement, as lines.
pub(super) fn lines(track: &FusedTrack) -> Vec<String> {
    let (poses, seconds) = track.radar;
    let mut lines = vec![format!(
        "fused track: {poses} poses from echoes over {seconds:.3} s, scale error {:+.3} %",
        1e2 * track.fused.scale.value
    )];
    lines.extend(track.sources.iter().map(|source| {
        let kind = match source.inertial {
            true => "inertial samples",
            false => "positions",
        };
        format!(
            "{}: {} of {} {kind} used",
            source.name, source.used, source.of
        )
    }));
    let deviation = match track.positions_off_m {
        Some(off_m) => format!("positions deviate by {off_m:.3} m RMS; "),
        None => String::new(),
    };
    let [steps, positions, inertial] = track.left_out;
    lines.push(format!(
        "{deviation}chi-square is {:.2} of the expected value; left out: {steps} motion intervals, {positions} positions, {inertial} inertial samples",
        track.agreement()
    ));
    lines
}

/// Contribution of each source and their agreement, as JSON.
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
