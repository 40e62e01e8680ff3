//! What an aperture resolves, and how densely it must be sampled.
//!
//! With `theta` half the angle that the aperture spans seen from the scatterer, the phase `4 pi R(x) / lambda`
//! along the track has spatial frequencies from `-2 sin(theta) / lambda` to `+2 sin(theta) / lambda`:
//!
//! ```text
//! cross-range resolution   lambda / (4 sin theta)                          Chim 2018, (2.40)
//! Nyquist's spacing        lambda / (4 sin theta)                          (2.29), (2.38)
//! range resolution         c / (2 B)                                       Schone 2020, 2.1
//! unambiguous range        c / (2 PRF) between pulses, c / (2 step) between profiles
//! unambiguous cross-range  lambda R / (2 d)
//! ```
//!
//! Where the aperture is the shorter, `L` at range `R`, `sin theta = (L / 2) / sqrt(R^2 + L^2 / 4)`, hence
//! `lambda R / (2 L)` for `L << R`: (4.3), which is `delta / R`, an angle. (In Chim (2.34) the factor `4 pi /
//! lambda` of the phase is missing, and back in (2.35); (4.3) holds for small angles only: the
//! root adds `L^2 / 8 R^2`.)
//!
//! Two widths ask for a spacing. The *beam* of full width `theta_b`: echoes come from all of it, so raw pulses need
//! `lambda / (4 sin(theta_b / 2))`, or what lies outside the scene folds into it. The *scene* of width `W` across
//! the line of sight: relative to its centre its Doppler band is that of the angle it subtends, `2 atan(W / 2R)`,
//! and a coarser spacing images it twice. The pulse rate is speed over spacing; wavelengths are those of the
//! highest frequency, where sampling is hardest, and of the carrier for resolution.

use serde::Serialize;

use subaperture_model::SPEED_OF_LIGHT_M_S;

/// Cross-range resolution of an aperture that spans `2 half_angle_rad`, metres: Rayleigh's, peak to null.
pub fn cross_range_resolution_m(wavelength_m: f64, half_angle_rad: f64) -> f64 {
    wavelength_m / (4.0 * half_angle_rad.sin())
}

/// Half the angle that a broadside aperture spans, radians.
pub fn half_angle_rad(aperture_m: f64, range_m: f64) -> f64 {
    (aperture_m / 2.0).atan2(range_m)
}

/// Range resolution, metres.
pub fn range_resolution_m(bandwidth_hz: f64) -> f64 {
    SPEED_OF_LIGHT_M_S / (2.0 * bandwidth_hz)
}

/// Slant range from which echoes arrive before the next pulse leaves, metres.
pub fn unambiguous_range_m(prf_hz: f64) -> f64 {
    SPEED_OF_LIGHT_M_S / (2.0 * prf_hz)
}

/// What a width of angles asks of the pulses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Need {
    /// The whole angle, radians.
    pub angle_rad: f64,
    /// Largest distance from pulse to pulse, metres.
    pub spacing_m: f64,
    /// Band of Doppler frequencies, and the least pulse rate, hertz; `None` if the speed is not known.
    pub doppler_band_hz: Option<f64>,
}

impl Need {
    /// For a whole angle below half a turn.
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
    fn table_4_1() {
        let wavelength_m = SPEED_OF_LIGHT_M_S / 10e9;
        // 130 m at 5 km: 0.57653 m by (4.3), and 130^2 / (8 5000^2) = 8.45e-5 of it more.
        let resolution_m = cross_range_resolution_m(wavelength_m, half_angle_rad(130.0, 5000.0));
        let plain_m = wavelength_m * 5000.0 / 260.0;
        assert!((resolution_m / plain_m - 1.0 - 8.45e-5).abs() < 1e-8);
        assert!((range_resolution_m(200e6) - 0.749_481).abs() < 1e-6);
        assert!((unambiguous_range_m(1000.0) - 149_896.229).abs() < 1e-6);
    }

    #[test]
    fn nyquist_is_where_the_edge_of_the_beam_turns_half_a_cycle_a_pulse() {
        // Phase from pulse to pulse of a scatterer at the beam's edge, from the geometry itself.
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
