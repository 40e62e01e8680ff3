//! True and measured tracks from `[platform]` and `[navigation]`, and tracks of moving targets.

use std::path::Path;
use std::sync::Arc;

use crate::track::{Navigated, NavigationError, Perturbation, Perturbed};
use subaperture_describe::track;
use subaperture_io::recorded_track;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::radar::Radar;
use subaperture_model::track::Trajectory;

use super::error::Fault;
use super::values::Values;

/// True track, and measured track if any.
pub(super) struct Tracks {
    pub(super) track: Arc<dyn Trajectory>,
    pub(super) measured: Option<Arc<dyn Trajectory>>,
}

/// Time at the middle of the collection, seconds.
pub(super) fn middle_s(radar: &Radar) -> f64 {
    radar.start_s + (radar.num_pulses as f64 - 1.0) / 2.0 * radar.pri_s
}

/// Build the tracks of a scenario.
pub(super) fn build(
    top: &Values,
    radar: &Radar,
    frame: &SceneFrame,
    seed: u64,
    folder: &Path,
) -> Result<Tracks, Fault> {
    let platform = top.section("platform");
    let nominal = match platform.text("kind") {
        "csv" | "novatel" => {
            let origin = top.section("scene").section("origin");
            let known = ["latitude", "longitude"].iter().any(|key| origin.says(key));
            recorded_track::build(platform, known.then_some(frame), folder)?
        }
        _ => track::track(platform, middle_s(radar))?,
    };
    let perturbations = platform.sections("perturbation");
    let track: Arc<dyn Trajectory> = if perturbations.is_empty() {
        nominal
    } else {
        let all = perturbations.iter().zip(0..);
        Arc::new(Perturbed {
            track: nominal,
            perturbations: all
                .map(|(values, index)| perturbation(values, seed, index))
                .collect::<Result<_, _>>()?,
        })
    };
    let measured = top
        .optional_section("navigation")
        .map(|values| navigated(values, track.clone(), seed))
        .transpose()?;
    Ok(Tracks { track, measured })
}

fn perturbation(values: &Values, seed: u64, index: u32) -> Result<Perturbation, Fault> {
    Ok(match values.text("kind") {
        "sway" => {
            let (rms_m, correlation_s) = (values.vector("rms"), values.number("correlation"));
            Perturbation::sway(rms_m, correlation_s, seed, index)
                .map_err(|error| values.fault("rms", error.to_string()))?
        }
        "vibration" => Perturbation::Vibration {
            amplitude_m: values.vector("amplitude"),
            frequency_hz: values.number("frequency"),
            phase_rad: values.number("phase"),
        },
        "acceleration" => Perturbation::Acceleration {
            acceleration_m_s2: values.vector("acceleration"),
            from_s: values.number("from"),
        },
        _ => Perturbation::Wobble {
            amplitude_rad: values.vector("angles"),
            period_s: values.number("period"),
            phase_rad: values.number("phase"),
        },
    })
}

fn navigated(
    values: &Values,
    track: Arc<dyn Trajectory>,
    seed: u64,
) -> Result<Arc<dyn Trajectory>, Fault> {
    let error = NavigationError {
        bias_m: values.vector("bias"),
        drift_rms_m: values.vector("drift"),
        noise_rms_m: values.vector("noise"),
        fix_rate_hz: values.number("fix_rate"),
        attitude_bias_rad: values.vector("attitude_bias"),
        attitude_drift_rms_rad: values.vector("attitude_drift"),
        drift_time_s: values.number("drift_time"),
    };
    let navigated = Navigated::new(track, error, seed);
    Ok(Arc::new(navigated.map_err(|error| {
        Fault::new(&values.at, error.to_string())
    })?))
}
