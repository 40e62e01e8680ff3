//! `subap live`: image a running capture sweep by sweep.

use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use subaperture::focus::live::Settings;
use subaperture::geometry::SceneFrame;
use subaperture::io::product;
use subaperture::io::product::record::{Brightest, Picture, Record};
use subaperture::io::written::WrittenFile;
use subaperture::live_capture::{BodyMotion, CaptureGeometry, EchoTrack, Echoes, Imaging};
use subaperture::plot::{Panel, quicklook_within};
use subaperture::radio::experiment::{self, Experiment};
use subaperture::radio::live::SweepAssembler;
use subaperture::radio::sigmf::Setup;

use super::capture::{self, end, record, warn};
use crate::args::Live;
use crate::config::{Session, command_line, record_of_run};
use crate::failure::Usage;
use crate::watch::{Watched, imaged};
use crate::{messages, text};

/// Run a capture and its imaging.
pub(crate) fn run(session: &Session, typed: &Live) -> anyhow::Result<()> {
    let started = Instant::now();
    let experiment = Experiment::read_within(&typed.experiment, &typed.set, session.memory_bytes)?;
    let Some(live) = &experiment.live else {
        let fault = "the experiment has no section [live], which sets the image grid and the motion of the antennas: subap capture --keys lists its keys";
        return Err(Usage(fault.to_owned()).into());
    };
    let Some(out) = typed.out.clone().or(experiment.recording.clone()) else {
        let fault =
            "no output for the recording: give --out NAME, or files.recording of the experiment";
        return Err(Usage(fault.to_owned()).into());
    };
    session.check_grid(&live.grid, 1)?;
    let mut claims = session.claims(&typed.writing, std::slice::from_ref(&typed.experiment));
    if let Some(folder) = &typed.image {
        claims.folder(folder, product::NAMES)?;
    }
    let make =
        |setup: &Setup, follower: &SweepAssembler| imaging(session, typed, live, setup, follower);
    let opening = session.progress("opening the radio");
    let watched = experiment.with_radio(session.memory_bytes, |radio| {
        opening.finish();
        let watching = &typed.watching;
        imaged(
            session,
            radio,
            &experiment,
            watching,
            true,
            &out,
            Some(&make),
        )
    })??;
    report(session, typed, &experiment, &out, &watched, started)?;
    end(&experiment.plan, watched.summary, &out)
}

fn imaging(
    session: &Session,
    typed: &Live,
    live: &experiment::Live,
    setup: &Setup,
    follower: &SweepAssembler,
) -> anyhow::Result<Imaging> {
    let receivers = follower.receivers();
    if setup.antennas.is_none() && receivers.len() > 1 {
        let fault =
            "two receivers need antenna positions: add a section [antennas] to the experiment";
        return Err(Usage(fault.to_owned()).into());
    }
    let motion = match &live.motion {
        experiment::BodyMotion::Echoes { start_m } => {
            BodyMotion::Echoes(Echoes::new(setup.band(), follower.reach_m(), *start_m))
        }
        given => BodyMotion::Track(given.track()?),
    };
    let place = CaptureGeometry {
        motion,
        antennas: setup.antennas.unwrap_or_default(),
        reference_m: live.reference_m,
        receivers,
        reach_m: follower.reach_m(),
    };
    let mut settings = Settings::default()
        .error_db(typed.error_db)
        .window(typed.window)
        .memory_bytes(session.memory_bytes);
    settings.last_pulses = live.last;
    Ok(Imaging::new(&live.grid, setup.steps, place, &settings)?)
}

/// Write the image and report the capture and the image.
fn report(
    session: &Session,
    typed: &Live,
    experiment: &Experiment,
    out: &Path,
    watched: &Watched,
    started: Instant,
) -> anyhow::Result<()> {
    let (plan, summary) = (&experiment.plan, &watched.summary);
    let Some(imaging) = &watched.imaging else {
        return capture::report(session, plan, summary, out, None);
    };
    let (left_out, why) = imaging.left_out();
    if let Some(why) = why {
        messages::warning(format!(
            "image: {left_out} sweeps are left out; the last because: {why}"
        ));
    }
    if watched.skipped > 0 {
        messages::warning(format!(
            "image: {} sweeps arrived faster than they could be imaged and are left out, but are in the recording: use a smaller or coarser live.grid",
            watched.skipped
        ));
    }
    if let Some(track) = imaging.found() {
        doubt(&track);
    }
    let written = match &typed.image {
        Some(folder) => save(session, typed, imaging, experiment, out, (folder, started))?,
        None => Vec::new(),
    };
    let image = record_of_image(imaging, watched.skipped);
    if session.json() {
        warn(summary);
        let mut value = record(plan, summary, out);
        value["image"] = image;
        if let Some(files) = value["files"].as_array_mut() {
            files.extend(written.iter().map(|file| json!(file)));
        }
        return text::say_json("capture", value);
    }
    capture::report(session, plan, summary, out, None)?;
    if !session.prints_text() {
        return Ok(());
    }
    let error_db = imaging.live().accuracy().predicted_db();
    let mut facts = vec![(
        "image",
        format!("{} sweeps, error below {error_db:.1} dB", imaging.taken()),
    )];
    if let Some(track) = imaging.found() {
        facts.push((
            "track",
            format!(
                "{:.2} m long, estimated from {} targets; x is the initial direction of travel",
                track.length_m, track.going.targets
            ),
        ));
    }
    if let Some(peak) = imaging.image().peak() {
        let place = imaging.live().grid().position_m(peak.row, peak.column);
        facts.push(("brightest", format!("x {:.2}, y {:.2} m", place.x, place.y)));
    }
    if let Some(folder) = &typed.image {
        facts.push(("written to", folder.display().to_string()));
    }
    Ok(text::say(text::facts(&facts).join("\n"))?)
}

/// Warn of sweeps where the estimated track is doubtful.
fn doubt(track: &EchoTrack) {
    let going = &track.going;
    if going.blind > 0 {
        messages::warning(format!(
            "track: {} sweeps have no position: fewer than two targets are detected in them, or the targets are too close in range",
            going.blind
        ));
    }
    if going.doubtful > 0 {
        messages::warning(format!(
            "track: phase residuals near pi in {} sweeps: half-wavelength slips are possible from there on; move slower, or shorten the sweep (fewer steps, shorter dwell)",
            going.doubtful
        ));
    }
}

fn record_of_image(imaging: &Imaging, skipped: u64) -> Value {
    let grid = imaging.live().grid();
    let brightest = imaging.image().peak().map(|peak| {
        let place = grid.position_m(peak.row, peak.column);
        json!({ "position_m": [place.x, place.y, place.z] })
    });
    json!({
        "sweeps": imaging.taken(),
        "left_out": imaging.left_out().0,
        "skipped": skipped,
        "predicted_error_db": imaging.live().accuracy().predicted_db(),
        "brightest": brightest,
        "track": imaging.found().map(|track| json!({
            "length_m": track.length_m,
            "targets": track.going.targets,
            "blind": track.going.blind,
            "doubtful": track.going.doubtful,
        })),
    })
}

/// Write the image as a product, readable by `subap quality`, `view` and others.
fn save(
    session: &Session,
    typed: &Live,
    imaging: &Imaging,
    experiment: &Experiment,
    out: &Path,
    (folder, started): (&Path, Instant),
) -> anyhow::Result<Vec<WrittenFile>> {
    let (image, grid) = (imaging.image(), imaging.live().grid());
    let name = &experiment.plan.name;
    let sweeps = imaging.taken();
    if sweeps == 0 {
        messages::warning("image: no sweep was imaged, so that no picture is drawn");
    }
    let title = format!("{name}, {sweeps} sweeps");
    let metadata = Record {
        run: record_of_run(session, started.elapsed()),
        command_line: json!(command_line()),
        grid,
        frame: &SceneFrame::Local,
        settings: json!({
            "algorithm": "live",
            "window": typed.window.to_string(),
            // All sweeps are weighted equally.
            "slow_window": "none",
            "resolved": {
                "error_db": typed.error_db,
                "predicted_error_db": imaging.live().accuracy().predicted_db(),
            },
        }),
        collection: json!({
            "name": name,
            "recording": out.display().to_string(),
            "num_pulses": sweeps,
        }),
        support: Value::Null,
        antennas: Value::Null,
        inputs: &[],
        brightest: Brightest::of(&image, grid),
        picture: (sweeps > 0).then_some(Picture {
            title: &title,
            look: None,
            north: None,
        }),
        check: Value::Null,
        warnings: json!(messages::warnings()),
    }
    .to_json();
    let draw = || match sweeps {
        0 => Ok(Vec::new()),
        _ => {
            let panel = Panel::new(&image, grid, title.clone());
            Ok(quicklook_within(&panel, session.memory_bytes)?)
        }
    };
    product::write_drawing::<anyhow::Error>(folder, &image, || metadata.clone(), draw)
}
