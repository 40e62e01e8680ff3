//! Interpolation kernels for the maps of a setup.

use subaperture_core::stream::Setup;

use subaperture_focus::MARGIN_DB;
use subaperture_signal::windowed_sinc::{TAPS, WindowedSinc};

/// Interpolation kernels in range and Doppler with equal numbers of taps.
#[derive(Clone, Debug)]
pub struct Kernels {
    /// Range kernel.
    pub range: WindowedSinc,
    /// Doppler kernel.
    pub doppler: WindowedSinc,
    /// Predicted relative RMS error of both kernels together.
    pub error: f64,
}

impl Kernels {
    /// Kernels with the fewest taps that keep [`Self::share`] of a bound on the image error in dB, or with the most taps if none
    /// keep it.
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

    /// Kernels with `taps` taps.
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

    /// Error allowed for kernels if the image is to keep `error_db`: [`MARGIN_DB`] below, and half of that power, since the path
    /// model takes the other half.
    pub fn share(error_db: f64) -> f64 {
        10f64.powf((error_db - MARGIN_DB) / 20.0) / 2f64.sqrt()
    }

    /// Minimum distance in bins between a pixel's position and the edge of the gate.
    pub fn margin(taps: usize) -> usize {
        taps / 2 + 1
    }
}

/// Bandwidths of a map in range and Doppler in cycles per bin: `(F/2) / R` and `u_max f_max / (f_ref D)`.
pub fn bands(setup: &Setup) -> [f64; 2] {
    let count = f64::from(setup.num_frequencies);
    let highest_hz = setup.start_hz + (count - 1.0) * setup.step_hz;
    let last_pulse = (f64::from(setup.num_pulses) - 1.0) / 2.0;
    [
        f64::from(setup.num_frequencies / 2) / f64::from(setup.range_length),
        last_pulse * highest_hz / setup.centre_hz() / f64::from(setup.doppler_length),
    ]
}
