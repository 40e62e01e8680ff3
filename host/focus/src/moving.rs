//! Focusing of moving targets: any former in a moving frame, and one position at many velocities.
//!
//! A target at `p` at the epoch `t_0` with displacement `d(t)`, `d(t_0) = 0`, has in pulse `n` the path
//!
//! ```text
//! path_n(p + d(t_n)) = |p - (a_t - d(t_n))| + |p - (a_r - d(t_n))|
//! ```
//!
//! where `a_t`, `a_r` are the antennas at `t_n` (Schone 2020, 4.3; 2.3 notes that only relative motion
//! counts). A stationary target seen by antennas with an additional motion of `-d(t)` therefore has the same echo.
//! For constant velocity `d(t) = v (t - t_0)`; for any other motion `d` is a natural cubic spline through sampled
//! positions ([`Displacement`]). The velocity of intra-pulse motion is the derivative `d'(t_n)`.
//! [`Moving`] presents a phase history in that frame, and every former focuses the target like
//! a stationary one. The path to which phases are compensated is a number of the recording and
//! unchanged; the point that it belongs to moves along. Scatterers with a different motion are smeared.
//!
//! [`VelocityPlane`] is the other section through `I(x, y, v_x, v_y)` (Figure 4.13b): one position at the
//! epoch, a grid of velocities, by backprojection with the path above.
//!
//! **Resolution in velocity.** The phase at frequency `f` grows with velocity as
//! `2 pi f (t - t_0) (u_t + u_r) . v / c`, `u` the unit vectors from the antennas to the target. So
//! `K = f (t - t_0) (u_t + u_r) / c`, cycles per m/s, corresponds for velocity to spatial frequency for
//! position, and the resolution along a direction follows from the distribution of `K` along it as in
//! [`subaperture_model::resolution::support`] ([`velocity_resolution_m_s`]). For a monostatic radar, a CPI of `T` seconds and the epoch at its
//! start that is `lambda / (2 T)` along the line of sight, 14 mm/s on Table 4.1; across it, where
//! only the angle of the aperture changes `u_t + u_r`, 1 m/s.
//!
//! **Interpolation.** Positions sampled every `h` seconds have an error of at most `5 / 384 h^4 max |d''''|` where the
//! acceleration is smooth. Where it jumps by `J` (at the first and last sample, from its value to zero), the spline
//! `s` equals `d` at the samples and `|s'' - d''| <= 2 J`: the error is at most `J h^2 / 4`, and decreases by a factor of 3.7 per
//! sample. The phase error is at most `4 pi / lambda` times that, `pi J h^2 / lambda`: at 4 m/s^2 and 10 GHz 0.04 rad for samples every
//! 10 ms. Samples before the first and after the last pulse reduce the error at the ends.
//!
//! Neglected: target motion during pulse propagation, and acceleration `a` during a pulse of `T` seconds, whose
//! displacement is at most `a T^2 / 8`: 0.5 um at 4 m/s^2 in 1 ms.
//!
//! Cost: [`Moving`] copies the geometry, 264 bytes per pulse; [`VelocityPlane`] is
//! [`super::bp`] with as many pixels as velocities.
//!
//! Accuracy: `tests/formers/movers.rs` compares both with the plain sum over a target in motion.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::bp;
use super::coverage::Coverage;
use super::former_choices::FormerChoices;
use super::{
    BoundPolicy, Decision, ErrorGoal, FormError, Formed, Forming, GridPoints, ImageFormer,
    ImageSpec, Task, accuracy,
};
use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::geometry::Axis;
use subaperture_model::monitor::Monitor;
use subaperture_model::phase_history::{Beam, Collection, NoBeam, PhaseHistory, ReadError};
use subaperture_model::resolution::support::{self, Projection, path_gradient};
use subaperture_model::track::Displacement;

/// Largest time of a pulse before the first or after the last sample of a displacement, seconds: rounding of decimal times.
pub const SLACK_S: f64 = 1e-9;

/// Phase history in a frame that moves with a target.
pub struct Moving<'a> {
    history: Box<dyn PhaseHistory + 'a>,
    collection: Collection,
    target: Displacement,
}

impl<'a> Moving<'a> {
    /// Make the frame that moves with the displacement of a `target`, or at its velocity, and coincides with the scene frame at `epoch_s`, a
    /// time of the collection. Image positions are those at the epoch.
    ///
    /// # Errors
    /// [`FormError::Unsuited`] if the recording has no times, a number is not finite, the speed exceeds that of light, or a
    /// sampled displacement does not cover the epoch and all pulses to [`SLACK_S`].
    pub fn new(
        history: impl PhaseHistory + 'a,
        target: impl Into<Displacement>,
        epoch_s: f64,
    ) -> Result<Self, FormError> {
        let target = target.into();
        require_times(history.collection())?;
        require_motion(&target, history.collection(), epoch_s)?;
        let mut collection = history.collection().clone();
        for pulse in &mut collection.pulses {
            let (moved_m, velocity_m_s) = target.between(epoch_s, pulse.time_s);
            pulse.transmitter_m -= moved_m;
            pulse.receiver_m -= moved_m;
            pulse.reference_m -= moved_m;
            // Intra-pulse motion changes likewise. Without intra-pulse motion the target is stationary during a pulse.
            pulse.sweep.transmitter_m_s -= velocity_m_s;
            pulse.sweep.receiver_m_s -= velocity_m_s;
            if let Some(reference_m_s) = &mut pulse.sweep.reference_m_s {
                *reference_m_s -= velocity_m_s;
            }
        }
        Ok(Self {
            history: Box::new(history),
            collection,
            target,
        })
    }

    /// Transform a beam of the recording to this frame; its angles remain relative to the antennas' own track.
    #[must_use]
    pub fn seen_from(&self, beam: Beam) -> Beam {
        Beam {
            target: Some(self.target.clone()),
            ..beam
        }
    }
}

impl PhaseHistory for Moving<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses, samples)
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.samples_in_memory(pulses)
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(&*self.history)
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        let stated = self.history.stated_beam()?;
        Ok(stated.map(|beam| self.seen_from(beam)))
    }

    fn target(&self) -> Option<&Displacement> {
        Some(&self.target)
    }
}

/// Former for one position at many velocities. The task's grid is one of velocities: metres per second replace
/// metres, and its origin is the velocity at `x = y = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityPlane {
    /// Position of the target at the epoch, metres in the scene frame.
    pub position_m: DVec3,
    /// Epoch, seconds from the collection's start.
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

    fn grid_points(&self) -> GridPoints {
        GridPoints::Velocities {
            position_m: self.position_m,
            epoch_s: self.epoch_s,
        }
    }

    fn form_asked(&self, task: &Task, bound_policy: BoundPolicy) -> Result<Formed, FormError> {
        Coverage::new(task.spec(), self.grid_points()).count_uncovered()?;
        // Its pixels are moving points, for which there is no exact sum.
        accuracy::keep_planned(self, task, bound_policy, |decision, work, tiles| {
            self.open(task.spec(), &decision.choices)?.form(work, tiles)
        })
    }

    fn decide(
        &self,
        spec: &ImageSpec,
        goal: &ErrorGoal,
        _: &dyn Monitor,
    ) -> Result<Decision, FormError> {
        require_times(spec.collection)?;
        let decision = bp::decide(spec, self.error_db, goal, self.grid_points())?;
        Ok(decision.map_choices(FormerChoices::new))
    }

    fn open<'a>(
        &self,
        spec: ImageSpec<'a>,
        choices: &FormerChoices,
    ) -> Result<Box<dyn Forming + 'a>, FormError> {
        bp::open(spec, choices.of(self.name())?, self.grid_points())
    }
}

/// Rayleigh resolution in velocity along a `direction` (a unit vector) of a target at `position_m` at
/// `epoch_s`, m/s, as in [`Projection::resolution_m`]; infinite where no pulse resolves velocity.
pub fn velocity_resolution_m_s(
    collection: &Collection,
    position_m: DVec3,
    epoch_s: f64,
    direction: DVec3,
) -> f64 {
    let segments = collection.pulses.iter().map(|pulse| {
        let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, position_m);
        let across = (pulse.time_s - epoch_s) * gradient.dot(direction) / SPEED_OF_LIGHT_M_S;
        // The band extends half a sample beyond either end.
        let edge = |k: f64| (pulse.start_hz + k * pulse.step_hz) * across;
        ([edge(-0.5), edge(collection.num_samples as f64 - 0.5)], 1.0)
    });
    let cells = vec![1.0; collection.num_samples.min(support::MAX_CELLS)];
    Projection::new(segments, &cells)
        .and_then(|projection| projection.resolution_m())
        .unwrap_or(f64::INFINITY)
}

/// Largest number of steps on either side of zero in [`default_velocities`].
const MAX_VELOCITIES: usize = 128;

/// Default velocities along a `direction` (a unit vector) for a target at `position_m` at the first pulse: from zero in both directions in steps of half the resolution
/// ([`velocity_resolution_m_s`]), within the unambiguous interval, at most 128 steps. A velocity is ambiguous where the two-way path grows by half a
/// wavelength or more from pulse to pulse:
///
/// ```text
/// v < lambda / (2 T |g|),    g = (u_t + u_r) . direction
/// ```
///
/// where `T` is the mean time between pulses and `|g|` the largest of all pulses.
///
/// # Errors
/// [`FormError::Unsuited`] if the recording has no times, or does not resolve velocities along the direction.
pub fn default_velocities(
    collection: &Collection,
    position_m: DVec3,
    direction: DVec3,
) -> Result<Axis, FormError> {
    require_times(collection)?;
    let (Some(first), Some(last)) = (collection.pulses.first(), collection.pulses.last()) else {
        return Err(FormError::unsuited(
            "the recording has no pulses".to_owned(),
        ));
    };
    let resolution_m_s = velocity_resolution_m_s(collection, position_m, first.time_s, direction);
    if !(resolution_m_s.is_finite() && resolution_m_s > 0.0) {
        return Err(FormError::unsuited(format!(
            "{}: velocities along ({}, {}, {}) are not resolved at this position",
            collection.name, direction.x, direction.y, direction.z
        )));
    }
    let step = 0.5 * resolution_m_s;
    let middle = collection.num_samples as f64 / 2.0;
    let fastest = collection.pulses.iter().map(|pulse| {
        let gradient = path_gradient(pulse.transmitter_m, pulse.receiver_m, position_m);
        let frequency_hz = pulse.start_hz + middle * pulse.step_hz;
        gradient.dot(direction).abs() * frequency_hz / SPEED_OF_LIGHT_M_S
    });
    let turns_a_metre = fastest.fold(0.0, f64::max);
    let pri_s = (last.time_s - first.time_s) / (collection.pulses.len() as f64 - 1.0).max(1.0);
    let unambiguous = 0.5 / (pri_s * turns_a_metre) / step;
    // Infinite where there is no limit.
    let steps = match unambiguous < MAX_VELOCITIES as f64 {
        true => (unambiguous.floor() as usize).max(1),
        false => MAX_VELOCITIES,
    };
    Ok(Axis {
        start: -(steps as f64) * step,
        step,
        count: 2 * steps + 1,
    })
}

fn require_times(collection: &Collection) -> Result<(), FormError> {
    if collection.timed {
        return Ok(());
    }
    Err(FormError::unsuited(format!(
        "{}: the recording has no pulse times, which a moving target needs: focus it as \
         stationary",
        collection.name
    )))
}

/// Check that a displacement is finite, slower than light, and covers the epoch and all pulses.
fn require_motion(
    target: &Displacement,
    collection: &Collection,
    epoch_s: f64,
) -> Result<(), FormError> {
    if let Displacement::Velocity(velocity_m_s) = target
        && !(velocity_m_s.length() < SPEED_OF_LIGHT_M_S && epoch_s.is_finite())
    {
        return Err(FormError::unsuited(format!(
            "target velocity {velocity_m_s} m/s at {epoch_s} s: expected finite numbers and a speed below the \
             speed of light"
        )));
    }
    let Some([first_s, last_s]) = target.span_s() else {
        return Ok(());
    };
    let times = collection.pulses.iter().map(|pulse| pulse.time_s);
    let [from_s, to_s] = times.fold([epoch_s; 2], |[low, high], time_s| {
        [low.min(time_s), high.max(time_s)]
    });
    if from_s >= first_s - SLACK_S && to_s <= last_s + SLACK_S {
        return Ok(());
    }
    Err(FormError::unsuited(format!(
        "{}: expected the target's motion from {from_s} s to {to_s} s, the times of the pulses, found {first_s} s to {last_s} s",
        collection.name
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use subaperture_simulate::{Preset, Variation};

    /// Pulse 400 of Table 4.1, computed by hand: the radar at ((400 - 519.5) 0.125, -5000), 0.4 s after the
    /// start, a target that left (3, 4) at 0.1 s with (20, -10, 5) m/s.
    #[test]
    fn moving_frame_preserves_paths() {
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
    fn recording_without_times_is_refused() {
        let history = Preset::Table41.simulate(&Variation::default());
        let mut collection = history.collection().clone();
        collection.timed = false;
        let untimed = subaperture_simulate::PointTargetHistory::new(collection, Vec::new(), None);
        let error = Moving::new(&untimed, DVec3::X, 0.0).err().unwrap();
        assert!(error.to_string().contains("has no pulse times"), "{error}");
        let error = Moving::new(&history, DVec3::NAN, 0.0).err().unwrap();
        assert!(error.to_string().contains("finite"), "{error}");
        let error = Moving::new(&untimed, cubic(0.0), 0.0).err().unwrap();
        assert!(error.to_string().contains("has no pulse times"), "{error}");
    }

    /// Displacement `x = (t - start)^3` up to 1 s after its start, then with acceleration that falls linearly to zero at 2 s: the
    /// natural spline through 0, 1 and 6 m.
    fn cubic(start_s: f64) -> Displacement {
        let times = [0.0, 1.0, 2.0].map(|t| start_s + t);
        let places = [0.0, 1.0, 6.0].map(|x| DVec3::new(x, 0.0, 0.0));
        Displacement::sampled(times.to_vec(), &places).unwrap()
    }

    /// Pulse 400 of Table 4.1, 0.4 s after the start of the cubic, with intra-pulse motion: `0.4^3` m and `3 0.4^2` m/s.
    #[test]
    fn accelerated_frame_has_displacement_and_velocity_of_each_pulse() {
        let history = Preset::Table41.simulate(&Variation::default());
        let mut collection = history.collection().clone();
        for pulse in &mut collection.pulses {
            pulse.sweep.sample_s = 1e-6;
            pulse.sweep.transmitter_m_s = DVec3::X * 125.0;
            pulse.sweep.receiver_m_s = DVec3::X * 125.0;
            pulse.sweep.reference_m_s = Some(DVec3::ZERO);
        }
        let at_rest = subaperture_simulate::PointTargetHistory::new(collection, Vec::new(), None);
        let moving = Moving::new(&at_rest, cubic(0.0), 0.0).unwrap();
        let pulse = &moving.collection().pulses[400];
        let x_m = (400.0 - 519.5) * 0.125 - 0.064;
        // Rounding of float64 at 100 m and 125 m/s.
        assert!((pulse.transmitter_m.x - x_m).abs() < 1e-13, "{pulse:?}");
        assert!((pulse.receiver_m.x - x_m).abs() < 1e-13, "{pulse:?}");
        for velocity_m_s in [pulse.sweep.transmitter_m_s, pulse.sweep.receiver_m_s] {
            assert!((velocity_m_s.x - 124.52).abs() < 1e-12, "{pulse:?}");
        }
        let reference_m_s = pulse.sweep.reference_m_s.unwrap();
        assert!((reference_m_s.x + 0.48).abs() < 1e-13, "{pulse:?}");
    }

    #[test]
    fn motion_that_does_not_cover_pulses_is_refused_with_both_intervals() {
        let history = Preset::Table41.simulate(&Variation::default());
        // Pulses from 0 to 1.039 s; the slack is 1 ns.
        assert!(Moving::new(&history, cubic(0.9e-9), 0.0).is_ok());
        for (start_s, found) in [
            (2e-9, "found 0.000000002 s to"),
            (-1.5, "found -1.5 s to 0.5 s"),
        ] {
            let error = Moving::new(&history, cubic(start_s), 0.0).err().unwrap();
            let error = error.to_string();
            assert!(error.contains("from 0 s to 1.039 s"), "{error}");
            assert!(error.contains(found), "{error}");
        }
    }

    /// The direct sum over pulses and frequencies with true paths, from zero velocity to half its power. Radially
    /// every pulse contributes in proportion to its time; across, most pulses contribute little, and a bounding box would
    /// give 0.98 m/s where 1.04 is correct.
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
