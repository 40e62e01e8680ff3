//! True and measured tracks from `[platform]` and `[navigation]`, and tracks of moving targets.

use std::path::Path;
use std::sync::Arc;

use crate::track::{Navigated, NavigationError, Perturbation, Perturbed};
use glam::DVec3;
use subaperture_describe::track::{curve, line, segments};
use subaperture_io::recorded_track;
use subaperture_model::geometry::SceneFrame;
use subaperture_model::radar::Radar;
use subaperture_model::track::{self, Rail, Trajectory};

use super::error::Fault;
use super::keys::{
    NavigationKeys, PerturbationKeys, PerturbationKind, PlatformKeys, PlatformMotion, ScenarioKeys,
};

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
    top: &ScenarioKeys,
    radar: &Radar,
    frame: &SceneFrame,
    seed: u64,
    folder: &Path,
) -> Result<Tracks, Fault> {
    let origin_is_given = top.scene.origin.is_given();
    let frame = origin_is_given.then_some(frame);
    let nominal = nominal(&top.platform, middle_s(radar), frame, folder)?;
    let perturbations = &top.platform.perturbation;
    let track: Arc<dyn Trajectory> = if perturbations.is_empty() {
        nominal
    } else {
        let all = perturbations.iter().zip(0..);
        Arc::new(Perturbed {
            track: nominal,
            perturbations: all
                .map(|(keys, index)| perturbation(keys, seed, index))
                .collect::<Result<_, _>>()?,
        })
    };
    let measured = top
        .navigation
        .as_ref()
        .map(|keys| navigated(keys, track.clone(), seed))
        .transpose()?;
    Ok(Tracks { track, measured })
}

/// Track without perturbations. `frame` is the scene's if its origin is stated.
fn nominal(
    platform: &PlatformKeys,
    middle_s: f64,
    frame: Option<&SceneFrame>,
    folder: &Path,
) -> Result<Arc<dyn Trajectory>, Fault> {
    Ok(match &platform.kind {
        PlatformMotion::Linear(keys) => {
            line(keys.position_m, keys.velocity_m_s, keys.at.time_s(middle_s))
        }
        PlatformMotion::Fixed(keys) => line(keys.position_m, DVec3::ZERO, 0.0),
        PlatformMotion::Circular(keys) => {
            let at_s = keys.at.time_s(middle_s);
            keys.turn
                .circle(keys.centre_m, keys.radius_m, keys.speed_m_s, at_s)
        }
        PlatformMotion::Rail(keys) => {
            if keys.from_m.distance(*keys.to_m) < 1e-9 {
                let message = "the rail has zero length: move one of its ends";
                return Err(keys.to_m.fault(message));
            }
            Arc::new(Rail {
                from_m: keys.from_m,
                to_m: *keys.to_m,
                speed_m_s: keys.speed_m_s,
                start_s: keys.start_s,
            })
        }
        PlatformMotion::Arc(keys) => Arc::new(track::Arc {
            pivot_m: keys.pivot_m,
            radius_m: keys.radius_m,
            from_rad: keys.from_angle_rad,
            to_rad: keys.to_angle_rad,
            rate_rad_s: keys.rate_rad_s,
            start_s: keys.start_s,
        }),
        PlatformMotion::Waypoints(keys) => segments(&keys.points)?,
        PlatformMotion::Spline(keys) => curve(&keys.points)?,
        PlatformMotion::Csv(keys) => recorded_track::csv(&keys.file, folder)?,
        PlatformMotion::Novatel(keys) => {
            recorded_track::novatel(&keys.file, &keys.log, frame, folder)?
        }
    })
}

fn perturbation(keys: &PerturbationKeys, seed: u64, index: u32) -> Result<Perturbation, Fault> {
    Ok(match &keys.kind {
        PerturbationKind::Sway(keys) => {
            Perturbation::sway(*keys.rms_m, keys.correlation_s, seed, index)
                .map_err(|error| keys.rms_m.fault(error.to_string()))?
        }
        PerturbationKind::Vibration(keys) => Perturbation::Vibration {
            amplitude_m: keys.amplitude_m,
            frequency_hz: keys.frequency_hz,
            phase_rad: keys.phase_rad,
        },
        PerturbationKind::Acceleration(keys) => Perturbation::Acceleration {
            acceleration_m_s2: keys.acceleration_m_s2,
            from_s: keys.from_s,
        },
        PerturbationKind::Wobble(keys) => Perturbation::Wobble {
            amplitude_rad: keys.angles_rad,
            period_s: keys.period_s,
            phase_rad: keys.phase_rad,
        },
    })
}

fn navigated(
    keys: &NavigationKeys,
    track: Arc<dyn Trajectory>,
    seed: u64,
) -> Result<Arc<dyn Trajectory>, Fault> {
    let error = NavigationError {
        bias_m: keys.bias_m,
        drift_rms_m: keys.drift_m,
        noise_rms_m: keys.noise_m,
        fix_rate_hz: keys.fix_rate_hz,
        attitude_bias_rad: keys.attitude_bias_rad,
        attitude_drift_rms_rad: keys.attitude_drift_rad,
        drift_time_s: keys.drift_time_s,
    };
    let navigated = Navigated::new(track, error, seed);
    Ok(Arc::new(navigated.map_err(|error| {
        Fault::new(&keys.header, error.to_string())
    })?))
}
