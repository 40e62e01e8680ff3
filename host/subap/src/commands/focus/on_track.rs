//! `--track`: a recording as the radar made it on another track, one of a file or one that is found of its own echoes.

use anyhow::Context;
use subaperture::io::open::{Options, cphd_info, open_channels};
use subaperture::io::track_csv;
use subaperture::phase_history::{Channels, Joined, OnTrack, PhaseHistory};
use subaperture::targets::{Arrangement, Settings, TargetsError};
use subaperture::track::{Fix, SampledTrack};

use crate::args::{Input, Logs, TrackSource};
use crate::commands::{one_track, track};
use crate::config::Session;
use crate::failure::Usage;
use crate::{interrupt, messages, text};

/// Opens the recordings given, on the track in the file or one that is found of their echoes; several channels as their coherent sum.
pub(super) fn open(
    session: &Session,
    input: &Input,
    source: &TrackSource,
    logs: &Logs,
) -> anyhow::Result<Joined> {
    let named = || format!("--track {source}");
    let mut fixes = match source {
        TrackSource::File(path) => track_csv::read(path).with_context(named)?,
        TrackSource::Echoes | TrackSource::Fused => found(session, input, source, logs)?,
    };
    let reading = session.progress("reading");
    let mut left = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: &input.set,
    };
    let mut recordings = Vec::with_capacity(input.paths.len());
    for path in &input.paths {
        let opened = open_channels::<&str>(path, None, &left)?;
        left.memory_bytes = left.memory_bytes.saturating_sub(opened.held_bytes());
        recordings.push(opened);
    }
    let channels = Channels::join(recordings)?;
    reading.finish();
    let arrangement = Arrangement::of(&channels)?;
    for fix in &mut fixes {
        // Without attitudes the antennas stay as the first pulse has them.
        fix.attitude.get_or_insert(arrangement.attitude);
    }
    let body = SampledTrack::new(&fixes).with_context(named)?;
    let span_s = (fixes[0].time_s, fixes[fixes.len() - 1].time_s);
    let wanted = wanted(input, &channels)?;
    let all = channels.num_pulses();
    let mut moved = Vec::new();
    for (c, (about, history)) in channels.into_inner().into_iter().enumerate() {
        let [t, r] = arrangement.of_channels[c];
        let arms_m = [arrangement.transmitters_m[t], arrangement.receivers_m[r]];
        if wanted.contains(&c) {
            let history = OnTrack::new(history, &body, arms_m, span_s).with_context(named)?;
            for warning in history.warnings() {
                messages::warning(warning);
            }
            moved.push((about, Box::new(history) as Box<dyn PhaseHistory>));
        }
    }
    let moved = Channels::new(moved)?;
    if moved.num_pulses() < all {
        messages::warning(format!(
            "the track is from {} s to {} s: {} of {all} pulses are outside, and left out",
            span_s.0,
            span_s.1,
            all - moved.num_pulses()
        ));
    }
    Ok(match moved.len() {
        1 => {
            let alone = moved.into_inner().into_iter().map(|(_, history)| history);
            Joined::join(alone.collect())?
        }
        _ => Joined::alone(Box::new(moved.coherent_sum()?)),
    })
}

/// The track of a recording's own echoes, or of them and of navigation.
fn found(
    session: &Session,
    input: &Input,
    source: &TrackSource,
    logs: &Logs,
) -> anyhow::Result<Vec<Fix>> {
    let [path] = &input.paths[..] else {
        return Err(Usage(format!("--track {source} is of one recording")).into());
    };
    let options = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: &input.set,
    };
    let channels = open_channels::<&str>(path, None, &options)?;
    let about = one_track::about(&channels)?;
    let attitude = Arrangement::of(&channels)?.attitude;
    let found = match track::find(session, channels, &Settings::default()) {
        Ok(found) => found,
        // What cannot be read is not the echoes' fault, and would fail again.
        Err(error)
            if *source == TrackSource::Fused
                && !logs.navigation.is_empty()
                && !matches!(error.downcast_ref(), Some(TargetsError::Read(_))) =>
        {
            interrupt::check()?;
            messages::warning(format!(
                "the echoes tell no track ({error:#}): that of the navigation alone is taken"
            ));
            return one_track::alone(session, &about, logs, attitude);
        }
        Err(error) => return Err(error),
    };
    if *source != TrackSource::Fused {
        return Ok(found.moments.iter().map(track::fix).collect());
    }
    let both = one_track::of(session, &found, &about, logs)?;
    if session.tells() {
        for line in one_track::told(&both) {
            text::say(line)?;
        }
    }
    Ok(both.fixes(about.span_s))
}

/// The channels whose image is asked for: of a CPHD its reference channel, of a description all, unless others are named.
fn wanted(input: &Input, channels: &Channels) -> anyhow::Result<Vec<usize>> {
    let named: Vec<String> = match (&input.channel, &input.channels) {
        (Some(name), _) => vec![name.clone()],
        (None, Some(several)) => match several.named() {
            Some(names) => names.to_vec(),
            None => return Ok((0..channels.len()).collect()),
        },
        (None, None) => match cphd_info(&input.paths[0])? {
            Some(info) => vec![info.ref_channel],
            None => return Ok((0..channels.len()).collect()),
        },
    };
    let each = named.iter().map(|name| Ok(channels.find(name)?));
    each.collect()
}
