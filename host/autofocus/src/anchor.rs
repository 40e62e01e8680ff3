//! Displacement of image points with the geometry parameters.
//!
//! A wrong clock or range bias displaces an image as well as defocusing it. On fixed pixels, points enter and leave with the
//! parameter, and the figure of merit then depends on which points are present more than on sharpness: its maximum may lie
//! anywhere. The search must therefore compare the same pulses and the same points, on pixels that follow the points.
//!
//! The displacement follows from geometry alone. A point imaged at `p` has the measured paths
//! `P_n = path_n(p) + bias`. With other parameter values it is imaged where its paths fit best,
//!
//! ```text
//! p' = argmin sum_n w_n^2 (path'_n(p') + bias' - P_n)^2,    p' in the plane of the pixels
//! ```
//!
//! by Gauss-Newton iteration, and the pixels are moved by `p' - p`. The remaining path differences cause defocus. Rotation
//! of the scene about `p` is not followed.

use glam::DVec3;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Pulse;

/// Largest number of Gauss-Newton steps, and the step length that ends them, metres.
const STEPS: usize = 20;
const CLOSE_M: f64 = 1e-4;

/// Largest displacement of pixels, in units of the farthest antenna's range.
const FARTHEST: f64 = 4.0;

/// Displacement, metres in the plane of `grid`, of a scene point imaged at `at_m` with the pulses `from` and the path bias
/// `from_bias_m`, if the geometry changes to `to` and `to_bias_m`; zero if no displacement fits better.
pub(super) fn shift_m(
    grid: &ImageGrid,
    at_m: DVec3,
    (from, from_bias_m): (&[Pulse], f64),
    (to, to_bias_m): (&[Pulse], f64),
) -> DVec3 {
    let axes = [grid.x_axis, grid.y_axis];
    let count = from.len().min(to.len());
    let weight = |n: usize| {
        // Hann window: the centre of the aperture has more weight, as in a windowed image.
        let turn = std::f64::consts::TAU * (n as f64 + 0.5) / count as f64;
        0.5 * (1.0 - turn.cos())
    };
    let paths_m: Vec<f64> = from
        .iter()
        .map(|pulse| pulse.path_m(at_m) + from_bias_m)
        .collect();
    let reach_m = paths_m.iter().copied().fold(0.0, f64::max);
    let cost = |moved_m: DVec3| -> f64 {
        let each = to.iter().zip(&paths_m).enumerate();
        each.map(|(n, (pulse, path_m))| {
            (weight(n) * (pulse.path_m(at_m + moved_m) + to_bias_m - path_m)).powi(2)
        })
        .sum()
    };
    let mut moved_m = DVec3::ZERO;
    let mut least = cost(moved_m);
    for _ in 0..STEPS {
        let point = at_m + moved_m;
        let (mut a, mut b, mut d) = (0.0, 0.0, 0.0);
        let (mut u, mut v) = (0.0, 0.0);
        for (n, (pulse, path_m)) in to.iter().zip(&paths_m).enumerate() {
            let slope = (point - pulse.transmitter_m).normalize_or_zero()
                + (point - pulse.receiver_m).normalize_or_zero();
            let [x, y] = axes.map(|axis| slope.dot(axis) * weight(n));
            let left = (pulse.path_m(point) + to_bias_m - path_m) * weight(n);
            a += x * x;
            b += x * y;
            d += y * y;
            u += x * left;
            v += y * left;
        }
        // A small part of the trace bounds the move in a direction that the paths do not determine.
        let little = 1e-6 * (a + d);
        let (a, d) = (a + little, d + little);
        let determinant = a * d - b * b;
        if determinant <= 0.0 || !determinant.is_finite() {
            break;
        }
        let step_m =
            axes[0] * ((b * v - d * u) / determinant) + axes[1] * ((b * u - a * v) / determinant);
        // Halve the step until the cost decreases.
        let Some((better, next)) = (0..8)
            .map(|i| moved_m + step_m * 0.5f64.powi(i))
            .map(|next| (cost(next), next))
            .find(|(cost, _)| *cost < least)
        else {
            break;
        };
        (least, moved_m) = (better, next);
        if moved_m.length() > FARTHEST * reach_m {
            return DVec3::ZERO;
        }
        if step_m.length() < CLOSE_M {
            break;
        }
    }
    moved_m
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pulses(place: impl Fn(f64) -> DVec3) -> Vec<Pulse> {
        let pulse = |n: u32| {
            let antenna_m = place(f64::from(n) / 100.0 - 0.5);
            Pulse {
                time_s: f64::from(n),
                transmitter_m: antenna_m,
                receiver_m: antenna_m,
                reference_m: DVec3::ZERO,
                reference_path_m: 0.0,
                start_hz: 1e10,
                step_hz: 1e6,
                sweep: subaperture_model::phase_history::Sweep::AT_ONCE,
                recorded_path_m: None,
            }
        };
        (0..101).map(pulse).collect()
    }

    #[test]
    fn displacement_is_where_paths_fit_best() {
        let grid: ImageGrid = "x=-1:1:0.1,y=3:5:0.1".parse().unwrap();
        let at = DVec3::new(0.2, 4.0, 0.0);
        let straight = pulses(|t| DVec3::new(2.0 * t, 0.0, 0.0));
        // The antennas are 0.7 m farther along x, and ranges are 0.1 m longer: the point moves by as much.
        let along = pulses(|t| DVec3::new(2.0 * t + 0.7, 0.0, 0.0));
        let moved = shift_m(&grid, at, (&straight, 0.0), (&along, 0.0));
        assert!(moved.distance(DVec3::new(0.7, 0.0, 0.0)) < 1e-3, "{moved}");
        let moved = shift_m(&grid, at, (&straight, 0.2), (&straight, 0.0));
        // 0.1 m of range exactly for a short aperture, within 0.01 m for this one of 14 degrees.
        assert!(
            (moved.y - 0.1).abs() < 0.01 && moved.x.abs() < 0.01,
            "{moved}"
        );
        let none = shift_m(&grid, at, (&straight, 0.0), (&straight, 0.0));
        assert_eq!(none, DVec3::ZERO);
        // An antenna at rest determines no direction: the move stays bounded.
        let still = pulses(|_| DVec3::ZERO);
        let moved = shift_m(&grid, at, (&still, 0.0), (&still, -0.2));
        assert!((moved.length() - 0.1).abs() < 1e-2, "{moved}");
    }
}
