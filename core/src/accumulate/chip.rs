//! Coherent accumulation of patch maps into an image chip, one sub-CPI after another.
//!
//! **Equation** (for the map of [`crate::stream`]). A pixel's path relative to the patch centre is computed at the
//! header's two nodes, `early` and `late`, `u_g` pulses before and after the middle of the sub-CPI,
//! `u_g^2 = (M^2 - 1)/12`. Over the sub-CPI the path is approximated by the line through them:
//!
//! ```text
//! a = (early + late) / 2,   b = (late - early) / (2 u_g)
//! pixel += weight  map[-b D f_ref / c][a R step_hz / c]  exp(+j 2 pi f_ref a / c)
//! ```
//!
//! The map is interpolated between bins by a [`Kernel`]. A single pulse has `b = 0`.
//!
//! **Weights.** A map is a mean over its `M` pulses. If the weight of a map is `M` divided by the sum of all
//! pulses' weights, a scatterer of unit amplitude has amplitude 1 in the sum of all sub-CPIs, whatever their
//! lengths.
//!
//! **Neglected**: the curvature of the path relative to the patch centre beyond its least-squares line, and the
//! interpolation error of the kernel for `R >= 2F` and `D >= 2M`. A pixel is skipped if a tap with nonzero weight
//! lies outside the map: make the patch larger than the pixels' extent by half the kernel.
//!
//! **Output**: pixels, row-major. **Cost**: 8 bytes per pixel; per pixel and map two float64 square roots (four if
//! transmitter and receiver differ), one phasor, and `2 T^2 + 2 T` multiply-adds for `T` taps. **Accuracy** against
//! the exact sum over pulses and frequencies in float64, relative RMS over the chip, `R = 2F`, `D = 2M`, no windows
//! (`tests/stream/chip.rs`): -64.4 dB with 8 taps; -70.3 dB with 10 taps, where curvature alone contributes
//! -71.0 dB; -17.2 dB with bilinear interpolation of the same map.

use num_complex::Complex32;

use super::coherent::add_pixels;
use super::{Kernel, PixelGrid};
use crate::pulse::distance_m;
use crate::stream::{Node, PatchMap, Setup, node_offset_pulses};
use crate::{LengthError, SPEED_OF_LIGHT_M_S, Turns};

/// Interpolation kernel of the module's image chips: 10 taps, in 2560 bytes. Its RMS error along one axis is -79.8 dB for
/// `R >= 2F`, `D >= 2M` (`tests/stream/kernel.rs`).
pub type ChipKernel = Kernel<10, 64>;

/// Add `weight` times a patch map to the pixels of `grid`. Returns the number of pixels inside the map.
///
/// ```
/// use subaperture_core::Complex32;
/// use subaperture_core::accumulate::{ChipKernel, PixelGrid, add_patch_map};
/// use subaperture_core::stream::{MapHeader, MapSamples, Node, Patch, PatchMap, Setup};
///
/// let grid = PixelGrid {
///     origin_m: [0.0, 1000.0, 0.0],
///     column_step_m: [0.0; 3],
///     row_step_m: [0.0; 3],
///     num_columns: 1,
///     num_rows: 1,
/// };
/// let patch = Patch { centre_m: [0.0, 1000.0, 0.0], range_reach: 1, doppler_reach: 0 };
/// let header = MapHeader {
///     sub_cpi: 0,
///     patch_index: 0,
///     channel: 0,
///     num_pulses: 1,
///     patch,
///     time_s: [0.0; 2],
///     weight_sum: 1.0,
///     nodes: [Node::default(); 2],
/// };
/// let samples = [Complex32::ZERO, Complex32::I, Complex32::ZERO];
/// let map = PatchMap { header, samples: MapSamples::Float(&samples) };
/// let setup = Setup {
///     num_pulses: 1,
///     num_channels: 1,
///     num_frequencies: 2,
///     range_length: 4,
///     doppler_length: 2,
///     start_hz: 1e9,
///     step_hz: 1e6,
/// };
/// // The pixel is at the patch centre: on a bin and without phase.
/// let mut pixels = [Complex32::ZERO];
/// assert_eq!(add_patch_map(&mut pixels, &grid, &setup, &map, &ChipKernel::new(), 0.5)?, 1);
/// assert_eq!(pixels[0], Complex32::new(0.0, 0.5));
/// # Ok::<(), subaperture_core::LengthError>(())
/// ```
///
/// # Errors
/// [`LengthError`] if `pixels` does not have one element per pixel of the grid. Nothing is then written.
pub fn add_patch_map<const TAPS: usize, const PHASES: usize>(
    pixels: &mut [Complex32],
    grid: &PixelGrid,
    setup: &Setup,
    map: &PatchMap<'_>,
    kernel: &Kernel<TAPS, PHASES>,
    weight: f32,
) -> Result<usize, LengthError> {
    let line = Line::new(map);
    let wavenumber = setup.centre_hz() / SPEED_OF_LIGHT_M_S; // cycles a metre of path
    let doppler_bins = f64::from(setup.doppler_length) * wavenumber;
    let range_bins = f64::from(setup.range_length) * setup.step_hz / SPEED_OF_LIGHT_M_S;
    add_pixels(pixels, grid, |point_m| {
        let (a, b) = line.path_m(point_m);
        let value = interpolate(map, kernel, -b * doppler_bins, a * range_bins)?;
        Some(value * (Turns::from_f64(wavenumber * a).phasor() * weight))
    })
}

/// Linear approximation of the path over a sub-CPI, relative to the patch centre.
struct Line {
    nodes: [Node; 2],
    /// Paths from the nodes to the patch centre in metres.
    centre_paths_m: [f64; 2],
    /// Node offset `u_g` in pulses.
    offset_pulses: f64,
}

impl Line {
    fn new(map: &PatchMap<'_>) -> Self {
        let nodes = map.header.nodes;
        Self {
            nodes,
            centre_paths_m: nodes.map(|node| path_m(&node, map.header.patch.centre_m)),
            offset_pulses: node_offset_pulses(map.header.num_pulses.into()),
        }
    }

    /// `(a, b)`: relative path in the middle in metres, and its rate in metres per pulse.
    #[inline]
    fn path_m(&self, point_m: [f64; 3]) -> (f64, f64) {
        let relative_m = |i: usize| path_m(&self.nodes[i], point_m) - self.centre_paths_m[i];
        let (early, late) = (relative_m(0), relative_m(1));
        let rate = if self.offset_pulses > 0.0 {
            (late - early) / (2.0 * self.offset_pulses)
        } else {
            0.0
        };
        ((early + late) / 2.0, rate)
    }
}

/// Path from transmitter to point to receiver in metres. Takes one square root if both are at the same position.
#[inline]
fn path_m(node: &Node, point_m: [f64; 3]) -> f64 {
    let out_m = distance_m(node.transmitter_m, point_m);
    if node.receiver_m == node.transmitter_m {
        2.0 * out_m
    } else {
        out_m + distance_m(node.receiver_m, point_m)
    }
}

/// Interpolate the map at fractional bins from the patch centre. `None` if a tap with nonzero weight is outside.
#[inline]
fn interpolate<const TAPS: usize, const PHASES: usize>(
    map: &PatchMap<'_>,
    kernel: &Kernel<TAPS, PHASES>,
    doppler_bin: f64,
    range_bin: f64,
) -> Option<Complex32> {
    let patch = &map.header.patch;
    let (reach_d, reach_r) = (i32::from(patch.doppler_reach), i32::from(patch.range_reach));
    // Also rejects NaN.
    let inside = |bin: f64, reach: i32| libm::fabs(bin) <= f64::from(reach);
    if !(inside(doppler_bin, reach_d) && inside(range_bin, reach_r)) {
        return None;
    }
    let (first_d, weights_d) = kernel.place(doppler_bin);
    let (first_r, weights_r) = kernel.place(range_bin);
    let rows = (first_d..).zip(&weights_d);
    let (width, taps) = (patch.num_range_bins(), TAPS as i32);
    let whole = first_r >= -reach_r && first_r + taps - 1 <= reach_r;
    let mut value = Complex32::ZERO;
    for (d, weight_d) in rows {
        if *weight_d == 0.0 {
            continue;
        }
        if d < -reach_d || d > reach_d {
            return None;
        }
        let along_range = if whole {
            let (row, first) = ((d + reach_d) as usize, (first_r + reach_r) as usize);
            map.samples.weighted(width, row, first, &weights_r)?
        } else {
            interpolate_at_edge(map, d, first_r, &weights_r)?
        };
        value += along_range * *weight_d;
    }
    Some(value)
}

/// Weighted sum at the edge of a row, where taps may be outside the map.
#[cold]
fn interpolate_at_edge(
    map: &PatchMap<'_>,
    d: i32,
    first: i32,
    weights: &[f32],
) -> Option<Complex32> {
    let reach = i32::from(map.header.patch.range_reach);
    let mut sum = Complex32::ZERO;
    for (r, weight) in (first..).zip(weights) {
        if *weight == 0.0 {
            continue;
        }
        if r < -reach || r > reach {
            return None;
        }
        sum += map.at(d, r) * *weight;
    }
    Some(sum)
}
