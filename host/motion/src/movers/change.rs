//! Change of each target over a segment of pulses, and the group that agrees with one motion of the radar.

use std::collections::BTreeSet;

use glam::{DMat3, DVec2, DVec3};
use subaperture_signal::dense::Factor;

use crate::MIN_PIVOT;
use crate::model::Array;
use crate::series::{Series, line, unit};

/// Quantile 0.9999 of the squared residual of a standing target, two degrees of freedom.
pub(super) const STANDING_LIMIT: f64 = 18.4;
/// The same for motions that follow from a pair alone, which are uncertain.
const PAIR_LIMIT: f64 = 5.0 * STANDING_LIMIT;

/// Change of a target over a segment.
pub(crate) struct Change {
    pub(crate) name: usize,
    u: DVec2,
    range_m: f64,
    /// Changes of range (metres) and of direction (radians).
    by: [f64; 2],
    /// Standard deviations of both, and of the mean direction.
    sigma: [f64; 3],
}

impl Change {
    pub(super) fn new(array: &Array, series: &Series) -> Self {
        let looks = &series.looks;
        let (first, last) = (&looks[0], &looks[looks.len() - 1]);
        let k = array.rad_m();
        let channels = array.num_channels() as f64;
        let count = looks.len() as f64;
        let bearings = series.bearings_rad(array);
        let pulses = looks.iter().map(|look| look.pulse as f64);
        let [slope, slope_sigma, mean] = line(pulses.zip(bearings));
        let length = (last.pulse - first.pulse) as f64;
        let bearing_sigma = looks
            .iter()
            .map(|look| look.arrival.bearing_sigma_rad)
            .sum::<f64>()
            / count;
        let [a, b] = [first, last].map(|look| look.sighting.phase_sigma_rad);
        let phase_sigma = libm::hypot(a, b);
        Self {
            name: series.name,
            u: unit(mean),
            range_m: looks.iter().map(|look| look.sighting.range_m).sum::<f64>() / count,
            by: [
                -(last.common_rad - first.common_rad) / (2.0 * k),
                slope * length,
            ],
            sigma: [
                phase_sigma / (2.0 * k * libm::sqrt(channels)),
                slope_sigma * length * bearing_sigma,
                bearing_sigma / libm::sqrt(count),
            ],
        }
    }

    /// Derivatives of both changes by motion and turn.
    fn lines(&self) -> [DVec3; 2] {
        let across = self.u.perp() / -self.range_m;
        [(-self.u).extend(0.0), across.extend(-1.0)]
    }

    /// Residuals in standard deviations, for a standing target.
    pub(super) fn errors(&self, motion: DVec3) -> [f64; 2] {
        let sigma = self.sigmas(motion);
        let lines = self.lines();
        [0, 1].map(|i| (self.by[i] - lines[i].dot(motion)) / sigma[i])
    }

    fn sigmas(&self, motion: DVec3) -> [f64; 2] {
        let by_direction = self.u.perp().dot(motion.truncate()) * self.sigma[2];
        [libm::hypot(self.sigma[0], by_direction), self.sigma[1]]
    }

    pub(super) fn square(&self, motion: DVec3) -> f64 {
        self.errors(motion).iter().map(|error| error * error).sum()
    }
}

/// Motion by least squares over some targets; `None` if they do not determine it.
pub(super) fn motion<'a>(some: impl Iterator<Item = &'a Change> + Clone) -> Option<DVec3> {
    let mut motion = DVec3::ZERO;
    // Errors of directions make the weights depend on the motion.
    for _ in 0..3 {
        let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for change in some.clone() {
            let both = change.lines().into_iter().zip(change.by);
            for ((line, by), sigma) in both.zip(change.sigmas(motion)) {
                let weighed = line / (sigma * sigma);
                matrix += DMat3::from_cols(line * weighed.x, line * weighed.y, line * weighed.z);
                right += weighed * by;
            }
        }
        let factor = Factor::new(3, &matrix.to_cols_array(), MIN_PIVOT)?;
        let mut solved = right.to_array();
        factor.solve(&mut solved);
        motion = DVec3::from_array(solved);
    }
    motion.is_finite().then_some(motion)
}

/// Largest group that agrees with one motion, and that motion.
pub(super) fn group(changes: &[&Change]) -> Option<(BTreeSet<usize>, DVec3)> {
    let mut best: Option<(BTreeSet<usize>, DVec3, f64)> = None;
    for i in 0..changes.len() {
        for j in i + 1..changes.len() {
            let Some(start) = motion([changes[i], changes[j]].into_iter()) else {
                continue;
            };
            let near = |limit: f64, motion: DVec3| {
                let agree = move |c: &usize| changes[*c].square(motion) < limit;
                (0..changes.len()).filter(agree).collect::<Vec<usize>>()
            };
            let mut found = near(PAIR_LIMIT, start);
            let mut by = start;
            // Remove outliers, the worst first.
            while found.len() >= 3 {
                let some = found.iter().map(|&c| changes[c]);
                let Some(refined) = motion(some) else { break };
                by = refined;
                let worst = found
                    .iter()
                    .copied()
                    .max_by(|&a, &b| changes[a].square(by).total_cmp(&changes[b].square(by)))
                    .expect("there are three");
                if changes[worst].square(by) < STANDING_LIMIT {
                    break;
                }
                found.retain(|&c| c != worst);
            }
            let agree = near(STANDING_LIMIT, by);
            if found.len() < 3 || agree.len() < 3 {
                continue;
            }
            let sum = agree.iter().map(|&c| changes[c].square(by)).sum::<f64>();
            let better = best.as_ref().is_none_or(|(group, _, least)| {
                agree.len() > group.len() || agree.len() == group.len() && sum < *least
            });
            if better {
                best = Some((agree.into_iter().collect(), by, sum));
            }
        }
    }
    best.map(|(group, by, _)| (group, by))
}
