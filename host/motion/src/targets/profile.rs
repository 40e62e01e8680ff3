//! Range profiles of all channels of a pulse, on one axis of path.
//!
//! First the recording's compensation is undone: sample `k` of a channel is multiplied by `exp(-j 2 pi f_k reference_path / c)`, so that a scatterer at path `p` has the phase `-2 pi f_k p / c` in every channel and pulse. Then
//!
//! ```text
//! S_c(p) = sum_k w_k z_ck exp(+j 2 pi (k - (K-1)/2) step p / c),        power(l) = sum_c |S_c(l c / (L step))|^2
//! ```
//!
//! with `w` symmetric about `(K-1)/2`, the middle of the band. Near a scatterer's path `p_0`, `S_c` is a real number times `exp(-j 2 pi f_m p_0 / c)` with `f_m` the middle frequency: **its phase is that of the path at `f_m`,
//! whatever the error of `p`**, and is independent of the error of the estimated path. At any other frequency of the band it would depend on that error linearly.
//!
//! Paths are ambiguous by `c / step`. They are reported from a least path on: half of that below the first pulse's reference path, but not below 0.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::{Complex32, Complex64};
use subaperture_fft::{Fft, Transforms};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Band, Pulse};
use subaperture_signal::fast_length::fastest_length;
use subaperture_signal::phase::phasor;

/// Bins of a profile a sample: scalloping is below a tenth of the power under any window.
pub(crate) const STRIDE: usize = 4;

/// Computes profiles of one band.
#[derive(Clone)]
pub(crate) struct Profiler {
    pub(crate) band: Band,
    /// Window weights over frequency.
    pub(crate) window: Vec<f64>,
    fft: Arc<dyn Fft<f64>>,
    /// Searched bins: the first, and their number.
    pub(crate) bins: (usize, usize),
    /// Least path reported, metres.
    least_path_m: f64,
    /// Largest path searched for targets, metres; noise is measured beyond it too.
    pub(crate) most_path_m: f64,
}

/// Uncompensated samples of a pulse, channel by channel.
pub(crate) type Echoes = Vec<Vec<Complex64>>;

impl Profiler {
    /// Profiler for paths of twice these ranges, or for the whole unambiguous interval.
    pub(crate) fn new(
        band: Band,
        window: Vec<f64>,
        reference_path_m: f64,
        ranges_m: Option<(f64, f64)>,
    ) -> Self {
        let length = fastest_length(band.count * STRIDE);
        let repeats_m = band.unambiguous_path_m();
        let first_m = ranges_m.map_or(reference_path_m - 0.5 * repeats_m, |(near_m, _)| {
            2.0 * near_m
        });
        let mut profiler = Self {
            band,
            window,
            fft: Transforms::Portable.inverse(length),
            bins: (0, length),
            least_path_m: first_m.max(0.0),
            most_path_m: f64::INFINITY,
        };
        let bin_m = profiler.bin_m();
        profiler.bins.0 = ((profiler.least_path_m / bin_m).ceil() as u64 % length as u64) as usize;
        if let Some((_, far_m)) = ranges_m {
            profiler.most_path_m = 2.0 * far_m;
        }
        profiler
    }

    /// Middle frequency of the band, hertz.
    pub(crate) fn middle_hz(&self) -> f64 {
        self.band.start_hz + 0.5 * (self.band.count as f64 - 1.0) * self.band.step_hz
    }

    /// Path difference between bins, metres.
    pub(crate) fn bin_m(&self) -> f64 {
        self.band.unambiguous_path_m() / self.fft.len() as f64
    }

    /// Resolution of the path, metres: `c / B`.
    pub(crate) fn cell_m(&self) -> f64 {
        SPEED_OF_LIGHT_M_S / self.band.bandwidth_hz()
    }

    /// Bins a path resolution.
    pub(crate) fn stride(&self) -> usize {
        (self.cell_m() / self.bin_m()).round() as usize
    }

    /// Path of searched bin `i`, metres.
    pub(crate) fn path_m(&self, i: usize) -> f64 {
        self.within_interval_m((self.bins.0 + i) as f64 * self.bin_m())
    }

    /// Path within the reported interval, metres: it differs by a whole number of ambiguities.
    pub(crate) fn within_interval_m(&self, path_m: f64) -> f64 {
        let repeats_m = self.band.unambiguous_path_m();
        let above = (path_m - self.least_path_m) / repeats_m;
        path_m - above.floor() * repeats_m
    }

    /// Samples without the recording's compensation.
    pub(crate) fn uncompensated(&self, pulse: &Pulse, samples: &[Complex32]) -> Vec<Complex64> {
        let turns = |hz: f64| -hz * pulse.reference_path_m / SPEED_OF_LIGHT_M_S;
        let step = phasor(turns(self.band.step_hz));
        let mut phase = phasor(turns(self.band.start_hz));
        let each = samples.iter().map(|z| {
            let turned = Complex64::new(z.re.into(), z.im.into()) * phase;
            phase *= step;
            turned
        });
        each.collect()
    }

    /// Power in the searched bins.
    pub(crate) fn power(&self, samples: &[Complex64]) -> Vec<f64> {
        let all = self.full_power(samples);
        let (first, count) = self.bins;
        (0..count).map(|i| all[(first + i) % all.len()]).collect()
    }

    /// Power in all bins, from path 0 on.
    pub(crate) fn full_power(&self, samples: &[Complex64]) -> Vec<f64> {
        let length = self.fft.len();
        let mut bins: Vec<Complex64> = samples
            .iter()
            .zip(&self.window)
            .map(|(z, w)| z * w)
            .collect();
        bins.resize(length, Complex64::ZERO);
        self.fft.process(&mut bins);
        bins.iter().map(Complex64::norm_sqr).collect()
    }

    /// Wavenumber of sample `k` relative to the middle of the band, radians a metre of path.
    pub(crate) fn rad_m(&self, k: usize) -> f64 {
        let from_middle = k as f64 - 0.5 * (self.band.count as f64 - 1.0);
        TAU * from_middle * self.band.step_hz / SPEED_OF_LIGHT_M_S
    }

    /// `exp(+j rad_m(k) path)` for all samples.
    pub(crate) fn phasors(&self, path_m: f64) -> impl Iterator<Item = Complex64> + use<> {
        let step_turns = self.band.step_hz * path_m / SPEED_OF_LIGHT_M_S;
        let step = phasor(step_turns);
        let first = phasor(-0.5 * (self.band.count as f64 - 1.0) * step_turns);
        let mut phase = first;
        (0..self.band.count).map(move |_| {
            let own = phase;
            phase *= step;
            own
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_start_at_the_least_path() {
        let band = Band {
            start_hz: 1e9,
            step_hz: 4e6,
            count: 101,
        };
        let repeats_m = SPEED_OF_LIGHT_M_S / 4e6;
        for (reference_m, ranges_m, least_m) in [
            (10.0, None, 0.0),
            (1000.0, None, 1000.0 - 0.5 * repeats_m),
            (1000.0, Some((12.0, 20.0)), 24.0),
        ] {
            let profiler = Profiler::new(band, vec![1.0; 101], reference_m, ranges_m);
            let (_, count) = profiler.bins;
            for i in 0..count {
                let path_m = profiler.path_m(i);
                assert!((least_m - 1e-9..least_m + repeats_m).contains(&path_m));
                assert!((path_m - profiler.path_m(0) - i as f64 * profiler.bin_m()).abs() < 1e-6);
            }
        }
    }
}
