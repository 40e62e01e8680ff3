//! `subap gmti`: moving targets of a recording of several channels.

mod evaluate;
mod found;
mod methods;
mod packet;
mod performance;
mod report;

use std::time::Instant;

use serde_json::json;
use subaperture::geometry::ImageGrid;
use subaperture::gmti::tracker::Plane;
use subaperture::gmti::{Imaging, MovingTargets, find, find_in_dwells};
use subaperture::io::ours::Kind;
use subaperture::io::together::FileSet;
use subaperture::io::written::FileKind;
use subaperture::phase_history::{PhaseHistory, PulseRange};

use super::{forming, track};
use crate::args::Gmti;
use crate::config::Session;
use crate::{interrupt, text};
use packet::Packet;

pub(crate) use found::Found;
pub(crate) use report::say;

/// Rows and columns of a refocused target.
const REFOCUSED_PIXELS: usize = 32;

/// Detect targets and write them with a picture, both complete or neither; or evaluate a scenario.
pub(crate) fn run(session: &Session, typed: &Gmti) -> anyhow::Result<()> {
    if typed.evaluate {
        return evaluate::run(session, typed);
    }
    let start = Instant::now();
    let picture = match &typed.picture {
        Some(path) => path.clone(),
        None => typed.out.with_extension("png"),
    };
    let mut claims = session.claims(&typed.writing, &[&typed.input]);
    claims.file(&typed.out, Kind::Record)?;
    claims.file(&picture, Kind::Picture)?;
    if let Some(path) = &typed.stanag {
        claims.file(path, Kind::Gmtif)?;
    }
    let named = typed.channels.named();
    let channels = track::open(session, &typed.input, named, &typed.set)?;
    let grid = grid(session, typed, channels.channel(0))?;
    session.check_grid(&grid, 2 + channels.len() as u64)?;
    let collection = channels.channel(0).collection();
    let mut packet = match &typed.stanag {
        Some(_) => Some(Packet::new(typed, channels.channel(0))?),
        None => None,
    };
    let former = methods::former(typed)?;
    let progress = session.progress("detecting");
    let imaging = Imaging {
        former: &*former,
        grid: &grid,
        windows: typed.windows.both(),
        memory_bytes: session.memory_bytes,
        numerics: typed.numerics(),
        monitor: &progress,
    };
    let settings = methods::detection(typed);
    let integration = typed.sub_cpis.map(|_| methods::sub_cpis(typed, &imaging));
    let integration = integration.as_ref();
    let mut found = Found::new(Plane::of(&grid))?;
    let mut visit = |dwell: MovingTargets| -> anyhow::Result<()> {
        if let Some(packet) = &mut packet {
            packet.add(&dwell, &grid, &collection.frame)?;
        }
        if found.sensitivity.is_none() {
            found.sensitivity = Some(dwell.sensitivity(&settings, typed.cross_section)?);
        }
        let refocused = match typed.refocus {
            true => dwell.refocus(&channels, &imaging, REFOCUSED_PIXELS)?,
            false => Vec::new(),
        };
        found.add(dwell, &channels, typed.dwell.is_some(), &refocused);
        interrupt::check()?;
        Ok(())
    };
    match typed.dwell {
        None => visit(find(&channels, &imaging, &settings, integration)?)?,
        Some(dwell_s) => {
            find_in_dwells(&channels, &imaging, &settings, integration, dwell_s, visit)?
        }
    }
    progress.finish();
    let drawn = found.drawn(session, &grid, &channels)?;
    let detection = (&settings, integration);
    let mut record = found.record(session, &collection.frame, detection, start.elapsed());
    let mut files = FileSet::new();
    let bytes = serde_json::to_vec_pretty(&record)?;
    files.write_bytes(&typed.out, FileKind::MovingTargets, &bytes)?;
    files.write_bytes(&picture, FileKind::Picture, &drawn)?;
    if let (Some(path), Some(packet)) = (&typed.stanag, &packet) {
        files.write_bytes(path, FileKind::Stanag4607, &packet.encoded()?)?;
    }
    let files = files.commit()?;
    if session.json() {
        record["files"] = json!(files);
        return text::say_json("moving-targets", record);
    }
    match session.prints_text() {
        true => say(&typed.out, &found),
        false => Ok(()),
    }
}

/// Given grid, or the default grid of the first dwell.
fn grid(session: &Session, typed: &Gmti, history: &dyn PhaseHistory) -> anyhow::Result<ImageGrid> {
    let pulses = &history.collection().pulses;
    let count = match (typed.dwell, pulses.first()) {
        (Some(dwell_s), Some(first)) => {
            pulses.partition_point(|pulse| pulse.time_s - first.time_s <= dwell_s)
        }
        _ => pulses.len(),
    };
    let survey = forming::survey(&PulseRange::new(history, 0..count))?;
    session.grid(typed.grid.as_ref(), &survey)
}
