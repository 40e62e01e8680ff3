//! Reduction of a failing case, step by step, while it still fails.

use glam::DVec3;
use subaperture::signal::window::Window;

use super::{Antennas, Case, Shape};

/// Maximum number of tried steps.
const TRIES: usize = 300;

/// The smallest case that still `fails`.
pub(crate) fn shrink(case: &Case, mut fails: impl FnMut(&Case) -> bool) -> Case {
    let mut best = case.clone();
    let mut tries = 0;
    'again: loop {
        for smaller in steps(&best) {
            if tries == TRIES {
                return best;
            }
            tries += 1;
            if smaller != best && fails(&smaller) {
                best = smaller;
                continue 'again;
            }
        }
        return best;
    }
}

/// Cases one step simpler, the largest steps first.
fn steps(case: &Case) -> Vec<Case> {
    let mut steps = Vec::new();
    let mut with = |change: &dyn Fn(&mut Case)| {
        let mut smaller = case.clone();
        change(&mut smaller);
        steps.push(smaller);
    };
    let half = |count: usize| count.div_ceil(2);
    with(&|c| c.points.truncate(1));
    with(&|c| c.noise = 0.0);
    with(&|c| c.windows = [Window::None; 2]);
    with(&|c| c.track.antennas = Antennas::Monostatic);
    with(&|c| c.track.shape = Shape::Straight);
    with(&|c| c.track.reference_m = 0.0);
    with(&|c| c.plane.turn_deg = [0.0; 3]);
    with(&|c| c.plane.centre_m = DVec3::ZERO);
    with(&|c| c.plane.polar_from_m = None);
    // Half of the pulses over half of the track, or over all of it.
    with(&|c| {
        c.num_pulses = half(c.num_pulses);
        c.track.length_m /= 2.0;
    });
    with(&|c| c.num_pulses = half(c.num_pulses));
    with(&|c| c.num_samples = half(c.num_samples));
    with(&|c| c.plane.counts[0] = half(c.plane.counts[0]));
    with(&|c| c.plane.counts[1] = half(c.plane.counts[1]));
    with(&|c| {
        c.points.pop();
    });
    with(&|c| c.points = c.points.split_off(1.min(c.points.len())));
    with(&|c| c.num_pulses = c.num_pulses.max(2) - 1);
    with(&|c| c.num_samples = c.num_samples.max(2) - 1);
    steps.retain(|c| !c.points.is_empty());
    steps
}
