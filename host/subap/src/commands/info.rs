//! `subap info`: describe a recording or any other file that Subaperture reads or writes.

mod advice;
mod captures;
mod description;
mod doppler;
mod facts;
mod images;
mod l0b;
mod scene;
mod stored;
mod texts;
mod tracks;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use glam::DVec3;
use serde_json::{Value, json};
use subaperture::FileKind;
use subaperture::io::cphd::CphdInfo;
use subaperture::io::l0b::L0bInfo;
use subaperture::io::open::{Options, cphd_info, crsd_info, l0b_info, open_channels};
use subaperture::phase_history::{PhaseHistory, ReadError, TrackError};
use subaperture::resolution::survey::{DefaultGrid, Survey};

use crate::args::Info;
use crate::config::Session;
use crate::failure::Usage;
use crate::messages;
use crate::text::{self};
use advice::Advice;
use doppler::Doppler;

/// Print the survey of the inputs as one aperture.
pub(crate) fn run(session: &Session, typed: &Info) -> anyhow::Result<()> {
    let kinds = typed.input.files.iter();
    let kinds: Vec<(&PathBuf, FileKind)> =
        kinds.map(|path| (path, stored::kind_of(path))).collect();
    if kinds.iter().any(|(_, kind)| *kind != FileKind::Recording) {
        return describe_files(session, &kinds);
    }
    let history = session.open(&typed.input)?;
    if typed.at.is_none() {
        scene::warn_without(session, &typed.input);
    }
    let survey = match typed.at {
        None => Survey::of(history.collection()),
        Some(place_m) => Survey::at(history.collection(), place_m),
    };
    let survey = survey.context("the input holds no pulses")?;
    if survey.centre_at_antennas {
        let [x, y, z] = survey.scene_centre_m;
        messages::warning(format!(
            "resolution and geometry apply at x {x} m, y {y} m, z {z} m, which is at the antennas: give a point of the scene with --at X,Y,Z"
        ));
    }
    let advice = Advice::of(session, &history, &survey);
    let doppler = Doppler::of(session, &history, &survey)?;
    let track_error = TrackError::of(&history);
    let left_bytes = session.memory_bytes.saturating_sub(history.held_bytes());
    let containers = containers(&typed.input.files, left_bytes)?;
    let sampled = sampled_patterns(&typed.input.files)?;
    if session.json() {
        let mut value = serde_json::to_value(&survey)?;
        value["sub_cpi_advice"] = advice.to_json();
        value["track_error"] = serde_json::to_value(track_error)?;
        value["ambiguity"] = json!(survey.ambiguity());
        value["beam"] = match history.stated_beam() {
            Ok(beam) => json!(beam.map(|beam| json!({
                "width_deg": beam.width_rad.to_degrees(),
                "squint_deg": beam.squint_rad.to_degrees(),
                "source": beam.source,
                "turns": !beam.aims.is_empty(),
            }))),
            Err(why) => json!({ "none": why.to_string() }),
        };
        value["doppler"] = doppler.to_json();
        value["sampled_antenna_patterns"] = json!(sampled);
        value["warnings"] = json!(history.warnings());
        value["defects"] = serde_json::to_value(history.defects())?;
        value["channels"] = serde_json::to_value(history.channels())?;
        value["phase"] = serde_json::to_value(history.phase_conventions())?;
        value["containers"] = containers.iter().map(Container::to_json).collect();
        value["default_grid"] = match survey.default_grid() {
            Ok(DefaultGrid { grid, cropped, .. }) => json!({
                "x": grid.columns, "y": grid.rows, "z": grid.origin_m.z, "cropped": cropped
            }),
            Err(why) => json!({ "none": why.to_string() }),
        };
        text::say_json("info", value)?;
    } else {
        let files: String = containers.iter().map(Container::describe).collect();
        let mut report = files;
        let channels = history.channels();
        for channel in channels.iter().filter(|_| channels.len() > 1) {
            if let (Some(transmitter), Some(receiver)) = (&channel.transmitter, &channel.receiver) {
                let _ = writeln!(
                    report,
                    "{:<16} {}: transmitter {transmitter}, receiver {receiver}",
                    "  channel", channel.name
                );
            }
        }
        report += &facts::describe(session, &survey, &advice);
        match history.stated_beam() {
            Ok(None) => {}
            Ok(Some(beam)) => {
                let turns = match beam.aims.is_empty() {
                    true => "",
                    false => " on average, turning with the antennas",
                };
                let _ = writeln!(
                    report,
                    "{:<16} {:.3} deg wide, {:.3} deg forward of broadside{turns}, {}",
                    "beam",
                    beam.width_rad.to_degrees(),
                    beam.squint_rad.to_degrees(),
                    beam.source.name()
                );
            }
            Err(why) => {
                let _ = writeln!(
                    report,
                    "{:<16} the stated antenna patterns are not used: {why}",
                    "beam"
                );
            }
        }
        if let count @ 1.. = sampled {
            let _ = writeln!(
                report,
                "{:<16} {count} sampled antenna patterns, not used as a beam: subap focus takes it from --beam or the Doppler spectrum",
                "beam"
            );
        }
        report += &doppler.describe();
        for convention in history.phase_conventions() {
            let _ = writeln!(report, "{:<16} {convention}", "phase");
        }
        if let Some(error) = track_error {
            let _ = writeln!(
                report,
                "{:<16} contained in the file; the recorded positions deviate by {} RMS, {} at most",
                "true track",
                text::metres(Some(error.rms_m)),
                text::metres(Some(error.max_m))
            );
        }
        text::say(report)?;
    }
    Ok(())
}

/// Describe files that are not recordings, one after the other.
fn describe_files(session: &Session, paths: &[(&PathBuf, FileKind)]) -> anyhow::Result<()> {
    if let Some((path, _)) = paths.iter().find(|(_, kind)| *kind == FileKind::Recording) {
        return Err(Usage(format!(
            "{} is a recording, and others are not: describe them in separate commands",
            path.display()
        ))
        .into());
    }
    let found: Vec<description::Description> = paths
        .iter()
        .map(|(path, kind)| stored::describe(session, path, kind))
        .collect::<anyhow::Result<_>>()?;
    if session.json() {
        let stored: Vec<&Value> = found.iter().map(|found| &found.json).collect();
        return text::say_json("info-stored", json!({ "stored": stored }));
    }
    let texts: Vec<&str> = found.iter().map(|found| found.text.as_str()).collect();
    text::say(texts.join("\n"))?;
    Ok(())
}

/// File with metadata of its own.
enum Container {
    Cphd(Box<CphdContainer>),
    L0b(PathBuf, Box<L0bInfo>),
}

impl Container {
    fn describe(&self) -> String {
        match self {
            Self::Cphd(container) => container.describe(),
            Self::L0b(path, info) => l0b::describe(path, info),
        }
    }

    fn to_json(&self) -> Value {
        match self {
            Self::Cphd(container) => container.to_json(),
            Self::L0b(path, info) => l0b::to_json(path, info),
        }
    }
}

/// CPHD file with its metadata.
struct CphdContainer {
    path: PathBuf,
    info: CphdInfo,
    /// Antenna positions of each channel at the middle pulse relative to the first channel, metres; or the reason why the channels
    /// cannot be compared. `None` for a single channel.
    offsets_m: Option<Result<Vec<DVec3>, ReadError>>,
}

/// Number of antenna patterns that CRSD files hold as sampled arrays.
fn sampled_patterns(paths: &[PathBuf]) -> anyhow::Result<u64> {
    let mut count = 0;
    for path in paths {
        count += crsd_info(path)?.map_or(0, |info| info.num_antenna_patterns);
    }
    Ok(count)
}

fn containers(paths: &[PathBuf], memory_bytes: u64) -> anyhow::Result<Vec<Container>> {
    let mut containers = Vec::new();
    for path in paths {
        if let Some(info) = cphd_info(path, memory_bytes)? {
            containers.push(Container::Cphd(Box::new(CphdContainer {
                path: path.clone(),
                offsets_m: (info.channels.len() > 1).then(|| offsets_m(path, memory_bytes)),
                info,
            })));
        } else if let Some(info) = l0b_info(path, memory_bytes)? {
            containers.push(Container::L0b(path.clone(), Box::new(info)));
        }
    }
    Ok(containers)
}

fn offsets_m(path: &Path, memory_bytes: u64) -> Result<Vec<DVec3>, ReadError> {
    let options = Options {
        memory_bytes,
        ..Options::default()
    };
    let channels = open_channels::<&str>(path, None, &options)?;
    let middle = channels.num_pulses() / 2;
    let phase_centre_m = |history: &dyn PhaseHistory| {
        let pulse = &history.collection().pulses[middle];
        pulse.phase_centre_m()
    };
    let first_m = phase_centre_m(channels.channel(0));
    let all = channels.iter().map(|(_, history)| phase_centre_m(history));
    Ok(all.map(|centre_m| centre_m - first_m).collect())
}

impl CphdContainer {
    fn describe(&self) -> String {
        let info = &self.info;
        let mut text = format!(
            "{:<16} CPHD {}, {} domain, SGN {}, {}\n",
            self.path.display(),
            info.version,
            info.domain,
            info.sgn,
            info.classification
                .as_deref()
                .unwrap_or("classification not given"),
        );
        for (i, channel) in info.channels.iter().enumerate() {
            let reference = if channel.id == info.ref_channel {
                " (reference)"
            } else {
                ""
            };
            let _ = writeln!(
                text,
                "{:<16} {}: {} vectors of {} samples{reference}{}",
                "  channel",
                channel.id,
                channel.num_vectors,
                channel.num_samples,
                self.channel_details(i)
            );
        }
        if let Some(Err(why)) = &self.offsets_m {
            let _ = writeln!(text, "{:<16} not side by side: {why}", "");
        }
        text
    }

    /// Polarisation, band and antenna offset of channel `i`.
    fn channel_details(&self, i: usize) -> String {
        let channel = &self.info.channels[i];
        let about = channel.about();
        let mut text = String::new();
        if let (Some(transmitted), Some(received)) = (about.tx_polarization, about.rcv_polarization)
        {
            let _ = write!(text, ", {transmitted}{received}");
        }
        if let (Some(centre_hz), Some(width_hz)) = (channel.fx_c_hz, channel.fx_bw_hz) {
            let (centre, width) = (text::hertz(centre_hz), text::hertz(width_hz));
            let _ = write!(text, ", {width} about {centre}");
        }
        if let (1.., Some(Ok(offsets_m))) = (i, &self.offsets_m) {
            let [x, y, z] = offsets_m[i].to_array();
            let first = &self.info.channels[0].id;
            let _ = write!(
                text,
                ", antennas x {x:.4} m, y {y:.4} m, z {z:.4} m from those of {first}"
            );
        }
        text
    }

    fn to_json(&self) -> Value {
        let info = &self.info;
        json!({
            "path": self.path.to_string_lossy(),
            "format": format!("CPHD {}", info.version),
            "domain": info.domain.to_string(),
            "sgn": info.sgn.to_string(),
            "classification": info.classification,
            "collector": info.collector_name,
            "collection_start": info.collection_start,
            "reference_channel": info.ref_channel,
            "channels": info.channels.iter().enumerate().map(|(i, channel)| json!({
                "id": channel.id,
                "vectors": channel.num_vectors,
                "samples": channel.num_samples,
                "tx_polarization": channel.tx_polarization,
                "rcv_polarization": channel.rcv_polarization,
                "centre_hz": channel.fx_c_hz,
                "bandwidth_hz": channel.fx_bw_hz,
                "offset_m": match &self.offsets_m {
                    Some(Ok(offsets_m)) => Some(offsets_m[i].to_array()),
                    _ => None,
                },
            })).collect::<Vec<_>>(),
            "not_side_by_side": match &self.offsets_m {
                Some(Err(why)) => Some(why.to_string()),
                _ => None,
            },
        })
    }
}
