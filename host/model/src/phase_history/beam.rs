//! Antenna beam across the track, which selects the pulses that illuminate a point.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::track::Displacement;

/// Maximum change of the beam's angle to the track over the pulses, as a fraction of the beamwidth. A larger change
/// makes a beam with directions over time.
const MAX_TURN: f64 = 0.25;

/// Maximum error of interpolated directions of a rotating beam, as a fraction of half the beamwidth.
const AIM_ERROR: f64 = 0.01;

/// The heading at a pulse is averaged over this fraction, 1 / 64, of the pulses on either side.
const HEADING_PART: usize = 64;

/// Interval of the cone angle about the track, measured from broadside, in which the antennas illuminate the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// Full beamwidth, radians, in (0, pi).
    pub width_rad: f64,
    /// Squint of the beam centre, radians, positive forward of broadside. For a rotating beam the mean over the
    /// pulses.
    pub squint_rad: f64,
    /// Origin of width and squint.
    pub source: BeamSource,
    /// Displacement of the target in whose frame the geometry is given. The antennas move as the geometry does, plus this displacement.
    /// `None` for a frame at rest.
    #[serde(default, alias = "target_m_s", skip_serializing_if = "Option::is_none")]
    pub target: Option<Displacement>,
    /// Directions of the centre of a rotating beam, ascending in time. Empty for a beam with one squint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aims: Vec<Aim>,
}

/// Direction of the beam centre at a time. In between, directions are interpolated linearly in time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Aim {
    /// Time, seconds, as that of [`super::Pulse::time_s`].
    pub time_s: f64,
    /// Unit vector in scene axes.
    pub direction: [f64; 3],
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

/// Reason that antenna patterns stated by a recording give no [`Beam`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoBeam {
    /// An edge of the beam reaches along the track.
    AlongTrack {
        /// Width of the beam, radians.
        width_rad: f64,
        /// Squint farthest from broadside, radians.
        squint_rad: f64,
    },
    /// The antennas do not move at some pulse, so that no heading is defined.
    AtRest,
    /// The pulses belong to several channels, or to recordings with different beams.
    Several,
    /// The attitude or the boresight of an antenna is not defined at some pulse.
    NoAttitude,
}

impl fmt::Display for NoBeam {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::AlongTrack {
                width_rad,
                squint_rad,
            } => write!(
                f,
                "a beam {:.1} deg wide, {:.1} deg forward of broadside, reaches along the track",
                width_rad.to_degrees(),
                squint_rad.to_degrees()
            ),
            Self::AtRest => f.write_str("the antennas do not move at some pulse"),
            Self::Several => f.write_str(
                "the pulses belong to several channels or recordings with different beams",
            ),
            Self::NoAttitude => f.write_str(
                "the attitude or the boresight of an antenna is not defined at some pulse",
            ),
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
            target: None,
            aims: Vec::new(),
        }
    }

    /// Create the beam of two antennas with half-power widths `widths_rad` (of one-way power, along the track).
    /// `None` for an antenna without a main lobe along the track, such as an isotropic one, which is ignored. At
    /// pulse `n`, at `times_s[n]` with heading `headings[n]`, the boresight of antenna `i` is the unit vector
    /// `lobe(n, i).0`, and the centre of its lobe is `lobe(n, i).1` radians forward of it.
    ///
    /// For widths `w_t` and `w_r` the width is `sqrt(2 / (1 / w_t^2 + 1 / w_r^2))`. At its edges the two-way power of
    /// Gaussian patterns is a quarter of the maximum; for two equal antennas the width is that of one. The squint is
    /// the mean of both, weighted by `1 / w^2` and averaged over the pulses. If it changes by more than a quarter of
    /// the width, the beam rotates and [`Self::aims`] contains its directions.
    ///
    /// `None` if neither antenna has a main lobe.
    ///
    /// # Errors
    /// [`NoBeam::AlongTrack`] if the beam reaches along the track.
    pub fn of_lobes(
        widths_rad: [Option<f64>; 2],
        times_s: &[f64],
        headings: &[DVec3],
        lobe: impl Fn(usize, usize) -> (DVec3, f64),
    ) -> Result<Option<Self>, NoBeam> {
        let inverse_squares = widths_rad.map(|width| width.map_or(0.0, |w| 1.0 / (w * w)));
        let together: f64 = inverse_squares.iter().sum();
        if together == 0.0 || headings.is_empty() {
            return Ok(None);
        }
        let width_rad = (2.0 / together).sqrt();
        let shares = inverse_squares.map(|one| one / together);
        let squints: Vec<f64> = (0..headings.len())
            .map(|n| {
                let squint = |i: usize| match shares[i] > 0.0 {
                    true => {
                        let (boresight, off_rad) = lobe(n, i);
                        shares[i] * (angle_rad(boresight, headings[n]) + off_rad)
                    }
                    false => 0.0,
                };
                squint(0) + squint(1)
            })
            .collect();
        let least = squints.iter().copied().fold(f64::INFINITY, f64::min);
        let most = squints.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let squint_rad = squints.iter().sum::<f64>() / squints.len() as f64;
        let mut beam = Self::new(width_rad, squint_rad, BeamSource::Stated);
        let mut farthest = [squint_rad; 2];
        if most - least > MAX_TURN * width_rad {
            farthest = [least, most];
            beam.aims = aims(times_s, 0.5 * AIM_ERROR * width_rad, |n| {
                let lobes = [0, 1].map(|i| match shares[i] > 0.0 {
                    true => shares[i] * lobe(n, i).0,
                    false => DVec3::ZERO,
                });
                let towards = lobes[0] + lobes[1];
                let aside = (towards - headings[n] * towards.dot(headings[n])).normalize_or_zero();
                aside * libm::cos(squints[n]) + headings[n] * libm::sin(squints[n])
            });
        }
        let is_along = |squint_rad: &f64| !Self::is_within(*squint_rad, width_rad);
        match farthest.iter().copied().find(is_along) {
            None => Ok(Some(beam)),
            Some(squint_rad) => Err(NoBeam::AlongTrack {
                width_rad,
                squint_rad,
            }),
        }
    }

    /// Squint in radians at pulses with ascending `times_s` and unit headings `headings`: towards [`Self::aims`], or
    /// [`Self::squint_rad`] for a beam with one squint. Directions are constant before the first and after the last.
    pub fn squints_rad(&self, times_s: &[f64], headings: &[DVec3]) -> Vec<f64> {
        let squint_rad = |(&time_s, &heading): (&f64, &DVec3)| match self.direction(time_s) {
            Some(direction) => angle_rad(direction, heading),
            None => self.squint_rad,
        };
        times_s.iter().zip(headings).map(squint_rad).collect()
    }

    /// Direction of the centre at a time. `None` for a beam with one squint.
    fn direction(&self, time_s: f64) -> Option<DVec3> {
        let after = self.aims.partition_point(|aim| aim.time_s <= time_s);
        let to = self.aims.get(after).or(self.aims.last())?;
        let from = &self.aims[after.saturating_sub(1)];
        Some(between(from, to, time_s))
    }

    /// Whether the width is positive and both edges of the beam are less than 90 degrees from broadside.
    pub fn is_sound(&self) -> bool {
        Self::is_within(self.squint_rad, self.width_rad)
    }

    fn is_within(squint_rad: f64, width_rad: f64) -> bool {
        width_rad > 0.0 && squint_rad.abs() + 0.5 * width_rad < std::f64::consts::FRAC_PI_2
    }
}

/// Angle of a unit vector forward of the plane normal to a heading.
fn angle_rad(direction: DVec3, heading: DVec3) -> f64 {
    libm::asin(direction.dot(heading).clamp(-1.0, 1.0))
}

/// Direction at a time between two.
fn between(from: &Aim, to: &Aim, time_s: f64) -> DVec3 {
    let [start, end] = [from, to].map(|aim| DVec3::from_array(aim.direction));
    let span_s = to.time_s - from.time_s;
    let part = match span_s > 0.0 {
        true => ((time_s - from.time_s) / span_s).clamp(0.0, 1.0),
        false => 0.0,
    };
    start.lerp(end, part).normalize_or(start)
}

/// Directions at some of the pulses. Their number doubles until interpolation between them is off by at most `error_rad` at every pulse.
fn aims(times_s: &[f64], error_rad: f64, direction: impl Fn(usize) -> DVec3) -> Vec<Aim> {
    let last = times_s.len().saturating_sub(1);
    let aim = |n: usize| Aim {
        time_s: times_s[n],
        direction: direction(n).to_array(),
    };
    let mut intervals = 1;
    loop {
        let chosen: Vec<usize> = (0..=intervals).map(|i| i * last / intervals).collect();
        let close = chosen.windows(2).all(|pair| {
            let [from, to] = [aim(pair[0]), aim(pair[1])];
            (pair[0]..pair[1]).all(|n| {
                let off_rad = between(&from, &to, times_s[n]).angle_between(direction(n));
                off_rad <= error_rad
            })
        });
        if close || intervals >= last {
            return chosen.into_iter().map(aim).collect();
        }
        intervals = (2 * intervals).min(last);
    }
}

/// Heading at each of these positions as unit vectors; zero where the positions do not move.
///
/// A heading is the direction from the position 1/64 of the track before to that 1/64 after (at least one position
/// each), which averages out noise. Positions nearer to an end have the heading of the first or last complete
/// interval, whose error on a circle is up to 1/64 of the arc.
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

    const TIMES_S: [f64; 3] = [0.0, 1.0, 2.0];

    /// Horizontal direction at an angle forward of broadside on a track along x.
    fn at(squint_rad: f64) -> DVec3 {
        DVec3::new(squint_rad.sin(), squint_rad.cos(), 0.0)
    }

    #[test]
    fn two_equal_lobes_keep_their_width_and_single_lobe_is_wider() {
        let beam = |widths| {
            let lobe = |_, i: usize| [(at(0.1), 0.0), (at(0.2), 0.1)][i];
            Beam::of_lobes(widths, &TIMES_S, &[DVec3::X; 3], lobe)
        };
        let both = beam([Some(0.2), Some(0.2)]).unwrap().unwrap();
        assert!((both.width_rad - 0.2).abs() < 1e-15 && (both.squint_rad - 0.2).abs() < 1e-15);
        assert!(both.aims.is_empty());
        let one = beam([None, Some(0.2)]).unwrap().unwrap();
        assert!((one.width_rad - 0.2 * 2f64.sqrt()).abs() < 1e-15);
        assert!((one.squint_rad - 0.3).abs() < 1e-15);
        assert_eq!(beam([None, None]), Ok(None));
        let lobe = |_, _| (at(1.5), 0.0);
        let along = Beam::of_lobes([Some(0.2); 2], &TIMES_S, &[DVec3::X; 3], lobe);
        assert!(matches!(along, Err(NoBeam::AlongTrack { .. })), "{along:?}");
    }

    #[test]
    fn rotating_beam_follows_its_antennas_on_any_heading() {
        // A scan of 60 degrees, faster towards its end, on a track whose heading wobbles by up to 0.1 rad.
        let count = 401;
        let times_s: Vec<f64> = (0..count).map(|n| 5.0 + 0.01 * n as f64).collect();
        let scan_rad = |n: usize| 0.5 * ((n as f64 / 400.0).powi(2) * 2.0 - 1.0);
        let heading = |n: usize| {
            let angle = 0.1 * (0.05 * n as f64).sin();
            DVec3::new(angle.cos(), angle.sin(), 0.0)
        };
        let headings: Vec<DVec3> = (0..count).map(heading).collect();
        let lobe = |n: usize, _| (at(scan_rad(n)), 0.0);
        let beam = Beam::of_lobes([Some(0.1); 2], &times_s, &headings, lobe);
        let beam = beam.unwrap().unwrap();
        assert!(
            beam.aims.len() > 2 && beam.aims.len() < 100,
            "{}",
            beam.aims.len()
        );
        let worst = |headings: &[DVec3], expected: &dyn Fn(usize) -> f64| {
            let squints = beam.squints_rad(&times_s, headings);
            let off = squints
                .iter()
                .enumerate()
                .map(|(n, s)| (s - expected(n)).abs());
            off.fold(0.0, f64::max)
        };
        // Interpolation bound: 1 % of half the width.
        let bound = 0.01 * 0.05;
        assert!(worst(&headings, &|n| scan_rad(n) + 0.1 * (0.05 * n as f64).sin()) <= bound);
        // Directions are those of the antennas, independent of the measured heading.
        assert!(worst(&vec![DVec3::X; count], &scan_rad) <= bound);
        // Serialised text keeps all bits.
        let text = serde_json::to_string(&beam).unwrap();
        assert_eq!(serde_json::from_str::<Beam>(&text).unwrap(), beam);
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
