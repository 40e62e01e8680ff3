//! The direction of a target from the phases of an array's channels: from the shortest baseline, refined by longer ones.
//!
//! Two channels whose antennas are `b` apart in sum (transmitter and receiver) have phases that differ by `2 pi b . u / wavelength`, `u` towards the
//! target: with one transmitter and receivers `B` apart `2 pi B sin(theta) / wavelength`. (C (7.3) has `4 pi`, which counts the way back as well, and
//! C (7.18) `2 pi`.) Whole turns are lost, so that `B` up to half a wavelength tells all angles, and a longer one those of a *target region* alone
//! (C 7.3.4, regions A, B and C). There the thesis looks up the turns of each pair of four antennas in a table by region, of the
//! target and of the motion. Here they are what the direction found so far says, which is the same for any array:
//!
//! ```text
//! turns_c = round((model_c(theta) - measured_c) / 2 pi),      taken if its standard deviation is below a twelfth of a turn
//! ```
//!
//! channel after channel from the shortest baseline outwards; after each the direction is found again by least squares over all taken, with exact
//! paths to a place at the measured range. At three standard deviations a turn is then a quarter off, half of what would be
//! taken for the next. Regions of motion are the same question from pulse to pulse: [`subaperture_motion`] answers it by the predicted pose.

use std::f64::consts::TAU;

use glam::DVec2;
use subaperture_motion::{Array, Pose, Sighting, Target};

/// Standard deviation of a channel's phase as it is expected, in turns, up to which whole turns are told.
const SURE_TURNS: f64 = 1.0 / 12.0;

/// Steps of the least squares: each squares the error.
const STEPS: usize = 6;

/// Where an echo comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Angle from the direction across the array (its y axis), radians, towards its x axis.
    pub angle_rad: f64,
    /// Its standard deviation, radians.
    pub sigma_rad: f64,
    /// Channels that tell it: the others' turns are in doubt.
    pub channels: usize,
}

/// The direction of a sighting's target, before the array; none if no two channels are half a wavelength or less apart.
pub fn arrival(array: &Array, sighting: &Sighting) -> Option<Arrival> {
    let centres: Vec<DVec2> = array.channels().map(|[t, r]| t + r).collect();
    if sighting.phases_rad.len() != centres.len() {
        return None;
    }
    let (first, second) = shortest(array, &centres)?;
    let mut fit = Fit::start(array, sighting, [first, second], &centres);
    let mut others: Vec<usize> = (0..centres.len())
        .filter(|c| ![first, second].contains(c))
        .collect();
    let away = |c: &usize| centres[*c].distance(centres[first]);
    others.sort_by(|a, b| away(a).total_cmp(&away(b)));
    for channel in others {
        let (expected_rad, sigma_rad) = fit.expected(channel);
        if sigma_rad > SURE_TURNS * TAU {
            break;
        }
        let turns = (expected_rad - sighting.phases_rad[channel]) / TAU;
        let whole_rad = sighting.phases_rad[channel] + TAU * turns.round();
        fit.taken.push((channel, whole_rad));
        fit.settle();
    }
    Some(Arrival {
        angle_rad: fit.angle_rad,
        sigma_rad: fit.variance[1].sqrt(),
        channels: fit.taken.len(),
    })
}

/// The two channels nearest to each other, of half a wavelength at the most.
fn shortest(array: &Array, centres: &[DVec2]) -> Option<(usize, usize)> {
    let pairs = (0..centres.len()).flat_map(|i| (i + 1..centres.len()).map(move |j| (i, j)));
    let apart = |&(i, j): &(usize, usize)| centres[i].distance(centres[j]);
    // To a ten-thousandth: half a wavelength is often what is meant.
    let most_m = 0.50005 * array.wavelength_m;
    pairs
        .filter(|pair| (f64::MIN_POSITIVE..=most_m).contains(&apart(pair)))
        .min_by(|a, b| apart(a).total_cmp(&apart(b)))
}

/// A direction and a phase, and the channels that tell them.
struct Fit<'a> {
    array: &'a Array,
    sighting: &'a Sighting,
    angle_rad: f64,
    phase_rad: f64,
    /// Of phase, and of angle; and between.
    variance: [f64; 3],
    /// Channels with their phases, without wraps.
    taken: Vec<(usize, f64)>,
}

impl<'a> Fit<'a> {
    fn start(
        array: &'a Array,
        sighting: &'a Sighting,
        [i, j]: [usize; 2],
        centres: &[DVec2],
    ) -> Self {
        let phases = &sighting.phases_rad;
        let turns = (phases[j] - phases[i]) / TAU;
        let turns = turns - turns.round();
        let baseline = centres[j] - centres[i];
        // Nearer to the target the phase is larger, for the path is shorter.
        let along = (turns * array.wavelength_m / baseline.length()).clamp(-1.0, 1.0);
        let direction = baseline.normalize();
        let ahead = match direction.perp() {
            perp if perp.y < 0.0 => -perp,
            perp => perp,
        };
        let towards = direction * along + ahead * (1.0 - along * along).sqrt();
        let mut fit = Self {
            array,
            sighting,
            angle_rad: libm::atan2(towards.x, towards.y),
            phase_rad: phases[i],
            variance: [f64::INFINITY; 3],
            taken: vec![(i, phases[i]), (j, phases[i] + TAU * turns)],
        };
        fit.settle();
        fit
    }

    /// Phases of all channels relative to their mean path's, and how they change with the angle.
    fn lines(&self) -> Vec<[f64; 2]> {
        let (sin, cos) = libm::sincos(self.angle_rad);
        let range_m = self.sighting.range_m;
        let target = Target {
            at_m: range_m * DVec2::new(sin, cos),
            phase_rad: 0.0,
            from: Pose::default(),
        };
        let across = range_m * DVec2::new(cos, -sin);
        let lines = self.array.lines(&Pose::default(), &target);
        let phases = &lines[..lines.len() - 1];
        phases
            .iter()
            .map(|line| [line.value, line.target.truncate().dot(across)])
            .collect()
    }

    /// The normal equations of phase and angle: matrix (11, 22, 12) and right side.
    fn normal(&self) -> ([f64; 3], [f64; 2]) {
        let lines = self.lines();
        let weight = self.sighting.phase_sigma_rad.powi(-2);
        let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
        for &(c, measured_rad) in &self.taken {
            let [value, slope] = lines[c];
            let off = measured_rad - self.phase_rad - value;
            matrix[0] += weight;
            matrix[1] += weight * slope * slope;
            matrix[2] += weight * slope;
            right[0] += weight * off;
            right[1] += weight * slope * off;
        }
        (matrix, right)
    }

    fn settle(&mut self) {
        for _ in 0..STEPS {
            let ([a, b, both], [x, y]) = self.normal();
            let determinant = a * b - both * both;
            // Along the array the slope is 0, and nothing tells the angle.
            if determinant <= 1e-12 * a * b || !determinant.is_finite() {
                return;
            }
            self.variance = [b / determinant, a / determinant, -both / determinant];
            self.phase_rad += (b * x - both * y) / determinant;
            let step = (a * y - both * x) / determinant;
            let most = std::f64::consts::FRAC_PI_2;
            self.angle_rad = (self.angle_rad + step.clamp(-0.3, 0.3)).clamp(-most, most);
        }
    }

    /// The phase that a channel should have, and its standard deviation: the expectation's and the channel's own.
    fn expected(&self, channel: usize) -> (f64, f64) {
        let [value, slope] = self.lines()[channel];
        let [phase, angle, both] = self.variance;
        let variance = phase + 2.0 * slope * both + slope * slope * angle;
        let own = self.sighting.phase_sigma_rad.powi(2);
        (self.phase_rad + value, (variance + own).sqrt())
    }
}
