//! Antenna beam across the track, which selects the pulses that illuminate a point.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Largest change of the beam's angle to the track over the pulses, as a fraction of the beamwidth. A larger change is that of a steered antenna.
const MAX_TURN: f64 = 0.25;

/// Part of the pulses, on either side of a pulse, over which its heading is taken.
const HEADING_PART: usize = 64;

/// Interval of the cone angle about the track, measured from broadside, in which the antennas illuminate the scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// Full beamwidth, radians, in (0, pi).
    pub width_rad: f64,
    /// Squint of the beam centre, radians, positive forward of broadside.
    pub squint_rad: f64,
    /// Origin of width and squint.
    pub source: BeamSource,
    /// Velocity of the target in whose frame the geometry is given, m/s. The velocity of the antennas is that of the geometry plus this one.
    /// `None` for a frame at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_m_s: Option<[f64; 3]>,
}

/// Origin of a beam's width and squint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum BeamSource {
    /// Given by the user.
    Given,
    /// Stated in the recording's antenna description.
    Stated,
    /// Estimated from the azimuth Doppler spectrum of the samples.
    Estimated,
}

impl BeamSource {
    /// Description of the origin that follows the word "beam" in a message.
    pub fn name(self) -> &'static str {
        match self {
            Self::Given => "given",
            Self::Stated => "stated by the recording",
            Self::Estimated => "estimated from the Doppler spectrum",
        }
    }
}

impl Beam {
    /// Create a beam of full width `width_rad` centred at `squint_rad`, for a frame at rest.
    pub fn new(width_rad: f64, squint_rad: f64, source: BeamSource) -> Self {
        Self {
            width_rad,
            squint_rad,
            source,
            target_m_s: None,
        }
    }

    /// Create the beam of two antennas with half-power widths `widths_rad` (of one-way power, along the track) and squints `squints_rad(n)` at pulse `n` of `count`.
    /// `None` for an antenna without a main lobe along the track, such as an isotropic one: it has no share in the beam.
    ///
    /// With widths `w_t` and `w_r` the width is `sqrt(2 / (1 / w_t^2 + 1 / w_r^2))`. At its edges the two-way power of Gaussian patterns is a quarter of
    /// the maximum; two equal antennas have a beam of their own width. The squint is the mean of both weighted by `1 / w^2`, averaged over the pulses.
    ///
    /// `None` if neither antenna has a main lobe, if the squint changes by more than a quarter of the width (a steered antenna), or if the beam reaches
    /// along the track.
    pub fn of_lobes(
        widths_rad: [Option<f64>; 2],
        count: usize,
        squints_rad: impl Fn(usize) -> [f64; 2],
    ) -> Option<Self> {
        let inverse_squares = widths_rad.map(|width| width.map_or(0.0, |w| 1.0 / (w * w)));
        let together: f64 = inverse_squares.iter().sum();
        if together == 0.0 || count == 0 {
            return None;
        }
        let width_rad = (2.0 / together).sqrt();
        let (mut least, mut most, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for n in 0..count {
            let squints = squints_rad(n);
            let shares = [0, 1].map(|i| match inverse_squares[i] > 0.0 {
                true => inverse_squares[i] / together * squints[i],
                false => 0.0,
            });
            let squint_rad: f64 = shares.iter().sum();
            (least, most, sum) = (
                least.min(squint_rad),
                most.max(squint_rad),
                sum + squint_rad,
            );
        }
        let beam = Self::new(width_rad, sum / count as f64, BeamSource::Stated);
        (most - least <= MAX_TURN * width_rad && beam.is_sound()).then_some(beam)
    }

    /// Whether the width is positive and both edges of the beam are less than 90 degrees from broadside.
    pub fn is_sound(&self) -> bool {
        let edge = self.squint_rad.abs() + 0.5 * self.width_rad;
        self.width_rad > 0.0 && edge < std::f64::consts::FRAC_PI_2
    }
}

/// Heading at each of these positions, unit vectors; zero where the positions do not move.
///
/// A heading is the direction from the position 1/64 of the track before to that 1/64 after, at least one position: noise of
/// the positions is averaged out. Positions nearer to an end have the heading of the first or last whole interval, which on a circle is off by up to 1/64 of
/// the arc.
pub fn headings(places_m: &[DVec3]) -> Vec<DVec3> {
    let last = places_m.len().saturating_sub(1);
    let half = (places_m.len() / HEADING_PART).max(1);
    let heading = |n: usize| {
        let from = n.saturating_sub(half).min(last.saturating_sub(2 * half));
        let to = (from + 2 * half).min(last);
        (places_m[to] - places_m[from]).normalize_or_zero()
    };
    (0..places_m.len()).map(heading).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_equal_lobes_keep_their_width_and_one_alone_is_wider() {
        let beam = |widths| Beam::of_lobes(widths, 3, |_| [0.1, 0.3]);
        let both = beam([Some(0.2), Some(0.2)]).unwrap();
        assert!((both.width_rad - 0.2).abs() < 1e-15 && (both.squint_rad - 0.2).abs() < 1e-15);
        let one = beam([None, Some(0.2)]).unwrap();
        assert!((one.width_rad - 0.2 * 2f64.sqrt()).abs() < 1e-15);
        assert!((one.squint_rad - 0.3).abs() < 1e-15);
        assert_eq!(beam([None, None]), None);
        let steered = Beam::of_lobes([Some(0.2); 2], 3, |n| [0.03 * n as f64; 2]);
        assert_eq!(steered, None);
    }

    #[test]
    fn headings_average_noise_of_positions() {
        // 2 cm to either side every other position of 5 cm: a chord of 2 x 15 positions is off by at most 4 cm in 1.5 m.
        let place = |n: usize| {
            DVec3::new(
                0.05 * n as f64,
                if n.is_multiple_of(2) { 0.02 } else { -0.02 },
                0.0,
            )
        };
        let places_m: Vec<DVec3> = (0..1000).map(place).collect();
        for heading in headings(&places_m) {
            assert!(heading.angle_between(DVec3::X) < 0.04 / 1.5);
        }
        assert_eq!(headings(&[DVec3::X; 2]), [DVec3::ZERO; 2]);
        assert_eq!(headings(&[DVec3::ZERO, DVec3::Y]), [DVec3::Y; 2]);
        assert!(headings(&[]).is_empty());
    }
}
