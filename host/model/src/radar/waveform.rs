//! Sample count, sample times and frequencies of a waveform.

use super::Waveform;

impl Waveform {
    /// Number of raw samples per pulse.
    #[inline]
    pub fn num_samples(&self) -> usize {
        match self {
            Self::Ideal { band } | Self::Stepped { band, .. } => band.count,
            Self::Pulsed { num_samples, .. } | Self::Fmcw { num_samples, .. } => *num_samples,
        }
    }

    /// Centre of the transmitted frequencies, hertz.
    #[inline]
    pub fn centre_hz(&self) -> f64 {
        match *self {
            Self::Ideal { band } | Self::Stepped { band, .. } => band.centre_hz(),
            Self::Pulsed { centre_hz, .. } => centre_hz,
            Self::Fmcw {
                start_hz,
                chirp_hz_s,
                sample_rate_hz,
                num_samples,
                ..
            } => start_hz + 0.5 * chirp_hz_s * num_samples as f64 / sample_rate_hz,
        }
    }

    /// Time of raw sample `k` after the pulse's start, seconds. Samples of an ideal waveform are simultaneous.
    #[inline]
    pub fn sample_s(&self, k: usize) -> f64 {
        let k = k as f64;
        match *self {
            Self::Ideal { .. } => 0.0,
            Self::Pulsed {
                sample_rate_hz,
                window_start_s,
                ..
            } => window_start_s + k / sample_rate_hz,
            Self::Fmcw { sample_rate_hz, .. } => k / sample_rate_hz,
            Self::Stepped { step_s, .. } => k * step_s,
        }
    }

    /// Time of the middle sample, `count / 2`, to which the pulse's geometry refers.
    #[inline]
    pub fn middle_s(&self) -> f64 {
        self.sample_s(self.num_samples() / 2)
    }

    /// Noise bandwidth of a raw sample, hertz: the sampling rate, or the inverse of a carrier's dwell.
    /// An ideal radar that transmits without pause divides its pulse repetition interval `pri_s`
    /// among its frequencies.
    pub fn noise_bandwidth_hz(&self, pri_s: f64) -> f64 {
        match *self {
            Self::Ideal { band } => band.count as f64 / pri_s,
            Self::Pulsed { sample_rate_hz, .. } | Self::Fmcw { sample_rate_hz, .. } => {
                sample_rate_hz
            }
            Self::Stepped { dwell_s, .. } => 1.0 / dwell_s,
        }
    }

    /// Waveform of a radar whose clock is fast by the relative `offset`: higher frequencies,
    /// shorter times. The pulse shape in samples is unchanged.
    #[must_use]
    pub fn with_clock_offset(&self, offset: f64) -> Self {
        let rate = 1.0 + offset;
        let mut true_waveform = self.clone();
        match &mut true_waveform {
            Self::Ideal { band } => {
                band.start_hz *= rate;
                band.step_hz *= rate;
            }
            Self::Pulsed {
                centre_hz,
                sample_rate_hz,
                window_start_s,
                ..
            } => {
                *centre_hz *= rate;
                *sample_rate_hz *= rate;
                *window_start_s /= rate;
            }
            Self::Fmcw {
                start_hz,
                chirp_hz_s,
                sample_rate_hz,
                mixer_delay_s,
                ..
            } => {
                *start_hz *= rate;
                *chirp_hz_s *= rate * rate;
                *sample_rate_hz *= rate;
                *mixer_delay_s /= rate;
            }
            Self::Stepped {
                band,
                step_s,
                dwell_s,
            } => {
                band.start_hz *= rate;
                band.step_hz *= rate;
                *step_s /= rate;
                *dwell_s /= rate;
            }
        }
        true_waveform
    }
}
