//! Centring of point histories: the circular shift of PGA in exact geometry.
//!
//! The phase of a scatterer off the pixel rotates from pulse to pulse. Centring searches cross-range for the position with the largest
//! coherent sum of the history, after correction of known phase errors,
//!
//! ```text
//! max over d of | sum_n h_n(p) exp(+j k (path_n(p + d e) - path_n(p))) exp(-j phi_n) |
//! ```
//!
//! with `e` in the plane of the pixels and across the mean line of sight. On a far straight aperture the paths' difference is linear
//! in `n` and this is a circular shift of the spectrum; over wide angles it is not, and a shift would leave curvature.
//! Within a range cell, the history at the displaced position differs only by that phase.

use glam::DVec3;
use num_complex::Complex64;

use subaperture_model::geometry::ImageGrid;
use subaperture_model::phase_history::Collection;
use subaperture_signal::phase::cis;

use super::echoes::{Echo, gradients, wavenumber_rad_m};

/// Search steps per resolution cell, coarse and fine: the loss between two steps is at most 0.9 dB and 0.06 dB.
const COARSE_A_CELL: f64 = 2.0;
const FINE_A_CELL: f64 = 8.0;

/// History of a point, centred on its brightest position.
#[derive(Clone, Debug)]
pub(crate) struct Centred {
    /// Position of the centre, metres.
    pub(crate) place_m: DVec3,
    /// History compensated to the position, one value per turn.
    pub(crate) values: Vec<Complex64>,
}

/// Cross-range direction in the plane of the pixels, and length of a resolution cell along it, metres; `None` if the line of
/// sight does not rotate.
pub(crate) fn cross_range(
    collection: &Collection,
    grid: &ImageGrid,
    echo: &Echo,
    place_m: DVec3,
) -> Option<(DVec3, f64)> {
    let gradients = gradients(collection, echo, place_m);
    let mean = gradients.iter().sum::<DVec3>();
    let normal = grid.x_axis.cross(grid.y_axis);
    // A line of sight normal to the plane defines no cross-range direction in it.
    let across = normal.cross(mean).try_normalize()?;
    let along = gradients.iter().map(|gradient| gradient.dot(across));
    let (least, most) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(x), b.max(x))
    });
    let wavenumber = wavenumber_rad_m(collection, &collection.pulses[echo.first]);
    let cell_m = std::f64::consts::TAU / (wavenumber * (most - least));
    cell_m.is_finite().then_some((across, cell_m))
}

/// Centre the history `echo` of a point at `place_m` on the brightest position within `reach_cells` resolution cells, after correction of `phases_rad`.
pub(crate) fn centre(
    collection: &Collection,
    grid: &ImageGrid,
    echo: &Echo,
    place_m: DVec3,
    phases_rad: Option<&[f64]>,
    reach_cells: f64,
) -> Centred {
    let unchanged = || Centred {
        place_m,
        values: echo.values.clone(),
    };
    let Some((across, cell_m)) = cross_range(collection, grid, echo, place_m) else {
        return unchanged();
    };
    let pulses = &collection.pulses[echo.first..echo.first + echo.values.len()];
    let rotated = |moved_m: f64| {
        let there_m = place_m + moved_m * across;
        let each = pulses.iter().zip(&echo.values);
        each.map(move |(pulse, value)| {
            let path_m = pulse.path_m(there_m) - pulse.path_m(place_m);
            value * cis(wavenumber_rad_m(collection, pulse) * path_m)
        })
    };
    let sum = |moved_m: f64| -> f64 {
        let values = rotated(moved_m);
        match phases_rad {
            None => values.sum::<Complex64>().norm_sqr(),
            Some(phases_rad) => values
                .zip(phases_rad)
                .map(|(value, &phase)| value * cis(-phase))
                .sum::<Complex64>()
                .norm_sqr(),
        }
    };
    let coarse_m = cell_m / COARSE_A_CELL;
    let reach = (reach_cells * COARSE_A_CELL).ceil() as i64;
    let around = |middle_m: f64, step_m: f64, reach: i64| {
        let places = (-reach..=reach).map(move |i| middle_m + i as f64 * step_m);
        places.map(|place| (place, sum(place))).collect::<Vec<_>>()
    };
    let largest =
        |sums: &[(f64, f64)]| (0..sums.len()).max_by(|&a, &b| sums[a].1.total_cmp(&sums[b].1));
    let sums = around(0.0, coarse_m, reach);
    let Some(best) = largest(&sums) else {
        return unchanged();
    };
    let fine_m = cell_m / FINE_A_CELL;
    let sums = around(sums[best].0, fine_m, (FINE_A_CELL / COARSE_A_CELL) as i64);
    let Some(best) = largest(&sums) else {
        return unchanged();
    };
    let mut moved_m = sums[best].0;
    // Vertex of the parabola through the maximum and its neighbours.
    if let [(_, before), (_, at), (_, after)] =
        sums[best.saturating_sub(1)..(best + 2).min(sums.len())]
    {
        let bend = before - 2.0 * at + after;
        if bend < 0.0 {
            moved_m += fine_m * (0.5 * (before - after) / bend).clamp(-0.5, 0.5);
        }
    }
    Centred {
        place_m: place_m + moved_m * across,
        values: rotated(moved_m).collect(),
    }
}
