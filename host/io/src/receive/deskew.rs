//! Deskew of dechirped FMCW sweeps into phase history: removal of residual video phase and range skew.
//!
//! With `a = chirp_hz_s`, `t_m = mixer_delay_s`, `d = tau - t_m`, the beat signal of a sweep is (see
//! [`Waveform::Fmcw`](subaperture_model::radar::Waveform::Fmcw))
//!
//! ```text
//! s(t) = exp(-j 2 pi (start + a (t - t_m)) d) exp(+j pi a d^2)
//! ```
//!
//! 1. The beat signal is divided by the same expression for the reference, with `d_r = tau_ref(t) - t_m` from the
//!    measured track. With `e = tau - tau_ref`, since `d^2 - d_r^2 = e^2 + 2 e d_r`, the result is exactly
//!
//!    ```text
//!    s1(t) = exp(-j 2 pi (start + a (t - t_m - d_r)) e) exp(+j pi a e^2)
//!    ```
//!
//!    This is the beat signal with a copy delayed by `tau_ref`. The beat frequency is `f = -a e`.
//! 2. It is filtered with `H(f) = exp(-j pi f^2 / a) exp(+j 2 pi f (d_r - d_0))`, by a zero-padded FFT over the sweep.
//!    At `f = -a e` the first factor is `exp(-j pi a e^2)`, which removes the residual video phase. Its group delay `f
//!    / a = -e` removes the echo's own delay (the range skew), so that all echoes are aligned within the sweep. The
//!    second factor shifts the samples to a common frequency axis for all pulses; `d_0` is the middle of all `d_r`:
//!
//!    ```text
//!    z[k] = exp(-j 2 pi f_k e),    f_k = start + a (k / sample_rate - t_m - d_0)
//!    ```
//!
//! Descending sweeps are reversed, so that frequencies ascend.
//!
//! Chim 2018 (2.12) has a frequency rate of `2 a` (the phase is `2 pi a t^2`). Its (2.22) then combines `exp(-j 2 pi a
//! tau^2)` with `f = a tau`, which is inconsistent: with a rate of `2 a` the beat frequency is `2 a tau`, and with a
//! rate of `a` the residual phase is `pi a tau^2`. (3.1) repeats the error. Both also keep the skew, the factor `exp(j
//! 2 pi (a tau - f) tau)` that is dropped from (2.19) to (2.20). The sign is the opposite of the one here, since C
//! mixes with the conjugate.
//!
//! # Edges of the sweep
//! A sweep with abrupt ends causes a Fresnel ripple over the whole band when filtered: at a time `u` from an edge,
//! with the amplitude `1 / (2 pi sqrt(a) u)`; -31 dB next to the part that is cut, -70 dB in the middle. The raw
//! sweep is therefore first faded in and out with the integral of a Gaussian of standard deviation `s = 1 / sqrt(2 pi
//! a)`, which the filter widens to `s' = sqrt(s^2 + 1 / (2 pi a s)^2) = sqrt(2) s`. The edge lies `4 s` within the
//! sweep (the remainder of the raw edge is 3e-5), and `4.4 s'` before the part that is kept (5e-6). A Gaussian
//! shorter than a few samples is not representable, and its spectrum about a beat frequency of up to `a h` must end
//! before half the sample rate. Therefore `s` is at least `0.6 / (sample_rate / 2 - a h)`, though this condition
//! never requires more than `1.6 / sample_rate`.
//!
//! For delays `|e| <= h` in the scene, the edges move by up to `h`, and the change of `d_r` between pulses is added.
//! The lost bandwidth is `2 a (h + 4 s + 4.4 s' + (max d_r - min d_r) / 2)`. The remaining ripple is below -90 dB near
//! the edges and -120 dB in the middle for echoes with beat frequencies below a quarter of the sample rate, and up to
//! -50 and -100 dB for those near half of it.
//!
//! # Motion
//! Sample `k` is assigned the position of the raw sample with its frequency in the middle pulse; an echo with delay `e`
//! is there `e + d_r - d_0` later. The antennas' motion in this time is neglected: 10 um at 100 m/s and 0.1 us,
//! multiplied by the difference of the lines of sight.
//!
//! White noise stays white at the delays of the scene: every step except the fading, whose part is cut away, is a
//! rotation in time or in frequency.
//!
//! Cost: two float64 FFTs per pulse. Accuracy: `tests/simulate/chain.rs`, against a pulsed radar.

mod sweep;

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use subaperture_fft::{Fft, Transforms};

use self::sweep::{Sweep, ends_of_delays_s, seen_half_delay_s, sweep_of};
use super::{Echoes, ReceiveError, collection_of, in_blocks};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, InputFile, PhaseHistory, ReadError};
use subaperture_model::quantity::hertz;
use subaperture_signal::fast_length::fast_length;
use subaperture_signal::phase::{narrow, phasor, widen};

/// Handling of residual video phase and range skew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Skew {
    /// Removed.
    #[default]
    Removed,
    /// Kept, to demonstrate their effect.
    Left,
}

/// Fade-in of a sweep: the integral of a Gaussian.
#[derive(Clone, Copy, Debug)]
struct Edge {
    /// Standard deviation, seconds.
    sigma_s: f64,
    /// Time from the start of the sweep to the middle of the edge, seconds.
    begin_s: f64,
    /// Time from the middle of the edge to where its effect after the filter has vanished, seconds.
    end_s: f64,
}

impl Edge {
    fn new(chirp_hz_s: f64, sample_rate_hz: f64, half_delay_s: f64) -> Self {
        let beta_s2 = 1.0 / (TAU * chirp_hz_s);
        let room_hz = 0.5 * sample_rate_hz - chirp_hz_s * half_delay_s;
        let sampled_s = (0.6 / room_hz.max(0.0)).min(1.6 / sample_rate_hz);
        let sigma_s = beta_s2.sqrt().max(sampled_s);
        let spread_s = libm::hypot(sigma_s, beta_s2 / sigma_s);
        Self {
            sigma_s,
            begin_s: 4.0 * sigma_s,
            end_s: 4.4 * spread_s,
        }
    }

    /// Amplitudes of the sweep's first samples; all later samples have amplitude 1.
    fn fade(&self, sample_rate_hz: f64, num_samples: usize) -> Vec<f64> {
        let step = 1.0 / (sample_rate_hz * self.sigma_s);
        let count = (12.0 / step).ceil() as usize;
        let gauss = |x: f64| libm::exp(-0.5 * x * x);
        // Simpson's rule over the step of each sample: error 1e-6 and less for steps below one.
        const PARTS: usize = 8;
        let mut sum = 0.0;
        let mut fade = Vec::with_capacity(count);
        for k in 0..count.min(num_samples / 2) {
            if k == 0 {
                // Tail before the first sample, by its asymptotic series: within 1 %.
                sum = gauss(4.0) / 4.0 * (1.0 - 1.0 / 16.0);
            } else {
                let h = step / PARTS as f64;
                for i in 0..PARTS {
                    let x = (k - 1) as f64 * step + i as f64 * h - 4.0;
                    sum += h / 6.0 * (gauss(x) + 4.0 * gauss(x + 0.5 * h) + gauss(x + h));
                }
            }
            fade.push((sum / TAU.sqrt()).min(1.0));
        }
        fade
    }
}

/// Phase history of an FMCW radar.
#[derive(Clone)]
pub struct Deskewed<E> {
    echoes: E,
    collection: Collection,
    sweep: Sweep,
    raw_samples: usize,
    skew: Skew,
    /// Fade-in amplitudes of the first raw samples; the fade-out is its reverse.
    fade: Vec<f64>,
    /// Raw sample index of the first sample kept.
    first: usize,
    /// Common delay `d_0`, seconds.
    common_delay_s: f64,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
}

impl<E: Echoes> Deskewed<E> {
    /// Deskew the echoes of an FMCW sweep, for a scene whose delays are within `half_delay_s` of the reference's;
    /// `None` uses the collection's extent.
    ///
    /// # Errors
    /// [`ReceiveError`] if the waveform is not FMCW, the size of the scene is unknown, or it is too large for the
    /// sample rate or for the sweep.
    pub fn new(echoes: E, half_delay_s: Option<f64>, skew: Skew) -> Result<Self, ReceiveError> {
        let collection = echoes.collection();
        let fault = |what: String| ReceiveError::new(collection, what);
        let (sweep, num_samples) = sweep_of(collection).map_err(fault)?;
        let Sweep {
            start_hz,
            chirp_hz_s,
            sample_rate_hz,
            mixer_delay_s,
        } = sweep;
        let half_delay_s = seen_half_delay_s(collection, half_delay_s, &sweep).map_err(fault)?;
        let (least_s, most_s) = ends_of_delays_s(collection, mixer_delay_s);
        let drift_s = 0.5 * (most_s - least_s);
        let edge = Edge::new(chirp_hz_s.abs(), sample_rate_hz, half_delay_s);
        let cut_s = half_delay_s + edge.begin_s + edge.end_s + drift_s;
        let cut = (cut_s * sample_rate_hz).ceil() as usize;
        let kept = num_samples.saturating_sub(cut.saturating_mul(2));
        if kept < 2 {
            return Err(fault(format!(
                "a sweep of {num_samples} samples loses {cut} at either end to the delays of the scene, which leaves \
                                fewer than two: lengthen the sweep, or reduce the extent"
            )));
        }
        // When reversed, an even number of samples has another middle sample: drop one sample at the raw start.
        let reversed = chirp_hz_s < 0.0;
        let first = cut + usize::from(reversed && kept % 2 == 0);
        let kept = kept - (first - cut);
        let common_delay_s = 0.5 * (least_s + most_s);
        let frequency_hz = |k: usize| {
            let after_s = k as f64 / sample_rate_hz - mixer_delay_s - common_delay_s;
            start_hz + chirp_hz_s * after_s
        };
        let lowest_hz = frequency_hz(if reversed { first + kept - 1 } else { first });
        if lowest_hz <= 0.0 {
            return Err(fault(format!(
                "the sweep extends down to {}: expected positive frequencies",
                hertz(lowest_hz)
            )));
        }
        // Delays up to those of half the sample rate, plus the shift, must not wrap around.
        let zeros = (sample_rate_hz * (sample_rate_hz / chirp_hz_s.abs() + drift_s)).ceil();
        let length = fast_length(num_samples + (zeros as usize).min(3 * num_samples));
        let step_hz = chirp_hz_s.abs() / sample_rate_hz;
        let sample_s = chirp_hz_s.signum() / sample_rate_hz;
        let fade = edge.fade(sample_rate_hz, num_samples);
        let collection = collection_of(&echoes, (lowest_hz, step_hz, kept), sample_s);
        Ok(Self {
            echoes,
            collection,
            sweep,
            raw_samples: num_samples,
            skew,
            fade,
            first,
            common_delay_s,
            forward: Transforms::Portable.forward(length),
            inverse: Transforms::Portable.inverse(length),
        })
    }

    /// Raw echoes from which the phase history is computed.
    pub fn echoes(&self) -> &E {
        &self.echoes
    }

    /// Deskew `echo` of pulse `n` into `row`; `work` and `scratch` have the lengths required by the FFT.
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
        for (k, &amplitude) in self.fade.iter().enumerate() {
            work[k] *= amplitude;
            work[echo.len() - 1 - k] *= amplitude;
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
        let kept = work[self.first..].iter().zip(0..row.len());
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
        // The FFT plans are about as large as two of their buffers each.
        let plans = 4 * 16 * self.forward.len();
        let pulses = size_of_val(self.collection.pulses.as_slice());
        self.echoes.held_bytes() + (plans + pulses) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.echoes.inputs()
    }
}
