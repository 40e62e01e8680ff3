//! Internal clutter motion: scatterers that move with the wind.
//!
//! Each point has a constant velocity of its own. The three components are independent Gaussian variables of the
//! standard deviation `sigma_v`, so that the radial velocity has this deviation from every direction. A cell of many
//! points has a Gaussian Doppler spectrum of the deviation `2 sigma_v / lambda`. Its echoes at a lag `tau` have the
//! correlation
//!
//! ```text
//! rho(tau) = exp(-8 pi^2 sigma_v^2 tau^2 / lambda^2)
//! ```
//!
//! for a monostatic radar. In an image a point of radial velocity `v` at the range `R` is displaced by `R v / V` along
//! the track of a radar of speed `V`. The amplitudes do not fluctuate.
//!
//! A filter that cancels clutter weights each point by its velocity. The residue of few points has a heavier tail than that of Gaussian clutter: with 3 points per
//! square metre and cells of 0.6 m2 a detector has 900 times the false alarms of a requested 1e-5, with 100 points 12 times.
//!
//! **Source.** Ward, "Space-time adaptive processing for airborne radar", MIT Lincoln Laboratory, technical report 1015,
//! 1994, section 2.6.1.

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::{MovingPoint, SceneError};
use crate::Scatterer;
use crate::random::normal;

/// Random stream of the velocities.
const VELOCITY: u64 = u64::from_be_bytes(*b"cluttvel");

/// Largest standard deviation, metres per second.
pub(crate) const MAX_SPREAD_M_S: f64 = 100.0;

/// Internal motion of a patch of clutter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InternalMotion {
    /// Standard deviation of the radial velocity, 0 to 100 metres per second.
    pub velocity_spread_m_s: f64,
    /// Time at which the points have their given positions, seconds.
    pub epoch_s: f64,
}

impl InternalMotion {
    /// Points with random velocities; the same seed gives the same velocities. Patches with one seed and different
    /// `index` differ.
    ///
    /// # Errors
    /// [`SceneError`] for a standard deviation or a time out of range.
    pub fn of(
        &self,
        points: &[Scatterer],
        seed: u64,
        index: u32,
    ) -> Result<Vec<MovingPoint>, SceneError> {
        let Self {
            velocity_spread_m_s,
            epoch_s,
        } = *self;
        if !((0.0..=MAX_SPREAD_M_S).contains(&velocity_spread_m_s) && epoch_s.is_finite()) {
            return Err(SceneError(format!(
                "expected a velocity spread of 0 to {MAX_SPREAD_M_S} m/s and a finite time, found \
                 {velocity_spread_m_s} m/s and {epoch_s} s"
            )));
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(VELOCITY.wrapping_add(u64::from(index)));
        let mut component = || normal(&mut random) * velocity_spread_m_s;
        let moving = |point: &Scatterer| {
            let velocity_m_s = DVec3::new(component(), component(), component());
            let position_m = point.position_m - velocity_m_s * epoch_s;
            MovingPoint {
                start: Scatterer {
                    position_m,
                    ..*point
                },
                velocity_m_s,
            }
        };
        Ok(points.iter().map(moving).collect())
    }
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;

    use super::*;

    fn points(count: usize) -> Vec<Scatterer> {
        let point = |i| Scatterer {
            position_m: DVec3::new(i as f64, 3.0, 1.0),
            amplitude: Complex64::new(0.5, i as f64),
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn velocities_are_gaussian_and_isotropic_and_keep_positions_at_the_epoch() {
        let motion = InternalMotion {
            velocity_spread_m_s: 0.3,
            epoch_s: 7.0,
        };
        let still = points(20_000);
        let moving = motion.of(&still, 5, 0).unwrap();
        for (still, moving) in still.iter().zip(&moving) {
            assert_eq!(still.amplitude, moving.start.amplitude);
            assert!(still.position_m.distance(moving.position_m(7.0)) < 1e-11);
        }
        let mean = |of: &dyn Fn(DVec3) -> f64| {
            moving.iter().map(|p| of(p.velocity_m_s / 0.3)).sum::<f64>() / moving.len() as f64
        };
        // Five standard errors of 20,000 numbers.
        let error = 5.0 / 20_000f64.sqrt();
        for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, -0.8)] {
            assert!(mean(&|v| v.dot(direction)).abs() < error);
            assert!((mean(&|v| v.dot(direction).powi(2)) - 1.0).abs() < 2f64.sqrt() * error);
            assert!((mean(&|v| v.dot(direction).powi(4)) - 3.0).abs() < 96f64.sqrt() * error);
        }
        assert!(mean(&|v| v.x * v.y).abs() < error);
        assert_eq!(moving, motion.of(&still, 5, 0).unwrap());
        assert_ne!(moving, motion.of(&still, 6, 0).unwrap());
        assert_ne!(moving, motion.of(&still, 5, 1).unwrap());
    }

    #[test]
    fn spread_and_time_out_of_range_are_refused() {
        for (velocity_spread_m_s, epoch_s) in [
            (-0.1, 0.0),
            (f64::NAN, 0.0),
            (101.0, 0.0),
            (0.1, f64::INFINITY),
        ] {
            let motion = InternalMotion {
                velocity_spread_m_s,
                epoch_s,
            };
            let error = motion.of(&points(2), 0, 0).unwrap_err().to_string();
            assert!(error.contains("0 to 100 m/s"), "{error}");
        }
    }
}
