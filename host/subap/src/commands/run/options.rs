//! From the keys of a job to what each of its stages is told: the options of the command that does the same by hand.
//!
//! A key's value is read as its option's, so that both take the same and have the same defaults, and what is wrong with it is shown where the
//! text has it. The tables below say which key is which option; a stage's settings, on which its fingerprint rests, are the keys of its table.

use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::Parser;
use serde_json::{Map, Value};
use subaperture::describe::error::Fault;
use subaperture::describe::values::{Value as OptionValues, Values};
use subaperture::geometry::Geodetic;
use subaperture::job::JobText;

use crate::args::{self, Args, Command, ImageFormat, TrackSource};

/// A key, `section.key`, and the option that it is.
type Keys = &'static [(&'static str, &'static str, &'static str)];

const INPUT: Keys = &[
    ("input", "channel", "channel"),
    ("input", "channels", "channels"),
];

/// Of the former, wherever images are formed.
const FORMER: Keys = &[
    ("former", "algorithm", "algorithm"),
    ("former", "error", "error-db"),
    ("former", "window", "window"),
    ("former", "slow_window", "slow-window"),
    ("former", "sub_cpi", "sub-cpi"),
    ("former", "patch", "patch"),
    ("former", "mode", "mode"),
    ("former", "no_keystone", "no-keystone"),
    ("former", "no_src", "no-src"),
];

const FOCUS: Keys = &[
    ("grid", "pixels", "grid"),
    ("grid", "surface", "surface"),
    ("grid", "geoid", "geoid"),
    ("grid", "troposphere", "troposphere"),
    ("former", "allow_error", "allow-error"),
    ("former", "beam", "beam"),
    ("former", "squint", "squint"),
    ("former", "velocity", "velocity"),
    ("former", "portable", "portable"),
    ("former", "scratch", "scratch"),
];

/// The track's source and file are no options of who finds it.
const TRACK: Keys = &[
    ("track", "navigation", "navigation"),
    ("track", "navigation_start", "navigation-start"),
    ("track", "lever_arm", "lever-arm"),
];

const AUTOFOCUS: Keys = &[
    ("autofocus", "method", "method"),
    ("autofocus", "measure", "measure"),
    ("autofocus", "rounds", "rounds"),
    ("autofocus", "points", "points"),
    ("autofocus", "within", "within"),
    ("autofocus", "estimator", "estimator"),
    ("autofocus", "unknown", "unknown"),
    ("autofocus", "goal", "goal"),
    ("autofocus", "patch_pixels", "patch-pixels"),
    ("autofocus", "looks", "looks"),
];
const OWN_GRID: Keys = &[("autofocus", "grid", "grid")];
const IMAGE_GRID: Keys = &[("grid", "pixels", "grid")];

const PICTURE: Keys = &[
    ("picture", "remap", "remap"),
    ("picture", "top", "top"),
    ("picture", "span", "span"),
    ("picture", "colours", "colours"),
];

/// The names of what stages leave, in the job's folder.
pub(super) const TRACK_CSV: &str = "track.csv";
pub(super) const TRACK_PNG: &str = "track.png";
pub(super) const CORRECTION: &str = "correction.csv";
pub(super) const AUTOFOCUS_PNG: &str = "autofocus.png";
pub(super) const PICTURE_PNG: &str = "picture.png";

/// A stage that a command does: what it is told, and the settings that this comes from.
pub(super) struct Told<T> {
    pub(super) typed: T,
    pub(super) settings: Map<String, Value>,
}

/// What all stages are told.
pub(super) struct Options {
    /// What the report is called.
    pub(super) name: String,
    /// Folder of the job's outputs.
    pub(super) out: PathBuf,
    pub(super) track: Option<Told<Box<args::Track>>>,
    pub(super) autofocus: Option<Told<Box<args::Autofocus>>>,
    pub(super) focus: Told<Box<args::Focus>>,
    /// Pixels that are formed by the exact sum.
    pub(super) check: u64,
    pub(super) picture: Told<args::Picture>,
    /// Strongest points that are measured.
    pub(super) points: u64,
    pub(super) quality: Box<args::Quality>,
    pub(super) formats: Vec<ImageFormat>,
    pub(super) place: Option<Geodetic>,
}

impl Options {
    /// Those of a job in the file `path`.
    ///
    /// # Errors
    /// Everything that is wrong with values, where they are.
    pub(super) fn of(
        job: &JobText,
        path: &Path,
        writing: args::Writing,
    ) -> Result<Self, Vec<Fault>> {
        let top = job.values();
        let out = match top.optional_text("out") {
            Some(out) => job.path(out),
            None => path.with_extension(""),
        };
        if top.optional_text("out").is_none() && out == path {
            let what = "this file's name has no ending, without which the folder could be called so: say how it is called, as out = \"my-job\"";
            return Err(vec![Fault::new(&top.at, what)]);
        }
        let name = top.optional_text("name").map(str::to_owned);
        let name = name.unwrap_or_else(|| {
            let stem = path.file_stem().unwrap_or_default();
            stem.to_string_lossy().into_owned()
        });
        let typing = Typing {
            job,
            out: &out,
            writing,
        };
        let mut faults = Vec::new();
        let mut keep = |found: Vec<Fault>| faults.extend(found);
        let track = typing.track().unwrap_or_else(|found| {
            keep(found);
            None
        });
        let autofocus = typing.autofocus().unwrap_or_else(|found| {
            keep(found);
            None
        });
        let focus = typing.focus(autofocus.as_ref().map(|told| &*told.typed));
        let picture = typing.picture();
        let quality = typing.quality();
        let products = typing.products();
        match (focus, picture, quality, products) {
            (Ok(focus), Ok(picture), Ok(quality), Ok((formats, place))) if faults.is_empty() => {
                Ok(Self {
                    name,
                    track,
                    autofocus,
                    focus,
                    check: top.section("check").count("pixels"),
                    picture,
                    points: top.section("quality").count("points"),
                    quality,
                    formats,
                    place,
                    out: out.clone(),
                })
            }
            (focus, picture, quality, products) => {
                let found = [focus.err(), picture.err(), quality.err(), products.err()];
                faults.extend(found.into_iter().flatten().flatten());
                // One key may be an option of several stages.
                let mut told = Vec::<Fault>::new();
                for found in faults {
                    let known =
                        |other: &Fault| other.at == found.at && other.message == found.message;
                    if !told.iter().any(known) {
                        told.push(found);
                    }
                }
                Err(told)
            }
        }
    }
}

/// What a job's keys become options by.
struct Typing<'a> {
    job: &'a JobText,
    out: &'a Path,
    writing: args::Writing,
}

impl Typing<'_> {
    fn section(&self, name: &str) -> Option<&Values> {
        self.job.values().optional_section(name)
    }

    fn inputs(&self) -> Vec<OsString> {
        let files = self.job.values().section("input").texts("files");
        files
            .iter()
            .map(|file| self.job.path(file).into())
            .collect()
    }

    fn in_folder(&self, name: &str) -> OsString {
        self.out.join(name).into()
    }

    fn force(&self) -> Option<OsString> {
        self.writing.force.then(|| "--force".into())
    }

    fn track(&self) -> Result<Option<Told<Box<args::Track>>>, Vec<Fault>> {
        let Some(track) = self.section("track") else {
            return Ok(None);
        };
        if track.text("source") == "file" {
            return Ok(None);
        }
        let mut words = self.inputs();
        if words.len() != 1 {
            let input = self.job.values().section("input");
            let what = "a track is found of one recording: name one file, or take a [track] of source \"file\"";
            return Err(vec![input.fault("files", what)]);
        }
        words.extend(["--out".into(), self.in_folder(TRACK_CSV)]);
        words.extend(["--picture".into(), self.in_folder(TRACK_PNG)]);
        words.extend(self.force());
        let mut told = self.told("track", words, &[TRACK], |command| match command {
            Command::Track(typed) => Some(Box::new(typed)),
            _ => None,
        })?;
        told.settings
            .insert("track.source".to_owned(), track.text("source").into());
        Ok(Some(told))
    }

    fn autofocus(&self) -> Result<Option<Told<Box<args::Autofocus>>>, Vec<Fault>> {
        let Some(autofocus) = self.section("autofocus") else {
            return Ok(None);
        };
        let grid = match autofocus.optional_text("grid") {
            Some(_) => OWN_GRID,
            None => IMAGE_GRID,
        };
        let mut words = self.inputs();
        words.extend(["--out".into(), self.in_folder(CORRECTION)]);
        words.extend(["--picture".into(), self.in_folder(AUTOFOCUS_PNG)]);
        words.extend(self.force());
        let keys = [INPUT, AUTOFOCUS, grid, FORMER];
        self.told("autofocus", words, &keys, |command| match command {
            Command::Autofocus(typed) => Some(Box::new(typed)),
            _ => None,
        })
        .map(Some)
    }

    fn focus(
        &self,
        autofocus: Option<&args::Autofocus>,
    ) -> Result<Told<Box<args::Focus>>, Vec<Fault>> {
        let mut words = self.inputs();
        // Existing tiles, if any, belong to this job.
        words.extend(["--out".into(), self.out.into(), "--resume".into()]);
        words.extend(self.force());
        let keys = [INPUT, FOCUS, FORMER];
        let mut told = self.told("focus", words, &keys, |command| match command {
            Command::Focus(typed) => Some(typed),
            _ => None,
        })?;
        let track = self.section("track");
        if let Some(track) = track {
            let source = track.text("source");
            told.settings
                .insert("track.source".to_owned(), source.into());
            let path = match source {
                "file" => self.job.path(track.text("file")),
                _ => self.out.join(TRACK_CSV),
            };
            told.typed.track = Some(TrackSource::File(path));
        }
        if let Some(autofocus) = autofocus {
            let path = self.out.join(CORRECTION);
            match autofocus.finds_track() {
                true => told.typed.track = Some(TrackSource::File(path)),
                false => told.typed.phase = Some(path),
            }
        }
        Ok(told)
    }

    fn picture(&self) -> Result<Told<args::Picture>, Vec<Fault>> {
        let mut words: Vec<OsString> = vec![self.out.into(), "--out".into()];
        words.push(self.in_folder(PICTURE_PNG));
        words.extend(self.force());
        self.told("picture", words, &[PICTURE], |command| match command {
            Command::Picture(typed) => Some(typed),
            _ => None,
        })
    }

    fn quality(&self) -> Result<Box<args::Quality>, Vec<Fault>> {
        let rows = self.job.values().section("quality").optional_rows("at");
        let mut words: Vec<OsString> = vec![self.out.into()];
        for row in rows.into_iter().flatten() {
            words.push(format!("--at={},{}", row[0], row[1]).into());
        }
        let told = self.told("quality", words, &[], |command| match command {
            Command::Quality(typed) => Some(Box::new(typed)),
            _ => None,
        })?;
        Ok(told.typed)
    }

    fn products(&self) -> Result<(Vec<ImageFormat>, Option<Geodetic>), Vec<Fault>> {
        let products = self.job.values().section("products");
        // Any name will do: only the place is taken from there.
        let words = vec![self.out.into(), "--out".into(), self.in_folder("map.kmz")];
        let place: Keys = &[("products", "place", "place")];
        let told = self.told("export", words, &[place], |command| match command {
            Command::Export(typed) => Some(typed),
            _ => None,
        })?;
        let mut formats = Vec::new();
        for name in products.optional_texts("formats").unwrap_or_default() {
            let known = <ImageFormat as clap::ValueEnum>::from_str(name, false);
            let format = known.map_err(|_| {
                vec![products.fault("formats", format!("\"{name}\" is not written here yet"))]
            })?;
            if !formats.contains(&format) {
                formats.push(format);
            }
        }
        Ok((formats, told.typed.place))
    }

    /// What `command` is told by `words`, and by the keys of `tables` that are there.
    fn told<T>(
        &self,
        command: &str,
        words: Vec<OsString>,
        tables: &[Keys],
        take: impl Fn(Command) -> Option<T>,
    ) -> Result<Told<T>, Vec<Fault>> {
        let fixed: Vec<OsString> = ["subap".into(), command.into()]
            .into_iter()
            .chain(words)
            .collect();
        let mut settings = Map::new();
        let mut options: Vec<(&Values, &str, Vec<OsString>)> = Vec::new();
        for (section, key, option) in tables.iter().copied().flatten() {
            let all = self.job.settings(&[section]);
            let name = format!("{section}.{key}");
            let (Some(values), Some(value)) = (self.section(section), all.get(&name)) else {
                continue;
            };
            settings.insert(name, value.clone());
            options.push((values, key, self.typed(option, &values.keys[*key].value)));
        }
        let words = fixed
            .iter()
            .chain(options.iter().flat_map(|(_, _, words)| words));
        match Args::try_parse_from(words) {
            Ok(typed) => {
                let command = typed.command.expect("a command was named");
                Ok(Told {
                    typed: take(command).expect("it is the one that was named"),
                    settings,
                })
            }
            Err(error) => {
                // Each alone, to tell whose fault it is.
                let alone = options.iter().filter_map(|(values, key, words)| {
                    let error = Args::try_parse_from(fixed.iter().chain(words)).err()?;
                    Some(values.fault(key, message(&error)))
                });
                let found: Vec<Fault> = alone.collect();
                Err(match found.is_empty() {
                    true => vec![Fault::new(&self.job.values().at, message(&error))],
                    false => found,
                })
            }
        }
    }

    /// A surface, its file from the text's folder.
    fn surface(&self, text: &str) -> String {
        match text.split_once(':') {
            Some(("dem", file)) if !file.is_empty() => {
                format!("dem:{}", self.job.path(file).display())
            }
            _ => text.to_owned(),
        }
    }

    /// A geoid: a number, or a file from the text's folder.
    fn geoid(&self, text: &str) -> String {
        let file = self.job.path(text);
        match file.exists() {
            true => file.display().to_string(),
            false => text.to_owned(),
        }
    }

    /// A value as it is typed for `option`.
    fn typed(&self, option: &str, value: &OptionValues) -> Vec<OsString> {
        let one = |text: String| vec![OsString::from(format!("--{option}={text}"))];
        match value {
            OptionValues::Text(text) => one(match option {
                "surface" => self.surface(text),
                "geoid" => self.geoid(text),
                _ => text.clone(),
            }),
            OptionValues::Flag(true) => vec![format!("--{option}").into()],
            OptionValues::Flag(false) => Vec::new(),
            OptionValues::Count(count) => one(count.to_string()),
            OptionValues::Number(number) => one(number.to_string()),
            OptionValues::Numbers(numbers) => {
                let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
                one(numbers.join(","))
            }
            // Such options are of files.
            OptionValues::Texts(texts) => {
                let word = |text: &String| {
                    let mut word = OsString::from(format!("--{option}="));
                    word.push(self.job.path(text));
                    word
                };
                texts.iter().map(word).collect()
            }
            OptionValues::Rows(_) => Vec::new(),
        }
    }
}

/// What is wrong, without the option's name where the value alone is.
fn message(error: &clap::Error) -> String {
    if let Some(cause) = error.source() {
        return cause.to_string();
    }
    let text = error.to_string();
    let line = text.lines().next().unwrap_or_default();
    line.strip_prefix("error: ").unwrap_or(line).to_owned()
}
