//! The straight, evenly sampled track that frequency-domain formers assume, fitted to a recorded one.
//!
//! ```text
//! s_n = (n - (N - 1) / 2) d,   antenna_n = centre + s_n direction
//! ```
//!
//! by least squares over the middles between transmitter and receiver. A point of the scene then is
//! two numbers: `x`, its place along the track from the aperture's centre, and `r`, its distance from the
//! track's line; its two-way path is `2 sqrt(r^2 + (x - s_n)^2)`.
//!
//! What the recorded track does otherwise (sway, uneven speed, antennas apart) is taken out to first
//! order: each pulse is moved to the line by the difference of paths to one reference point,
//! `path_n(q) - 2 |q - antenna_n|`. That is exact for the point. What is left elsewhere is
//! [`StraightTrack::residual_m`], measured on points of the scene for every pulse, and part of what formers predict
//! ([`super::strip`]); who plans asks [`StraightTrack::check`] whether it keeps a bound.

use std::f64::consts::PI;

use glam::DVec3;

use super::{FormError, Reason, Remedy};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::{Collection, Pulse};

/// A straight track with evenly spaced pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightTrack {
    /// The middle of the aperture, metres in the scene frame.
    pub centre_m: DVec3,
    /// Unit vector of flight.
    pub direction: DVec3,
    /// From pulse to pulse, metres.
    pub spacing_m: f64,
    /// Number of pulses.
    pub num_pulses: usize,
}

impl StraightTrack {
    /// The line nearest to the pulses' phase centres.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the pulses do not move.
    pub fn fit(collection: &Collection) -> Result<Self, FormError> {
        let num_pulses = collection.pulses.len();
        let middle = |pulse: &Pulse| (pulse.transmitter_m + pulse.receiver_m) / 2.0;
        let centre_m = collection.pulses.iter().map(middle).sum::<DVec3>() / num_pulses as f64;
        let (mut slope, mut square) = (DVec3::ZERO, 0.0);
        for (n, pulse) in collection.pulses.iter().enumerate() {
            let index = n as f64 - (num_pulses as f64 - 1.0) / 2.0;
            slope += (middle(pulse) - centre_m) * index;
            square += index * index;
        }
        let step = slope / square;
        let spacing_m = step.length();
        // A fit of points that all coincide leaves rounding only.
        let rounding_m = 1e-13 * (1.0 + centre_m.length());
        if spacing_m.is_nan() || spacing_m <= rounding_m {
            let why = format!(
                "the {num_pulses} pulses come from one place, and a straight track is needed"
            );
            let remedies = [Remedy::OtherFormer(&["bp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        Ok(Self {
            centre_m,
            direction: step / spacing_m,
            spacing_m,
            num_pulses,
        })
    }

    /// Place of pulse `n` along the track from the aperture's centre, metres.
    pub fn along_m(&self, n: usize) -> f64 {
        (n as f64 - (self.num_pulses as f64 - 1.0) / 2.0) * self.spacing_m
    }

    /// Place along the track and distance from its line of a scene point, metres.
    pub fn along_and_range_m(&self, point: DVec3) -> (f64, f64) {
        let from_centre = point - self.centre_m;
        let along_m = from_centre.dot(self.direction);
        (along_m, (from_centre - self.direction * along_m).length())
    }

    /// How much longer the two-way path of pulse `n` to `point` is than from the line, metres.
    pub fn excess_path_m(&self, n: usize, pulse: &Pulse, point: DVec3) -> f64 {
        let on_line = self.centre_m + self.direction * self.along_m(n);
        pulse.path_m(point) - 2.0 * (point - on_line).length()
    }

    /// What moving every pulse to the line for `reference` leaves at `points`: the RMS over pulses of
    /// half the path, at the worst point, metres.
    pub fn residual_m(&self, collection: &Collection, points: &[DVec3], reference: DVec3) -> f64 {
        let at = |&point: &DVec3| {
            let pulses = collection.pulses.iter().enumerate();
            let square: f64 = pulses
                .map(|(n, pulse)| {
                    let left = self.excess_path_m(n, pulse, point)
                        - self.excess_path_m(n, pulse, reference);
                    (left / 2.0).powi(2)
                })
                .sum();
            (square / self.num_pulses as f64).sqrt()
        };
        points.iter().map(at).fold(0.0, f64::max)
    }

    /// Checks that what is left of the track's deviations keeps `error_db` at `frequency_hz`; returns it,
    /// metres. A range wrong by `e` turns a sample by `4 pi f e / c`, which is the image's relative
    /// error.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] with both figures if it does not.
    pub fn check(
        &self,
        collection: &Collection,
        points: &[DVec3],
        reference: DVec3,
        frequency_hz: f64,
        error_db: f64,
    ) -> Result<f64, FormError> {
        let residual_m = self.residual_m(collection, points, reference);
        let allowed_m =
            libm::pow(10.0, error_db / 20.0) * SPEED_OF_LIGHT_M_S / (4.0 * PI * frequency_hz);
        if residual_m.is_nan() || residual_m > allowed_m {
            let why = format!(
                "the track is not straight and even: {residual_m:.2e} m RMS of range are left after \
                 motion compensation to a line, an error of {:.0} dB, and an error of {error_db} dB \
                 allows {allowed_m:.2e} m",
                error_db + 20.0 * libm::log10(residual_m / allowed_m)
            );
            let remedies = [Remedy::OtherFormer(&["bp", "rdbp"])];
            return Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)));
        }
        Ok(residual_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::Sweep;

    /// 101 pulses, 0.5 m apart along a slant line, displaced by `sway(n)`; antennas `apart` metres apart.
    fn collection(sway: impl Fn(usize) -> DVec3, apart_m: f64) -> Collection {
        let direction = DVec3::new(0.8, 0.6, 0.0);
        let pulses = (0..101)
            .map(|n| {
                let at = DVec3::new(5.0, -1000.0, 300.0) + direction * (n as f64 * 0.5) + sway(n);
                Pulse {
                    time_s: n as f64,
                    transmitter_m: at - direction * (apart_m / 2.0),
                    receiver_m: at + direction * (apart_m / 2.0),
                    reference_m: DVec3::ZERO,
                    reference_path_m: 0.0,
                    start_hz: 1e9,
                    step_hz: 1e6,
                    sweep: Sweep::AT_ONCE,
                }
            })
            .collect();
        Collection {
            name: "line".to_owned(),
            num_samples: 8,
            pulses,
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        }
    }

    #[test]
    fn a_line_is_found_again() {
        let line = collection(|_| DVec3::ZERO, 0.0);
        let track = StraightTrack::fit(&line).unwrap();
        assert!((track.spacing_m - 0.5).abs() < 1e-12);
        let centre = DVec3::new(5.0, -1000.0, 300.0) + DVec3::new(0.8, 0.6, 0.0) * 25.0;
        assert!((track.centre_m - centre).length() < 1e-9);
        // 7 m along and a 3-4-5 triangle across (across: horizontal normal and vertical).
        let point = centre + track.direction * 7.0 + DVec3::new(-0.6, 0.8, 0.0) * 30.0
            - DVec3::new(0.0, 0.0, 40.0);
        let (along_m, range_m) = track.along_and_range_m(point);
        assert!((along_m - 7.0).abs() < 1e-9 && (range_m - 50.0).abs() < 1e-9);
        assert!(track.residual_m(&line, &[point, DVec3::ZERO], DVec3::X * 9.0) < 1e-10);
    }

    #[test]
    fn what_sway_leaves_is_the_change_of_the_line_of_sight() {
        // 1 cm of sway upwards every other pulse. From the middle of the track, seen at points P and Q,
        // the excess one-way range differs by 1 cm times the difference of the lines of sight's heights.
        let sway = |n: usize| DVec3::Z * if n.is_multiple_of(2) { 0.01 } else { -0.01 };
        let swaying = collection(sway, 0.0);
        let track = StraightTrack::fit(&swaying).unwrap();
        let (p, q) = (DVec3::new(20.0, 0.0, 0.0), DVec3::new(20.0, 500.0, 0.0));
        let height = |point: DVec3| (point - track.centre_m).normalize().z;
        let expected_m = 0.01 * (height(p) - height(q)).abs();
        let got_m = track.residual_m(&swaying, &[p], q);
        // The lines of sight turn by 50 m in 1000 m over the aperture, and the fit tilts by 1e-4: 1 %.
        assert!(
            (got_m / expected_m - 1.0).abs() < 0.01,
            "{got_m} {expected_m}"
        );
        let error = track.check(&swaying, &[p], q, 1e9, -60.0).unwrap_err();
        assert_eq!(error.remedies(), [Remedy::OtherFormer(&["bp", "rdbp"])]);
        assert!(track.check(&swaying, &[p], q, 1e9, -15.0).is_ok());
    }

    #[test]
    fn antennas_close_together_are_one_in_their_middle() {
        // Apart by b along the track: path = 2 R + b^2 cos^2(angle off the track's normal) / (4 R).
        let pair = collection(|_| DVec3::ZERO, 0.2);
        let track = StraightTrack::fit(&pair).unwrap();
        let point = track.centre_m + DVec3::new(-0.6, 0.8, 0.0) * 100.0;
        let excess_m = track.excess_path_m(50, &pair.pulses[50], point);
        assert!((excess_m / (0.04 / 400.0) - 1.0).abs() < 1e-3, "{excess_m}");
    }

    #[test]
    fn a_radar_that_stands_still_is_refused() {
        let mut still = collection(|_| DVec3::ZERO, 0.0);
        still.pulses = vec![still.pulses[3]; 5];
        assert!(StraightTrack::fit(&still).is_err());
        still.pulses.truncate(1);
        assert!(StraightTrack::fit(&still).is_err());
    }
}
