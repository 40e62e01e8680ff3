//! Orbit through state vectors: a polynomial of degree 7 through the nearest ones.
//!
//! With velocities it is the Hermite polynomial through positions and velocities at four times,
//!
//! ```text
//! p(t) = sum_i l_i(t)^2 ((1 - 2 l_i'(t_i) (t - t_i)) p_i + (t - t_i) v_i),    l_i(t) = prod_(j != i) (t - t_j) / (t_i - t_j)
//! ```
//!
//! without velocities the Lagrange polynomial `sum_i l_i(t) p_i` through positions at eight times. Both are of order 8: the error is at most
//! `max |p^(8)| / 8! prod_i |t - t_i|^m`, with `m = 2` for Hermite's and `m = 1` for Lagrange's.

use std::ops::Range;

use glam::DVec3;

use super::{Pose, TrackError, Trajectory, check_knots, heading};
use crate::SPEED_OF_LIGHT_M_S;

/// Gravitational parameter of the Earth, m^3/s^2 (WGS 84).
const GRAVITY_M3_S2: f64 = 3.986_004_418e14;
/// Angular rate of the Earth, rad/s (WGS 84).
const EARTH_RAD_S: f64 = 7.292_115e-5;
/// Order of the polynomials.
const ORDER: i32 = 8;
const FACTORIAL: f64 = 40_320.0;

/// Interval up to which state vectors are dense: their polynomial is not extrapolated, because it would amplify rounding.
const DENSE_S: f64 = 0.1;

/// Largest difference between a displacement and the mean velocity times the interval, relative to the displacement. A circular orbit deviates by
/// `(w h)^2 / 12`, 4e-3 for `h` of 200 s; velocities in an inertial frame differ by 1 to 7 % from Earth-fixed ones.
const SAME_VELOCITY: f64 = 5e-3;

/// Positions, and velocities if known, at ascending times.
#[derive(Clone, Debug, PartialEq)]
pub struct StateVectors {
    times_s: Vec<f64>,
    positions_m: Vec<DVec3>,
    velocities_m_s: Option<Vec<DVec3>>,
}

impl StateVectors {
    /// Number of state vectors that define a polynomial: with velocities, and without.
    pub const SUPPORT: [usize; 2] = [4, 8];

    /// Track through positions with ascending times.
    ///
    /// # Errors
    /// [`TrackError`] for fewer state vectors than [`Self::SUPPORT`], another number of velocities than of positions, times that do not ascend,
    /// values that are not finite, or speeds above that of light.
    pub fn new(
        times_s: Vec<f64>,
        positions_m: Vec<DVec3>,
        velocities_m_s: Option<Vec<DVec3>>,
    ) -> Result<Self, TrackError> {
        check_knots(&times_s, &positions_m)?;
        let made = Self {
            times_s,
            positions_m,
            velocities_m_s,
        };
        let (count, support) = (made.times_s.len(), made.support());
        if count < support {
            return Err(TrackError(format!(
                "expected at least {support} state vectors {} velocities, found {count}",
                if support == Self::SUPPORT[0] {
                    "with"
                } else {
                    "without"
                }
            )));
        }
        let Some(velocities_m_s) = &made.velocities_m_s else {
            return Ok(made);
        };
        if velocities_m_s.len() != count {
            return Err(TrackError(format!(
                "expected a velocity for each of {count} positions, found {}",
                velocities_m_s.len()
            )));
        }
        let sound = |v: &DVec3| v.length() < SPEED_OF_LIGHT_M_S;
        match velocities_m_s.iter().position(|v| !sound(v)) {
            None => Ok(made),
            Some(n) => Err(TrackError(format!(
                "state vector {} has the velocity {} m/s: expected finite values below the speed of light",
                n + 1,
                velocities_m_s[n]
            ))),
        }
    }

    /// Check that velocities are the derivatives of the positions.
    ///
    /// # Errors
    /// [`TrackError`] with the first interval where they differ by more than half a per cent.
    pub fn check_velocities(&self) -> Result<(), TrackError> {
        let Some(velocities) = &self.velocities_m_s else {
            return Ok(());
        };
        for n in 1..self.times_s.len() {
            let step_s = self.times_s[n] - self.times_s[n - 1];
            let moved_m = self.positions_m[n] - self.positions_m[n - 1];
            let mean = 0.5 * (velocities[n] + velocities[n - 1]);
            if (mean * step_s - moved_m).length() > SAME_VELOCITY * moved_m.length() {
                return Err(TrackError(format!(
                    "velocities disagree with positions: state vectors {n} and {} are {:.1} m apart, and their mean velocity times {step_s} s differs from that by {:.1} m; \
                     expected velocities in metres per second in the frame of the positions (Earth-fixed, not inertial)",
                    n + 1,
                    moved_m.length(),
                    (mean * step_s - moved_m).length()
                )));
            }
        }
        Ok(())
    }

    /// First and last time, seconds.
    pub fn span_s(&self) -> [f64; 2] {
        [self.times_s[0], self.times_s[self.times_s.len() - 1]]
    }

    /// Interval of time that the track covers: from half an interval before the first to half an interval after the last state vector, or between these if they are
    /// dense (up to 0.1 s apart).
    pub fn known_s(&self) -> [f64; 2] {
        let [first_s, last_s] = self.span_s();
        let [before_s, after_s] = self.ends_s();
        [first_s - 0.5 * before_s, last_s + 0.5 * after_s]
    }

    /// Extrapolation of the polynomial at both ends, seconds: the first and the last interval between state vectors; 0 for dense ones.
    fn ends_s(&self) -> [f64; 2] {
        let times = &self.times_s;
        let last = times.len() - 1;
        [times[1] - times[0], times[last] - times[last - 1]]
            .map(|step_s| if step_s > DENSE_S { step_s } else { 0.0 })
    }

    /// Memory of the state vectors, bytes.
    pub fn held_bytes(&self) -> u64 {
        let each = if self.velocities_m_s.is_some() {
            56
        } else {
            32
        };
        each * self.times_s.len() as u64
    }

    fn support(&self) -> usize {
        Self::SUPPORT[usize::from(self.velocities_m_s.is_none())]
    }

    /// State vectors of the polynomial at a time.
    fn nearest(&self, time_s: f64) -> Range<usize> {
        let support = self.support();
        let after = self.times_s.partition_point(|&t| t <= time_s);
        let first = after.saturating_sub(support / 2);
        let first = first.min(self.times_s.len() - support);
        first..first + support
    }

    /// Bound on the interpolation error at a time, metres, for an Earth-fixed circular orbit: `r w^8 / 8! prod_i |t - t_i|^m`, with `r` the distance from
    /// the Earth's centre `centre_m` and `w` the sum of the rates of orbit and Earth.
    pub fn orbit_error_m(&self, time_s: f64, centre_m: DVec3) -> f64 {
        let nearest = self.nearest(time_s);
        let radius_m = self.positions_m[nearest.start].distance(centre_m);
        let multiple = ORDER / nearest.len() as i32;
        let apart = self.times_s[nearest]
            .iter()
            .map(|t| (time_s - t).abs().powi(multiple));
        let rate = orbit_rate_rad_s(radius_m);
        apart.product::<f64>() * radius_m * rate.powi(ORDER) / FACTORIAL
    }

    /// Position and velocity at a time. More than an interval beyond the ends (of dense state vectors, beyond the ends) the velocity is constant.
    pub fn at(&self, time_s: f64) -> [DVec3; 2] {
        let [first_s, last_s] = self.span_s();
        let [before_s, after_s] = self.ends_s();
        let near_s = time_s.clamp(first_s - before_s, last_s + after_s);
        let [position, velocity] = self.polynomial(near_s);
        [position + velocity * (time_s - near_s), velocity]
    }

    fn polynomial(&self, time_s: f64) -> [DVec3; 2] {
        let nearest = self.nearest(time_s);
        let first = nearest.start;
        let times = &self.times_s[nearest];
        let (mut position, mut velocity) = (DVec3::ZERO, DVec3::ZERO);
        for (i, &own) in times.iter().enumerate() {
            let others = || times.iter().enumerate().filter(move |&(j, _)| j != i);
            // The Lagrange polynomial, its derivative, and its derivative at its own time.
            let value: f64 = others().map(|(_, &t)| (time_s - t) / (own - t)).product();
            let slope: f64 = others()
                .map(|(j, &t)| {
                    let rest = others().filter(|&(k, _)| k != j);
                    rest.map(|(_, &t)| (time_s - t) / (own - t))
                        .product::<f64>()
                        / (own - t)
                })
                .sum();
            let own_m = self.positions_m[first + i];
            let Some(velocities_m_s) = &self.velocities_m_s else {
                position += own_m * value;
                velocity += own_m * slope;
                continue;
            };
            let own_slope: f64 = others().map(|(_, &t)| 1.0 / (own - t)).sum();
            let after_s = time_s - own;
            let own_m_s = velocities_m_s[first + i];
            let state = own_m * (1.0 - 2.0 * own_slope * after_s) + own_m_s * after_s;
            let rate = own_m * (-2.0 * own_slope) + own_m_s;
            position += state * (value * value);
            velocity += state * (2.0 * value * slope) + rate * (value * value);
        }
        [position, velocity]
    }
}

/// Largest angular rate of the Earth-fixed position on a circular orbit of this radius, rad/s.
pub fn orbit_rate_rad_s(radius_m: f64) -> f64 {
    (GRAVITY_M3_S2 / radius_m.powi(3)).sqrt() + EARTH_RAD_S
}

impl Trajectory for StateVectors {
    fn pose(&self, time_s: f64) -> Pose {
        let [position_m, velocity_m_s] = self.at(time_s);
        Pose {
            position_m,
            attitude: heading(velocity_m_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circular orbit in an inertial frame, seen from the rotating Earth.
    fn state(time_s: f64) -> [DVec3; 2] {
        let (radius_m, rate, earth) = (7.07e6, 1.062e-3, -7.292e-5);
        let tilt: f64 = 1.7;
        let (sin, cos) = (rate * time_s).sin_cos();
        let inertial = DVec3::new(cos, sin * tilt.cos(), sin * tilt.sin()) * radius_m;
        let moving = DVec3::new(-sin, cos * tilt.cos(), cos * tilt.sin()) * (radius_m * rate);
        let (sin, cos) = (earth * time_s).sin_cos();
        let turned = |v: DVec3| DVec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        let position = turned(inertial);
        [
            position,
            turned(moving) + DVec3::new(-position.y, position.x, 0.0) * earth,
        ]
    }

    fn vectors(count: u32, step_s: f64, known: bool) -> StateVectors {
        let times_s: Vec<f64> = (0..count).map(|n| step_s * f64::from(n)).collect();
        let states: Vec<[DVec3; 2]> = times_s.iter().map(|&t| state(t)).collect();
        let column = |i: usize| states.iter().map(|state| state[i]).collect::<Vec<_>>();
        StateVectors::new(times_s, column(0), known.then(|| column(1))).unwrap()
    }

    #[test]
    fn hermite_polynomial_follows_orbit_between_vectors_a_minute_apart() {
        let orbit = vectors(12, 60.0, true);
        for n in 0..=660 {
            let time_s = f64::from(n);
            let [position, velocity] = orbit.at(time_s);
            let [true_position, true_velocity] = state(time_s);
            // r w^8 / 8! = 5e-22 m / s^8 with w the sum of both rates, 1.14e-3 rad/s. The product of the squares is at most (90 30 30 90
            // s^4)^2 in the middle intervals, 27 nm, and (23 37 97 157 s^4)^2 in the outer ones, 84 nm. Rounding of 7e6 m: 0.9 nm for each
            // of some 40 terms.
            let outer = !(60.0..=600.0).contains(&time_s);
            let most_m = if outer { 1.3e-7 } else { 7e-8 };
            assert!(
                position.distance(true_position) < most_m,
                "{time_s} s: {}",
                position.distance(true_position)
            );
            assert!(
                velocity.distance(true_velocity) < most_m,
                "{time_s} s: {}",
                velocity.distance(true_velocity)
            );
        }
    }

    #[test]
    fn error_bound_holds_for_both_polynomials_and_beyond_the_ends() {
        for known in [true, false] {
            let orbit = vectors(12, 120.0, known);
            let [from_s, to_s] = orbit.known_s();
            assert_eq!([from_s, to_s], [-60.0, 1380.0]);
            let mut largest = 0.0f64;
            for n in 0..=480 {
                let time_s = from_s + f64::from(n) * 3.0;
                let off_m = orbit.at(time_s)[0].distance(state(time_s)[0]);
                let bound_m = orbit.orbit_error_m(time_s, DVec3::ZERO);
                // Rounding of 7e6 m is 0.9 nm for each of some 40 terms, whose weights are below 10.
                assert!(off_m <= bound_m + 4e-7, "{time_s} s: {off_m} and {bound_m}");
                largest = largest.max(off_m / (bound_m + 4e-7));
            }
            // The rates of orbit and Earth add up only in the plane of the equator: the bound is not much larger than the error.
            assert!(largest > 0.1, "{largest}");
        }
    }

    #[test]
    fn dense_vectors_are_not_extrapolated_by_their_polynomial() {
        let orbit = vectors(20, 0.001, true);
        assert_eq!(orbit.known_s(), orbit.span_s());
        // Rounding of 7e6 m by 1e-9 m, times 100 if extrapolated by 6 intervals with degree 7 it would be 1e-2 m; at constant velocity the
        // error is 9 m/s^2 (6 ms)^2 / 2.
        let off_m = orbit.at(0.025)[0].distance(state(0.025)[0]);
        assert!(off_m < 2e-4, "{off_m}");
    }

    #[test]
    fn unsound_state_vectors_are_refused() {
        let refuse = |times: Vec<f64>, places: Vec<DVec3>, speeds: Option<Vec<DVec3>>| {
            StateVectors::new(times, places, speeds)
                .unwrap_err()
                .to_string()
        };
        let times: Vec<f64> = (0..5).map(f64::from).collect();
        let places: Vec<DVec3> = times.iter().map(|&t| state(t)[0]).collect();
        let speeds: Vec<DVec3> = times.iter().map(|&t| state(t)[1]).collect();
        let message = refuse(times.clone(), places.clone(), None);
        assert!(
            message.contains("at least 8 state vectors without"),
            "{message}"
        );
        let message = refuse(times.clone(), places.clone(), Some(speeds[1..].to_vec()));
        assert!(
            message.contains("each of 5 positions, found 4"),
            "{message}"
        );
        let mut bad = speeds.clone();
        bad[2].y = f64::NAN;
        let message = refuse(times.clone(), places.clone(), Some(bad));
        assert!(message.contains("state vector 3"), "{message}");
        // Velocities of the inertial frame lack the rotation of the Earth, 7.3e-5 rad/s times 7e6 m.
        let inertial = times.iter().map(|&t| {
            let [place, speed] = state(t);
            speed + DVec3::new(-place.y, place.x, 0.0) * 7.292e-5
        });
        let mixed = StateVectors::new(times.clone(), places.clone(), Some(inertial.collect()));
        let message = mixed.unwrap().check_velocities().unwrap_err().to_string();
        assert!(message.contains("velocities disagree"), "{message}");
        let sound = StateVectors::new(times, places, Some(speeds)).unwrap();
        assert_eq!(sound.check_velocities(), Ok(()));
    }
}
