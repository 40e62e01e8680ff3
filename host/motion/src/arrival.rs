//! Direction of arrival and position of a target from one pulse (C 7.3.4).
//!
//! The two nearest receivers give an unambiguous angle. Channels farther apart refine it as soon as their whole turns follow from it: they are added one by one, the most certain phase first. These are the target
//! regions of C 7.3.4, whose corrections (7.11) are whole turns, `2 pi`, not `pi`.
//!
//! Path lengths are exact and need no correction for near targets. In the far field, receivers `B` apart differ in phase by `2 pi B sin(theta) / wavelength`; (7.3) has twice that.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use crate::model::{Array, Pose, Sighting};

/// Standard deviations that must fit into half a turn to unwrap a channel.
const UNWRAP_SIGMAS: f64 = 3.0;

/// Position of a target from one pulse.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// Position in the array's frame, metres: x along the array, y along boresight.
    pub at_m: DVec2,
    /// Standard deviation of the direction as seen from [`Array::centre_m`], radians.
    pub bearing_sigma_rad: f64,
    /// Phase of each channel, radians, unwrapped between channels.
    pub phases_rad: Vec<f64>,
    /// Number of channels with ambiguous whole turns: they do not contribute to the angle.
    pub doubtful: usize,
}

/// Sums of a linear fit of a bearing to channel phases: `phase = offset + value + lever (bearing - about)`.
struct Bearing {
    sum: f64,
    levers: f64,
    squares: f64,
    values: f64,
    products: f64,
}

impl Bearing {
    /// Sums over the unwrapped channels of their phase errors against the model and their levers.
    fn new(channels: impl Iterator<Item = (f64, f64)>) -> Self {
        let zero = Self {
            sum: 0.0,
            levers: 0.0,
            squares: 0.0,
            values: 0.0,
            products: 0.0,
        };
        channels.fold(zero, |sums, (error, lever)| Self {
            sum: sums.sum + 1.0,
            levers: sums.levers + lever,
            squares: sums.squares + lever * lever,
            values: sums.values + error,
            products: sums.products + error * lever,
        })
    }

    /// Sum of squared levers about their mean.
    fn spread(&self) -> f64 {
        self.squares - self.levers * self.levers / self.sum
    }

    /// Correction of the bearing.
    fn step(&self) -> f64 {
        (self.products - self.values * self.levers / self.sum) / self.spread()
    }

    /// Offset common to all phases after this correction of the bearing.
    fn offset(&self, step: f64) -> f64 {
        (self.values - self.levers * step) / self.sum
    }
}

/// Position of a target from one sighting.
pub(crate) fn look(array: &Array, sighting: &Sighting) -> Arrival {
    let ([first, second], baseline) = array.shortest_baseline().expect("there are two receivers");
    let centre_m = array.centre_m();
    let turns = (sighting.phases_rad[second] - sighting.phases_rad[first]) / TAU;
    // The phase is larger at the receiver nearer to the target, where the path is shorter.
    let along = (turns - turns.round()) * array.wavelength_m / baseline.length();
    // Endfire has no sensitivity to the angle: noise beyond it is clamped.
    let along = along.clamp(-0.999, 0.999);
    let direction = baseline.normalize();
    let ahead = match direction.perp() {
        perp if perp.y < 0.0 => -perp,
        perp => perp,
    };
    let from = direction * along + ahead * libm::sqrt(1.0 - along * along);
    let mut phases_rad = sighting.phases_rad.clone();
    let turns = (phases_rad[second] - phases_rad[first]) / TAU;
    phases_rad[second] -= TAU * turns.round();
    let mut unwrapped = vec![false; phases_rad.len()];
    (unwrapped[first], unwrapped[second]) = (true, true);
    let mut bearing_rad = libm::atan2(from.y, from.x);
    let k = array.rad_m();
    loop {
        let mut fit = None;
        // The error left by the curvature is negligible after the second step.
        for _ in 0..3 {
            let (sin, cos) = libm::sincos(bearing_rad);
            let u = DVec2::new(cos, sin);
            let across = u.perp() * sighting.range_m;
            let paths = array.paths(&Pose::default(), centre_m + u * sighting.range_m);
            let errors: Vec<(f64, f64)> = paths
                .iter()
                .zip(&phases_rad)
                .map(|(path, phase)| (phase + k * path.length_m, -k * path.slope.dot(across)))
                .collect();
            let used = errors.iter().zip(&unwrapped).filter(|(_, used)| **used);
            let bearing = Bearing::new(used.map(|(error, _)| *error));
            // At most about a beam width: levers are short near endfire.
            let step = bearing.step().clamp(-0.3, 0.3);
            bearing_rad += step;
            fit = Some((errors, bearing, step));
        }
        let (errors, bearing, step) = fit.expect("there were steps");
        let sigma = sighting.phase_sigma_rad;
        let bearing_sigma_rad = sigma / libm::sqrt(bearing.spread());
        let mean = bearing.levers / bearing.sum;
        let doubt = |lever: f64| {
            let by_angle = (lever - mean) * bearing_sigma_rad;
            UNWRAP_SIGMAS
                * libm::sqrt(by_angle * by_angle + sigma * sigma * (1.0 + 1.0 / bearing.sum))
        };
        let next = (0..unwrapped.len())
            .filter(|&c| !unwrapped[c])
            .min_by(|&a, &b| doubt(errors[a].1).total_cmp(&doubt(errors[b].1)));
        let offset = bearing.offset(step);
        let mut unwrap = |c: usize| {
            let (error, lever) = errors[c];
            let turns = (error - lever * step - offset) / TAU;
            phases_rad[c] -= TAU * turns.round();
        };
        match next {
            Some(c) if doubt(errors[c].1) < PI => {
                unwrap(c);
                unwrapped[c] = true;
            }
            _ => {
                let left = (0..unwrapped.len()).filter(|&c| !unwrapped[c]);
                left.for_each(&mut unwrap);
                let (sin, cos) = libm::sincos(bearing_rad);
                return Arrival {
                    at_m: centre_m + DVec2::new(cos, sin) * sighting.range_m,
                    bearing_sigma_rad,
                    phases_rad,
                    doubtful: unwrapped.iter().filter(|used| !**used).count(),
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact paths with wrapped phases; receivers up to eight wavelengths apart.
    #[test]
    fn distant_channels_are_unwrapped_to_exact_position() {
        let wavelength_m = 0.004;
        let receivers = [0.0, 0.5, 1.5, 3.5, 8.0];
        let array = Array {
            transmitters_m: vec![DVec2::new(-0.02, 0.0), DVec2::new(-0.013, 0.001)],
            receivers_m: receivers
                .map(|x| DVec2::new(x * wavelength_m, 0.0))
                .to_vec(),
            wavelength_m,
        };
        for place in [[-1.5, 2.0], [0.1, 3.0], [2.0, 1.2], [0.0, 0.5]] {
            let at_m = DVec2::from_array(place);
            let mut sum_m = 0.0;
            let mut phases_rad = Vec::new();
            for t in &array.transmitters_m {
                for r in &array.receivers_m {
                    let path_m = at_m.distance(*t) + at_m.distance(*r);
                    sum_m += path_m;
                    let phase = 1.0 - TAU * path_m / wavelength_m;
                    phases_rad.push(phase - TAU * (phase / TAU).round());
                }
            }
            let sighting = Sighting {
                target: 0,
                range_m: 0.5 * sum_m / 10.0,
                range_sigma_m: 0.01,
                phases_rad,
                phase_sigma_rad: 0.02,
            };
            let arrival = look(&array, &sighting);
            assert_eq!(arrival.doubtful, 0);
            // Half the mean path exceeds the range from the phase centre by (antenna spacing)^2 / (2 range): 0.3 mm at 0.5 m.
            let allowed = 2e-4 / place[1];
            assert!(
                arrival.at_m.distance(at_m) < allowed,
                "{:?} {at_m}",
                arrival.at_m
            );
            for (c, channel) in array.channels().enumerate() {
                let path_m = channel.map(|a| at_m.distance(a)).iter().sum::<f64>();
                let common = arrival.phases_rad[0] - arrival.phases_rad[c];
                let first = array.channels().next().unwrap().map(|a| at_m.distance(a));
                let paths = TAU * (path_m - first.iter().sum::<f64>()) / wavelength_m;
                assert!((common - paths).abs() < 1e-9, "{c}: {common} {paths}");
            }
        }
    }

    #[test]
    fn channel_with_ambiguous_turns_is_counted() {
        let wavelength_m = 0.004;
        let array = Array {
            transmitters_m: vec![DVec2::ZERO],
            receivers_m: [0.0, 0.5, 40.0]
                .map(|x| DVec2::new(x * wavelength_m, 0.0))
                .to_vec(),
            wavelength_m,
        };
        let sighting = Sighting {
            target: 0,
            range_m: 3.0,
            range_sigma_m: 0.01,
            phases_rad: vec![0.0, 0.3, 1.0],
            phase_sigma_rad: 0.1,
        };
        // The angle of a half-wavelength baseline is good to 0.14 rad of phase, 80 times that at 40 wavelengths.
        assert_eq!(look(&array, &sighting).doubtful, 1);
    }
}
