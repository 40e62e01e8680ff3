//! Stages of a job and their dependencies.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde_json::{Map, Value};
use subaperture::job::{Basis, FileStamp, JobText, stamp};
use subaperture::phase_history::InputFile;

use super::job::Job;
use super::keys;
use crate::args::{FormerOptions, TrackSource, Windows};

/// Stage of a job's chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Track,
    Autofocus,
    Focus,
    Check,
    Picture,
    Quality,
    Products,
}

/// The report, which depends on all other stages.
pub(super) const REPORT: &str = "report";

impl Stage {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Track => "track",
            Self::Autofocus => "autofocus",
            Self::Focus => "focus",
            Self::Check => "check",
            Self::Picture => "picture",
            Self::Quality => "quality",
            Self::Products => "products",
        }
    }

    /// Result of the stage, for progress notes.
    pub(super) fn result(self) -> &'static str {
        match self {
            Self::Track => "the track of the radar",
            Self::Autofocus => "phase errors or the track, by autofocus",
            Self::Focus => "the image",
            Self::Check => "the error of the image against the exact sum",
            Self::Picture => "the picture of the report",
            Self::Quality => "point responses and image statistics",
            Self::Products => "products for other programs",
        }
    }
}

/// Stage of a job with its dependencies.
pub(super) struct Link {
    pub(super) stage: Stage,
    pub(super) basis: Basis,
    /// Preceding stages, the nearest first.
    pub(super) before: Vec<&'static str>,
}

impl Link {
    pub(super) fn name(&self) -> &'static str {
        self.stage.name()
    }
}

/// The stages of a job, in order. `inputs` are the files of its recordings.
///
/// # Errors
/// If a file that a stage reads cannot be read.
pub(super) fn chain(text: &JobText, job: &Job, inputs: &[InputFile]) -> anyhow::Result<Vec<Link>> {
    let recordings: Vec<FileStamp> = inputs
        .iter()
        .map(|input| FileStamp {
            path: input.path.display().to_string(),
            bytes: input.bytes,
            crc32: input.identity.text().to_owned(),
        })
        .collect();
    let mut chain: Vec<Link> = Vec::new();
    let mut add = |stage: Stage, files: Vec<FileStamp>| {
        // Focusing depends on the stages before it, and all stages after it on focusing.
        let before: Vec<&'static str> = match stage {
            Stage::Track | Stage::Autofocus | Stage::Focus => {
                chain.iter().map(Link::name).collect()
            }
            _ => vec![Stage::Focus.name()],
        };
        let fingerprint = |name: &&'static str| {
            let link = chain.iter().find(|link| link.name() == *name);
            let link = link.expect("a stage follows those that it depends on");
            ((*name).to_owned(), link.basis.fingerprint())
        };
        let after: BTreeMap<String, String> = before.iter().map(fingerprint).collect();
        chain.push(Link {
            stage,
            basis: Basis {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                stage: stage.name().to_owned(),
                settings: settings(text, stage),
                files,
                after,
            },
            before,
        });
    };
    if let Some(track) = &job.track {
        let logs = stamps(track.logs.navigation.iter().map(AsRef::as_ref))?;
        add(Stage::Track, [recordings.clone(), logs].concat());
    }
    if job.autofocus.is_some() {
        add(Stage::Autofocus, recordings.clone());
    }
    let more = stamps(read_by_focus(job))?;
    add(Stage::Focus, [recordings, more].concat());
    if job.check > 0 {
        add(Stage::Check, Vec::new());
    }
    add(Stage::Picture, Vec::new());
    add(Stage::Quality, Vec::new());
    if !job.products.formats.is_empty() {
        add(Stage::Products, Vec::new());
    }
    Ok(chain)
}

/// Settings on which a stage depends, by key. The files of the recordings are dependencies by content, not by name.
fn settings(text: &JobText, stage: Stage) -> Map<String, Value> {
    match stage {
        Stage::Focus => {
            let mut settings = text.settings(&["input", "grid", "former"]);
            settings.remove("input.files");
            let track = text.settings(&["track"]).remove_entry("track.source");
            settings.extend(track);
            settings
        }
        Stage::Autofocus => {
            let mut settings = text.settings(&["input", "autofocus"]);
            settings.remove("input.files");
            if !settings.contains_key("autofocus.grid") {
                settings.extend(text.settings(&["grid"]).remove_entry("grid.pixels"));
            }
            let shared = [keys::names::<FormerOptions>(), keys::names::<Windows>()].concat();
            let former = text.section("former").map(|(_, former)| former);
            let former = former.into_iter().flatten();
            let former = former.filter(|(key, _)| shared.contains(&key.as_str()));
            settings.extend(former.map(|(key, value)| (format!("former.{key}"), value)));
            settings
        }
        // Their sections have the names of the stages.
        Stage::Track | Stage::Check | Stage::Picture | Stage::Quality | Stage::Products => {
            text.settings(&[stage.name()])
        }
    }
}

/// Files that focusing reads besides the recordings, except outputs of other stages.
fn read_by_focus(job: &Job) -> impl Iterator<Item = &Path> {
    let grid = &job.focus.image.grid;
    let geoid = grid.geoid.as_ref().and_then(|geoid| geoid.file());
    let track = job.focus.track.as_ref().and_then(TrackSource::file);
    let track = track.filter(|_| job.track.is_none() && job.autofocus.is_none());
    let motion = job.focus.target.motion.as_deref();
    let ground = grid.surface.file().into_iter().chain(geoid);
    ground.chain(track).chain(motion)
}

fn stamps<'a>(paths: impl Iterator<Item = &'a Path>) -> anyhow::Result<Vec<FileStamp>> {
    let one = |path: &Path| {
        let named = || format!("cannot read {}", path.display());
        let found = stamp(path, &path.display().to_string()).with_context(named)?;
        found.with_context(|| format!("cannot read {}: it is not there", path.display()))
    };
    paths.map(one).collect()
}
