//! Stages of a job and their dependencies.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde_json::{Map, Value};
use subaperture::job::{Basis, FileStamp, JobText, stamp};
use subaperture::phase_history::InputFile;

use super::options::Options;
use crate::args;

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

/// The report, which is made of all others.
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

    /// What it does, for people.
    pub(super) fn what(self) -> &'static str {
        match self {
            Self::Track => "the radar's track",
            Self::Autofocus => "what sharpens the image",
            Self::Focus => "the image",
            Self::Check => "its error against the exact sum",
            Self::Picture => "the report's picture",
            Self::Quality => "points and levels measured",
            Self::Products => "files for other programs",
        }
    }
}

/// A stage of a job, and what it depends on.
pub(super) struct Link {
    pub(super) stage: Stage,
    pub(super) basis: Basis,
    /// The stages that it goes on from, the nearest first.
    pub(super) before: Vec<&'static str>,
}

impl Link {
    pub(super) fn name(&self) -> &'static str {
        self.stage.name()
    }
}

/// The stages that a job has, in their order, made of recordings of which `inputs` are the files.
///
/// # Errors
/// If a file that a stage reads cannot be read.
pub(super) fn chain(
    job: &JobText,
    options: &Options,
    inputs: &[InputFile],
) -> anyhow::Result<Vec<Link>> {
    let recordings: Vec<FileStamp> = inputs
        .iter()
        .map(|input| FileStamp {
            path: input.path.display().to_string(),
            bytes: input.bytes,
            crc32: input.crc32.clone(),
        })
        .collect();
    let mut chain: Vec<Link> = Vec::new();
    let mut add = |stage: Stage, settings: Map<String, Value>, files: Vec<FileStamp>| {
        // Of those before, focus goes on from what it is told of, and all others from focus.
        let before: Vec<&'static str> = match stage {
            Stage::Track | Stage::Autofocus | Stage::Focus => {
                chain.iter().map(Link::name).collect()
            }
            _ => vec![Stage::Focus.name()],
        };
        let fingerprint = |name: &&'static str| {
            let link = chain.iter().find(|link| link.name() == *name);
            let link = link.expect("stages follow those that they go on from");
            ((*name).to_owned(), link.basis.fingerprint())
        };
        let after: BTreeMap<String, String> = before.iter().map(fingerprint).collect();
        chain.push(Link {
            stage,
            basis: Basis {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                stage: stage.name().to_owned(),
                settings,
                files,
                after,
            },
            before,
        });
    };
    if let Some(track) = &options.track {
        let logs = track.typed.logs.navigation.iter();
        let logs = logs
            .map(|path| beside(path))
            .collect::<Result<Vec<_>, _>>()?;
        let files = recordings.iter().cloned().chain(logs).collect();
        add(Stage::Track, track.settings.clone(), files);
    }
    if let Some(autofocus) = &options.autofocus {
        add(
            Stage::Autofocus,
            autofocus.settings.clone(),
            recordings.clone(),
        );
    }
    let mut files = recordings;
    for path in read_by(
        &options.focus.typed,
        options.track.is_none() && options.autofocus.is_none(),
    ) {
        files.push(beside(path)?);
    }
    add(Stage::Focus, options.focus.settings.clone(), files);
    if options.check > 0 {
        add(Stage::Check, job.settings(&["check"]), Vec::new());
    }
    add(Stage::Picture, options.picture.settings.clone(), Vec::new());
    add(Stage::Quality, job.settings(&["quality"]), Vec::new());
    if !options.formats.is_empty() {
        add(Stage::Products, job.settings(&["products"]), Vec::new());
    }
    Ok(chain)
}

/// Files that focusing reads beside the recordings; the track if it is `given`, and no stage's.
fn read_by(typed: &args::Focus, given: bool) -> impl Iterator<Item = &Path> {
    let surfacing = &typed.image.surfacing;
    let geoid = surfacing.geoid.as_ref().and_then(|geoid| geoid.file());
    let track = typed.track.as_ref().and_then(args::TrackSource::file);
    let track = track.filter(|_| given);
    surfacing
        .surface
        .file()
        .into_iter()
        .chain(geoid)
        .chain(track)
}

fn beside(path: &Path) -> anyhow::Result<FileStamp> {
    let named = || format!("cannot read {}", path.display());
    let found = stamp(path, &path.display().to_string()).with_context(named)?;
    found.with_context(|| format!("cannot read {}: it is not there", path.display()))
}
