//! Radar equation: signal-to-noise ratio (SNR) per sample, pulse and image, and noise-equivalent sigma zero.
//!
//! Echo of a radar cross-section `sigma` (Chim 2018, (2.11)) and thermal noise in the sampling
//! bandwidth `B_n`:
//!
//! ```text
//! P_rx = P_tx G_tx G_rx lambda^2 sigma / ((4 pi)^3 R_tx^2 R_rx^2 L)
//! P_n  = k_B (T_a + (F - 1) T_0) B_n,   T_0 = 290 K
//! SNR  = P_rx / P_n
//! ```
//!
//! `F` is the receiver's noise figure (1.604 dB for Chim's chain, 5.2.1), `T_a` the antenna noise
//! temperature. With `T_a = T_0` the noise power is `k T_0 F B_n`.
//!
//! A matched filter over a pulse of duration `T` integrates `T B_n` samples coherently, and an image integrates `N` pulses, independent of the
//! sampling rate: `SNR_pulse = SNR T B_n`, `SNR_image = N SNR_pulse`. Clutter
//! of `sigma0` fills a resolution cell of `rho_r rho_x`; the clutter with the power of the noise is the
//! noise-equivalent sigma zero (NESZ),
//!
//! ```text
//! NESZ = 1 / (SNR_image(1 m^2) rho_r rho_x)       rho_r on the ground
//! ```
//!
//! Neglected: propagation losses other than `L`, antenna patterns (boresight gains), window losses (up to 2 dB).

use std::f64::consts::PI;

use serde::Serialize;

use subaperture_model::radar::LinkBudget;

/// Boltzmann constant, joules per kelvin (exact by definition).
pub const BOLTZMANN_J_K: f64 = 1.380_649e-23;
/// Reference temperature of noise figures, kelvin.
pub const STANDARD_TEMPERATURE_K: f64 = 290.0;

/// Power ratio of a value in decibels.
fn ratio(db: f64) -> f64 {
    10f64.powf(db / 10.0)
}

/// Received power of 1 m² at the given one-way ranges, watts.
pub fn echo_power_w(
    link: &LinkBudget,
    wavelength_m: f64,
    transmit_range_m: f64,
    receive_range_m: f64,
) -> f64 {
    let gains = ratio(link.transmit_gain_dbi + link.receive_gain_dbi - link.losses_db);
    let spread = (4.0 * PI).powi(3) * (transmit_range_m * receive_range_m).powi(2);
    link.power_w * gains * wavelength_m.powi(2) / spread
}

/// Thermal noise power in `bandwidth_hz`, watts.
pub fn noise_power_w(link: &LinkBudget, bandwidth_hz: f64) -> f64 {
    let receiver_k = (ratio(link.noise_figure_db) - 1.0) * STANDARD_TEMPERATURE_K;
    BOLTZMANN_J_K * (link.temperature_k + receiver_k) * bandwidth_hz
}

/// Signal-to-noise ratio (power ratio) of a raw sample of 1 m² in `bandwidth_hz`.
pub fn sample_snr(
    link: &LinkBudget,
    wavelength_m: f64,
    transmit_range_m: f64,
    receive_range_m: f64,
    bandwidth_hz: f64,
) -> f64 {
    echo_power_w(link, wavelength_m, transmit_range_m, receive_range_m)
        / noise_power_w(link, bandwidth_hz)
}

/// Sensitivity of a radar, dB.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Received power of 1 m², dBW.
    pub echo_dbw: f64,
    /// SNR of 1 m² in a raw sample of the full bandwidth, dB.
    pub sample_snr_db: f64,
    /// SNR of 1 m² after the matched filter, dB.
    pub pulse_snr_db: f64,
    /// SNR of 1 m² in the image, dB.
    pub image_snr_db: f64,
    /// Noise-equivalent sigma zero, dB; `None` without a resolution cell.
    pub noise_equivalent_sigma0_db: Option<f64>,
}

/// Illumination of the scene: further inputs of the sensitivity in addition to the link budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Illumination {
    /// Wavelength, metres.
    pub wavelength_m: f64,
    /// One-way ranges to transmitter and receiver, metres.
    pub ranges_m: [f64; 2],
    /// Bandwidth, hertz.
    pub bandwidth_hz: f64,
    /// Pulse duration, seconds.
    pub pulse_s: f64,
    /// Number of pulses in the image.
    pub num_pulses: usize,
    /// Ground resolution in range and cross-range, metres; `None` if unresolved.
    pub cell_m: Option<[f64; 2]>,
}

impl Sensitivity {
    /// Evaluate the equations at the head of this module.
    pub fn new(link: &LinkBudget, lit: &Illumination) -> Self {
        let db = |ratio: f64| 10.0 * ratio.log10();
        let [out_m, back_m] = lit.ranges_m;
        let sample = sample_snr(link, lit.wavelength_m, out_m, back_m, lit.bandwidth_hz);
        let pulse = sample * lit.pulse_s * lit.bandwidth_hz;
        let image = pulse * lit.num_pulses as f64;
        Self {
            echo_dbw: db(echo_power_w(link, lit.wavelength_m, out_m, back_m)),
            sample_snr_db: db(sample),
            pulse_snr_db: db(pulse),
            image_snr_db: db(image),
            noise_equivalent_sigma0_db: lit
                .cell_m
                .map(|[range_m, cross_m]| -db(image * range_m * cross_m)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn link_budget_agrees_with_hand_calculation() {
        // 10 W, 20 dBi twice, 3 cm, 1 km, no losses, in dB: 10 + 40 - 30.458 - 32.976 - 120 dBW = -133.434 dBW.
        // Noise: -228.599 + 24.624 (290 K) + 80 (100 MHz) + 3 = -120.975 dBW.
        let link = LinkBudget {
            power_w: 10.0,
            transmit_gain_dbi: 20.0,
            receive_gain_dbi: 20.0,
            losses_db: 0.0,
            noise_figure_db: 3.0,
            temperature_k: 290.0,
        };
        let echo_db = 10.0 * echo_power_w(&link, 0.03, 1000.0, 1000.0).log10();
        let noise_db = 10.0 * noise_power_w(&link, 100e6).log10();
        assert!((echo_db + 133.434).abs() < 2e-3, "{echo_db}");
        assert!((noise_db + 120.975).abs() < 2e-3, "{noise_db}");
        let snr_db = 10.0 * sample_snr(&link, 0.03, 1000.0, 1000.0, 100e6).log10();
        assert!((snr_db + 12.459).abs() < 4e-3, "{snr_db}");
        // 1 us is 20 dB at 100 MHz, 1000 pulses 30 dB: 37.541 dB; a cell of 0.5 m² needs 3.010 dB more clutter.
        let lit = Illumination {
            wavelength_m: 0.03,
            ranges_m: [1000.0, 1000.0],
            bandwidth_hz: 100e6,
            pulse_s: 1e-6,
            num_pulses: 1000,
            cell_m: Some([1.0, 0.5]),
        };
        let whole = Sensitivity::new(&link, &lit);
        assert!((whole.pulse_snr_db - 7.541).abs() < 4e-3, "{whole:?}");
        assert!((whole.image_snr_db - 37.541).abs() < 4e-3, "{whole:?}");
        assert!((whole.noise_equivalent_sigma0_db.unwrap() + 34.531).abs() < 4e-3);
        // With an antenna at 0 K only receiver noise remains: (10^0.3 - 1) of 10^0.3.
        let cold = LinkBudget {
            temperature_k: 0.0,
            ..link
        };
        let part = noise_power_w(&cold, 100e6) / noise_power_w(&link, 100e6);
        assert!((part - (1.0 - 10f64.powf(-0.3))).abs() < 1e-12);
        // Bistatic: doubling one leg costs 6 dB.
        let far = echo_power_w(&link, 0.03, 1000.0, 2000.0);
        assert!((echo_power_w(&link, 0.03, 1000.0, 1000.0) / far - 4.0).abs() < 1e-12);
    }
}
