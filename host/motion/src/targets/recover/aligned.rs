//! Alignment of a track's frame with the recorded positions.

use std::f64::consts::{PI, TAU};

use crate::{Pose, Track};
use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use crate::targets::arrangement::Arrangement;

/// Alignment by one turn and one shift.
pub(super) struct Aligned {
    origin_m: DVec3,
    body: DQuat,
    turn_rad: f64,
    shift_m: DVec2,
    /// Angle from the scene's x axis to the body's in the first pulse, if the plane is level.
    yaw_rad: f64,
    pub(super) reversed: bool,
    /// Whether all recorded positions were used, and not the first alone.
    pub(super) moves: bool,
    /// RMS extent of the recorded positions in the plane, metres.
    pub(super) extent_m: f64,
}

impl Aligned {
    pub(super) fn new(
        found: &Track,
        recorded_m: &[DVec3],
        arrangement: &Arrangement,
        wavelength_m: f64,
    ) -> Self {
        let body = arrangement.attitude;
        let in_plane = |at: &DVec3| (body.inverse() * (*at - arrangement.origin_m)).truncate();
        let wanted: Vec<DVec2> = recorded_m.iter().map(in_plane).collect();
        let got: Vec<DVec2> = found.poses.iter().map(|pose| pose.at_m).collect();
        let share = 1.0 / got.len() as f64;
        let mean = |all: &[DVec2]| all.iter().sum::<DVec2>() * share;
        let (mean_got, mean_wanted) = (mean(&got), mean(&wanted));
        let (mut dot, mut cross, mut size) = (0.0, 0.0, 0.0);
        for (got, wanted) in got.iter().zip(&wanted) {
            let (a, b) = (*got - mean_got, *wanted - mean_wanted);
            dot += a.dot(b);
            cross += a.perp_dot(b);
            size += b.length_squared();
        }
        let moves = (size * share).sqrt() > 0.25 * wavelength_m;
        let mean_heading = found.poses.iter().map(|pose| pose.heading_rad).sum::<f64>() * share;
        let (turn_rad, shift_m) = match moves {
            true => {
                let turn_rad = libm::atan2(cross, dot);
                (turn_rad, mean_wanted - turned(turn_rad, mean_got))
            }
            false => {
                let turn_rad = -found.poses[0].heading_rad;
                (turn_rad, wanted[0] - turned(turn_rad, got[0]))
            }
        };
        let off = (turn_rad + mean_heading) / TAU;
        let level = (body * DVec3::Z).distance(DVec3::Z) < 1e-6;
        let x = body * DVec3::X;
        Self {
            origin_m: arrangement.origin_m,
            body,
            turn_rad,
            shift_m,
            yaw_rad: match level {
                true => libm::atan2(x.y, x.x),
                false => 0.0,
            },
            moves,
            extent_m: (size * share).sqrt(),
            reversed: moves && TAU * (off - off.round()).abs() > 0.5 * PI,
        }
    }

    /// Position in the scene of a point in the plane, at the distance of `recorded_m` from it.
    pub(super) fn position_m(&self, at_m: DVec2, recorded_m: DVec3) -> DVec3 {
        let out_m = (self.body.inverse() * (recorded_m - self.origin_m)).z;
        let aligned = turned(self.turn_rad, at_m) + self.shift_m;
        self.origin_m + self.body * aligned.extend(out_m)
    }

    /// Velocity in the scene of a velocity in the plane.
    pub(super) fn velocity_m_s(&self, velocity_m_s: DVec2) -> DVec3 {
        self.body * turned(self.turn_rad, velocity_m_s).extend(0.0)
    }

    pub(super) fn attitude(&self, pose: &Pose) -> DQuat {
        self.body * DQuat::from_rotation_z(pose.heading_rad + self.turn_rad)
    }

    pub(super) fn covariance(&self, covariance: &DMat3) -> DMat3 {
        let (sin, cos) = libm::sincos(self.turn_rad + self.yaw_rad);
        let turn = DMat3::from_mat2(DMat2::from_cols(
            DVec2::new(cos, sin),
            DVec2::new(-sin, cos),
        ));
        turn * *covariance * turn.transpose()
    }
}

fn turned(by_rad: f64, at_m: DVec2) -> DVec2 {
    let (sin, cos) = libm::sincos(by_rad);
    DVec2::new(cos * at_m.x - sin * at_m.y, sin * at_m.x + cos * at_m.y)
}
