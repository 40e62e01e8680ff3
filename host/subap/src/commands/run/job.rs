//! A job as the settings of its stages: for each stage the arguments of the command that does the same alone.

use std::path::{Path, PathBuf};

use subaperture::describe::error::Fault;
use subaperture::job::JobText;

use super::sections::{Sections, Source};
use crate::args::{
    Autofocus, DeviceChoice, Focus, Imaging, Input, Logs, Picture, Producing, Quality, Rehearsal,
    Tiled, Track, TrackSource, Writing, defaults,
};

/// File names of the outputs of stages, in the job's folder.
pub(super) const TRACK_CSV: &str = "track.csv";
pub(super) const TRACK_PNG: &str = "track.png";
pub(super) const CORRECTION: &str = "correction.csv";
pub(super) const AUTOFOCUS_PNG: &str = "autofocus.png";
pub(super) const PICTURE_PNG: &str = "picture.png";

/// Settings of all stages.
pub(super) struct Job {
    /// Title of the report.
    pub(super) name: String,
    /// Folder of the outputs.
    pub(super) out: PathBuf,
    pub(super) track: Option<Track>,
    pub(super) autofocus: Option<Autofocus>,
    pub(super) focus: Focus,
    /// Number of pixels that are also formed by the exact sum.
    pub(super) check: usize,
    pub(super) picture: Picture,
    /// Number of the strongest points that are measured.
    pub(super) points: usize,
    pub(super) quality: Quality,
    pub(super) products: Producing,
}

impl Job {
    /// Settings of the job in the file `path`.
    ///
    /// # Errors
    /// All faults of its values.
    pub(super) fn new(text: &JobText, path: &Path, writing: Writing) -> Result<Self, Vec<Fault>> {
        let sections = Sections::read(text)?;
        let out = match &sections.top.out {
            Some(out) => out.clone(),
            None => path.with_extension(""),
        };
        if out == path {
            let fault = "the name of this file has no extension that the name of the output folder could omit: name the folder, as out = \"my-job\"";
            return Err(vec![Fault::new(&text.values().at, fault)]);
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let name = sections.top.name.clone().unwrap_or(stem.into_owned());
        let track = track(&sections, &out, writing);
        let autofocus = autofocus(&sections, &out, writing);
        Ok(Self {
            name,
            track,
            picture: Picture {
                images: vec![out.clone()],
                out: out.join(PICTURE_PNG),
                looks: None,
                sub_apertures: None,
                look: sections.picture,
                writing,
            },
            quality: Quality {
                image: out.clone(),
                points: sections.quality.places.clone(),
                from: Vec::new(),
                against: None,
                measuring: defaults(),
                plots: None,
                rehearsal: Rehearsal::default(),
                writing,
            },
            check: sections.check.pixels,
            points: sections.quality.points,
            products: sections.products.clone(),
            focus: focus(sections, autofocus.as_ref(), &out, writing),
            autofocus,
            out,
        })
    }
}

/// The track stage; `None` if the job has no track to estimate.
fn track(sections: &Sections, out: &Path, writing: Writing) -> Option<Track> {
    let track = sections.track.as_ref()?;
    let [input] = &sections.input.files[..] else {
        return None;
    };
    (track.source != Source::File).then(|| Track {
        input: input.clone(),
        set: Vec::new(),
        out: out.join(TRACK_CSV),
        picture: Some(out.join(TRACK_PNG)),
        tracking: defaults(),
        logs: track.logs.clone(),
        writing,
    })
}

/// The autofocus stage, by default on the grid of the image; `None` if the job has none.
fn autofocus(sections: &Sections, out: &Path, writing: Writing) -> Option<Autofocus> {
    let mut settings = sections.autofocus.clone()?;
    settings.grid = settings.grid.or_else(|| sections.grid.pixels.clone());
    let forming = &sections.former.forming;
    Some(Autofocus {
        input: sections.input.clone(),
        settings,
        out: Some(out.join(CORRECTION)),
        picture: Some(out.join(AUTOFOCUS_PNG)),
        former: forming.former.clone(),
        windows: forming.windows,
        keep_unjudged: false,
        writing,
        rehearsal: Rehearsal::default(),
    })
}

/// The focus stage, with the track or the phases of the stages before.
fn focus(sections: Sections, autofocus: Option<&Autofocus>, out: &Path, writing: Writing) -> Focus {
    let correction = autofocus.map(|autofocus| {
        let path = out.join(CORRECTION);
        (path, autofocus.settings.finds_track())
    });
    let (track, phase) = match (sections.track, correction) {
        (Some(track), _) => {
            let path = track.file.unwrap_or_else(|| out.join(TRACK_CSV));
            (Some(path), None)
        }
        (None, Some((path, true))) => (Some(path), None),
        (None, Some((path, false))) => (None, Some(path)),
        (None, None) => (None, None),
    };
    Focus {
        input: Input {
            set: Vec::new(),
            ..sections.input
        },
        from_maps: None,
        out: out.to_owned(),
        image: Imaging {
            forming: sections.former.forming,
            grid: sections.grid,
            model: None,
        },
        target: sections.former.target,
        track: track.map(TrackSource::File),
        logs: Logs::default(),
        phase,
        gmti: None,
        check: None,
        device: DeviceChoice::Cpu,
        tiled: Tiled {
            // Tiles in the folder are those of this job.
            resume: true,
            ..Tiled::default()
        },
        look: Default::default(),
        producing: Producing::default(),
        writing,
        rehearsal: Rehearsal::default(),
    }
}
