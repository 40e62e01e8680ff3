//! Frequency response of the scene by a burst of chirps.
//!
//! The chirps of a burst are periodic, so that after the first pulse a period of `P` samples holds whole echoes, and
//! its discrete spectrum needs no window. With `X_c,p[k]` the spectrum of pulse `p` in channel `c`, the response is the
//! least-squares ratio over the pulses:
//!
//! ```text
//! z[k] = sum_p X_1,p[k] conj(X_0,p[k]) / sum_p |X_0,p[k]|^2         at carrier + k rate / P, within 0.8 of the bandwidth
//! ```
//!
//! The reference channel contains the transmitted chirp, with the distortion of amplifiers and filters and the
//! phases of the synthesisers; all cancel. From here on a burst is a sweep like that of stepped carriers: profile,
//! calibration and phase history are the same. The unambiguous range is `c / 2` times the pulse repetition interval.
//!
//! Neglected: motion within a burst, and the offset of the converters at the carrier, one of some thousand lines.

use num_complex::Complex64;
use subaperture_fft::Transforms;

use super::error::ProfileError;
use super::sweep::Sweep;
use crate::sigmf::{Flag, Recording, Setup, Step};
use crate::transceiver::Sample;

/// Sums of the response by bursts of chirps.
#[derive(Clone, Debug)]
pub struct ChirpResponse {
    setup: Setup,
    /// Products of echo and conjugate reference, and powers of the reference.
    sums: Vec<(Complex64, f64)>,
    /// Sum of the times of the middles of the bursts, seconds, and their number.
    times: (f64, u32),
    pulses: u64,
    skipped: u64,
}

impl ChirpResponse {
    /// Make a response without bursts.
    pub fn new(setup: &Setup) -> Self {
        Self {
            setup: setup.clone(),
            sums: vec![(Complex64::ZERO, 0.0); setup.band().count],
            times: (0.0, 0),
            pulses: 0,
            skipped: 0,
        }
    }

    /// Add the pulses of a burst, except the first, and those with lost samples in them or in the pulse before.
    pub fn add(&mut self, step: &Step, channels: [&[Sample]; 2]) {
        let (period, count) = (self.setup.period, self.sums.len());
        let pulses = channels[0].len() / period;
        if step.flags.contains(&Flag::Late) {
            self.skipped += pulses as u64;
            return;
        }
        self.times.0 += step.time_s + 0.5 * step.samples as f64 / self.setup.sample_rate_hz;
        self.times.1 += 1;
        let forward = Transforms::Portable.forward::<f64>(period);
        let mut spectra = [vec![Complex64::ZERO; period], vec![Complex64::ZERO; period]];
        // The echoes of the first pulse are not preceded by those of another.
        for pulse in 1..pulses {
            let (from, to) = ((pulse - 1) * period, (pulse + 1) * period);
            if step.lost.iter().any(|gap| gap.0 < to && gap.1 > from) {
                self.skipped += 1;
                continue;
            }
            for (spectrum, samples) in spectra.iter_mut().zip(channels) {
                for (z, sample) in spectrum.iter_mut().zip(&samples[pulse * period..]) {
                    *z = Complex64::new(f64::from(sample.re), f64::from(sample.im));
                }
                forward.process(spectrum);
            }
            for (k, sum) in self.sums.iter_mut().enumerate() {
                let line = (k + period - count / 2) % period;
                let [reference, echo] = [&spectra[0][line], &spectra[1][line]];
                sum.0 += echo * reference.conj();
                sum.1 += reference.norm_sqr();
            }
            self.pulses += 1;
        }
    }

    /// Number of pulses used, and of those skipped because of lost samples.
    pub fn pulses(&self) -> [u64; 2] {
        [self.pulses, self.skipped]
    }

    /// Response at the lines of [`Setup::band`], without values if no pulse is usable.
    pub fn sweep(&self) -> Sweep {
        let band = self.setup.band();
        let (seconds, bursts) = self.times;
        let ratio = |(product, power): &(Complex64, f64)| (*power > 0.0).then(|| product / power);
        Sweep {
            start_hz: band.start_hz,
            step_hz: band.step_hz,
            values: self.sums.iter().map(ratio).collect(),
            times_s: vec![seconds / f64::from(bursts.max(1)); band.count],
        }
    }
}

/// Response by the bursts of a sweep of a recording of chirps.
pub(super) fn response(recording: &mut Recording, sweep: u64) -> Result<Sweep, ProfileError> {
    let first = (recording.steps()).partition_point(|step| step.sweep < sweep);
    let end = (recording.steps()).partition_point(|step| step.sweep <= sweep);
    if first >= end {
        return Err(ProfileError::NoSweep(sweep));
    }
    let mut response = ChirpResponse::new(recording.setup());
    let mut channels: [Vec<Sample>; 2] = Default::default();
    for index in first..end {
        recording.read(index, &mut channels)?;
        response.add(&recording.steps()[index], [&channels[0], &channels[1]]);
    }
    Ok(response.sweep())
}
