//! Transform of the pulses to the along-track spectrum.

use num_complex::Complex32;
use rayon::prelude::*;

use super::cost::{COMPENSATION, SPECTRUM};
use super::motion::Profiles;
use super::motion::uneven::Uneven;
use super::motion::warp::Warp;
use super::{RangeMethod, Strip, step_done};
use crate::read_ahead::{blocks_of, read_ahead, read_ahead_into};
use crate::{FormError, Work};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::during;
use subaperture_signal::phase::{narrow, phasor};

/// Pulses read at a time.
pub(super) const BLOCK_PULSES: usize = 64;

/// Transform weighted samples over slow time after motion compensation to the line and phase reference to path zero:
/// `[K][Q]`, `sum_n exp(-j kx_q (s_n - s_0)) w_k v_n z[n][k] exp(-j 2 pi f_k (reference_path_n - excess_n) / c)`.
pub(super) fn along_track<M: RangeMethod>(
    strip: &Strip<M>,
    work: &Work,
) -> Result<Vec<Complex32>, FormError> {
    let (motion, axes) = (&strip.fitted.motion, &strip.fitted.axes);
    let transforms = strip.spec.numerics.transforms;
    let uneven = motion.positions.is_uneven().then(|| {
        let from_first_m = |n| motion.positions.along_m(n) - motion.positions.span_m()[0];
        let places_m = (0..motion.positions.track.num_pulses).map(from_first_m);
        Uneven::new(places_m, axes.period_m, axes.num_bins)
    });
    let samples = match motion.profiles() {
        Some(profiles) => warped(strip, profiles, work)?,
        None => moved(strip, work)?,
    };
    let num_pulses = motion.positions.track.num_pulses;
    let fft = transforms.forward(axes.slow_length);
    let mut spectrum = vec![Complex32::ZERO; axes.wavenumbers.len() * axes.num_bins];
    let scratch = || {
        let line = vec![Complex32::ZERO; axes.slow_length];
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
            let of_pulses = (0..num_pulses).map(|n| samples[n * axes.wavenumbers.len() + k]);
            if let Some(uneven) = &uneven {
                uneven.spread(of_pulses, line);
                fft.process_with_scratch(line, scratch);
                uneven.kept(line, bins);
                return;
            }
            for (value, sample) in line.iter_mut().zip(of_pulses) {
                *value = sample;
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

/// All samples `[N][K]`, weighted, compensated to the line for one point, referred to path zero.
fn moved<M: RangeMethod>(strip: &Strip<M>, work: &Work) -> Result<Vec<Complex32>, FormError> {
    let (spec, motion) = (&strip.spec, &strip.fitted.motion);
    let collection = spec.collection;
    let num_samples = collection.num_samples;
    let num_pulses = collection.pulses.len();
    // Normalise before the transforms sum, so that large samples stay within float32.
    let norm = spec.weights.normalisation();
    let mut samples = vec![Complex32::ZERO; num_pulses * num_samples];
    read_ahead_into(work.history, BLOCK_PULSES, &mut samples, |pulses, rows| {
        rows.par_chunks_exact_mut(num_samples)
            .zip(pulses.clone())
            .for_each(|(row, n)| {
                let _moving = during(work.monitor, SPECTRUM);
                let pulse = &collection.pulses[n];
                let weight = spec.weights.slow[n] * norm;
                let delay_s = (pulse.reference_path_m - motion.excess_m(n)) / SPEED_OF_LIGHT_M_S;
                let turns = strip.fitted.turns(n);
                for (k, (z, w)) in row.iter_mut().zip(&spec.weights.fast).enumerate() {
                    let turn = phasor(turns - pulse.frequency_hz(k) * delay_s);
                    *z *= narrow(turn * (w * weight));
                }
            });
        step_done(work, 0.3 * pulses.end as f64 / num_pulses as f64)
    })?;
    Ok(samples)
}

/// Samples `[N][K']` with range-dependent motion compensation to the line.
fn warped<M: RangeMethod>(
    strip: &Strip<M>,
    profiles: &Profiles,
    work: &Work,
) -> Result<Vec<Complex32>, FormError> {
    let (spec, fitted) = (&strip.spec, &strip.fitted);
    let collection = spec.collection;
    let num_samples = collection.num_samples;
    let num_pulses = collection.pulses.len();
    let norm = spec.weights.normalisation();
    let size = fitted.axes.wavenumbers.len();
    let mut samples = vec![Complex32::ZERO; num_pulses * size];
    let warp = Warp::new(profiles, &fitted.wavenumbers, spec.numerics.transforms);
    let blocks = blocks_of(num_pulses, BLOCK_PULSES);
    read_ahead(work.history, blocks, |pulses, read| {
        let room = || (warp.room(), during(work.monitor, COMPENSATION));
        samples[pulses.start * size..pulses.end * size]
            .par_chunks_exact_mut(size)
            .zip(read.par_chunks_exact(num_samples))
            .zip(pulses.clone())
            .for_each_init(room, |(room, _), ((out, row), n)| {
                let pulse = &collection.pulses[n];
                let weights = (&spec.weights.fast[..], spec.weights.slow[n] * norm);
                warp.pulse((n, pulse), row, weights, fitted.turns(n), room, out);
            });
        step_done(work, 0.3 * pulses.end as f64 / num_pulses as f64)
    })?;
    Ok(samples)
}
