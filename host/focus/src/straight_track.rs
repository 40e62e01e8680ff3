//! Straight, evenly sampled track assumed by frequency-domain formers, fitted to a recorded track.
//!
//! ```text
//! s_n = (n - (N - 1) / 2) d,   antenna_n = centre + s_n direction
//! ```
//!
//! by least squares over the midpoints between transmitter and receiver. A point of the scene then has
//! two coordinates: `x`, its along-track position from the aperture centre, and `r`, its distance from the
//! line of the track. Its two-way path is `2 sqrt(r^2 + (x - s_n)^2)`.
//!
//! Formers compensate deviations of the recorded track (sway, uneven speed, bistatic separation) and predict the residual
//! error ([`super::frequency_domain`]).

use glam::DVec3;

use super::{FormError, Reason, Remedy};
use subaperture_model::phase_history::{Collection, Pulse};

/// Largest ratio of the track's RMS extent across its line to that along it. An arc of angle `a` has about `0.13 a`; a third corresponds to 150 degrees.
const MAX_ACROSS: f64 = 1.0 / 3.0;

/// Straight track with evenly spaced pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightTrack {
    /// Centre of the aperture, metres in the scene frame.
    pub centre_m: DVec3,
    /// Direction of flight, unit vector.
    pub direction: DVec3,
    /// Distance between pulses, metres.
    pub spacing_m: f64,
    /// Number of pulses in the aperture.
    pub num_pulses: usize,
}

impl StraightTrack {
    /// Fit a line to the phase centres of the pulses.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the pulses do not move.
    pub fn fit(collection: &Collection) -> Result<Self, FormError> {
        let num_pulses = collection.pulses.len();
        let middle = |pulse: &Pulse| pulse.phase_centre_m();
        let centre_m = collection.pulses.iter().map(middle).sum::<DVec3>() / num_pulses as f64;
        let (mut slope, mut square) = (DVec3::ZERO, 0.0);
        for (n, pulse) in collection.pulses.iter().enumerate() {
            let index = n as f64 - (num_pulses as f64 - 1.0) / 2.0;
            slope += (middle(pulse) - centre_m) * index;
            square += index * index;
        }
        let step = slope / square;
        let spacing_m = step.length();
        // A fit of coincident points leaves only rounding.
        let rounding_m = 1e-13 * (1.0 + centre_m.length());
        if spacing_m.is_nan() || spacing_m <= rounding_m {
            let why =
                format!("the {num_pulses} pulses are at one position, expected a straight track");
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

    /// Refuse a track that extends far across its line before anything is planned for it: planning a strip for a circle takes long and
    /// gives no image.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the RMS distance of the pulses from the line exceeds a third of their RMS along-track position.
    pub fn check(&self, collection: &Collection) -> Result<(), FormError> {
        let (mut along, mut across) = (0.0, 0.0);
        for pulse in &collection.pulses {
            let middle_m = pulse.phase_centre_m();
            let (along_m, across_m) = self.along_and_range_m(middle_m);
            along += along_m * along_m;
            across += across_m * across_m;
        }
        let count = collection.pulses.len() as f64;
        let [along_m, across_m] = [along, across].map(|sum| (sum / count).sqrt());
        if across_m <= MAX_ACROSS * along_m {
            return Ok(());
        }
        let why = format!(
            "the track is not straight: RMS deviation of the pulses from the nearest line {across_m:.3} m, expected at most a third of their RMS extent along it, {along_m:.3} m"
        );
        let remedies = [Remedy::OtherFormer(&["auto", "bp", "ffbp"])];
        Err(FormError::Unsuited(Reason::new(why).helped_by(&remedies)))
    }

    /// Along-track position of pulse `n` from the aperture centre, metres.
    pub fn along_m(&self, n: usize) -> f64 {
        (n as f64 - (self.num_pulses as f64 - 1.0) / 2.0) * self.spacing_m
    }

    /// Along-track position of a scene point and its distance from the line, metres.
    pub fn along_and_range_m(&self, point: DVec3) -> (f64, f64) {
        let from_centre = point - self.centre_m;
        let along_m = from_centre.dot(self.direction);
        (along_m, (from_centre - self.direction * along_m).length())
    }

    /// Along-track position of a pulse's phase centre from the aperture centre, metres.
    pub fn place_m(&self, pulse: &Pulse) -> f64 {
        (pulse.phase_centre_m() - self.centre_m).dot(self.direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::Sweep;

    /// Collection of 101 pulses, 0.5 m apart along a slanted line.
    fn collection() -> Collection {
        let direction = DVec3::new(0.8, 0.6, 0.0);
        let pulses = (0..101)
            .map(|n| {
                let at = DVec3::new(5.0, -1000.0, 300.0) + direction * (n as f64 * 0.5);
                Pulse {
                    time_s: n as f64,
                    transmitter_m: at - direction,
                    receiver_m: at + direction,
                    reference_m: DVec3::ZERO,
                    reference_path_m: 0.0,
                    start_hz: 1e9,
                    step_hz: 1e6,
                    sweep: Sweep::AT_ONCE,
                    recorded_path_m: None,
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
    fn line_fit_recovers_track() {
        let line = collection();
        let track = StraightTrack::fit(&line).unwrap();
        assert!((track.spacing_m - 0.5).abs() < 1e-12);
        let centre = DVec3::new(5.0, -1000.0, 300.0) + DVec3::new(0.8, 0.6, 0.0) * 25.0;
        assert!((track.centre_m - centre).length() < 1e-9);
        // 7 m along the track and a 3-4-5 triangle across (horizontal normal and vertical).
        let point = centre + track.direction * 7.0 + DVec3::new(-0.6, 0.8, 0.0) * 30.0
            - DVec3::new(0.0, 0.0, 40.0);
        let (along_m, range_m) = track.along_and_range_m(point);
        assert!((along_m - 7.0).abs() < 1e-9 && (range_m - 50.0).abs() < 1e-9);
        for (n, pulse) in line.pulses.iter().enumerate() {
            assert!((track.place_m(pulse) - track.along_m(n)).abs() < 1e-10);
        }
    }

    /// Arc of `turn` turns with a radius of 100 m.
    fn arc(turn: f64) -> Collection {
        let mut arc = collection();
        let last = (arc.pulses.len() - 1) as f64;
        for (n, pulse) in arc.pulses.iter_mut().enumerate() {
            let (sin, cos) = (std::f64::consts::TAU * turn * n as f64 / last).sin_cos();
            pulse.transmitter_m = DVec3::new(100.0 * cos, 100.0 * sin, 30.0);
            pulse.receiver_m = pulse.transmitter_m;
        }
        arc
    }

    #[test]
    fn circle_is_refused_and_quarter_of_one_is_not() {
        let check = |turn: f64| {
            let arc = arc(turn);
            StraightTrack::fit(&arc).unwrap().check(&arc)
        };
        assert!(check(0.02).is_ok() && check(0.25).is_ok());
        for turn in [0.5, 0.9, 1.0] {
            let refused = check(turn).unwrap_err().to_string();
            assert!(refused.contains("not straight"), "{turn}: {refused}");
        }
    }

    #[test]
    fn stationary_radar_is_refused() {
        let mut still = collection();
        still.pulses = vec![still.pulses[3]; 5];
        assert!(StraightTrack::fit(&still).is_err());
        still.pulses.truncate(1);
        assert!(StraightTrack::fit(&still).is_err());
    }
}
