//! Per-pulse contributions to small patches around the brightest points, for fast evaluation of phase corrections.
//!
//! The value of pixel `p` is `sum_n b_n(p) exp(-j psi_n)`, with the backprojection `b_n(p)` of pulse `n` and the phase correction
//! `psi_n`. For a displacement `d` of the radar, `psi = k s . d` with the line of sight `s` from the
//! patch's centre, which hardly changes within a patch of a few cells. Patches are formed again in each round of autofocus.
//!
//! Memory: 8 bytes per pixel and pulse. Range profiles are interpolated linearly with the error bound [`ERROR_DB`]. Intra-pulse motion is
//! included as a shift of the range profile (range-Doppler coupling); its blur is neglected.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use subaperture_fft::Transforms;
use subaperture_focus::FormError;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::ImageGrid;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{PhaseHistory, Pulse};
use subaperture_model::resolution::support::path_gradient;
use subaperture_signal::phase::{cis, narrow, phasor32, widen};
use subaperture_signal::range_profile::RangeProfiler;

use super::echoes::wavenumber_rad_m;

/// Error bound of range profiles, dB: too small to move a maximum.
const ERROR_DB: f64 = -45.0;

/// Number of pulses summed in float32, with an error of at most 1e-6.
const PULSES_A_RUN: usize = 16;

/// Memory of range profiles in use, bytes.
const BLOCK_BYTES: usize = 16 << 20;

/// Part of an image as contributions of single pulses.
pub(crate) struct Patch {
    /// Number of pixels.
    pub(crate) count: usize,
    /// Contribution of pulse `n` to pixel `i`, at `n * count + i`.
    values: Vec<Complex32>,
    /// Derivatives of the phase of each pulse by displacement along x, y and z: `k s`, radians per metre.
    pub(crate) slopes: Vec<DVec3>,
    /// Power of all values.
    power: f64,
}

/// Memory of patches, bytes.
pub(crate) fn bytes(patches: usize, pixels: usize, pulses: usize) -> u64 {
    (patches * pulses) as u64 * (8 * pixels as u64 + size_of::<DVec3>() as u64)
}

/// Pixels around a place: `size` rows and columns, clipped to the grid.
pub(crate) fn pixels_around(grid: &ImageGrid, place_m: DVec3, size: usize) -> Vec<DVec3> {
    let [row, column] = grid.coordinates(place_m);
    let span = |value: f64, axis: &subaperture_model::geometry::Axis| {
        let middle = ((value - axis.start) / axis.step).round().max(0.0) as usize;
        let first = middle.saturating_sub(size / 2);
        first..(first + size).min(axis.count)
    };
    let columns = span(column, &grid.columns);
    span(row, &grid.rows)
        .flat_map(|row| columns.clone().map(move |column| (row, column)))
        .map(|(row, column)| grid.position_m(row, column))
        .collect()
}

/// Form the patches of these pixels.
///
/// # Errors
/// [`FormError`]: pulses cannot be read, or the monitor cancelled.
pub(crate) fn patches(
    history: &dyn PhaseHistory,
    fast: &[f64],
    pixels: &[Vec<DVec3>],
    monitor: &dyn Monitor,
) -> Result<Vec<Patch>, FormError> {
    let collection = history.collection();
    let (count, width) = (collection.pulses.len(), collection.num_samples);
    let profiler = RangeProfiler::new(
        1,
        fast,
        RangeProfiler::oversampling_for(1, ERROR_DB),
        Transforms::Fastest,
    );
    let length = profiler.length();
    let scale = (1.0 / (fast.iter().sum::<f64>() * count as f64)) as f32;
    let mut patches: Vec<Patch> = pixels
        .iter()
        .map(|pixels| Patch {
            count: pixels.len(),
            values: Vec::with_capacity(pixels.len() * count),
            slopes: Vec::with_capacity(count),
            power: 0.0,
        })
        .collect();
    let run = (BLOCK_BYTES / (8 * (length + 1 + width))).clamp(1, count);
    let mut samples = vec![Complex32::ZERO; run * width];
    let mut profiles = vec![Complex32::ZERO; run * (length + 1)];
    for start in (0..count).step_by(run) {
        if monitor.cancelled() {
            return Err(FormError::Cancelled);
        }
        let pulses = &collection.pulses[start..(start + run).min(count)];
        let block = &mut samples[..pulses.len() * width];
        history.read(start..start + pulses.len(), block)?;
        block
            .par_chunks_exact(width)
            .zip(profiles.par_chunks_exact_mut(length + 1))
            .for_each(|(pulse, profile)| {
                let mut scratch = vec![Complex32::ZERO; profiler.scratch_length()];
                profiler.profile(pulse, profile, &mut scratch);
            });
        patches
            .par_iter_mut()
            .zip(pixels)
            .for_each(|(patch, pixels)| {
                let middle_m = pixels.iter().sum::<DVec3>() / pixels.len().max(1) as f64;
                for (pulse, profile) in pulses.iter().zip(profiles.chunks_exact(length + 1)) {
                    let hz = pulse.frequency_hz(width / 2);
                    let value = |point: &DVec3| read(pulse, profile, hz, *point) * scale;
                    patch.values.extend(pixels.iter().map(value));
                    let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, middle_m);
                    patch
                        .slopes
                        .push(wavenumber_rad_m(collection, pulse) * gradient);
                }
            });
    }
    for patch in &mut patches {
        patch.power = patch.values.iter().map(|z| f64::from(z.norm_sqr())).sum();
    }
    Ok(patches)
}

/// Contribution of a pulse at a point.
fn read(pulse: &Pulse, profile: &[Complex32], hz: f64, point: DVec3) -> Complex32 {
    let terms = pulse.path_terms(point, DVec3::ZERO) - pulse.reference_terms();
    let length = profile.len() - 1;
    // Range and Doppler are coupled where antennas move from sample to sample.
    let path_m = terms.path_m + hz * terms.rate_m / pulse.step_hz;
    let at = path_m * pulse.step_hz / SPEED_OF_LIGHT_M_S;
    let at = (at - at.floor()) * length as f64;
    let index = (at as usize).min(length - 1);
    let part = (at - index as f64) as f32;
    let value = profile[index] * (1.0 - part) + profile[index + 1] * part;
    value * phasor32(hz * terms.path_m / SPEED_OF_LIGHT_M_S)
}

impl Patch {
    /// Factor that normalises the incoherent power of the pulses to 1, so that patches of different brightness have equal weight.
    pub(crate) fn scale(&self) -> f64 {
        match self.power > 0.0 {
            true => 1.0 / self.power,
            false => 0.0,
        }
    }

    /// Pixels after correction of the phases.
    pub(crate) fn image(&self, phases_rad: &[f64]) -> Vec<Complex64> {
        let count = self.count.max(1);
        let mut image = vec![Complex64::ZERO; self.count];
        let mut some = vec![Complex32::ZERO; self.count];
        // Sum blocks of pulses in float32, and the blocks in float64.
        let runs = self.values.chunks(count * PULSES_A_RUN);
        for (values, phases_rad) in runs.zip(phases_rad.chunks(PULSES_A_RUN)) {
            some.fill(Complex32::ZERO);
            for (values, &phase) in values.chunks_exact(count).zip(phases_rad) {
                let phasor = narrow(cis(-phase));
                some.iter_mut()
                    .zip(values)
                    .for_each(|(sum, value)| *sum += value * phasor);
            }
            image
                .iter_mut()
                .zip(&some)
                .for_each(|(sum, some)| *sum += widen(*some));
        }
        image
    }

    /// Derivatives of a figure by the phase of every pulse, from those by the power of every pixel:
    /// `d |I|^2 / d psi = 2 Re (I* (-j) b exp(-j psi)) = 2 Im (I* b exp(-j psi))`.
    pub(crate) fn by_phases(
        &self,
        image: &[Complex64],
        by_power: &[f64],
        phases_rad: &[f64],
    ) -> Vec<f64> {
        // In float32 with a common scale against underflow.
        let pull = |(z, &by): (&Complex64, &f64)| z.conj() * by;
        let most = image
            .iter()
            .zip(by_power)
            .map(|pair| pull(pair).norm_sqr())
            .fold(0.0, f64::max)
            .sqrt()
            .max(f64::MIN_POSITIVE);
        let pulled: Vec<Complex32> = image
            .iter()
            .zip(by_power)
            .map(|pair| narrow(pull(pair) / most))
            .collect();
        let pulses = self.values.chunks_exact(self.count.max(1));
        pulses
            .zip(phases_rad)
            .map(|(values, &phase)| {
                let sum: Complex32 = values.iter().zip(&pulled).map(|(b, z)| b * z).sum();
                2.0 * most * (widen(sum) * cis(-phase)).im
            })
            .collect()
    }
}
