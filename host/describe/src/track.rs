//! Tracks from a section's `kind` and keys.

use std::sync::Arc;

use glam::DVec3;

use subaperture_model::track::{
    self, Circular, Linear, Profile, Rail, Spline, TrackError, Trajectory, Waypoints,
};

use crate::error::Fault;
use crate::values::Values;

/// Build the track of a section. `middle_s` is the middle of the collection, seconds.
///
/// # Errors
/// The first invalid value, at its key.
pub fn track(values: &Values, middle_s: f64) -> Result<Arc<dyn Trajectory>, Fault> {
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
                return Err(values.fault("to", "the rail has zero length: move one of its ends"));
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
