//! `subap navigation`: describe a navigation log and its gaps; export its track.

use std::path::Path;

use anyhow::{Context, bail};
use glam::EulerRot;
use serde_json::{Value, json};
use subaperture::geometry::{Geodetic, SceneFrame};
use subaperture::io::ours::{Kind as Written, TEXT_MARK};
use subaperture::io::together::FileSet;
use subaperture::io::written::{FileKind, WrittenFile};
use subaperture::navigation::{Clock, Coverage, Log, Options, Place};
use subaperture::plot::{self, Chart, Curve, Stroke};
use subaperture::track::Fix;

use crate::args::Navigation;
use crate::config::Session;
use crate::{messages, text};

/// Maximum number of gaps listed individually.
const MAX_GAPS: usize = 10;

/// Read a log, describe it, and write its track if requested.
pub(crate) fn run(session: &Session, typed: &Navigation) -> anyhow::Result<()> {
    let mut claims = session.claims(&typed.writing, &[&typed.file]);
    let picture = typed.out.as_ref().map(|out| out.with_extension("png"));
    if let (Some(out), Some(picture)) = (&typed.out, &picture) {
        claims.file(out, Written::Text)?;
        claims.file(picture, Written::Picture)?;
    }
    let options = Options {
        week: typed.week,
        ..Options::default()
    };
    let log = read(session, &typed.file, &options)?;
    let coverage = log.coverage();
    let track = match (&typed.out, &picture) {
        (Some(out), Some(picture)) => Some(write(typed, &log, &coverage, out, picture)?),
        _ => None,
    };
    if session.json() {
        let mut record = record(&log, &coverage, track.as_ref());
        record["files"] = match &track {
            Some(track) => json!(track.files),
            None => json!([]),
        };
        return text::say_json("navigation", record);
    }
    for line in lines(&log) {
        text::say(line)?;
    }
    if let (Some(track), true) = (track, session.prints_text()) {
        text::say(format!("{}: {} positions", track.out, track.fixes))?;
    }
    Ok(())
}

/// Read a log and warn of lost data.
pub(super) fn read(session: &Session, path: &Path, options: &Options) -> anyhow::Result<Log> {
    let progress = session.progress("reading");
    let log = Log::read(path, options)?;
    progress.finish();
    let (damaged, disordered) = (log.account.damaged(), log.account.disordered());
    if damaged > 0 {
        messages::warning(format!(
            "{}: {damaged} truncated or damaged messages are left out (-v lists them)",
            path.display()
        ));
    }
    if disordered > 0 {
        messages::warning(format!(
            "{}: {disordered} records with times that do not ascend are left out (-v lists them)",
            path.display()
        ));
    }
    for doubt in &log.account.doubts {
        messages::warning(format!("{}: {doubt}", path.display()));
    }
    session.note(1, || log.account.to_string());
    Ok(log)
}

/// Description of a log as lines.
pub(super) fn lines(log: &Log) -> Vec<String> {
    let coverage = log.coverage();
    let lines = coverage.iter().flat_map(describe);
    lines.chain(clock(log)).collect()
}

/// Description of a log as JSON.
pub(super) fn about(log: &Log) -> Value {
    record(log, &log.coverage(), None)
}

/// Track that was exported.
struct Track {
    out: String,
    fixes: usize,
    attitudes: bool,
    files: Vec<WrittenFile>,
}

fn write(
    typed: &Navigation,
    log: &Log,
    coverage: &[Coverage],
    out: &Path,
    picture: &Path,
) -> anyhow::Result<Track> {
    let chosen = match typed.record {
        Some(record) => coverage.iter().find(|one| one.kind == record.kind()),
        None => coverage.iter().find(|one| one.with[0] > 0),
    };
    let name = typed.file.display();
    let Some(chosen) = chosen.filter(|one| one.with[0] > 0) else {
        bail!(
            "{name}: expected records of the requested type with positions, found no such record"
        );
    };
    let frame = match typed.origin {
        None => log.frame(),
        Some(origin) => {
            let place = Geodetic {
                latitude_deg: origin.x,
                longitude_deg: origin.y,
                height_m: origin.z,
            };
            if !(origin.x.abs() <= 90.0 && origin.y.abs() <= 180.0) {
                bail!(
                    "--origin {origin}: expected a latitude of -90 to 90 degrees and a longitude of -180 to 180"
                );
            }
            let [east, north, _] = place.east_north_up();
            Some(SceneFrame::Earth {
                origin_ecf_m: place.to_ecf_m(),
                x_axis_ecf: east,
                y_axis_ecf: north,
            })
        }
    };
    let frame = frame.with_context(|| format!("{name}: the log contains no position"))?;
    let fixes = log.fixes(chosen.kind, &frame, chosen.from);
    let fixes = fixes.with_context(|| name.to_string())?;
    let csv = csv(typed, chosen, &frame, &fixes);
    let file = typed.file.file_name().unwrap_or(typed.file.as_os_str());
    let png = plot::lines(&chart(&file.to_string_lossy(), &frame, chosen, &fixes))?;
    let mut files = FileSet::new();
    files.write_bytes(out, FileKind::Track, csv.as_bytes())?;
    files.write_bytes(picture, FileKind::Picture, &png)?;
    let files = files.commit()?;
    Ok(Track {
        out: out.display().to_string(),
        fixes: fixes.len(),
        attitudes: fixes.iter().all(|fix| fix.attitude.is_some()),
        files,
    })
}

/// Track in CSV format: seconds from its first record, metres, degrees.
fn csv(typed: &Navigation, chosen: &Coverage, frame: &SceneFrame, fixes: &[Fix]) -> String {
    let mut lines = vec![format!(
        "# {TEXT_MARK} navigation: {} of {}, from {}",
        chosen.kind.name(),
        typed.file.display().to_string().replace(['\n', '\r'], " "),
        chosen.from
    )];
    if let SceneFrame::Earth { origin_ecf_m, .. } = frame {
        let origin = Geodetic::from_ecf_m(*origin_ecf_m);
        lines.push(format!(
            "# x east, y north, z up at latitude {:.9} deg, longitude {:.9} deg, height {:.4} m",
            origin.latitude_deg, origin.longitude_deg, origin.height_m
        ));
    }
    let turned = fixes.iter().all(|fix| fix.attitude.is_some());
    let angles = if turned {
        ",roll_deg,pitch_deg,yaw_deg"
    } else {
        ""
    };
    lines.push(format!("time_s,x_m,y_m,z_m{angles}"));
    lines.extend(fixes.iter().map(|fix| {
        let place = fix.position_m;
        let mut line = format!(
            "{:.6},{:.4},{:.4},{:.4}",
            fix.time_s, place.x, place.y, place.z
        );
        if let Some(attitude) = fix.attitude {
            let (yaw, pitch, roll) = attitude.to_euler(EulerRot::ZYX);
            let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
            line += &format!(",{roll:.6},{pitch:.6},{yaw:.6}");
        }
        line
    }));
    lines.join("\n") + "\n"
}

/// Plan view of the track with its gaps.
fn chart(name: &str, frame: &SceneFrame, chosen: &Coverage, fixes: &[Fix]) -> Chart {
    let mut points: Vec<(f64, f64)> = Vec::with_capacity(fixes.len());
    let mut lost = Vec::new();
    let mut gaps = chosen.gaps.iter().peekable();
    for fix in fixes {
        let point = (fix.position_m.x, fix.position_m.y);
        let after = |time_s: f64| time_s <= fix.time_s + 1e-9;
        if gaps
            .next_if(|gap| after(gap.to.since(chosen.from)))
            .is_some()
        {
            lost.extend(points.last().copied());
            lost.extend([point, (f64::NAN, f64::NAN)]);
            points.push((f64::NAN, f64::NAN));
        }
        points.push(point);
    }
    let curve = |name: &str, points, stroke| Curve {
        name: name.to_owned(),
        points,
        stroke,
    };
    let first = fixes
        .first()
        .map(|fix| (fix.position_m.x, fix.position_m.y));
    let [across, up] = match frame {
        SceneFrame::Earth { .. } => ["east", "north"],
        _ => ["x", "y"],
    };
    let mut curves = vec![curve("track", points, Stroke::Solid)];
    if !lost.is_empty() {
        curves.push(curve("without records", lost, Stroke::Dashed));
    }
    curves.push(curve(
        "first position",
        first.into_iter().collect(),
        Stroke::Dots,
    ));
    Chart {
        title: format!("{name}: {}", chosen.kind.name()),
        across_label: format!("{across} (m)"),
        up_label: format!("{up} (m)"),
        curves,
        proportional: true,
        ..Chart::default()
    }
}

/// Description of one type of record in a few lines.
fn describe(one: &Coverage) -> Vec<String> {
    let seconds = one.to.since(one.from);
    let [places, velocities, attitudes] = one.with;
    let mut lines = vec![format!(
        "{:<9} {} records over {seconds:.3} s from {}{}; {places} positions, {velocities} velocities, {attitudes} attitudes",
        one.kind.name(),
        one.records,
        one.from,
        match one.interval_s > 0.0 {
            true => format!(", interval {:.4} s", one.interval_s),
            false => String::new(),
        }
    )];
    lines.extend(one.gaps.iter().take(MAX_GAPS).map(|gap| {
        format!(
            "          lost: {} from {:.3} s to {:.3} s after the first",
            match gap.missing {
                1 => "1 record".to_owned(),
                missing => format!("{missing} records"),
            },
            gap.from.since(one.from),
            gap.to.since(one.from)
        )
    }));
    if one.gaps.len() > MAX_GAPS {
        lines.push(format!(
            "          and {} more gaps",
            one.gaps.len() - MAX_GAPS
        ));
    }
    lines
}

/// Time scale of the log.
fn clock(log: &Log) -> Option<String> {
    let leap = log.account.leap_seconds_s;
    Some(match (log.account.clock, leap) {
        (Clock::Gps, Some(leap_s)) => format!("times are GPS, {leap_s} s ahead of UTC"),
        (Clock::Gps, None) => "times are GPS; the offset from UTC is not stated".to_owned(),
        (Clock::SecondsOfWeek, _) => "times are seconds of an unstated GPS week".to_owned(),
        (Clock::SecondsOfDay, _) => "times are seconds of an unstated day of UTC".to_owned(),
        (Clock::Own, _) => "times are by the log's own clock".to_owned(),
    })
}

fn record(log: &Log, coverage: &[Coverage], track: Option<&Track>) -> Value {
    let account = &log.account;
    let wrong = account.wrong.iter();
    let wrong: serde_json::Map<String, Value> = wrong
        .map(|(wrong, count)| (format!("{wrong:?}").to_lowercase(), json!(count)))
        .collect();
    let first = log.records.iter().find_map(|record| match record.place {
        Some(Place::Earth(place)) => Some(place),
        _ => None,
    });
    let kinds: Vec<Value> = coverage
        .iter()
        .map(|one| {
            let gap = |gap: &subaperture::navigation::Gap| {
                json!({
                    "from_s": gap.from.since(one.from),
                    "to_s": gap.to.since(one.from),
                    "missing": gap.missing,
                })
            };
            json!({
                "kind": one.kind.name(),
                "records": one.records,
                "places": one.with[0],
                "velocities": one.with[1],
                "attitudes": one.with[2],
                "from_week": one.from.week,
                "from_s": one.from.seconds,
                "seconds": one.to.since(one.from),
                "interval_s": one.interval_s,
                "gaps": one.gaps.iter().map(gap).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "kinds": kinds,
        "first_place": first,
        "clock": format!("{:?}", account.clock),
        "leap_seconds_s": account.leap_seconds_s,
        "unsolved": account.unsolved,
        "others": account.others,
        "wrong": wrong,
        "faults": account.faults.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "lost_bytes": account.lost_bytes,
        "bytes": account.bytes,
        "notes": account.notes,
        "doubts": account.doubts,
        "track": track.map(|track| json!({ "fixes": track.fixes, "attitudes": track.attitudes })),
    })
}
