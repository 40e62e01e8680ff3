//! Correction of a recording by autofocus: one phase per pulse, or displacements of the antennas.
//!
//! A recorded sample is modelled as `exp(+j error_rad[n])` times the value predicted by the geometry; the correction removes this
//! factor. A displacement is the offset of the radar, transmitter and receiver alike, from its recorded position. The reference
//! paths ([`Pulse::reference_path_m`](subaperture_model::phase_history::Pulse::reference_path_m)) are unchanged, because the
//! recording's producer computed them from the recorded track.
//!
//! Neglected: changes of the velocity within a pulse
//! ([`Sweep`](subaperture_model::phase_history::Sweep) is unchanged).

use std::ops::Range;

use glam::DVec3;
use num_complex::Complex32;

use subaperture_model::antenna::MountedAntennas;
use subaperture_model::phase_history::{Beam, Collection, NoBeam, PhaseHistory, ReadError};
use subaperture_signal::phase::{cis, narrow};

/// Correction of a recording, one entry per pulse.
#[derive(Clone, Debug, PartialEq)]
pub enum Correction {
    /// Phase errors, radians: each pulse is multiplied by `exp(-j error_rad)`.
    Phase {
        /// Phase correction of every pulse.
        error_rad: Vec<f64>,
    },
    /// Displacements of the antennas, metres in the scene frame: added to their recorded positions.
    Track {
        /// Displacement of every pulse.
        displacement_m: Vec<DVec3>,
    },
}

/// A correction that does not fit its recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Misfit {
    /// The number of entries differs from the number of pulses.
    #[error("expected a correction with one entry per pulse ({pulses}), got {entries} entries")]
    Count {
        /// Number of pulses in the correction.
        entries: usize,
        /// Number of pulses in the recording.
        pulses: usize,
    },
    /// An entry is not finite.
    #[error("the correction of pulse {pulse} (from 0) is not a finite number")]
    NotFinite {
        /// Index of the entry.
        pulse: usize,
    },
}

impl Correction {
    /// Number of entries, one per pulse.
    pub fn len(&self) -> usize {
        match self {
            Self::Phase { error_rad } => error_rad.len(),
            Self::Track { displacement_m } => displacement_m.len(),
        }
    }

    /// Whether the correction is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sum of two corrections of one kind and length.
    pub(crate) fn and(mut self, other: &Self) -> Self {
        match (&mut self, other) {
            (Self::Phase { error_rad }, Self::Phase { error_rad: more }) => {
                error_rad.iter_mut().zip(more).for_each(|(a, b)| *a += b);
            }
            (
                Self::Track { displacement_m },
                Self::Track {
                    displacement_m: more,
                },
            ) => {
                displacement_m
                    .iter_mut()
                    .zip(more)
                    .for_each(|(a, b)| *a += b);
            }
            _ => unreachable!("a method's corrections are of one kind"),
        }
        self
    }

    /// Root of the mean square phase about its mean, radians; `None` for a track. The smaller of the values for
    /// wrapped phases and for phases unwrapped from pulse to pulse: whole turns are no error.
    pub fn rms_phase_rad(&self) -> Option<f64> {
        let Self::Phase { error_rad } = self else {
            return None;
        };
        let wrapped: Vec<f64> = error_rad.iter().map(|&phase| wrap(phase)).collect();
        Some(rms(&unwrapped(error_rad)).min(rms(&wrapped)))
    }

    /// Root of the mean square displacement about its mean, metres; `None` for phase corrections.
    pub fn rms_displacement_m(&self) -> Option<f64> {
        let Self::Track { displacement_m } = self else {
            return None;
        };
        let count = displacement_m.len().max(1) as f64;
        let mean = displacement_m.iter().sum::<DVec3>() / count;
        let squares = displacement_m.iter().map(|d| d.distance_squared(mean));
        Some((squares.sum::<f64>() / count).sqrt())
    }

    fn check(&self, pulses: usize) -> Result<(), Misfit> {
        if self.len() != pulses {
            let entries = self.len();
            return Err(Misfit::Count { entries, pulses });
        }
        let bad = match self {
            Self::Phase { error_rad } => error_rad.iter().position(|x| !x.is_finite()),
            Self::Track { displacement_m } => displacement_m.iter().position(|x| !x.is_finite()),
        };
        match bad {
            None => Ok(()),
            Some(pulse) => Err(Misfit::NotFinite { pulse }),
        }
    }
}

/// Wrap a phase to -pi to pi.
pub(crate) fn wrap(phase_rad: f64) -> f64 {
    phase_rad - std::f64::consts::TAU * (phase_rad / std::f64::consts::TAU).round()
}

/// Phases with whole turns added, so that neighbours are less than half a turn apart.
pub(crate) fn unwrapped(phases_rad: &[f64]) -> Vec<f64> {
    let mut last = phases_rad.first().copied().unwrap_or(0.0);
    let follow = |&phase: &f64| {
        last += wrap(phase - last);
        last
    };
    phases_rad.iter().map(follow).collect()
}

fn rms(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Recording with a correction applied.
pub struct Corrected<'a> {
    history: Box<dyn PhaseHistory + 'a>,
    collection: Collection,
    phasors: Vec<Complex32>,
}

impl<'a> Corrected<'a> {
    /// Apply `correction` to `history`.
    ///
    /// # Errors
    /// [`Misfit`].
    pub fn new(history: impl PhaseHistory + 'a, correction: &Correction) -> Result<Self, Misfit> {
        let whole = history.collection();
        correction.check(whole.pulses.len())?;
        let mut collection = whole.clone();
        let mut phasors = Vec::new();
        match correction {
            Correction::Phase { error_rad } => {
                phasors = error_rad.iter().map(|&e| narrow(cis(-e))).collect();
            }
            Correction::Track { displacement_m } => {
                for (pulse, &moved_m) in collection.pulses.iter_mut().zip(displacement_m) {
                    pulse.transmitter_m += moved_m;
                    pulse.receiver_m += moved_m;
                }
            }
        }
        Ok(Self {
            history: Box::new(history),
            collection,
            phasors,
        })
    }
}

impl PhaseHistory for Corrected<'_> {
    fn collection(&self) -> &Collection {
        &self.collection
    }

    fn inner(&self) -> Option<&dyn PhaseHistory> {
        Some(&*self.history)
    }

    fn read(&self, pulses: Range<usize>, samples: &mut [Complex32]) -> Result<(), ReadError> {
        self.history.read(pulses.clone(), samples)?;
        let width = self.collection.num_samples.max(1);
        let phasors = self.phasors.iter().skip(pulses.start);
        for (pulse, &phasor) in samples.chunks_exact_mut(width).zip(phasors) {
            pulse.iter_mut().for_each(|z| *z *= phasor);
        }
        Ok(())
    }

    fn samples_in_memory(&self, pulses: Range<usize>) -> Option<&[Complex32]> {
        match self.phasors.is_empty() {
            true => self.history.samples_in_memory(pulses),
            false => None,
        }
    }

    fn true_antennas(&self) -> Option<&[[DVec3; 2]]> {
        self.history.true_antennas()
    }

    fn antennas(&self) -> Option<MountedAntennas> {
        self.history.antennas()
    }

    fn stated_beam(&self) -> Result<Option<Beam>, NoBeam> {
        self.history.stated_beam()
    }

    fn held_bytes(&self) -> u64 {
        let own =
            size_of_val(self.collection.pulses.as_slice()) + size_of_val(self.phasors.as_slice());
        self.history.held_bytes() + own as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_turns_do_not_count_as_phase_error() {
        let smooth: Vec<f64> = (0..100).map(|n| wrap(0.3 * f64::from(n))).collect();
        let all = unwrapped(&smooth);
        assert!((all[99] - all[0] - 0.3 * 99.0).abs() < 1e-9);
        // A ramp of 0.3 rad over 100 pulses is 0.3 sqrt((100^2 - 1) / 12) = 8.66 rad unwrapped, and wrapped at most
        // a turn over sqrt 12, 1.81.
        let error_rad = smooth;
        let rms = Correction::Phase { error_rad }.rms_phase_rad().unwrap();
        assert!(rms < 1.9, "{rms}");
        let turns = Correction::Phase {
            error_rad: vec![0.0, std::f64::consts::TAU, 0.0],
        };
        assert!(turns.rms_phase_rad().unwrap() < 1e-12);
    }

    #[test]
    fn rms_displacement_is_about_mean() {
        let displacement_m = vec![DVec3::new(1.0, 0.0, 0.0), DVec3::new(3.0, 0.0, 0.0)];
        let track = Correction::Track { displacement_m };
        assert_eq!(track.rms_displacement_m(), Some(1.0));
        let twice = track.clone().and(&track);
        assert_eq!(twice.rms_displacement_m(), Some(2.0));
        assert!(track.check(3).is_err());
    }
}
