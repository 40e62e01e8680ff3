//! Single-core times of maps and pixels by the timing model, and choice of the Doppler transform algorithm.

use crate::TimeModel;
use subaperture_kernels::doppler::{DopplerProduct, MAX_REACH};
use subaperture_signal::scaled_dft::{ScaledDft, Shape};

/// Time of one frequency's Doppler transform of `bins` from `m` pulses by matrix product and by chirp-z, ns.
fn doppler_ns(model: &TimeModel, m: f64, bins: f64) -> [f64; 2] {
    let length = m + bins;
    let transform = model.map_transform_ns * length * libm::log2(length.max(2.0));
    [model.doppler_tap_ns * m * bins, 2.0 * transform]
}

/// Whether the matrix product is faster.
pub(super) fn by_product(model: &TimeModel, shape: &Shape) -> bool {
    let [product, chirp] = doppler_ns(model, shape.inputs as f64, shape.outputs as f64);
    DopplerProduct::suits(shape) && product <= chirp
}

/// Size of a transform's table, bytes.
pub(super) fn table_bytes(model: &TimeModel, frequencies: usize, shape: &Shape) -> u64 {
    match by_product(model, shape) {
        true => DopplerProduct::table_bytes(frequencies, shape.inputs),
        false => ScaledDft::table_bytes(frequencies, shape.inputs, shape.outputs),
    }
}

/// Time of a patch's map of `bins` from `m` pulses of `k` samples (compensation, Doppler, range), ns.
pub(super) fn map_ns(model: &TimeModel, m: f64, k: f64, bins: f64) -> f64 {
    let [product, chirp] = doppler_ns(model, m, bins);
    let doppler = match bins <= (2 * MAX_REACH + 1) as f64 {
        true => product.min(chirp),
        false => chirp,
    };
    model.compensation_ns * m * k + k * doppler + bins * model.transform(2.0 * k)
}

/// Time of interpolating a pixel with the given number of taps, ns.
pub(super) fn pixel_ns(model: &TimeModel, taps: f64) -> f64 {
    model.map_pixel_ns + model.map_tap_ns * taps * taps
}
