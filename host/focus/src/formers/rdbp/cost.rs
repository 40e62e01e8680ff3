//! Cost of sub-CPIs with `M` pulses of `K` frequencies each.
//!
//! ```text
//! thesis   a pixel and sub-CPI: path and rate 34, place 5, bilinear 18, phasor 23, sum 8              88
//!          a sub-CPI: Keystone 4 K M^2, K transforms over Doppler, one over range for each of its bins
//! precise  a pixel and sub-CPI: two paths 22, place 5, kernel 8 W + 4 W^2, phasor 21, sum 8           56 + 8 W + 4 W^2
//!          a patch and sub-CPI: compensation 8 M K, Doppler 4 M D K or 2 K transforms of M + D, D transforms of 2 K
//! ```
//!
//! with `D` Doppler bins and kernels of `W` taps. With intra-pulse motion each sample has its own path and phasor:
//! compensation takes 60 M K. The thesis mode's maps cover the whole scene and are shared by all tiles; the precise
//! mode's maps cover one patch, and tiles share none if their edges coincide with patch edges.

use super::doppler::PULSE_BYTES;
use super::layout::Layout;
use super::mapper::{MAPS, PIXELS, Shapes};
use super::times::{by_product, map_ns, pixel_ns, table_bytes};
use crate::ImageSpec;
use crate::cost::{Copies, Cost, StageCost, transform};
use crate::patch::Patches;
use subaperture_kernels::map::row_length;

/// Operations per pixel and sub-CPI of the thesis mode.
const THESIS_PIXEL: f64 = 88.0;
/// Operations per pixel and sub-CPI of the precise mode without the kernel.
const PRECISE_PIXEL: f64 = 56.0;
/// Operations of compensating a sample to a patch centre: without, and with intra-pulse motion.
const COMPENSATION: [f64; 2] = [8.0, 60.0];

/// Cost of the thesis mode with the given layout.
pub(super) fn thesis(spec: &ImageSpec, layout: &Layout, keystone: bool) -> Cost {
    let (k, m) = (layout.band.count as f64, layout.longest as f64);
    let (doppler, range) = (layout.doppler_length as f64, layout.range_length as f64);
    let resampling = if keystone { 4.0 * k * m * m } else { 0.0 };
    let map = resampling + k * transform(doppler) + doppler * transform(range);
    let sub_cpis = layout.sub_cpis.len() as f64;
    let pixels = THESIS_PIXEL * spec.grid.num_pixels() as f64;
    let model = spec.numerics.model;
    let maps_ns = k * model.transform(doppler) + doppler * model.transform(range);
    let pixel_ns = model.map_pixel_ns * spec.grid.num_pixels() as f64;
    let cost = Cost::of([
        // An operation of the Keystone transform takes a fourth of a tap's time.
        StageCost::shared(
            MAPS,
            sub_cpis * map,
            sub_cpis * (maps_ns + 0.25 * model.map_tap_ns * resampling),
        ),
        StageCost::new(PIXELS, sub_cpis * pixels, sub_cpis * pixel_ns),
    ]);
    let cost = cost.holding("map", Copies::Pass, 8.0 * doppler * (range + k));
    let cost = match keystone {
        true => cost.holding("Keystone weights", Copies::Pass, 4.0 * k * m * m),
        false => cost,
    };
    cost.holding("a sub-CPI", Copies::Pass, 8.0 * k * m)
}

/// Cost of the precise mode; `sub_cpis` are the lengths, `held` the buffered pulses.
pub(super) fn precise(
    spec: &ImageSpec,
    sub_cpis: &[usize],
    shapes: &Shapes,
    patches: &Patches,
    taps: usize,
    held: usize,
) -> Cost {
    let k = spec.collection.num_samples as f64;
    let compensation = COMPENSATION[usize::from(spec.collection.sweeps())];
    let taps = taps as f64;
    let pixel = PRECISE_PIXEL + 8.0 * taps + 4.0 * taps * taps;
    let (num_pixels, sub_cpi_count) = (spec.grid.num_pixels() as f64, sub_cpis.len() as f64);
    let model = spec.numerics.model;
    let count = patches.count() as f64;
    let (mut maps, mut maps_ns) = (0.0, 0.0);
    for length in sub_cpis {
        let shape = &shapes[length].0;
        let (m, bins) = (*length as f64, shape.outputs as f64);
        let doppler = match by_product(model, shape) {
            true => 4.0 * m * bins,
            false => 2.0 * transform(m + bins),
        };
        let map = compensation * m * k + k * doppler + bins * transform(2.0 * k);
        maps += count * map;
        maps_ns += count * map_ns(model, m, k, bins);
    }
    let read = sub_cpi_count * num_pixels;
    let shapes = || shapes.values().map(|(shape, _)| shape);
    let tables = shapes().map(|shape| table_bytes(model, spec.collection.num_samples, shape));
    let map = shapes().map(|shape| {
        let (m, bins) = (shape.inputs as f64, shape.outputs as f64);
        // One additional row is being transformed.
        8.0 * (bins + 1.0) * row_length((2.0 * k) as usize) as f64 + m * PULSE_BYTES as f64
    });
    Cost::of([
        StageCost::new(MAPS, maps, maps_ns),
        StageCost::new(PIXELS, read * pixel, read * pixel_ns(model, taps)),
    ])
    .holding("Doppler tables", Copies::Image, tables.sum::<u64>() as f64)
    .holding("map", Copies::Thread, map.fold(0.0, f64::max))
    .holding("pulses", Copies::Pass, 8.0 * k * held as f64)
}
