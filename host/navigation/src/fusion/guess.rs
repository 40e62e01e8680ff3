//! Initial estimate of the least squares.
//!
//! Headings are those of the inertial solution where it is near in time, and continue by the radar's turns elsewhere. Without any, the radar's own track is rotated to fit the positions. Positions and velocities are interpolated
//! linearly: given the headings, the sum of squares is quadratic, and one step solves it.

use glam::{DMat3, DVec3};

use super::Inputs;
use super::bundle::Bundle;
use super::terms::{OWN, P, PSI, V, wrapped};
use super::timeline::Timeline;

/// Largest time to an inertial heading, seconds.
const NEAR_S: f64 = 0.2;

/// Positions at each state, interpolated linearly between measurements and constant beyond.
fn places(times_s: &[f64], known: &[(f64, DVec3)]) -> Vec<DVec3> {
    let at = |&time_s: &f64| {
        let after = known.partition_point(|one| one.0 <= time_s);
        match (after.checked_sub(1).map(|n| known[n]), known.get(after)) {
            (Some(a), Some(b)) => a.1.lerp(b.1, (time_s - a.0) / (b.0 - a.0)),
            (Some(a), None) => a.1,
            (None, Some(b)) => b.1,
            (None, None) => DVec3::ZERO,
        }
    };
    times_s.iter().map(at).collect()
}

/// Initial estimate of each state.
pub(super) fn guess(
    inputs: &Inputs<'_>,
    timeline: &Timeline,
    bundles: &[Option<Bundle>],
    [receiver_s, inertial_s]: [f64; 2],
    squint_rad: f64,
) -> Vec<[f64; OWN]> {
    let times_s = &timeline.times_s;
    let of_receiver = inputs
        .positions
        .iter()
        .map(|one| (one.time_s - receiver_s, one.position_m));
    let of_inertial = inputs
        .inertial
        .iter()
        .filter_map(|one| Some((one.time_s - inertial_s, one.position_m?[0])));
    let known: Vec<(f64, DVec3)> = match inputs.positions.is_empty() {
        true => of_inertial.collect(),
        false => of_receiver.collect(),
    };
    let places = places(times_s, &known);
    let headings = headings(inputs, timeline, bundles, &places, squint_rad);
    let velocity = |i: usize| {
        // Over about a second.
        let (from, to) = (times_s[i] - 0.5, times_s[i] + 0.5);
        let a = times_s.partition_point(|&t| t < from).min(i);
        let b = times_s
            .partition_point(|&t| t <= to)
            .clamp(i + 1, times_s.len())
            - 1;
        let seconds = times_s[b] - times_s[a];
        match seconds > 0.0 {
            true => (places[b] - places[a]) / seconds,
            false => DVec3::ZERO,
        }
    };
    let state = |i: usize| {
        let mut x = [0.0; OWN];
        x[P..P + 3].copy_from_slice(&places[i].to_array());
        x[V..V + 3].copy_from_slice(&velocity(i).to_array());
        x[PSI] = headings[i];
        x
    };
    (0..times_s.len()).map(state).collect()
}

fn headings(
    inputs: &Inputs<'_>,
    timeline: &Timeline,
    bundles: &[Option<Bundle>],
    places: &[DVec3],
    squint_rad: f64,
) -> Vec<f64> {
    let count = timeline.times_s.len();
    let mut stated = vec![None; count];
    for (one, &(i, _)) in inputs.inertial.iter().zip(&timeline.inertial) {
        stated[i] = one
            .heading_rad
            .map(|[heading, _]| heading + squint_rad)
            .or(stated[i]);
    }
    let turned = |i: usize| bundles[i].as_ref().map_or(0.0, |bundle| bundle.moved[2]);
    let Some(first) = stated.iter().position(Option::is_some) else {
        return by_fit(bundles, places);
    };
    let mut headings = vec![0.0; count];
    headings[first] = stated[first].unwrap_or_default();
    for i in (0..first).rev() {
        headings[i] = headings[i + 1] - turned(i);
    }
    let mut last = first;
    for i in first + 1..count {
        headings[i] = headings[i - 1] + turned(i - 1);
        if let Some(stated) = stated[i] {
            let away = wrapped(stated - headings[i]);
            let near = timeline.times_s[i] - timeline.times_s[last] < NEAR_S;
            // After a gap the radar's turns were the best estimate; their error is distributed evenly.
            if !near {
                let seconds = timeline.times_s[i] - timeline.times_s[last];
                let from_s = timeline.times_s[last];
                let between = timeline.times_s[last + 1..i].iter();
                for (heading, time_s) in headings[last + 1..i].iter_mut().zip(between) {
                    *heading += away * (time_s - from_s) / seconds;
                }
            }
            headings[i] += away;
            last = i;
        }
    }
    headings
}

/// Rotation of the radar's own track to the positions: the least-squares rotation between two point sets.
fn by_fit(bundles: &[Option<Bundle>], places: &[DVec3]) -> Vec<f64> {
    let mut at = DVec3::ZERO;
    let mut heading: f64 = 0.0;
    let mut track = vec![(at, heading)];
    for (bundle, pair) in bundles.iter().zip(places.windows(2)) {
        match bundle {
            Some(bundle) => {
                let turn = DMat3::from_rotation_z(heading);
                at += turn * DVec3::new(bundle.moved[0], bundle.moved[1], 0.0);
                heading += bundle.moved[2];
            }
            None => at += pair[1] - pair[0],
        }
        track.push((at, heading));
    }
    let mean = |points: &mut dyn Iterator<Item = DVec3>| points.sum::<DVec3>() / track.len() as f64;
    let middle = mean(&mut track.iter().map(|one| one.0));
    let centre = mean(&mut places.iter().copied());
    let (mut along, mut across) = (0.0, 0.0);
    for (one, place) in track.iter().zip(places) {
        let (a, b) = (one.0 - middle, *place - centre);
        along += a.x * b.x + a.y * b.y;
        across += a.x * b.y - a.y * b.x;
    }
    let turn = libm::atan2(across, along);
    track.iter().map(|one| one.1 + turn).collect()
}
