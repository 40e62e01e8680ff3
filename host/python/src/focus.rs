//! Image formation and its plans.

use std::path::PathBuf;
use std::str::FromStr;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use subaperture::Focusing;
use subaperture::autofocus::Correction;
use subaperture::corrections::{CorrectedRecording, Corrections};
use subaperture::focus::beam::{AntennaWeights, BeamChoice, choose, limited};
use subaperture::focus::formers::{self, DEFAULT, FORMERS};
use subaperture::focus::{
    BoundPolicy, ImageFormer, ImageSpec, Numerics, Plan as ImagePlan, SCRATCH_BYTES, Work,
};
use subaperture::geometry::ImageGrid;
use subaperture::glam::DVec3;
use subaperture::io::{phase_csv, target_csv};
use subaperture::monitor::Silent;
use subaperture::resolution::survey::scene_grid;
use subaperture::signal::window::Window;
use subaperture::terrain::{Geoid, PixelSurface};
use subaperture::track::Displacement;

use crate::convert::{self, Memory, Table, memory_bytes};
use crate::errors::Error;
use crate::grid::{Grid, GridLike};
use crate::image::Image;
use crate::recording::Recording;
use crate::work;

/// Beam: its width in degrees, `auto` or `none`.
#[derive(FromPyObject)]
pub(crate) enum BeamLike {
    Degrees(f64),
    Word(String),
}

/// Former with its settings: options by name, as on the command line.
pub(crate) fn former(
    name: &str,
    options: Option<&Bound<'_, PyDict>>,
) -> Result<Box<dyn ImageFormer>, Error> {
    let given = convert::given(options)?;
    let Some(entry) = FORMERS.iter().find(|entry| entry.name == name) else {
        return Ok(formers::former(name, &json!({}))?);
    };
    let settings = entry.settings(&given)?;
    Ok(formers::former(name, &settings)?)
}

/// Beam or processed Doppler band, from their arguments by name.
fn beam(request: &Request) -> Result<BeamChoice, Error> {
    let squint_rad = request.squint_deg.map(f64::to_radians);
    let beam = request.beam.as_ref();
    let choice = match (beam, request.doppler_band_hz) {
        (None, Some(width_hz)) => BeamChoice::DopplerBand {
            width_hz,
            centroid_hz: request.doppler_centroid_hz,
        },
        (Some(_), Some(_)) => {
            let fault = "doppler_band_hz: expected without beam: it replaces the whole beam";
            return Err(Error::argument(fault));
        }
        (_, None) if request.doppler_centroid_hz.is_some() => {
            let fault = "doppler_centroid_hz: expected with doppler_band_hz only";
            return Err(Error::argument(fault));
        }
        (beam, None) => beam_within(beam, squint_rad)?,
    };
    match (choice, squint_rad) {
        (BeamChoice::Given { .. } | BeamChoice::Estimated { .. }, _) | (_, None) => Ok(choice),
        (_, Some(_)) => Err(Error::argument("squint_deg: expected with beam only")),
    }
}

fn antenna_weights(request: &Request) -> Result<AntennaWeights, Error> {
    match request.antenna_weights.as_deref() {
        None | Some("none") => Ok(AntennaWeights::None),
        Some("matched") => Ok(AntennaWeights::Matched),
        Some(other) => Err(Error::argument(format!(
            "antenna_weights: expected 'none' or 'matched', found '{other}'"
        ))),
    }
}

fn beam_within(beam: Option<&BeamLike>, squint_rad: Option<f64>) -> Result<BeamChoice, Error> {
    Ok(match beam {
        None => BeamChoice::Stated,
        Some(&BeamLike::Degrees(width)) if width > 0.0 && width.is_finite() => BeamChoice::Given {
            width_rad: width.to_radians(),
            squint_rad: squint_rad.unwrap_or(0.0),
        },
        Some(BeamLike::Word(word)) if word == "auto" => BeamChoice::Estimated {
            near_rad: squint_rad,
        },
        Some(BeamLike::Word(word)) if word == "none" => BeamChoice::None,
        Some(_) => {
            return Err(Error::argument(
                "beam: expected a width above 0 in degrees, 'auto' or 'none'",
            ));
        }
    })
}

/// Arguments of an image by name, as in Python. Only `recording` is required.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Request<'py> {
    pub(crate) recording: PyRef<'py, Recording>,
    #[pyo3(default)]
    grid: Option<GridLike<'py>>,
    #[pyo3(default)]
    surface: Option<String>,
    #[pyo3(default)]
    geoid: Option<GeoidLike>,
    #[pyo3(default)]
    troposphere: Option<String>,
    #[pyo3(default)]
    velocity_m_s: Option<Vec<f64>>,
    #[pyo3(default)]
    motion: Option<Table<'py>>,
    #[pyo3(default)]
    phase_rad: Option<Table<'py>>,
    #[pyo3(default)]
    former: Option<String>,
    #[pyo3(default)]
    options: Option<Bound<'py, PyDict>>,
    #[pyo3(default)]
    window: Option<String>,
    #[pyo3(default)]
    slow_window: Option<String>,
    #[pyo3(default)]
    beam: Option<BeamLike>,
    #[pyo3(default)]
    squint_deg: Option<f64>,
    #[pyo3(default)]
    doppler_band_hz: Option<f64>,
    #[pyo3(default)]
    doppler_centroid_hz: Option<f64>,
    #[pyo3(default)]
    antenna_weights: Option<String>,
    #[pyo3(default)]
    memory: Option<Memory>,
    #[pyo3(default)]
    scratch: Option<Memory>,
    #[pyo3(default)]
    portable: bool,
    #[pyo3(default)]
    allow_error: bool,
    #[pyo3(default)]
    progress: Option<Py<PyAny>>,
}

/// Undulation in metres, or the path of a geoid file.
#[derive(FromPyObject)]
enum GeoidLike {
    Metres(f64),
    Path(PathBuf),
}

/// Image that is requested: a corrected recording, a grid on its surface, and settings.
pub(crate) struct Requested {
    pub(crate) recorded: CorrectedRecording<'static>,
    pub(crate) grid: ImageGrid,
    pub(crate) former: Box<dyn ImageFormer>,
    pub(crate) windows: [Window; 2],
    pub(crate) memory_bytes: u64,
    beam: BeamChoice,
    antenna_weights: AntennaWeights,
}

impl Request<'_> {
    /// Correct the recording and place the grid on its surface. Warnings of the surface are Python's.
    pub(crate) fn prepare(&self, py: Python<'_>) -> Result<Requested, Error> {
        let name = self.former.as_deref().unwrap_or(DEFAULT.name);
        let former = former(name, self.options.as_ref())?;
        let beam = beam(self)?;
        let antenna_weights = antenna_weights(self)?;
        let windows = [&self.window, &self.slow_window].map(Option::as_deref);
        let windows = convert::windows(windows[0], windows[1])?;
        let memory_bytes = memory_bytes(self.memory.clone())?;
        let corrections = self.corrections()?;
        let surface: PixelSurface = named("surface", self.surface.as_deref())?.unwrap_or_default();
        let geoid = match &self.geoid {
            None => Geoid::None,
            Some(GeoidLike::Metres(metres)) => Geoid::Undulation(*metres),
            Some(GeoidLike::Path(path)) => Geoid::parse(path.clone())
                .map_err(|error| Error::argument(format!("geoid: {error}")))?,
        };
        let given = self.grid.as_ref().map(GridLike::grid).transpose()?;
        let history = self.recording.history.clone();
        let (recorded, placed) = work::run(py, None, |monitor| {
            let recorded = corrections.apply(history)?;
            let plane = match given {
                Some(grid) => (grid, false),
                None => (scene_grid(recorded.at_rest())?, true),
            };
            let collection = recorded.history().collection();
            let placed = surface.place(plane, &geoid, collection, memory_bytes, monitor)?;
            Ok((recorded, placed))
        })?;
        for warning in &placed.warnings {
            crate::errors::warn(py, warning)?;
        }
        Ok(Requested {
            recorded,
            grid: placed.grid,
            former,
            windows,
            memory_bytes,
            beam,
            antenna_weights,
        })
    }

    fn corrections(&self) -> Result<Corrections, Error> {
        let velocity = match self.velocity_m_s.as_deref() {
            None => None,
            Some(&[x, y]) => Some(DVec3::new(x, y, 0.0)),
            Some(&[x, y, z]) => Some(DVec3::new(x, y, z)),
            Some(other) => {
                return Err(Error::argument(format!(
                    "velocity_m_s: expected two or three numbers, found {}",
                    other.len()
                )));
            }
        };
        if velocity.is_some() && self.motion.is_some() {
            return Err(Error::argument(
                "expected velocity_m_s or motion, found both",
            ));
        }
        let sampled = match &self.motion {
            None => None,
            Some(Table::File(path)) => Some(target_csv::read(path)?),
            Some(Table::Numbers(numbers)) => {
                let (times_s, positions_m) = convert::timed_positions("motion", numbers)?;
                let displacement = Displacement::sampled(times_s, &positions_m);
                let named = |error| Error::argument(format!("motion: {error}"));
                Some(displacement.map_err(named)?)
            }
        };
        let error_rad = match &self.phase_rad {
            None => None,
            Some(Table::File(path)) => Some(phase_csv::read(path)?),
            Some(Table::Numbers(numbers)) => Some(convert::numbers("phase_rad", numbers)?.1),
        };
        Ok(Corrections {
            troposphere: match self.troposphere.as_deref() {
                Some("none") => None,
                text => named("troposphere", text)?,
            },
            errors: error_rad.map(|error_rad| Correction::Phase { error_rad }),
            target: sampled.or(velocity.map(Displacement::Velocity)),
        })
    }

    /// Callable that receives the finished fraction.
    pub(crate) fn progress(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.progress
            .as_ref()
            .map(|progress| progress.clone_ref(py))
    }
}

/// Value of a text; the error names the argument.
fn named<T: FromStr<Err = String>>(name: &str, text: Option<&str>) -> Result<Option<T>, Error> {
    let value = text.map(str::parse).transpose();
    value.map_err(|error| Error::argument(format!("{name}: {error}")))
}

/// Form an image within an error bound.
#[pyfunction]
pub(crate) fn focus(py: Python<'_>, request: Request<'_>) -> Result<Image, Error> {
    let requested = request.prepare(py)?;
    let (portable, allow_error) = (request.portable, request.allow_error);
    let image = work::run(py, request.progress(py), |monitor| {
        let [fast, slow] = requested.windows;
        let mut focusing = Focusing::new(requested.recorded.history(), &requested.grid)
            .windows(fast, slow)
            .beam(requested.beam)
            .antenna_weights(requested.antenna_weights)
            .memory_bytes(requested.memory_bytes)
            .monitor(monitor);
        if portable {
            focusing = focusing.portable();
        }
        if allow_error {
            focusing = focusing.allow_error();
        }
        Ok(focusing.by(&*requested.former)?)
    })?;
    Ok(Image::formed(image))
}

/// Names and descriptions of all formers and their options.
#[pyfunction]
pub(crate) fn formers_table(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let option = |option: &formers::FormerOption| {
        json!({
            "name": option.name,
            "summary": option.summary,
            "default": option.default,
        })
    };
    let entry = |entry: &formers::Entry| {
        json!({
            "name": entry.name,
            "summary": entry.summary,
            "options": entry.options.iter().map(option).collect::<Vec<_>>(),
        })
    };
    let table: Vec<_> = FORMERS.iter().map(entry).collect();
    convert::object(py, &json!(table))
}

/// Plan of an image in tiles.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Plan {
    plan: ImagePlan,
}

/// Plan an image in tiles.
#[pyfunction]
pub(crate) fn plan(py: Python<'_>, request: Request<'_>) -> Result<Plan, Error> {
    let requested = request.prepare(py)?;
    let scratch_bytes = match &request.scratch {
        None => SCRATCH_BYTES,
        scratch => memory_bytes(scratch.clone())?,
    };
    let policy = match request.allow_error {
        true => BoundPolicy::Allowed,
        false => BoundPolicy::Refused,
    };
    let numerics = match request.portable {
        true => Numerics::default().portable(),
        false => Numerics::default(),
    };
    let plan = work::run(py, request.progress(py), |monitor| {
        let Requested {
            recorded,
            grid,
            former,
            windows: [fast, slow],
            beam,
            antenna_weights,
            ..
        } = requested;
        let history = recorded.history();
        let patterns = antenna_weights.patterns(history)?;
        let chosen = choose(antenna_weights.beam(beam), history, &grid, monitor)
            .map_err(|error| Error::new(crate::errors::Class::Unsuited, error))?;
        let former = limited(former, patterns, chosen.beam)?;
        let collection = history.collection();
        let spec = ImageSpec {
            collection,
            grid: &grid,
            weights: &former.weights(collection, &grid, fast, slow)?,
            scratch_bytes,
            numerics,
        };
        Ok(ImagePlan::for_recording(
            &*former, &spec, policy, history, monitor,
        )?)
    })?;
    Ok(Plan { plan })
}

#[pymethods]
impl Plan {
    /// Plan of a text.
    #[new]
    fn new(text: &str) -> Result<Self, Error> {
        Ok(Self {
            plan: ImagePlan::from_text(text)?,
        })
    }

    /// Text of the plan: everything except the samples. Plans of equal arguments are equal.
    #[getter]
    fn text(&self) -> String {
        self.plan.to_text()
    }

    /// Name of the image former.
    #[getter]
    fn former(&self) -> &str {
        &self.plan.former
    }

    /// Grid of the image.
    #[getter]
    fn grid(&self) -> Grid {
        Grid {
            grid: self.plan.grid.clone(),
        }
    }

    /// Number of tiles of the image.
    #[getter]
    fn num_tiles(&self) -> usize {
        self.plan.num_tiles()
    }

    /// Rows and columns of a tile; tiles at the edges are smaller.
    #[getter]
    fn tile_shape(&self) -> (usize, usize) {
        (self.plan.tile.rows, self.plan.tile.columns)
    }

    /// Planned relative RMS error against the exact sum, dB.
    #[getter]
    fn planned_error_db(&self) -> f64 {
        self.plan.planned_db
    }

    /// Memory of one tile with its scratch, bytes.
    #[getter]
    fn tile_bytes(&self) -> u64 {
        self.plan.tile_bytes
    }

    /// Predicted time of the image on one core, seconds.
    #[getter]
    fn core_s(&self) -> f64 {
        self.plan.cost.core_s()
    }

    /// Number of pulses that are read to form each of `tiles` on its own; a pulse that is read twice counts twice.
    #[pyo3(signature = (recording, tiles, *, memory=None))]
    fn pulses_read(
        &self,
        py: Python<'_>,
        recording: &Recording,
        tiles: Vec<usize>,
        memory: Option<Memory>,
    ) -> Result<Vec<u64>, Error> {
        let count = self.plan.num_tiles();
        if let Some(tile) = tiles.iter().find(|tile| **tile >= count) {
            return Err(Error::argument(format!(
                "tiles: expected numbers below {count}, found {tile}"
            )));
        }
        let memory_bytes = memory_bytes(memory)?;
        let history = &*recording.history;
        work::run(py, None, |_| {
            let collection = history.collection();
            let weights = self.plan.weights(collection)?;
            let opened = self.plan.open(collection, &weights)?;
            let work = Work {
                history,
                memory_bytes,
                monitor: &Silent,
            };
            let each = tiles
                .iter()
                .map(|tile| opened.pulses_read(&work, &[*tile], 1));
            Ok(each.collect::<Result<_, _>>()?)
        })
    }

    fn __repr__(&self) -> String {
        let (rows, columns) = self.tile_shape();
        format!(
            "<Plan by {}: {} tiles of {rows} x {columns} pixels, {:.1} dB>",
            self.plan.former,
            self.num_tiles(),
            self.plan.planned_db
        )
    }
}
