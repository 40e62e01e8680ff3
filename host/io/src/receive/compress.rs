//! Pulse compression: conversion of echoes of a known pulse into flat phase history.
//!
//! With `P[m]` the pulse's discrete spectrum, and an echo with delay `tau` in a receive window that starts at `t_w`,
//! the spectrum of the raw samples at `f_m` above the centre frequency `f_c` is
//!
//! ```text
//! S[m] = P[m] exp(-j 2 pi (f_c + f_m)(tau - t_w)) exp(-j 2 pi f_c t_w)
//! z[m] = W[m] S[m] exp(+j 2 pi ((f_c + f_m)(reference_path / c - t_w) + f_c t_w))
//! ```
//!
//! With `W P = 1`, the result is `exp(-j 2 pi (f_c + f_m)(tau - tau_ref))`, the definition of phase history.
//!
//! - [`Filter::Inverse`]: `W = conj(P) / max(|P|^2, 1e-4 mean |P|^2)`, flat over the band except where the pulse has
//!   almost no power. White noise of power `s^2` per raw sample becomes `N s^2 / |P[m]|^2`: it is amplified where the
//!   pulse is weak.
//! - [`Filter::Matched`]: `W = conj(P) / mean |P|^2`, with the mean over the band: the highest signal-to-noise ratio,
//!   but the band is weighted by `|P|^2`, which acts as a window. Noise becomes `N s^2 |P[m]|^2 / mean^2`.
//!
//! For a chirp of duration `T` and bandwidth `B`, `|P|^2` is close to `sample_rate^2 T / B`. Both filters then have the
//! gain `B T` in the sum over the band, and differ by the Fresnel ripple.
//!
//! The band is `-B/2 ..= B/2`, with `B` the swept bandwidth or the inverse of the chip duration; frequencies are
//! `sample_rate / N` apart. Echoes outside the receive window wrap around, as in any circular filter; the window
//! from its start `t_w` to a pulse's duration `T` before its end holds echoes completely, and is the pulses'
//! [`recorded_path_m`](subaperture_model::phase_history::Pulse::recorded_path_m) (its ends are exchanged where the pulse is longer than the window). Motion during the
//! pulse is neglected unless given by [`Compressed::moving`]: the Doppler shift times the pulse duration is `2 v T /
//! lambda` turns, 0.07 for 100 m/s, 10 us and 3 cm, and is common to all scatterers with the same range rate.
//!
//! Cost: one float64 FFT per pulse. Accuracy: `tests/simulate/chain.rs`.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_fft::{Fft, Transforms};

use super::{Echoes, ReceiveError, collection_of, in_blocks};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, InputFile, PhaseHistory, ReadError, Sweep};
use subaperture_model::quantity::hertz;
use subaperture_model::radar::{PulseShape, Waveform};
use subaperture_signal::phase::{narrow, phasor, widen};

/// Pulse compression filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// Inverse filter `1 / P` within the band: flat spectrum for any pulse.
    #[default]
    Inverse,
    /// Matched filter `conj(P)`: least noise.
    Matched,
}

/// Smallest `|P|^2` by which the inverse filter divides, relative to its mean over the band.
const MIN_POWER: f64 = 1e-4;

/// Phase history of a pulsed radar.
#[derive(Clone)]
pub struct Compressed<E> {
    echoes: E,
    collection: Collection,
    fft: Arc<dyn Fft<f64>>,
    /// FFT bin of sample 0 of the band.
    first_bin: usize,
    /// `W` at every frequency of the band.
    filter: Vec<Complex64>,
    centre_hz: f64,
    /// Chirp rate of an LFM pulse, hertz per second.
    chirp_hz_s: Option<f64>,
}

impl<E: Echoes> Compressed<E> {
    /// Compress the echoes of a pulsed waveform over the pulse's whole band.
    ///
    /// # Errors
    /// [`ReceiveError`] if the waveform is not pulsed, or its band exceeds the sample rate.
    pub fn new(echoes: E, filter: Filter) -> Result<Self, ReceiveError> {
        Self::within(echoes, filter, [f64::NEG_INFINITY, f64::INFINITY])
    }

    /// Compress echoes like [`Self::new`], with the band limited to `band_hz`, the lowest and highest frequencies
    /// relative to the waveform's centre.
    ///
    /// # Errors
    /// Those of [`Self::new`]; [`ReceiveError`] if the limits leave no frequency.
    pub fn within(echoes: E, filter: Filter, band_hz: [f64; 2]) -> Result<Self, ReceiveError> {
        let collection = echoes.collection();
        let fault = |what: String| ReceiveError::new(collection, what);
        let Waveform::Pulsed {
            centre_hz,
            sample_rate_hz,
            num_samples,
            ref shape,
            ..
        } = collection.waveform
        else {
            return Err(fault("expected a pulsed waveform".to_owned()));
        };
        let bandwidth_hz = shape.bandwidth_hz();
        if !(num_samples > 0 && sample_rate_hz > 0.0 && bandwidth_hz <= sample_rate_hz) {
            return Err(fault(format!(
                "{num_samples} samples at {} cannot hold a bandwidth of {}: raise the sample rate",
                hertz(sample_rate_hz),
                hertz(bandwidth_hz)
            )));
        }
        let step_hz = sample_rate_hz / num_samples as f64;
        // Rounding must not lose a bin on the band's edge.
        let reach = |edge_hz: f64| {
            let edge = edge_hz.min(bandwidth_hz / 2.0) / step_hz;
            (edge + edge.abs() * 1e-12).floor() as i64
        };
        let half = num_samples as i64 / 2;
        let below = reach(-band_hz[0]).min(half);
        let above = reach(band_hz[1]).min((num_samples as i64 - 1) / 2);
        if below + above < 0 {
            return Err(fault(format!(
                "no frequency of the pulse's band of {} lies within the received band",
                hertz(bandwidth_hz)
            )));
        }
        let start_hz = centre_hz - below as f64 * step_hz;
        if start_hz.is_nan() || start_hz <= 0.0 {
            return Err(fault(format!(
                "the band extends down to {}: expected positive frequencies",
                hertz(start_hz)
            )));
        }
        let first_bin = (-below).rem_euclid(num_samples as i64) as usize;
        let spectrum = shape.spectrum(sample_rate_hz, num_samples);
        let pulse: Vec<Complex64> = (0..=(below + above) as usize)
            .map(|k| spectrum[(first_bin + k) % num_samples])
            .collect();
        let mean = pulse.iter().map(Complex64::norm_sqr).sum::<f64>() / pulse.len() as f64;
        let weight = |p: &Complex64| match filter {
            Filter::Inverse => p.conj() / p.norm_sqr().max(MIN_POWER * mean),
            Filter::Matched => p.conj() / mean,
        };
        if mean <= 0.0 {
            return Err(fault("the pulse has no power in its band".to_owned()));
        }
        let filter = pulse.iter().map(weight).collect();
        let chirp_hz_s = match shape {
            PulseShape::Lfm {
                duration_s, rising, ..
            } => {
                let rate_hz_s = bandwidth_hz / duration_s;
                Some(if *rising { rate_hz_s } else { -rate_hz_s })
            }
            PulseShape::PhaseCode { .. } | PulseShape::Recorded { .. } => None,
        };
        let mut collection = collection_of(&echoes, (start_hz, step_hz, pulse.len()), 0.0);
        let late_s = num_samples as f64 / sample_rate_hz - shape.duration_s();
        for (n, pulse) in collection.pulses.iter_mut().enumerate() {
            let start_s = echoes.window_start_s(n);
            let ends_s = [start_s + late_s.min(0.0), start_s + late_s.max(0.0)];
            pulse.recorded_path_m = Some(ends_s.map(|s| s * SPEED_OF_LIGHT_M_S));
        }
        Ok(Self {
            echoes,
            collection,
            fft: Transforms::Portable.forward(num_samples),
            first_bin,
            filter,
            centre_hz,
            chirp_hz_s,
        })
    }

    /// Include the motion during an LFM pulse, with the velocities of transmitter and receiver in pulse `n` given by
    /// `of(n)`, metres per second. Frequency `f` is transmitted `(f - centre) / chirp` after the middle of the pulse,
    /// to which the recorded positions belong, and received one delay later. By the principle of stationary phase, its
    /// phase is that of the path at that time, and it is compensated by the path to the reference point at that time.
    /// The error is `(centre v / c)^2 / (2 chirp)` turns, with `v` the rate of the path: 3e-4 turns for 6 THz/s, 9.6
    /// GHz and 2 km/s. Pulses with other waveforms are unchanged.
    #[must_use]
    pub fn moving(mut self, of: impl Fn(usize) -> [DVec3; 2]) -> Self {
        let Some(chirp_hz_s) = self.chirp_hz_s else {
            return self;
        };
        for (n, pulse) in self.collection.pulses.iter_mut().enumerate() {
            let [transmitter_m_s, receiver_m_s] = of(n);
            // Positions are those of the middle sample.
            let middle_hz = pulse.frequency_hz(self.filter.len() / 2);
            let after_s = (middle_hz - self.centre_hz) / chirp_hz_s;
            // Bias of the recorded path.
            let excess_m = pulse.reference_path_m - pulse.path_m(pulse.reference_m);
            pulse.transmitter_m += transmitter_m_s * after_s;
            pulse.receiver_m += receiver_m_s * after_s;
            pulse.reference_path_m = pulse.path_m(pulse.reference_m) + excess_m;
            pulse.sweep = Sweep {
                sample_s: pulse.step_hz / chirp_hz_s,
                transmitter_m_s,
                receiver_m_s,
                reference_m_s: Some(DVec3::ZERO),
                ..Sweep::AT_ONCE
            };
        }
        self
    }

    /// Raw echoes from which the phase history is computed.
    pub fn echoes(&self) -> &E {
        &self.echoes
    }

    fn pulse(&self, n: usize, spectrum: &[Complex64], row: &mut [Complex32]) {
        let pulse = &self.collection.pulses[n];
        let window_start_s = self.echoes.window_start_s(n);
        let delay_s = pulse.reference_path_m / SPEED_OF_LIGHT_M_S - window_start_s;
        let constant = self.centre_hz * window_start_s;
        let middle = (self.filter.len() / 2) as f64;
        for (k, (z, w)) in row.iter_mut().zip(&self.filter).enumerate() {
            let s = spectrum[(self.first_bin + k) % spectrum.len()];
            let drift_s = pulse.reference_drift_m(k as f64 - middle) / SPEED_OF_LIGHT_M_S;
            let turns = pulse.frequency_hz(k) * (delay_s + drift_s) + constant;
            *z = narrow(s * w * phasor(turns));
        }
    }
}

impl<E: Echoes> PhaseHistory for Compressed<E> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let (raw, width) = (self.fft.len(), self.collection.num_samples);
        let compress = |first: usize, echoes: &[Complex32], rows: &mut [Complex32]| {
            rows.par_chunks_exact_mut(width)
                .zip(echoes.par_chunks_exact(raw))
                .enumerate()
                .for_each_init(
                    || vec![Complex64::ZERO; self.fft.get_inplace_scratch_len()],
                    |scratch, (i, (row, echo))| {
                        let mut spectrum: Vec<_> = echo.iter().map(|&s| widen(s)).collect();
                        self.fft.process_with_scratch(&mut spectrum, scratch);
                        self.pulse(first + i, &spectrum, row);
                    },
                );
        };
        in_blocks(&self.echoes, raw, pulses, width, samples, compress)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.echoes.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        // The FFT plan is about as large as two of its buffers.
        let filter = size_of_val(self.filter.as_slice()) + 2 * 16 * self.fft.len();
        let pulses = size_of_val(self.collection.pulses.as_slice());
        self.echoes.held_bytes() + (filter + pulses) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.echoes.inputs()
    }
}
