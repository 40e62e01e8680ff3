//! The kernels that read maps of a setup.

use subaperture_core::stream::Setup;

use subaperture_focus::MARGIN_DB;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// Kernels in range and Doppler, of as many taps.
#[derive(Clone, Debug)]
pub struct Kernels {
    /// Along range.
    pub range: WindowedSinc,
    /// Along Doppler.
    pub doppler: WindowedSinc,
    /// Predicted relative RMS error of both.
    pub error: f64,
}

impl Kernels {
    /// Those of fewest taps that keep [`Self::share`] of a bound on the image's error, dB, or of the most
    /// taps if none do.
    pub fn for_bound(setup: &Setup, error_db: f64) -> Self {
        let error = Self::share(error_db);
        let mut kernels = Self::new(setup, TAPS[0]);
        for &taps in &TAPS[1..] {
            if kernels.error <= error {
                break;
            }
            kernels = Self::new(setup, taps);
        }
        kernels
    }

    /// Those of `taps` taps.
    pub fn new(setup: &Setup, taps: usize) -> Self {
        let [range_band, doppler_band] = bands(setup);
        let range = WindowedSinc::new(taps, range_band);
        let doppler = WindowedSinc::new(taps, doppler_band);
        let error = range.error(range_band).hypot(doppler.error(doppler_band));
        Self {
            range,
            doppler,
            error,
        }
    }

    /// The error that kernels may have for an image to keep `error_db`: [`MARGIN_DB`] below, and half of
    /// that power, for the path's model has its share.
    pub fn share(error_db: f64) -> f64 {
        10f64.powf((error_db - MARGIN_DB) / 20.0) / 2f64.sqrt()
    }

    /// Bins that a pixel's place must keep from the gate's edge.
    pub fn margin(taps: usize) -> usize {
        taps / 2 + 1
    }
}

/// Bands of a map along range and along Doppler, cycles a bin: `(F/2) / R` and `u_max f_max / (f_ref D)`.
pub fn bands(setup: &Setup) -> [f64; 2] {
    let count = f64::from(setup.num_frequencies);
    let highest_hz = setup.start_hz + (count - 1.0) * setup.step_hz;
    let last_pulse = (f64::from(setup.num_pulses) - 1.0) / 2.0;
    [
        f64::from(setup.num_frequencies / 2) / f64::from(setup.range_length),
        last_pulse * highest_hz / setup.centre_hz() / f64::from(setup.doppler_length),
    ]
}
