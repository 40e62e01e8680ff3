//! `[platform]` and `[navigation]`: from keys to the true and the measured track; movers' tracks too.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::SceneFrame;
use crate::simulate::body::Trajectory;
use crate::simulate::radar::Radar;
use crate::simulate::track::{
    self, Circular, Linear, Navigated, NavigationError, Perturbation, Perturbed, Profile, Rail,
    Spline, TrackError, Waypoints,
};

use super::error::Found;
use super::recorded;
use super::values::Values;

/// The track, and what the recording says of it.
pub(super) struct Ways {
    pub(super) track: Arc<dyn Trajectory>,
    pub(super) measured: Option<Arc<dyn Trajectory>>,
}

/// Middle of the collection, seconds.
pub(super) fn middle_s(radar: &Radar) -> f64 {
    radar.start_s + (radar.num_pulses as f64 - 1.0) / 2.0 * radar.pri_s
}

/// The tracks of the scenario's `top`.
pub(super) fn build(
    top: &Values,
    radar: &Radar,
    frame: &SceneFrame,
    seed: u64,
    folder: &Path,
) -> Result<Ways, Found> {
    let platform = top.section("platform");
    let way = match platform.text("kind") {
        "csv" | "novatel" => {
            let origin = top.section("scene").section("origin");
            let known = ["latitude", "longitude"].iter().any(|key| origin.says(key));
            recorded::build(platform, known.then_some(frame), folder)?
        }
        _ => track(platform, middle_s(radar))?,
    };
    let perturbations = platform.sections("perturbation");
    let track: Arc<dyn Trajectory> = if perturbations.is_empty() {
        way
    } else {
        let all = perturbations.iter().zip(0..);
        Arc::new(Perturbed {
            track: way,
            perturbations: all
                .map(|(values, index)| perturbation(values, seed, index))
                .collect::<Result<_, _>>()?,
        })
    };
    let measured = top
        .optional_section("navigation")
        .map(|values| navigated(values, track.clone(), seed))
        .transpose()?;
    Ok(Ways { track, measured })
}

/// The track that a section's `kind` and its keys describe.
pub(crate) fn track(values: &Values, middle_s: f64) -> Result<Arc<dyn Trajectory>, Found> {
    let failed = |key: &str, error: TrackError| values.fault(key, error.to_string());
    Ok(match values.text("kind") {
        "fixed" => Arc::new(Linear {
            position_m: values.vector("position"),
            velocity_m_s: DVec3::ZERO,
            at_s: 0.0,
        }),
        "linear" => Arc::new(Linear {
            position_m: values.vector("position"),
            velocity_m_s: values.vector("velocity"),
            at_s: at_s(values, middle_s),
        }),
        "circular" => {
            let radius_m = values.number("radius");
            let turn = if values.text("turn") == "left" {
                1.0
            } else {
                -1.0
            };
            let rate_rad_s = turn * values.number("speed") / radius_m;
            Arc::new(Circular {
                centre_m: values.vector("centre"),
                radius_m,
                start_rad: values.number("bearing") - rate_rad_s * at_s(values, middle_s),
                rate_rad_s,
            })
        }
        "rail" => {
            let (from_m, to_m) = (values.vector("from"), values.vector("to"));
            if from_m.distance(to_m) < 1e-9 {
                return Err(values.fault("to", "the rail has no length: move one of its ends"));
            }
            Arc::new(Rail {
                from_m,
                to_m,
                speed_m_s: values.number("speed"),
                start_s: values.number("start"),
            })
        }
        "arc" => Arc::new(track::Arc {
            pivot_m: values.vector("pivot"),
            radius_m: values.number("radius"),
            from_rad: values.number("from_angle"),
            to_rad: values.number("to_angle"),
            rate_rad_s: values.number("rate"),
            start_s: values.number("start"),
        }),
        "profile" => {
            let pieces: Vec<(f64, DVec3)> = values
                .rows("pieces")
                .iter()
                .map(|row| (row[0], DVec3::from_slice(&row[1..])))
                .collect();
            let profile = Profile::new(
                values.number("start"),
                values.vector("position"),
                values.vector("velocity"),
                &pieces,
            );
            Arc::new(profile.map_err(|error| failed("pieces", error))?)
        }
        kind => {
            let rows = values.rows("points").iter();
            let (times, points): (Vec<f64>, Vec<DVec3>) = rows
                .map(|row| (row[0], DVec3::from_slice(&row[1..])))
                .unzip();
            let failed = |error| failed("points", error);
            if kind == "spline" {
                Arc::new(Spline::new(times, &points).map_err(failed)?)
            } else {
                Arc::new(Waypoints::new(times, points).map_err(failed)?)
            }
        }
    })
}

fn at_s(values: &Values, middle_s: f64) -> f64 {
    if values.text("at") == "middle" {
        middle_s
    } else {
        0.0
    }
}

fn perturbation(values: &Values, seed: u64, index: u32) -> Result<Perturbation, Found> {
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
) -> Result<Arc<dyn Trajectory>, Found> {
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
        Found::new(&values.at, error.to_string())
    })?))
}
