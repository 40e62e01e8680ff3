//! Maximisation of a merit over several parameters: grid search, refinement, peak width and error.

use std::collections::BTreeMap;

use subaperture_model::monitor::Monitor;

use crate::certainty;
use crate::trials::{Scan, Trials, TuneError, Views};

/// Interval of a parameter: `count` values from `start`, spaced by `step`.
pub use subaperture_model::geometry::Axis;

/// Order of the grid search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Every combination of values.
    #[default]
    Product,
    /// One parameter after another.
    InTurn,
}

/// Order and refinement of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Search {
    /// Order of the grid search.
    pub order: Order,
    /// Number of halvings of the step around the best values.
    pub refinements: usize,
}

/// Result of a parameter search.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// The best value of each parameter.
    pub best: Vec<f64>,
    /// Merit at the best values.
    pub merit: f64,
    /// Scan, error and verdict of each parameter.
    pub scans: Vec<Scan>,
    /// Merit of every combination, the last parameter fastest, if all were tried.
    pub grid: Option<Vec<f64>>,
    /// Best values without each part of the data, one row per part; empty if the merits are of all data only.
    pub without_parts: Vec<Vec<f64>>,
    /// Number of evaluations of the merit.
    pub evaluations: usize,
}

/// Search `intervals` for the values with the largest `merit`. A merit that is not finite counts as the smallest.
///
/// # Errors
/// [`TuneError`].
///
/// # Panics
/// If there are no intervals, or one is empty.
pub fn search<E, V: Into<Views>>(
    intervals: &[Axis],
    search: Search,
    monitor: &dyn Monitor,
    merit: impl FnMut(&[f64]) -> Result<V, E>,
) -> Result<Tuned, TuneError<E>> {
    search_from(intervals, search, None, monitor, merit)
}

/// [`search`] in turn, starting from `start` instead of the centres of the intervals.
pub(crate) fn search_from<E, V: Into<Views>>(
    intervals: &[Axis],
    search: Search,
    start: Option<&[f64]>,
    monitor: &dyn Monitor,
    merit: impl FnMut(&[f64]) -> Result<V, E>,
) -> Result<Tuned, TuneError<E>> {
    assert!(
        !intervals.is_empty() && intervals.iter().all(|axis| axis.count > 0),
        "nothing to search"
    );
    let mut trials = Trials {
        merit,
        known: BTreeMap::new(),
        monitor,
        expected: expected(intervals, search),
    };
    let (mut best, grid) = match search.order {
        Order::Product => trials.product(intervals)?,
        Order::InTurn => (trials.in_turn(intervals, start)?, None),
    };
    if best.1 == f64::NEG_INFINITY {
        return Err(TuneError::Nothing);
    }
    let mut steps: Vec<f64> = intervals.iter().map(|axis| axis.step).collect();
    for _ in 0..search.refinements {
        steps.iter_mut().for_each(|step| *step /= 2.0);
        best = trials.climb(intervals, &steps, best, 0)?;
    }
    if search.refinements > 0 {
        best = trials.vertex(intervals, &steps, best, 0)?;
    }
    let mut scans = (0..intervals.len())
        .map(|i| trials.scan(intervals, i, &best))
        .collect::<Result<Vec<_>, _>>()?;
    let without_parts = certainty::repeat(&mut trials, intervals, search.refinements)?;
    for (i, scan) in scans.iter_mut().enumerate() {
        let mut along = Vec::with_capacity(scan.points.len());
        for point in &scan.points {
            let mut values = best.0.clone();
            values[i] = point.0;
            along.push(trials.views(&values)?);
        }
        let found: Vec<f64> = without_parts.iter().map(|values| values[i]).collect();
        let best_views = trials.views(&best.0)?;
        let axis = &intervals[i];
        certainty::judge(
            axis,
            scan,
            best.0[i],
            &best_views,
            &along,
            &found,
            0.5 * steps[i],
        );
    }
    Ok(Tuned {
        best: best.0,
        merit: best.1,
        scans,
        grid,
        without_parts,
        evaluations: trials.known.len(),
    })
}

/// Approximate number of evaluations of a search: the refinement may need more, and evaluated merits are reused.
pub(crate) fn expected(intervals: &[Axis], search: Search) -> usize {
    let counts = intervals.iter().map(|axis| axis.count);
    let coarse = match search.order {
        Order::Product => counts.product(),
        Order::InTurn => 2 * counts.sum::<usize>(),
    };
    let neighbours = 3usize.pow(intervals.len() as u32) - 1;
    let scans: usize = intervals.iter().map(|axis| axis.count + 4).sum();
    coarse + search.refinements * neighbours + scans
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;
    use subaperture_model::monitor::Silent;

    fn axis(start: f64, step: f64, count: usize) -> Axis {
        Axis { start, step, count }
    }

    /// A peak of width 0.1 and 2 at (0.333, -1.27) over ripples of a third of its height.
    fn peak(values: &[f64]) -> Result<f64, Infallible> {
        let (x, y) = ((values[0] - 0.333) / 0.1, (values[1] + 1.27) / 2.0);
        let ripple = 0.3 * (9.0 * values[0]).sin() * (7.0 * values[1]).sin();
        Ok((-x * x - y * y).exp() + ripple * (1.0 - (-x * x - y * y).exp()))
    }

    #[test]
    fn both_search_orders_find_peak() {
        let intervals = [axis(0.0, 0.08, 13), axis(-3.0, 0.4, 16)];
        for order in [Order::Product, Order::InTurn] {
            let wanted = Search {
                order,
                refinements: 6,
            };
            let found = search(&intervals, wanted, &Silent, peak).unwrap();
            // The final steps are 0.00125 and 0.00625; the parabola improves on both.
            assert!((found.best[0] - 0.333).abs() < 1e-3, "{found:?}");
            assert!((found.best[1] + 1.27).abs() < 5e-3, "{found:?}");
            assert!(found.merit > 0.999);
            assert_eq!(found.grid.is_some(), order == Order::Product);
            assert!(!found.scans[0].at_end);
            // The width of a Gaussian at half its height above a median near 0 is 2 sqrt(ln 2) 0.1 = 0.167; ripples
            // and the coarse scan change that by a fifth.
            let width = found.scans[0].width.unwrap();
            assert!((0.13..0.2).contains(&width), "{width}");
        }
    }

    #[test]
    fn search_in_turn_costs_sum_of_counts() {
        let intervals = [axis(0.0, 0.01, 101), axis(-3.0, 0.05, 121)];
        let wanted = Search {
            order: Order::InTurn,
            refinements: 0,
        };
        let found = search(&intervals, wanted, &Silent, peak).unwrap();
        // Some rounds of 222 evaluations and the scans; all combinations would be 12221.
        assert!(found.evaluations < 5 * 222, "{}", found.evaluations);
    }

    #[test]
    fn parabola_vertex_is_exact_and_slope_ends_at_interval_end() {
        let wanted = Search {
            order: Order::Product,
            refinements: 1,
        };
        let vertex = |v: &[f64]| Ok::<_, Infallible>(-(v[0] - 0.1234).powi(2));
        let found = search(&[axis(-1.0, 0.3, 8)], wanted, &Silent, vertex).unwrap();
        // Exact except for rounding: differences of 1e-3 with rounding of 1e-16 over steps of 0.15.
        assert!((found.best[0] - 0.1234).abs() < 1e-12, "{found:?}");
        let slope = |v: &[f64]| Ok::<_, Infallible>(v[0]);
        let found = search(&[axis(-1.0, 0.3, 8)], wanted, &Silent, slope).unwrap();
        assert!(found.scans[0].at_end && found.scans[0].width.is_none());
        let dark = |_: &[f64]| Ok::<_, Infallible>(f64::NAN);
        let error = search(&[axis(0.0, 1.0, 3)], wanted, &Silent, dark).unwrap_err();
        assert!(matches!(error, TuneError::Nothing));
    }

    #[test]
    fn cancelled_search_stops() {
        struct Stop;
        impl Monitor for Stop {
            fn progress(&self, _fraction: f64) {}
            fn cancelled(&self) -> bool {
                true
            }
        }
        let wanted = Search {
            order: Order::Product,
            refinements: 0,
        };
        let error = search(&[axis(0.0, 1.0, 3)], wanted, &Stop, |_| {
            Ok::<_, Infallible>(0.0)
        });
        assert!(matches!(error, Err(TuneError::Cancelled)));
    }
}
