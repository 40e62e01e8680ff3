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
//! What the recorded track does otherwise (sway, uneven speed, antennas apart) is what formers compensate, and predict what
//! that leaves ([`super::strip`]).

use glam::DVec3;

use super::{FormError, Reason, Remedy};
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

    /// Where a pulse's phase centre lies along the track from the aperture's centre, metres.
    pub fn place_m(&self, pulse: &Pulse) -> f64 {
        ((pulse.transmitter_m + pulse.receiver_m) / 2.0 - self.centre_m).dot(self.direction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_model::geometry::SceneFrame;
    use subaperture_model::phase_history::Sweep;

    /// 101 pulses, 0.5 m apart along a slant line.
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
        let line = collection();
        let track = StraightTrack::fit(&line).unwrap();
        assert!((track.spacing_m - 0.5).abs() < 1e-12);
        let centre = DVec3::new(5.0, -1000.0, 300.0) + DVec3::new(0.8, 0.6, 0.0) * 25.0;
        assert!((track.centre_m - centre).length() < 1e-9);
        // 7 m along and a 3-4-5 triangle across (across: horizontal normal and vertical).
        let point = centre + track.direction * 7.0 + DVec3::new(-0.6, 0.8, 0.0) * 30.0
            - DVec3::new(0.0, 0.0, 40.0);
        let (along_m, range_m) = track.along_and_range_m(point);
        assert!((along_m - 7.0).abs() < 1e-9 && (range_m - 50.0).abs() < 1e-9);
        for (n, pulse) in line.pulses.iter().enumerate() {
            assert!((track.place_m(pulse) - track.along_m(n)).abs() < 1e-10);
        }
    }

    #[test]
    fn a_radar_that_stands_still_is_refused() {
        let mut still = collection();
        still.pulses = vec![still.pulses[3]; 5];
        assert!(StraightTrack::fit(&still).is_err());
        still.pulses.truncate(1);
        assert!(StraightTrack::fit(&still).is_err());
    }
}
