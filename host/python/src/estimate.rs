//! Estimates from recordings: autofocus, track, moving targets.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use serde_json::{Value, json};
use subaperture::autofocus::{
    Corrected, Correction, MapDrift, Measure, Method, ModifiedPhaseGradient, PhaseGradient,
    Sharpened, Sharpness, Stopping, Subject, sharpen,
};
use subaperture::focus::Numerics;
use subaperture::gmti::tracker::Plane;
use subaperture::gmti::{Imaging, detection, find, geojson, space_time};
use subaperture::phase_history::PhaseHistory;
use subaperture::targets::{Settings, on_track, recover};
use subaperture::track::Fix;

use crate::convert;
use crate::errors::Error;
use crate::focus::Request;
use crate::grid::Grid;
use crate::recording::{ChannelList, Recording};
use crate::work;

/// Correction found by autofocus, with its figures.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Autofocus {
    history: Arc<dyn PhaseHistory>,
    found: Sharpened,
    method: &'static str,
}

/// Estimate phase errors or the track by image sharpness, judged on held-out data.
#[pyfunction]
#[pyo3(signature = (request, *, method, rounds=None, keep_unjudged=false))]
pub(crate) fn autofocus(
    py: Python<'_>,
    request: Request<'_>,
    method: &str,
    rounds: Option<usize>,
    keep_unjudged: bool,
) -> Result<Autofocus, Error> {
    let methods: [Box<dyn Method>; 4] = [
        Box::new(PhaseGradient::default()),
        Box::new(ModifiedPhaseGradient::default()),
        Box::new(Sharpness::default()),
        Box::new(MapDrift::default()),
    ];
    let names: Vec<&str> = methods.iter().map(|method| method.name()).collect();
    let Some(method) = methods.iter().find(|each| each.name() == method) else {
        return Err(Error::argument(format!(
            "method: expected one of {}, found '{method}'",
            names.join(", ")
        )));
    };
    let arguments = request.prepare(py)?;
    let history = request.recording.history.clone();
    let default = Stopping::default();
    let stopping = Stopping {
        rounds: rounds.unwrap_or(default.rounds),
        keep_unjudged,
        ..default
    };
    let found = work::run(py, request.progress(py), |monitor| {
        let subject = Subject {
            history: &*history,
            grid: &arguments.grid,
            former: &*arguments.former,
            windows: arguments.windows,
            measure: Measure::default(),
            memory_bytes: arguments.memory_bytes,
            monitor,
        };
        Ok(sharpen(&subject, &**method, stopping)?)
    })?;
    Ok(Autofocus {
        history,
        found,
        method: method.name(),
    })
}

#[pymethods]
impl Autofocus {
    /// Whether a correction passed the tests on held-out data.
    #[getter]
    fn kept(&self) -> bool {
        self.found.correction.is_some()
    }

    /// Phase error of each pulse, radians; None without a correction of phases.
    #[getter]
    fn phase_rad<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        match &self.found.correction {
            Some(Correction::Phase { error_rad }) => Some(PyArray1::from_slice(py, error_rad)),
            _ => None,
        }
    }

    /// Displacement of the antennas at each pulse, pulses x 3, metres; None without a correction of the track.
    #[getter]
    fn displacement_m<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        match &self.found.correction {
            Some(Correction::Track { displacement_m }) => {
                Some(convert::positions(py, displacement_m.iter().copied()))
            }
            _ => None,
        }
    }

    /// Method, outcome, and sharpness before and after, also on held-out data.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let found = &self.found;
        let correction = found.correction.as_ref();
        convert::object(
            py,
            &json!({
                "method": self.method,
                "outcome": found.outcome,
                "rms_phase_rad": correction.and_then(Correction::rms_phase_rad),
                "rms_displacement_m": correction.and_then(Correction::rms_displacement_m),
                "before": found.before,
                "after": found.after,
                "held_out": found.held_out,
                "rounds": found.rounds,
            }),
        )
    }

    /// Recording with the correction applied; the recording as opened without a correction. Samples are shared.
    fn corrected(&self) -> Result<Recording, Error> {
        let history = self.history.clone();
        Ok(match &self.found.correction {
            None => Recording { history },
            Some(found) => Recording::new(Corrected::new(history, found).map_err(Error::argument)?),
        })
    }

    fn __repr__(&self) -> String {
        let kept = if self.kept() { "kept" } else { "no correction" };
        format!("<Autofocus by {}: {kept}>", self.method)
    }
}

/// Track estimated from echoes of several receivers.
#[pyclass(frozen, module = "subaperture")]
pub(crate) struct Track {
    found: subaperture::targets::Recovered,
}

/// Estimate the radar's track from its own echoes (MPGA).
#[pyfunction]
#[pyo3(signature = (channels, *, range_m=None, targets=None, min_snr_db=None, progress=None))]
pub(crate) fn track(
    py: Python<'_>,
    channels: &ChannelList,
    range_m: Option<(f64, f64)>,
    targets: Option<usize>,
    min_snr_db: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> Result<Track, Error> {
    let shared = channels.shared()?;
    let default = Settings::default();
    let settings = Settings {
        ranges_m: range_m.or(default.ranges_m),
        most_targets: targets.unwrap_or(default.most_targets),
        least_snr_db: min_snr_db.unwrap_or(default.least_snr_db),
        ..default
    };
    let found = work::run(py, progress, |monitor| {
        let found = recover(shared, &settings, monitor)?;
        found.trusted()?;
        Ok(found)
    })?;
    Ok(Track { found })
}

#[pymethods]
impl Track {
    /// Number of the pulse of each pose.
    #[getter]
    fn pulse<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<usize>> {
        PyArray1::from_iter(py, self.found.moments.iter().map(|moment| moment.pulse))
    }

    /// Time of each pose, seconds.
    #[getter]
    fn time_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(py, self.found.moments.iter().map(|moment| moment.time_s))
    }

    /// Position of each pose, poses x 3, metres in the scene frame.
    #[getter]
    fn position_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let moments = self.found.moments.iter();
        convert::positions(py, moments.map(|moment| moment.position_m))
    }

    /// Standard deviation of each position along its worst direction, metres.
    #[getter]
    fn deviation_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_iter(
            py,
            self.found.moments.iter().map(|moment| moment.spread_m()),
        )
    }

    /// Positions of the standing targets, targets x 3, metres.
    #[getter]
    fn targets_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        convert::positions(py, self.found.places.iter().map(|place| place.position_m))
    }

    /// Warnings about the track, one sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        let faults = self.found.seen.faults.iter();
        faults.map(ToString::to_string).collect()
    }

    /// Channels with their antennas on this track; pulses outside of its time are left out. Samples are shared.
    fn applied(&self, channels: &ChannelList) -> Result<ChannelList, Error> {
        let fixes = self.found.moments.iter().map(|moment| Fix {
            time_s: moment.time_s,
            position_m: moment.position_m,
            attitude: Some(moment.attitude),
        });
        let placed = on_track(channels.shared()?, &fixes.collect::<Vec<_>>())?;
        Ok(ChannelList::of(placed))
    }

    /// Length of the track, metres.
    #[getter]
    fn length_m(&self) -> f64 {
        self.found.length_m()
    }

    fn __repr__(&self) -> String {
        format!(
            "<Track: {} poses, {:.2} m>",
            self.found.moments.len(),
            self.length_m()
        )
    }
}

/// Detect moving targets in several channels: GeoJSON and the grid of the images.
#[pyfunction]
#[pyo3(signature = (channels, request, *, false_alarms=None, sub_cpis=None, max_speed_m_s=None))]
pub(crate) fn gmti<'py>(
    py: Python<'py>,
    channels: &ChannelList,
    request: Request<'_>,
    false_alarms: Option<f64>,
    sub_cpis: Option<usize>,
    max_speed_m_s: Option<f64>,
) -> Result<(Bound<'py, PyAny>, Grid), Error> {
    if let Some(probability) = false_alarms
        && !(probability > 0.0 && probability < 1.0)
    {
        return Err(Error::argument(format!(
            "false_alarms: expected a probability above 0 and below 1, found {probability}"
        )));
    }
    let shared = channels.shared()?;
    let arguments = request.prepare(py)?;
    let defaults = detection::Settings::default();
    let settings = detection::Settings {
        false_alarm_probability: false_alarms.unwrap_or(defaults.false_alarm_probability),
        ..defaults
    };
    let (targets, frame) = work::run(py, request.progress(py), |monitor| {
        let imaging = Imaging {
            former: &*arguments.former,
            grid: &arguments.grid,
            windows: arguments.windows,
            memory_bytes: arguments.memory_bytes,
            numerics: Numerics::default(),
            monitor,
        };
        let defaults = space_time::Settings::default();
        let integration = sub_cpis.map(|sub_cpis| space_time::Settings {
            sub_cpis,
            windows: imaging.windows,
            max_speed_m_s: max_speed_m_s.unwrap_or(defaults.max_speed_m_s),
            false_alarm_probability: settings.false_alarm_probability,
            transforms: imaging.numerics.transforms,
            memory_bytes: imaging.memory_bytes,
            ..defaults
        });
        let found = find(&shared, &imaging, &settings, integration.as_ref())?;
        Ok((found.targets, shared.channel(0).collection().frame))
    })?;
    let plane = Plane::of(&arguments.grid);
    let features: Value = geojson::collection(&[targets], (&[], &plane), &frame);
    let grid = Grid {
        grid: arguments.grid,
    };
    Ok((convert::object(py, &features)?, grid))
}
