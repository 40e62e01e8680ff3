//! Phase unwrapping in space over the edges of a graph.

use std::f64::consts::PI;

use super::graph::{Graph, Sets};
use super::screen::wrapped;

/// Largest difference along a sound edge: a quarter of a turn, an eighth of a wavelength of displacement.
const SOUND: f64 = PI / 2.0;

/// Unwrapped phases of one pair of passes.
pub(super) struct Unwrapped {
    /// Phases, radians. The median of the anchors is within half a turn of zero.
    pub(super) phases: Vec<f64>,
    /// Points that no chain of sound edges joins to the anchors, or at an edge that contradicts the result.
    pub(super) doubtful: Vec<bool>,
}

/// Unwrap phases along the edges of a graph, those with the smallest differences first. `anchors` are the points whose phases are near zero.
pub(super) fn unwrap(graph: &Graph, phases: &[f64], anchors: &[bool]) -> Unwrapped {
    let differences: Vec<f64> = graph
        .edges
        .iter()
        .map(|&[p, q]| wrapped(phases[q] - phases[p]))
        .collect();
    let mut rough = vec![false; phases.len()];
    for &[pq, qr, pr] in &graph.triangles {
        let around = differences[pq] + differences[qr] - differences[pr];
        if around.abs() > PI {
            for point in [pq, qr, pr].into_iter().flat_map(|edge| graph.edges[edge]) {
                rough[point] = true;
            }
        }
    }
    let sound = |edge: usize| {
        let most = match edge < graph.noisy_from {
            true => SOUND,
            // Random phases must not pass as sound.
            false => SOUND / 2.0,
        };
        let [p, q] = graph.edges[edge];
        graph.short[edge] && differences[edge].abs() < most && !rough[p] && !rough[q]
    };
    let sound: Vec<bool> = (0..differences.len()).map(sound).collect();
    let mut order: Vec<usize> = (0..differences.len()).collect();
    order.sort_unstable_by(|&a, &b| {
        let size = |e: usize| differences[e].abs();
        (sound[b].cmp(&sound[a]))
            .then(size(a).total_cmp(&size(b)))
            .then(a.cmp(&b))
    });
    let mut sets = Sets::new(phases.len());
    let first = order.partition_point(|&edge| sound[edge]);
    let join = |sets: &mut Sets, edges: &[usize]| {
        for &edge in edges {
            let [p, q] = graph.edges[edge];
            sets.join_at(p, q, differences[edge]);
        }
    };
    join(&mut sets, &order[..first]);
    let mut doubtful = outside_of_largest(&mut sets, anchors);
    join(&mut sets, &order[first..]);
    let mut phases: Vec<f64> = (0..phases.len())
        .map(|p| {
            let root = sets.root(p);
            phases[root] + sets.phase(p)
        })
        .collect();
    for (edge, &[p, q]) in graph
        .edges
        .iter()
        .enumerate()
        .filter(|&(edge, _)| sound[edge])
    {
        if (phases[q] - phases[p] - differences[edge]).abs() > PI {
            doubtful[p] = true;
            doubtful[q] = true;
        }
    }
    let mut near: Vec<f64> = (phases.iter().zip(anchors))
        .filter(|&(_, &anchor)| anchor)
        .map(|(&phase, _)| phase)
        .collect();
    let middle = near.len() / 2;
    if !near.is_empty() {
        let median = *near.select_nth_unstable_by(middle, f64::total_cmp).1;
        let turns = 2.0 * PI * (median / (2.0 * PI)).round();
        phases.iter_mut().for_each(|phase| *phase -= turns);
    }
    Unwrapped { phases, doubtful }
}

/// Points outside of the set with the most anchors.
fn outside_of_largest(sets: &mut Sets, anchors: &[bool]) -> Vec<bool> {
    let roots: Vec<usize> = (0..anchors.len()).map(|p| sets.root(p)).collect();
    let mut counts = vec![0usize; anchors.len()];
    for (&root, &anchor) in roots.iter().zip(anchors) {
        counts[root] += usize::from(anchor);
    }
    let most = (0..counts.len()).max_by_key(|&root| (counts[root], std::cmp::Reverse(root)));
    roots.iter().map(|&root| Some(root) != most).collect()
}
