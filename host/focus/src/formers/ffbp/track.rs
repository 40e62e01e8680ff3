//! A stretch of pulses and the smooth track through it.
//!
//! Decimated pulses lie between the recorded ones and, at either end, beyond them, where the track must
//! go on smoothly. A polynomial of at most degree 5 through all positions of the stretch, in least squares on orthogonal
//! polynomials (Forsythe's recurrence on evenly spaced places), does both. Of all degrees that fit about as well, the
//! lowest is taken: it goes on the most tamely.
//!
//! What the polynomial misses of the recorded antennas, `m_n` metres, turns a term by at most
//!
//! ```text
//! 2 pi f / c (|m_n(transmitter)| / d + |m_n(receiver)| / d) |p - q|
//! ```
//!
//! for a pixel `p` of a patch about `q`, as far as `d` from the antennas: the angle between the lines of sight to both is
//! at most `|p - q| / d`. Stretches are halved until that is small on the first patches; on each
//! patch it decides whether slow time is decimated at all.

use std::f64::consts::TAU;
use std::ops::Range;

use glam::DVec3;

use subaperture_model::SPEED_OF_LIGHT_M_S;
use subaperture_model::phase_history::Pulse;

const DEGREE: usize = 5;
/// Stretches this short are not halved further: little is won by decimating them.
const SHORTEST: usize = 16;
/// Pulses for each degree of a polynomial, at least: fewer are followed, not averaged.
const PULSES_A_DEGREE: usize = 6;
/// How much worse a polynomial of a lower degree may fit.
const ABOUT_AS_WELL: f64 = 1.3;

/// Pulses and their fitted antennas.
pub(super) struct Track {
    pulses: Range<usize>,
    transmitter: Polynomial,
    receiver: Polynomial,
    /// Root of the mean square of what both miss, metres.
    misfit_m: f64,
}

impl Track {
    /// Fits `pulses` of those recorded.
    pub(super) fn new(recorded: &[Pulse], pulses: Range<usize>) -> Self {
        let track = &recorded[pulses.clone()];
        let most = (track.len() / PULSES_A_DEGREE).clamp(1, DEGREE);
        let fits: Vec<Self> = (0..=most)
            .map(|degree| Self::of_degree(track, pulses.clone(), degree))
            .collect();
        let best_m = fits
            .iter()
            .map(|fit| fit.misfit_m)
            .fold(f64::INFINITY, f64::min);
        // A hundredth of a micrometre is nothing at any frequency.
        let enough_m = best_m * ABOUT_AS_WELL + 1e-8;
        fits.into_iter()
            .find(|fit| fit.misfit_m <= enough_m)
            .unwrap_or_else(|| Self::of_degree(track, pulses, 0))
    }

    fn of_degree(track: &[Pulse], pulses: Range<usize>, degree: usize) -> Self {
        let mut fit = Self {
            transmitter: Polynomial::new(track, degree, |p| p.transmitter_m),
            receiver: Polynomial::new(track, degree, |p| p.receiver_m),
            pulses,
            misfit_m: 0.0,
        };
        let square = |(i, pulse): (usize, &Pulse)| {
            let [transmitter, receiver] = fit.at(i as f64);
            let both_m =
                pulse.transmitter_m.distance(transmitter) + pulse.receiver_m.distance(receiver);
            both_m * both_m
        };
        let squares: f64 = track.iter().enumerate().map(square).sum();
        fit.misfit_m = (squares / track.len() as f64).sqrt();
        fit
    }

    /// Pulse indices.
    pub(super) fn pulses(&self) -> Range<usize> {
        self.pulses.clone()
    }

    /// Transmitter and receiver `u` pulses from the first.
    pub(super) fn at(&self, u: f64) -> [DVec3; 2] {
        [self.transmitter.at(u), self.receiver.at(u)]
    }

    /// RMS phase, radians, by which paths from the fitted antennas miss those from the recorded ones at most, on a
    /// patch that reaches `radius_m` from its centre and lies `distance_m` from the antennas.
    pub(super) fn phase_rad(&self, frequency_hz: f64, radius_m: f64, distance_m: f64) -> f64 {
        let angle = match distance_m > radius_m {
            true => radius_m / distance_m,
            // Any two lines of sight.
            false => 2.0,
        };
        TAU * frequency_hz / SPEED_OF_LIGHT_M_S * self.misfit_m * angle.min(2.0)
    }
}

/// Halves `pulses` until each part's phase on each of some patches, `phase_rad` of a track, is at most `allowed`; adds how many
/// pulses each has.
pub(super) fn halve(
    recorded: &[Pulse],
    pulses: Range<usize>,
    allowed: f64,
    phase_rad: &impl Fn(&Track) -> f64,
    stretches: &mut Vec<usize>,
) {
    let track = Track::new(recorded, pulses.clone());
    if pulses.len() > SHORTEST && phase_rad(&track) > allowed {
        let middle = pulses.start + pulses.len() / 2;
        halve(
            recorded,
            pulses.start..middle,
            allowed,
            phase_rad,
            stretches,
        );
        halve(recorded, middle..pulses.end, allowed, phase_rad, stretches);
        return;
    }
    stretches.push(pulses.len());
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
    fn new(track: &[Pulse], most: usize, position: impl Fn(&Pulse) -> DVec3) -> Self {
        let mut fit = Self {
            // Relative to one position, so that sums keep their digits far from the scene's origin.
            origin: position(&track[0]),
            count: track.len() as f64,
            recurrence: [0.0; DEGREE + 1],
            coefficients: [DVec3::ZERO; DEGREE + 1],
        };
        let mut norm_before = 0.0;
        for degree in 0..=most.min(track.len() - 1) {
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
    use subaperture_model::phase_history::Sweep;

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
        let fit = Polynomial::new(&pulses, DEGREE, |p| p.transmitter_m);
        for u in [-40.0, 0.0, 33.3, 149.0, 190.0] {
            assert!(fit.at(u).distance(curve(u)) < 1e-8, "{u}");
        }
        // Few pulses: through all of them.
        let few = Polynomial::new(&pulses[..3], DEGREE, |p| p.transmitter_m);
        assert!(few.at(2.0).distance(curve(2.0)) < 1e-8);
    }
}
