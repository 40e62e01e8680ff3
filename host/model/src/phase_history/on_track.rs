//! Phase history with its antenna positions replaced by those of another track.

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use super::{Beam, Collection, NoBeam, PhaseHistory, ReadError};
use crate::antenna::MountedAntennas;
use crate::track::Trajectory;

/// Phase history with the antenna positions of another track.
///
/// Phases remain compensated to the recorded reference paths: [`Pulse::reference_path_m`](super::Pulse::reference_path_m) is
/// a property of the samples. Intra-pulse motion stays as recorded ([`Sweep`](super::Sweep)): the difference
/// between the tracks within a pulse is neglected.
///
/// Memory: a copy of the geometry, 264 bytes a pulse.
pub struct OnTrack<'a> {
    history: Box<dyn PhaseHistory + 'a>,
    collection: Collection,
    first: usize,
}

impl<'a> OnTrack<'a> {
    /// Place transmitter and receiver at these positions on the body (body axes, metres) for the pulses with times
    /// within `span_s`, which are consecutive since times ascend.
    ///
    /// # Errors
    /// [`ReadError::Mismatch`] if no pulse is within.
    pub fn new(
        history: Box<dyn PhaseHistory + 'a>,
        track: &dyn Trajectory,
        arms_m: [DVec3; 2],
        span_s: (f64, f64),
    ) -> Result<Self, ReadError> {
        let of = history.collection();
        let within = |time_s: f64| span_s.0 <= time_s && time_s <= span_s.1;
        let first = of.pulses.iter().position(|pulse| within(pulse.time_s));
        let last = of.pulses.iter().rposition(|pulse| within(pulse.time_s));
        let (Some(first), Some(last)) = (first, last) else {
            let times =
                |of: &Collection| Some((of.pulses.first()?.time_s, of.pulses.last()?.time_s));
            let (from_s, to_s) = times(of).unwrap_or_default();
            return Err(ReadError::Mismatch(format!(
                "{}: no pulse is within the time of the track: pulses are from {from_s} s to {to_s} s, the track from {} s to {} s",
                of.name, span_s.0, span_s.1
            )));
        };
        let mut collection = Collection {
            pulses: of.pulses[first..=last].to_vec(),
            name: of.name.clone(),
            ..*of
        };
        for pulse in &mut collection.pulses {
            let pose = track.pose(pulse.time_s);
            let [transmitter_m, receiver_m] = arms_m.map(|arm_m| pose.point_m(arm_m));
            pulse.transmitter_m = transmitter_m;
            pulse.receiver_m = receiver_m;
        }
        Ok(Self {
            history,
            collection,
            first,
        })
    }

    fn recorded(&self, pulses: Range<usize>) -> Range<usize> {
        pulses.start + self.first..pulses.end + self.first
    }
}

impl PhaseHistory for OnTrack<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(&*self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(self.recorded(pulses), samples)
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        self.history.samples_in_memory(self.recorded(pulses))
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        let all = self.history.true_antennas()?;
        all.get(self.recorded(0..self.collection.pulses.len()))
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        let mut mounted = self.history.antennas()?;
        let recorded = self.recorded(0..self.collection.pulses.len());
        mounted.attitudes = mounted.attitudes.get(recorded)?.to_vec();
        Some(mounted)
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SceneFrame;
    use crate::phase_history::{InMemory, Pulse, Sweep};
    use crate::track::{Pose, turned};
    use std::f64::consts::FRAC_PI_2;

    /// Motion northwards at 2 m/s, heading north.
    #[derive(Debug)]
    struct North;

    impl Trajectory for North {
        fn pose(&self, time_s: f64) -> Pose {
            Pose {
                position_m: DVec3::Y * (2.0 * time_s),
                attitude: turned(0.0, 0.0, FRAC_PI_2),
            }
        }
    }

    #[test]
    fn antennas_follow_the_track() {
        let pulse = |n: usize| Pulse {
            time_s: n as f64,
            transmitter_m: DVec3::X * n as f64,
            receiver_m: DVec3::X * n as f64,
            reference_m: DVec3::new(0.0, 50.0, 0.0),
            reference_path_m: 100.0 + n as f64,
            start_hz: 1e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
            recorded_path_m: None,
        };
        let collection = Collection {
            name: "east".to_owned(),
            num_samples: 2,
            pulses: (0..6).map(pulse).collect(),
            frame: SceneFrame::Local,
            extent: None,
            timed: true,
        };
        let samples: Vec<Complex32> = (0..12).map(|i| Complex32::new(i as f32, 0.0)).collect();
        let history = || Box::new(InMemory::new(collection.clone(), samples.clone()).unwrap());
        let arms_m = [DVec3::X, DVec3::Y];
        let moved = OnTrack::new(history(), &North, arms_m, (0.5, 4.0)).unwrap();
        let pulses = &moved.collection().pulses;
        assert_eq!(pulses.len(), 4);
        for (pulse, n) in pulses.iter().zip(1..) {
            let at = DVec3::Y * (2.0 * f64::from(n));
            assert!(pulse.transmitter_m.distance(at + DVec3::Y) < 1e-12);
            assert!(pulse.receiver_m.distance(at - DVec3::X) < 1e-12);
            // The reference path of the samples is unchanged.
            assert_eq!(pulse.reference_path_m, 100.0 + f64::from(n));
        }
        let mut got = [Complex32::ZERO; 4];
        moved.read(1..3, &mut got).unwrap();
        assert_eq!(got.map(|z| z.re), [4.0, 5.0, 6.0, 7.0]);
        assert_eq!(moved.samples_in_memory(1..3).unwrap(), got);
        let error = OnTrack::new(history(), &North, arms_m, (6.0, 9.0))
            .err()
            .unwrap();
        assert!(error.to_string().contains("no pulse is within"), "{error}");
    }
}
