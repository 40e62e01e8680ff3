//! Moving targets: every former on a grid that moves, and one place at many velocities.
//!
//! A target that is at `p` at the epoch `t_0` and moves at `v` has in pulse `n` the path
//!
//! ```text
//! path_n(p + v (t_n - t_0)) = |p - (a_t - v (t_n - t_0))| + |p - (a_r - v (t_n - t_0))|
//! ```
//!
//! with `a_t`, `a_r` the antennas at `t_n` (Schone 2020, 4.3; 2.3 notes that only relative motion
//! counts). So a target at rest before antennas that move by `-v (t - t_0)` more has the same echo:
//! [`Moving`] presents a phase history in that frame, and every former focuses the target as it
//! focuses anything else. The path to which phases are compensated is a number of the recording and
//! stays; the point that it belongs to moves along. What does not move at `v` is smeared.
//!
//! [`VelocityPlane`] is the other cut through `I(x, y, v_x, v_y)` (Figure 4.13b): one position at the
//! epoch, a grid of velocities, by backprojection with the path above.
//!
//! **Resolution in velocity.** The phase at frequency `f` grows with velocity as
//! `2 pi f (t - t_0) (u_t + u_r) . v / c`, `u` the unit vectors from the antennas to the target. So
//! `K = f (t - t_0) (u_t + u_r) / c`, cycles for each m/s, is to velocity what spatial frequency is to
//! position, and the resolution along a direction follows from the distribution of `K` along it as in
//! [`subaperture_resolution::support`] ([`velocity_resolution_m_s`]). For a monostatic radar, a CPI of `T` seconds and the epoch at its
//! start that is `lambda / (2 T)` along the line of sight, 14 mm/s on Table 4.1; across it, where
//! `u_t + u_r` is only what the aperture's angle gives, 1 m/s.
//!
//! Neglected: the target's motion while a pulse travels, as everywhere here, and acceleration.
//!
//! Cost: [`Moving`] copies the geometry, 240 bytes a pulse; [`VelocityPlane`] is
//! [`super::bp`] with as many pixels as velocities.
//!
//! Accuracy: `tests/formers/movers.rs` compares both with the plain sum over a target in motion.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::bp;
use super::former::chosen;
use super::{
    Aim, Asked, Decision, FormError, Formed, Forming, ImageFormer, Misses, Task, accuracy,
};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Channel, Collection, InputFile, PhaseHistory, ReadError};
use subaperture_resolution::support::{self, Projection, path_gradient};

/// A phase history as a target at constant velocity sees it: in a frame that moves with the target.
pub struct Moving<'a> {
    history: &'a dyn PhaseHistory,
    collection: Collection,
}

impl<'a> Moving<'a> {
    /// The frame that moves at `velocity_m_s` and is the scene frame at `epoch_s`, a time of the
    /// collection: positions in an image are those at the epoch.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the recording tells no times, a number is not finite or light is slower.
    pub fn new(
        history: &'a dyn PhaseHistory,
        velocity_m_s: DVec3,
        epoch_s: f64,
    ) -> Result<Self, FormError> {
        require_times(history.collection())?;
        if !(velocity_m_s.length() < SPEED_OF_LIGHT_M_S && epoch_s.is_finite()) {
            return Err(FormError::unsuited(format!(
                "a velocity of {velocity_m_s} m/s at {epoch_s} s is no motion: give finite numbers, and less \
                 than the speed of light"
            )));
        }
        let mut collection = history.collection().clone();
        for pulse in &mut collection.pulses {
            let moved_m = velocity_m_s * (pulse.time_s - epoch_s);
            pulse.transmitter_m -= moved_m;
            pulse.receiver_m -= moved_m;
            pulse.reference_m -= moved_m;
            // The same from sample to sample. Where all are taken at once, nothing moves meanwhile.
            pulse.sweep.transmitter_m_s -= velocity_m_s;
            pulse.sweep.receiver_m_s -= velocity_m_s;
            if let Some(reference_m_s) = &mut pulse.sweep.reference_m_s {
                *reference_m_s -= velocity_m_s;
            }
        }
        Ok(Self {
            history,
            collection,
        })
    }
}

impl PhaseHistory for Moving<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)
    }

    fn at_hand(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.at_hand(pulses)
    }

    fn channels(&self) -> Vec<Channel> {
        self.history.channels()
    }

    fn held_bytes(&self) -> u64 {
        self.history.held_bytes() + size_of_val(self.collection.pulses.as_slice()) as u64
    }

    fn inputs(&self) -> Result<Vec<InputFile>, ReadError> {
        self.history.inputs()
    }
}

/// One position at many velocities. The task's grid is one of velocities: where an image has metres,
/// it has metres a second, and its origin is the velocity at `x = y = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityPlane {
    /// Where the target is at the epoch, metres in the scene frame.
    pub position_m: DVec3,
    /// When it is there, seconds from the collection's start.
    pub epoch_s: f64,
    /// Bound on the relative RMS error, dB (negative).
    pub error_db: f64,
}

impl ImageFormer for VelocityPlane {
    fn name(&self) -> &'static str {
        "velocity"
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!({
            "position_m": self.position_m.to_array(),
            "epoch_s": self.epoch_s,
            "error_db": self.error_db,
        })
    }

    fn bound_db(&self) -> Option<f64> {
        Some(self.error_db)
    }

    fn follows_sweeps(&self) -> bool {
        true
    }

    fn form_asked(&self, task: &Task, misses: Misses) -> Result<Formed, FormError> {
        accuracy::keep_planned(self, task, misses)
    }

    fn decide(&self, aim: &Aim, asked: &Asked, _: &dyn Monitor) -> Result<Decision, FormError> {
        require_times(aim.collection)?;
        bp::decide(aim, self.error_db, asked, self.meaning())
    }

    fn open<'a>(
        &self,
        aim: Aim<'a>,
        choices: &serde_json::Value,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        bp::open(aim, chosen(self.name(), choices)?, self.meaning())
    }
}

impl VelocityPlane {
    fn meaning(&self) -> bp::Meaning {
        bp::Meaning::Velocities {
            position_m: self.position_m,
            epoch_s: self.epoch_s,
        }
    }
}

/// Resolution in velocity along a `direction` (a unit vector) of a target at `position_m` at
/// `epoch_s`, m/s, Rayleigh's as [`Projection::resolution_m`] has it; infinite where no pulse tells anything of it.
pub fn velocity_resolution_m_s(
    collection: &Collection,
    position_m: DVec3,
    epoch_s: f64,
    direction: DVec3,
) -> f64 {
    let segments = collection.pulses.iter().map(|pulse| {
        let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, position_m);
        let across = (pulse.time_s - epoch_s) * gradient.dot(direction) / SPEED_OF_LIGHT_M_S;
        // Half a sample beyond either end: the band is as wide as it has samples.
        let edge = |k: f64| (pulse.start_hz + k * pulse.step_hz) * across;
        ([edge(-0.5), edge(collection.num_samples as f64 - 0.5)], 1.0)
    });
    let cells = vec![1.0; collection.num_samples.min(support::MOST_CELLS)];
    Projection::new(segments, &cells)
        .and_then(|projection| projection.resolution_m())
        .unwrap_or(f64::INFINITY)
}

fn require_times(collection: &Collection) -> Result<(), FormError> {
    if collection.timed {
        return Ok(());
    }
    Err(FormError::unsuited(format!(
        "{}: the recording tells no times, so nothing in it can be said to move: focus it without a \
         velocity",
        collection.name
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_simulate::{Preset, Variation};

    /// Pulse 400 of Table 4.1, by hand: the radar at ((400 - 519.5) 0.125, -5000), 0.4 s after the
    /// start, a target that left (3, 4) at 0.1 s with (20, -10, 5) m/s.
    #[test]
    fn the_moving_frame_keeps_the_paths() {
        let history = Preset::Table41.simulate(&Variation::default());
        let velocity = DVec3::new(20.0, -10.0, 5.0);
        let moving = Moving::new(&history, velocity, 0.1).unwrap();
        let pulse = &moving.collection().pulses[400];
        let (x, y, z) = (3.0 + 6.0 + 119.5 * 0.125, 4.0 - 3.0 + 5000.0, 1.5f64);
        let expected_m = 2.0 * (x * x + y * y + z * z).sqrt() - 10_000.0;
        let got_m = pulse.relative_path_m(DVec3::new(3.0, 4.0, 0.0));
        // Rounding of float64 at 1e4 m.
        assert!((got_m - expected_m).abs() < 1e-11, "{got_m} {expected_m}");
        assert!((pulse.path_m(pulse.reference_m) - 10_000.0).abs() < 1e-11);
    }

    #[test]
    fn a_recording_without_times_is_refused() {
        let history = Preset::Table41.simulate(&Variation::default());
        let mut collection = history.collection().clone();
        collection.timed = false;
        let untimed = subaperture_simulate::Simulated::new(collection, Vec::new(), None);
        let error = Moving::new(&untimed, DVec3::X, 0.0).err().unwrap();
        assert!(error.to_string().contains("tells no times"), "{error}");
        let error = Moving::new(&history, DVec3::NAN, 0.0).err().unwrap();
        assert!(error.to_string().contains("finite"), "{error}");
    }

    /// The plain sum over pulses and frequencies, with true paths, stepped from zero velocity to half its power. Radially
    /// every pulse tells as much as its time; across, more of them tell little than much, and the box around them would
    /// say 0.98 m/s where 1.04 is true.
    #[test]
    fn velocity_resolution_of_table_4_1() {
        let history = Preset::Table41.simulate(&Variation::default());
        let collection = history.collection();
        for direction in [DVec3::X, DVec3::Y] {
            let power = |speed_m_s: f64| {
                let mut sum = num_complex::Complex64::ZERO;
                for pulse in collection.pulses.iter().step_by(4) {
                    let moved_m = direction * speed_m_s * pulse.time_s;
                    let path_m = pulse.path_m(moved_m) - pulse.path_m(DVec3::ZERO);
                    for k in (0..collection.num_samples).step_by(8) {
                        let turns = pulse.frequency_hz(k) * path_m / SPEED_OF_LIGHT_M_S;
                        sum += num_complex::Complex64::cis(std::f64::consts::TAU * turns);
                    }
                }
                sum.norm_sqr()
            };
            let predicted = velocity_resolution_m_s(collection, DVec3::ZERO, 0.0, direction);
            let step = predicted / 1000.0;
            let half = (1..5000).find(|&i| power(f64::from(i) * step) < power(0.0) / 2.0);
            let measured = 2.0 * f64::from(half.unwrap()) * step / 0.885_893;
            println!("{direction}: predicted {predicted:.4} m/s, measured {measured:.4} m/s");
            assert!(
                (predicted / measured - 1.0).abs() < 0.01,
                "{predicted} {measured}"
            );
        }
    }
}
