//! Antenna patterns: amplitude over direction.
//!
//! With boresight `b`, up vector `u` and `l = u x b` (left, looking along `b`), a unit direction `d` has
//!
//! ```text
//! azimuth = atan2(d.l, d.b)     elevation = asin(d.u)
//! Gaussian: exp(-2 ln 2 ((azimuth / w_az)^2 + (elevation / w_el)^2))
//! Cosine:   cos(azimuth)^q_az cos(elevation)^q_el,  d.b > 0;  0 behind;  q = -ln 2 / (2 ln cos(w / 2))
//! Aperture: sinc(h d.l / sin(w_az / 2)) sinc(h d.u / sin(w_el / 2)),  d.b > 0;  0 behind
//! Table:    bilinear in azimuth and elevation ([`PatternTable`](super::PatternTable))
//! ```
//!
//! `sinc(x) = sin(pi x) / (pi x)` and `sinc(h) = 1 / sqrt 2`, so that the patterns have half their power at half the
//! widths. The aperture pattern is the far field of a uniformly illuminated rectangle in an opaque screen, of length
//! `h / sin(w / 2)` wavelengths. Its side lobes alternate in sign; the first is at -13.26 dB. The pattern of one
//! frequency is used for the whole band (a real aperture's narrows by the relative bandwidth over the band).
//! Polarisation and the element factor are neglected.
//!
//! The boresight is fixed in the body, or steered to a point of the scene ([`Antenna::aim_m`]). The up vector of a steered
//! beam is the component of the body's that is orthogonal to the boresight.
//!
//! Accuracy: half-power angles to 1e-12, side lobe to 0.01 dB, by the tests below.

use std::f64::consts::{LN_2, PI};

use glam::{DQuat, DVec3};

use super::{Antenna, Pattern};

/// Positive solution of `sin(pi x) / (pi x) = 1 / sqrt 2`.
const HALF_POWER: f64 = 0.442_946_470_689_452_3;

impl Antenna {
    /// One-way amplitude in a direction, 1 on boresight; negative where the field has the opposite sign.
    ///
    /// `attitude` is that of the body that carries the antenna, `towards` a unit vector in scene axes. [`Self::aim_m`] has no effect.
    #[inline]
    pub fn amplitude(&self, attitude: DQuat, towards: DVec3) -> f64 {
        if self.pattern == Pattern::Isotropic {
            return 1.0;
        }
        let direction = attitude.conjugate() * towards;
        let left = self.up.cross(self.boresight);
        self.pattern
            .amplitude([self.boresight, left, self.up].map(|axis| direction.dot(axis)))
    }

    /// One-way amplitude from the antenna at `from_m` to a point, both in scene axes, with the boresight fixed in the body or steered.
    pub fn amplitude_at(&self, attitude: DQuat, from_m: DVec3, point_m: DVec3) -> f64 {
        let towards = (point_m - from_m).normalize_or_zero();
        if self.aim_m.is_none() || self.pattern == Pattern::Isotropic {
            return self.amplitude(attitude, towards);
        }
        let axes = self.axes(attitude, from_m);
        self.pattern.amplitude(axes.map(|axis| towards.dot(axis)))
    }

    /// Boresight, left and up of an antenna at `from_m`: unit vectors in scene axes.
    pub fn axes(&self, attitude: DQuat, from_m: DVec3) -> [DVec3; 3] {
        let [fixed, up] = [self.boresight, self.up].map(|axis| attitude * axis);
        let steered = self
            .aim_m
            .and_then(|aim_m| (aim_m - from_m).try_normalize());
        let Some(boresight) = steered else {
            return [fixed, up.cross(fixed), up];
        };
        // The body's up vector, or its boresight if that is the steered direction.
        let aside = |axis: DVec3| axis - boresight * axis.dot(boresight);
        let across = [up, fixed].map(aside);
        let up = match across[0].length_squared() > 1e-12 {
            true => across[0].normalize(),
            false => across[1].normalize_or(boresight.any_orthonormal_vector()),
        };
        [boresight, up.cross(boresight), up]
    }

    /// Half-power width in azimuth, radians; `None` for a pattern without one.
    pub fn width_rad(&self) -> Option<f64> {
        self.pattern.widths_rad()[0]
    }

    /// Narrowest half-power width, radians; `None` for a pattern without one.
    pub fn narrowest_rad(&self) -> Option<f64> {
        let widths = self.pattern.widths_rad();
        widths.into_iter().flatten().min_by(f64::total_cmp)
    }
}

impl Pattern {
    /// Full half-power widths in azimuth and elevation, radians; `None` along an axis without one.
    pub fn widths_rad(&self) -> [Option<f64>; 2] {
        match self {
            Self::Isotropic => [None; 2],
            Self::Gaussian {
                azimuth_rad,
                elevation_rad,
            }
            | Self::Cosine {
                azimuth_rad,
                elevation_rad,
            }
            | Self::Aperture {
                azimuth_rad,
                elevation_rad,
            } => [Some(*azimuth_rad), Some(*elevation_rad)],
            Self::Table(table) => table.widths_rad(),
        }
    }

    /// Amplitude in a direction with these cosines to boresight, left and up.
    pub(super) fn amplitude(&self, [ahead, left, up]: [f64; 3]) -> f64 {
        let azimuth = || libm::atan2(left, ahead);
        let elevation = || libm::asin(up.clamp(-1.0, 1.0));
        match self {
            Self::Isotropic => 1.0,
            Self::Gaussian {
                azimuth_rad,
                elevation_rad,
            } => {
                let (azimuth, elevation) = (azimuth() / azimuth_rad, elevation() / elevation_rad);
                libm::exp(-2.0 * LN_2 * (azimuth * azimuth + elevation * elevation))
            }
            Self::Cosine {
                azimuth_rad,
                elevation_rad,
            } if ahead > 0.0 => {
                // cos(elevation)^2 = ahead^2 + left^2, and cos(azimuth) is ahead over its root.
                let level = libm::hypot(ahead, left).min(1.0);
                libm::pow(
                    ahead / libm::hypot(ahead, left),
                    cosine_exponent(*azimuth_rad),
                ) * libm::pow(level, cosine_exponent(*elevation_rad))
            }
            Self::Aperture {
                azimuth_rad,
                elevation_rad,
            } if ahead > 0.0 => {
                sinc(HALF_POWER * left / libm::sin(azimuth_rad / 2.0))
                    * sinc(HALF_POWER * up / libm::sin(elevation_rad / 2.0))
            }
            Self::Cosine { .. } | Self::Aperture { .. } => 0.0,
            Self::Table(table) => table.amplitude(azimuth(), elevation()),
        }
    }
}

/// Exponent of the amplitude `cos(angle)^q` with half the power at half of a width: `-ln 2 / (2 ln cos(w / 2))`.
pub fn cosine_exponent(width_rad: f64) -> f64 {
    let sine = libm::sin(width_rad / 4.0);
    // cos(w / 2) = 1 - 2 sin(w / 4)^2, without cancellation for a narrow beam.
    -LN_2 / (2.0 * libm::log1p(-2.0 * sine * sine))
}

fn sinc(x: f64) -> f64 {
    // Below 1e-8 the series 1 - (pi x)^2 / 6 is 1 to the last bit.
    if x.abs() < 1e-8 {
        1.0
    } else {
        libm::sin(PI * x) / (PI * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AZIMUTH_RAD: f64 = 0.3;
    const ELEVATION_RAD: f64 = 0.7;

    /// Antenna that looks to the left of the body, with the body's up vector.
    fn antenna(pattern: Pattern) -> Antenna {
        Antenna {
            name: "side".to_owned(),
            offset_m: DVec3::ZERO,
            boresight: DVec3::Y,
            up: DVec3::Z,
            pattern,
            aim_m: None,
        }
    }

    fn both() -> [Pattern; 3] {
        [
            Pattern::Cosine {
                azimuth_rad: AZIMUTH_RAD,
                elevation_rad: ELEVATION_RAD,
            },
            Pattern::Gaussian {
                azimuth_rad: AZIMUTH_RAD,
                elevation_rad: ELEVATION_RAD,
            },
            Pattern::Aperture {
                azimuth_rad: AZIMUTH_RAD,
                elevation_rad: ELEVATION_RAD,
            },
        ]
    }

    /// Body direction at an azimuth (about z from y) and an elevation.
    fn direction(azimuth: f64, elevation: f64) -> DVec3 {
        DVec3::new(
            -azimuth.sin() * elevation.cos(),
            azimuth.cos() * elevation.cos(),
            elevation.sin(),
        )
    }

    #[test]
    fn power_is_one_on_boresight_and_half_at_half_widths() {
        for pattern in both() {
            let antenna = antenna(pattern);
            let power = |az, el| {
                antenna
                    .amplitude(DQuat::IDENTITY, direction(az, el))
                    .powi(2)
            };
            assert!((power(0.0, 0.0) - 1.0).abs() < 1e-15);
            for sign in [-1.0, 1.0] {
                // The slope of power over angle is below 10 / rad, the constant has 16 digits.
                assert!((power(sign * AZIMUTH_RAD / 2.0, 0.0) - 0.5).abs() < 1e-12);
                assert!((power(0.0, sign * ELEVATION_RAD / 2.0) - 0.5).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn aperture_has_first_side_lobe_at_minus_13_26_db_and_no_back_lobe() {
        let antenna = antenna(both()[2].clone());
        let amplitude = |az: f64| antenna.amplitude(DQuat::IDENTITY, direction(az, 0.0));
        // Between the first nulls, sin(az) = sin(w / 2) / h and twice that.
        let null = (AZIMUTH_RAD / 2.0).sin() / HALF_POWER;
        assert!(amplitude(null.asin()).abs() < 1e-12);
        let lowest = (0..=10_000)
            .map(|i| amplitude((null * (1.0 + f64::from(i) / 1e4)).asin()))
            .fold(0.0, f64::min);
        // The lobe's extremum is where tan(pi x) = pi x, x = 1.4303: -0.217234, -13.2615 dB. Steps of
        // 1e-4 of a null miss it by (pi 1e-4)^2 / 8 of itself.
        assert!((lowest + 0.217_234).abs() < 1e-6, "{lowest}");
        assert!((20.0 * lowest.abs().log10() + 13.26).abs() < 0.01);
        assert_eq!(amplitude(3.0), 0.0);
    }

    #[test]
    fn beam_rotates_with_body_and_azimuth_is_about_up() {
        // Nose along scene y: the beam, to the left, points along scene -x.
        let attitude = DQuat::from_rotation_z(PI / 2.0);
        for pattern in both() {
            let antenna = antenna(pattern);
            assert!((antenna.amplitude(attitude, DVec3::NEG_X) - 1.0).abs() < 1e-15);
            let aside = DQuat::from_rotation_z(AZIMUTH_RAD / 2.0) * DVec3::NEG_X;
            assert!((antenna.amplitude(attitude, aside).powi(2) - 0.5).abs() < 1e-12);
            let above = DQuat::from_rotation_y(ELEVATION_RAD / 2.0) * DVec3::NEG_X;
            assert!((antenna.amplitude(attitude, above).powi(2) - 0.5).abs() < 1e-12);
        }
        assert_eq!(
            antenna(Pattern::Isotropic).amplitude(attitude, DVec3::X),
            1.0
        );
    }

    #[test]
    fn cosine_power_has_stated_exponent_and_no_back_lobe() {
        // A width of 120 deg has cos(w / 2) = 1/2: half the power is cos^(1/2) in amplitude. One of 90 deg has q = 1.
        assert!((cosine_exponent(120f64.to_radians()) - 0.5).abs() < 1e-14);
        assert!((cosine_exponent(PI / 2.0) - 1.0).abs() < 1e-14);
        let antenna = antenna(Pattern::Cosine {
            azimuth_rad: PI / 2.0,
            elevation_rad: 120f64.to_radians(),
        });
        let amplitude = |az, el| antenna.amplitude(DQuat::IDENTITY, direction(az, el));
        assert!((amplitude(0.4, 0.0) - 0.4f64.cos()).abs() < 1e-14);
        assert!((amplitude(0.4, -0.7) - 0.4f64.cos() * 0.7f64.cos().sqrt()).abs() < 1e-14);
        assert_eq!(amplitude(2.0, 0.1), 0.0);
        // A narrow beam: half the power to the 11 digits that a width of 1e-3 rad leaves of a power near 1.
        let q = cosine_exponent(1e-3);
        assert!((libm::pow(libm::cos(5e-4), 2.0 * q) - 0.5).abs() < 1e-8);
    }

    #[test]
    fn steered_beam_points_at_its_aim_and_keeps_up() {
        let from_m = DVec3::new(10.0, -300.0, 100.0);
        let mut steered = antenna(both()[1].clone());
        let aim_m = DVec3::new(-40.0, 20.0, 0.0);
        steered.aim_m = Some(aim_m);
        let attitude = DQuat::from_rotation_z(0.3) * DQuat::from_rotation_x(0.1);
        let of = |antenna: &Antenna, point_m| antenna.amplitude_at(attitude, from_m, point_m);
        let at = |point_m| of(&steered, point_m);
        assert!((at(aim_m) - 1.0).abs() < 1e-12);
        // Directions off by half the azimuth width about up, and by half the elevation width towards up.
        let [boresight, left, up] = steered.axes(attitude, from_m);
        assert!(up.dot(boresight).abs() < 1e-15 && up.dot(attitude * DVec3::Z) > 0.9);
        assert!((up.cross(boresight) - left).length() < 1e-15);
        let half = AZIMUTH_RAD / 2.0;
        let aside = from_m + 50.0 * (boresight * half.cos() - left * half.sin());
        assert!((at(aside).powi(2) - 0.5).abs() < 1e-12);
        let half = ELEVATION_RAD / 2.0;
        let above = from_m + 50.0 * (boresight * half.cos() + up * half.sin());
        assert!((at(above).powi(2) - 0.5).abs() < 1e-12);
        // Without an aim, the amplitude is that of the body's boresight.
        steered.aim_m = None;
        let towards = (aim_m - from_m).normalize();
        let fixed = steered.amplitude(attitude, towards);
        assert_eq!(of(&steered, aim_m), fixed);
    }
}
