//! `subap track`: the radar's track from a recording of several receivers.

use std::path::{Path, PathBuf};

use anyhow::Context;
use glam::DVec3;
use serde_json::{Value, json};
use subaperture::convention::INFERENCE;
use subaperture::io::estimated_track::{self, EstimatedFix};
use subaperture::io::open::{Options, open_channels};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::phase_history::Channels;
use subaperture::plot::{Chart, Curve, Stroke, stacked};
use subaperture::targets::follow::Event;
use subaperture::targets::{Moment, Mover, Recovered, Settings, TargetsError, recover};
use subaperture::track::Fix;
use subaperture::track_fusion::FusedTrack;

use super::track_fusion;
use crate::args::Track;
use crate::config::{Session, report_reading};
use crate::{interrupt, messages, text};

/// Number of error ellipses in the picture.
const ELLIPSES: usize = 12;

/// Estimate the track and write it with its picture, both complete or neither.
pub(crate) fn run(session: &Session, typed: &Track) -> anyhow::Result<()> {
    let picture = match &typed.picture {
        Some(path) => path.clone(),
        None => picture_path(&typed.out),
    };
    let inputs: Vec<&PathBuf> = [&typed.input]
        .into_iter()
        .chain(&typed.logs.navigation)
        .collect();
    let mut claims = session.claims(&typed.writing, &inputs);
    claims.file(&typed.out, Kind::Text)?;
    claims.file(&picture, Kind::Picture)?;
    let named = typed.tracking.channels.named();
    let channels = open(session, &typed.input, named, &typed.set)?;
    let name = channels.channel(0).collection().name.clone();
    let defaults = Settings::default();
    let mut settings = Settings {
        window: typed.tracking.window,
        ranges_m: typed.tracking.range,
        most_targets: typed.tracking.targets,
        least_snr_db: typed.tracking.least_snr,
        ..defaults
    };
    settings.follow.bridge = typed.tracking.bridge;
    let about = track_fusion::about(&channels)?;
    let mut found = find(session, channels, &settings)?;
    let both = match typed.logs.navigation.is_empty() {
        true => None,
        false => Some(track_fusion::of(session, &found, &about, &typed.logs)?),
    };
    if let Some(both) = &both {
        both.lay(&mut found);
    }
    let drawn = stacked(&charts(&name, &found))?;
    let fixes: Vec<EstimatedFix> = found.moments.iter().map(found_fix).collect();
    let mut files = FileSet::new();
    let track = estimated_track::text(&fixes);
    files.write_bytes(&typed.out, FileKind::Track, track.as_bytes())?;
    files.write_bytes(&picture, FileKind::Picture, &drawn)?;
    let files = files.commit()?;
    report(session, typed, (&picture, &files), &found, both.as_ref())
}

/// Open the channels of a recording, all or those named, and report what was inferred.
pub(super) fn open(
    session: &Session,
    input: &Path,
    named: Option<&[String]>,
    set: &[(String, String)],
) -> anyhow::Result<Channels<'static>> {
    let options = Options {
        channel: None,
        memory_bytes: session.memory_bytes,
        settings: set,
        inference: Some(INFERENCE),
    };
    let reading = session.progress("reading");
    let channels = open_channels(input, named, &options)?;
    reading.finish();
    report_reading(channels.channel(0));
    Ok(channels)
}

/// The track's file name with the extension of a picture.
fn picture_path(track: &Path) -> PathBuf {
    track.with_extension("png")
}

/// Estimate the track of a recording, and report its faults.
pub(super) fn find(
    session: &Session,
    channels: Channels,
    settings: &Settings,
) -> anyhow::Result<Recovered> {
    let progress = session.progress("following targets");
    let found = recover(channels, settings, &progress).map_err(explained)?;
    progress.finish();
    found.trusted().map_err(explained)?;
    for event in &found.seen.events {
        session.note(1, || describe(event));
    }
    for fault in &found.seen.faults {
        match fault.is_doubt() {
            true => messages::bound_missed(fault.to_string()),
            false => messages::warning(fault.to_string()),
        }
    }
    interrupt::check()?;
    Ok(found)
}

/// A pose as a fix of a track file.
pub(super) fn fix(moment: &Moment) -> Fix {
    Fix {
        time_s: moment.time_s,
        position_m: moment.position_m,
        attitude: Some(moment.attitude),
    }
}

fn found_fix(moment: &Moment) -> EstimatedFix {
    EstimatedFix {
        fix: fix(moment),
        covariance: moment.covariance,
        residual: moment.residual,
        targets: moment.targets,
        pulse: moment.pulse,
    }
}

/// `error` with advice on options.
fn explained(error: TargetsError) -> anyhow::Error {
    let advice = match &error {
        TargetsError::NoLastingTarget { .. } => {
            "place reflectors, or search other ranges with --range"
        }
        TargetsError::TooFew { .. } | TargetsError::Sparse { .. } => {
            "place a second reflector, or lower --least-snr"
        }
        TargetsError::Movers(_) => {
            "place reflectors that stand still, three or more in different directions, or leave out ranges of movers with --range"
        }
        TargetsError::Motion { .. } | TargetsError::Diverged { .. } => {
            "leave out ranges of clutter with --range, or receivers with --channels"
        }
        _ => return error.into(),
    };
    anyhow::anyhow!("{error}: {advice}")
}

/// Line of text about a mover.
pub(super) fn mover_line(mover: &Mover) -> String {
    let [x, y, z] = mover.velocity_m_s.to_array();
    let [from_s, to_s] = mover.seen_s;
    let steady = match mover.steady {
        true => "",
        false => "; its velocity changes, this is the mean",
    };
    format!(
        "mover {}: speed {:.3} m/s, velocity ({x:+.3}, {y:+.3}, {z:+.3}) m/s, sigma {:.1} mm/s, seen in {} pulses from {from_s:.3} s to {to_s:.3} s{steady}",
        mover.targets[0],
        mover.velocity_m_s.length(),
        1e3 * mover.sigma_m_s,
        mover.pulses,
    )
}

/// All movers, for JSON.
pub(super) fn movers_record(found: &Recovered) -> Value {
    found.movers.iter().map(mover_record).collect()
}

/// A mover, for JSON.
fn mover_record(mover: &Mover) -> Value {
    json!({
        "targets": mover.targets,
        "pulses": mover.pulses,
        "seen_s": mover.seen_s,
        "position_m": mover.position_m.to_array(),
        "velocity_m_s": mover.velocity_m_s.to_array(),
        "sigma_m_s": mover.sigma_m_s,
        "steady": mover.steady,
    })
}

fn describe(event: &Event) -> String {
    match event {
        Event::Born {
            target,
            pulse,
            range_m,
        } => format!("target {target}: first seen in pulse {pulse}, at a range of {range_m:.2} m"),
        Event::Lost { target, pulse } => format!("target {target}: last seen in pulse {pulse}"),
        Event::Crossed { targets, pulse } => format!(
            "targets {} and {}: not resolved in range from pulse {pulse} on",
            targets[0], targets[1]
        ),
        Event::Split {
            target,
            into,
            pulse,
        } => format!("target {into}: split from target {target} in pulse {pulse}"),
        _ => format!("{event:?}"),
    }
}

/// Charts of the track over the recorded one: a map with the targets, and the track alone with enlarged error ellipses.
fn charts(name: &str, found: &Recovered) -> [Chart; 2] {
    let at = |m: DVec3| (m.x, m.y);
    let moments = &found.moments;
    let spread_m = moments.iter().map(Moment::spread_m).fold(0.0, f64::max);
    let length_m = found.length_m();
    // A twentieth of the track, by a power of ten.
    let larger = 10f64.powf((0.05 * length_m / spread_m).log10().floor());
    let larger = if larger.is_finite() {
        larger.max(1.0)
    } else {
        1.0
    };
    let mut ellipses = Vec::new();
    for moment in moments.iter().step_by(moments.len().div_ceil(ELLIPSES)) {
        let ring = moment.ellipse_m(larger);
        ellipses.extend(ring.into_iter().map(|m| (m.x, m.y)));
        ellipses.push((f64::NAN, f64::NAN));
    }
    let curve = |name: String, points: Vec<(f64, f64)>, stroke: Stroke| Curve {
        name,
        points,
        stroke,
    };
    let found_m: Vec<(f64, f64)> = moments.iter().map(|moment| at(moment.position_m)).collect();
    let recorded_m: Vec<(f64, f64)> = moments.iter().map(|moment| at(moment.recorded_m)).collect();
    let places_m = found.places.iter().map(|place| at(place.position_m));
    let tracks = || {
        vec![
            curve("estimated track".to_owned(), found_m.clone(), Stroke::Solid),
            curve(
                "recorded track".to_owned(),
                recorded_m.clone(),
                Stroke::Dashed,
            ),
        ]
    };
    let chart = |title: String, more: Curve| Chart {
        title,
        across_label: "x (m)".to_owned(),
        up_label: "y (m)".to_owned(),
        curves: tracks().into_iter().chain([more]).collect(),
        ..Chart::default()
    };
    [
        Chart {
            proportional: true,
            ..chart(
                format!("{name}: {} poses, {length_m:.3} m", moments.len()),
                curve("targets".to_owned(), places_m.collect(), Stroke::Dots),
            )
        },
        chart(
            "Track and error ellipses".to_owned(),
            curve(
                format!("1-sigma ellipse x {larger:.0}"),
                ellipses,
                Stroke::Solid,
            ),
        ),
    ]
}

fn report(
    session: &Session,
    typed: &Track,
    (picture, files): (&Path, &[WrittenFile]),
    found: &Recovered,
    both: Option<&FusedTrack>,
) -> anyhow::Result<()> {
    let last = found.moments.last().context("a track has poses")?;
    let seen = &found.seen;
    let [sum, expected] = found.chi_square;
    let sigma_m = last.spread_m();
    let sigma_deg = last.covariance.z_axis.z.sqrt().to_degrees();
    if session.json() {
        return text::say_json(
            "track",
            json!({
                "pulses": seen.times_s.len(),
                "poses": found.moments.len(),
                "channels": seen.channels,
                "length_m": found.length_m(),
                "last_sigma_m": sigma_m,
                "last_sigma_heading_deg": sigma_deg,
                "chi_square": sum,
                "chi_square_expected": expected,
                "settled": found.converged,
                "recorded_off_m": found.recorded_off_m,
                "movers": movers_record(found),
                "one_track": both.map(track_fusion::record),
                "targets": found.places.iter().map(|place| json!({
                    "target": place.target,
                    "pulses": place.pulses,
                    "position_m": place.position_m.to_array(),
                })).collect::<Vec<_>>(),
                "files": files,
            }),
        );
    }
    if !session.prints_text() {
        return Ok(());
    }
    text::say(format!(
        "{}: {} poses of {} pulses, track length {:.3} m, {} standing targets, channels {}; picture {}",
        typed.out.display(),
        found.moments.len(),
        seen.times_s.len(),
        found.length_m(),
        found.places.len(),
        seen.channels.join(", "),
        picture.display()
    ))?;
    text::say(format!(
        "last pose: sigma {:.2} mm and {sigma_deg:.3} deg; residuals {:.2} times the noise",
        1e3 * sigma_m,
        (sum / expected.max(1.0)).sqrt()
    ))?;
    for mover in &found.movers {
        text::say(mover_line(mover))?;
    }
    for line in both.map(track_fusion::lines).unwrap_or_default() {
        text::say(line)?;
    }
    Ok(())
}
