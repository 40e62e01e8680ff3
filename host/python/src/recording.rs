//! Recordings: phase history from files, arrays and simulations.

use std::path::PathBuf;
use std::sync::Arc;

use num_complex::Complex32;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use subaperture::convention::INFERENCE;
use subaperture::io::arrays;
use subaperture::io::cphd::{self, WriteOptions};
use subaperture::io::open::{self as files, Options};
use subaperture::io::track_csv;
use subaperture::phase_history::{Channel, Channels, CoherentSum, PhaseHistory, Pulse};
use subaperture::resolution::survey::{Survey, scene_grid};
use subaperture::targets::on_track;
use subaperture::track::Fix;

use crate::convert::{self, Memory, Table, memory_bytes};
use crate::errors::{Class, Error};
use crate::grid::Grid;
use crate::work;

/// Phase history of one aperture.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Recording {
    pub(crate) history: Arc<dyn PhaseHistory>,
}

/// Channels of one recording.
#[pyclass(frozen, module = "subaperture", name = "Channels")]
pub(crate) struct ChannelList {
    channels: Vec<(Channel, Arc<dyn PhaseHistory>)>,
}

/// One path or several.
#[derive(FromPyObject)]
pub(crate) enum Paths {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

/// Channel by its number from 0 or its name.
#[derive(FromPyObject)]
pub(crate) enum Key {
    Number(isize),
    Name(String),
}

fn settings(settings: Option<Vec<(String, String)>>) -> Vec<(String, String)> {
    settings.unwrap_or_default()
}

/// Open one recording, or several as one aperture.
#[pyfunction]
#[pyo3(signature = (path, *, channel=None, settings=None, memory=None))]
pub(crate) fn open_recording(
    py: Python<'_>,
    path: Paths,
    channel: Option<String>,
    settings: Option<Vec<(String, String)>>,
    memory: Option<Memory>,
) -> Result<Recording, Error> {
    let paths = match path {
        Paths::One(path) => vec![path],
        Paths::Several(paths) => paths,
    };
    let settings = self::settings(settings);
    let memory_bytes = memory_bytes(memory)?;
    let history = work::run(py, None, |_| {
        let options = Options {
            channel: channel.as_deref(),
            memory_bytes,
            settings: &settings,
            inference: Some(INFERENCE),
        };
        Ok(files::open_all(&paths, &options)?)
    })?;
    Ok(Recording {
        history: Arc::new(history),
    })
}

/// Open the channels of a recording, all or those named.
#[pyfunction]
#[pyo3(signature = (path, *, names=None, settings=None, memory=None))]
pub(crate) fn open_channels(
    py: Python<'_>,
    path: PathBuf,
    names: Option<Vec<String>>,
    settings: Option<Vec<(String, String)>>,
    memory: Option<Memory>,
) -> Result<ChannelList, Error> {
    let settings = self::settings(settings);
    let memory_bytes = memory_bytes(memory)?;
    let channels = work::run(py, None, |_| {
        let options = Options {
            channel: None,
            memory_bytes,
            settings: &settings,
            inference: Some(INFERENCE),
        };
        Ok(files::open_channels(&path, names.as_deref(), &options)?)
    })?;
    Ok(ChannelList::of(channels))
}

/// Phase history from arrays, by the names of `subap recording --arrays`.
#[pyfunction]
#[pyo3(signature = (name, arrays, *, check=false, memory=None))]
pub(crate) fn phase_history(
    py: Python<'_>,
    name: String,
    arrays: &Bound<'_, PyDict>,
    check: bool,
    memory: Option<Memory>,
) -> Result<ChannelList, Error> {
    let mut given = Vec::new();
    for (name, value) in arrays {
        if !value.is_none() {
            let name: String = name.extract()?;
            let array = convert::array(&name, &value)?;
            given.push((name, array));
        }
    }
    let memory_bytes = memory_bytes(memory)?;
    // Small images infer an unstated convention, and check a stated one on request only.
    let states = |name: &str| given.iter().any(|(other, _)| other == name);
    let stated = states("sign") && (states("reference_path_m") || states("reference_m"));
    let inference = (check || !stated).then_some(&INFERENCE);
    let channels = work::run(py, None, |_| {
        Ok(self::arrays::from_arrays(
            &name,
            given,
            memory_bytes,
            inference,
        )?)
    })?;
    Ok(ChannelList::of(channels))
}

impl Recording {
    pub(crate) fn new(history: impl PhaseHistory + 'static) -> Self {
        Self {
            history: Arc::new(history),
        }
    }

    fn pulses(&self) -> &[Pulse] {
        &self.history.collection().pulses
    }

    fn each<'py>(&self, py: Python<'py>, of: impl Fn(&Pulse) -> f64) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.pulses().iter().map(of))
    }
}

#[pymethods]
impl Recording {
    /// Name of the recording.
    #[getter]
    fn name(&self) -> &str {
        &self.history.collection().name
    }

    /// Numbers of pulses and of frequency samples.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let collection = self.history.collection();
        (collection.pulses.len(), collection.num_samples)
    }

    /// Frequency of the first sample of each pulse, hertz.
    #[getter]
    fn start_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |pulse| pulse.start_hz)
    }

    /// Frequency step of each pulse, hertz.
    #[getter]
    fn step_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |pulse| pulse.step_hz)
    }

    /// Two-way path that the phase of each pulse is compensated to, metres.
    #[getter]
    fn reference_path_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.each(py, |pulse| pulse.reference_path_m)
    }

    /// Shortest and longest two-way path of the echoes that the samples contain completely, pulses x 2, metres; None
    /// if unknown.
    #[getter]
    fn recorded_path_m<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let paths = self.pulses().iter().map(Pulse::recorded_paths_m);
        let paths: Option<Vec<[f64; 2]>> = paths.collect();
        let values = paths?.into_flattened();
        Some(convert::matrix(py, [values.len() / 2, 2], values))
    }

    /// Time of each pulse, seconds; None if the recording states none.
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let timed = self.history.collection().timed;
        timed.then(|| self.each(py, |pulse| pulse.time_s))
    }

    /// Transmitter positions, pulses x 3, metres in the scene frame.
    #[getter]
    fn transmitter_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        convert::positions(py, self.pulses().iter().map(|pulse| pulse.transmitter_m))
    }

    /// Receiver positions, pulses x 3, metres in the scene frame.
    #[getter]
    fn receiver_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        convert::positions(py, self.pulses().iter().map(|pulse| pulse.receiver_m))
    }

    /// Latitude and longitude (degrees) and height (metres) of the origin; None if unknown.
    #[getter]
    fn origin_deg_m(&self) -> Option<(f64, f64, f64)> {
        let frame = &self.history.collection().frame;
        let origin = frame.geodetic(subaperture::glam::DVec3::ZERO)?;
        Some((origin.latitude_deg, origin.longitude_deg, origin.height_m))
    }

    /// Names of the channels; empty if the recording does not name them.
    #[getter]
    fn channels(&self) -> Vec<String> {
        let channels = self.history.channels();
        channels.into_iter().map(|channel| channel.name).collect()
    }

    /// Warnings about the quality of an image, one sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.history.warnings()
    }

    /// Defects of the recorded pulses and samples, a dictionary each, with the keys of ``subap info --json``.
    #[getter]
    fn defects<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::object(py, &json!(self.history.defects()))
    }

    /// Phase conventions of the files, stated or inferred.
    #[getter]
    fn phase_conventions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::object(py, &json!(self.history.phase_conventions()))
    }

    /// Samples of the pulses from `start` to before `stop`: complex64, pulses x frequencies.
    ///
    /// A unit scatterer at a point has the phase ``-2 pi f (path - reference_path) / c``, whatever the sign in the file.
    #[pyo3(signature = (start=0, stop=None))]
    fn samples<'py>(
        &self,
        py: Python<'py>,
        start: usize,
        stop: Option<usize>,
    ) -> Result<Bound<'py, PyArray2<Complex32>>, Error> {
        let (count, width) = self.shape();
        let stop = stop.unwrap_or(count);
        if !(start <= stop && stop <= count) {
            return Err(Error::argument(format!(
                "samples: expected 0 <= start <= stop <= {count}, found {start} and {stop}"
            )));
        }
        let history = &self.history;
        let samples = work::run(py, None, |_| {
            let mut samples = vec![Complex32::ZERO; (stop - start) * width];
            history.read(start..stop, &mut samples)?;
            Ok(samples)
        })?;
        Ok(convert::matrix(py, [stop - start, width], samples))
    }

    /// Band, aperture, resolution and scene of the recording, in SI units.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::object(py, &json!(Survey::of(self.history.collection())))
    }

    /// Default grid: the extent that the recording declares, or the unambiguous one, at half the resolution.
    fn grid(&self) -> Result<Grid, Error> {
        let grid = scene_grid(&*self.history)?;
        Ok(Grid { grid })
    }

    /// Write the recording as CPHD 1.1. It must be georeferenced.
    #[pyo3(signature = (path, *, progress=None))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        progress: Option<Py<PyAny>>,
    ) -> Result<(), Error> {
        let id = self.channels().into_iter().next();
        let channel = cphd::Channel::new(id.unwrap_or_else(|| "1".to_owned()), &*self.history);
        write_cphd(py, path, &[channel], progress)
    }

    fn __repr__(&self) -> String {
        let (pulses, samples) = self.shape();
        format!(
            "<Recording '{}': {pulses} pulses x {samples} samples>",
            self.name()
        )
    }
}

/// Write channels as CPHD 1.1.
fn write_cphd(
    py: Python<'_>,
    path: PathBuf,
    channels: &[cphd::Channel],
    progress: Option<Py<PyAny>>,
) -> Result<(), Error> {
    work::run(py, progress, |monitor| {
        cphd::write(&path, channels, &WriteOptions::default(), monitor)
            .map_err(|error| Error::new(Class::Write, error))
    })?;
    Ok(())
}

impl ChannelList {
    pub(crate) fn of(channels: Channels<'static>) -> Self {
        let channels = channels.into_inner().into_iter();
        Self {
            channels: channels
                .map(|(about, history)| (about, Arc::from(history)))
                .collect(),
        }
    }

    /// The channels as the library's functions take them; samples are shared.
    pub(crate) fn shared(&self) -> Result<Channels<'static>, Error> {
        let channels = self.channels.iter().map(|(about, history)| {
            let history: Box<dyn PhaseHistory> = Box::new(history.clone());
            (about.clone(), history)
        });
        Ok(Channels::new(channels.collect())?)
    }

    /// Recording of one channel.
    pub(crate) fn recording(&self, index: usize) -> Recording {
        Recording {
            history: self.channels[index].1.clone(),
        }
    }
}

#[pymethods]
impl ChannelList {
    /// Names of the channels.
    #[getter]
    fn names(&self) -> Vec<&str> {
        let names = self.channels.iter().map(|(about, _)| about.name.as_str());
        names.collect()
    }

    /// Recording whose image is the coherent sum of the images of all channels.
    fn coherent_sum(&self) -> Result<Recording, Error> {
        Ok(Recording::new(CoherentSum::new(self.shared()?)?))
    }

    /// Channels on the track of a file of ``subap track``, or of an array of n x 4 (time_s, x_m, y_m, z_m); pulses outside of its time are
    /// left out. Positions are those of the middle of the antennas, attitudes that of the file, else the direction of flight. Samples are shared.
    fn on_track(&self, track: Table<'_>) -> Result<Self, Error> {
        let fixes = match &track {
            Table::File(path) => track_csv::read(path)?,
            Table::Numbers(numbers) => {
                let (times_s, positions_m) = convert::timed_positions("track", numbers)?;
                let fix = |(time_s, position_m)| Fix {
                    time_s,
                    position_m,
                    attitude: None,
                };
                times_s.into_iter().zip(positions_m).map(fix).collect()
            }
        };
        Ok(Self::of(on_track(self.shared()?, &fixes)?))
    }

    /// Write all channels as one CPHD 1.1. They must be georeferenced.
    #[pyo3(signature = (path, *, progress=None))]
    fn save(
        &self,
        py: Python<'_>,
        path: PathBuf,
        progress: Option<Py<PyAny>>,
    ) -> Result<(), Error> {
        let channels = self.channels.iter();
        let channels: Vec<cphd::Channel> = channels
            .map(|(about, history)| cphd::Channel::new(about.name.clone(), &**history))
            .collect();
        write_cphd(py, path, &channels, progress)
    }

    fn __len__(&self) -> usize {
        self.channels.len()
    }

    fn __getitem__(&self, key: Key) -> Result<Recording, Error> {
        let count = self.channels.len();
        let index = match &key {
            Key::Name(name) => (self.channels.iter()).position(|(about, _)| about.name == *name),
            Key::Number(number) => {
                let from_end = count as isize + number;
                let number = if *number < 0 { from_end } else { *number };
                usize::try_from(number).ok().filter(|index| *index < count)
            }
        };
        let Some(index) = index else {
            // Iteration over a sequence ends by this exception.
            let message = format!(
                "expected one of {}, or a number below {count}",
                self.names().join(", ")
            );
            return Err(pyo3::exceptions::PyIndexError::new_err(message).into());
        };
        Ok(self.recording(index))
    }

    fn __repr__(&self) -> String {
        format!("<Channels: {}>", self.names().join(", "))
    }
}
