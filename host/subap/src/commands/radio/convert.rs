//! `subap radio convert`: convert a capture to phase history in CPHD.

use serde_json::json;
use subaperture::geometry::SceneFrame;
use subaperture::io::cphd::{self, Channel, WriteOptions};
use subaperture::io::ours::Kind;
use subaperture::radio::history::{Capture, Options, Placement, Track};
use subaperture::radio::profile::{self, Calibration};

use crate::args::Convert;
use crate::config::Session;
use crate::{messages, text};

pub(super) fn run(session: &Session, typed: &Convert) -> anyhow::Result<()> {
    let mut inputs = vec![typed.recording.clone()];
    inputs.extend(typed.track.clone());
    inputs.extend(typed.calibration.clone());
    let mut claims = session.claims(&typed.writing, &inputs);
    claims.file(&typed.out, Kind::Collection)?;
    let calibration = typed.calibration.as_deref().map(Calibration::read);
    let options = Options {
        profile: profile::Options {
            reference: None,
            reach_m: typed.reach,
            calibration: calibration.transpose()?,
        },
        memory_bytes: session.memory_bytes,
    };
    let reading = session.progress("reading");
    let capture = Capture::open(&typed.recording, options)?;
    reading.finish();
    let track = typed
        .track
        .as_deref()
        .map(|path| Track::read(path, typed.zero));
    let track = track.transpose()?;
    let [x_axis_ecf, y_axis_ecf, _] = typed.origin.east_north_up();
    let channels = capture.channels(&Placement {
        track: track.as_ref(),
        antennas: None,
        reference_m: typed.reference,
        extent: typed.extent,
        frame: SceneFrame::Earth {
            origin_ecf_m: typed.origin.to_ecf_m(),
            x_axis_ecf,
            y_axis_ecf,
        },
    })?;
    if track.is_none() {
        messages::warning(
            "no --track: all pulses are placed at the scene's origin, so that there is no aperture and focus cannot form an image. Give the track \
             of the antennas with --track; or estimate it from the echoes of two receivers: subap track FILE -o TRACK.csv, and focus --track TRACK.csv",
        );
    }
    // Left-out sweeps are the same for all receivers.
    for warning in channels.channel(0).warnings() {
        messages::warning(warning);
    }
    let written: Vec<Channel> = channels
        .iter()
        .map(|(about, history)| Channel::new(about.name.clone(), history))
        .collect();
    let progress = session.progress("writing");
    let files = cphd::write(&typed.out, &written, &WriteOptions::default(), &progress)?;
    progress.finish();
    let collection = channels.channel(0).collection();
    let (pulses, frequencies) = (collection.pulses.len(), collection.num_samples);
    if session.json() {
        return text::say_json(
            "conversion",
            json!({
                "files": files,
                "channels": channels.len(),
                "pulses": pulses,
                "samples": frequencies,
                "left_out": capture.left_out().len(),
            }),
        );
    }
    if session.prints_text() {
        let of = match channels.len() {
            1 => "one receiver".to_owned(),
            count => format!("{count} receivers"),
        };
        text::say(format!(
            "{}: {pulses} pulses of {frequencies} frequencies, {of}",
            typed.out.display()
        ))?;
    }
    Ok(())
}
