//! Scatterer with a flash: strong within a narrow range of azimuth about its normal.
//!
//! The amplitude towards the azimuth `phi` from the normal is `a exp(-2 ln 2 (phi / w)^2)` for `|phi| < 90 deg`, with the half-power width `w` of
//! the flash, and independent of the elevation, as of a vertical plate with the ground before it (dihedral). Its power has the mean over all
//! azimuths
//!
//! ```text
//! |a|^2 w sqrt(pi / (4 ln 2)) erf(pi sqrt(ln 2) / w) / (2 pi)
//! ```
//!
//! With bistatic antennas the azimuth is that of the bisector.

use std::f64::consts::{FRAC_PI_2, LN_2, PI, TAU};

use glam::{DVec2, DVec3};
use num_complex::Complex64;

use super::MovingPoint;
use crate::Scatterer;

/// Scatterer of constant velocity whose amplitude depends on the azimuth of the radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    /// Position at time 0, and amplitude along the normal.
    pub start: Scatterer,
    /// Velocity, metres per second.
    pub velocity_m_s: DVec3,
    /// Horizontal normal, a unit vector; `None` for equal amplitudes towards all azimuths.
    pub normal: Option<DVec2>,
    /// Half-power width of the flash, radians.
    pub width_rad: f64,
}

impl Facet {
    /// Position at a time, metres.
    pub fn position_m(&self, time_s: f64) -> DVec3 {
        self.start.position_m + self.velocity_m_s * time_s
    }

    /// Gain of the amplitude towards a direction from the scatterer.
    pub fn gain(&self, towards: DVec3) -> f64 {
        let Some(normal) = self.normal else {
            return 1.0;
        };
        let flat = towards.truncate();
        let azimuth = libm::atan2(normal.perp_dot(flat), normal.dot(flat)).abs();
        match azimuth < FRAC_PI_2 {
            true => libm::exp(-2.0 * LN_2 * (azimuth / self.width_rad).powi(2)),
            false => 0.0,
        }
    }

    /// Same facet with the amplitude towards a direction.
    pub(crate) fn towards(&self, towards: DVec3) -> MovingPoint {
        MovingPoint {
            start: Scatterer {
                amplitude: self.start.amplitude * self.gain(towards),
                ..self.start
            },
            velocity_m_s: self.velocity_m_s,
        }
    }
}

/// Amplitude along the normal of a flash of a width whose power has this mean over azimuth, with a phase in turns.
pub(super) fn flash(mean_m2: f64, width_rad: f64, phase: Complex64) -> Complex64 {
    let inside = libm::erf(PI * LN_2.sqrt() / width_rad);
    let mean = width_rad * (PI / (4.0 * LN_2)).sqrt() * inside / TAU;
    phase * (mean_m2 / mean).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flash_has_half_its_power_at_half_its_width_and_stated_mean() {
        for width_rad in [0.02f64, 0.3, 1.0] {
            let facet = Facet {
                start: Scatterer {
                    position_m: DVec3::ZERO,
                    amplitude: flash(7.0, width_rad, Complex64::I),
                },
                velocity_m_s: DVec3::ZERO,
                normal: Some(DVec2::new(0.6, 0.8)),
                width_rad,
            };
            let towards = |azimuth: f64| {
                let own = DVec2::new(0.6, 0.8).rotate(DVec2::from_angle(azimuth));
                facet.gain((own * 3.0).extend(5.0)).powi(2)
            };
            assert!((towards(0.0) - 1.0).abs() < 1e-12);
            assert!((towards(width_rad / 2.0) - 0.5).abs() < 1e-12);
            assert_eq!(towards(1.6), 0.0);
            // Mean by the midpoint rule: exact for smooth periodic functions, up to the cut at 90 degrees, exp(-6.8) for 1 rad.
            let count = 20_000;
            let mean = (0..count)
                .map(|i| towards((f64::from(i) + 0.5) / f64::from(count) * TAU - PI))
                .sum::<f64>()
                / f64::from(count);
            let total = mean * facet.start.amplitude.norm_sqr();
            assert!((total / 7.0 - 1.0).abs() < 1e-3, "{width_rad}: {total}");
        }
    }
}
