//! Thermal noise: complex Gaussian, independent between samples.
//!
//! Radar equation (Chim 2018 (2.11), with separate transmit and receive gains) for a cross section of `s = 1 m²`, with
//! noise from the antenna temperature and from the receiver. Its noise figure `F` is defined at `T_0 = 290 K`:
//! figure `F` being defined at `T_0 = 290 K`:
//!
//! ```text
//! SNR = P G_t G_r lambda^2 s / ((4 pi)^3 R^4 L) / (k (T_a + (F - 1) T_0) B)
//! ```
//!
//! per raw sample, with `B` the noise bandwidth ([`Waveform::noise_bandwidth_hz`]). With `T_a = T_0` the noise is `k
//! T_0 F B`. `R` is the range of the reference point at the middle of the collection, where the echo defines the
//! scene's unit of amplitude.
//!
//! [`Waveform::noise_bandwidth_hz`]: subaperture_model::radar::Waveform::noise_bandwidth_hz

use num_complex::Complex64;

use super::Moment;
use super::stream::{Kind, stream};
use crate::random::complex_normal;
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::radar::{LinkBudget, Radar, ThermalNoise};
use subaperture_model::units::{amplitude_of_db, power_of_db};

/// Boltzmann constant, joules per kelvin (exact by definition).
const BOLTZMANN_J_K: f64 = 1.380_649e-23;
/// Reference temperature of noise figures, kelvin.
const STANDARD_K: f64 = 290.0;

/// Signal-to-noise ratio of a raw sample for a target of 1 m² at `range_m`, dB; `bandwidth_hz` is the noise bandwidth.
/// For bistatic ranges use their geometric mean.
///
/// Radar of Chim 2018, ch. 5 (4 W, 1.604 dB), with antenna gains of 10 dBi at 1.3 GHz, 100 m and 1 MHz:
///
/// ```
/// use subaperture_model::radar::LinkBudget;
/// use subaperture_simulate::receiver::thermal::snr_db;
///
/// let budget = LinkBudget {
///     power_w: 4.0,
///     transmit_gain_dbi: 10.0,
///     receive_gain_dbi: 10.0,
///     losses_db: 0.0,
///     noise_figure_db: 1.604,
///     temperature_k: 290.0,
/// };
/// // Received: 6.02 + 20 - 12.74 - 32.98 - 80 dBW; noise: -143.98 + 1.60 dBW.
/// assert!((snr_db(&budget, 1.3e9, 100.0, 1e6) - 42.68).abs() < 0.02);
/// ```
pub fn snr_db(budget: &LinkBudget, centre_hz: f64, range_m: f64, bandwidth_hz: f64) -> f64 {
    let db = |ratio: f64| 10.0 * libm::log10(ratio);
    let wavelength_m = SPEED_OF_LIGHT_M_S / centre_hz;
    let received_db = db(budget.power_w)
        + budget.transmit_gain_dbi
        + budget.receive_gain_dbi
        + 2.0 * db(wavelength_m)
        - 3.0 * db(4.0 * std::f64::consts::PI)
        - 4.0 * db(range_m)
        - budget.losses_db;
    let figure = power_of_db(budget.noise_figure_db);
    let temperature_k = budget.temperature_k + (figure - 1.0) * STANDARD_K;
    received_db - db(BOLTZMANN_J_K * temperature_k * bandwidth_hz)
}

/// Standard deviation of I and of Q.
pub(super) fn deviation(noise: &ThermalNoise, radar: &Radar, range_m: f64) -> Result<f64, String> {
    let power_db = match noise {
        ThermalNoise::Relative { power_db } => *power_db,
        ThermalNoise::Equation(budget) => {
            let waveform = &radar.waveform;
            let bandwidth_hz = waveform.noise_bandwidth_hz(radar.pri_s);
            -snr_db(budget, waveform.centre_hz(), range_m, bandwidth_hz)
        }
    };
    let deviation = amplitude_of_db(power_db) * std::f64::consts::FRAC_1_SQRT_2;
    if deviation.is_finite() {
        Ok(deviation)
    } else {
        Err(format!(
            "thermal noise power of {power_db} dB: expected a finite value, check the link budget"
        ))
    }
}

/// Add noise to the samples of a pulse.
pub(super) fn add(moment: &Moment, seed: u64, deviation: f64, samples: &mut [Complex64]) {
    let mut random = stream(seed, Kind::Thermal, moment.receiver, moment.pulse);
    for z in samples {
        *z += complex_normal(&mut random) * deviation;
    }
}
