//! `focus --track`: replace a recording's track by one from a file or estimated from its echoes.

use anyhow::Context;
use serde_json::Value;
use subaperture::convention::INFERENCE;
use subaperture::io::open::{Options, cphd_info, open_channels};
use subaperture::io::track_csv;
use subaperture::phase_history::{Channels, Joined};
use subaperture::targets::{self, Arrangement, Settings, TargetsError};
use subaperture::track::Fix;
use subaperture::track_fusion::TrackFusionError;

use crate::args::{Input, Logs, TrackSource};
use crate::commands::{track, track_fusion};
use crate::config::{Session, note_inferred};
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// Open the recordings on the track of a file or of their echoes, several channels as their coherent sum. The JSON value holds the movers, for the record.
pub(super) fn open(
    session: &Session,
    input: &Input,
    source: &TrackSource,
    logs: &Logs,
) -> anyhow::Result<(Joined, Value)> {
    let named = || format!("--track {source}");
    let (fixes, movers) = match source {
        TrackSource::File(path) => (track_csv::read(path).with_context(named)?, Value::Null),
        TrackSource::Echoes | TrackSource::Fused | TrackSource::Navigation => {
            estimated(session, input, source, logs)?
        }
    };
    let reading = session.progress("reading");
    let mut left = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: &input.set,
        inference: Some(INFERENCE),
    };
    let mut recordings = Vec::with_capacity(input.files.len());
    for path in &input.files {
        let opened = open_channels::<&str>(path, None, &left)?;
        left.memory_bytes = left.memory_bytes.saturating_sub(opened.held_bytes());
        recordings.push(opened);
    }
    let channels = Channels::join(recordings)?;
    reading.finish();
    note_inferred(channels.channel(0));
    let span_s = fixes.first().zip(fixes.last());
    let span_s = span_s.map_or((0.0, 0.0), |(first, last)| (first.time_s, last.time_s));
    let wanted = wanted(input, &channels, session.memory_bytes)?;
    let all = channels.num_pulses();
    let placed = targets::on_track(channels, &fixes).with_context(named)?;
    let placed = placed.into_inner().into_iter().enumerate();
    let moved: Vec<_> = placed
        .filter(|(c, _)| wanted.contains(c))
        .map(|(_, channel)| channel)
        .collect();
    for (_, history) in &moved {
        for warning in history.warnings() {
            messages::warning(warning);
        }
    }
    let moved = Channels::new(moved)?;
    if moved.num_pulses() < all {
        messages::warning(format!(
            "the track covers {} s to {} s: {} of {all} pulses outside are left out",
            span_s.0,
            span_s.1,
            all - moved.num_pulses()
        ));
    }
    let joined = match moved.len() {
        1 => {
            let alone = moved.into_inner().into_iter().map(|(_, history)| history);
            Joined::join(alone.collect())?
        }
        _ => Joined::alone(Box::new(moved.coherent_sum()?)),
    };
    Ok((joined, movers))
}

/// Track estimated from the recording's echoes, optionally with navigation, and the movers.
fn estimated(
    session: &Session,
    input: &Input,
    source: &TrackSource,
    logs: &Logs,
) -> anyhow::Result<(Vec<Fix>, Value)> {
    let [path] = &input.files[..] else {
        return Err(Usage(format!("--track {source} needs exactly one recording")).into());
    };
    let options = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: &input.set,
        inference: Some(INFERENCE),
    };
    let channels = open_channels::<&str>(path, None, &options)?;
    let about = track_fusion::about(&channels)?;
    let attitude = Arrangement::of(&channels)?.attitude;
    if *source == TrackSource::Navigation {
        let alone = track_fusion::alone(session, &about, logs, attitude)?;
        return Ok((alone, Value::Null));
    }
    let found = match track::find(session, channels, &Settings::default()) {
        Ok(found) => found,
        // Any read error would occur again, so it is not a reason to continue.
        Err(error)
            if *source == TrackSource::Fused
                && !logs.navigation.is_empty()
                && !matches!(error.downcast_ref(), Some(TargetsError::Read(_))) =>
        {
            interrupt::check()?;
            messages::warning(format!(
                "track: estimation from the echoes failed ({error:#}): the image is formed on the navigation track alone"
            ));
            let alone = track_fusion::alone(session, &about, logs, attitude)?;
            return Ok((alone, Value::Null));
        }
        Err(error) => return Err(error),
    };
    let movers = track::movers_record(&found);
    if session.prints_text() {
        for mover in &found.movers {
            text::say(track::mover_line(mover))?;
        }
    }
    if *source != TrackSource::Fused {
        let fixes = found.moments.iter().map(track::fix);
        return Ok((fixes.collect(), movers));
    }
    let both = match track_fusion::of(session, &found, &about, logs) {
        Ok(both) => both,
        // Navigation is used where the echoes give no track.
        Err(error)
            if !logs.navigation.is_empty()
                && matches!(error.downcast_ref(), Some(TrackFusionError::Neither { .. })) =>
        {
            messages::bound_missed(format!(
                "track: {error:#}: the image is formed on the navigation track alone, without verification by the echoes"
            ));
            let alone = track_fusion::alone(session, &about, logs, attitude)?;
            return Ok((alone, Value::Null));
        }
        Err(error) => return Err(error),
    };
    let movers = track::movers_record(&found);
    if session.prints_text() {
        for line in track_fusion::lines(&both) {
            text::say(line)?;
        }
    }
    Ok((both.fixes(about.span_s), movers))
}

/// Channels to image: those named, else the reference channel of a CPHD, or all channels of a description.
fn wanted(input: &Input, channels: &Channels, memory_bytes: u64) -> anyhow::Result<Vec<usize>> {
    let named: Vec<String> = match (&input.channel, &input.channels) {
        (Some(name), _) => vec![name.clone()],
        (None, Some(several)) => match several.named() {
            Some(names) => names.to_vec(),
            None => return Ok((0..channels.len()).collect()),
        },
        (None, None) => match cphd_info(&input.files[0], memory_bytes)? {
            Some(info) => vec![info.ref_channel],
            None => return Ok((0..channels.len()).collect()),
        },
    };
    let each = named.iter().map(|name| Ok(channels.find(name)?));
    each.collect()
}
