//! Job and dwell of detected targets.

use glam::DVec3;
use subaperture_model::geometry::{Geodetic, ImageGrid, SceneFrame};

use super::{Dwell, Job, LineOfSightVelocity, SensorVelocity, StanagError, TargetReport};
use crate::report::MovingTargets;

impl Dwell {
    /// Job number 1 with the area of a grid, and the dwell with the targets that were detected on it. `start_ns` is the UTC of the collection's time zero, nanoseconds
    /// since 1970. Targets without a position are left out. Standard deviations are not part of the dwell, because that of the sensor is unknown.
    ///
    /// # Errors
    /// [`StanagError::NotGeoreferenced`].
    pub fn of(
        found: &MovingTargets,
        grid: &ImageGrid,
        frame: &SceneFrame,
        start_ns: i64,
    ) -> Result<(Job, Self), StanagError> {
        let geodetic = |position_m: DVec3| {
            let place = frame.geodetic(position_m);
            place.ok_or(StanagError::NotGeoreferenced)
        };
        let sensor_m = found.images.view.antenna_m();
        let sensor = geodetic(sensor_m)?;
        let level = SceneFrame::east_north_up(&sensor);
        let local = |direction: DVec3| level.direction_from_ecf(frame.direction_to_ecf(direction));
        let velocity = local(found.images.view.along()) * found.alignment.speed_m_s();
        let (last_row, last_column) = (grid.rows.count - 1, grid.columns.count - 1);
        let corners_m = [
            [0, 0],
            [last_row, 0],
            [last_row, last_column],
            [0, last_column],
        ]
        .map(|[row, column]| grid.position_m(row, column));
        let centre_m = grid.position_m(grid.rows.count / 2, grid.columns.count / 2);
        let sights = corners_m.map(|corner_m| local(corner_m - sensor_m));
        let middle = local(centre_m - sensor_m);
        let (mut ground_m, mut angle_rad) = (0f64, 0f64);
        for sight in sights {
            let [own, mean] =
                [sight, middle].map(|v| (libm::hypot(v.x, v.y), libm::atan2(v.x, v.y)));
            ground_m = ground_m.max((own.0 - mean.0).abs());
            let turn = (own.1 - mean.1).rem_euclid(std::f64::consts::TAU);
            angle_rad = angle_rad.max(turn.min(std::f64::consts::TAU - turn));
        }
        let place =
            |position_m: DVec3| geodetic(position_m).map(|at| [at.latitude_deg, at.longitude_deg]);
        let mut area_deg = [[0.0; 2]; 4];
        for (out, &corner_m) in area_deg.iter_mut().zip(&corners_m) {
            *out = place(corner_m)?;
        }
        // Clockwise seen from above, whatever the axes of the grid.
        let side = |i: usize| local(corners_m[i] - corners_m[0]);
        if side(1).cross(side(2)).z > 0.0 {
            area_deg.reverse();
        }
        let mut targets = Vec::new();
        for target in &found.targets {
            let Some(position_m) = target.position_m else {
                continue;
            };
            let Geodetic {
                latitude_deg,
                longitude_deg,
                height_m,
            } = geodetic(position_m.into())?;
            targets.push(TargetReport {
                index: u16::try_from(targets.len()).ok(),
                height_m: Some(height_m),
                velocity: Some(LineOfSightVelocity {
                    away_m_s: -target.radial_velocity_m_s,
                    wrap_m_s: target.velocity_ambiguity_m_s / 2.0,
                    deviation_m_s: None,
                }),
                snr_db: Some(target.snr_db),
                ..TargetReport::new(latitude_deg, longitude_deg)
            });
        }
        let centre_ns = start_ns + (1e9 * found.alignment.centre_s()).round() as i64;
        let dwell = Self {
            revisit_index: 0,
            dwell_index: 0,
            is_last: true,
            centre_utc_ns: centre_ns,
            sensor,
            sensor_deviation: None,
            sensor_velocity: Some(SensorVelocity {
                track_deg: libm::atan2(velocity.x, velocity.y).to_degrees(),
                speed_m_s: libm::hypot(velocity.x, velocity.y),
                up_m_s: velocity.z,
            }),
            area_centre_deg: place(centre_m)?,
            range_half_extent_m: ground_m,
            angle_half_extent_deg: angle_rad.to_degrees(),
            targets,
        };
        Ok((Job::new(1, area_deg), dwell))
    }
}
