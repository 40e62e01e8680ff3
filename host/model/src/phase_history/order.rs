//! Order of pulses without times, by the angle of the antennas about the scene.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Pulse;

/// Minimum area swept by the arms, relative to the sum of their squares; less is rounding.
const MIN_SWEPT: f64 = 1e-12;

/// Vector from the reference point of a pulse to the middle of its antennas.
fn arm(pulse: &Pulse) -> DVec3 {
    pulse.phase_centre_m() - pulse.reference_m
}

/// Normal of the plane in which the antennas of `runs` move around their reference points, oriented so that most of
/// the motion is counterclockwise.
fn axis(runs: &[&[Pulse]]) -> Option<DVec3> {
    let mut areas = Vec::with_capacity(runs.len());
    let mut square = 0.0;
    for run in runs {
        let mut area = DVec3::ZERO;
        for pair in run.windows(2) {
            area += arm(&pair[0]).cross(arm(&pair[1]));
            square += arm(&pair[0]).length_squared();
        }
        areas.push(area);
    }
    let largest = |a: &DVec3, b: &DVec3| if b.length() > a.length() { *b } else { *a };
    let side = areas.iter().copied().reduce(|a, b| largest(&a, &b))?;
    // Opposite passes share a plane, but their areas would cancel.
    let aligned = |area: &DVec3| if area.dot(side) < 0.0 { -*area } else { *area };
    let sum: DVec3 = areas.iter().map(aligned).sum();
    if sum.length().is_nan() || sum.length() <= MIN_SWEPT * square {
        return None;
    }
    let normal = sum.normalize();
    let way: f64 = areas.iter().map(|area| area.dot(normal)).sum();
    Some(if way < 0.0 { -normal } else { normal })
}

/// Angles of all pulses of `runs`, one run after another, in the plane in which the antennas move around their
/// reference points and in the direction of most of the motion, radians from the middle of the widest gap.
///
/// `None` if there is no such plane: antennas at rest, or moving straight towards or away from the point.
pub(super) fn travelled_angles(runs: &[&[Pulse]]) -> Option<Vec<f64>> {
    let normal = axis(runs)?;
    let across = normal.any_orthonormal_vector();
    let up = normal.cross(across);
    let pulses = runs.iter().flat_map(|run| run.iter());
    let mut angles: Vec<f64> = pulses
        .map(|p| libm::atan2(arm(p).dot(up), arm(p).dot(across)))
        .collect();
    let mut sorted = angles.clone();
    sorted.sort_by(f64::total_cmp);
    let (first, last) = (*sorted.first()?, *sorted.last()?);
    let mut widest_rad = first + TAU - last;
    let mut start_rad = last + widest_rad / 2.0;
    for pair in sorted.windows(2) {
        if pair[1] - pair[0] > widest_rad {
            widest_rad = pair[1] - pair[0];
            start_rad = pair[0] + widest_rad / 2.0;
        }
    }
    for angle in &mut angles {
        *angle = (*angle - start_rad).rem_euclid(TAU);
    }
    Some(angles)
}

/// Minimum length of a jump in units of the usual step from pulse to pulse.
const JUMP_STEPS: f64 = 8.0;
/// Maximum ratio of the mean step in pulse order to that in angular order on a single track. A forth-and-back track
/// has 2.
const MAX_DISORDER: f64 = 4.0;

/// Whether the antennas move along one track in pulse order: no jumps except straight ahead (dropped pulses), and no
/// disorder.
pub(crate) fn is_one_pass(pulses: &[Pulse]) -> bool {
    let centre = |pulse: &Pulse| pulse.phase_centre_m();
    let steps: Vec<DVec3> = (pulses.windows(2))
        .map(|pair| centre(&pair[1]) - centre(&pair[0]))
        .collect();
    let lengths = || steps.iter().map(|step| step.length());
    let mut sorted: Vec<f64> = lengths().filter(|length| *length > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(&usual_m) = sorted.get(sorted.len() / 2) else {
        return true;
    };
    let is_jump = |n: usize| steps[n].length() > JUMP_STEPS * usual_m;
    let is_ahead = |n: usize| {
        let along = |other: Option<&DVec3>| other.is_none_or(|other| other.dot(steps[n]) >= 0.0);
        along(n.checked_sub(1).map(|before| &steps[before])) && along(steps.get(n + 1))
    };
    if (0..steps.len()).any(|n| is_jump(n) && !is_ahead(n)) {
        return false;
    }
    let Some(ranks) = ranks_by_angle(pulses) else {
        return true;
    };
    let mut by_angle = vec![DVec3::ZERO; pulses.len()];
    for (rank, pulse) in ranks.into_iter().zip(pulses) {
        by_angle[rank] = centre(pulse);
    }
    let around_m: f64 = (by_angle.windows(2))
        .map(|pair| pair[0].distance(pair[1]))
        .sum();
    lengths().sum::<f64>() <= MAX_DISORDER * around_m
}

/// Rank of every pulse by its angle; pulses with equal angles keep their order. `None` as for [`travelled_angles`].
pub(crate) fn ranks_by_angle(pulses: &[Pulse]) -> Option<Vec<usize>> {
    let angles = travelled_angles(&[pulses])?;
    let mut order: Vec<usize> = (0..pulses.len()).collect();
    order.sort_by(|&a, &b| angles[a].total_cmp(&angles[b]));
    let mut ranks = vec![0; pulses.len()];
    for (rank, n) in order.into_iter().enumerate() {
        ranks[n] = rank;
    }
    Some(ranks)
}
