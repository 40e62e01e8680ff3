//! De-chirped sweeps (FMCW) become phase history: residual video phase and range skew removed.
//!
//! With `a = chirp_hz_s`, `t_m = mixer_delay_s`, `d = tau - t_m`, a sweep's beat is (see
//! [`Waveform::Fmcw`])
//!
//! ```text
//! s(t) = exp(-j 2 pi (start + a (t - t_m)) d) exp(+j pi a d^2)
//! ```
//!
//! 1. It is divided by the same expression for the reference, `d_r = tau_ref(t) - t_m` by the measured
//!    track. With `e = tau - tau_ref`, since `d^2 - d_r^2 = e^2 + 2 e d_r`,
//!
//!    ```text
//!    s1(t) = exp(-j 2 pi (start + a (t - t_m - d_r)) e) exp(+j pi a e^2)
//!    ```
//!
//!    exactly: the beat with a copy that is `tau_ref` late. The beat frequency is `f = -a e`.
//! 2. It is filtered with `H(f) = exp(-j pi f^2 / a) exp(+j 2 pi f (d_r - d_0))`, by an FFT over the sweep with
//!    zeros after it. At `f = -a e` the first factor is `exp(-j pi a e^2)`: the residual video phase goes.
//!    Its group delay is `f / a = -e`: the echo's own delay goes, so that all echoes lie alike under the
//!    sweep. The second factor moves the samples to one frequency axis for all pulses, `d_0` being
//!    the middle of all `d_r`:
//!
//!    ```text
//!    z[k] = exp(-j 2 pi f_k e),    f_k = start + a (k / sample_rate - t_m - d_0)
//!    ```
//!
//! Falling sweeps are turned round, so that frequencies rise.
//!
//! Chim 2018 (2.12) lets the frequency run at `2 a` (the phase is `2 pi a t^2`), so that (2.22) has
//! `exp(-j 2 pi a tau^2)` and `f = a tau` together, which no sweep has: with a rate of `2 a` the beat is at
//! `2 a tau`, with `a` the residual phase is `pi a tau^2`. (3.1) repeats it. Both also leave the skew, the
//! `exp(j 2 pi (a tau - f) tau)` dropped from (2.19) to (2.20). The sign there is the opposite of
//! ours: C mixes the other way round.
//!
//! # What is cut away
//! With delays `|e| <= h` in the scene, only samples from `h` after the sweep's begin to `h` before
//! its end have all echoes after the shift; the change of `d_r` between pulses takes its part too. The
//! edges of the sweep spread in the filter as Fresnel's ripple does: at a time `u` from an edge it has
//! the amplitude `1 / (2 pi sqrt(a) u)` and the beat of a scatterer `u` away in delay. So `2 h` more are
//! cut, and `4 / sqrt(a)`: what ripple is left focuses outside the scene. The band lost is
//! `2 a (3 h + 4 / sqrt(a) + (max d_r - min d_r) / 2)`.
//!
//! White noise stays white: every step is a rotation in time or in frequency.
//!
//! Cost: two FFTs in float64 a pulse. Accuracy: `tests/simulate_chain.rs`, against a pulsed radar.

use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};

use super::{EchoCollection, EchoPulse, Echoes, ReceiveError, in_blocks};
use crate::SPEED_OF_LIGHT_M_S;
use crate::geometry::Extent;
use crate::phase_history::{Collection, InputFile, PhaseHistory, ReadError};
use crate::quantity::{hertz, seconds};
use crate::signal::fast_length::fast_length;
use crate::signal::phase::{narrow, phasor, widen};
use crate::simulate::radar::Waveform;

/// Whether residual video phase and range skew are removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Skew {
    /// Removed.
    #[default]
    Removed,
    /// Left where they are, to show what they do.
    Left,
}

/// A sweep's numbers.
#[derive(Clone, Copy, Debug)]
struct Sweep {
    start_hz: f64,
    chirp_hz_s: f64,
    sample_rate_hz: f64,
    mixer_delay_s: f64,
}

/// Phase history of an FMCW radar.
#[derive(Clone)]
pub struct Deskewed<E> {
    echoes: E,
    collection: Collection,
    sweep: Sweep,
    raw_samples: usize,
    skew: Skew,
    /// Samples lost at either end.
    cut: usize,
    /// `d_0`, seconds.
    common_delay_s: f64,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl<E: Echoes> Deskewed<E> {
    /// Of echoes of a linear sweep, for a scene whose delays are within `half_delay_s` of the
    /// reference's; that of the collection's extent if `None`.
    ///
    /// # Errors
    /// [`ReceiveError`] if the waveform is another one, nothing says how large the scene is, or it is too
    /// large for the sampling rate or for the sweep.
    pub fn new(echoes: E, half_delay_s: Option<f64>, skew: Skew) -> Result<Self, ReceiveError> {
        let collection = echoes.collection();
        let fault = |what: String| ReceiveError::new(collection, what);
        let Waveform::Fmcw {
            start_hz,
            chirp_hz_s,
            sample_rate_hz,
            num_samples,
            mixer_delay_s,
        } = collection.waveform
        else {
            return Err(fault("its waveform is not a linear sweep".to_owned()));
        };
        let moves = chirp_hz_s.is_finite() && chirp_hz_s != 0.0;
        if !(moves && sample_rate_hz > 0.0 && num_samples > 0 && !collection.pulses.is_empty()) {
            return Err(fault("its sweep does not sweep, or is empty".to_owned()));
        }
        let Some(half_delay_s) = half_delay_s.or_else(|| half_delay(collection)) else {
            return Err(fault(
                "nothing says how large its scene is: give the extent or the half delay".to_owned(),
            ));
        };
        if !(half_delay_s >= 0.0 && half_delay_s.is_finite()) {
            return Err(fault(format!(
                "a scene of delays up to {half_delay_s} s from the reference: give a number, 0 or more"
            )));
        }
        // All that the samples tell apart is allowed, whatever the rounding.
        if half_delay_s * chirp_hz_s.abs() > sample_rate_hz / 2.0 * (1.0 + 1e-9) {
            return Err(fault(format!(
                "delays up to {} from the reference beat at up to {}, more than half the sampling rate of {}: \
                 sample faster, sweep slower or see less",
                seconds(half_delay_s),
                hertz(half_delay_s * chirp_hz_s.abs()),
                hertz(sample_rate_hz)
            )));
        }
        let delays = collection
            .pulses
            .iter()
            .map(|p| p.reference_path_m / SPEED_OF_LIGHT_M_S - mixer_delay_s);
        let (least_s, most_s) = delays.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| {
            (a.min(d), b.max(d))
        });
        let drift_s = 0.5 * (most_s - least_s);
        let edge_s = 4.0 / chirp_hz_s.abs().sqrt();
        let cut = ((3.0 * half_delay_s + edge_s + drift_s) * sample_rate_hz).ceil() as usize;
        let kept = num_samples.saturating_sub(cut.saturating_mul(2));
        if kept < 2 {
            return Err(fault(format!(
                "a sweep of {num_samples} samples loses {cut} at either end to the scene's delays, and \
                 little or nothing is left: sweep longer or see less"
            )));
        }
        let common_delay_s = 0.5 * (least_s + most_s);
        let frequency_hz = |k: usize| {
            let after_s = k as f64 / sample_rate_hz - mixer_delay_s - common_delay_s;
            start_hz + chirp_hz_s * after_s
        };
        let lowest_hz = if chirp_hz_s > 0.0 {
            frequency_hz(cut)
        } else {
            frequency_hz(num_samples - 1 - cut)
        };
        if lowest_hz <= 0.0 {
            return Err(fault(format!(
                "its sweep reaches {}; frequencies are positive",
                hertz(lowest_hz)
            )));
        }
        // Delays up to half the sampling rate's, and the shift, must not come round.
        let zeros = (sample_rate_hz * (sample_rate_hz / chirp_hz_s.abs() + drift_s)).ceil();
        let length = fast_length(num_samples + (zeros as usize).min(3 * num_samples));
        let mut planner = FftPlanner::new();
        let step_hz = chirp_hz_s.abs() / sample_rate_hz;
        let collection = collection.with_band(lowest_hz, step_hz, kept);
        Ok(Self {
            echoes,
            collection,
            sweep: Sweep {
                start_hz,
                chirp_hz_s,
                sample_rate_hz,
                mixer_delay_s,
            },
            raw_samples: num_samples,
            skew,
            cut,
            common_delay_s,
            forward: planner.plan_fft_forward(length),
            inverse: planner.plan_fft_inverse(length),
        })
    }

    /// The echoes behind.
    pub fn echoes(&self) -> &E {
        &self.echoes
    }

    /// Turns `echo` of pulse `n` into `row`; `work` and `scratch` are as long as the transform needs.
    fn pulse(
        &self,
        n: usize,
        echo: &[Complex32],
        work: &mut [Complex64],
        scratch: &mut [Complex64],
        row: &mut [Complex32],
    ) {
        let sweep = self.sweep;
        work.fill(Complex64::ZERO);
        for (k, (z, &s)) in work.iter_mut().zip(echo).enumerate() {
            let after_s = k as f64 / sweep.sample_rate_hz;
            let d =
                self.echoes.reference_path_m(n, after_s) / SPEED_OF_LIGHT_M_S - sweep.mixer_delay_s;
            let frequency_hz = sweep.start_hz + sweep.chirp_hz_s * (after_s - sweep.mixer_delay_s);
            *z = widen(s) * phasor(frequency_hz * d - 0.5 * sweep.chirp_hz_s * d * d);
        }
        self.forward.process_with_scratch(work, scratch);
        let length = work.len();
        let shift_s = self.collection.pulses[n].reference_path_m / SPEED_OF_LIGHT_M_S
            - sweep.mixer_delay_s
            - self.common_delay_s;
        for (m, z) in work.iter_mut().enumerate() {
            let above = if m < length.div_ceil(2) { 0 } else { length };
            let f = (m as f64 - above as f64) * sweep.sample_rate_hz / length as f64;
            let skew = match self.skew {
                Skew::Removed => -0.5 * f * f / sweep.chirp_hz_s,
                Skew::Left => 0.0,
            };
            *z *= phasor(skew + f * shift_s);
        }
        self.inverse.process_with_scratch(work, scratch);
        let scale = 1.0 / length as f64;
        let kept = work[self.cut..].iter().zip(0..row.len());
        for (z, k) in kept {
            let k = if sweep.chirp_hz_s > 0.0 {
                k
            } else {
                row.len() - 1 - k
            };
            row[k] = narrow(z * scale);
        }
    }
}

impl<E: Echoes> PhaseHistory for Deskewed<E> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        let (raw, width) = (self.raw_samples, self.collection.num_samples);
        let length = self.forward.len();
        let scratch =
            (self.forward.get_inplace_scratch_len()).max(self.inverse.get_inplace_scratch_len());
        let deskew = |first: usize, echoes: &[Complex32], rows: &mut [Complex32]| {
            rows.par_chunks_exact_mut(width)
                .zip(echoes.par_chunks_exact(raw))
                .enumerate()
                .for_each_init(
                    || {
                        (
                            vec![Complex64::ZERO; length],
                            vec![Complex64::ZERO; scratch],
                        )
                    },
                    |(work, scratch), (i, (row, echo))| {
                        self.pulse(first + i, echo, work, scratch, row);
                    },
                );
        };
        in_blocks(&self.echoes, raw, pulses, width, samples, deskew)
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.echoes.true_antennas()
    }

    fn held_bytes(&self) -> u64 {
        // The transforms' plans are about as large as two of their buffers each.
        let plans = 4 * 16 * self.forward.len();
        let pulses = size_of_val(self.collection.pulses.as_slice());
        self.echoes.held_bytes() + (plans + pulses) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.echoes.inputs()
    }
}

/// Largest difference of a delay in the extent, at height 0, from the reference's.
fn half_delay(collection: &EchoCollection) -> Option<f64> {
    let Extent { x_m, y_m } = collection.extent?;
    let of_pulse = |pulse: &EchoPulse| {
        // Delays are convex: largest at a corner, least near the point below the antennas or the nearest.
        let middle_m = 0.5 * (pulse.transmitter_m + pulse.receiver_m);
        let nearest = (
            middle_m.x.clamp(x_m.0, x_m.1),
            middle_m.y.clamp(y_m.0, y_m.1),
        );
        let corners = [
            (x_m.0, y_m.0),
            (x_m.0, y_m.1),
            (x_m.1, y_m.0),
            (x_m.1, y_m.1),
        ];
        corners
            .into_iter()
            .chain([nearest])
            .map(|(x, y)| pulse.relative_delay_s(DVec3::new(x, y, 0.0)).abs())
            .fold(0.0, f64::max)
    };
    Some(collection.pulses.iter().map(of_pulse).fold(0.0, f64::max))
}
