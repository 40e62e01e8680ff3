//! Sections of a job as settings structs: those of the commands, and those that only a job has.

use std::path::PathBuf;

use clap::{Args as Group, ValueEnum, ValueHint};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use subaperture::describe::error::Fault;
use subaperture::job::JobText;
use subaperture::terrain::{Geoid, PixelSurface};

use crate::args::{
    AutofocusSettings, Forming, GridSettings, Input, Logs, Look, Points, Producing, TargetMotion,
    defaults,
};

/// Keys of the top level.
#[derive(Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(super) struct Top {
    /// Title of the report [default: the file name of the job]
    #[arg(long)]
    pub(super) name: Option<String>,

    /// Folder for all outputs [default: beside this file, named as it is without its extension]
    #[arg(long, value_hint = ValueHint::DirPath)]
    pub(super) out: Option<PathBuf>,
}

/// `[track]`.
#[derive(Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(super) struct TrackSection {
    /// Source of the track: a file, an estimate from the recording's own echoes (mpga), or from echoes and navigation (fused)
    #[arg(long, value_enum, required = true)]
    pub(super) source: Source,

    /// Track file, as subap track writes it
    #[arg(long)]
    pub(super) file: Option<PathBuf>,

    #[command(flatten)]
    #[serde(flatten)]
    pub(super) logs: Logs,
}

/// Source of a job's track.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Source {
    File,
    #[default]
    Mpga,
    Fused,
}

/// `[former]`.
#[derive(Debug, Default, Group, Deserialize)]
#[serde(default)]
pub(super) struct FormerSection {
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) forming: Forming,

    #[command(flatten)]
    #[serde(flatten)]
    pub(super) target: TargetMotion,
}

/// `[check]`.
#[derive(Debug, Group, Deserialize)]
#[serde(default)]
pub(super) struct CheckSection {
    /// Number of pixels, chosen by a fixed seed, that are also formed by the exact sum; 0 for no check
    #[arg(long, default_value_t = 64)]
    pub(super) pixels: usize,
}

impl Default for CheckSection {
    fn default() -> Self {
        defaults()
    }
}

/// `[quality]`.
#[derive(Debug, Group, Deserialize)]
#[serde(default)]
pub(super) struct QualitySection {
    /// Number of points to measure, the strongest outside each other's side lobes; 0 for none
    #[arg(long, default_value_t = 5)]
    pub(super) points: usize,

    #[command(flatten)]
    #[serde(flatten)]
    pub(super) places: Points,
}

impl Default for QualitySection {
    fn default() -> Self {
        defaults()
    }
}

/// All sections of a job. Paths are relative to the working directory.
pub(super) struct Sections {
    pub(super) top: Top,
    pub(super) input: Input,
    pub(super) track: Option<TrackSection>,
    pub(super) autofocus: Option<AutofocusSettings>,
    pub(super) grid: GridSettings,
    pub(super) former: FormerSection,
    pub(super) check: CheckSection,
    pub(super) picture: Look,
    pub(super) quality: QualitySection,
    pub(super) products: Producing,
}

impl Sections {
    /// Read the sections of a job that agrees with the schema.
    ///
    /// # Errors
    /// All values that are not valid, and all combinations of keys that are not.
    pub(super) fn read(job: &JobText) -> Result<Self, Vec<Fault>> {
        let mut faults = Vec::new();
        let mut sections = Self {
            top: required(job, "", &mut faults),
            input: required(job, "input", &mut faults),
            track: optional(job, "track", &mut faults),
            autofocus: optional(job, "autofocus", &mut faults),
            grid: required(job, "grid", &mut faults),
            former: required(job, "former", &mut faults),
            check: required(job, "check", &mut faults),
            picture: required(job, "picture", &mut faults),
            quality: required(job, "quality", &mut faults),
            products: required(job, "products", &mut faults),
        };
        faults.extend(sections.contradictions(job));
        if !faults.is_empty() {
            return Err(faults);
        }
        sections.resolve_paths(job);
        Ok(sections)
    }

    /// Faults of keys that exclude or need each other.
    fn contradictions(&self, job: &JobText) -> Vec<Fault> {
        let values = job.values();
        let mut faults = Vec::new();
        if let (Some(_), Some(autofocus)) = (&self.track, values.optional_section("autofocus")) {
            let fault = "autofocus is of the positions as recorded, and [track] replaces them: leave one of the two out";
            faults.push(Fault::new(&autofocus.at, fault));
        }
        let target = &self.former.target;
        if target.velocity.is_some() && target.motion.is_some() {
            let fault = "give either velocity or motion, not both";
            faults.push(values.section("former").fault("motion", fault));
        }
        let input = values.section("input");
        if self.input.channel.is_some() && self.input.channels.is_some() {
            faults.push(input.fault("channels", "give either channel or channels, not both"));
        }
        if let Some(track) = &self.track
            && track.source != Source::File
            && self.input.files.len() != 1
        {
            let fault = "a track is estimated from one recording: name one file, or take a [track] of source \"file\"";
            faults.push(input.fault("files", fault));
        }
        if self.former.forming.squint.is_some() && self.former.forming.beam.is_none() {
            let fault = "'squint' needs 'beam': write for example beam = \"auto\"";
            faults.push(values.section("former").fault("squint", fault));
        }
        let forming = &self.former.forming;
        if forming.doppler_centroid.is_some() && forming.doppler_band.is_none() {
            let fault = "'doppler_centroid' needs 'doppler_band': write for example doppler_band = \"1 kHz\"";
            faults.push(values.section("former").fault("doppler_centroid", fault));
        }
        if forming.doppler_band.is_some() && forming.beam.is_some() {
            let fault = "give either beam or doppler_band, not both";
            faults.push(values.section("former").fault("doppler_band", fault));
        }
        faults
    }

    /// Join relative paths to the folder of the job's file.
    fn resolve_paths(&mut self, job: &JobText) {
        let track = self.track.iter_mut();
        let of_track =
            track.flat_map(|track| track.logs.navigation.iter_mut().chain(&mut track.file));
        let paths = self.input.files.iter_mut().chain(&mut self.top.out);
        for path in paths.chain(of_track).chain(&mut self.former.target.motion) {
            *path = job.path(&path);
        }
        if let PixelSurface::Dem(path) = &mut self.grid.surface {
            *path = job.path(&path);
        }
        // A number is the name of a file if there is one.
        if let Some(text) = job.values().section("grid").key::<Option<String>>("geoid") {
            let path = job.path(text);
            if path.exists() || matches!(self.grid.geoid, Some(Geoid::File(_))) {
                self.grid.geoid = Some(Geoid::File(path));
            }
        }
    }
}

/// A section that every job has; defaults if it has faults.
fn required<T: DeserializeOwned + Default>(
    job: &JobText,
    name: &str,
    faults: &mut Vec<Fault>,
) -> T {
    optional(job, name, faults).unwrap_or_default()
}

/// A section; `None` if it is absent or has faults.
fn optional<T: DeserializeOwned>(job: &JobText, name: &str, faults: &mut Vec<Fault>) -> Option<T> {
    let (values, settings) = job.section(name)?;
    let read = |settings| serde_json::from_value::<T>(Value::Object(settings));
    let error = match read(settings.clone()) {
        Ok(section) => return Some(section),
        Err(error) => error,
    };
    // Each key alone: all faults, each at its value.
    let before = faults.len();
    for (key, value) in settings {
        let alone = Map::from_iter([(key.clone(), value)]);
        if let Err(error) = read(alone) {
            faults.push(values.fault(&key, error.to_string()));
        }
    }
    if faults.len() == before {
        faults.push(Fault::new(&values.at, error.to_string()));
    }
    None
}
