//! Simulated recordings and their scenes.

use std::path::PathBuf;

use num_complex::Complex64;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use subaperture::glam::DVec3;
use subaperture::phase_history::{Channel, Channels, InMemory, PhaseHistory};
use subaperture::simulate::scenario::{Scenario, examples};
use subaperture::simulate::scene as library;
use subaperture::simulate::{Experiment, Preset, Variation};
use subaperture::track::Trajectory;

use crate::convert::{self, Memory, memory_bytes};
use crate::errors::{Class, Error};
use crate::recording::ChannelList;
use crate::work;

const PRESETS: [Preset; 2] = [Preset::Table21, Preset::Table41];

/// Half of the interval of a velocity by central differences, seconds.
const HALF_STEP_S: f64 = 5e-4;

/// Preset or example by its name, scenario by its text, or file of one, with values that override its own.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Source {
    #[pyo3(default)]
    name: Option<String>,
    #[pyo3(default)]
    scenario: Option<String>,
    #[pyo3(default)]
    path: Option<PathBuf>,
    settings: Option<Vec<(String, String)>>,
    #[pyo3(default)]
    seed: Option<u64>,
    #[pyo3(default)]
    memory: Option<Memory>,
}

/// Preset or scenario that is simulated.
enum Simulated {
    Preset(Preset),
    Experiment(Box<Experiment>),
}

impl Source {
    fn resolve(self, limit_bytes: u64) -> Result<Simulated, Error> {
        let mut scenario = match (self.name, self.scenario, self.path) {
            (Some(name), None, None) => {
                let preset = PRESETS.into_iter().find(|preset| preset.name() == name);
                match (preset, &self.settings) {
                    (Some(preset), None) => return Ok(Simulated::Preset(preset)),
                    (Some(_), Some(_)) => {
                        return Err(Error::argument(format!(
                            "settings: expected a scenario, found the preset {name}"
                        )));
                    }
                    (None, _) => example(&name)?,
                }
            }
            (None, Some(text), None) => Scenario::new("scenario", text, "."),
            (None, None, Some(path)) => Scenario::read_within(&path, limit_bytes)
                .map_err(|error| Error::new(Class::Read, format!("{}: {error}", path.display())))?,
            _ => {
                return Err(Error::argument(
                    "simulate: expected a name, a scenario or a path",
                ));
            }
        };
        for (key, value) in self.settings.unwrap_or_default() {
            scenario.set(&key, &value)?;
        }
        if let Some(seed) = self.seed {
            scenario.set("seed", &seed.to_string())?;
        }
        let experiment = scenario.experiment_within(limit_bytes)?;
        Ok(Simulated::Experiment(Box::new(experiment)))
    }
}

/// Simulate a preset or a scenario.
#[pyfunction]
#[pyo3(signature = (source, *, progress=None))]
pub(crate) fn simulate(
    py: Python<'_>,
    source: Source,
    progress: Option<Py<PyAny>>,
) -> Result<ChannelList, Error> {
    let limit_bytes = memory_bytes(source.memory.clone())?;
    let seed = source.seed;
    let channels = work::run(py, progress, |_| match source.resolve(limit_bytes)? {
        Simulated::Preset(preset) => of_preset(preset, seed),
        Simulated::Experiment(experiment) => {
            let channels = experiment.channels(limit_bytes / 2);
            Ok(channels.map_err(Error::argument)?.in_memory()?)
        }
    })?;
    Ok(ChannelList::of(channels))
}

/// Scene of a simulation: the positions and amplitudes that its echoes are computed from.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Scene {
    scene: library::Scene,
}

/// Scene of a preset or a scenario.
#[pyfunction]
pub(crate) fn scene(py: Python<'_>, source: Source) -> Result<Scene, Error> {
    let limit_bytes = memory_bytes(source.memory.clone())?;
    let scene = work::run(py, None, |_| {
        Ok(match source.resolve(limit_bytes)? {
            Simulated::Preset(preset) => library::Scene {
                points: preset.simulate(&Variation::default()).scatterers().to_vec(),
                ..library::Scene::default()
            },
            Simulated::Experiment(experiment) => experiment.scene,
        })
    })?;
    Ok(Scene { scene })
}

impl Scene {
    /// Values of each mover at each time: movers x times x 3.
    fn over_time<'py>(
        &self,
        py: Python<'py>,
        time_s: &Bound<'py, PyAny>,
        value: impl Fn(&dyn Trajectory, f64) -> DVec3,
    ) -> Result<Bound<'py, PyArray3<f64>>, Error> {
        let (_, times_s) = convert::numbers("time_s", time_s)?;
        if let Some(time_s) = times_s.iter().find(|time_s| !time_s.is_finite()) {
            return Err(Error::argument(format!(
                "time_s: expected finite seconds, found {time_s}"
            )));
        }
        let movers = self.scene.movers.iter();
        let values: Vec<f64> = movers
            .flat_map(|mover| times_s.iter().map(|&time_s| value(&*mover.motion, time_s)))
            .flat_map(|value| value.to_array())
            .collect();
        let values = PyArray1::from_vec(py, values);
        Ok(values.reshape([self.scene.movers.len(), times_s.len(), 3])?)
    }
}

#[pymethods]
impl Scene {
    /// Positions of the static points, points x 3, metres in the scene frame: point targets, clutter, pictures and walls.
    #[getter]
    fn point_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        convert::positions(py, self.scene.points.iter().map(|point| point.position_m))
    }

    /// Complex amplitudes of the static points; 1 is a radar cross section of 1 square metre.
    #[getter]
    fn point_amplitude<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<Complex64>> {
        PyArray1::from_iter(py, self.scene.points.iter().map(|point| point.amplitude))
    }

    /// Positions of the apexes of the corner reflectors, corners x 3, metres.
    #[getter]
    fn corner_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let corners = self.scene.corners.iter();
        convert::positions(py, corners.map(|corner| corner.position_m))
    }

    /// Complex amplitudes of the moving targets; 1 is a radar cross section of 1 square metre.
    #[getter]
    fn mover_amplitude<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<Complex64>> {
        PyArray1::from_iter(py, self.scene.movers.iter().map(|mover| mover.amplitude))
    }

    /// Positions of the moving targets at times in seconds, such as ``recording.time_s``: movers x times x 3, metres.
    fn mover_m<'py>(&self, time_s: &Bound<'py, PyAny>) -> Result<Bound<'py, PyArray3<f64>>, Error> {
        self.over_time(time_s.py(), time_s, |motion, time_s| {
            motion.pose(time_s).position_m
        })
    }

    /// Velocities of the moving targets at times in seconds, the mean over 1 ms: movers x times x 3, metres per second.
    fn mover_velocity_m_s<'py>(
        &self,
        time_s: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArray3<f64>>, Error> {
        self.over_time(time_s.py(), time_s, |motion, time_s| {
            let [before, after] =
                [-HALF_STEP_S, HALF_STEP_S].map(|step_s| motion.pose(time_s + step_s).position_m);
            (after - before) / (2.0 * HALF_STEP_S)
        })
    }

    fn __repr__(&self) -> String {
        let scene = &self.scene;
        format!(
            "<Scene: {} points, {} corners, {} movers>",
            scene.points.len(),
            scene.corners.len(),
            scene.movers.len()
        )
    }
}

/// Example scenario of a name.
fn example(name: &str) -> Result<Scenario, Error> {
    match examples::text(name) {
        Some(text) => Ok(Scenario::new(name, text, ".")),
        None => Err(Error::argument(format!(
            "scenario: expected one of {}, {}, found '{name}'",
            PRESETS.map(Preset::name).join(", "),
            examples::names().join(", ")
        ))),
    }
}

fn of_preset(preset: Preset, seed: Option<u64>) -> Result<Channels<'static>, Error> {
    let variation = Variation {
        seed: seed.unwrap_or_default(),
        ..Variation::default()
    };
    let history: Box<dyn PhaseHistory> = Box::new(InMemory::copy_of(&preset.simulate(&variation))?);
    Ok(Channels::new(vec![(Channel::new("1"), history)])?)
}
