//! Phase histories of points in exact geometry.
//!
//! The history of a point `p` is the recording compensated to `p` and compressed in range there,
//!
//! ```text
//! h_n(p) = sum_k w_k z[n][k] exp(+j 2 pi f_k (path_n(p) - reference_path_n) / c) / sum_k w_k
//! ```
//!
//! which is the term of pulse `n` in the sum of the pixel at `p`. A scatterer at `p` contributes a constant times the phasor of its phase
//! error. Other scatterers of its range cell rotate at a rate proportional to their cross-range distance. `h(p)` over the pulses
//! corresponds to a range bin of conventional PGA after circular shift and inverse transform. No transform
//! relates image and pulses here, and no far-field geometry is assumed: paths are exact for each pulse's antennas, in the near field
//! and over any angle, for images of any former, and no spectrum alignment is
//! needed (C 6.3.3: the phase that (6.10) restores is never removed).
//!
//! Each channel gives a separate history. Phases between channels do not matter.
//!
//! Points are the brightest pixels of the image, one per range bin (C 6.5: "argmax of the amplitude") of two range cells at
//! the centre of the aperture, within a given number of dB of the brightest: C's mask. There is one per bin because side
//! lobes and the blur of a point lie in its own bin and would count as points at another angle. Over wide angles they lie on
//! arcs of constant range from the antennas of each pulse, which leave the bin. A pixel therefore counts only if it lies outside
//! the range cells of every brighter point in nearly all pulses.

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;

use subaperture_focus::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::image::{Image, power};
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Collection, PhaseHistory, Pulse};
use subaperture_model::resolution::support::path_gradient;
use subaperture_signal::phase::{phasor, widen};

/// Bytes of samples read at a time.
const BLOCK_BYTES: usize = 16 << 20;

/// Range cells per bin.
const CELLS_A_BIN: f64 = 2.0;

/// Pulses used to separate points, and the fraction of them in which two points must lie in different range cells.
const PROBED_PULSES: usize = 32;
const APART: f64 = 0.85;

/// Selection of the points for histories, by number and brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    /// Largest number of points, brightest first.
    pub most: usize,
    /// Largest level below the brightest point, dB, positive.
    pub within_db: f64,
}

/// History of a point in one channel.
#[derive(Clone, Debug)]
pub(crate) struct Echo {
    /// Index of the point.
    pub(crate) point: usize,
    /// Index of the channel's first pulse.
    pub(crate) first: usize,
    /// Values, one per turn of the radar.
    pub(crate) values: Vec<Complex64>,
}

impl Echo {
    /// Power of the scatterer, assumed constant, and of noise and other scatterers, from the second and fourth moments of the
    /// values: for Gaussian noise of power `s`, `E |h|^2 = a + s` and `E |h|^4 = a^2 + 4 a s + 2 s^2`, so that
    /// `a^2 = 2 (E |h|^2)^2 - E |h|^4`. The noise is at least a hundredth of the total.
    pub(crate) fn signal_and_rest(&self) -> [f64; 2] {
        let count = self.values.len().max(1) as f64;
        let powers = || self.values.iter().map(|h| h.norm_sqr());
        let second = powers().sum::<f64>() / count;
        let fourth = powers().map(|p| p * p).sum::<f64>() / count;
        let signal = (2.0 * second * second - fourth).max(0.0).sqrt();
        [signal, (second - signal).max(0.01 * second)]
    }
}

/// Two-way path of a range cell, `c / bandwidth`, metres.
pub(crate) fn cell_path_m(collection: &Collection) -> f64 {
    let middle = &collection.pulses[collection.num_turns() / 2];
    SPEED_OF_LIGHT_M_S / (collection.num_samples as f64 * middle.step_hz)
}

/// Wavenumber at the reference frequency of a pulse, radians per metre of path.
pub(crate) fn wavenumber_rad_m(collection: &Collection, pulse: &Pulse) -> f64 {
    let hz = pulse.frequency_hz(collection.num_samples / 2);
    std::f64::consts::TAU * hz / SPEED_OF_LIGHT_M_S
}

/// Brightest pixel of every range bin, in descending order.
pub(crate) fn brightest(
    collection: &Collection,
    grid: &ImageGrid,
    image: &Image,
    points: Points,
) -> Vec<DVec3> {
    let middle = &collection.pulses[collection.num_turns() / 2];
    let bin_m = CELLS_A_BIN * cell_path_m(collection);
    let mut bins = std::collections::BTreeMap::<i64, (f64, DVec3)>::new();
    let mut most = 0.0f64;
    for (index, &pixel) in image.pixels.iter().enumerate() {
        let power = power(pixel);
        if !power.is_finite() || power <= 0.0 {
            continue;
        }
        most = most.max(power);
        let place_m = grid.position_m(index / image.columns, index % image.columns);
        let bin = (middle.path_m(place_m) / bin_m).floor() as i64;
        let best = bins.entry(bin).or_insert((power, place_m));
        if power > best.0 {
            *best = (power, place_m);
        }
    }
    let floor = most * libm::pow(10.0, -points.within_db / 10.0);
    let mut found: Vec<(f64, DVec3)> = bins.into_values().filter(|bin| bin.0 >= floor).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let turns = collection.num_turns();
    let probed: Vec<&Pulse> = (0..PROBED_PULSES.min(turns))
        .map(|i| &collection.pulses[i * turns / PROBED_PULSES.min(turns)])
        .collect();
    let paths =
        |place_m: DVec3| -> Vec<f64> { probed.iter().map(|pulse| pulse.path_m(place_m)).collect() };
    let mut kept: Vec<(Vec<f64>, DVec3)> = Vec::new();
    for (_, place_m) in found {
        if kept.len() == points.most {
            break;
        }
        let paths_m = paths(place_m);
        let apart = |(others_m, _): &(Vec<f64>, DVec3)| {
            let pairs = paths_m.iter().zip(others_m);
            let apart = pairs
                .filter(|(a, b)| (*a - *b).abs() >= 0.75 * bin_m)
                .count();
            apart as f64 >= APART * probed.len() as f64
        };
        if kept.iter().all(apart) {
            kept.push((paths_m, place_m));
        }
    }
    kept.into_iter().map(|(_, place_m)| place_m).collect()
}

/// Histories of points in all channels, point by point.
pub(crate) fn echoes(
    history: &dyn PhaseHistory,
    fast: &[f64],
    points: &[DVec3],
    monitor: &dyn Monitor,
) -> Result<Vec<Echo>, FormError> {
    let collection = history.collection();
    let (count, width) = (collection.pulses.len(), collection.num_samples);
    let turns = collection.num_turns();
    let channels = count / turns;
    let mut echoes: Vec<Echo> = (0..points.len() * channels)
        .map(|i| Echo {
            point: i / channels,
            first: i % channels * turns,
            values: vec![Complex64::ZERO; turns],
        })
        .collect();
    let run = (BLOCK_BYTES / (8 * width)).clamp(1, count);
    let mut samples = vec![num_complex::Complex32::ZERO; run * width];
    for start in (0..count).step_by(run) {
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let end = (start + run).min(count);
        let block = &mut samples[..(end - start) * width];
        history.read(start..end, block)?;
        let said: Vec<Vec<Complex64>> = block
            .par_chunks_exact(width)
            .zip(&collection.pulses[start..end])
            .map(|(pulse, geometry)| responses(geometry, fast, pulse, points))
            .collect();
        for (n, values) in (start..end).zip(said) {
            for (point, value) in values.into_iter().enumerate() {
                echoes[point * channels + n / turns].values[n % turns] = value;
            }
        }
    }
    Ok(echoes)
}

/// Response of a pulse at every point.
fn responses(
    pulse: &Pulse,
    fast: &[f64],
    samples: &[num_complex::Complex32],
    points: &[DVec3],
) -> Vec<Complex64> {
    let scale = 1.0 / fast.iter().sum::<f64>();
    let at = |point: &DVec3| -> Complex64 {
        let weighted = || samples.iter().zip(fast);
        if !pulse.sweep.is_at_once() {
            let middle = (samples.len() / 2) as f64;
            let term = |(k, (z, w)): (usize, (&num_complex::Complex32, &f64))| {
                let path_m = pulse.relative_path_after_m(*point, k as f64 - middle);
                widen(*z) * phasor(pulse.frequency_hz(k) * path_m / SPEED_OF_LIGHT_M_S) * *w
            };
            return weighted().enumerate().map(term).sum::<Complex64>() * scale;
        }
        let delay_s = pulse.relative_path_m(*point) / SPEED_OF_LIGHT_M_S;
        let mut turning = phasor(pulse.start_hz * delay_s);
        let step = phasor(pulse.step_hz * delay_s);
        let mut sum = Complex64::ZERO;
        for (z, w) in weighted() {
            sum += widen(*z) * turning * *w;
            // The rounding error grows by 1e-16 per sample.
            turning *= step;
        }
        sum * scale
    };
    points.iter().map(at).collect()
}

/// Derivative of the path of each turn of a channel by the point's position: `u_t + u_r`.
pub(crate) fn gradients(collection: &Collection, echo: &Echo, place_m: DVec3) -> Vec<DVec3> {
    let pulses = &collection.pulses[echo.first..echo.first + echo.values.len()];
    let of = |pulse: &Pulse| path_gradient(pulse.transmitter_m, pulse.receiver_m, place_m);
    pulses.iter().map(of).collect()
}
