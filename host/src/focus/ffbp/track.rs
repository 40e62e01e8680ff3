//! A stretch of pulses and the smooth track through it.
//!
//! Decimated pulses lie between the recorded ones and, at either end, beyond them, where the track must
//! go on smoothly. A polynomial of degree 5 through all positions of the stretch, in least squares on orthogonal
//! polynomials (Forsythe's recurrence on evenly spaced places), does both. What it misses counts only as
//! far as it differs between a patch's pixel and its centre; stretches are halved until that is
//! small enough.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;

use crate::SPEED_OF_LIGHT_M_S;
use crate::focus::Task;
use crate::focus::rdbp::patch::Rectangle;
use crate::phase_history::Pulse;

const DEGREE: usize = 5;
/// Stretches this short are not halved: they are not decimated either.
const SHORTEST: usize = 16;
/// Pulses at which the fit is measured.
const PROBE_PULSES: usize = 64;

/// Pulses and their fitted antennas.
pub(super) struct Track {
    pulses: Range<usize>,
    transmitter: Polynomial,
    receiver: Polynomial,
    error: f64,
}

impl Track {
    fn new(track: &[Pulse], pulses: Range<usize>) -> Self {
        Self {
            transmitter: Polynomial::new(track, |p| p.transmitter_m),
            receiver: Polynomial::new(track, |p| p.receiver_m),
            pulses,
            error: 0.0,
        }
    }

    /// Pulse indices.
    pub(super) fn pulses(&self) -> Range<usize> {
        self.pulses.clone()
    }

    /// Relative RMS error that the fit is measured to cost.
    pub(super) fn error(&self) -> f64 {
        self.error
    }

    /// Transmitter and receiver `u` pulses from the first.
    pub(super) fn at(&self, u: f64) -> [DVec3; 2] {
        [self.transmitter.at(u), self.receiver.at(u)]
    }

    /// RMS phase, radians, by which paths from the fitted antennas miss those from the true ones, relative to
    /// each patch's centre.
    fn measure(&self, task: &Task, patches: &[Rectangle]) -> f64 {
        let collection = task.history.collection();
        let track = &collection.pulses[self.pulses.clone()];
        let step = track.len().div_ceil(PROBE_PULSES);
        let mut worst = 0.0f64;
        for patch in patches {
            let centre = patch.centre_m(task.grid);
            for (row, column) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
                let point = patch.point_m(task.grid, row, column);
                let (mut sum, mut count) = (0.0, 0.0);
                for (i, pulse) in track.iter().enumerate().step_by(step) {
                    let [transmitter, receiver] = self.at(i as f64);
                    let path = |p: DVec3| p.distance(transmitter) + p.distance(receiver);
                    let error_m =
                        pulse.path_m(point) - pulse.path_m(centre) - path(point) + path(centre);
                    let frequency_hz = pulse.frequency_hz(collection.num_samples / 2);
                    sum += (TAU * frequency_hz * error_m / SPEED_OF_LIGHT_M_S).powi(2);
                    count += 1.0;
                }
                worst = worst.max(sum / count);
            }
        }
        worst.sqrt()
    }
}

/// Fits `pulses`, halved until each part's error on `patches` is at most `share`.
pub(super) fn fit_all(
    task: &Task,
    pulses: Range<usize>,
    patches: &[Rectangle],
    share: f64,
    tracks: &mut Vec<Track>,
) {
    let recorded = &task.history.collection().pulses[pulses.clone()];
    let mut track = Track::new(recorded, pulses.clone());
    if pulses.len() > SHORTEST {
        track.error = track.measure(task, patches);
        if track.error > share {
            let middle = pulses.start + pulses.len() / 2;
            fit_all(task, pulses.start..middle, patches, share, tracks);
            fit_all(task, middle..pulses.end, patches, share, tracks);
            return;
        }
    }
    tracks.push(track);
}

/// Least-squares polynomial through positions at `u = 0, 1, ..`, in the orthogonal polynomials
/// `p_(j+1) = s p_j - b_j p_(j-1)` of `s = (2 u - M + 1) / M`.
struct Polynomial {
    origin: DVec3,
    count: f64,
    recurrence: [f64; DEGREE + 1],
    coefficients: [DVec3; DEGREE + 1],
}

impl Polynomial {
    fn new(track: &[Pulse], position: impl Fn(&Pulse) -> DVec3) -> Self {
        let mut fit = Self {
            // Relative to one position, so that sums keep their digits far from the scene's origin.
            origin: position(&track[0]),
            count: track.len() as f64,
            recurrence: [0.0; DEGREE + 1],
            coefficients: [DVec3::ZERO; DEGREE + 1],
        };
        let mut norm_before = 0.0;
        for degree in 0..=DEGREE.min(track.len() - 1) {
            let (mut norm, mut sum) = (0.0, DVec3::ZERO);
            for (u, pulse) in track.iter().enumerate() {
                let value = fit.basis(u as f64)[degree];
                norm += value * value;
                sum += (position(pulse) - fit.origin) * value;
            }
            fit.coefficients[degree] = sum / norm;
            if degree > 0 {
                fit.recurrence[degree] = norm / norm_before;
            }
            norm_before = norm;
        }
        fit
    }

    /// All polynomials at `u`, as far as the recurrence is known: `p_(j+1)` needs `b_j`.
    fn basis(&self, u: f64) -> [f64; DEGREE + 1] {
        let s = (2.0 * u - self.count + 1.0) / self.count;
        let mut basis = [1.0; DEGREE + 1];
        basis[1] = s;
        for j in 1..DEGREE {
            basis[j + 1] = s * basis[j] - self.recurrence[j] * basis[j - 1];
        }
        basis
    }

    fn at(&self, u: f64) -> DVec3 {
        let terms = self.basis(u).into_iter().zip(self.coefficients);
        self.origin + terms.map(|(value, c)| c * value).sum::<DVec3>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phase_history::Sweep;

    #[test]
    fn a_quintic_is_fitted_and_continued() {
        let curve = |u: f64| {
            let s = u / 100.0 - 0.7;
            DVec3::new(1e4 + s.powi(5), 3.0 * s * s, -s.powi(3) + s)
        };
        let pulse = |n: usize| Pulse {
            time_s: 0.0,
            transmitter_m: curve(n as f64),
            receiver_m: curve(n as f64),
            reference_m: DVec3::ZERO,
            reference_path_m: 0.0,
            start_hz: 1e9,
            step_hz: 1e6,
            sweep: Sweep::AT_ONCE,
        };
        let pulses: Vec<Pulse> = (0..150).map(pulse).collect();
        let fit = Polynomial::new(&pulses, |p| p.transmitter_m);
        for u in [-40.0, 0.0, 33.3, 149.0, 190.0] {
            assert!(fit.at(u).distance(curve(u)) < 1e-8, "{u}");
        }
        // Few pulses: through all of them.
        let few = Polynomial::new(&pulses[..3], |p| p.transmitter_m);
        assert!(few.at(2.0).distance(curve(2.0)) < 1e-8);
    }
}
