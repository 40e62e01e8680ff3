//! Slant plane of a collection: the plane of range and cross-range.
//!
//! At a scene point, the path of the middle pulse increases fastest along `u`, the range direction. From the first pulse to the last that direction
//! changes by `d`. The slant plane passes through the point along both: y along `u`, away from the antennas, x along the component of `d`
//! normal to it, with the normal `x cross y` upwards in the scene frame. It contains a straight track.
//!
//! Resolution is finest in this plane. A scatterer off the plane is displaced to the intersection of its circle about the track with the plane (layover).

use glam::DVec3;

use crate::geometry::{Axis, ImageGrid};
use crate::phase_history::Collection;
use crate::resolution::support::{Looks, path_gradient};
use crate::resolution::survey::default_grid::round_to_two_digits;
use crate::resolution::survey::{MAX_PIXELS, NoDefaultGrid};
use subaperture_signal::window::Window;

/// Smallest change of the range direction that defines a plane, radians.
const MIN_TURN: f64 = 1e-9;

/// Axes x and y of the slant plane at a scene point; `None` if the antennas do not move across the line of sight.
pub fn slant_axes(collection: &Collection, place_m: DVec3) -> Option<[DVec3; 2]> {
    let pulses = &collection.pulses;
    let gradient = |n: usize| {
        let pulse = pulses.get(n)?;
        Some(path_gradient(
            pulse.transmitter_m,
            pulse.receiver_m,
            place_m,
        ))
    };
    let y = gradient(pulses.len() / 2)?.normalize_or_zero();
    let turn = gradient(pulses.len().checked_sub(1)?)? - gradient(0)?;
    let across = turn - y * turn.dot(y);
    if across.length().is_nan() || across.length() < MIN_TURN {
        return None;
    }
    let x = across.normalize();
    Some(match x.cross(y).z < 0.0 {
        true => [-x, y],
        false => [x, y],
    })
}

/// Grid in the slant plane at the origin of a horizontal grid that covers the same area, with half the largest alias-free pixel spacing.
/// Cropped about its centre to [`MAX_PIXELS`].
///
/// # Errors
/// [`NoDefaultGrid`] if there is no slant plane.
pub fn slant_grid(
    collection: &Collection,
    horizontal: &ImageGrid,
) -> Result<ImageGrid, NoDefaultGrid> {
    let origin_m = horizontal.origin_m;
    let axes = slant_axes(collection, origin_m).ok_or_else(NoDefaultGrid::no_slant_plane)?;
    let (rows, columns) = (&horizontal.rows, &horizontal.columns);
    let corners = [
        [0, 0],
        [0, columns.count],
        [rows.count, 0],
        [rows.count, columns.count],
    ];
    let looks = Looks::new(collection, Window::None, Window::None);
    let support = looks.at(origin_m);
    let mut found = [Axis {
        start: 0.0,
        step: 1.0,
        count: 1,
    }; 2];
    for (axis, own) in axes.into_iter().zip(&mut found) {
        let places = corners.map(|[row, column]| {
            let point = horizontal.point_m(rows.at(row), columns.at(column));
            (point - origin_m).dot(axis)
        });
        let low = places.into_iter().fold(f64::INFINITY, f64::min);
        let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let width = support.extent(axis).map_or(0.0, |[low, high]| high - low);
        let step = round_to_two_digits(0.5 / width);
        if !(step.is_finite() && step > 0.0) {
            return Err(NoDefaultGrid::no_slant_plane());
        }
        let most = (MAX_PIXELS as f64).sqrt() * step;
        let middle = low.midpoint(high);
        let half = (0.5 * (high - low)).min(0.5 * most);
        let half = (half / step + 1e-9).floor().max(1.0) * step;
        *own = Axis::from_range(middle - half, middle + half, step)
            .map_err(|error| NoDefaultGrid::of(error.0))?;
    }
    let [columns, rows] = found;
    let [x_axis, y_axis] = axes;
    Ok(ImageGrid {
        origin_m,
        x_axis,
        y_axis,
        columns,
        rows,
        polar: false,
        relief: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SceneFrame;
    use crate::phase_history::{Pulse, Sweep};

    /// A straight track at 3 km height and 4 km ground distance: the normal of the slant plane is (0, -3, 4) / 5.
    #[test]
    fn slant_plane_contains_straight_track() {
        let pulse = |x: f64| Pulse {
            time_s: 0.0,
            transmitter_m: DVec3::new(x, -4000.0, 3000.0),
            receiver_m: DVec3::new(x, -4000.0, 3000.0),
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: 1e10,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let empty = Collection {
            name: String::new(),
            num_samples: 100,
            pulses: Vec::new(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        for sign in [1.0, -1.0] {
            let collection = Collection {
                pulses: (0..=100)
                    .map(|i| pulse(sign * (f64::from(i) * 4.0 - 200.0)))
                    .collect(),
                ..empty.clone()
            };
            let [x, y] = slant_axes(&collection, DVec3::ZERO).unwrap();
            assert!(x.distance(DVec3::X) < 1e-9, "{x}");
            assert!(y.distance(DVec3::new(0.0, 0.8, -0.6)) < 1e-9, "{y}");
            let horizontal: ImageGrid = "x=-10:10:1,y=-20:20:1".parse().unwrap();
            let grid = slant_grid(&collection, &horizontal).unwrap();
            // 40 m of ground range are 32 m of slant range. At the track's ends 10 GHz projects on y with the cosine of 200 m over 5 km, 0.9992:
            // 2 (10.1 GHz - 9.992 GHz) / c are 0.72 cycles per metre, and half a period rounds down to 0.69 m.
            assert!((grid.rows.step - 0.69).abs() < 1e-12, "{:?}", grid.rows);
            let reach = grid.rows.count as f64 * grid.rows.step;
            assert!((30.5..=32.0).contains(&reach), "{reach}");
        }
        let one = Collection {
            pulses: vec![pulse(0.0); 5],
            ..empty
        };
        assert_eq!(slant_axes(&one, DVec3::ZERO), None);
    }
}
