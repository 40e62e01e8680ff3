//! Resolution of an aperture, and its Nyquist sampling.
//!
//! With `theta` half the angle that the aperture subtends at the scatterer, the phase `4 pi R(x) / lambda`
//! along the track has spatial frequencies from `-2 sin(theta) / lambda` to `+2 sin(theta) / lambda`:
//!
//! ```text
//! cross-range resolution   lambda / (4 sin theta)                          Chim 2018, (2.40)
//! Nyquist spacing          lambda / (4 sin theta)                          (2.29), (2.38)
//! range resolution         c / (2 B)                                       Schone 2020, 2.1
//! unambiguous range        c / (2 PRF) by the pulse rate, c / (2 step) by the frequency step
//! unambiguous cross-range  lambda R / (2 d)
//! ```
//!
//! Where the aperture length `L` at range `R` is the limit, `sin theta = (L / 2) / sqrt(R^2 + L^2 / 4)`, hence
//! `lambda R / (2 L)` for `L << R`: (4.3), which gives the angle `delta / R`. (Chim (2.34) omits the factor `4 pi /
//! lambda` of the phase, and (2.35) has it again; (4.3) holds for small angles only: the
//! square root adds `L^2 / 8 R^2`.)
//!
//! Two widths determine the spacing. For the *beam* of full width `theta_b`, raw pulses need
//! `lambda / (4 sin(theta_b / 2))`; otherwise echoes from outside the scene alias into it. For the *scene* of width `W` across
//! the line of sight, the Doppler band relative to its centre is that of the angle it subtends, `2 atan(W / 2R)`,
//! and a coarser spacing produces azimuth ambiguities. The pulse rate is speed over spacing. Sampling uses the wavelength of the
//! highest frequency, resolution that of the carrier.

use serde::Serialize;

use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Cross-range resolution (Rayleigh, peak to null) of an aperture that subtends `2 half_angle_rad`, metres.
pub fn cross_range_resolution_m(wavelength_m: f64, half_angle_rad: f64) -> f64 {
    wavelength_m / (4.0 * half_angle_rad.sin())
}

/// Half the angle that a broadside aperture subtends, radians.
pub fn half_angle_rad(aperture_m: f64, range_m: f64) -> f64 {
    (aperture_m / 2.0).atan2(range_m)
}

/// Range resolution, metres.
pub fn range_resolution_m(bandwidth_hz: f64) -> f64 {
    SPEED_OF_LIGHT_M_S / (2.0 * bandwidth_hz)
}

/// Unambiguous slant range: echoes arrive before the next pulse, metres.
pub fn unambiguous_range_m(prf_hz: f64) -> f64 {
    SPEED_OF_LIGHT_M_S / (2.0 * prf_hz)
}

/// Pulse sampling needed for an angular width.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Need {
    /// Full angle, radians.
    pub angle_rad: f64,
    /// Largest pulse spacing, metres.
    pub spacing_m: f64,
    /// Doppler bandwidth, equal to the smallest pulse rate, hertz; `None` if the speed is unknown.
    pub doppler_band_hz: Option<f64>,
}

impl Need {
    /// Compute for a full angle below pi.
    pub fn new(angle_rad: f64, shortest_wavelength_m: f64, velocity_m_s: Option<f64>) -> Self {
        let spacing_m = cross_range_resolution_m(shortest_wavelength_m, angle_rad / 2.0);
        Self {
            angle_rad,
            spacing_m,
            doppler_band_hz: velocity_m_s.map(|velocity| velocity / spacing_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolution_agrees_with_table_4_1() {
        let wavelength_m = SPEED_OF_LIGHT_M_S / 10e9;
        // 130 m at 5 km: 0.57653 m by (4.3), and 130^2 / (8 5000^2) = 8.45e-5 of it more.
        let resolution_m = cross_range_resolution_m(wavelength_m, half_angle_rad(130.0, 5000.0));
        let plain_m = wavelength_m * 5000.0 / 260.0;
        assert!((resolution_m / plain_m - 1.0 - 8.45e-5).abs() < 1e-8);
        assert!((range_resolution_m(200e6) - 0.749_481).abs() < 1e-6);
        assert!((unambiguous_range_m(1000.0) - 149_896.229).abs() < 1e-6);
    }

    #[test]
    fn nyquist_spacing_turns_beam_edge_by_half_a_cycle_per_pulse() {
        // Phase step between pulses for a scatterer at the beam's edge, from geometry.
        let (wavelength_m, angle_rad, range_m) = (0.03, 0.4f64, 1e6);
        let need = Need::new(angle_rad, wavelength_m, Some(100.0));
        let x_m = range_m * (angle_rad / 2.0).tan();
        let range_at = |shift_m: f64| range_m.hypot(x_m + shift_m);
        let cycles = 2.0 * (range_at(need.spacing_m) - range_at(0.0)) / wavelength_m;
        // Curvature: spacing / range.
        assert!((cycles - 0.5).abs() < 1e-6, "{cycles}");
        assert!((need.doppler_band_hz.unwrap() - 100.0 / need.spacing_m).abs() < 1e-9);
    }
}
