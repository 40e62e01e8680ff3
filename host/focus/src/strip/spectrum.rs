//! Pulses to their spectrum along the track.

use num_complex::Complex32;
use rayon::prelude::*;

use super::cost::SPECTRUM;
use super::{RangeMethod, Strip, step_done};
use crate::read_ahead::read_ahead_into;
use crate::{FormError, Work};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::during;
use subaperture_signal::phase::{narrow, phasor};

/// Pulses read at once.
const BLOCK_PULSES: usize = 64;

/// Weighted samples, moved to the line and referred to path zero, transformed over slow time:
/// `[K][Q]`, `sum_n exp(-j kx_q n d) w_k v_n z[n][k] exp(-j 2 pi f_k (reference_path_n - excess_n) / c)`.
pub(super) fn along_track<M: RangeMethod>(
    strip: &Strip<M>,
    work: &Work,
) -> Result<Vec<Complex32>, FormError> {
    let samples = on_the_line(strip, work)?;
    let axes = &strip.axes;
    let num_pulses = strip.track.num_pulses;
    let fft = strip.aim.means.transforms.forward(axes.period);
    let mut spectrum = vec![Complex32::ZERO; axes.wavenumbers.len() * axes.num_bins];
    let scratch = || {
        let line = vec![Complex32::ZERO; axes.period];
        let scratch = vec![Complex32::ZERO; fft.get_inplace_scratch_len()];
        (line, scratch, during(work.monitor, SPECTRUM))
    };
    spectrum
        .par_chunks_exact_mut(axes.num_bins)
        .enumerate()
        .for_each_init(scratch, |(line, scratch, _), (k, bins)| {
            if work.monitor.cancelled() {
                return;
            }
            for (n, value) in line[..num_pulses].iter_mut().enumerate() {
                *value = samples[n * axes.wavenumbers.len() + k];
            }
            line[num_pulses..].fill(Complex32::ZERO);
            fft.process_with_scratch(line, scratch);
            for (q, bin) in (axes.first_bin..).zip(bins) {
                *bin = line[q.rem_euclid(axes.period as i64) as usize];
            }
        });
    step_done(work, 0.4)?;
    Ok(spectrum)
}

/// All samples `[N][K]`, weighted, on the line, referred to path zero.
fn on_the_line<M: RangeMethod>(strip: &Strip<M>, work: &Work) -> Result<Vec<Complex32>, FormError> {
    let Strip { aim, track, .. } = strip;
    let collection = aim.collection;
    let num_samples = collection.num_samples;
    let num_pulses = collection.pulses.len();
    // Normalised here, before transforms sum: large samples stay within float32.
    let norm = aim.weights.normalisation();
    let mut samples = vec![Complex32::ZERO; num_pulses * num_samples];
    read_ahead_into(work.history, BLOCK_PULSES, &mut samples, |pulses, rows| {
        rows.par_chunks_exact_mut(num_samples)
            .zip(pulses.clone())
            .for_each(|(row, n)| {
                let _moving = during(work.monitor, SPECTRUM);
                let pulse = &collection.pulses[n];
                let weight = aim.weights.slow[n] * norm;
                let excess_m = track.excess_path_m(n, pulse, strip.reference);
                let delay_s = (pulse.reference_path_m - excess_m) / SPEED_OF_LIGHT_M_S;
                for (k, (z, w)) in row.iter_mut().zip(&aim.weights.fast).enumerate() {
                    *z *= narrow(phasor(-pulse.frequency_hz(k) * delay_s) * (w * weight));
                }
            });
        step_done(work, 0.3 * pulses.end as f64 / num_pulses as f64)
    })?;
    Ok(samples)
}
