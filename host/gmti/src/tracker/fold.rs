//! Measurement of a detection at a fold of its radial velocity.

use subaperture_signal::dense::fixed::{Matrix, times, transposed};

use super::plane::Plane;
use super::scan::{Detection, Scan};

/// Least sine of the angle between the ground range and the radar's track at a folded position.
const LEAST_SINE: f64 = 0.01;

/// Measurement `(x, y, v_r)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measurement {
    /// Metres and metres per second.
    pub(super) z: [f64; 3],
    /// Covariance matrix, m^2, m * m/s and (m/s)^2.
    pub(super) covariance: Matrix<3, 3>,
}

impl Measurement {
    /// Measurement of a detection whose radial velocity is `folds` ambiguity intervals above the stated one. `None` if no point of the
    /// plane has its range and Doppler.
    pub(super) fn new(
        plane: &Plane,
        scan: &Scan,
        detection: &Detection,
        folds: f64,
    ) -> Option<Self> {
        let at_m = plane.coordinates_m(detection.position_m);
        let change_m_s = match detection.velocity_ambiguity_m_s {
            Some(interval_m_s) if folds != 0.0 => folds * interval_m_s,
            _ => 0.0,
        };
        let ([x, y], slopes) = match change_m_s != 0.0 {
            true => moved(plane, scan, at_m, change_m_s)?,
            false => (at_m, [[1.0, 0.0], [0.0, 1.0]]),
        };
        let [[a, b], [c, d]] = slopes;
        let whole = [[a, b, 0.0], [c, d, 0.0], [0.0, 0.0, 1.0]];
        Some(Self {
            z: [x, y, detection.radial_velocity_m_s + change_m_s],
            covariance: times(&times(&whole, &detection.covariance), &transposed(&whole)),
        })
    }
}

/// Position with the same range whose direction cosine along the track is lower by the velocity change over the radar's speed, and its derivative
/// with respect to the position.
fn moved(
    plane: &Plane,
    scan: &Scan,
    [x, y]: [f64; 2],
    change_m_s: f64,
) -> Option<([f64; 2], Matrix<2, 2>)> {
    let foot = plane.coordinates_m(scan.sensor_m);
    let [vx, vy] = plane.along(scan.sensor_velocity_m_s);
    let speed_m_s = libm::hypot(vx, vy);
    if speed_m_s == 0.0 {
        return Some(([x, y], [[1.0, 0.0], [0.0, 1.0]]));
    }
    let (tx, ty) = (vx / speed_m_s, vy / speed_m_s);
    let (qx, qy) = (x - foot[0], y - foot[1]);
    // Components along the track and to its left.
    let (along, left) = (qx * tx + qy * ty, qy * tx - qx * ty);
    let ground_m = libm::hypot(along, left);
    let range_m = (plane.position_m([x, y]) - scan.sensor_m).length();
    let cosine = change_m_s / speed_m_s;
    let new_along = along - cosine * range_m;
    let new_left = (ground_m * ground_m - new_along * new_along).sqrt();
    let new_left = new_left.copysign(left);
    // Not met by NaN.
    let visible = new_left.abs() >= LEAST_SINE * ground_m;
    let d_along = [1.0 - cosine * along / range_m, -cosine * left / range_m];
    let d_left = [
        (along - new_along * d_along[0]) / new_left,
        (left - new_along * d_along[1]) / new_left,
    ];
    let turn = [[tx, ty], [-ty, tx]];
    let slopes = times(&times(&transposed(&turn), &[d_along, d_left]), &turn);
    let [[new_x], [new_y]] = times(&transposed(&turn), &[[new_along], [new_left]]);
    visible.then_some(([foot[0] + new_x, foot[1] + new_y], slopes))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn scan() -> Scan {
        Scan {
            time_s: 0.0,
            sensor_m: DVec3::new(-800.0, -3000.0, 1200.0),
            sensor_velocity_m_s: DVec3::new(90.0, 30.0, -4.0),
            detections: Vec::new(),
        }
    }

    #[test]
    fn fold_keeps_range_and_changes_range_rate() {
        let scan = scan();
        let plane = Plane::horizontal(20.0);
        for (at, change_m_s) in [
            ([100.0, 40.0], 7.5),
            ([-600.0, 900.0], -15.0),
            ([0.0, -6000.0], 12.0),
        ] {
            let (new, slopes) = moved(&plane, &scan, at, change_m_s).unwrap();
            // Range, and closing speed of a point at rest.
            let seen = |at| {
                let line_m = plane.position_m(at) - scan.sensor_m;
                (
                    line_m.length(),
                    scan.sensor_velocity_m_s.dot(line_m.normalize()),
                )
            };
            let (before, after) = (seen(at), seen(new));
            assert!((before.0 - after.0).abs() < 1e-8);
            assert!((before.1 - change_m_s - after.1).abs() < 1e-10);
            for i in 0..2 {
                let stepped = |step: f64| {
                    let mut other = at;
                    other[i] += step;
                    moved(&plane, &scan, other, change_m_s).unwrap().0
                };
                let (above, below) = (stepped(0.01), stepped(-0.01));
                for row in 0..2 {
                    let slope = (above[row] - below[row]) / 0.02;
                    assert!((slopes[row][i] - slope).abs() < 1e-7, "{slopes:?}");
                }
            }
        }
    }

    #[test]
    fn fold_without_place_in_the_plane_is_refused() {
        let scan = scan();
        let plane = Plane::horizontal(0.0);
        assert!(moved(&plane, &scan, [0.0, 0.0], 150.0).is_none());
        assert!(moved(&plane, &scan, [f64::MAX, 0.0], 1.0).is_none());
    }

    #[test]
    fn radar_at_rest_keeps_positions() {
        let mut scan = scan();
        scan.sensor_velocity_m_s = DVec3::ZERO;
        let (at, _) = moved(&Plane::horizontal(0.0), &scan, [3.0, 4.0], 7.5).unwrap();
        assert_eq!(at, [3.0, 4.0]);
    }
}
