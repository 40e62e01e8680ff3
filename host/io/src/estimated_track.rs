//! Tracks estimated from echoes, with their covariance, as comma-separated values.
//!
//! The format is that of [`crate::track_csv`], which reads times, positions and attitudes and skips the other
//! columns. The first line states the writing program, the second the column names. Every further line is a pulse:
//!
//! | column | meaning |
//! |---|---|
//! | `time_s`, `x_m`, `y_m`, `z_m` | time and position of the body in the scene frame |
//! | `roll_deg`, `pitch_deg`, `yaw_deg` | attitude |
//! | `variance_x_m2`, `covariance_x_y_m2`, `variance_y_m2` | covariance of x and y |
//! | `covariance_x_yaw_m_rad`, `covariance_y_yaw_m_rad`, `variance_yaw_rad2` | covariance of x and y with the heading, variance of the heading |
//! | `residual` | RMS residual of ranges and phases in standard deviations |
//! | `targets` | number of targets observed |
//! | `pulse` | pulse number in the recording, from 0 |

use std::io::Write;
use std::path::Path;

use glam::{DMat3, EulerRot};
use subaperture_model::track::Fix;

use crate::atomic::{WriteError, write_atomically};
use crate::ours::TEXT_MARK;

/// Line of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedFix {
    /// Time, position and attitude. A missing attitude is written as that of the scene's axes.
    pub fix: Fix,
    /// Covariance of x and y in metres and heading in radians.
    pub covariance: DMat3,
    /// RMS residual in standard deviations.
    pub residual: f64,
    /// Number of targets observed.
    pub targets: usize,
    /// Pulse number.
    pub pulse: usize,
}

/// Columns that [`crate::track_csv`] skips.
pub(crate) const EXTRA_COLUMNS: [&str; 9] = [
    "variance_x_m2",
    "covariance_x_y_m2",
    "variance_y_m2",
    "covariance_x_yaw_m_rad",
    "covariance_y_yaw_m_rad",
    "variance_yaw_rad2",
    "residual",
    "targets",
    "pulse",
];

/// Write a track atomically.
///
/// # Errors
/// [`WriteError`].
pub fn write(path: &Path, fixes: &[EstimatedFix]) -> Result<(), WriteError> {
    let text = text(fixes);
    write_atomically(path, text.len() as u64, |file| {
        file.write_all(text.as_bytes())
    })
}

/// Text of the file.
pub fn text(fixes: &[EstimatedFix]) -> String {
    let place = "time_s,x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg";
    let mut text = format!(
        "# track estimated from echoes, {TEXT_MARK}\n{place},{}\n",
        EXTRA_COLUMNS.join(",")
    );
    for found in fixes {
        let fix = &found.fix;
        let (yaw, pitch, roll) = fix.attitude.unwrap_or_default().to_euler(EulerRot::ZYX);
        let c = &found.covariance;
        let numbers = [
            c.x_axis.x, c.x_axis.y, c.y_axis.y, c.x_axis.z, c.y_axis.z, c.z_axis.z,
        ];
        let at = fix.position_m.to_array().map(|x| format!("{x:.9}"));
        let turned = [roll, pitch, yaw].map(|rad| format!("{:.9}", rad.to_degrees()));
        let known = numbers.map(|x| format!("{x:.6e}"));
        text += &format!(
            "{:?},{},{},{},{:.4},{},{}\n",
            fix.time_s,
            at.join(","),
            turned.join(","),
            known.join(","),
            found.residual,
            found.targets,
            found.pulse
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track_csv;
    use glam::{DQuat, DVec3};
    use subaperture_model::track::turned;

    #[test]
    fn written_track_reads_back() {
        let fix = |n: usize| EstimatedFix {
            fix: Fix {
                time_s: n as f64 / 3.0,
                position_m: DVec3::new(1.0 / 7.0, -2e3 / 3.0, 0.5) * n as f64,
                attitude: Some(turned(0.01, -0.02, 3.0 + 0.1 * n as f64)),
            },
            covariance: DMat3::from_diagonal(DVec3::new(1e-6, 2e-6, 3e-8)),
            residual: 1.02,
            targets: 5,
            pulse: n,
        };
        let fixes: Vec<EstimatedFix> = (0..4).map(fix).collect();
        let text = text(&fixes);
        assert!(text.lines().next().unwrap().contains(TEXT_MARK));
        let read = track_csv::read_from(text.as_bytes(), Path::new("track.csv")).unwrap();
        assert_eq!(read.len(), 4);
        for (read, written) in read.iter().zip(&fixes) {
            assert_eq!(read.time_s, written.fix.time_s);
            assert!(read.position_m.distance(written.fix.position_m) < 1e-9);
            let turn = |fix: &Fix| fix.attitude.unwrap_or(DQuat::IDENTITY) * DVec3::X;
            assert!(turn(read).distance(turn(&written.fix)) < 1e-10);
        }
    }
}
