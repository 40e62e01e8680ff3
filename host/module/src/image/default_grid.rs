//! Default image grid for the maps of a run.

use glam::DVec3;

use super::gather::{PatchMaps, patches};
use super::kernels::Kernels;
use super::model::sub_cpi_of;
use super::{arithmetic_error, probe};
use crate::maps::Maps;
use subaperture_focus::sub_cpi::SubCpi;
use subaperture_focus::{FormError, Reason, Remedy};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::{Axis, ImageGrid};
use subaperture_model::resolution::survey::default_grid::round_to_two_digits;
use subaperture_signal::windowed_sinc::TAPS;

/// Step of the path gradients in metres: second differences of a path are `1 / range`.
const STEP_M: f64 = 0.5;

/// Default image grid: horizontal at the mean height of the patches, with a spacing of half the resolution in x and y. It
/// covers the bounding box of squares around the patch centres. Each square lies within all maps of its patch, and the
/// linear path model is predicted to keep `error_db` on it with the kernels chosen for that bound.
///
/// # Errors
/// [`FormError::Unsuited`] if there are no maps, the maps have no resolution, or their position is invalid for a grid.
pub fn default_grid(maps: &dyn Maps, error_db: f64) -> Result<ImageGrid, FormError> {
    let allowed = line_share(maps, error_db);
    let patches = patches(maps)?;
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    let (mut low_cycles_m, mut high_cycles_m) = (low, high);
    for patch in &patches {
        let centre = DVec3::from(patch.patch.centre_m);
        let half_m = accurate_half_side_m(maps, patch, half_side_m(maps, patch), allowed);
        low = low.min(centre - half_m);
        high = high.max(centre + half_m);
        for &index in &patch.maps {
            for k in wave_vectors(maps, index, centre) {
                low_cycles_m = low_cycles_m.min(k);
                high_cycles_m = high_cycles_m.max(k);
            }
        }
    }
    let axis = |name: &str, low_m: f64, high_m: f64, band_cycles_m: f64| {
        // The resolution is `1 / band`.
        let step = round_to_two_digits(0.5 / band_cycles_m);
        let middle = low_m.midpoint(high_m);
        let half = ((high_m - low_m) / 2.0 / step).floor() * step;
        Axis::from_range(middle - half, middle + half, step).map_err(|_| {
            let why = format!(
                "no default grid: the extent of the maps along {name} does not exceed their resolution"
            );
            FormError::Unsuited(Reason::new(why).helped_by(&[Remedy::SomeGrid]))
        })
    };
    let band = high_cycles_m - low_cycles_m;
    let heights = patches.iter().map(|patch| patch.patch.centre_m[2]);
    let z_m = heights.sum::<f64>() / patches.len() as f64;
    let grid = ImageGrid::horizontal(
        axis("x", low.x, high.x, band.x)?,
        axis("y", low.y, high.y, band.y)?,
        z_m,
    );
    // Antennas and patches may be farther away than pixels.
    match grid.fault() {
        Some(fault) => Err(FormError::unsuited(format!(
            "no default grid: {}: are the patch positions in metres?",
            fault.0
        ))),
        None => Ok(grid),
    }
}

/// Gradients of path and path rate along x and y at the centre of a map.
fn gradients(sub_cpi: &SubCpi, centre: DVec3) -> [(f64, f64); 2] {
    let datum = sub_cpi.datum(centre);
    [DVec3::X, DVec3::Y].map(|axis| {
        let (a, b) = sub_cpi.line(&datum, centre + axis * STEP_M);
        let (c, d) = sub_cpi.line(&datum, centre - axis * STEP_M);
        ((a - c) / (2.0 * STEP_M), (b - d) / (2.0 * STEP_M))
    })
}

fn sub_cpi(maps: &dyn Maps, index: usize) -> SubCpi {
    let header = &maps.headers()[index];
    sub_cpi_of(header)
}

/// Half side of the largest square around a patch centre whose corners lie within the gates of all its maps, including the
/// margin of the smallest kernel.
fn half_side_m(maps: &dyn Maps, patch: &PatchMaps) -> f64 {
    let setup = &maps.run().setup;
    let margin = Kernels::margin(TAPS[0]) as f64;
    let bins = |reach: u16| (f64::from(reach) - margin).max(0.0);
    let path_m = bins(patch.patch.range_reach) * SPEED_OF_LIGHT_M_S
        / (f64::from(setup.range_length) * setup.step_hz);
    let rate_m = bins(patch.patch.doppler_reach) * SPEED_OF_LIGHT_M_S
        / (f64::from(setup.doppler_length) * setup.centre_hz());
    let centre = DVec3::from(patch.patch.centre_m);
    let sides = patch.maps.iter().map(|&index| {
        let [x, y] = gradients(&sub_cpi(maps, index), centre);
        // Corners have the largest path and rate; a zero gradient sets no limit.
        (path_m / (x.0.abs() + y.0.abs())).min(rate_m / (x.1.abs() + y.1.abs()))
    });
    sides.fold(f64::INFINITY, f64::min)
}

/// Phase error in radians that the linear path model may cause within `error_db`: what the kernels and the module's
/// arithmetic leave. Infinite if these alone exceed the bound, since a smaller grid would not help.
fn line_share(maps: &dyn Maps, error_db: f64) -> f64 {
    let others = Kernels::for_bound(&maps.run().setup, error_db).error;
    let others = others.hypot(arithmetic_error(maps));
    let bound = 10f64.powf(error_db / 20.0);
    match bound > others {
        true => (bound * bound - others * others).sqrt(),
        false => f64::INFINITY,
    }
}

/// Half side, at most `half_m`, of a square on which the linear path model causes at most `allowed` in every probed map. The
/// error grows at least linearly with the side, so one proportional step suffices.
fn accurate_half_side_m(maps: &dyn Maps, patch: &PatchMaps, half_m: f64, allowed: f64) -> f64 {
    let centre = DVec3::from(patch.patch.centre_m);
    let places = || (-2..=2).map(|i| f64::from(i) / 2.0 * half_m);
    let points: Vec<DVec3> = places()
        .flat_map(|y| places().map(move |x| centre + DVec3::new(x, y, 0.0)))
        .collect();
    let left = probe(maps, patch, |_| points.clone());
    match left > allowed {
        true => half_m * allowed / left,
        false => half_m,
    }
}

/// Spatial frequencies at the ends of a map's slow-time and frequency axes, in cycles per metre.
fn wave_vectors(maps: &dyn Maps, index: usize, centre: DVec3) -> [DVec3; 4] {
    let setup = &maps.run().setup;
    let sub_cpi = sub_cpi(maps, index);
    let [x, y] = gradients(&sub_cpi, centre);
    let last_hz = setup.start_hz + f64::from(setup.num_frequencies) * setup.step_hz;
    let half = sub_cpi.num_pulses() as f64 / 2.0;
    let at = |u: f64, f_hz: f64| {
        DVec3::new(x.0 + x.1 * u, y.0 + y.1 * u, 0.0) * (f_hz / SPEED_OF_LIGHT_M_S)
    };
    [
        at(-half, setup.start_hz),
        at(-half, last_hz),
        at(half, setup.start_hz),
        at(half, last_hz),
    ]
}
