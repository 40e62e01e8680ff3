//! Times of the estimated states.
//!
//! States lie at measurements: within a run of increments at the nearest edge of one, from which velocity and rate of turn bridge the rest of the time (half an increment at most), elsewhere at the time of measurement. States also
//! lie at both ends of a run, and at least every [`LONGEST_S`] within one.

use std::ops::Range;

use super::Inputs;

/// Longest time over which increments are composed, seconds: their scale error is constant as long.
const LONGEST_S: f64 = 0.1;

/// Time below which states are merged, seconds.
const SAME_S: f64 = 1e-4;

/// Edge of an increment: its run, and the increment that begins there.
type Edge = (usize, usize);

/// States, and the measurements at and between them.
#[derive(Debug, PartialEq)]
pub(super) struct Timeline {
    /// Times, seconds of the radar's clock, ascending.
    pub(super) times_s: Vec<f64>,
    /// Increments from each state to the next, where they have no gap.
    pub(super) intervals: Vec<Option<Range<usize>>>,
    /// State of each position, and the time from the state to the position, seconds.
    pub(super) positions: Vec<(usize, f64)>,
    /// State of each inertial measurement, and the time from the state to it, seconds.
    pub(super) inertial: Vec<(usize, f64)>,
}

/// Runs of increments without gaps or outliers.
fn runs(inputs: &Inputs<'_>, doubted: &[usize]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut doubted = doubted.iter().peekable();
    for (n, one) in inputs.increments.iter().enumerate() {
        if doubted.next_if_eq(&&n).is_some() {
            continue;
        }
        let near = |last: &Range<usize>| {
            let before = &inputs.increments[last.end - 1];
            one.from_s - before.to_s <= 0.1 * (one.to_s - one.from_s)
        };
        match runs.last_mut() {
            Some(last) if last.end == n && near(last) => last.end = n + 1,
            _ => runs.push(n..n + 1),
        }
    }
    runs
}

impl Timeline {
    /// Timeline for clocks that are ahead of the radar's by `receiver_s` and `inertial_s`, without the increments in `doubted` (ascending indices).
    pub(super) fn new(
        inputs: &Inputs<'_>,
        doubted: &[usize],
        [receiver_s, inertial_s]: [f64; 2],
    ) -> Self {
        let increments = inputs.increments;
        let runs = runs(inputs, doubted);
        let edge_s = |(run, n): Edge| match n < runs[run].end {
            true => increments[n].from_s,
            false => increments[n - 1].to_s,
        };
        let mut wanted: Vec<(f64, Option<Edge>)> = Vec::new();
        for (number, run) in runs.iter().enumerate() {
            let mut last_s = f64::NEG_INFINITY;
            for (n, one) in (run.start..).zip(&increments[run.clone()]) {
                if n == run.start || one.to_s - last_s > LONGEST_S * (1.0 + 1e-9) {
                    wanted.push((one.from_s, Some((number, n))));
                    last_s = one.from_s;
                }
            }
            wanted.push((edge_s((number, run.end)), Some((number, run.end))));
        }
        let snapped = |time_s: f64| {
            let after = runs.partition_point(|run| increments[run.start].from_s <= time_s);
            let number = after.checked_sub(1)?;
            let run = runs[number].clone();
            if time_s > increments[run.end - 1].to_s {
                return None;
            }
            let within = increments[run.clone()].partition_point(|one| one.from_s <= time_s);
            let n = run.start + within.max(1) - 1;
            let edges = [(number, n), (number, n + 1)];
            let off = edges.map(|edge| (edge_s(edge) - time_s).abs());
            Some(edges[usize::from(off[1] < off[0])])
        };
        let positions = inputs.positions.iter().map(|one| one.time_s - receiver_s);
        let inertial = inputs.inertial.iter().map(|one| one.time_s - inertial_s);
        let measured: Vec<f64> = positions.chain(inertial).collect();
        wanted.extend(measured.iter().map(|&time_s| match snapped(time_s) {
            Some(edge) => (edge_s(edge), Some(edge)),
            None => (time_s, None),
        }));
        wanted.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let mut moments: Vec<(f64, Option<Edge>)> = Vec::new();
        for (time_s, edge) in wanted {
            match moments.last_mut() {
                Some(last) if last.1.is_some() && last.1 == edge => {}
                Some(last) if time_s - last.0 < SAME_S && (edge.is_none() || last.1.is_none()) => {
                    if let Some(edge) = edge {
                        *last = (time_s, Some(edge));
                    }
                }
                _ => moments.push((time_s, edge)),
            }
        }
        let intervals = moments.windows(2).map(|pair| match (pair[0].1, pair[1].1) {
            (Some((a, from)), Some((b, to))) if a == b => Some(from..to),
            _ => None,
        });
        let intervals = intervals.collect();
        let times_s: Vec<f64> = moments.iter().map(|&(time_s, _)| time_s).collect();
        let nearest = |&time_s: &f64| {
            let after = times_s
                .partition_point(|&t| t <= time_s)
                .min(times_s.len() - 1);
            let before = after.saturating_sub(1);
            let off = |n: usize| time_s - times_s[n];
            match off(before).abs() <= off(after).abs() {
                true => (before, off(before)),
                false => (after, off(after)),
            }
        };
        let (positions, inertial) = measured.split_at(inputs.positions.len());
        Self {
            intervals,
            positions: positions.iter().map(nearest).collect(),
            inertial: inertial.iter().map(nearest).collect(),
            times_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Increment, Inertial, Position};
    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn states_lie_at_increment_edges_and_else_at_measurements() {
        let step = |from_s: f64, to_s: f64| Increment {
            from_s,
            to_s,
            moved_m: [0.0; 2],
            turned_rad: 0.0,
            covariance: DMat3::IDENTITY,
        };
        // 0 to 0.04 s, and 1 to 1.25 s, a hundredth each.
        let increments: Vec<Increment> = (0..4)
            .chain(100..125)
            .map(|n| step(f64::from(n) / 100.0, f64::from(n + 1) / 100.0))
            .collect();
        let position = |time_s| Position {
            time_s,
            position_m: DVec3::ZERO,
            sigma_m: DVec3::ONE,
            velocity_m_s: None,
        };
        let inertial = |time_s| Inertial {
            time_s,
            position_m: None,
            velocity_m_s: None,
            heading_rad: None,
            roll_pitch_rad: [0.0; 2],
        };
        let inputs = Inputs {
            increments: &increments,
            // Half a second late.
            positions: &[position(0.513), position(1.0), position(1.537)],
            inertial: &[inertial(0.5), inertial(1.036)],
        };
        let timeline = Timeline::new(&inputs, &[], [0.5, 0.0]);
        let expected = [0.0, 0.01, 0.04, 0.5, 1.0, 1.04, 1.1, 1.2, 1.25];
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12;
        assert_eq!(timeline.times_s.len(), expected.len(), "{timeline:?}");
        assert!(
            timeline.times_s.iter().zip(&expected).all(near),
            "{timeline:?}"
        );
        assert_eq!(
            timeline.intervals,
            [
                Some(0..1),
                Some(1..4),
                None,
                None,
                Some(4..8),
                Some(8..14),
                Some(14..24),
                Some(24..29)
            ]
        );
        let at: Vec<usize> = timeline.positions.iter().map(|one| one.0).collect();
        assert_eq!(at, [1, 3, 5]);
        assert!((timeline.positions[0].1 - 0.003).abs() < 1e-12);
        assert!((timeline.positions[2].1 + 0.003).abs() < 1e-12);
        assert!((timeline.inertial[1].1 + 0.004).abs() < 1e-12);
        // An outlier ends a run, and the next run starts after it.
        let parted = Timeline::new(&inputs, &[10], [0.5, 0.0]);
        assert_eq!(parted.intervals[4..7], [Some(4..8), Some(8..10), None]);
        assert_eq!(parted.intervals[7], Some(11..21));
    }
}
