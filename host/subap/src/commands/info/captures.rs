//! Descriptions of captures and radio experiments.

use std::path::Path;

use anyhow::Context;
use serde_json::json;
use subaperture::radio::experiment::{AnyExperiment, ChirpExperiment, Device};
use subaperture::radio::sigmf::Recording;
use subaperture::radio::vna::VnaExperiment;

use super::description::{Description, line};
use crate::config::Session;
use crate::text::{bytes, hertz, seconds};

/// Describe a SigMF recording: carriers, sweeps and flagged steps.
pub(super) fn capture(path: &Path) -> anyhow::Result<Description> {
    let meta = subaperture::capture_of(path).unwrap_or_else(|| path.to_owned());
    let recording = Recording::open(&meta)?;
    let (setup, steps) = (recording.setup(), recording.steps());
    let band = setup.band();
    let sweeps = steps
        .iter()
        .map(|step| step.sweep)
        .max()
        .map_or(0, |last| last + 1);
    let lasts_s = match (steps.first(), steps.last()) {
        (Some(first), Some(last)) => last.time_s - first.time_s,
        _ => 0.0,
    };
    let flagged = steps.iter().filter(|step| !step.flags.is_empty()).count();
    let data = meta.with_extension("sigmf-data");
    let size = std::fs::metadata(&data)
        .with_context(|| format!("cannot read {}", data.display()))?
        .len();
    let mut text = line("capture", &meta.display().to_string());
    text += &line("name", &setup.name);
    text += &line("hardware", &setup.hardware);
    text += &line(
        "data",
        &format!("{}, {} samples/s", bytes(size.into()), setup.sample_rate_hz),
    );
    let carriers = match setup.is_chirp() {
        true => format!(
            "chirps of {} at {}",
            hertz(setup.step_hz),
            hertz(setup.start_hz)
        ),
        false => format!(
            "{} from {}, {} apart",
            setup.steps,
            hertz(setup.start_hz),
            hertz(setup.step_hz)
        ),
    };
    text += &line("carriers", &carriers);
    text += &line(
        "band",
        &format!(
            "{} to {}",
            hertz(band.start_hz),
            hertz(band.start_hz + band.step_hz * band.count as f64)
        ),
    );
    text += &line(
        "holds",
        &format!(
            "{} steps of {sweeps} sweeps over {}",
            steps.len(),
            seconds(lasts_s)
        ),
    );
    text += &line(
        "receivers",
        &format!(
            "{} and {}",
            setup.receive_antennas[0], setup.receive_antennas[1]
        ),
    );
    text += &line(
        "antennas",
        match setup.antennas {
            Some(_) => "positions recorded",
            None => "no positions recorded",
        },
    );
    if flagged > 0 {
        text += &line("flagged", &format!("{flagged} incomplete steps"));
    }
    if recording.interrupted() {
        text += &line("interrupted", "steps were recovered from the journal");
    }
    text += &line(
        "next",
        "compute range profiles with subap profile, convert to phase history with subap radio convert",
    );
    Ok(Description {
        text,
        json: json!({
            "path": meta.display().to_string(),
            "kind": "capture",
            "name": setup.name,
            "hardware": setup.hardware,
            "sample_rate_hz": setup.sample_rate_hz,
            "carriers": { "start_hz": setup.start_hz, "step_hz": setup.step_hz, "count": setup.steps },
            "steps": steps.len(),
            "sweeps": sweeps,
            "seconds": lasts_s,
            "flagged": flagged,
            "bytes": size,
            "interrupted": recording.interrupted(),
        }),
    })
}

/// Describe the plan and radio of an experiment.
pub(super) fn experiment(session: &Session, path: &Path) -> anyhow::Result<Description> {
    let experiment = match AnyExperiment::read_within(path, &[], session.memory_bytes)? {
        AnyExperiment::Radio(experiment) => experiment,
        AnyExperiment::Chirps(experiment) => return Ok(chirps(path, &experiment)),
        AnyExperiment::Analyser(experiment) => return Ok(analyser(path, &experiment)),
    };
    let plan = &experiment.plan;
    let radio = radio(&experiment.device);
    let sweeps = match plan.sweeps {
        0 => "unlimited".to_owned(),
        sweeps => sweeps.to_string(),
    };
    let mut text = line("experiment", &path.display().to_string());
    text += &line("name", &plan.name);
    text += &line("radio", &radio);
    text += &line(
        "carriers",
        &format!(
            "{} from {}, {} apart, {} at each",
            plan.steps,
            hertz(plan.start_hz),
            hertz(plan.step_hz()),
            seconds(plan.dwell_s)
        ),
    );
    text += &line("sweeps", &sweeps);
    if let Some(live) = &experiment.live {
        let size = format!(
            "live image of {} x {} pixels, by subap live",
            live.grid.rows.count, live.grid.columns.count
        );
        text += &line("image", &size);
    }
    text += &line("next", "run it with subap capture");
    Ok(Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "experiment",
            "name": plan.name,
            "radio": radio,
            "carriers": { "start_hz": plan.start_hz, "step_hz": plan.step_hz(), "count": plan.steps },
            "sweeps": plan.sweeps,
            "images": experiment.live.is_some(),
        }),
    })
}

fn radio(device: &Device) -> String {
    match device {
        Device::Simulated(simulated) => {
            format!("simulated, scene {}", simulated.scenario.display())
        }
        Device::Uhd(_) => "USRP (UHD)".to_owned(),
        Device::Replay(path) => format!("replay of {}", path.display()),
    }
}

/// Describe the plan and radio of a capture of chirps.
fn chirps(path: &Path, experiment: &ChirpExperiment) -> Description {
    let (plan, radio) = (&experiment.plan, radio(&experiment.device));
    let bursts = match plan.bursts {
        0 => "unlimited".to_owned(),
        bursts => bursts.to_string(),
    };
    let mut text = line("experiment", &path.display().to_string());
    text += &line("name", &plan.name);
    text += &line("radio", &radio);
    let chirps = format!(
        "{} per burst at {}, {} in {}",
        plan.pulses,
        hertz(plan.carrier_hz),
        hertz(plan.bandwidth_hz),
        seconds(plan.duration_s)
    );
    text += &line("chirps", &chirps);
    text += &line("bursts", &bursts);
    text += &line("next", "run it with subap capture");
    Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "chirp experiment",
            "name": plan.name,
            "radio": radio,
            "chirps": {
                "carrier_hz": plan.carrier_hz,
                "bandwidth_hz": plan.bandwidth_hz,
                "duration_s": plan.duration_s,
                "interval_s": plan.interval_s,
                "per_burst": plan.pulses,
            },
            "bursts": plan.bursts,
        }),
    }
}

/// Describe the plan and analyser of an experiment.
fn analyser(path: &Path, experiment: &VnaExperiment) -> Description {
    let analyser = &experiment.analyser;
    let place = format!(
        "network analyser at {}, port {}",
        analyser.address, analyser.port
    );
    let mut text = line("experiment", &path.display().to_string());
    text += &line("name", &experiment.name);
    text += &line("device", &place);
    text += &line(
        "frequencies",
        &format!(
            "{} from {}, {} apart",
            analyser.points,
            hertz(analyser.start_hz),
            hertz(analyser.step_hz)
        ),
    );
    let sweeps = match experiment.sweeps {
        0 => "unlimited".to_owned(),
        sweeps => sweeps.to_string(),
    };
    text += &line("sweeps", &sweeps);
    text += &line("next", "run it with subap capture");
    Description {
        text,
        json: json!({
            "path": path.display().to_string(),
            "kind": "experiment",
            "name": experiment.name,
            "radio": place,
            "carriers": { "start_hz": analyser.start_hz, "step_hz": analyser.step_hz, "count": analyser.points },
            "sweeps": experiment.sweeps,
            "images": false,
        }),
    }
}
