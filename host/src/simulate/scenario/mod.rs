//! Scenarios: a text that says what to simulate, made into an [`Experiment`].
//!
//! The text is TOML. Quantities carry their units (`pri = "1 ms"`), and everything is checked against
//! one table of keys, which [`reference()`] prints. Errors point at file, line and column, show the line,
//! and say what to do; several are told at once.
//!
//! ```text
//! text ─> tree (values and places; settings laid over) ─> resolve (names, kinds, units, bounds,
//!         defaults) ─> radar, receiver, platform, scene ─> check (what makes no sense together)
//! ```
//!
//! A setting ([`Scenario::set`]) overrides one key of the text, as `radar.pri` or
//! `scene.point[0].position`; its errors name it in place of a line.
//!
//! # Example
//! ```
//! use subaperture::simulate::scenario::Scenario;
//!
//! let text = r#"
//!     [radar]
//!     kind = "ideal"
//!     pulses = 64
//!     pri = "1 ms"
//!     centre = "10 GHz"
//!     bandwidth = "200 MHz"
//!     samples = 128
//!
//!     [platform]
//!     kind = "linear"
//!     position = "0, -5, 3 km"
//!     velocity = "100, 0, 0 m/s"
//!
//!     [[scene.point]]
//!     position = "10, 5, 0 m"
//! "#;
//! let mut scenario = Scenario::new("first.toml", text, ".");
//! scenario.set("radar.pri", "0.5 ms")?;
//! let experiment = scenario.experiment()?;
//! assert_eq!(experiment.radar.pri_s, 0.5e-3);
//!
//! scenario.set("radar.pri", "0.5 mm")?;
//! let error = scenario.experiment().unwrap_err().to_string();
//! assert!(error.contains("a length and a time is wanted"), "{error}");
//! # Ok::<(), subaperture::simulate::scenario::ScenarioError>(())
//! ```

mod check;
mod error;
pub mod examples;
mod keys;
mod nearest;
mod platform;
mod radar;
mod receiver;
mod recorded;
mod resolve;
mod scene;
mod schema;
mod tree;
mod units;
mod values;

use std::io;
use std::path::{Path, PathBuf};

use super::engine::Method;
use super::experiment::Experiment;
use error::{At, Found, explain};
use tree::{Step, lay_over, parse_path, parse_setting};

pub use error::{Fault, ScenarioError};
pub use keys::reference;

/// Longest text that is read, bytes: far longer than anyone writes.
const LONGEST_BYTES: u64 = 16 << 20;

/// A text that says what to simulate, and settings that override it.
#[derive(Clone, Debug)]
pub struct Scenario {
    file: String,
    text: String,
    folder: PathBuf,
    settings: Vec<Setting>,
}

#[derive(Clone, Debug)]
struct Setting {
    path: Vec<Step>,
    value: String,
    /// `KEY=VALUE`, for errors.
    words: String,
}

impl Scenario {
    /// A scenario of a text. `file` names it in errors; paths in it start at `folder`.
    pub fn new(
        file: impl Into<String>,
        text: impl Into<String>,
        folder: impl Into<PathBuf>,
    ) -> Self {
        Self {
            file: file.into(),
            text: text.into(),
            folder: folder.into(),
            settings: Vec::new(),
        }
    }

    /// Reads a scenario's text.
    ///
    /// # Errors
    /// If the file cannot be read, is no UTF-8, or has more than 16 MiB.
    pub fn read(path: &Path) -> io::Result<Self> {
        if std::fs::metadata(path)?.len() > LONGEST_BYTES {
            return Err(io::Error::other("more than 16 MiB: is this a scenario?"));
        }
        let text = std::fs::read_to_string(path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Ok(Self::new(path.display().to_string(), text, folder))
    }

    /// Overrides the key at a dotted path, such as `radar.pri` or `scene.point[0].position`. The value is
    /// as in the text; a text may leave out its quotes. Later settings override earlier ones.
    ///
    /// # Errors
    /// For a key that there is not; values are checked by [`Self::experiment`].
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), ScenarioError> {
        let words = format!("{key}={value}");
        let path = parse_path(key).and_then(|path| {
            known(&path)?;
            Ok(path)
        });
        match path {
            Ok(path) => {
                self.settings.push(Setting {
                    path,
                    value: value.to_owned(),
                    words,
                });
                Ok(())
            }
            Err(message) => {
                let found = Found::new(&At::Setting(0), message);
                Err(explain(&self.file, &self.text, &[words], vec![found]))
            }
        }
    }

    /// What the scenario describes.
    ///
    /// # Errors
    /// [`ScenarioError`] with everything that is wrong, as far as one error does not hide another.
    pub fn experiment(&self) -> Result<Experiment, ScenarioError> {
        let words: Vec<String> = self.settings.iter().map(|s| s.words.clone()).collect();
        self.build()
            .map_err(|faults| explain(&self.file, &self.text, &words, faults))
    }

    fn build(&self) -> Result<Experiment, Vec<Found>> {
        let mut tree = tree::parse(&self.text).map_err(|found| vec![found])?;
        for (index, setting) in self.settings.iter().enumerate() {
            let value = parse_setting(&setting.value, index);
            lay_over(&mut tree, &setting.path, value).map_err(|found| vec![found])?;
        }
        let mut faults = Vec::new();
        let top = resolve::resolve(&keys::TOP, &tree, &At::Text(0..0), &mut faults);
        if !faults.is_empty() {
            return Err(faults);
        }

        let seed = top.count("seed");
        let one = |found| vec![found];
        let place = scene::place(top.section("scene")).map_err(one)?;
        let mut radar = radar::build(top.section("radar"))?;
        let ways = platform::build(&top, &radar, &place.frame, seed, &self.folder).map_err(one)?;
        check::place_window(&mut radar, &*ways.track, place.reference);
        let scene = scene::build(top.section("scene"), &radar, seed, &self.folder).map_err(one)?;
        let experiment = Experiment {
            name: top.text("name").to_owned(),
            frame: place.frame,
            extent: place.extent,
            radar,
            track: ways.track,
            measured: ways.measured,
            scene,
            reference: place.reference,
            seed,
            method: match top.text("method") {
                "sum" => Method::Sum,
                _ => Method::Fast,
            },
        };
        let faults = check::check(&top, &experiment);
        if !faults.is_empty() {
            return Err(faults);
        }
        debug_assert_eq!(top.not_taken(), Vec::<String>::new(), "keys never read");
        Ok(experiment)
    }
}

/// Refuses a setting's path that leads to no key.
fn known(path: &[Step]) -> Result<(), String> {
    let names: Vec<&str> = path.iter().map(|(name, _)| name.as_str()).collect();
    let (key, sections) = names.split_last().ok_or("a key is wanted")?;
    let wanted = sections.join(".");
    let section = keys::SECTIONS.iter().find(|s| s.path == wanted);
    if section.is_some_and(|section| section.key(key).is_some()) {
        return Ok(());
    }
    let whole = names.join(".");
    let all: Vec<String> = keys::SECTIONS
        .iter()
        .flat_map(|section| section.keys.iter().map(|key| join(section.path, key.name)))
        .collect();
    let meant = nearest::nearest(&whole, all.iter().map(String::as_str))
        .map(|path| format!("; did you mean '{path}'?"))
        .unwrap_or_default();
    Err(format!(
        "there is no key '{whole}'{meant} (the reference of keys lists all)"
    ))
}

fn join(section: &str, key: &str) -> String {
    match section {
        "" => key.to_owned(),
        _ => format!("{section}.{key}"),
    }
}

#[cfg(test)]
mod tests;
