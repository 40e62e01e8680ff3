//! Scenarios: TOML descriptions of a simulation, converted into an [`Experiment`].
//!
//! Quantities carry units (`pri = "1 ms"`), and the text is checked against a schema, which [`reference()`]
//! prints. Errors give file, line and column, show the line, and say what to do; several faults are reported at once.
//!
//! ```text
//! text ─> tree (values and positions; settings applied) ─> resolve (names, types, units, bounds,
//!         defaults) ─> radar, receiver, platform, scene ─> check (consistency)
//! ```
//!
//! A setting ([`Scenario::set`]) overrides one key of the text, such as `radar.pri` or `scene.point[0].position`. Its
//! errors name the key instead of a line.
//!
//! # Example
//! ```
//! use subaperture_simulate::scenario::Scenario;
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
//! assert!(error.contains("expected a time, found a length"), "{error}");
//! # Ok::<(), subaperture_simulate::scenario::ScenarioError>(())
//! ```

mod around;
mod check;
pub mod examples;
mod keys;
mod logs;
mod objects;
mod platform;
mod scene;
mod scene_keys;
mod terrain;

use std::io;
use std::path::{Path, PathBuf};

use super::engine::Method;
use super::experiment::Experiment;
use around::Around;
use error::{ALLOW_MORE_MEMORY, Fault};
use keys::{ScenarioKeys, Summation};
use subaperture_describe::{Description, error};
use subaperture_io::pattern_csv;

pub use keys::reference;
pub use subaperture_describe::{DescriptionError as ScenarioError, RenderedFault};

/// Memory per pulse from simulation to file, bytes: geometry as echo and as phase history, true antenna positions, the
/// engine's view, the CPHD record.
const BYTES_A_PULSE: u64 = 1024;

/// TOML description of a simulation, with settings that override it.
#[derive(Clone, Debug)]
pub struct Scenario(Description);

impl Scenario {
    /// Make a scenario of a text. `file` is its name in errors; relative paths start at `folder`.
    pub fn new(
        file: impl Into<String>,
        text: impl Into<String>,
        folder: impl Into<PathBuf>,
    ) -> Self {
        Self(Description::new(file, text, folder))
    }

    /// Read a scenario file. Its text may take [`DEFAULT_MEMORY_BYTES`](subaperture_describe::DEFAULT_MEMORY_BYTES) when it is parsed.
    ///
    /// # Errors
    /// As [`Description::read_within`].
    pub fn read(path: &Path) -> io::Result<Self> {
        Description::read(path).map(Self)
    }

    /// Read a scenario file whose text takes at most `memory_bytes` when it is parsed.
    ///
    /// # Errors
    /// As [`Description::read_within`].
    pub fn read_within(path: &Path, memory_bytes: u64) -> io::Result<Self> {
        Description::read_within(path, memory_bytes).map(Self)
    }

    /// Override the key at a dotted path, such as `radar.pri` or `scene.point[0].position`. The value is written as in
    /// TOML; quotes of a string may be omitted. Later settings override earlier ones.
    ///
    /// # Errors
    /// For an unknown key. Values are checked by [`Self::experiment`].
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), ScenarioError> {
        self.0.set(&keys::SCHEMA, "--set", key, value)
    }

    /// Build the experiment of the scenario.
    ///
    /// # Errors
    /// [`ScenarioError`] with all faults, as far as one does not hide another.
    pub fn experiment(&self) -> Result<Experiment, ScenarioError> {
        self.experiment_within(u64::MAX)
    }

    /// Build the experiment if its scene and pulses fit into `memory_bytes`; checked before they are made.
    ///
    /// # Errors
    /// Those of [`Self::experiment`], and for too little memory.
    pub fn experiment_within(&self, memory_bytes: u64) -> Result<Experiment, ScenarioError> {
        let built = self.build(memory_bytes);
        built.map_err(|faults| self.0.explain(faults))
    }

    fn build(&self, memory_bytes: u64) -> Result<Experiment, Vec<Fault>> {
        if let Some(at) = self.0.has_section("recording") {
            return Err(vec![Fault::new(
                &at,
                "this file describes an existing raw recording, not a simulation: give it to subap \
                 info or subap focus (a scenario has no [recording])",
            )]);
        }
        let top: ScenarioKeys = self.0.resolve_as(&keys::SCHEMA)?;
        let folder = self.0.folder();
        let seed = top.seed;
        let one = |found| vec![found];
        let place = scene::place(&top.scene).map_err(one)?;
        let mut radar = top.radar.build(&pattern_csv::tables_in(folder))?;
        let pulses_bytes = BYTES_A_PULSE
            .saturating_mul(radar.num_pulses as u64)
            .saturating_mul(radar.receivers.len() as u64);
        if pulses_bytes > memory_bytes {
            let what = format!(
                "{} pulses need {pulses_bytes} bytes, but {memory_bytes} are available: simulate fewer \
                 pulses, or {ALLOW_MORE_MEMORY}",
                radar.num_pulses
            );
            return Err(vec![top.radar.pulses.fault(what)]);
        }
        let tracks = platform::build(&top, &radar, &place.frame, seed, folder).map_err(one)?;
        check::place_window(&mut radar, &*tracks.track, place.reference);
        let around = Around {
            radar: &radar,
            track: &*tracks.track,
            frame: &place.frame,
            seed,
            folder,
        };
        let scene = scene::build(&top.scene, &around, memory_bytes - pulses_bytes).map_err(one)?;
        let logs = logs::build(&top, &radar).map_err(one)?;
        let experiment = Experiment {
            name: top.name.clone(),
            frame: place.frame,
            extent: place.extent,
            radar,
            track: tracks.track,
            measured: tracks.measured,
            scene,
            reference: place.reference,
            seed,
            method: match top.method {
                Summation::Sum => Method::Sum,
                Summation::Fast => Method::Fast,
            },
            collection_start: top.collection_start.as_ref().map(|text| text.to_string()),
            logs,
        };
        let faults = check::check(&top, &experiment);
        if !faults.is_empty() {
            return Err(faults);
        }
        Ok(experiment)
    }
}

#[cfg(test)]
mod tests;
